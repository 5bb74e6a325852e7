//! Grids in pages: images are those of the whole grid, whatever the pool holds at a time.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::caller::Caller;
use crate::common::*;
use crate::folder::Folder;
use glam::{DMat3, DVec3};
use volraster::ash::vk;
use volraster::gpu::GpuOptions;
use volraster::io::ReadOptions;
use volraster::io::scene_file::LoadedScene;
use volraster::measure::ImageErrors;
use volraster::scene::{
    Camera, Clip, Field, Grid, Lighting, Mode, OnDemand, Projection, SampleSource, Samples, Scene, Surface,
    TransferFunction, View,
};
use volraster::technique::Renderer;
use volraster::{GpuScene, TargetDesc, TargetMode};

/// A grid of 3 x 2 x 3 pages, the last of which are cut.
const DIMS: [u32; 3] = [160, 80, 131];
const PAGES: u64 = 18;

/// Fog whose pages are all visible, and one with hidden pages.
const FOG: [[f64; 5]; 4] = [
    [0.0, 0.1, 0.2, 0.9, 0.02],
    [0.3, 0.1, 0.2, 0.9, 0.0],
    [0.6, 0.9, 0.5, 0.1, 3.0],
    [1.0, 1.0, 1.0, 0.3, 40.0],
];

fn fog() -> TransferFunction {
    TransferFunction::from_rows(&FOG).unwrap()
}

fn parts() -> TransferFunction {
    TransferFunction::from_rows(&[[0.7, 0.9, 0.4, 0.1, 0.0], [0.9, 1.0, 0.9, 0.2, 30.0]]).unwrap()
}

fn views() -> [View; 3] {
    [view(perspective(), 1.0, 70, 60), view(orthographic(), 1.0, 64, 61), view(perspective(), 0.2, 50, 40)]
}

/// Options with a pool of so many pages of samples with `sample` bytes.
fn pool(pages: u64, sample: u64) -> GpuOptions {
    GpuOptions { page_pool: Some(pages * (67_u64.pow(3) * sample + 4)), ..GpuOptions::default() }
}

fn is_same(scene: &Arc<GpuScene>, whole: &Arc<GpuScene>, view: &View, spec: &str, what: &str) -> [u64; 2] {
    let want = draw_on(whole, view, spec);
    let mut frames = Renderer::new(scene, technique(spec)).frames(view).unwrap();
    let drawn = frames.draw(view).unwrap();
    let errors = ImageErrors::between(&frames.read_back().unwrap(), &want).unwrap().all;
    let count = |name: &str| drawn.counters.iter().find(|(key, _)| *key == name).map_or(0, |(_, n)| *n);
    println!(
        "{what} {spec}: {:.1e}, at most {:.1e}; {} pages",
        errors.rmse,
        errors.max_abs,
        count("pages_read")
    );
    // Both sum the same terms; only the coordinates of the filter are rounded otherwise, where the fog is steep to 3e-5 of a pixel.
    let [mut rmse, mut most] = if spec.contains("filter=exact") { [0.0; 2] } else { [2e-6, 6e-5] };
    // A device with weights of few bits rounds them otherwise in another image: at most, twice what it does to each.
    if !spec.contains("filter=exact") && whole.gpu().filter_error().unwrap() > 1e-4 {
        let exact = draw_on(whole, view, &with_option(spec, "filter", "exact"));
        let rounding = ImageErrors::between(&want, &exact).unwrap().all;
        [rmse, most] = [rmse + 2.0 * rounding.rmse, most + 2.0 * rounding.max_abs];
    }
    assert!(errors.rmse <= rmse && errors.max_abs <= most, "{what}, {spec}: {errors:?}");
    [count("pages_read"), count("bytes_read")]
}

