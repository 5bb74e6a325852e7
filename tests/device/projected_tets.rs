//! Projected tetrahedra against closed forms and the float64 reference.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of test images")]

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::*;
use crate::folder::shared;
use glam::DVec3;
use volraster::GpuScene;
use volraster::Image;
use volraster::gpu::Gpu;
use volraster::io::{self, Data, ReadOptions};
use volraster::measure::ImageErrors;
use volraster::scene::{Camera, Field, Projection, Scene, TetScalars, Tets, TransferFunction, View};
use volraster::technique::{Method, Renderer, Technique};

type Counters = Vec<(&'static str, u64)>;

fn mesh_scene(mesh: Tets, rows: &[[f64; 5]]) -> Scene {
    Scene::new(mesh, TransferFunction::from_rows(rows).unwrap())
}

fn counter(counters: &Counters, name: &str) -> u64 {
    counters.iter().find(|(key, _)| *key == name).unwrap_or_else(|| panic!("{name} is not in {counters:?}")).1
}

/// Image and counters of a frame.
fn frame(scene: &Arc<GpuScene>, view: &View, spec: &str) -> (Image, Counters) {
    let mut frames = Renderer::new(scene, technique(&format!("projected-tets:{spec}"))).frames(view).unwrap();
    let time = frames.draw(view).unwrap();
    let counters = time.counters.into_iter().chain(frames.plan().counters()).collect();
    (frames.read_back().unwrap(), counters)
}

/// Every way to integrate cells in every pixel. Exact: what is left is rounding, and in space what a rasteriser's grid of places
/// moves.
fn exact_specs(gpu: &Gpu) -> Vec<&'static str> {
    let mut specs = vec!["route=compute,rank=mpvo,integrator=exact"];
    if routes_of(gpu, Method::ProjectedTets).contains(&"raster") {
        specs.extend(["route=raster,integrator=exact", "plane=space,integrator=exact"]);
    }
    specs
}

/// What a way may be off by, root mean square. Fans in space: a pixel within 1/256 pixel of an edge, one in a hundred at
/// an edge a pixel, may be given to the cell on the other side, whose thickness there is that of the edge.
fn tolerance(spec: &str) -> f64 {
    if spec.contains("space") { 1e-4 } else { 1e-6 }
}

/// Distances of centroids do not order these cells; with repair they draw the image of an order that is right, and few pixels need it.
#[test]
fn the_order_of_the_device_draws_what_an_exact_order_draws() {
    let gpu = gpu();
    let on_gpu = GpuScene::new(&gpu, mesh_scene(Field::Blobs.tets(9).unwrap(), &FOG));
    let mut flagged = 0;
    for distance in [1.0, 0.3, 0.1] {
        let view = view(perspective(), distance, 96, 72);
        let (exact, counters) = frame(&on_gpu, &view, "rank=mpvo");
        assert_eq!(counter(&counters, "cycles") + counter(&counters, "unsorted_pixels"), 0);
        let (image, counters) = frame(&on_gpu, &view, "");
        // Pieces may be taken in either order that meet within rounding.
        let most = |image: &Image| ImageErrors::between(image, &exact).unwrap().all.max_abs;
        assert!(most(&image) < 4e-6, "{distance}: {:.1e}", most(&image));
        assert_eq!(counter(&counters, "approximate"), 0);
        let unsorted = counter(&counters, "unsorted_pixels");
        let left = most(&frame(&on_gpu, &view, "rank=centroid,repair=none").0);
        assert_eq!(left > 4e-6, unsorted > 0, "{distance}: {left:.1e}, {unsorted} unsorted");
        flagged += unsorted;
    }
    assert!(flagged > 0);
}

#[track_caller]
fn assert_rmse(image: &Image, scene: &Scene, view: &View, most: f64, what: &str) {
    let errors = errors(image, scene, view);
    assert!(errors.all.rmse <= most, "{what}: {errors}, {most:e} is allowed");
}

/// The view from far away that shows the same.
fn far(distance: f64, side: u32) -> View {
    let half = (21.0_f64.to_radians().tan() / distance).atan();
    view(Projection::Perspective { fov_y_deg: 2.0 * half.to_degrees() }, distance, side, side)
}

