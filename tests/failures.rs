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
    Place { device: None, validation: Validation::On }
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

macro_rules! sweeps {
    ($($name:ident $session:literal;)*) => {$(
        mod $name {
            #[test]
            fn each_call_may_fail() {
                super::fail_each($session, 4);
            }

            #[test]
            fn each_call_of_a_frame_may_fail() {
                super::fail_frames($session);
            }

            #[test]
            #[ignore = "takes minutes: all calls, of which the test above takes some of each name"]
            fn every_call_may_fail() {
                super::fail_each($session, usize::MAX);
            }

            #[test]
            fn a_device_may_be_lost() {
                super::lose($session);
            }
        }
    )*};
}

sweeps! {
    grid_raster "grid-raster";
    grid_compute "grid-compute";
    grid_warp "grid-warp";
    mesh_lists "mesh-lists";
    mesh_raster "mesh-raster";
    points_ellipses "points-ellipses";
    points_sheets "points-sheets";
    grid_cut "grid-cut";
    mesh_cut "mesh-cut";
}

#[test]
fn each_call_of_a_fresh_device_may_fail_by_raster() {
    fail_opening("grid-raster", 9);
}

#[test]
fn each_call_of_a_fresh_device_may_fail_by_compute() {
    fail_opening("mesh-lists", 3);
}