/// Every technique with a march draws the image of the whole grid, from a pool for all pages and from pools that hold a few.
#[test]
fn images_are_those_of_the_whole_grid() {
    let whole = gpu();
    let specs = [
        "slices-3d:step=0.5",
        "slices-3d:step=0.7,empty-space=march",
        "slabs",
        "slabs:integrator=exact,filter=exact",
        "raycast:step=0.5",
        "raycast:step=2,integrator=integral",
        "raycast:step=0.5,integrator=exact,filter=exact",
        "slices-2d",
        "slices-2d:step=0.5,filter=exact",
        "shear-warp",
        "shear-warp:step=0.5,filter=exact,warp=mip",
        "shear-warp:integrator=integral",
        "shear-warp:every=3",
        "slabs:resolution=half",
    ];
    // This device filters 8-bit samples too coarsely: they take 16 bits.
    for (kind, bytes) in taken(1, [("f32", 4), ("u8", 2)]) {
        let grid = Field::Blobs.sample(DIMS, kind).unwrap();
        let scenes = [(fog(), "fog"), (parts(), "parts")]
            .map(|(transfer, name)| (Scene::new(grid.clone(), transfer), name));
        for (i, pages) in [1, 4, PAGES].into_iter().enumerate() {
            let paged = gpu_with(pool(pages, bytes));
            for (j, (scene, name)) in scenes.iter().enumerate() {
                let all = GpuScene::new(&whole, scene.clone());
                for spec in taken_from(2 * i + j, 8, specs) {
                    // Without skipping, pages that show nothing are read again once they are known.
                    let again = if spec.contains("march") { PAGES } else { 6 };
                    let few = GpuScene::new(&paged, scene.clone());
                    let mut before = 0;
                    for view in &views() {
                        let what = format!("{kind}, {name}, {pages} pages,");
                        let [read, _] = is_same(&few, &all, view, spec, &what);
                        if pages == PAGES {
                            // The stack of another axis has pages of its own.
                            let most = if spec.contains("shear-warp") { 2 * PAGES } else { PAGES };
                            assert!(read <= most, "{what} {spec}: {read} pages were read");
                        }
                        if pages == 4 {
                            assert!(
                                read - before <= PAGES + again,
                                "{what} {spec}: {} pages were read",
                                read - before
                            );
                        }
                        before = read;
                    }
                }
            }
        }
    }
}

/// A pool is as large as one allocation may be, where the budget has more.
#[test]
fn a_pool_is_no_larger_than_one_allocation_may_be() {
    let scene = Scene::new(Field::Blobs.sample(DIMS, "f32").unwrap(), fog());
    let page = 67_u64.pow(3) * 4 + 4;
    let limited = GpuOptions { allocation_size: Some(3 * page), ..pool(PAGES, 4) };
    let few = GpuScene::new(&gpu_with(limited), scene.clone());
    is_same(&few, &GpuScene::new(&gpu(), scene), &views()[0], "slabs", "limited");
    let pools: Vec<_> =
        few.gpu().memory_report().into_iter().filter(|(name, _)| name == "page pool").collect();
    assert!(pools.len() == 1 && (page..=3 * page).contains(&pools[0].1), "{pools:?}");
}

/// Counts are those of all sweeps: what is sampled of the whole grid, and once more where a ray has missed a page.
#[test]
fn counts_are_those_of_all_sweeps() {
    let scene = Scene::new(Field::Blobs.sample(DIMS, "f32").unwrap(), fog());
    let taken = |gpu: &volraster::Gpu| {
        let scene = GpuScene::new(gpu, scene.clone());
        let counts = Renderer::new(&scene, technique("slabs:filter=exact")).count(&views()[0]).unwrap();
        counts.iter().find(|(key, _)| *key == "samples").map_or(0, |(_, n)| *n)
    };
    let [whole, few] = [taken(&gpu()), taken(&gpu_with(pool(2, 4)))];
    assert!(
        whole > 10_000 && (whole..whole + whole / 10).contains(&few),
        "{few} samples, of the whole {whole}"
    );
}

