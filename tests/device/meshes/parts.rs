//! Meshes in parts: images to the bit of those of the whole, whatever comes out of order, overlaps or lies in front.

#![allow(unsafe_code, reason = "plays the caller, who owns Vulkan objects")]

use glam::DVec3;
use volraster::ash::vk;
use volraster::gpu::GpuOptions;
use volraster::scene::{Camera, Field, Projection, Scene, Surface, TetScalars, Tets, View};
use volraster::technique::Renderer;
use volraster::{Error, GpuScene, Plan, TargetDesc, TargetMode};

use crate::common::caller::Caller;
use crate::common::*;
use crate::meshes::support::*;

/// The same mesh with a scalar for each cell.
fn of_cells(mesh: &Tets) -> Tets {
    let values: Vec<f32> = (0..mesh.cells().len()).map(|i| (i * 37 % 101) as f32 / 100.0).collect();
    mesh.clone().with_scalars(TetScalars::Cell(values)).unwrap()
}

/// Two meshes in one place.
fn overlapping() -> Tets {
    both(&Field::Blobs.tets(4).unwrap(), &moved(&Field::Ramp.tets(3).unwrap(), |p| p * 0.7 + 0.11))
}

fn scenes() -> Vec<(&'static str, Scene, [View; 2])> {
    let near = [view(perspective(), 1.0, 37, 29), view(perspective(), 0.1, 37, 29)];
    let blobs = Field::Blobs.tets(6).unwrap();
    let glass = |i: u8| Surface::sphere(DVec3::ZERO, f64::from(i) * 0.11, [0.9, 0.5, 0.2, 0.2], 2).unwrap();
    let scene = |mesh: &Tets| Scene::new(mesh.clone(), transfer(&FOG));
    vec![
        ("cubes", Scene::new(blobs.clone(), transfer(&SHELLS)), near),
        ("needles", scene(&needles(4)), [needles_view(26, 19), view(orthographic(), 1.0, 26, 19)]),
        ("scalars of cells", scene(&of_cells(&blobs)), near),
        ("overlapping cells", scene(&overlapping()), near),
        ("overlapping, scalars of cells", scene(&of_cells(&overlapping())), near),
        ("surfaces", scene(&blobs).with_surfaces((1..=6).map(glass).collect()), near),
    ]
}

/// What a part leaves in the k-buffer is what the next one finds.
#[test]
fn parts_give_the_image_of_the_whole() {
    let gpu = gpu();
    let (mut unsorted, mut overlapping) = (0, 0);
    for (name, scene, views) in scenes() {
        let on_gpu = GpuScene::new(&gpu, scene);
        for view in views {
            for more in taken(3, ["k=1", "k=7", "k=8", "k=2,chunk=7", "k=15", "stop=0.05"]) {
                let whole = Drawn::new(&on_gpu, &view, &format!("havs:parts=1,{more}"));
                for parts in taken(2, [3, 8]) {
                    let drawn = Drawn::new(&on_gpu, &view, &format!("havs:parts={parts},{more}"));
                    let what = format!("{name}, eye {}, {more}, parts {parts}", view.camera().eye);
                    assert_eq!(drawn.counter("parts"), parts, "{what}");
                    assert_eq!(drawn.image, whole.image, "{what}");
                    unsorted += drawn.counter("kbuffer_overflow_pixels");
                    overlapping += drawn.counter("overlap_pixels");
                }
            }
        }
    }
    assert!(unsorted > 100 && overlapping > 100, "{unsorted} unsorted, {overlapping} overlapping");
}

/// Back to front, pairs of one depth leave in the other order, which rounds otherwise.
#[test]
fn parts_back_to_front() {
    let gpu = gpu();
    for (name, scene, views) in scenes().into_iter().filter(|(name, ..)| *name != "surfaces") {
        let on_gpu = GpuScene::new(&gpu, scene);
        for view in views {
            let [whole, parts] = [1, 7]
                .map(|n| Drawn::new(&on_gpu, &view, &format!("havs:k=7,order=back-to-front,parts={n}")));
            assert_eq!(parts.image, whole.image, "{name}");
            // Parts come from behind, too.
            let unsorted = [&whole, &parts].map(|drawn| drawn.counter("kbuffer_overflow_pixels"));
            assert!(unsorted[1] <= 2 * unsorted[0] + 100, "{name}: {unsorted:?}");
        }
    }
}

/// A view that sees one part of four draws its faces once.
#[test]
fn one_part_alone() {
    let gpu = gpu();
    let on_gpu = GpuScene::new(&gpu, cubes(Field::Blobs, 8, &HAZE));
    let camera = Camera {
        eye: DVec3::new(0.6, 0.4, 5.0),
        target: DVec3::new(0.6, 0.4, 0.0),
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 4.0 },
    };
    let view = View::new(camera, 40, 40).unwrap();
    for more in ["repair=none", "repair=exact", "chunk=3"] {
        let [whole, parts] = [1, 4].map(|n| Drawn::new(&on_gpu, &view, &format!("havs:parts={n},{more}")));
        assert_eq!((parts.counter("parts"), parts.counter("parts_seen")), (4, 1));
        assert_eq!(parts.image, whole.image, "{more}");
        assert_eq!(parts.counter("fragments"), whole.counter("fragments"), "{more}");
    }
}

