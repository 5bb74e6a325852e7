//! Vulkan calls that fail, and devices that are lost: what is told, what stays behind, what can be done afterwards.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    dead_code,
    unreachable_pub,
    reason = "a test fails by panicking; it shares a file with the program, which uses all of it"
)]

#[path = "../src/cli/commands/selftest/session/mod.rs"]
mod session;

use session::{Place, Session, Swept};
use volraster::gpu::Validation;

/// The layer keeps its devices in a table without a lock: tests with devices take turns.
static TURN: std::sync::Mutex<()> = std::sync::Mutex::new(());

fn turn() -> std::sync::MutexGuard<'static, ()> {
    TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn place() -> Place {
    Place { validation: Validation::On, ..Place::default() }
}

fn named(name: &str) -> Session {
    session::sessions().unwrap().into_iter().find(|session| session.name == name).unwrap()
}

fn report(name: &str, swept: &Swept) {
    println!("{name}: {} calls, failed {:?}, harmless {}", swept.calls, swept.failed, swept.harmless);
}

fn fail_each(name: &str, most: usize) {
    let _turn = turn();
    let swept =
        session::fail_each(&place(), &named(name), most).unwrap_or_else(|finding| panic!("{finding}"));
    report(name, &swept);
    for call in
        ["vkCreateBuffer", "vkQueueSubmit2", "vkWaitForFences", "vkResetFences", "vkAllocateDescriptorSets"]
    {
        assert!(swept.failed.contains_key(call), "{call} of {:?}", swept.failed);
    }
}

fn fail_frames(name: &str) {
    let _turn = turn();
    let swept = session::fail_frames(&place(), &named(name), usize::MAX)
        .unwrap_or_else(|finding| panic!("{finding}"));
    report(name, &swept);
    for call in ["vkBeginCommandBuffer", "vkQueueSubmit2", "vkWaitForFences", "vkCreateBuffer"] {
        assert!(swept.failed.contains_key(call), "{call} of {:?}", swept.failed);
    }
}

fn fail_opening(name: &str, most: usize) {
    let _turn = turn();
    let swept =
        session::fail_opening(&place(), &named(name), most).unwrap_or_else(|finding| panic!("{finding}"));
    report(name, &swept);
    for call in ["vkCreateInstance", "vkCreateDevice", "vkCreatePipelineCache", "vkDeviceWaitIdle"] {
        assert!(swept.failed.contains_key(call), "{call} of {:?}", swept.failed);
    }
}

fn lose(name: &str) {
    let _turn = turn();
    let swept = session::lose(&place(), &named(name), 2).unwrap_or_else(|finding| panic!("{finding}"));
    report(name, &swept);
    for call in ["vkQueueSubmit2", "vkWaitForFences"] {
        assert!(swept.failed.contains_key(call), "{call} of {:?}", swept.failed);
    }
}

/// Tests of a session. Those in the first brackets are in `make test`, the others in `make test-all`.
macro_rules! sweeps {
    ($($name:ident $session:literal [$($quick:ident)*] [$($all:ident)*];)*) => {$(
        mod $name {
            $(sweeps! { @$quick $session })*
            $(sweeps! { @$all $session #[ignore = "make test-all"] })*

            #[test]
            #[ignore = "takes minutes: all calls, of which each_call_may_fail takes some of each name"]
            fn measure_every_call() {
                super::fail_each($session, usize::MAX);
            }
        }
    )*};
    (@each_call $session:literal $(#[$attribute:meta])*) => {
        #[test]
        $(#[$attribute])*
        fn each_call_may_fail() {
            super::fail_each($session, 4);
        }
    };
    (@frames $session:literal $(#[$attribute:meta])*) => {
        #[test]
        $(#[$attribute])*
        fn each_call_of_a_frame_may_fail() {
            super::fail_frames($session);
        }
    };
    (@lost $session:literal $(#[$attribute:meta])*) => {
        #[test]
        $(#[$attribute])*
        fn a_device_may_be_lost() {
            super::lose($session);
        }
    };
}

sweeps! {
    grid_raster "grid-raster" [each_call] [frames lost];
    grid_compute "grid-compute" [] [each_call frames lost];
    grid_warp "grid-warp" [frames] [each_call lost];
    mesh_lists "mesh-lists" [lost] [each_call frames];
    mesh_raster "mesh-raster" [each_call] [frames lost];
    points_ellipses "points-ellipses" [frames] [each_call lost];
    points_sheets "points-sheets" [each_call] [frames lost];
    grid_cut "grid-cut" [lost] [each_call frames];
    mesh_cut "mesh-cut" [] [each_call frames lost];
}

#[test]
fn each_call_of_a_fresh_device_may_fail_by_raster() {
    fail_opening("grid-raster", 1);
}

#[test]
#[ignore = "make test-all"]
fn each_call_of_a_fresh_device_may_fail_by_compute() {
    fail_opening("mesh-lists", 3);
}
