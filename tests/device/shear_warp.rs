//! `shear-warp`: what it shares with slices and slabs along the same lines, what the warp adds, and views from
//! everywhere.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of test images")]

use std::sync::Arc;

use crate::common::*;
use glam::{DMat3, DVec2, DVec3};
use volraster::GpuScene;
use volraster::Image;
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceOptions};
use volraster::scene::{Camera, Field, Grid, Projection, Samples, Scene, TransferFunction, View};
use volraster::technique::{Method, Renderer, Technique};
use volraster::{Plan, TargetDesc};

fn view_of(eye: DVec3, target: DVec3, up: DVec3, projection: Projection, [width, height]: [u32; 2]) -> View {
    View::new(Camera { eye, target, up, projection }, width, height).unwrap()
}

fn wide(fov_y_deg: f64) -> Projection {
    Projection::Perspective { fov_y_deg }
}

fn parallel(half_height: f64) -> Projection {
    Projection::Orthographic { half_height }
}

/// The largest difference of two images over all channels.
fn apart(a: &Image, b: &Image) -> f64 {
    ImageErrors::between(a, b).unwrap().all.max_abs
}

fn rmse(image: &Image, truth: &reference::ReferenceImage) -> f64 {
    ImageErrors::between_f64(image, truth).unwrap().all.rmse
}

fn counter(plan: &Plan, name: &str) -> Option<u64> {
    plan.counters().iter().find(|counter| counter.0 == name).map(|counter| counter.1)
}

/// Pixels with their centres.
fn pixels(view: &View) -> Vec<([u32; 2], DVec2)> {
    let [width, height] = view.extent();
    let centre = |x: u32, y: u32| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    (0..height).flat_map(|y| (0..width).map(move |x| ([x, y], centre(x, y)))).collect()
}

/// A field at unlike numbers of samples, about the origin, with the transfer function in units of the type.
fn brick(field: Field, dims: [u32; 3], spacing: DVec3, kind: &str, rows: &[[f64; 5]]) -> Scene {
    let top = match kind {
        "u8" => 255.0,
        "u16" => 65535.0,
        "i16" => 32767.0,
        _ => 1.0,
    };
    let rows: Vec<[f64; 5]> = rows.iter().map(|&[s, r, g, b, tau]| [s * top, r, g, b, tau]).collect();
    let last = DVec3::from_array(dims.map(|n| f64::from(n - 1)));
    let grid = field.sample(dims, kind).unwrap();
    let grid = grid.with_placement(spacing, last * spacing * -0.5, DMat3::IDENTITY).unwrap();
    Scene::new(grid, TransferFunction::from_rows(&rows).unwrap())
}

/// Views along each axis, both ways, for which the warp has nothing to do: parallel, and in perspective from a place beside
/// the centre.
fn upright_views() -> Vec<View> {
    let mut views = Vec::new();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let (along, up) = (DVec3::AXES[axis] * sign, DVec3::AXES[(axis + 1) % 3]);
            let eye = along * 4.5 + (DVec3::ONE - DVec3::AXES[axis]) * DVec3::new(0.11, -0.07, 0.05);
            let size = if sign > 0.0 { [33, 26] } else { [24, 29] };
            for projection in [parallel(1.137), wide(35.0)] {
                views.push(view_of(eye, eye - along, up, projection, size));
            }
        }
    }
    views
}

/// Where texels are pixels the picture is that of slices and of slabs along the same lines, whatever the type, the route
/// and where samples come from. Two float32 ways to the same places are up to two units in the last place of an index of 20
/// apart, 4e-6 of a voxel: with at most 0.3 of scalar a voxel and extinction that rises by 14 for one of scalar, 1.6e-5 a
/// unit of length. Of 15 to 19 such roundings that are independent about a quarter is left.
#[test]
fn without_a_warp_it_is_slices_or_slabs() {
    const ROUNDING: f64 = 5e-6;
    let gpu = gpu();
    let mut worst: f64 = 0.0;
    let mut compare = |scene: &Arc<GpuScene>, view: &View, want: &str, specs: &[&str], what: &str| {
        let want_image = draw_on(scene, view, want);
        let covered = want_image.pixels().iter().filter(|p| p[3] > 0.05).count();
        assert!(covered > 100, "{what}: only {covered} pixels of something");
        for spec in specs {
            let spec = format!("shear-warp:intermediate=pixel,filter=exact,{spec}");
            let off = apart(&draw_on(scene, view, &spec), &want_image);
            worst = worst.max(off);
            assert!(off <= ROUNDING, "{what} {spec} is not {want}: {off:e}\n{view:?}");
        }
    };
    let views = upright_views();
    for (kind, nth) in [("u8", 1), ("u16", 5), ("i16", 5), ("f32", 1)] {
        // Unlike sizes and spacings: slices lie where slices lie.
        let spacing = DVec3::new(0.17, 0.1, 0.13);
        let scene = GpuScene::new(&gpu, brick(Field::Blobs, [12, 19, 15], spacing, kind, &FOG));
        for (i, view) in views.iter().enumerate().step_by(nth) {
            let mut specs = vec!["route=compute,every=1", "route=raster"];
            // What else shall change nothing.
            specs.extend((kind == "f32").then_some("order=front-to-back"));
            specs.extend((kind == "u8" && i < 3).then(|| ["empty-space=march", "stacks=all", "stop=0"][i]));
            compare(&scene, view, "slices-2d:filter=exact", &specs, kind);
        }
    }
    for (kind, nth) in [("u8", 3), ("u16", 5), ("i16", 5), ("f32", 1)] {
        // Cubic voxels: a slab is a voxel thick, whatever the axis, and slices lie as they do counted from the other end.
        let scene = GpuScene::new(&gpu, brick(Field::Blobs, [12, 19, 15], DVec3::splat(0.12), kind, &FOG));
        let integrators =
            if kind == "f32" { ["exact", "integral", "full,table=64"].as_slice() } else { &["exact"] };
        for view in views.iter().step_by(nth) {
            for integrator in integrators {
                let specs = ["route=compute", "route=raster"];
                let specs = specs.map(|spec| format!("{spec},integrator={integrator}"));
                let want = format!("slabs:step=1,filter=exact,integrator={integrator}");
                compare(&scene, view, &want, &specs.each_ref().map(String::as_str), kind);
            }
            if !view.is_perspective() {
                let specs = ["step=0.5", "step=0.5,route=raster"];
                compare(&scene, view, "slices-2d:filter=exact,step=0.5", &specs, kind);
            }
        }
    }
    println!("largest difference: {worst:.1e}");
    assert!(worst > 0.0, "the comparison saw nothing");
}