#[test]
fn a_homogeneous_box_of_many_cells_is_the_box() {
    let gpu = gpu();
    let (n, tau) = (9, 1.5);
    let mesh = Field::Homogeneous(1.0).tets(n).unwrap();
    let scene = GpuScene::new(&gpu, mesh_scene(mesh, &[[0.0, 0.8, 0.4, 0.1, tau]]));
    let views = [
        view(perspective(), 1.0, 64, 48),
        view(orthographic(), 1.0, 64, 48),
        view(perspective(), 0.1, 64, 48),
        far(1e4, 48),
        // Every other face edge-on, edges on top of each other.
        View::new(Camera { eye: DVec3::Z * 4.0, up: DVec3::Y, ..camera(orthographic(), 1.0) }, 53, 53)
            .unwrap(),
    ];
    for view in &views {
        let distance = view.camera().eye.length().max(1.0);
        // At most 5 cells a cube and 3 n cubes on a line.
        let bound = 2e-6_f64.max(1.2e-7 * f64::from(15 * n)) + 4.0 * (-24.0_f64).exp2() * tau * distance;
        for spec in exact_specs(&gpu) {
            let (image, _) = frame(&scene, view, spec);
            let mut worst: f64 = 0.0;
            let mut seen = 0;
            for (i, pixel) in pixels(view).filter(|(_, pixel)| !on_outline(view, *pixel)) {
                let alpha = f64::from(image.pixels()[i][3]);
                let truth = -(-tau * chord(view, pixel)).exp_m1();
                seen += u32::from(truth > 0.0);
                worst = worst.max((alpha - truth).abs());
            }
            // A cell's thickness changes by at most 2 sqrt(3) its edge across itself, here some pixels; 1/256 of
            // a pixel of it, for a few cells a line.
            let bound = if spec.contains("space") { 2e-2 } else { bound };
            assert!(seen > 100 && worst <= bound, "{spec}, eye {}: off by {worst:e}", view.camera().eye);
        }
    }
}

#[test]
fn affine_fields_look_as_on_a_grid() {
    let gpu = gpu();
    let rows = [
        [0.0, 0.1, 0.9, 0.4, 0.0],
        [0.3, 0.3, 0.5, 0.4, 2.0],
        [0.5, 0.9, 0.2, 0.5, 0.1],
        [1.0, 0.9, 0.2, 0.5, 3.0],
    ];
    let grid = scene(Field::Ramp, 9, "f32", &rows);
    let on_gpu = GpuScene::new(&gpu, mesh_scene(Field::Ramp.tets(6).unwrap(), &rows));
    for view in [
        view(perspective(), 1.0, 64, 48),
        view(perspective(), 0.1, 64, 48),
        view(orthographic(), 1.0, 64, 48),
        view(orthographic(), 1e5, 64, 48),
    ] {
        for spec in exact_specs(&gpu) {
            let (image, counters) = frame(&on_gpu, &view, spec);
            assert_rmse(&image, &grid, &view, tolerance(spec), spec);
            assert_eq!([counter(&counters, "cycles"), counter(&counters, "approximate")], [0, 0]);
        }
    }
    // The reference's own rays are rounded to 1e5 * 2^-53.
    let view = far(1e5, 48);
    for spec in exact_specs(&gpu) {
        assert_rmse(&frame(&on_gpu, &view, spec).0, &grid, &view, tolerance(spec).max(3e-6), spec);
    }
}

/// Numbers in [0, 1) (Steele, Lea and Flood 2014: SplitMix64).
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ z >> 31) >> 11) as f64 * (-53.0_f64).exp2()
}

/// Tetrahedra side by side, of every class: random ones; and as seen along z such with a corner on an edge or on another corner, with an
/// edge-on face, needles and plates.
fn assorted(count: u32) -> Tets {
    let mut state = 7;
    let (mut points, mut cells, mut scalars) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..count * count {
        let mut corner = || DVec3::new(random(&mut state), random(&mut state), random(&mut state)) - 0.5;
        let mut corners = [corner(), corner(), corner(), corner()];
        let [a, b, c, _] = corners;
        match i % 8 {
            1 => corners[3] = DVec3::new(0.0, 0.0, 0.7) + (a + b) * 0.5,
            2 => corners[3] = DVec3::new(0.0, 0.0, 0.7) + a,
            3 => corners[2] = a.lerp(b, 1.6) - DVec3::Z * 0.4,
            4 => corners[3] = DVec3::new(0.0, 0.0, 0.7) + (a + b + c) / 3.0,
            5 => corners = corners.map(|p| DVec3::new(p.x, p.y * 1e-3, p.z)),
            6 => corners = corners.map(|p| DVec3::new(p.x, p.y, p.z * 1e-3)),
            _ => {}
        }
        let place = DVec3::new(f64::from(i % count), f64::from(i / count), 0.0) * 1.5;
        let first = points.len() as u32;
        points.extend(corners.map(|p| place + p));
        scalars.extend([0.2, 0.9, 0.4, 0.7_f32]);
        cells.push([first, first + 1, first + 2, first + 3]);
    }
    Tets::new(points, cells, TetScalars::Point(scalars)).unwrap().0
}

