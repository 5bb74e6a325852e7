//! Threads that share a device: what may go from one to another, and what they draw at the same time.

#![allow(unsafe_code, reason = "plays the caller, who owns Vulkan objects")]
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_precision_loss,
    reason = "a test fails by panicking, and makes its own numbers"
)]

use std::sync::{Arc, Barrier};

use crate::common::caller::{Caller, Signal};
use crate::common::*;
use glam::{DMat3, DVec3};
use volraster::Status;
use volraster::ash::vk;
use volraster::gpu::{
    CommandBuffer, DepthImage, DepthProjection, DeviceReport, Enabled, GpuOptions, GpuParts, Handles,
    PassTime, QueueLock, TargetImage, ValidationLog,
};
use volraster::scene::{Grid, Samples, Scene, TransferFunction, View};
use volraster::technique::{FrameTime, Frames, Method};
use volraster::{Error, Gpu, GpuScene, Image, Plan, Recorded, Renderer, TargetDesc, TargetMode, Technique};

fn shared<T: Send + Sync>() {}

/// Compiles, or does not.
#[test]
fn everything_goes_between_threads() {
    shared::<Gpu>();
    shared::<GpuOptions>();
    shared::<GpuParts>();
    shared::<Enabled>();
    shared::<Arc<dyn QueueLock>>();
    shared::<Handles>();
    shared::<DeviceReport>();
    shared::<ValidationLog>();
    shared::<volraster::scene::Scene>();
    shared::<View>();
    shared::<GpuScene>();
    shared::<Technique>();
    shared::<Method>();
    shared::<Renderer>();
    shared::<TargetDesc>();
    shared::<Plan>();
    shared::<CommandBuffer>();
    shared::<TargetImage>();
    shared::<DepthImage>();
    shared::<DepthProjection>();
    shared::<Recorded>();
    shared::<Status>();
    shared::<PassTime>();
    shared::<Frames>();
    shared::<FrameTime>();
    shared::<Image>();
    shared::<Error>();
}

/// Runs the test `name` in a process in which the validation layer has one lock for its own records. The layer 1.3.239 has
/// one for each otherwise, and crashes now and then while two threads destroy a command pool each. What it checks of threads
/// is the same in both modes. `false` in the process that only waits for the other.
fn alone(name: &str) -> bool {
    const ONE_LOCK: &str = "VK_LAYER_FINE_GRAINED_LOCKING";
    if std::env::var_os(ONE_LOCK).is_some() {
        return true;
    }
    let mut test = std::process::Command::new(std::env::current_exe().unwrap());
    let output = test
        .args(["--exact", &format!("threads::{name}"), "--nocapture"])
        .env(ONE_LOCK, "0")
        .output()
        .unwrap();
    let text = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    let passed = output.status.success() && text[0].contains("1 passed");
    // The status names the signal that ended the process, if one did.
    assert!(passed, "{name} in a process of its own: {}\n{}{}", output.status, text[0], text[1]);
    false
}

const SIZE: [u32; 2] = [40, 30];
const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;
const FRAMES: usize = 5;

/// A frame in flight.
struct Slot {
    plan: Plan,
    caller: Caller,
    pending: Option<(usize, Recorded)>,
}