/// Every so manieth slice stands for so many: those of a grid that has only these, seen along the stack.
#[test]
fn every_third_slice_is_a_grid_of_every_third() {
    let gpu = gpu();
    let scene = brick(Field::Blobs, [20, 20, 22], DVec3::splat(0.1), "f32", &FOG);
    let volraster::scene::Data::Grid(grid) = &scene.data else { unreachable!() };
    let mut thinned = Vec::new();
    for z in (0..22).step_by(3) {
        thinned.extend((0..400).map(|i| grid.value(i % 20, i / 20, z) as f32));
    }
    let spacing = DVec3::new(0.1, 0.1, 0.3);
    let thin = Grid::new([20, 20, 8], Samples::F32(thinned)).unwrap();
    let thin = thin.with_placement(spacing, grid.origin(), DMat3::IDENTITY).unwrap();
    let thin = GpuScene::new(&gpu, Scene::new(thin, scene.transfer.clone()));
    let full = GpuScene::new(&gpu, scene.clone());
    for projection in [parallel(1.1), wide(35.0)] {
        for up in [1.0, -1.0] {
            let view = view_of(DVec3::Z * 4.0 * up, DVec3::ZERO, DVec3::Y, projection, [30, 30]);
            let want = draw_on(&thin, &view, "shear-warp:intermediate=pixel,filter=exact");
            for route in ["compute", "raster"] {
                let spec = format!("shear-warp:intermediate=pixel,filter=exact,every=3,route={route}");
                let off = apart(&draw_on(&full, &view, &spec), &want);
                // The first and the last slab are cut at their slices. There lines are looked up where they pass the slice,
                // and the thinned grid beside the middle of the piece: across lines that is a shift.
                let most = if view.is_perspective() { 3e-2 } else { 2e-5 };
                assert!(off < most, "{projection:?} {up} {route}: {off:e}");
            }
        }
    }
    let rows = [[0.3, 1.0, 0.5, 0.2, 0.0], [0.32, 1.0, 0.5, 0.2, 20.0], [0.34, 1.0, 0.5, 0.2, 0.0]];
    let narrow = GpuScene::new(&gpu, brick(Field::Blobs, [40, 40, 42], DVec3::splat(0.05), "f32", &rows));
    // Oblique lines look up nothing that lies off them, so what shows nothing may be passed over.
    let view = view_of(DVec3::new(3.0, 2.0, 4.0), DVec3::ZERO, DVec3::Y, parallel(1.3), [40, 40]);
    for every in [3, 8, 21] {
        let draw = |options: &str| draw_on(&narrow, &view, &format!("shear-warp:every={every}{options}"));
        let off = apart(&draw(""), &draw(",empty-space=march"));
        assert!(off < 1e-6, "every {every}: {off:e}");
    }
    // 22 slices: with every=4 the last stands for less, and with every=64 one stands for all.
    let rows = [[0.0, 0.25, 0.5, 1.0, 1.0]];
    let box_scene =
        GpuScene::new(&gpu, brick(Field::Homogeneous(1.0), [20, 20, 22], DVec3::splat(0.1), "f32", &rows));
    let view = view_of(DVec3::Z * 4.0, DVec3::ZERO, DVec3::Y, parallel(0.5), [4, 4]);
    for every in [1, 4, 5, 64] {
        let image = draw_on(&box_scene, &view, &format!("shear-warp:every={every}"));
        let alpha = f64::from(image.pixel(1, 2)[3]);
        assert!((alpha + (-2.1_f64).exp_m1()).abs() < 2e-6, "every {every}: {alpha}");
    }
}

/// Whether a ray crosses both faces of the standard cube across an axis, and so do those so far beside it.
fn through_both_faces(view: &View, pixel: DVec2, axis: usize, beside: f64) -> bool {
    let (origin, direction) = view.ray(pixel);
    [-1.0, 1.0].into_iter().all(|face| {
        let t = (face - origin[axis]) / direction[axis];
        let at = (origin + direction * t).abs();
        let [u, v] = [at[(axis + 1) % 3], at[(axis + 2) % 3]];
        t.is_finite() && u.max(v) < 1.0 - beside
    })
}