/// Once all visible pages are there, empty space is skipped as in the whole grid: with as few samples, but for those that end walks and runs.
#[test]
fn empty_space_is_skipped_as_in_the_whole_grid() {
    let whole = gpu();
    let paged = gpu_with(pool(PAGES, 4));
    let mode = |name: &str| if name == "maximum" { Mode::Maximum } else { Mode::Emission };
    for (name, spec) in [
        ("slices-3d", "slices-3d:step=0.5"),
        ("slabs", "slabs"),
        ("raycast", "raycast"),
        ("slices-2d", "slices-2d"),
        ("shear-warp", "shear-warp"),
        ("maximum", "raycast"),
    ] {
        let scene = Scene::new(Field::Blobs.sample(DIMS, "f32").unwrap(), parts());
        let scene = scene.with_mode(mode(name)).unwrap();
        let view = &views()[usize::from(name == "shear-warp")];
        let samples = |scene: &Arc<GpuScene>, spec: &str| {
            let counts = Renderer::new(scene, technique(spec)).count(view).unwrap();
            counts.iter().find(|(key, _)| *key == "samples").map_or(0, |(_, n)| *n)
        };
        let all = GpuScene::new(&whole, scene.clone());
        let some = GpuScene::new(&paged, scene);
        let first = samples(&some, spec);
        let [want, got] = [&all, &some].map(|scene| samples(scene, spec));
        let march =
            samples(&all, &format!("{spec}{}empty-space=march", if spec.contains(':') { "," } else { ":" }));
        println!("{name}: {first}, then {got} samples, of the whole grid {want}; without skipping {march}");
        assert!(
            (want - want / 25..=want + want / 100).contains(&got),
            "{name}: {got} samples, of the whole grid {want}"
        );
        assert!(march > want + want / 10 && first > want + want / 100, "{name}: {march}, {first}, {want}");
    }
}

/// Each part of a frame is no farther from the complete one than it says, and comes nearer.
#[test]
fn frames_that_end_early_keep_their_bound() {
    let (whole, paged) = (gpu(), gpu_with(pool(2, 4)));
    let grid = Field::Blobs.sample(DIMS, "f32").unwrap();
    let bright = TransferFunction::from_rows(&FOG.map(|[s, r, g, b, tau]| [s, 3.0 * r, g, b, tau])).unwrap();
    let lit = Mode::Lit(Lighting { specular: 0.8, ..Lighting::default() });
    let cases = [
        ("slabs", fog(), Mode::Emission),
        ("raycast:step=0.5", bright.clone(), Mode::Emission),
        ("slices-3d", bright, lit),
        ("slices-2d", parts(), Mode::Emission),
        ("shear-warp", fog(), Mode::Emission),
        ("raycast", fog(), Mode::Maximum),
    ];
    for (spec, transfer, mode) in cases {
        let scene = Scene::new(grid.clone(), transfer).with_mode(mode).unwrap();
        let view = &views()[usize::from(spec == "shear-warp")];
        let complete = draw_on(&GpuScene::new(&whole, scene.clone()), view, spec);
        let few = GpuScene::new(&paged, scene);
        let mut frames = Renderer::new(&few, technique(spec)).frames(view).unwrap();
        let mut bounds = Vec::new();
        while frames.draw_part(view).unwrap().is_none() {
            bounds.extend(frames.bound());
        }
        assert!(frames.bound().is_none() && bounds.len() > 3, "{spec}: {bounds:?}");
        assert!(bounds.windows(2).all(|pair| pair[1].rmse <= pair[0].rmse), "{spec}: {bounds:?}");
        let mut ended = 0;
        for part in bounds.iter().step_by(bounds.len().div_ceil(5)).chain(bounds.last()) {
            frames.stop_within(part.rmse);
            let Some(bound) = frames.draw(view).unwrap().bound else { continue };
            let errors = ImageErrors::between(&frames.read_back().unwrap(), &complete).unwrap().all;
            println!(
                "{spec}: {:.1e} of {:.1e}, {:.1e} of {:.1e}",
                errors.rmse, bound.rmse, errors.max_abs, bound.greatest
            );
            assert!(bound.rmse <= part.rmse && bound.rmse <= bound.greatest, "{spec}: {bound:?}, {part:?}");
            assert!(errors.rmse <= bound.rmse + 2e-6, "{spec}: {} beyond {}", errors.rmse, bound.rmse);
            assert!(
                errors.max_abs <= bound.greatest + 6e-5,
                "{spec}: {} beyond {}",
                errors.max_abs,
                bound.greatest
            );
            ended += 1;
        }
        assert!(ended > 2, "{spec}: {ended} frames ended early");
        frames.stop_within(0.0);
        assert_eq!(frames.draw(view).unwrap().bound, None);
        assert!(ImageErrors::between(&frames.read_back().unwrap(), &complete).unwrap().all.rmse < 2e-6);
    }
}