/// Draws the views with two frames in flight, and gives their bytes. What lacked room is drawn again.
fn draw_all(gpu: &Gpu, scene: &Arc<GpuScene>, spec: &str, views: &[View]) -> Vec<Vec<u8>> {
    let renderer = Renderer::new(scene, technique(spec));
    let target = TargetDesc::caller(FORMAT, TargetMode::Over);
    let mut images = vec![Vec::new(); views.len()];
    let mut slots: Vec<Slot> = (0..2)
        .map(|_| Slot {
            plan: renderer.prepare(&views[0], &target).unwrap(),
            caller: Caller::new(gpu, FORMAT, SIZE, 16),
            pending: None,
        })
        .collect();
    let record = |slot: &mut Slot, frame: usize| {
        let Slot { plan, caller, .. } = slot;
        if !plan.set_view(&views[frame]).unwrap() {
            *plan = renderer.prepare(&views[frame], &target).unwrap();
        }
        caller.begin([0.25, 0.5, 0.0, 1.0]);
        let recorded = plan.record(&mut caller.command_buffer(gpu), Some(&caller.target(gpu)), None).unwrap();
        caller.submit(gpu, Signal::Fence);
        slot.pending = Some((frame, recorded));
    };
    let mut finish = |slot: &mut Slot| {
        for _ in 0..9 {
            let Some((frame, recorded)) = slot.pending.take() else { return };
            slot.caller.wait();
            if recorded.completed().unwrap().complete {
                images[frame] = slot.caller.read();
                return;
            }
            slot.plan = renderer.prepare(&views[frame], &target).unwrap();
            record(slot, frame);
        }
        panic!("{spec}: no room in nine frames");
    };
    for frame in 0..views.len() {
        let slot = &mut slots[frame % 2];
        finish(slot);
        record(slot, frame);
    }
    slots.iter_mut().for_each(finish);
    images
}

fn views(around: f64) -> Vec<View> {
    let view = |i| {
        let camera = camera(perspective(), 1.0).orbit(around + 7.0 * f64::from(i)).unwrap();
        View::new(camera, SIZE[0], SIZE[1]).unwrap()
    };
    (0_u8..).take(FRAMES).map(view).collect()
}

/// Two threads with two frames in flight each, on one device: first one volume each, then one between them. Everything is
/// new to the device, so that uploads and pipelines are made at the same time, too. The pictures are those of one thread.
#[test]
fn threads_draw_on_one_device_as_one_does() {
    if !alone("threads_draw_on_one_device_as_one_does") {
        return;
    }
    let gpu = fresh_gpu();
    let gpu: &Gpu = &gpu;
    let views = [views(0.0), views(100.0)];
    let draw_both = |scenes: [&Arc<GpuScene>; 2], spec: &str| -> Vec<Vec<Vec<u8>>> {
        let start = Barrier::new(2);
        std::thread::scope(|scope| {
            let threads: Vec<_> = scenes
                .into_iter()
                .zip(&views)
                .map(|(scene, views)| {
                    let start = &start;
                    scope.spawn(move || {
                        start.wait();
                        draw_all(gpu, scene, spec, views)
                    })
                })
                .collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        })
    };
    let (ours, theirs, alone) = (every_kind(gpu), every_kind(gpu), every_kind(gpu));
    let mut routes = 0;
    for ((ours, specs), ((theirs, _), (alone, _))) in ours.iter().zip(theirs.iter().zip(&alone)) {
        for spec in specs {
            let apart = draw_both([ours, theirs], spec);
            let together = draw_both([ours, ours], spec);
            let want: Vec<_> = views.iter().map(|views| draw_all(gpu, alone, spec, views)).collect();
            let background: Vec<u8> =
                [0.25_f32, 0.5, 0.0, 1.0].iter().flat_map(|c| c.to_ne_bytes()).collect();
            for (thread, want) in want.iter().enumerate() {
                assert!(want[0] != want[1] && want[0].chunks_exact(16).any(|p| p != background), "{spec}");
                for frame in 0..FRAMES {
                    assert!(apart[thread][frame] == want[frame], "{spec}: thread {thread}, frame {frame}");
                    assert!(together[thread][frame] == want[frame], "{spec}: one volume, {thread}, {frame}");
                }
            }
            routes += 1;
        }
    }
    assert!(routes >= if exhaustive() { 14 } else { 7 }, "{routes}");
}