/// A homogeneous cube has opacity `1 - exp(-tau d)` at any spacing of slices, to the bound of every technique in rgba32f. Parallel
/// lines through both base-plane faces are equally long, so that the warp between them changes nothing; in perspective
/// that holds where the warp does nothing.
#[test]
fn a_homogeneous_cube_is_exact_through_both_faces() {
    let gpu = gpu();
    let [mut worst, mut seen]: [f64; 2] = [0.0, 0.0];
    let oblique = [DVec3::new(0.3, 0.2, 4.0), DVec3::new(-4.0, 1.1, 1.7), DVec3::new(1.5, -3.8, -1.2)];
    let mut views: Vec<(View, f64)> = Vec::new();
    for eye in oblique {
        views.push((view_of(eye, DVec3::ZERO, DVec3::new(0.3, 0.2, 1.0), parallel(1.2), [36, 30]), 3.0));
    }
    views.push((view_of(DVec3::X * 300.0, DVec3::ZERO, DVec3::Z, parallel(1.2), [31, 30]), 3.0));
    let upright = upright_views();
    views.extend([upright[1], upright[6], upright[7]].map(|view| (view, 0.0)));
    for tau in [0.05, 1.0, 25.0] {
        let rows = [[0.0, 0.25, 0.5, 1.0, tau]];
        let scene = GpuScene::new(&gpu, scene(Field::Homogeneous(1.0), 9, "f32", &rows));
        for (view, margin) in &views {
            for spec in [
                "",
                "every=3",
                "route=raster",
                "step=0.37",
                "step=4,route=raster,order=front-to-back",
                "step=0.03,integrator=exact",
                "integrator=integral",
                "integrator=full,table=64",
                "integrator=exact,route=raster",
            ] {
                let spec = format!("shear-warp:intermediate=pixel,warp=bilinear,{spec}");
                let mut frames = Renderer::new(&scene, technique(&spec)).frames(view).unwrap();
                frames.draw(view).unwrap();
                let image = frames.read_back().unwrap();
                let axis = counter(frames.plan(), "stack_axis").unwrap() as usize;
                let slices = counter(frames.plan(), "slices").unwrap() as f64;
                let eye = view.camera().eye.length();
                let bound = (1.2e-7 * slices).max(2e-6) + 4.0 * (-24.0_f64).exp2() * tau * eye;
                for ([x, y], pixel) in pixels(view) {
                    // Texels are at most so far from the pixel, on the base plane.
                    let size = if view.is_perspective() { 0.02 } else { view.pixel_size() };
                    if !through_both_faces(view, pixel, axis, margin * size + 1e-3) {
                        continue;
                    }
                    seen += 1.0;
                    let alpha = -(-tau * chord(view, pixel)).exp_m1();
                    let [r, g, b, a] = image.pixel(x, y).map(f64::from);
                    worst = worst.max((a - alpha).abs() / bound);
                    assert!(
                        (a - alpha).abs() <= bound,
                        "{tau} {spec} at {x},{y}: {a}, not {alpha}\n{view:?}"
                    );
                    let colour = (r - 0.25 * a).abs().max((g - 0.5 * a).abs()).max((b - a).abs());
                    assert!(colour <= bound, "colour {r} {g} {b} of alpha {a}");
                }
            }
        }
    }
    println!("largest error: {worst:.3} of the bound, {seen} pixels");
    assert!(worst > 0.0 && seen > 27.0 * 7.0 * 100.0, "the comparison saw {seen} pixels");
}

/// In perspective opacity varies over the base plane, smoothly where lines pass both faces: a warp between texels leaves
/// `max |alpha''| h^2 / 8` along each axis, four times less for each halving of their distance h, and bicubic less than
/// that. With `d = 2 sqrt(1 + (r / e)^2)` on the plane at a distance e, `alpha'' <= 2 tau / e^2 exp(-2 tau)`.
#[test]
fn a_warped_homogeneous_cube_has_the_error_of_resampling() {
    let gpu = gpu();
    let tau = 0.5;
    let rows = [[0.0, 1.0, 1.0, 1.0, tau]];
    let scene = GpuScene::new(&gpu, scene(Field::Homogeneous(1.0), 9, "f32", &rows));
    let eye = DVec3::new(0.35, 0.25, 3.0);
    let view = view_of(eye, DVec3::new(0.05, 0.0, 0.3), DVec3::new(0.4, 1.0, 0.0), wide(60.0), [48, 40]);
    let error = |spec: &str| {
        let image = draw_on(&scene, &view, &format!("shear-warp:{spec}"));
        let mut worst: f64 = 0.0;
        for ([x, y], pixel) in pixels(&view) {
            if through_both_faces(&view, pixel, 2, 0.45) {
                let alpha = -(-tau * chord(&view, pixel)).exp_m1();
                worst = worst.max((f64::from(image.pixel(x, y)[3]) - alpha).abs());
            }
        }
        worst
    };
    for route in ["compute", "raster"] {
        let mut last = f64::INFINITY;
        for texels in [0.5, 1.0, 2.0] {
            let bilinear = error(&format!("intermediate={texels},route={route}"));
            let bicubic = error(&format!("intermediate={texels},route={route},warp=bicubic"));
            // Pixels of the base plane z = 1, a distance of 2 from the eye.
            let h = 2.0 * view.pixel_size() * 1.2 / texels;
            let bound = 2.0 * (2.0 * tau / 4.0 * (-2.0 * tau).exp()) * h * h / 8.0;
            println!("{route} {texels}: bilinear {bilinear:.2e} (bound {bound:.2e}), bicubic {bicubic:.2e}");
            assert!(bilinear > 0.05 * bound && bilinear < bound, "{bilinear:e} {bound:e}");
            assert!(bilinear < last / 3.0, "order: {last:e} {bilinear:e}");
            // One order more, down to rounding.
            assert!(bicubic < (0.1 * bilinear).max(1e-6), "{bicubic:e}, bilinear {bilinear:e}");
            last = bilinear;
        }
    }
}