#[test]
fn cells_of_every_class_are_what_rays_meet() {
    let gpu = gpu();
    let count = 48;
    let mesh = assorted(count);
    assert!(mesh.cells().len() > 2200);
    let rows = [[0.0, 0.9, 0.1, 0.2, 0.5], [0.5, 0.2, 0.7, 0.3, 2.0], [1.0, 0.1, 0.3, 0.9, 4.0]];
    let scene = mesh_scene(mesh, &rows);
    let on_gpu = GpuScene::new(&gpu, scene.clone());
    let centre = DVec3::new(1.0, 1.0, 0.0) * 0.75 * f64::from(count - 1);
    let up = DVec3::Y;
    for (eye, projection) in [
        (centre + DVec3::Z * 99.0, Projection::Orthographic { half_height: 37.0 }),
        (centre + DVec3::new(9.0, -17.0, 70.0), Projection::Perspective { fov_y_deg: 60.0 }),
    ] {
        let view = View::new(Camera { eye, target: centre, up, projection }, 801, 797).unwrap();
        let truth = truth(&scene, &view);
        for spec in exact_specs(&gpu) {
            let (image, _) =
                frame(&on_gpu, &view, &format!("{},rank=centroid", spec.replace("rank=mpvo,", "")));
            let off = |(a, b): (&[f32; 4], &[f64; 4])| (0..4).any(|c| (f64::from(a[c]) - b[c]).abs() > 2e-4);
            let wrong = image.pixels().iter().zip(truth.pixels()).filter(|&pair| off(pair)).count();
            let covered = truth.pixels().iter().filter(|pixel| pixel[3] > 0.0).count();
            // Needles are 1/100 pixel wide: places, float32 in radii of 50, are off by 4e-5 pixel, and that changes their
            // thickness by more than is allowed. In space: of the pixels a third are at an outline, there within 1/256
            // pixel of it is one in a hundred, and where a face is edge-on thickness has a step.
            let most = if spec.contains("space") { covered / 200 } else { 12 };
            assert!(covered > 20_000 && wrong <= most, "{spec}: {wrong} of {covered} pixels");
        }
    }
}

#[test]
fn routes_and_directions_agree() {
    let gpu = gpu();
    let scene = mesh_scene(Field::Blobs.tets(8).unwrap(), &FOG);
    let on_gpu = GpuScene::new(&gpu, scene);
    for distance in [1.0, 0.1] {
        let view = view(perspective(), distance, 80, 60);
        for rank in ["mpvo", "centroid", "power"] {
            let one = frame(&on_gpu, &view, &format!("rank={rank},route=compute,repair=none")).0;
            let mut specs = vec!["route=compute,order=back-to-front,repair=none"];
            if routes_of(&gpu, Method::ProjectedTets).contains(&"raster") {
                specs.extend(["route=raster", "route=raster,order=back-to-front"]);
            }
            for spec in specs {
                let other = frame(&on_gpu, &view, &format!("rank={rank},{spec}")).0;
                let errors = ImageErrors::between(&other, &one).unwrap();
                // Some 60 blends, each rounded to 2^-24. Ranks from behind have ties the other way round.
                let most =
                    if spec.contains("back") && rank != "mpvo" { 2e-2 } else { 60.0 * (-23.0_f64).exp2() };
                assert!(errors.all.max_abs <= most, "{rank} {spec}: {errors}");
            }
        }
    }
}