/// What was recorded and never submitted, and what belongs to another view, does not count as drawn.
#[test]
fn frames_that_are_given_up_begin_anew() {
    let gpu = gpu();
    let on_gpu = GpuScene::new(&gpu, cubes(Field::Blobs, 6, &SHELLS));
    let views = [view(perspective(), 1.0, 37, 29), view(orthographic(), -1.0, 37, 29)];
    let renderer = Renderer::new(&on_gpu, technique("havs:parts=5"));
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let mut plan = renderer.prepare(&views[0], &TargetDesc::caller(format, TargetMode::Clear)).unwrap();
    assert!(!plan.load().unwrap());
    let caller = Caller::new(&gpu, format, [37, 29], 16);
    let record = |plan: &mut Plan| {
        caller.begin([0.0; 4]);
        plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap()
    };
    for given_up in ["nothing", "a recording", "a view in flight", "a view"] {
        let mut drawn = 0;
        let bytes = loop {
            let recorded = record(&mut plan);
            let bytes = caller.end(&gpu);
            drawn += 1;
            if given_up == "a view in flight" && drawn == 2 {
                assert!(plan.set_view(&views[1]).unwrap());
            }
            if recorded.completed().unwrap().complete {
                break bytes;
            }
            assert!(plan.load().unwrap());
            if given_up == "a recording" && drawn == 2 {
                let recorded = record(&mut plan);
                // SAFETY: recording.
                unsafe { caller.device.end_command_buffer(caller.commands) }.unwrap();
                recorded.discarded();
                assert!(!plan.load().unwrap());
            }
            if given_up == "a view" && drawn == 2 {
                assert!(plan.set_view(&views[1]).unwrap());
                assert!(!plan.load().unwrap());
            }
        };
        assert_eq!(drawn, if given_up == "nothing" { 5 } else { 7 }, "{given_up}");
        let turned = given_up.starts_with("a view");
        let view = &views[usize::from(turned)];
        if turned {
            assert!(plan.set_view(&views[0]).unwrap());
        }
        let whole = draw_on(&on_gpu, view, "havs:parts=1");
        let numbers: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
        assert_eq!(numbers, whole.pixels(), "{given_up}");
    }
}

/// A million cells, of which every line meets hundreds.
#[test]
fn eight_parts_of_a_million_cells() {
    let gpu = gpu();
    let on_gpu = GpuScene::new(&gpu, cubes(Field::Blobs, 59, &FOG));
    assert!(on_gpu.scene().mesh().unwrap().cells().len() > 1_000_000);
    let view = view(perspective(), 1.0, 256, 256);
    let parts = Drawn::new(&on_gpu, &view, "havs:parts=8");
    assert_eq!((parts.counter("parts"), parts.counter("parts_seen")), (8, 8));
    let whole = Drawn::new(&on_gpu, &view, "havs:parts=1");
    assert_eq!(parts.image, whole.image);
    assert_eq!(parts.counter("fragments"), whole.counter("fragments"));
}

/// Frames of other views take the parts in other orders, and leave out those that they do not see.
#[test]
fn views_change_the_order_of_parts() {
    let gpu = gpu();
    let on_gpu = GpuScene::new(&gpu, cubes(Field::Blobs, 6, &SHELLS));
    let views = [
        view(perspective(), 1.0, 37, 29),
        view(orthographic(), -1.0, 37, 29),
        view(Projection::Perspective { fov_y_deg: 6.0 }, 1.0, 37, 29),
        view(perspective(), 1.0, 37, 29),
    ];
    let mut frames = Renderer::new(&on_gpu, technique("havs:parts=60")).frames(&views[0]).unwrap();
    let mut seen = Vec::new();
    for view in views {
        // A frame that is given up leaves nothing.
        assert!(frames.draw_part(&view).unwrap().is_none());
        frames.draw(&view).unwrap();
        let counters = frames.plan().counters();
        seen.extend(counters.into_iter().filter(|(name, _)| *name == "parts_seen").map(|(_, seen)| seen));
        assert_eq!(frames.read_back().unwrap(), draw_on(&on_gpu, &view, "havs:parts=1"));
    }
    assert!(seen.iter().any(|&seen| seen < 60) && seen.contains(&60), "{seen:?}");
}

/// A device without room for the whole mesh draws it in parts of its own accord; one part lacks memory.
#[test]
fn a_small_budget_makes_parts() {
    let scene = cubes(Field::Blobs, 24, &HAZE);
    let view = view(perspective(), 1.0, 64, 64);
    let whole = draw_on(&GpuScene::new(&gpu(), scene.clone()), &view, "havs");
    let gpu = gpu_with(GpuOptions { memory_budget: Some(8 << 20), ..GpuOptions::default() });
    let on_gpu = GpuScene::new(&gpu, scene);
    let drawn = Drawn::new(&on_gpu, &view, "havs");
    assert!(drawn.counter("parts") > 1);
    assert_eq!(drawn.image, whole);
    // Pixels are no reason for parts.
    let small = GpuScene::new(&gpu, cubes(Field::Blobs, 2, &HAZE));
    let wide = View::new(*view.camera(), 300, 300).unwrap();
    assert_eq!(Drawn::new(&small, &wide, "havs").counters.iter().find(|(name, _)| *name == "parts"), None);
    let error = Renderer::new(&on_gpu, technique("havs:parts=1")).render(&view).unwrap_err();
    assert!(matches!(error, Error::Memory { .. }), "{error}");
}