/// A smooth field that is vacuum before the domain's faces: three unlike Gaussians in 40^3 samples, linear extinction.
fn smooth() -> Scene {
    let centres = [
        (DVec3::new(0.2, 0.1, -0.1), 0.9),
        (DVec3::new(-0.2, 0.25, 0.1), 0.6),
        (DVec3::new(0.0, -0.2, 0.2), 0.5),
    ];
    let value =
        |p: DVec3| centres.iter().map(|(c, a)| a * (-(p - *c).length_squared() / 0.08).exp()).sum::<f64>();
    let n = 40;
    let at = |i: u32| 2.0 * f64::from(i) / f64::from(n - 1) - 1.0;
    let samples = (0..n * n * n).map(|i| value(DVec3::new(at(i % n), at(i / n % n), at(i / n / n))) as f32);
    let grid = Grid::new([n, n, n], Samples::F32(samples.collect())).unwrap();
    let spacing = DVec3::splat(2.0 / f64::from(n - 1));
    let grid = grid.with_placement(spacing, DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let rows = [[0.0, 0.1, 0.3, 0.9, 0.0], [1.6, 1.0, 0.6, 0.2, 4.0]];
    Scene::new(grid, TransferFunction::from_rows(&rows).unwrap())
}

/// The warp's own error: second order in the texels' distance with bilinear, third with bicubic, down to that of the lines. Where
/// the domain's faces cut what is visible the picture has kinks, and there both lose an order on lines of pixels: half an
/// order of the root mean square.
#[test]
fn the_warp_s_error_has_its_order() {
    let gpu = gpu();
    for (name, scene) in [("gaussians", smooth()), ("blobs", scene(Field::Blobs, 32, "f32", &FOG))] {
        let view = view_of(DVec3::new(2.0, 1.5, 3.8), DVec3::ZERO, DVec3::Y, parallel(1.3), [44, 40]);
        let truth = truth(&scene, &view);
        let on_device = GpuScene::new(&gpu, scene);
        let errors = |warp: &str| {
            [0.25, 0.5, 1.0, 2.0, 4.0].map(|texels| {
                let spec = format!("shear-warp:step=0.25,integrator=exact,intermediate={texels},warp={warp}");
                rmse(&draw_on(&on_device, &view, &spec), &truth)
            })
        };
        let (bilinear, bicubic) = (errors("bilinear"), errors("bicubic"));
        println!("{name}: rmse with 1/4, 1/2, 1, 2, 4 texels a pixel's side");
        let orders = |errors: [f64; 5]| [0, 1, 2, 3].map(|i| (errors[i] / errors[i + 1]).log2());
        for (warp, errors) in [("bilinear", bilinear), ("bicubic", bicubic)] {
            let text = errors.map(|error| format!("{error:.2e}")).join(" ");
            println!("  {warp}: {text}, orders {:.2?}", orders(errors));
        }
        // Over three halvings.
        let order = |errors: [f64; 5], from: usize, to: usize| {
            (errors[from] / errors[to]).log2() / (to - from) as f64
        };
        if name == "gaussians" {
            assert!(orders(bilinear).iter().all(|&order| order > 1.6), "{bilinear:?}");
            assert!((1.85..2.2).contains(&order(bilinear, 1, 4)), "{bilinear:?}");
            assert!(order(bicubic, 0, 2) > 3.0 && bicubic[4] < 1.5e-5, "{bicubic:?}");
        } else {
            assert!(order(bilinear, 1, 4) > 1.6, "{bilinear:?}");
            assert!(order(bicubic, 1, 4) > 2.0, "{bicubic:?}");
            assert!((2..5).all(|i| bicubic[i] < 0.4 * bilinear[i]), "{bilinear:?} {bicubic:?}");
        }
    }
}

/// Places of the eye in and about the standard cube of 9 samples a side: its centre, a sample, a cell's middle, a place like
/// no other; on a face, an edge and a vertex, and a hair outside of a face.
fn places() -> Vec<(&'static str, DVec3)> {
    vec![
        ("centre", DVec3::ZERO),
        ("sample", DVec3::new(0.25, -0.5, 0.75)),
        ("cell", DVec3::new(0.125, 0.375, -0.625)),
        ("anywhere", DVec3::new(-0.31, 0.17, 0.43)),
        ("face", DVec3::new(0.2, 1.0, -0.3)),
        ("edge", DVec3::new(1.0, 0.1, -1.0)),
        ("vertex", DVec3::new(-1.0, 1.0, 1.0)),
        ("near", DVec3::new(0.1, 0.2, 1.0 + 1e-6)),
    ]
}

/// Which face of the standard cube the line of a pixel leaves by, with the length inside.
fn exit(view: &View, pixel: DVec2) -> (usize, f64) {
    let (origin, direction) = view.ray(pixel);
    let leave = ((direction.signum() - origin) / direction).to_array();
    ((0..3).min_by(|&i, &j| leave[i].total_cmp(&leave[j])).unwrap(), chord(view, pixel))
}

/// From an eye anywhere in the cube no pixel is off, at seams of base planes or elsewhere, to the error of resampling: 1e-3
/// where the lines of the texels around leave by one face. At an edge of the cube opacity has a kink, and bilinear leaves a
/// fourth of the texels' distance times the jump of its slope, first order: 5e-3 here. An eye on a face sees lengths jump from 0
/// to what they are: a filter blurs that, whatever its resolution.
#[test]
fn an_eye_inside_sees_no_seams() {
    let gpu = gpu();
    let tau = 1.6;
    let rows = [[0.0, 0.25, 0.5, 1.0, tau]];
    let scene = GpuScene::new(&gpu, scene(Field::Homogeneous(1.0), 9, "f32", &rows));
    let directions = [DVec3::NEG_Z, DVec3::new(0.6, 0.5, -0.7), DVec3::new(1.0, -1.0, 0.02)];
    let mut parted = 0;
    for (fov, size) in [(60.0, [48, 40]), (100.0, [48, 48]), (150.0, [64, 64])] {
        for warp in ["bilinear", "bicubic"] {
            let [mut flat, mut kinks, mut seams] = [(0.0_f64, 0); 3];
            for (name, eye) in places() {
                for direction in directions {
                    let view = view_of(eye, eye + direction, DVec3::Y, wide(fov), size);
                    let spec = format!("shear-warp:step=2,intermediate=2,warp={warp}");
                    let mut frames = Renderer::new(&scene, technique(&spec)).frames(&view).unwrap();
                    frames.draw(&view).unwrap();
                    let image = frames.read_back().unwrap();
                    parted += u32::from(counter(frames.plan(), "base_planes").unwrap() > 1);
                    for ([x, y], pixel) in pixels(&view) {
                        let (own, length) = exit(&view, pixel);
                        let alpha = -(-tau * length).exp_m1();
                        let [r, g, b, a] = image.pixel(x, y).map(f64::from);
                        let error = (a - alpha).abs();
                        assert!(
                            [r, g, b, a].iter().all(|v| v.is_finite()),
                            "{name} {fov} {warp}: {a} at {pixel}"
                        );
                        let colour = (r - 0.25 * a).abs().max((g - 0.5 * a).abs()).max((b - a).abs());
                        assert!(colour < 1e-5, "colour {r} {g} {b} of alpha {a}");
                        // The lines around, so far as the filter may reach.
                        let reach = if warp == "bicubic" { 1.6 } else { 0.8 };
                        let around =
                            [-1.0, 0.0, 1.0].map(|x| [-1.0, 0.0, 1.0].map(|y| DVec2::new(x, y) * reach));
                        let around = around.as_flattened().iter().map(|&offset| pixel + offset);
                        let lengths: Vec<(usize, f64)> = around.clone().map(|p| exit(&view, p)).collect();
                        let class = if lengths.iter().any(|(_, length)| *length == 0.0) {
                            // Nothing around, or a jump.
                            let nothing = lengths.iter().all(|(_, length)| *length == 0.0);
                            assert!(!nothing || a < 1e-5, "{name} {fov} {warp}: {a} of nothing at {pixel}");
                            continue;
                        } else if lengths.iter().any(|(face, _)| *face != own) {
                            &mut kinks
                        } else {
                            // Steepest planes of the lines around.
                            let steepest = around.map(|p| view.ray(p).1.abs()).map(|d| {
                                if d.x > d.y.max(d.z) {
                                    0
                                } else if d.y > d.z {
                                    1
                                } else {
                                    2
                                }
                            });
                            let first = {
                                let d = view.ray(pixel).1.abs();
                                if d.x > d.y.max(d.z) {
                                    0
                                } else if d.y > d.z {
                                    1
                                } else {
                                    2
                                }
                            };
                            if steepest.clone().any(|axis| axis != first) { &mut seams } else { &mut flat }
                        };
                        *class = (class.0.max(error), class.1 + 1);
                    }
                }
            }
            println!(
                "fov {fov}, {warp}: largest error and pixels: flat {flat:?}, at seams {seams:?}, at edges {kinks:?}"
            );
            assert!(flat.0 < 1e-3 && seams.0 < 1e-3, "fov {fov}, {warp}");
            assert!(flat.1 > 10_000 && seams.1 > 500, "fov {fov}, {warp}: {flat:?} {seams:?}");
            assert!(kinks.0 < 1e-2, "fov {fov}, {warp}: {kinks:?}");
        }
    }
    assert!(parted > 60, "only {parted} views have several base planes");
}

/// A camera on its way: from outside through a face, past the centre, and out by an edge, turning. Its pixels stay about as large
/// as a voxel.
fn path(turn: u32, turns: u32) -> View {
    let t = f64::from(turn) / f64::from(turns);
    // Control points: outside, in the face z = 1, beside the centre, on the edge, outside.
    let eye = if t < 0.6 {
        DVec3::new(0.3, 0.2, 3.5).lerp(DVec3::new(0.02, -0.03, 0.05), t / 0.6)
    } else {
        DVec3::new(0.02, -0.03, 0.05).lerp(DVec3::new(1.6, -1.6, 0.1), (t - 0.6) / 0.4)
    };
    let angle = (t * 720.0).to_radians();
    // Outside it looks at the cube, inside about.
    let about = DVec3::new(angle.sin(), 0.4 * (3.0 * angle).sin(), -angle.cos());
    let inside = ((1.3 - eye.abs().max_element()) * 3.0).clamp(0.0, 1.0);
    let direction = (-eye).normalize_or(DVec3::NEG_Z).lerp(about, inside);
    let direction = if direction.length() < 0.1 { DVec3::X } else { direction };
    let fov = 2.0 * (0.3 / (0.3 + eye.length())).atan().to_degrees();
    view_of(eye, eye + direction, DVec3::new(0.1, 1.0, 0.2), wide(fov), [32, 24])
}

/// 360 views on that way against the reference, each drawn by the plan that drew the one before: none is bad, and none has a
/// hole. The distance of slices leaves 1e-2 of these sharp shells, a line a pixel the rest.
#[test]
fn a_flight_through_the_volume_has_no_bad_view() {
    const TURNS: u32 = 360;
    // A step that hits the views which are compared with a fresh plan.
    let step: u32 = if exhaustive() { 1 } else { 3 };
    let gpu = gpu();
    let scene = scene(Field::MarschnerLobb, 40, "f32", &SHELLS);
    let on_device = GpuScene::new(&gpu, scene.clone());
    let spec = "shear-warp:step=0.25,integrator=exact,intermediate=pixel,warp=bicubic";
    let renderer = Renderer::new(&on_device, technique(spec));
    let mut frames = renderer.frames(&path(0, TURNS)).unwrap();
    let (mut worst, mut sum, mut planes, mut past) = ((0.0, 0), 0.0, [0; 7], 0);
    for turn in (1..TURNS).step_by(step as usize) {
        let view = path(turn, TURNS);
        frames.draw(&view).unwrap();
        let image = frames.read_back().unwrap();
        let truth = truth(&scene, &view);
        let errors = ImageErrors::between_f64(&image, &truth).unwrap();
        assert_eq!(errors.non_finite, 0, "view {turn}");
        sum += errors.all.rmse;
        if errors.all.rmse > worst.0 {
            worst = (errors.all.rmse, turn);
        }
        planes[counter(frames.plan(), "base_planes").unwrap() as usize] += 1;
        past += u32::from(truth.pixels().iter().any(|p| p[3] == 0.0));
        let holes = (0..768).filter(|&i| truth.pixels()[i][3] > 0.5 && image.pixels()[i][3] == 0.0);
        assert_eq!(holes.count(), 0, "view {turn}");
        if turn % 45 == 7 {
            let mut fresh = renderer.frames(&view).unwrap();
            fresh.draw(&view).unwrap();
            // Hysteresis may have kept another base plane.
            let axis = |plan: &Plan| counter(plan, "stack_axis");
            assert_eq!(axis(fresh.plan()), axis(frames.plan()), "view {turn}");
            assert_eq!(image, fresh.read_back().unwrap(), "view {turn}");
        }
    }
    let mean = sum * f64::from(step) / f64::from(TURNS);
    println!("rmse: mean {mean:.2e}, worst {:.2e} in view {}", worst.0, worst.1);
    println!("views by number of base planes: {planes:?}; {past} see past the domain");
    assert!(worst.0 < 1.5e-2 && mean < 5e-3, "view {}: {:e}, mean {mean:e}", worst.1, worst.0);
    let seen = [planes[1], planes[2], planes[3], past].map(|views| views * step);
    assert!(seen[0] > 100 && seen[1] > 50 && seen[2] > 30 && seen[3] > 20, "{planes:?} {past}");
}

/// Where two base planes serve alike the picture jumps from one to the other: by the difference of the lines' errors at the same
/// distance of slices, and of the warps', and both as small as one likes.
#[test]
fn a_switch_of_base_planes_is_small() {
    let gpu = gpu();
    let scene = scene(Field::Blobs, 32, "f32", &FOG);
    let on_device = GpuScene::new(&gpu, scene.clone());
    let at = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        view_of(DVec3::new(4.5 * sin, 0.4, 4.5 * cos), DVec3::ZERO, DVec3::Y, parallel(1.3), [48, 40])
    };
    let jump = |options: &str| {
        let renderer =
            Renderer::new(&on_device, technique(&format!("shear-warp:hysteresis=0.05,stacks=all,{options}")));
        let images = [(44.0, 2), (46.0, 0)].map(|(begin, axis)| {
            let mut frames = renderer.frames(&at(begin)).unwrap();
            frames.draw(&at(45.0)).unwrap();
            assert_eq!(counter(frames.plan(), "stack_axis"), Some(axis), "hysteresis keeps the plane in use");
            frames.read_back().unwrap()
        });
        let errors = ImageErrors::between(&images[0], &images[1]).unwrap().all;
        (errors.rmse, errors.max_abs, rmse(&images[0], &truth(&scene, &at(45.0))))
    };
    // Both pictures have the error of their warp, about as large.
    let (plain, plain_max, plain_error) = jump("step=0.5,integrator=exact,intermediate=pixel");
    let (fine, fine_max, fine_error) = jump("step=0.25,integrator=exact,intermediate=2,warp=bicubic");
    println!("jump {plain:.2e}, at most {plain_max:.2e}, error {plain_error:.2e}");
    println!("step 1/4, two texels a pixel's side, bicubic: {fine:.2e}, {fine_max:.2e}, {fine_error:.2e}");
    assert!(plain > 1e-4 && plain < 5e-3 && plain_max < 0.1, "{plain:e} {plain_max:e}");
    assert!(fine < 1e-3 && fine_max < 2e-2 && fine < 0.5 * plain, "{fine:e} {fine_max:e}");
}