/// Whatever the ranks: pixels in which cells do not come in order are known, and repaired.
#[test]
fn wrong_ranks_are_known_in_each_pixel_and_repaired() {
    let gpu = gpu();
    let scene = mesh_scene(Field::Blobs.tets(8).unwrap(), &FOG);
    let on_gpu = GpuScene::new(&gpu, scene.clone());
    let mut all_wrong = BTreeMap::new();
    for distance in [1.0, 0.1] {
        let view = view(perspective(), distance, 80, 60);
        let truth = truth(&scene, &view);
        for rank in ["centroid", "power", "mpvo"] {
            for order in ["front-to-back", "back-to-front"] {
                let draw = |repair: &str| {
                    let spec = format!("projected-tets:rank={rank},order={order},repair={repair}");
                    let mut frames = Renderer::new(&on_gpu, technique(&spec)).frames(&view).unwrap();
                    let counters = frames.draw(&view).unwrap().counters;
                    let flagged = frames.overflow_map().unwrap().unwrap();
                    let count = flagged.iter().filter(|&&flag| flag).count() as u64;
                    assert_eq!(counter(&counters, "unsorted_pixels"), count, "{spec}");
                    let image = frames.read_back().unwrap();
                    let off = |(p, t): (&[f32; 4], &[f64; 4])| {
                        (0..4).map(|c| (f64::from(p[c]) - t[c]).abs()).fold(0.0, f64::max)
                    };
                    let off: Vec<f64> = image.pixels().iter().zip(truth.pixels()).map(off).collect();
                    (flagged, off)
                };
                let what = format!("{rank} {order} from {distance}");
                let (flagged, off) = draw("none");
                let worst =
                    off.iter().zip(&flagged).filter(|pair| !pair.1).map(|pair| *pair.0).fold(0.0, f64::max);
                assert!(worst < 1e-5, "{what}: {worst:e} where cells came in order");
                let wrong = off.iter().filter(|&&off| off > 1e-4).count();
                let count = flagged.iter().filter(|&&flag| flag).count();
                assert!(rank != "mpvo" || wrong + count == 0, "{what}: {wrong} wrong, {count} flagged");
                *all_wrong.entry(rank).or_insert(0) += wrong;
                let (known, off) = draw("exact");
                assert_eq!(known, flagged, "{what}");
                let worst = off.into_iter().fold(0.0, f64::max);
                assert!(worst < 1e-5, "{what}: {worst:e} after repair");
            }
        }
    }
    assert!(all_wrong["centroid"] > 0 && all_wrong["power"] > 0, "{all_wrong:?}");
}

#[test]
fn fans_in_space_serve_every_view_from_one_eye() {
    let gpu = gpu();
    if !routes_of(&gpu, Method::ProjectedTets).contains(&"raster") {
        return;
    }
    let scene = mesh_scene(Field::Blobs.tets(7).unwrap(), &FOG);
    let on_gpu = GpuScene::new(&gpu, scene.clone());
    for (distance, rank) in [(1.0, "mpvo"), (0.1, "mpvo"), (0.1, "centroid"), (1.0, "power")] {
        let base = camera(perspective(), distance);
        let looking = |target: DVec3, fov_y_deg: f64| {
            let projection = Projection::Perspective { fov_y_deg };
            View::new(Camera { target, projection, ..base }, 64, 48).unwrap()
        };
        let spec = format!("projected-tets:plane=space,integrator=exact,rank={rank}");
        let first = looking(DVec3::ZERO, 42.0);
        let mut frames = Renderer::new(&on_gpu, technique(&spec)).frames(&first).unwrap();
        let mut reused = Vec::new();
        // Listing steps records nothing that a frame could reuse.
        assert!(!frames.plan().steps().iter().any(|step| step.contains("earlier")));
        let moved = View::new(Camera { eye: base.eye * 1.1, ..base }, 64, 48).unwrap();
        for view in [
            first,
            looking(DVec3::new(-0.6, 0.3, 0.2), 42.0),
            looking(DVec3::new(0.3, -0.1, 0.4), 15.0),
            looking(base.eye * 2.0 + DVec3::X * 0.1, 70.0),
            moved,
            moved,
        ] {
            let counters = frames.draw(&view).unwrap().counters;
            reused.push([counter(&counters, "fans_reused"), counter(&counters, "ranks_reused")]);
            let image = frames.read_back().unwrap();
            // Ties and sizes of neighbours are what centroids and power distances are wrong in.
            let most = if rank == "mpvo" { 1e-4 } else { 5e-3 };
            assert_rmse(&image, &scene, &view, most, &spec);
            let fresh = frame(&on_gpu, &view, &spec["projected-tets:".len()..]).0;
            let errors = ImageErrors::between(&image, &fresh).unwrap();
            // Other views weigh fans with other rounding; the order may not differ.
            assert!(errors.all.rmse < 1e-4, "{spec}: reused against made anew: {errors}");
        }
        assert_eq!(reused, [[0, 0], [1, 1], [1, 1], [1, 1], [0, 0], [1, 1]], "{spec}");
        // What an earlier submission wrote is made visible.
        let steps = frames.plan().steps();
        let earlier = ["polygons", "order"].map(|name| format!("{name}: from an earlier frame"));
        assert!(earlier.iter().all(|line| steps.contains(line)), "{steps:#?}");
    }
    // Of parallel rays the direction counts, not the place.
    let base = camera(orthographic(), 1.0);
    let shift = DVec3::new(0.2, -0.1, 0.3);
    let views = [base, Camera { eye: base.eye + shift, target: base.target + shift, ..base }]
        .map(|camera| View::new(camera, 40, 30).unwrap());
    let mut frames = Renderer::new(&on_gpu, technique("projected-tets:plane=space,integrator=exact"))
        .frames(&views[0])
        .unwrap();
    frames.draw(&views[0]).unwrap();
    let counters = frames.draw(&views[1]).unwrap().counters;
    assert_eq!(counter(&counters, "fans_reused"), 1);
    assert_rmse(&frames.read_back().unwrap(), &scene, &views[1], 1e-4, "moved sideways");
}