/// A scene most of whose 125 pages show nothing.
fn mostly_hidden() -> Scene {
    let grid = Field::Blobs.sample([300, 260, 280], "u8").unwrap();
    let [low, high] = grid.range();
    let rows = [[low + 0.35 * (high - low), 0.9, 0.4, 0.1, 0.0], [high, 1.0, 0.9, 0.2, 8.0]];
    Scene::new(grid, TransferFunction::from_rows(&rows).unwrap())
}

/// Where most pages show nothing, and many are loaded at a time, they make room first: the image is the same to the bit, and a page is read
/// once but for a few.
#[test]
fn hidden_pages_leave_first() {
    let scene = mostly_hidden();
    let all = GpuScene::new(&gpu(), scene.clone());
    // Of 125 pages; two are loaded at a time.
    let paged = gpu_with(pool(16, 1));
    let specs = ["slices-3d:filter=exact", "slabs:filter=exact,integrator=exact", "raycast:filter=exact"];
    for (i, spec) in specs.into_iter().enumerate() {
        for view in &taken_from(i, 3, views()) {
            let few = GpuScene::new(&paged, scene.clone());
            let want = draw_on(&all, view, spec);
            let mut frames = Renderer::new(&few, technique(spec)).frames(view).unwrap();
            let drawn = frames.draw(view).unwrap();
            assert!(frames.read_back().unwrap() == want, "{spec}");
            let read = drawn.counters.iter().find(|(key, _)| *key == "pages_read").map_or(0, |(_, n)| *n);
            println!("{spec}: {read} pages");
            assert!((4..=160).contains(&read), "{spec}: {read} pages were read");
        }
    }
}

/// The stack of each axis has pages of its own, of which those that are known to show nothing are not read again. They make room for those of
/// another axis: the images of a view from each side are those of the whole grid to the bit.
#[test]
fn stacks_of_all_axes_share_a_pool() {
    let scene = mostly_hidden();
    let all = GpuScene::new(&gpu(), scene.clone());
    for (pages, spec) in
        [(375, "slices-2d:filter=exact"), (5, "slices-2d:filter=exact"), (5, "shear-warp:filter=exact")]
    {
        let few = GpuScene::new(&gpu_with(pool(pages, 1)), scene.clone());
        let reads = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::X].map(|side| {
            let eye = 4.0 * side + DVec3::new(0.3, 0.2, -0.4);
            let up = if side == DVec3::Y { DVec3::X } else { DVec3::Y };
            let view = View::new(Camera { eye, target: DVec3::ZERO, up, projection: perspective() }, 48, 40)
                .unwrap();
            is_same(&few, &all, &view, spec, &format!("from {side}, {pages} pages,"))[0]
        });
        if pages == 375 {
            let [first, second, third, again] = reads;
            assert!(
                (second - first).max(third - second) < first * 2 / 3 && second > first,
                "{reads:?} pages were read"
            );
            assert_eq!(again, third, "pages of the first axis are still there");
        }
    }
}

