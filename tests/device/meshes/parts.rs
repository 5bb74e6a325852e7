//! Meshes in parts: images to the bit of those of the whole, whatever comes out of order, overlaps or lies in front.

use glam::DVec3;
use volraster::gpu::GpuOptions;
use volraster::scene::{Field, Projection, Scene, Surface, TetScalars, Tets, View};
use volraster::technique::Renderer;
use volraster::{Error, GpuScene};

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
            let draw = |parts| draw_on(&on_gpu, &view, &format!("havs:order=back-to-front,parts={parts}"));
            assert_eq!(draw(7), draw(1), "{name}");
        }
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
fn own_device_a_small_budget_makes_parts() {
    let scene = cubes(Field::Blobs, 24, &HAZE);
    let view = view(perspective(), 1.0, 64, 64);
    let whole = draw_on(&GpuScene::new(&gpu(), scene.clone()), &view, "havs");
    let gpu = gpu_with(GpuOptions { memory_budget: Some(8 << 20), ..GpuOptions::default() });
    let on_gpu = GpuScene::new(&gpu, scene);
    let drawn = Drawn::new(&on_gpu, &view, "havs");
    assert!(drawn.counter("parts") > 1);
    assert_eq!(drawn.image, whole);
    let error = Renderer::new(&on_gpu, technique("havs:parts=1")).render(&view).unwrap_err();
    assert!(matches!(error, Error::Memory { .. }), "{error}");
}
