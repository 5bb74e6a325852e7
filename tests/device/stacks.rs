//! `slices-2d`: which stack is drawn, what a switch costs, and what lies on the device.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use crate::common::*;
use glam::{DMat3, DVec3};
use volraster::GpuScene;
use volraster::measure::ImageErrors;
use volraster::scene::{Camera, Field, Projection, Scene, TransferFunction, View};
use volraster::technique::Renderer;
use volraster::{Gpu, Plan, TargetDesc};

/// The standard distance, turned by an angle about y from the z axis.
fn turned(projection: Projection, degrees: f64, side: u32) -> View {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let camera =
        Camera { eye: DVec3::new(4.5 * sin, 0.4, 4.5 * cos), target: DVec3::ZERO, up: DVec3::Y, projection };
    View::new(camera, side, side).unwrap()
}

fn axis(plan: &Plan) -> u64 {
    plan.counters().iter().find(|counter| counter.0 == "stack_axis").unwrap().1
}

/// The stack whose planes face the viewer most; for an eye inside, the view's direction decides.
#[test]
fn the_stack_that_faces_the_viewer_is_drawn() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 12, "f32", &FOG));
    let renderer = Renderer::new(&scene, technique("slices-2d:"));
    let drawn = |eye: DVec3, target: DVec3, projection| {
        let up = if eye.x == 0.0 && eye.z == 0.0 { DVec3::X } else { DVec3::Y };
        let view = View::new(Camera { eye, target, up, projection }, 16, 16).unwrap();
        axis(&renderer.prepare(&view, &TargetDesc::own()).unwrap())
    };
    for projection in [perspective(), orthographic()] {
        for (i, along) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            for sign in [1.0, -1.0] {
                let skewed = along * sign * 4.0 + DVec3::new(0.3, -0.2, 0.1) * (DVec3::ONE - along);
                assert_eq!(drawn(skewed, DVec3::ZERO, projection), i as u64, "{projection:?} {skewed}");
            }
        }
    }
    // From outside, perspective goes by where the eye is, not by where it looks.
    assert_eq!(drawn(DVec3::new(0.2, 0.1, 3.0), DVec3::new(9.0, 0.0, 2.0), perspective()), 2);
    assert_eq!(drawn(DVec3::new(0.2, 0.1, 0.9), DVec3::new(9.0, 0.0, 0.8), perspective()), 0);
    // A stretched, sheared lattice: the planes' normals count, not the axes.
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.0, 1.0, 0.9), DVec3::Z);
    let grid = Field::Blobs.sample([12, 12, 12], "f32").unwrap();
    let grid = grid.with_placement(DVec3::splat(0.2), DVec3::splat(-1.0), shear).unwrap();
    let centre = grid.centre();
    let scene = Scene::new(grid, TransferFunction::from_rows(&FOG).unwrap());
    let scene = GpuScene::new(&gpu, scene);
    let renderer = Renderer::new(&scene, technique("slices-2d:"));
    // The y planes are spanned by x and z, the z planes by x and (0, 1, 0.9): normal (0, -0.9, 1).
    let camera = Camera {
        eye: centre + DVec3::new(0.0, -0.9, 1.0) * 4.0,
        target: centre,
        up: DVec3::X,
        projection: orthographic(),
    };
    let view = View::new(camera, 16, 16).unwrap();
    assert_eq!(axis(&renderer.prepare(&view, &TargetDesc::own()).unwrap()), 2);
}

/// Where two stacks face the viewer alike the picture jumps from one to the other: by the difference of their
/// errors, some 1e-2 at this spacing, and second order in it with blended slices. The same view drawn twice does
/// not jump.
#[test]
fn the_jump_between_stacks_is_measured() {
    let gpu = gpu();
    let scene = scene(Field::MarschnerLobb, 48, "f32", &SHELLS);
    let gpu_scene = GpuScene::new(&gpu, scene.clone());
    for projection in [perspective(), orthographic()] {
        let jump = |options: &str| {
            // One view, drawn from either stack: a plan with hysteresis keeps the one that it began with.
            let renderer = Renderer::new(
                &gpu_scene,
                technique(&format!("slices-2d:hysteresis=0.05,stacks=all,{options}")),
            );
            let view = turned(projection, 45.0, 96);
            let mut images = Vec::new();
            for begin in [40.0, 50.0] {
                let mut frames = renderer.frames(&turned(projection, begin, 96)).unwrap();
                frames.draw(&view).unwrap();
                images.push((axis(frames.plan()), frames.read_back().unwrap()));
            }
            assert_eq!((images[0].0, images[1].0), (2, 0), "hysteresis keeps the stack in use");
            let truth = truth(&scene, &view);
            let error = ImageErrors::between_f64(&images[0].1, &truth).unwrap().all.rmse;
            (ImageErrors::between(&images[0].1, &images[1].1).unwrap().all.rmse, error)
        };
        let (slices, slices_error) = jump("");
        let (half, half_error) = jump("step=0.5");
        let (quarter, _) = jump("step=0.25");
        println!(
            "{projection:?}: jump {slices:.2e} (error {slices_error:.2e}); step 0.5: {half:.2e} ({half_error:.2e}); step 0.25: {quarter:.2e}"
        );
        assert!(slices > 1e-3 && slices < 2.5 * slices_error, "{slices:e} {slices_error:e}");
        assert!(half < 0.5 * slices && quarter < 0.4 * half, "{slices:e} {half:e} {quarter:e}");
    }
}