/// The plane in use is kept until another leads by the hysteresis: a view that sways about 45 degrees does not flicker.
#[test]
fn hysteresis_keeps_the_base_plane() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 8, "f32", &FOG));
    // To and fro between 44 and 46 degrees, thrice, 0.2 degrees at a time.
    let sway: Vec<f64> = (0..61_i32).map(|i| 44.0 + 0.2 * f64::from((i % 20 - 10).abs())).collect();
    let switches = |projection: Projection, hysteresis: &str| {
        let at = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            view_of(DVec3::new(4.5 * sin, 0.02, 4.5 * cos), DVec3::ZERO, DVec3::Y, projection, [8, 8])
        };
        let spec = format!("shear-warp:stacks=all,hysteresis={hysteresis}");
        let mut frames = Renderer::new(&scene, technique(&spec)).frames(&at(sway[0])).unwrap();
        let mut axes = Vec::new();
        for &degrees in &sway {
            frames.draw(&at(degrees)).unwrap();
            axes.push(counter(frames.plan(), "stack_axis").unwrap());
        }
        axes.windows(2).filter(|pair| pair[0] != pair[1]).count()
    };
    for projection in [parallel(1.3), wide(3.0)] {
        // cos 44 - sin 44 is 0.025: past 45 degrees each time, or past 0.57 degrees beyond, or never.
        assert_eq!(switches(projection, "0"), 6, "{projection:?}");
        assert_eq!(switches(projection, "0.01"), 6, "{projection:?}");
        assert_eq!(switches(projection, "0.03"), 0, "{projection:?}");
    }
    // Within the hysteresis on both sides: never back.
    let small: Vec<f64> = (0..41_i32).map(|i| 44.6 + 0.2 * f64::from((i % 8 - 4).abs())).collect();
    assert!(small.iter().all(|&degrees| (44.5..45.5).contains(&degrees)));
    for (hysteresis, want) in [("0", true), ("0.01", false)] {
        let at = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            view_of(DVec3::new(4.5 * sin, 0.02, 4.5 * cos), DVec3::ZERO, DVec3::Y, parallel(1.3), [8, 8])
        };
        let spec = format!("shear-warp:stacks=all,hysteresis={hysteresis}");
        let mut frames = Renderer::new(&scene, technique(&spec)).frames(&at(45.4)).unwrap();
        let first = counter(frames.plan(), "stack_axis");
        let mut changed = false;
        for &degrees in &small {
            frames.draw(&at(degrees)).unwrap();
            changed |= counter(frames.plan(), "stack_axis") != first;
        }
        assert_eq!(changed, want, "hysteresis {hysteresis}");
    }
}