/// Between a recording and the load of what it has missed the view may change: the next one begins anew.
#[test]
fn views_may_change_before_pages_are_loaded() {
    let gpu = gpu_with(pool(4, 4));
    let scene = Scene::new(Field::Blobs.sample(DIMS, "f32").unwrap(), fog());
    let views = [view(perspective(), 1.0, 50, 40), view(orthographic(), 1.0, 50, 40)];
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let caller = Caller::new(&gpu, format, [50, 40], 16);
    for spec in ["slabs:filter=exact", "slices-2d:filter=exact", "shear-warp:filter=exact"] {
        let few = GpuScene::new(&gpu, scene.clone());
        let renderer = Renderer::new(&few, technique(spec));
        let mut plan = renderer.prepare(&views[0], &TargetDesc::caller(format, TargetMode::Clear)).unwrap();
        let mut drawn = 0;
        let bytes = loop {
            caller.begin([0.0; 4]);
            let recorded =
                plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap();
            let bytes = caller.end(&gpu);
            let complete = recorded.completed().unwrap().complete;
            drawn += 1;
            if drawn == 2 {
                assert!(!complete && plan.set_view(&views[1]).unwrap());
            } else if complete {
                break bytes;
            }
            assert!(plan.load().unwrap() || drawn == 2, "{spec}, {drawn}");
        };
        let numbers: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
        assert_eq!(
            numbers,
            draw_on(&GpuScene::new(&crate::common::gpu(), scene.clone()), &views[1], spec).pixels(),
            "{spec}"
        );
    }
}