#[test]
fn a_plan_turns_to_views_that_need_other_ranks() {
    let gpu = gpu();
    let scene = mesh_scene(Field::Blobs.tets(6).unwrap(), &FOG);
    let on_gpu = GpuScene::new(&gpu, scene.clone());
    let views = [1.0, -1.0, 0.1].map(|distance| view(perspective(), distance, 48, 40));
    for spec in exact_specs(&gpu) {
        let technique = technique(&format!("projected-tets:{spec}"));
        let mut frames = Renderer::new(&on_gpu, technique).frames(&views[0]).unwrap();
        for view in views.iter().chain(&views) {
            frames.draw(view).unwrap();
            assert_rmse(&frames.read_back().unwrap(), &scene, view, tolerance(spec), spec);
        }
    }
}

#[test]
fn colours_of_vertices_err_by_what_is_documented() {
    let gpu = gpu();
    if !routes_of(&gpu, Method::ProjectedTets).contains(&"raster") {
        return;
    }
    let view = view(perspective(), 1.0, 96, 96);
    let scenes = [6, 12, 24].map(|cubes| {
        let scene = mesh_scene(Field::Blobs.tets(cubes).unwrap(), &FOG);
        (GpuScene::new(&gpu, scene.clone()), truth(&scene, &view))
    });
    for plane in ["image", "space"] {
        let rmse = scenes.each_ref().map(|(on_gpu, truth)| {
            let image = frame(on_gpu, &view, &format!("plane={plane},shade=vertex")).0;
            ImageErrors::between_f64(&image, truth).unwrap().all.rmse
        });
        println!("{plane}: {rmse:?}");
        // docs/TECHNIQUES.md: 1.2e-2 of 12 cubes; it falls with the cells' thickness.
        assert!((0.8e-2..1.6e-2).contains(&rmse[1]), "{plane}: {rmse:?}");
        assert!(rmse[1] < rmse[0] / 1.4 && rmse[2] < rmse[1] / 1.4, "{plane}: {rmse:?}");
    }
    // From inside too, where one cell has no fan.
    let inside = crate::common::view(perspective(), 0.1, 64, 64);
    let scene = mesh_scene(Field::Blobs.tets(12).unwrap(), &FOG);
    let image = frame(&GpuScene::new(&gpu, scene.clone()), &inside, "shade=vertex").0;
    assert_rmse(&image, &scene, &inside, 4e-2, "inside");
}