/// A volume far away: pixels of many voxels, a line a voxel, and the mean of the lines. One line a pixel misses what lies between.
#[test]
fn minified_lines_are_averaged() {
    let gpu = gpu();
    let checker =
        |i: u32| if (i % 64 / 3 + i / 64 % 64 / 3 + i / 4096 / 3).is_multiple_of(2) { 1.0 } else { 0.0 };
    let samples = (0..64 * 64 * 64).map(checker).collect();
    let grid = Grid::new([64; 3], Samples::F32(samples)).unwrap();
    let grid = grid.with_placement(DVec3::splat(2.0 / 63.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let rows = [[0.0, 0.2, 0.4, 1.0, 0.0], [0.5, 0.9, 0.4, 0.1, 0.2], [1.0, 1.0, 0.8, 0.3, 3.0]];
    let checkers = Scene::new(grid, TransferFunction::from_rows(&rows).unwrap());
    for (name, scene) in
        [("checkers", checkers), ("marschner-lobb", scene(Field::MarschnerLobb, 64, "f32", &SHELLS))]
    {
        let on_device = GpuScene::new(&gpu, scene.clone());
        for projection in [parallel(1.7), wide(42.0)] {
            let view = view_of(DVec3::new(1.2, 0.9, 4.2), DVec3::ZERO, DVec3::Y, projection, [16, 16]);
            let truth = reference::render(&scene, &view, &ReferenceOptions { samples: 8 }, None).unwrap();
            let error = |spec: &str| rmse(&draw_on(&on_device, &view, spec), &truth);
            let lines = "step=0.5,integrator=exact";
            let direct = error("slices-3d:step=0.25");
            let routes = if view.is_perspective() { ["compute"].as_slice() } else { &["compute", "raster"] };
            for route in routes {
                let of = |options: &str| error(&format!("shear-warp:{lines},route={route},{options}"));
                let (mip, bilinear) =
                    (of("intermediate=voxel,warp=mip"), of("intermediate=voxel,warp=bilinear"));
                let pixel = of("intermediate=pixel");
                println!(
                    "{name} {projection:?} {route}: mip {mip:.2e}, bilinear {bilinear:.2e}, a line a pixel {pixel:.2e}, slices-3d {direct:.2e}"
                );
                assert!(
                    mip < 0.35 * direct && mip < 0.4 * bilinear && mip < 0.35 * pixel,
                    "{name} {route}: {mip:e}"
                );
            }
        }
    }
}

/// Both routes draw the same lines: a few roundings a slice apart.
#[test]
fn raster_is_compute_to_rounding() {
    let gpu = gpu();
    let scene =
        GpuScene::new(&gpu, brick(Field::Blobs, [20, 17, 23], DVec3::new(0.1, 0.12, 0.09), "u16", &FOG));
    let up = DVec3::new(0.1, 1.0, 0.3);
    let size = [37, 30];
    let mut views = vec![
        view_of(DVec3::new(-3.0, 2.5, -0.8), DVec3::ZERO, up, parallel(0.4), size),
        view_of(DVec3::new(2.0, 1.5, 3.8), DVec3::ZERO, up, wide(42.0), size),
        view_of(DVec3::new(0.2, -3.5, 0.3), DVec3::ZERO, up, wide(42.0), size),
        view_of(DVec3::new(0.8, 0.7, 1.6), DVec3::ZERO, up, wide(80.0), size),
    ];
    for (fov, target) in [(60.0, DVec3::X), (100.0, DVec3::new(1.0, 1.0, 1.0)), (150.0, DVec3::NEG_Z)] {
        views.push(view_of(DVec3::new(0.1, -0.2, 0.15), target, up, wide(fov), size));
        // Straight ahead: pixels on the image's diagonals lie on seams, exactly.
        views.push(view_of(
            DVec3::ZERO,
            if fov < 120.0 { DVec3::Z } else { DVec3::NEG_Y },
            DVec3::X,
            wide(fov),
            [32, 32],
        ));
    }
    let (mut several, mut worst) = (0, 0.0_f64);
    for view in &views {
        for lines in ["", "step=0.6", "every=4", "integrator=exact", "step=1.5,integrator=integral"] {
            for warp in
                if lines.is_empty() { ["bilinear", "mip", "bicubic"].as_slice() } else { &["bilinear"] }
            {
                let spec = format!("shear-warp:warp={warp},stop=0,{lines}");
                let mut frames = Renderer::new(&scene, technique(&spec)).frames(view).unwrap();
                frames.draw(view).unwrap();
                several += u32::from(counter(frames.plan(), "base_planes").unwrap() > 1);
                let want = frames.read_back().unwrap();
                assert!(want.pixels().iter().any(|p| p[3] > 0.1), "nothing is seen of {view:?}");
                for order in ["back-to-front", "front-to-back"] {
                    let spec = format!("{spec},route=raster,order={order}");
                    let off = apart(&draw_on(&scene, view, &spec), &want);
                    worst = worst.max(off);
                    assert!(off < 1e-5, "{spec}: {off:e}\n{view:?}");
                }
            }
        }
    }
    println!("{worst:.1e} apart, {several} pictures of several base planes");
    assert!(several > 24);
}

/// Options out of range are refused in one line that names option and rule; those in force read back to themselves.
#[test]
fn options_are_checked() {
    for (options, words) in [
        ("every=0", ["every", "from 1 to 64"]),
        ("every=65", ["every", "from 1 to 64"]),
        ("every=1.5", ["every", "whole number"]),
        ("every=2,step=1", ["every", "step must be slices"]),
        ("step=0", ["step", "positive"]),
        ("step=none", ["step", "positive"]),
        ("intermediate=0", ["intermediate", "positive"]),
        ("intermediate=-1", ["intermediate", "positive"]),
        ("intermediate=inf", ["intermediate", "finite"]),
        ("intermediate=texel", ["intermediate", "positive"]),
        ("warp=nearest", ["warp", "bilinear, mip, bicubic"]),
        ("filter=nearest", ["filter", "hardware, exact"]),
        ("hysteresis=1", ["hysteresis", "below 1"]),
        ("hysteresis=-0.1", ["hysteresis", "below 1"]),
        ("hysteresis=nan", ["hysteresis", "below 1"]),
        ("stacks=none", ["stacks", "used, all"]),
        ("integrator=smoke", ["integrator", "smoke"]),
        ("table=16", ["table", "midpoint has no table"]),
        ("integrator=full,table=2048", ["table", "1024"]),
        ("prefilter=mip", ["prefilter", "must be one of"]),
        ("target=rgba8", ["target", "must be one of"]),
        ("dither=blue", ["dither", "must be one of"]),
        ("seed=1", ["seed", "must be one of"]),
        ("route=compute,order=front-to-back", ["route", "order"]),
        ("unheard=1", ["unheard", "intermediate"]),
    ] {
        let error = Technique::parse(&format!("shear-warp:{options}")).unwrap_err();
        let text = error.to_string();
        assert!(words.iter().all(|word| text.contains(word)) && !text.contains('\n'), "{options}: {text}");
        assert_eq!(error.exit_code(), 2, "{options}");
    }
    for options in [
        "",
        "every=7",
        "step=0.5,integrator=full,table=64,warp=mip",
        "filter=bicubic,intermediate=voxel",
        "filter=exact,intermediate=1.5,hysteresis=0",
        "intermediate=pixel,stacks=all,route=raster,order=front-to-back,stop=0.01",
        "empty-space=march,step=3",
    ] {
        let technique = technique(&format!("shear-warp:{options}"));
        let pairs: Vec<(String, String)> =
            technique.option_pairs().into_iter().map(|(key, value)| (key.to_string(), value)).collect();
        assert_eq!(Technique::new(Method::ShearWarp, &pairs).unwrap(), technique, "{options}: {pairs:?}");
    }
    assert_eq!(technique("shear-warp:filter=bicubic"), technique("shear-warp:warp=bicubic"));
}

/// What the device or the scene does not allow.
#[test]
fn what_cannot_be_drawn_is_refused() {
    let gpu = gpu();
    let view = view(perspective(), 1.0, 16, 16);
    let why = |scene: Scene, spec: &str| {
        let error = Renderer::new(&GpuScene::new(&gpu, scene), technique(spec))
            .prepare(&view, &TargetDesc::own())
            .unwrap_err();
        (error.to_string(), error.exit_code())
    };
    let blobs = || scene(Field::Blobs, 8, "f32", &FOG);
    let (text, code) = why(blobs(), "shear-warp:step=1e-7");
    assert!(text.contains("step") && text.contains("slices") && code == 2, "{text}");
    let mut samples = vec![0.5; 512];
    samples[77] = f32::NAN;
    let grid = Grid::new([8; 3], Samples::F32(samples)).unwrap();
    let hole = Scene::new(grid, TransferFunction::from_rows(&FOG).unwrap());
    let (text, code) = why(hole.clone(), "shear-warp:every=2");
    assert!(text.contains("NaN") && code == 3, "{text}");
    let mesh = Scene::new(Field::Blobs.tets(2).unwrap(), TransferFunction::from_rows(&FOG).unwrap());
    assert_eq!(why(mesh, "shear-warp").1, 2);
}

/// Flat grids, small images, views past the domain: what there is is drawn, and nothing is nothing.
#[test]
fn odd_inputs_are_drawn() {
    let gpu = gpu();
    let specs = [
        "route=compute",
        "filter=exact",
        "route=raster",
        "integrator=exact,warp=mip",
        "step=0.3,warp=bicubic",
    ];
    // Needles and sheets of one cell, across the view and along it: their opacity where lines meet them.
    for (dims, size) in [([2, 2, 65], DVec3::new(0.05, 0.05, 2.0)), ([33, 2, 33], DVec3::new(2.0, 0.02, 2.0))]
    {
        let last = DVec3::from_array(dims.map(|n: u32| f64::from(n - 1)));
        let grid = Grid::new(dims, Samples::U8(vec![255; dims.iter().product::<u32>() as usize])).unwrap();
        let grid = grid.with_placement(size / last, size * -0.5, DMat3::IDENTITY).unwrap();
        let rows = [[0.0, 1.0, 1.0, 1.0, 5.0]];
        let scene = Scene::new(grid, TransferFunction::from_rows(&rows).unwrap());
        let on_device = GpuScene::new(&gpu, scene.clone());
        for eye in [DVec3::new(0.0, 0.0, 3.0), DVec3::new(3.0, 0.1, 0.2), DVec3::new(0.01, 0.005, 0.2)] {
            let view =
                view_of(eye, DVec3::new(0.01, 0.0, 0.0), DVec3::new(0.1, 1.0, 0.0), wide(3.0), [40, 40]);
            let truth = truth(&scene, &view);
            let opaque = truth.pixels().iter().filter(|p| p[3] > 0.02).count();
            assert!(opaque > 100, "{dims:?} {eye}: {opaque}");
            for spec in specs {
                let image = draw_on(&on_device, &view, &format!("shear-warp:{spec},intermediate=2"));
                let error = rmse(&image, &truth);
                assert!(error < 0.03, "{dims:?} {eye} {spec}: {error:e}");
            }
        }
    }
    // Two samples along each axis, one cell.
    let tau = 0.8;
    let rows = [[0.0, 0.25, 0.5, 1.0, tau]];
    let cell = GpuScene::new(&gpu, scene(Field::Homogeneous(1.0), 2, "u8", &rows));
    for spec in specs {
        // One pixel, that shows the middle.
        for projection in [parallel(1.6), wide(20.0)] {
            let view = view(projection, 1.0, 1, 1);
            let image = draw_on(&cell, &view, &format!("shear-warp:{spec}"));
            let want = -(-tau * chord(&view, DVec2::splat(0.5))).exp_m1();
            let got = f64::from(image.pixel(0, 0)[3]);
            // A mip level of a pixel as large as the domain blurs all of it.
            let bound = if spec.contains("mip") && projection == parallel(1.6) { 0.5 } else { 0.02 };
            assert!((got - want).abs() < bound, "{projection:?} {spec}: {got} is not {want}");
        }
        // A row and a column.
        for (size, fov) in [([40, 1], 0.5), ([1, 40], 20.0)] {
            let view = view_of(DVec3::new(2.0, 1.5, 3.8), DVec3::ZERO, DVec3::Y, wide(fov), size);
            let image = draw_on(&cell, &view, &format!("shear-warp:{spec},intermediate=2"));
            for ([x, y], pixel) in pixels(&view) {
                let want = -(-tau * chord(&view, pixel)).exp_m1();
                let got = f64::from(image.pixel(x, y)[3]);
                assert!((got - want).abs() < 0.02, "{spec} {size:?} {x},{y}: {got} is not {want}");
            }
        }
        // Beside the domain, behind the eye, and with all of it behind and the eye at a face.
        let away = [
            view_of(DVec3::Z * 4.0, DVec3::new(9.0, 0.0, 4.0), DVec3::Y, wide(60.0), [12, 10]),
            view_of(DVec3::Z * 4.0, DVec3::Z * 5.0, DVec3::Y, wide(160.0), [12, 10]),
            view_of(DVec3::Z, DVec3::Z * 5.0, DVec3::Y, wide(120.0), [12, 10]),
            view_of(DVec3::new(0.0, 3.0, 9.0), DVec3::new(0.0, 3.0, 0.0), DVec3::Y, parallel(1.0), [12, 10]),
        ];
        let renderer = Renderer::new(&cell, technique(&format!("shear-warp:stacks=all,{spec}")));
        let seen = view(perspective(), 1.0, 12, 10);
        let mut frames = renderer.frames(&seen).unwrap();
        for view in &away {
            for image in [draw_on(&cell, view, &format!("shear-warp:{spec}")), {
                // After a frame that showed something.
                frames.draw(&seen).unwrap();
                assert!(frames.read_back().unwrap().pixels().iter().any(|p| p[3] > 0.1));
                frames.draw(view).unwrap();
                frames.read_back().unwrap()
            }] {
                assert!(image.pixels().iter().flatten().all(|&v| v == 0.0), "{spec} {view:?}");
            }
        }
    }
}