/// Hysteresis holds a stack until another leads by so much, and then lets it go.
#[test]
fn hysteresis_holds_and_lets_go() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 12, "f32", &FOG));
    let switches = |options: &str| {
        let renderer = Renderer::new(&scene, technique(&format!("slices-2d:stacks=all,{options}")));
        let mut frames = renderer.frames(&turned(orthographic(), 44.0, 16)).unwrap();
        let mut axes = Vec::new();
        // To and fro around 45 degrees, then on.
        for degrees in [44.0, 45.5, 44.5, 46.0, 44.0, 52.0, 60.0] {
            frames.draw(&turned(orthographic(), degrees, 16)).unwrap();
            axes.push(axis(frames.plan()));
        }
        axes
    };
    assert_eq!(switches("hysteresis=0"), [2, 0, 2, 0, 2, 0, 0]);
    // sin 46 - cos 46 is 0.025, sin 52 - cos 52 is 0.17.
    assert_eq!(switches("hysteresis=0.1"), [2, 2, 2, 2, 2, 0, 0]);
}

fn stacks(gpu: &Gpu) -> Vec<(String, u64)> {
    let mut report = gpu.memory_report();
    report.retain(|(name, _)| name.starts_with("stack") || name == "volume");
    report.sort();
    report
}

/// Only the stack in use is uploaded, unless all are asked for; a turn to another one then needs no new plan.
#[test]
fn only_what_is_used_lies_on_the_device() {
    let gpu = gpu();
    let bytes = 20 * 21 * 22 * 4;
    let make = || {
        let grid = Field::Blobs.sample([20, 21, 22], "f32").unwrap();
        GpuScene::new(&gpu, Scene::new(grid, TransferFunction::from_rows(&FOG).unwrap()))
    };
    let (front, side) = (turned(orthographic(), 0.0, 16), turned(orthographic(), 90.0, 16));
    // Texels, and at most what alignment adds: lavapipe rounds a layer's rows up to 64 bytes and 4 rows, NVIDIA's driver layers up to 4 KiB.
    let check = |want: &[&str]| {
        let report = stacks(&gpu);
        assert_eq!(report.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), want);
        assert!(report.iter().all(|(_, size)| (bytes..3 * bytes).contains(size)), "{report:?}");
    };
    let scene = make();
    let renderer = Renderer::new(&scene, technique("slices-2d:"));
    let mut plan = renderer.prepare(&front, &TargetDesc::own()).unwrap();
    check(&["stack.z"]);
    assert!(!plan.set_view(&side).unwrap(), "the other stack is not there");
    assert_eq!(axis(&plan), 2);
    drop((plan, renderer, scene));
    check(&[]);

    let scene = make();
    let renderer = Renderer::new(&scene, technique("slices-2d:stacks=all"));
    let mut plan = renderer.prepare(&front, &TargetDesc::own()).unwrap();
    check(&["stack.x", "stack.y", "stack.z"]);
    assert!(plan.set_view(&side).unwrap());
    assert_eq!(axis(&plan), 0);
    // And it draws what a plan for that view draws.
    let mut frames = renderer.frames(&front).unwrap();
    frames.draw(&side).unwrap();
    assert_eq!(frames.read_back().unwrap(), renderer.render(&side).unwrap());
}

/// More slices than the device has array layers are refused with both numbers.
#[test]
fn too_many_slices_are_refused() {
    let gpu = gpu();
    let grid = Field::Ramp.sample([2, 2, 4097], "f32").unwrap();
    let scene = Scene::new(grid, TransferFunction::from_rows(&FOG).unwrap());
    let result = Renderer::new(&GpuScene::new(&gpu, scene), technique("slices-2d:"))
        .prepare(&turned(orthographic(), 0.0, 16), &TargetDesc::own());
    match result {
        Ok(_) => println!("skipped: the device has more than 4096 array layers"),
        Err(error) => {
            let message = error.to_string();
            assert!(message.contains("4097") && message.contains("layers"), "{message}");
            assert_eq!(error.exit_code(), 3);
        }
    }
}