#[test]
fn scalars_of_cells_and_blank_cells() {
    let gpu = gpu();
    let mesh = Field::Blobs.tets(6).unwrap();
    let TetScalars::Point(mut at_points) = mesh.scalars().clone() else { panic!("scalars at points") };
    let mut state = 3;
    let mut in_cells: Vec<f32> = mesh.cells().iter().map(|_| random(&mut state) as f32).collect();
    for i in (0..in_cells.len()).step_by(7) {
        in_cells[i] = f32::NAN;
    }
    for i in (0..at_points.len()).step_by(23) {
        at_points[i] = f32::NAN;
    }
    at_points[5] = f32::INFINITY;
    let in_cells = mesh.clone().with_scalars(TetScalars::Cell(in_cells)).unwrap();
    let at_points = mesh.with_scalars(TetScalars::Point(at_points)).unwrap();
    for mesh in [in_cells, at_points] {
        let blank = mesh.blank_count();
        assert!(blank > 0);
        let scene = mesh_scene(mesh, &[[0.0, 0.1, 0.2, 0.7, 0.1], [1.0, 1.0, 0.25, 0.1, 4.0]]);
        let on_gpu = GpuScene::new(&gpu, scene.clone());
        for distance in [1.0, 0.1] {
            let view = view(perspective(), distance, 64, 48);
            for spec in exact_specs(&gpu) {
                let (image, counters) = frame(&on_gpu, &view, spec);
                assert_rmse(&image, &scene, &view, tolerance(spec), spec);
                let all = scene.mesh().unwrap().cells().len();
                assert_eq!(counter(&counters, "cells_seen"), (all - blank) as u64);
            }
        }
    }
}

#[test]
fn cells_in_which_nothing_is_visible_are_left_out() {
    let gpu = gpu();
    let mesh = Field::Blobs.tets(12).unwrap();
    let rows = [[0.6, 0.9, 0.3, 0.1, 0.0], [0.7, 0.9, 0.3, 0.1, 9.0], [0.8, 0.1, 0.3, 0.9, 0.0]];
    let TetScalars::Point(s) = mesh.scalars() else { panic!("scalars at points") };
    let meets = |cell: &&[u32; 4]| {
        let values = cell.map(|i| s[i as usize]);
        values.iter().any(|&s| s > 0.6) && values.iter().any(|&s| s < 0.8)
    };
    let seen = mesh.cells().iter().filter(meets).count();
    assert!(seen > 100 && seen < mesh.cells().len() / 2);
    let scene = mesh_scene(mesh, &rows);
    let on_gpu = GpuScene::new(&gpu, scene.clone());
    let view = view(perspective(), 1.0, 64, 48);
    for spec in exact_specs(&gpu) {
        let (image, counters) = frame(&on_gpu, &view, spec);
        assert_rmse(&image, &scene, &view, tolerance(spec), spec);
        assert_eq!(counter(&counters, "cells_seen"), seen as u64, "{spec}");
    }
}

#[test]
fn integrators_differ_by_their_own_errors() {
    let gpu = gpu();
    let view = view(perspective(), 1.0, 64, 48);
    // Extinction proportional to the scalar and one colour: the smoke model is exact.
    let smoke =
        mesh_scene(Field::Ramp.tets(5).unwrap(), &[[0.0, 0.6, 0.5, 0.4, 0.0], [1.0, 0.6, 0.5, 0.4, 2.5]]);
    let fog = mesh_scene(Field::Blobs.tets(12).unwrap(), &FOG);
    let on_gpu = [&smoke, &fog].map(|scene| GpuScene::new(&gpu, scene.clone()));
    for spec in exact_specs(&gpu) {
        let way = spec.split_once(',').unwrap().0;
        let most = tolerance(spec);
        let image = frame(&on_gpu[0], &view, &format!("{way},integrator=smoke,smoke=2.5")).0;
        assert_rmse(&image, &smoke, &view, most, way);
        // The mean colour of a cell is second order in its optical depth; a table has nodes.
        for (integrator, error) in [("integral", 1e-3), ("full", 1e-3)] {
            let image = frame(&on_gpu[1], &view, &format!("{way},integrator={integrator}")).0;
            assert_rmse(&image, &fog, &view, error + most, &format!("{way} {integrator}"));
        }
    }
}

#[test]
fn images_of_every_size() {
    let gpu = gpu();
    let scene = mesh_scene(Field::Blobs.tets(5).unwrap(), &FOG);
    let on_gpu = GpuScene::new(&gpu, scene.clone());
    for (width, height) in [(1, 1), (17, 9), (1, 40), (130, 3)] {
        let view = view(perspective(), 1.0, width, height);
        for spec in exact_specs(&gpu) {
            let (image, _) = frame(&on_gpu, &view, spec);
            assert_rmse(
                &image,
                &scene,
                &view,
                tolerance(spec).max(2e-6),
                &format!("{spec} {width} x {height}"),
            );
        }
    }
}