/// Frames that wait by themselves, of three threads: the crate's own submissions take turns.
#[test]
fn threads_wait_for_their_own_frames() {
    if !alone("threads_wait_for_their_own_frames") {
        return;
    }
    let gpu = gpu();
    let gpu: &Gpu = &gpu;
    let scenes = every_kind(gpu);
    let draw = |scene: &Arc<GpuScene>, spec: &str| -> Vec<Image> {
        let views = views(20.0);
        let mut frames = Renderer::new(scene, technique(spec)).frames(&views[0]).unwrap();
        let draw = |view| {
            frames.draw(view).unwrap();
            frames.read_back().unwrap()
        };
        views.iter().map(draw).collect()
    };
    let drawn: Vec<Vec<Image>> = std::thread::scope(|scope| {
        let draw = &draw;
        let threads: Vec<_> =
            scenes.iter().map(|(scene, specs)| scope.spawn(move || draw(scene, &specs[0]))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    for ((scene, specs), drawn) in scenes.iter().zip(drawn) {
        assert!(drawn == draw(scene, &specs[0]), "{}", specs[0]);
    }
}

/// A time series: while one thread draws frames of the last step, another uploads the next, plane by plane, and prepares
/// what draws it. No frame is anything but one of the two, and what was prepared beside others is what is prepared alone.
#[test]
fn values_change_while_frames_go_on() {
    if !alone("values_change_while_frames_go_on") {
        return;
    }
    let options = GpuOptions { staging_bytes: Some(1), ..GpuOptions::default() };
    let gpu = gpu_with(options);
    let gpu: &Gpu = &gpu;
    let view = views(0.0)[0];
    let step = |i: u8| {
        let samples = (0..24_u32.pow(3)).map(|n| (n as f32 * 0.01 * f32::from(i + 1)).sin().abs());
        Samples::F32(samples.collect())
    };
    let grid = Grid::new([24; 3], step(0)).unwrap();
    let grid = grid.with_placement(DVec3::splat(2.0 / 23.0), DVec3::splat(-1.0), DMat3::IDENTITY).unwrap();
    let first = GpuScene::new(gpu, Scene::new(grid.clone(), TransferFunction::from_rows(&FOG).unwrap()));
    for spec in ["slabs", "shear-warp", "splat-sheets:sheets=image"] {
        let draw = |scene: &Arc<GpuScene>| Renderer::new(scene, technique(spec)).render(&view).unwrap();
        let mut scene = Arc::clone(&first);
        let mut frames = Renderer::new(&scene, technique(spec)).frames(&view).unwrap();
        let pipelines = |gpu: &Gpu| gpu.pipelines().len();
        let mut drawn = draw(&scene);
        let built = pipelines(gpu);
        for i in 1..4 {
            let next = scene.with_samples(step(i)).unwrap();
            let prepared = std::thread::scope(|scope| {
                let worker = scope.spawn(|| {
                    let mut frames = Renderer::new(&next, technique(spec)).frames(&view).unwrap();
                    frames.draw(&view).unwrap();
                    frames
                });
                while !worker.is_finished() {
                    frames.draw(&view).unwrap();
                    assert!(frames.read_back().unwrap() == drawn, "{spec}: step {i}");
                }
                worker.join().unwrap()
            });
            (frames, scene) = (prepared, next);
            frames.draw(&view).unwrap();
            let now = frames.read_back().unwrap();
            assert!(now != drawn, "{spec}: step {i} is the one before");
            // Every step reads the first one's.
            let held = gpu.memory_report();
            let transfers = held.iter().filter(|(name, _)| name == "transfer.knots").count();
            assert_eq!(transfers, 1, "{spec}: step {i}: {held:?}");
            let alone = grid.with_samples(step(i)).unwrap();
            let alone = GpuScene::new(gpu, Scene::new(alone, TransferFunction::from_rows(&FOG).unwrap()));
            assert!(now == draw(&alone), "{spec}: step {i}");
            drawn = now;
        }
        assert_eq!(pipelines(gpu), built, "{spec}: nothing is built anew");
    }
    let short = first.with_samples(Samples::F32(vec![0.0; 7])).unwrap_err().to_string();
    assert!(short.contains("13824"), "{short}");
}
