//! Kernels in parts: images to the bit of those of all kernels, whatever reaches several parts, and however small the device.

#![allow(unsafe_code, reason = "plays the caller, who owns Vulkan objects")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, reason = "small numbers of test images")]

use std::sync::Arc;

use glam::DVec3;
use volraster::ash::vk;
use volraster::gpu::GpuOptions;
use volraster::scene::{Kernel, KernelSize, Model, Scene, Surface, TransferFunction, View};
use volraster::technique::Renderer;
use volraster::{Error, GpuScene, Image, Plan, TargetDesc, TargetMode};

use crate::common::caller::Caller;
use crate::common::*;
use crate::splats::{SMOOTH, cloud, covariances, scenes, with};

/// The image of a frame, and its counters.
struct Drawn {
    image: Image,
    counters: Vec<(&'static str, u64)>,
}

impl Drawn {
    fn new(scene: &Arc<GpuScene>, view: &View, spec: &str) -> Self {
        let mut frames = Renderer::new(scene, technique(spec)).frames(view).unwrap();
        let time = frames.draw(view).unwrap();
        let counters = frames.plan().counters().into_iter().chain(time.counters).collect();
        Self { image: frames.read_back().unwrap(), counters }
    }

    /// Returns a counter; 0 where there is none.
    fn counter(&self, name: &str) -> u64 {
        self.counters.iter().find(|(key, _)| *key == name).map_or(0, |(_, n)| *n)
    }
}

/// Many kernels, of which each reaches few rows of tiles, and fewer where they are smaller.
fn small_kernels(n: usize, scale: f32) -> [(&'static str, Scene); 3] {
    let mut next = random(11);
    let sizes: Vec<f32> = (0..n).map(|_| scale * (0.05 + 0.04 * next()) as f32).collect();
    let KernelSize::Covariances(wide) = covariances(n) else { panic!("covariances") };
    let narrow = wide.into_iter().map(|all| all.map(|x| x * (0.1 * scale).powi(2))).collect();
    let scene = |size| {
        let transfer = TransferFunction::from_rows(&SMOOTH.map(|[s, r, g, b, tau]| [s, r, g, b, 4.0 * tau]));
        Scene::new(cloud(n, 4).with_size(size).unwrap(), transfer.unwrap())
    };
    let ball = Surface::sphere(DVec3::new(0.2, 0.1, 0.3), 0.4, [0.9, 0.5, 0.2, 1.0], 3).unwrap();
    [
        ("radii", with(scene(KernelSize::Radii(sizes.clone())), Kernel::Gaussian, Model::Density)),
        ("covariances", with(scene(KernelSize::Covariances(narrow)), Kernel::Gaussian, Model::Density)),
        ("surfaces", scene(KernelSize::Radii(sizes)).with_surfaces(vec![ball])),
    ]
}

fn views() -> [View; 4] {
    // Of the last, nothing is above and below the kernels.
    [
        view(perspective(), 1.0, 50, 90),
        view(orthographic(), 1.0, 61, 70),
        view(perspective(), 0.15, 44, 75),
        view(perspective(), 2.0, 40, 120),
    ]
}

const SPECS: [&str; 7] = [
    "splat-ewa:order=center",
    "splat-ewa:order=pixel",
    "splat-ewa:order=center,footprint=ewa",
    "splat-ewa:order=center,footprint=ewa,variance=30",
    "splat-ewa:order=slabs,step=2",
    "splat-sheets:sheets=image,step=2",
    "splat-sheets:sheets=axis",
];

/// Each part draws its rows with all kernels that reach them, in their own order.
#[test]
fn parts_give_the_image_of_all_kernels() {
    let gpu = gpu();
    let mut with_fewer = 0;
    for (name, scene) in small_kernels(3000, 1.0) {
        let on_gpu = GpuScene::new(&gpu, scene);
        for (i, view) in views().into_iter().enumerate() {
            for spec in taken_from(i, 4, SPECS) {
                let whole = Drawn::new(&on_gpu, &view, &format!("{spec},parts=1"));
                for more in taken(2, ["parts=2", "parts=5", "parts=3,pairs=3000", "parts=4,spread=pixels"]) {
                    let drawn = Drawn::new(&on_gpu, &view, &format!("{spec},{more}"));
                    let what = format!("{name}, {spec}, {more}, eye {}", view.camera().eye);
                    // Wide footprints may all reach one row of tiles, which is no less than a part.
                    let several = drawn.counter("parts") > 1 || spec.contains("variance");
                    assert!(several, "{what}: {:?}", drawn.counters);
                    if more.contains("spread") {
                        let whole = draw_on(&on_gpu, &view, &format!("{spec},spread=pixels"));
                        assert_eq!(drawn.image, whole, "{what}");
                    } else {
                        assert_eq!(drawn.image, whole.image, "{what}");
                    }
                    assert_eq!(drawn.counter("pairs"), whole.counter("pairs"), "{what}");
                    with_fewer += u64::from(drawn.counter("bands") > drawn.counter("parts"));
                }
            }
        }
    }
    assert!(with_fewer > 0, "no part was drawn in several bands");
}

/// So do kernels of grids and of vertices, of every shape, which reach many rows.
#[test]
fn every_kind_of_kernel_is_drawn_in_parts() {
    let gpu = gpu();
    for (place, (name, scene, gaussian)) in scenes().into_iter().enumerate() {
        let on_gpu = GpuScene::new(&gpu, scene);
        for view in taken_from(place, 4, views()) {
            let interpolates = name.contains("interpolate");
            let draws = |spec: &&str| {
                !spec.starts_with("splat-ewa") || gaussian && (!interpolates || spec.contains("slabs"))
            };
            let mesh = name.starts_with("mesh");
            for spec in SPECS.into_iter().filter(draws).filter(|spec| !mesh || spec.starts_with("splat-ewa"))
            {
                let [whole, parts] = [1, 4].map(|n| Drawn::new(&on_gpu, &view, &format!("{spec},parts={n}")));
                assert!(parts.counter("parts") > 0, "{name}, {spec}");
                assert_eq!(parts.image, whole.image, "{name}, {spec}, eye {}", view.camera().eye);
            }
        }
    }
}

/// Frames of other views have other parts, and what is left of a frame that is given up shows in none.
#[test]
fn views_change_the_parts() {
    let gpu = gpu();
    for (name, scene) in small_kernels(2000, 1.0) {
        let on_gpu = GpuScene::new(&gpu, scene);
        let turned = |distance| view(perspective(), distance, 50, 90);
        let views = [turned(1.0), turned(1.1), turned(0.8), turned(3.0), turned(0.2), turned(1.0)];
        let mut frames = Renderer::new(&on_gpu, technique("splat-ewa:parts=6")).frames(&views[0]).unwrap();
        for view in views {
            assert!(frames.draw_part(&view).unwrap().is_none());
            assert!(frames.read_back().is_err());
            frames.draw(&view).unwrap();
            assert_eq!(frames.read_back().unwrap(), draw_on(&on_gpu, &view, "splat-ewa:parts=1"), "{name}");
            frames.draw(&view).unwrap();
            assert_eq!(frames.read_back().unwrap(), draw_on(&on_gpu, &view, "splat-ewa:parts=1"), "{name}");
        }
    }
}

/// In an engine's frames, a recording that is given up, and one of another view, begin anew.
#[test]
fn recordings_go_on_or_begin_anew() {
    let gpu = gpu();
    let [(_, scene), ..] = small_kernels(2000, 1.0);
    let on_gpu = GpuScene::new(&gpu, scene);
    let views = [view(perspective(), 1.0, 50, 90), view(perspective(), 1.1, 50, 90)];
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let target = TargetDesc::caller(format, TargetMode::Clear);
    let mut plan =
        Renderer::new(&on_gpu, technique("splat-ewa:parts=4")).prepare(&views[0], &target).unwrap();
    assert!(!plan.load().unwrap());
    let caller = Caller::new(&gpu, format, [50, 90], 16);
    let record = |plan: &mut Plan| {
        caller.begin([0.0; 4]);
        plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap()
    };
    for given_up in ["nothing", "the same view", "a recording", "a view in flight", "a view"] {
        let mut drawn = 0;
        let bytes = loop {
            let recorded = record(&mut plan);
            let bytes = caller.end(&gpu);
            drawn += 1;
            let turns = given_up == "a view in flight" && drawn == 2;
            if turns {
                assert!(plan.set_view(&views[1]).unwrap());
            }
            if recorded.completed().unwrap().complete {
                break bytes;
            }
            assert!(plan.load().unwrap());
            if given_up == "nothing" && drawn == 1 {
                // What is not drawn yet is transparent.
                let whole = draw_on(&on_gpu, &views[0], "splat-ewa:parts=1");
                let shown: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
                let missing = |(shown, whole): &(&[f32; 4], &[f32; 4])| shown != whole;
                let missing: Vec<_> = shown.iter().zip(whole.pixels()).filter(missing).collect();
                assert!(missing.len() > 500 && missing.iter().all(|(shown, _)| **shown == [0.0; 4]));
            }
            if given_up == "a recording" && drawn == 2 {
                let recorded = record(&mut plan);
                // SAFETY: recording.
                unsafe { caller.device.end_command_buffer(caller.commands) }.unwrap();
                recorded.discarded();
                assert!(!plan.load().unwrap());
            }
            if given_up == "the same view" {
                assert!(plan.set_view(&views[0]).unwrap());
            }
            if given_up == "a view" && drawn == 2 {
                assert!(plan.set_view(&views[1]).unwrap());
                assert!(!plan.load().unwrap());
            }
        };
        let parts = plan.counters().iter().find(|(name, _)| *name == "parts").unwrap().1;
        let twice = given_up.starts_with("a ");
        assert_eq!(drawn, if twice { parts + 2 } else { parts }, "{given_up}");
        let turned = given_up.starts_with("a view");
        let view = &views[usize::from(turned)];
        if turned {
            assert!(plan.set_view(&views[0]).unwrap());
        }
        let numbers: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
        assert_eq!(numbers, draw_on(&on_gpu, view, "splat-ewa:parts=1").pixels(), "{given_up}");
    }
}

/// A device without room for all points draws them in parts of its own accord; one part lacks memory.
#[test]
fn a_small_budget_makes_parts() {
    let [(_, scene), (_, shapes), _] = small_kernels(200_000, 0.3);
    let view = view(perspective(), 1.0, 64, 400);
    for (scene, spec) in [(&scene, "splat-ewa"), (&shapes, "splat-ewa"), (&scene, "splat-sheets:step=8")] {
        let whole = draw_on(&GpuScene::new(&gpu(), scene.clone()), &view, spec);
        let gpu = gpu_with(GpuOptions { memory_budget: Some(16 << 20), ..GpuOptions::default() });
        let on_gpu = GpuScene::new(&gpu, scene.clone());
        let drawn = Drawn::new(&on_gpu, &view, spec);
        assert!(drawn.counter("parts") > 1, "{spec}");
        assert_eq!(drawn.image, whole, "{spec}");
        let error =
            Renderer::new(&on_gpu, technique(&with_option(spec, "parts", "1"))).render(&view).unwrap_err();
        assert!(matches!(error, Error::Memory { .. }), "{error}");
    }
}