#[test]
fn options_that_do_not_go_together_are_refused() {
    let why = |spec: &str| Technique::parse(&format!("projected-tets:{spec}")).unwrap_err().to_string();
    assert!(why("stop=0.1,route=raster").contains("route=compute"));
    assert!(why("stop=0.1,plane=space").contains("route=compute"));
    assert!(why("route=compute,plane=space").contains("polygons"));
    assert!(why("route=compute,shade=vertex").contains("polygons"));
    assert!(why("rank=best").contains("mpvo, power, centroid"));
    assert!(why("k=3").contains("rank"));
    let text = "rank=power,route=raster,plane=space,shade=vertex,integrator=smoke,smoke=3,order=back-to-front,stop=0,empty-space=skip";
    let pairs = technique(&format!("projected-tets:{text}")).option_pairs();
    let read: Vec<String> = pairs.iter().map(|(key, value)| format!("{key}={value}")).collect();
    assert_eq!(read.join(","), text);
    let gpu = gpu();
    let grid = GpuScene::new(&gpu, scene(Field::Ramp, 3, "f32", &FOG));
    let view = view(perspective(), 1.0, 8, 8);
    assert!(Renderer::new(&grid, technique("projected-tets")).render(&view).is_err());
}

/// A real mesh, with fog over the range of its data that is as thick across it as across the cube.
fn real(name: &str) -> Option<Scene> {
    let path = shared(&format!("unstructured/{name}"))?;
    let mut options = ReadOptions::within(4 << 30);
    options.array = (name == "can_crush_hex.vtu").then(|| "cell:EQPS".to_string());
    let Data::Mesh(mesh) = io::read(&path, &options).unwrap().data else { panic!("{name} is no mesh") };
    let ([low, high], [a, b]) = (mesh.range(), mesh.bounds());
    let unit = 12_f64.sqrt() / (b - a).length();
    let rows = FOG.map(|[s, r, g, b, tau]| [low + (high - low) * s, r, g, b, tau * unit]);
    Some(mesh_scene(mesh, &rows))
}

#[test]
#[ignore = "make test-all: data that is not part of the project"]
fn real_meshes() {
    let gpu = gpu();
    for name in [
        "tiny_tets_ascii.vtk",
        "post_small.vtk",
        "can_crush_hex.vtu",
        "bracket_quadratic.vtu",
        "bluntfin_tets.vtu",
        "combustor_tets.vtu",
        "aneurysm_flow.vtu",
    ] {
        let Some(scene) = real(name) else { continue };
        let mesh = scene.mesh().unwrap();
        let [low, high] = mesh.bounds();
        let (centre, size) = ((low + high) * 0.5, (high - low).length());
        let cell = mesh.cells()[mesh.cells().len() / 3];
        let middle = cell.iter().map(|&i| mesh.points()[i as usize]).sum::<DVec3>() * 0.25;
        let wide = Projection::Perspective { fov_y_deg: 80.0 };
        let on_gpu = GpuScene::new(&gpu, scene.clone());
        for (eye, target, projection) in [
            (centre + size * DVec3::new(0.6, 0.45, 1.1), centre, perspective()),
            (centre + size * DVec3::new(0.3, -0.9, 0.5), centre, perspective()),
            (middle, centre + size * DVec3::new(0.31, 0.17, 0.11), wide),
        ] {
            let view = View::new(Camera { eye, target, up: DVec3::Z, projection }, 56, 56).unwrap();
            let truth = truth(&scene, &view);
            for spec in exact_specs(&gpu) {
                let (image, counters) = frame(&on_gpu, &view, spec);
                // Cells of the crushed can overlap: no order is right.
                let dropped = counter(&counters, "dropped_relations");
                assert!(dropped == 0 || name == "can_crush_hex.vtu", "{name}: {counters:?}");
                let errors = ImageErrors::between_f64(&image, &truth).unwrap();
                // Of so few pixels a single one at an outline, where faces are edge-on and thickness has a step, is
                // the error of fans in space.
                let (error, most) = match spec.contains("space") {
                    _ if dropped > 0 => (errors.all.rmse, 2e-3),
                    true => (errors.all.p99, 2e-4),
                    false => (errors.all.rmse, 2e-6),
                };
                assert!(error <= most, "{name} {spec} from {eye}: {errors}");
            }
        }
    }
}