/// Pages that show nothing are read once, however many follow each other on a ray.
#[test]
fn rays_pass_long_gaps_without_reading_them_again() {
    let dims = [1200, 65, 65];
    let shown = |i: usize| if (20..1180).contains(&(i % 1200)) { 0 } else { 200 };
    let samples = Samples::U8((0..1200 * 65 * 65).map(shown).collect());
    let spacing = DVec3::splat(2.0 / 1199.0);
    let grid =
        Grid::new(dims, samples).unwrap().with_placement(spacing, DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let rows = [[40.0, 0.9, 0.4, 0.1, 0.0], [255.0, 1.0, 0.9, 0.2, 9.0]];
    let scene = Scene::new(grid, TransferFunction::from_rows(&rows).unwrap());
    let target = DVec3::new(0.0, -0.946, -0.946);
    let view = |y: f64| {
        let projection = Projection::Orthographic { half_height: 0.07 };
        let eye = target + DVec3::new(-4.0, y, 0.0);
        View::new(Camera { eye, target, up: DVec3::Z, projection }, 32, 32).unwrap()
    };
    let (whole, paged) = (gpu(), gpu_with(pool(4, 1)));
    for spec in ["slices-3d", "slabs", "raycast", "slices-2d", "shear-warp"] {
        let spec = format!("{spec}:filter=exact");
        let scene = scene.clone();
        let [all, few] = [&whole, &paged].map(|gpu| GpuScene::new(gpu, scene.clone()));
        let mut frames = Renderer::new(&few, technique(&spec)).frames(&view(0.0)).unwrap();
        let read = [0.0, 0.02, 0.04].map(|y| {
            let drawn = frames.draw(&view(y)).unwrap();
            let errors =
                ImageErrors::between(&frames.read_back().unwrap(), &draw_on(&all, &view(y), &spec)).unwrap();
            assert!(errors.all.max_abs <= 2e-6, "{spec} {y}: {:e}", errors.all.max_abs);
            drawn.counters.iter().find(|(key, _)| *key == "pages_read").map_or(0, |(_, n)| *n)
        });
        // 19 pages, of which those at the ends show something, and samples at the ends of a walk may need those beside them.
        println!("{spec}: {read:?} pages");
        assert!(read[0] >= 19 && read[2] <= read[0] + 8, "{spec}: {read:?} pages were read");
    }
}

/// So do lit scenes, maximum intensity projection, vacuum, infinite samples, cut views, and volumes with translucent surfaces.
#[test]
fn every_kind_of_scene_is_drawn_from_pages() {
    let whole = gpu();
    let smooth = Field::Blobs.sample(DIMS, "f32").unwrap();
    let Samples::F32(mut values) = smooth.samples().clone() else { panic!("float32") };
    for (i, value) in values.iter_mut().enumerate() {
        let [x, y, z] = [i % 160, i / 160 % 80, i / 12800];
        match (x + 2 * y + z) % 97 {
            // Bytes 0xFF, with which files are filled, are a NaN, too.
            0..3 => *value = f32::from_bits(u32::MAX),
            40 => *value = f32::INFINITY,
            41 => *value = f32::NEG_INFINITY,
            _ => {}
        }
    }
    let holed = Grid::new(DIMS, Samples::F32(values)).unwrap();
    let pane = |z: f64, colour| {
        let corners = [[-2.0, -2.0, z], [2.0, -2.0, z], [2.0, 2.0, 0.2 - z], [-2.0, 2.0, 0.2 - z]];
        Surface::new(corners.map(DVec3::from_array).to_vec(), vec![[0, 1, 2], [0, 2, 3]], colour).unwrap()
    };
    let panes = || vec![pane(0.4, [0.2, 0.5, 1.0, 0.4]), pane(-0.3, [1.0, 0.7, 0.1, 0.3])];
    let clip = Clip::none().with_plane(DVec3::new(0.1, 0.2, 0.0), DVec3::new(0.3, -1.0, 0.2)).unwrap();
    let seen = Scene::new(smooth.clone(), parts());
    let plain = Scene::new(smooth, fog());
    let scenes = [
        (
            "lit",
            plain.clone().with_mode(Mode::Lit(Lighting::default())).unwrap(),
            "slabs slices-3d raycast:integrator=exact",
        ),
        ("maximum", plain.clone().with_mode(Mode::Maximum).unwrap(), "raycast:step=0.5"),
        (
            "holes",
            Scene::new(holed, fog()),
            "slabs slices-3d raycast slices-2d slices-2d:step=0.7 shear-warp shear-warp:integrator=exact",
        ),
        (
            "panes",
            plain.clone().with_surfaces(panes()),
            "slabs slices-3d:step=0.5 raycast:integrator=exact slices-2d",
        ),
        (
            "lit parts",
            seen.clone().with_mode(Mode::Lit(Lighting::default())).unwrap(),
            "slabs slices-3d raycast",
        ),
        ("panes and parts", seen.with_surfaces(panes()), "slabs slices-3d:step=0.5 raycast slices-2d"),
        ("cut", plain, "slabs slices-3d raycast slices-2d"),
    ];
    for (pages, paged) in [1, PAGES].map(|pages| (pages, gpu_with(pool(pages, 4)))) {
        for (name, scene, specs) in &scenes {
            let [all, few] = [&whole, &paged].map(|gpu| GpuScene::new(gpu, scene.clone()));
            for (place, spec) in specs.split(' ').enumerate() {
                for view in taken_from(place, 3, views()) {
                    let view = if *name == "cut" { view.with_clip(clip) } else { view };
                    is_same(&few, &all, &view, spec, &format!("{name}, {pages} pages,"));
                }
            }
        }
    }
}

/// Transfer functions share the pages of a grid with infinite samples, which count as the ends of each: pages that contain some are read for each.
#[test]
fn transfer_functions_share_pages_without_infinite_samples() {
    let (whole, paged) = (gpu(), gpu_with(pool(PAGES, 4)));
    let Samples::F32(mut values) = Field::Blobs.sample(DIMS, "f32").unwrap().samples().clone() else {
        panic!("float32")
    };
    // In the first page, beyond the apron of others.
    for i in (0..9).flat_map(|z| (0..9).flat_map(move |y| (0..9).map(move |x| x + 160 * (y + 80 * z)))) {
        values[i] = if i % 2 == 0 { f32::INFINITY } else { f32::NEG_INFINITY };
    }
    let grid = Grid::new(DIMS, Samples::F32(values)).unwrap();
    let wide = TransferFunction::from_rows(&[[-0.5, 1.0, 0.3, 0.1, 0.3], [1.5, 0.1, 0.6, 0.4, 9.0]]).unwrap();
    let scenes = [fog(), wide.clone()].map(|transfer| Scene::new(grid.clone(), transfer));
    let all = scenes.clone().map(|scene| GpuScene::new(&whole, scene));
    let view = &views()[0];
    for spec in ["slabs:filter=exact", "raycast:filter=exact", "shear-warp:filter=exact"] {
        let first = GpuScene::new(&paged, scenes[0].clone());
        let second = first.with_transfer(wide.clone());
        let [mut before, mut steps] = [0, 0];
        for turn in [0, 1, 0, 1, 1] {
            let [read, _] = is_same([&first, &second][turn], &all[turn], view, spec, "infinite samples");
            let most = if steps == 0 { u64::MAX } else { 1 };
            assert!(
                read - before <= most && read <= PAGES + 4,
                "{spec}: {} pages in step {steps}",
                read - before
            );
            assert!(steps == 0 || steps == 4 || read > before, "{spec}: none in step {steps}");
            (before, steps) = (read, steps + 1);
        }
    }
}

/// Scenes that draw their parts in turn take each other's pages, and complete all the same.
#[test]
fn scenes_that_take_turns_complete() {
    let whole = gpu();
    let Samples::F32(mut values) = Field::Blobs.sample(DIMS, "f32").unwrap().samples().clone() else {
        panic!("float32")
    };
    // Each page has some, so that each is another's for another transfer function.
    values.iter_mut().step_by(997).for_each(|value| *value = f32::INFINITY);
    let grid = Grid::new(DIMS, Samples::F32(values)).unwrap();
    let transfers = [fog(), parts()];
    let all = transfers.clone().map(|transfer| GpuScene::new(&whole, Scene::new(grid.clone(), transfer)));
    let [view, other, _] = views();
    for pages in [1, PAGES] {
        let paged = gpu_with(pool(pages, 4));
        let first = GpuScene::new(&paged, Scene::new(grid.clone(), transfers[0].clone()));
        let second = first.with_transfer(transfers[1].clone());
        for spec in ["slabs:filter=exact", "shear-warp:filter=exact"] {
            // Of two frames of one scene, too.
            let turns = [(&first, &all[0], view), (&second, &all[1], view), (&first, &all[0], other)];
            let mut frames =
                turns.map(|(scene, ..)| Renderer::new(scene, technique(spec)).frames(&view).unwrap());
            let mut complete = [false; 3];
            let mut parts = 0;
            while complete != [true; 3] {
                for ((frames, complete), (_, _, view)) in frames.iter_mut().zip(&mut complete).zip(&turns) {
                    *complete = *complete || frames.draw_part(view).unwrap().is_some();
                }
                parts += 1;
                assert!(parts < 200, "{spec} from {pages} pages goes on for ever: {complete:?}");
            }
            for (frames, (_, all, view)) in frames.iter_mut().zip(&turns) {
                assert_eq!(frames.read_back().unwrap(), draw_on(all, view, spec), "{spec}, {pages} pages");
            }
        }
    }
}

/// Samples of a source that takes its time, or has none any more.
#[derive(Debug)]
struct Slow {
    grid: Grid,
    ends: AtomicBool,
}

impl SampleSource for Slow {
    fn read(&self, first: [u32; 3], extent: [u32; 3]) -> volraster::Result<Samples> {
        if self.ends.load(Ordering::Relaxed) {
            return Err(volraster::Error::Invalid { what: "samples".into(), why: "are gone".into() });
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
        let Samples::F32(all) = self.grid.samples() else { panic!("float32") };
        let index = |x: u32, y: u32, z: u32| ((z * DIMS[1] + y) * DIMS[0] + x) as usize;
        let rows = (0..extent[2]).flat_map(|z| (0..extent[1]).map(move |y| (y, z)));
        let row = |(y, z)| {
            let from = index(first[0], first[1] + y, first[2] + z);
            all[from..from + extent[0] as usize].to_vec()
        };
        Ok(Samples::F32(rows.flat_map(row).collect()))
    }
}

/// A slow source costs time alone, also part by part; one that fails later ends the frame with its error, and the next that can be read is right.
#[test]
fn sources_may_be_slow_and_may_fail() {
    let gpu = gpu_with(pool(4, 4));
    let grid = Field::Blobs.sample(DIMS, "f32").unwrap();
    let source = Arc::new(Slow { grid: grid.clone(), ends: AtomicBool::new(false) });
    let on_demand = OnDemand::new(DIMS, Shared(Arc::clone(&source))).unwrap();
    let slow = grid.with_samples(Samples::OnDemand(on_demand)).unwrap();
    let [view, other, _] = views();
    let want = draw(&gpu, &Scene::new(grid, fog()), &view, "slabs:filter=exact");
    let scene = GpuScene::new(&gpu, Scene::new(slow, fog()));
    let mut frames = Renderer::new(&scene, technique("slabs:filter=exact")).frames(&view).unwrap();
    let mut parts = 1;
    // Another view in between, of which a part is drawn.
    assert!(frames.draw_part(&other).unwrap().is_none());
    while frames.draw_part(&view).unwrap().is_none() {
        assert!(frames.read_back().is_err(), "the picture is not complete");
        parts += 1;
    }
    assert!(parts > 4 && frames.read_back().unwrap() == want, "{parts} parts");
    source.ends.store(true, Ordering::Relaxed);
    let error = frames.draw(&other).unwrap_err().to_string();
    assert!(error.contains("are gone") && frames.read_back().is_err(), "{error}");
    source.ends.store(false, Ordering::Relaxed);
    frames.draw(&view).unwrap();
    assert!(frames.read_back().unwrap() == want);
}

/// A source that others hold as well.
#[derive(Debug)]
struct Shared(Arc<Slow>);

impl SampleSource for Shared {
    fn read(&self, first: [u32; 3], extent: [u32; 3]) -> volraster::Result<Samples> {
        self.0.read(first, extent)
    }
}

/// A file that is cut off after it was opened is an error in one line, which names it.
#[test]
fn a_file_that_is_cut_off_later_is_refused() {
    let gpu = gpu_with(pool(4, 4));
    let folder = Folder::new();
    folder.write("samples.raw", vec![7; 160 * 80 * 131]);
    let json = r#"{"volume": {"file": "samples.raw", "dims": [160, 80, 131], "type": "u8"}, "transfer": {"preset": "fog", "range": [0, 20]}}"#;
    folder.write("scene.json", json);
    let options = ReadOptions { on_demand: Some(0), ..ReadOptions::default() };
    let loaded = LoadedScene::load_any(folder.path("scene.json"), &options).unwrap();
    std::fs::OpenOptions::new().write(true).open(folder.path("samples.raw")).unwrap().set_len(1000).unwrap();
    let scene = GpuScene::new(&gpu, loaded.scene);
    let error = Renderer::new(&scene, technique("slabs")).render(&views()[0]).unwrap_err().to_string();
    assert!(error.contains("samples.raw") && error.contains("ends") && !error.contains('\n'), "{error}");
}
