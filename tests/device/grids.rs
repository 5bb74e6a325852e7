//! Every technique for grids against closed forms, the float64 reference and each other, on every route.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of test images")]

use crate::common::*;
use glam::{DMat3, DVec2, DVec3};
use volraster::GpuScene;
use volraster::gpu::GpuOptions;
use volraster::measure::ImageErrors;
use volraster::scene::{
    Camera, Field, Grid, Projection, Rescale, Samples, Scene, Surface, TransferFunction, View,
};
use volraster::technique::{Renderer, Technique};
use volraster::{Gpu, TargetDesc};

/// A homogeneous cube has opacity `1 - exp(-tau d)` at any spacing: what is left is rounding. The bound
/// is that of every technique in rgba32f: `max(2e-6, 1.2e-7 N)` for N blended pieces, and the rounding of
/// the depth at the eye's distance. What resamples an image is exact where pixels have lines of their own: `tests/device/extremes`.
#[test]
fn a_homogeneous_cube_is_exact() {
    let gpu = gpu();
    let mut worst: f64 = 0.0;
    for tau in taken(2, [0.05, 1.0, 25.0]) {
        let rows = [[0.0, 0.25, 0.5, 1.0, tau]];
        let scene = GpuScene::new(&gpu, scene(Field::Homogeneous(1.0), 9, "f32", &rows));
        for (projection, distance) in [
            (perspective(), 1.0),
            (perspective(), 0.12),
            (perspective(), 0.3),
            (orthographic(), 1.0),
            (orthographic(), 0.1),
        ] {
            let view = view(projection, distance, 36, 30);
            let eye = view.camera().eye.length();
            for step in taken(2, ["4", "0.37", "0.03"]) {
                for route in specs(&gpu).into_iter().filter(|spec| by_pixel(spec)) {
                    for order in if route.contains("raster") {
                        ["order=back-to-front,", "order=front-to-back,"].as_slice()
                    } else {
                        &[""]
                    } {
                        // Splats end lines sooner than the others.
                        let stop = if route.starts_with("splat") { ",stop=0" } else { "" };
                        let options = format!("{route},{order}step={step}{stop}");
                        let renderer = Renderer::new(&scene, technique(&options));
                        let mut frames = renderer.frames(&view).unwrap();
                        frames.draw(&view).unwrap();
                        let image = frames.read_back().unwrap();
                        let counters = frames.plan().counters();
                        let slices = counters.iter().find(|c| c.0 == "slices").map_or(0.0, |c| c.1 as f64);
                        let bound = (1.2e-7 * slices).max(2e-6) + 4.0 * (-24.0_f64).exp2() * tau * eye;
                        for (i, pixel) in pixels(&view).filter(|(_, pixel)| !on_outline(&view, *pixel)) {
                            let alpha = -(-tau * chord(&view, pixel)).exp_m1();
                            let [r, g, b, a] = image.pixels()[i].map(f64::from);
                            let error = (a - alpha).abs();
                            worst = worst.max(error / bound);
                            assert!(
                                error <= bound,
                                "tau {tau} {projection:?} x {distance} {options} at {pixel}: {a} is not {alpha} within {bound:e}"
                            );
                            // One colour everywhere: premultiplied it is the colour times alpha.
                            let colour = (r - 0.25 * a).abs().max((g - 0.5 * a).abs()).max((b - a).abs());
                            assert!(colour <= bound, "colour {r} {g} {b} of alpha {a}");
                        }
                    }
                }
            }
        }
    }
    println!("largest error: {worst:.3} of the bound");
    assert!(worst > 0.0, "the comparison saw nothing");
}

/// Every sample type, rescale and placement gives the picture that the reference draws of it. The bound
/// is ten times the sampling error of the plain float32 grid; a wrong scale, axis or sign costs more
/// than a thousand times as much (asserted below with a mirrored axis).
#[test]
fn sample_types_and_placements_match_the_reference() {
    let gpu = gpu();
    let rows = [[0.0, 0.2, 0.6, 1.0, 0.0], [1.0, 1.0, 0.5, 0.1, 3.0]];
    let base = Field::Blobs.sample([14, 12, 10], "f32").unwrap();
    let values: Vec<f64> = (0..base.samples().len()).map(|i| base.samples().get(i)).collect();
    let dims = base.dims();
    let scaled = |scale: f64, offset: f64| values.iter().map(move |v| (v * scale + offset).round());
    let grids = [
        ("f32", Grid::new(dims, base.samples().clone()).unwrap(), Rescale::IDENTITY),
        (
            "u8",
            Grid::new(dims, Samples::U8(scaled(255.0, 0.0).map(|v| v as u8).collect())).unwrap(),
            Rescale { slope: 1.0 / 255.0, intercept: 0.0 },
        ),
        (
            "u16",
            Grid::new(dims, Samples::U16(scaled(65535.0, 0.0).map(|v| v as u16).collect())).unwrap(),
            Rescale { slope: 1.0 / 65535.0, intercept: 0.0 },
        ),
        (
            "i16",
            Grid::new(dims, Samples::I16(scaled(65535.0, -32768.0).map(|v| v as i16).collect())).unwrap(),
            Rescale { slope: 1.0 / 65535.0, intercept: 32768.0 / 65535.0 },
        ),
        (
            "u8 negative slope",
            Grid::new(dims, Samples::U8(scaled(-255.0, 255.0).map(|v| v as u8).collect())).unwrap(),
            Rescale { slope: -1.0 / 255.0, intercept: 1.0 },
        ),
    ];
    let shear =
        DMat3::from_cols(DVec3::new(0.9, 0.1, 0.0), DVec3::new(-0.2, 0.0, 1.0), DVec3::new(0.1, 0.8, 0.3));
    for (name, grid, rescale) in taken(2, grids) {
        for direction in [DMat3::IDENTITY, DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), shear] {
            let centre = direction * (DVec3::new(0.15, 0.18, 0.2) * grid.last_index() * 0.5);
            let grid = grid.clone().with_rescale(rescale).unwrap();
            let grid = grid.with_placement(DVec3::new(0.15, 0.18, 0.2), -centre, direction).unwrap();
            let scene = Scene::new(grid, TransferFunction::from_rows(&rows).unwrap());
            let view = view(perspective(), 1.0, 30, 25);
            let truth = truth(&scene, &view);
            let on_device = GpuScene::new(&gpu, scene);
            for spec in specs(&gpu).into_iter().filter(|spec| by_pixel(spec)) {
                for filter in ["hardware", "exact"] {
                    let options = with_option(&format!("{spec},step=0.1"), "filter", filter);
                    let image = draw_on(&on_device, &view, &options);
                    let errors = ImageErrors::between_f64(&image, &truth).unwrap();
                    assert!(errors.all.rmse < 3e-4, "{name} {direction} {spec} {filter}: {errors}");
                }
            }
        }
    }
    // The comparison sees a mirrored axis.
    let view = view(perspective(), 1.0, 60, 50);
    let scene = Scene::new(base.clone(), TransferFunction::from_rows(&rows).unwrap());
    let mirrored = base
        .with_placement(
            DVec3::new(2.0 / 13.0, 2.0 / 11.0, 2.0 / 9.0),
            DVec3::new(1.0, -1.0, -1.0),
            DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)),
        )
        .unwrap();
    let mirrored = Scene::new(mirrored, scene.transfer.clone());
    assert!(errors(&draw(&gpu, &mirrored, &view, "slices-3d:step=0.1"), &scene, &view).all.rmse > 1e-2);
}

/// One bright sample near a corner appears where the camera says, upright and not mirrored.
#[test]
fn an_asymmetric_volume_appears_where_it_is() {
    let gpu = gpu();
    let n = 17;
    for [x, y, z] in [[14_u32, 3, 5], [2, 13, 8], [9, 4, 14]] {
        let mut samples = vec![0_u8; (n * n * n) as usize];
        samples[((z * n + y) * n + x) as usize] = 255;
        let grid = Grid::new([n, n, n], Samples::U8(samples)).unwrap();
        let grid = grid.with_placement(DVec3::splat(0.125), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
        let position = grid.world_of_index(DVec3::new(f64::from(x), f64::from(y), f64::from(z)));
        let transfer =
            TransferFunction::from_rows(&[[0.0, 1.0, 1.0, 1.0, 0.0], [255.0, 1.0, 1.0, 1.0, 20.0]]).unwrap();
        let scene = Scene::new(grid, transfer);
        let on_device = GpuScene::new(&gpu, scene);
        for projection in [perspective(), orthographic()] {
            let view = view(projection, 1.0, 90, 70);
            let (expected, _) = view.project(position).unwrap();
            for route in specs(&gpu) {
                let image = draw_on(&on_device, &view, &format!("{route},step=0.25"));
                let (mut sum, mut centre) = (0.0, DVec2::ZERO);
                for py in 0..70 {
                    for px in 0..90 {
                        let a = f64::from(image.pixel(px, py)[3]);
                        sum += a;
                        centre += DVec2::new(f64::from(px) + 0.5, f64::from(py) + 0.5) * a;
                    }
                }
                assert!(sum > 1.0, "nothing was drawn");
                // The footprint is symmetric about the sample but for perspective, a tenth of a pixel.
                assert!(
                    (centre / sum - expected).length() < 0.3,
                    "{projection:?} {route}: {} is not {expected}",
                    centre / sum
                );
            }
        }
    }
}

/// A cell that touches a NaN is vacuum, an infinity takes the transfer function's end, and neither
/// reaches its neighbours.
#[test]
fn not_a_number_is_vacuum_and_infinity_is_an_end() {
    let gpu = gpu();
    let base = Field::Ramp.sample([8, 8, 8], "f32").unwrap();
    let Samples::F32(values) = base.samples().clone() else { panic!("f32 was asked for") };
    let rows = [[0.0, 0.2, 0.6, 1.0, 0.5], [1.0, 1.0, 0.5, 0.1, 3.0]];
    for special in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut values = values.clone();
        values[(3 * 8 + 4) * 8 + 2] = special;
        let grid = Grid::new([8, 8, 8], Samples::F32(values)).unwrap();
        let grid = grid.with_placement(DVec3::splat(2.0 / 7.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
        // Two knots are walked through, forty are searched.
        let few = TransferFunction::from_rows(&rows).unwrap();
        let many: Vec<[f64; 5]> = (0..40)
            .map(|i| {
                let (c, tau) = few.at(f64::from(i) / 39.0);
                [f64::from(i) / 39.0, c.x, c.y, c.z, tau]
            })
            .collect();
        let many = TransferFunction::from_rows(&many).unwrap();
        for (projection, transfer) in
            taken(2, [(perspective(), &few), (orthographic(), &few), (perspective(), &many)])
        {
            let scene = Scene::new(grid.clone(), transfer.clone());
            let view = view(projection, 1.0, 36, 30);
            let truth = truth(&scene, &view);
            let on_device = GpuScene::new(&gpu, scene);
            // Beside a NaN splats go on: what is left of a sum of weights has a mean.
            for route in specs(&gpu).iter().filter(|spec| has_option(spec, "filter") && by_pixel(spec)) {
                for filter in ["exact", "hardware"] {
                    let image = draw_on(&on_device, &view, &format!("{route},step=0.02,filter={filter}"));
                    let errors = ImageErrors::between_f64(&image, &truth).unwrap();
                    // First order at the vacuum's faces: half a step of 0.006 times tau of 3.
                    assert!(
                        errors.all.rmse < 2e-3 && errors.all.max_abs < 1.5e-2,
                        "{special} {projection:?} {route} {filter}: {errors}"
                    );
                }
            }
        }
    }
}

/// More knots than the shader walks through are searched; both evaluate the same function, also where data
/// lies left of the first knot and right of the last.
#[test]
fn many_knots_match_few() {
    let gpu = gpu();
    let grid = Field::Blobs.sample([16, 16, 16], "f32").unwrap();
    let view = view(perspective(), 1.0, 60, 50);
    for rows in [FOG.as_slice(), &FOG[2..4]] {
        let few = TransferFunction::from_rows(rows).unwrap();
        let [lo, hi] = few.domain();
        // 2,000 knots take more bytes than a uniform buffer may bind.
        let dense = (0..=2000).map(|i| {
            let s = lo + (hi - lo) * f64::from(i) / 2000.0;
            let (c, tau) = few.at(s);
            [s, c.x, c.y, c.z, tau]
        });
        // No two knots at the ends: a jump there would hide an extrapolation.
        let inner = rows.iter().copied().filter(|row| row[0] > lo && row[0] < hi);
        let mut many: Vec<[f64; 5]> = dense.chain(inner).collect();
        many.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let many = TransferFunction::from_rows(&many).unwrap();
        let scenes = [few, many].map(|transfer| GpuScene::new(&gpu, Scene::new(grid.clone(), transfer)));
        for route in specs(&gpu) {
            let [few, many] =
                scenes.each_ref().map(|scene| draw_on(scene, &view, &format!("{route},step=0.5")));
            let errors = ImageErrors::between(&few, &many).unwrap();
            assert!(errors.all.max_abs < 1e-5, "{route}: {errors}");
        }
    }
}

/// At two knots of one scalar the later one holds, walked through or searched.
#[test]
fn a_jump_is_continuous_from_the_right() {
    let gpu = gpu();
    let camera =
        Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection: orthographic() };
    let view = View::new(camera, 3, 3).unwrap();
    for padding in taken(2, [0, 1, 2, 30]) {
        // The jump at the data's value is the last of the knots, or followed by others.
        for after in [0, 1] {
            let mut rows = vec![[0.0, 1.0, 1.0, 1.0, 9.0]; 1 + padding];
            rows.extend([[1.0, 1.0, 1.0, 1.0, 9.0], [1.0, 1.0, 1.0, 1.0, 0.25]]);
            rows.extend(vec![[2.0, 1.0, 1.0, 1.0, 5.0]; after]);
            let on_device = GpuScene::new(&gpu, scene(Field::Homogeneous(1.0), 3, "f32", &rows));
            for route in specs(&gpu) {
                let a = f64::from(draw_on(&on_device, &view, &format!("{route},step=0.5")).pixel(1, 1)[3]);
                let want = -(-0.5_f64).exp_m1();
                assert!(
                    (a - want).abs() < 2e-6,
                    "{route} padding {padding} after {after}: {a} is not {want}"
                );
            }
        }
    }
}

/// Extremes: nothing is lost in thin media, nothing overflows in thick ones, and a far eye costs nothing.
#[test]
fn extremes_stay_exact() {
    let gpu = gpu();
    let square = |projection, distance, side: u32| {
        let camera =
            Camera { eye: DVec3::new(0.0, 0.0, distance), target: DVec3::ZERO, up: DVec3::Y, projection };
        View::new(camera, side, side).unwrap()
    };
    let of = |tau: f64| {
        GpuScene::new(&gpu, scene(Field::Homogeneous(1.0), 3, "f32", &[[0.0, 1.0, 1.0, 1.0, tau]]))
    };
    let (thin, nothing) = (of(0.5e-8), of(0.0));
    let thick = [60.0, 1e4, 1e30, 1e300].map(|tau| (tau, of(tau)));
    let blobs = scene(Field::Blobs, 16, "f32", &FOG);
    // A million sizes away, through a small angle; the cube is 20.2 pixels of 31 wide.
    let far =
        square(Projection::Perspective { fov_y_deg: (3.07e-6_f64 / 2.0).atan().to_degrees() * 2.0 }, 1e6, 31);
    // A wide angle from inside, a very narrow image, and the view along an axis from a face.
    let others = [
        square(Projection::Perspective { fov_y_deg: 170.0 }, 0.5, 40),
        View::new(camera(perspective(), 1.0), 1, 64).unwrap(),
        square(perspective(), 1.0, 33),
    ];
    let far_truth = truth(&blobs, &far);
    let other_truths = others.each_ref().map(|view| truth(&blobs, view));
    let blobs = GpuScene::new(&gpu, blobs);
    let centre = |scene: &std::sync::Arc<GpuScene>, view: &View, options: &str| {
        draw_on(scene, view, options).pixel(0, 0).map(f64::from)
    };
    for route in specs(&gpu) {
        let parallel = square(orthographic(), 4.0, 1);
        // Thin: 1 - exp(-od) would give 0. One slab of 2 units, then 1000.
        for (step, tolerance) in [("9", 1e-6), ("0.002", 1e-3)] {
            let a = centre(&thin, &parallel, &format!("{route},step={step}"))[3];
            assert!((a / 1e-8 - 1.0).abs() <= tolerance, "{route} step {step}: {a}");
        }
        // Thick: alpha is 1 and the colour is the colour.
        for (tau, thick) in &thick {
            let p = centre(thick, &parallel, &format!("{route},step=0.5"));
            assert_eq!(p, [1.0; 4], "{route} tau {tau}");
        }
        // Nothing: exactly transparent black.
        assert_eq!(centre(&nothing, &parallel, &route), [0.0; 4]);
        if !by_pixel(&route) {
            continue;
        }
        let spec = with_option(&format!("{route},step=0.05"), "filter", "exact");
        let errors = ImageErrors::between_f64(&draw_on(&blobs, &far, &spec), &far_truth).unwrap();
        assert!(errors.all.rmse < 1e-4, "{route}: {errors}");
        for (view, truth) in others.iter().zip(&other_truths) {
            let errors = ImageErrors::between_f64(&draw_on(&blobs, view, &spec), truth).unwrap();
            // At 85 degrees off the axis planar slices lie 1/cos = 11 times as far apart along the ray; the
            // scalar's curvature between a segment's ends costs up to twice what it does in the middle.
            assert!(
                errors.non_finite == 0 && errors.all.rmse < if route.contains("slabs") { 2e-3 } else { 1e-3 },
                "{route} {:?}: {errors}",
                view.camera()
            );
        }
    }
}

/// The world's unit of length does not matter, be it a parsec in centimetres or an angstrom in metres.
#[test]
fn the_scale_of_the_world_does_not_matter() {
    let gpu = gpu();
    let plain = scene(Field::Blobs, 16, "f32", &FOG);
    let scaled = [3e21, 3e18, 1e-10, 1e-20].map(|unit| {
        let grid = plain.grid().unwrap().clone();
        let grid = grid
            .with_placement(DVec3::splat(2.0 / 15.0 * unit), DVec3::NEG_ONE * unit, DMat3::IDENTITY)
            .unwrap();
        let rows: Vec<[f64; 5]> = FOG.iter().map(|&[s, r, g, b, tau]| [s, r, g, b, tau / unit]).collect();
        let transfer = TransferFunction::from_rows(&rows).unwrap();
        (unit, GpuScene::new(&gpu, Scene::new(grid, transfer)))
    });
    let on_device = GpuScene::new(&gpu, plain);
    for projection in [perspective(), orthographic()] {
        let base = camera(projection, 1.0);
        let view = View::new(base, 60, 50).unwrap();
        for route in specs(&gpu) {
            let options = format!("{route},step=0.5");
            let want = draw_on(&on_device, &view, &options);
            for (unit, scene) in &scaled {
                let unit = *unit;
                let projection = match projection {
                    Projection::Orthographic { half_height } => {
                        Projection::Orthographic { half_height: half_height * unit }
                    }
                    perspective => perspective,
                };
                let view = View::new(Camera { eye: base.eye * unit, projection, ..base }, 60, 50).unwrap();
                let errors = ImageErrors::between(&draw_on(scene, &view, &options), &want).unwrap();
                // The same numbers but for the rounding of the scaled ones. Where that turns the rounding of a coarse weight, one
                // sample takes 2 errors of its neighbours' difference more: here far below an error in colour.
                assert!(
                    errors.all.max_abs < 2e-5 + 0.3 * gpu.filter_error().unwrap(),
                    "{unit:e} {route} {projection:?}: {errors}"
                );
            }
        }
    }
    // Beyond float32 it is refused, not drawn wrong.
    let far =
        View::new(Camera { eye: DVec3::new(0.0, 0.0, 1e39), ..camera(perspective(), 1.0) }, 8, 8).unwrap();
    let error = Renderer::new(&on_device, Technique::default()).render(&far).unwrap_err();
    assert!(error.to_string().contains("float32") && error.exit_code() == 2, "{error}");
}

/// Early termination counts with the colours: what is bright shows through more.
#[test]
fn bright_colours_behind_opaque_matter_are_not_lost() {
    let gpu = gpu();
    // Dark and dense in front (z = 1), bright behind: transmittance is some 1e-7 where brightness begins.
    let rows = [[0.5, 0.0, 0.0, 0.0, 16.0], [0.5, 1e5, 1e5, 1e5, 1.0]];
    let samples = (0..4 * 4 * 4).map(|i| if i < 32 { 1.0 } else { 0.0 }).collect();
    let grid = Grid::new([4, 4, 4], Samples::F32(samples)).unwrap();
    let grid = grid.with_placement(DVec3::splat(2.0 / 3.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let scene = Scene::new(grid, TransferFunction::from_rows(&rows).unwrap());
    let camera =
        Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection: orthographic() };
    let view = View::new(camera, 9, 9).unwrap();
    let want = truth(&scene, &view).pixel(4, 4)[0];
    assert!(want > 1e-3, "the scene shows what it should: {want}");
    let on_device = GpuScene::new(&gpu, scene.clone());
    for route in taken(2, specs(&gpu)) {
        let got = f64::from(draw_on(&on_device, &view, &format!("{route},step=0.01")).pixel(4, 4)[0]);
        // Sampling places the jump to half a step: 16 * 0.003 of optical depth in front of it.
        assert!((got / want - 1.0).abs() < 0.1, "{route}: {got} is not {want}");
    }
    // In several dispatches too, though transmittance is then some 1e-7 between two of them.
    let split = gpu_with(GpuOptions { loop_limit: Some(1500), ..GpuOptions::default() });
    let on_device = GpuScene::new(&split, scene);
    for route in taken(2, specs(&gpu).iter().filter(|route| route.contains("compute"))) {
        let got = f64::from(draw_on(&on_device, &view, &format!("{route},step=0.01")).pixel(4, 4)[0]);
        assert!((got / want - 1.0).abs() < 0.1, "{route} in parts: {got} is not {want}");
    }
}

/// Integer data exactly on a jump takes the later knot, whatever its type and sign.
#[test]
fn integers_fall_on_the_right_side_of_a_jump() {
    let gpu = gpu();
    let camera =
        Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection: orthographic() };
    let view = View::new(camera, 3, 3).unwrap();
    let mut cases: Vec<(Samples, f64)> = Vec::new();
    for v in [i16::MIN, i16::MIN + 1, -20_001, -16_384, -16_352, -1000, -3, -1, 0, 1, 7, 12_345, i16::MAX] {
        cases.push((Samples::I16(vec![v; 8]), f64::from(v)));
    }
    for v in [0, 1, 255, 256, 40_001, 65_535] {
        cases.push((Samples::U16(vec![v; 8]), f64::from(v)));
    }
    for v in [0, 1, 127, 254, 255] {
        cases.push((Samples::U8(vec![v; 8]), f64::from(v)));
    }
    for (samples, value) in cases {
        let grid = Grid::new([2, 2, 2], samples.clone()).unwrap();
        let grid = grid.with_placement(DVec3::splat(2.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
        let rows =
            [[value - 1.0, 1.0, 1.0, 1.0, 9.0], [value, 1.0, 1.0, 1.0, 9.0], [value, 1.0, 1.0, 1.0, 0.25]];
        let scene = Scene::new(grid, TransferFunction::from_rows(&rows).unwrap());
        let on_device = GpuScene::new(&gpu, scene);
        // A sampler's filter may round even between equal samples.
        // Splats divide two sums: equal scalars are within rounding only, which a jump does not forgive.
        for spec in specs(&gpu).iter().filter(|spec| has_option(spec, "filter")) {
            let options = format!("{spec},filter=exact");
            let a = f64::from(draw_on(&on_device, &view, &options).pixel(1, 1)[3]);
            let want = -(-0.5_f64).exp_m1();
            assert!((a - want).abs() < 2e-6, "{} {value} {options}: {a} is not {want}", samples.type_name());
        }
    }
}

/// The same frame is the same picture, bit by bit, and a plan turned to a view draws what a new plan does.
#[test]
fn frames_repeat_exactly() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::MarschnerLobb, 24, "f32", &SHELLS));
    for route in specs(&gpu) {
        let renderer = Renderer::new(&scene, technique(&route));
        let (a, b) = (view(perspective(), 1.0, 50, 40), view(perspective(), 0.2, 50, 40));
        let mut frames = renderer.frames(&a).unwrap();
        frames.draw(&b).unwrap();
        let turned = frames.read_back().unwrap();
        assert_eq!(turned, renderer.render(&b).unwrap());
        frames.draw(&a).unwrap();
        assert_eq!(frames.read_back().unwrap(), renderer.render(&a).unwrap());
        assert_ne!(turned, frames.read_back().unwrap());
        // A plan has room for views with more slices, and reading back twice reads the same.
        let along = View::new(Camera { eye: DVec3::Z * 4.0, ..*a.camera() }, 50, 40).unwrap();
        let mut plan = renderer.prepare(&along, &TargetDesc::own()).unwrap();
        let slices = |plan: &volraster::Plan| plan.counters()[0].1;
        let before = slices(&plan);
        assert!(plan.set_view(&a).unwrap(), "{route}");
        let aligned = route.starts_with("slices-3d") || route.starts_with("slabs");
        assert!(!aligned || slices(&plan) > before, "{route}: {before} slices");
        assert!(
            !plan.set_view(&view(perspective(), 1.0, 51, 40)).unwrap(),
            "another size needs another plan"
        );
        assert_eq!(frames.read_back().unwrap(), frames.read_back().unwrap());
    }
}
/// More slabs than one invocation may loop over: the work is split, and the picture is whole.
#[test]
fn long_marches_are_split() {
    let gpu = gpu();
    let limit = gpu.loop_limit().unwrap();
    println!("loop limit: {limit}");
    let tau = 0.5;
    let scene = scene(Field::Homogeneous(1.0), 2, "f32", &[[0.0, 1.0, 1.0, 1.0, tau]]);
    let camera = Camera {
        eye: DVec3::new(0.0, 0.0, 5.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: orthographic(),
    };
    let view = View::new(camera, 3, 3).unwrap();
    // Two units of depth, 280,000 slabs, two for each turn of a loop; voxels are two units wide.
    let options = technique("slices-3d:step=3.5714285e-6,route=compute");
    let alpha = |gpu: &Gpu| {
        let renderer = Renderer::new(&GpuScene::new(gpu, scene.clone()), options);
        let mut frames = renderer.frames(&view).unwrap();
        frames.draw(&view).unwrap();
        let dispatches = frames.plan().counters().iter().find(|c| c.0 == "dispatches_or_draws").unwrap().1;
        (f64::from(frames.read_back().unwrap().pixel(1, 1)[3]), dispatches)
    };
    let want = -(-tau * 2.0_f64).exp_m1();
    // 1.2e-7 a piece is the worst case, which rounding in one direction would reach.
    let bound = 1.2e-7 * 280_000.0;
    let (split, dispatches) = alpha(&gpu);
    assert!((split - want).abs() <= bound, "{split} is not {want} in {dispatches} dispatches");
    // The same with a limit of our own, on any device.
    let limited = gpu_with(GpuOptions { loop_limit: Some(10_000), ..GpuOptions::default() });
    let (pieces, dispatches) = alpha(&limited);
    assert!(dispatches >= 28, "{dispatches} dispatches");
    assert!((pieces - want).abs() <= bound, "{pieces} is not {want} in {dispatches} dispatches");
    // A plan for one dispatch has no room for a view that needs two, and keeps its own.
    let long = technique("slices-3d:step=6e-4,route=compute");
    let renderer = Renderer::new(&GpuScene::new(&limited, scene.clone()), long);
    let mut plan = renderer.prepare(&view, &TargetDesc::own()).unwrap();
    let before = plan.counters();
    let across = View::new(Camera { eye: DVec3::new(3.0, 3.0, 3.0), ..camera }, 3, 3).unwrap();
    assert!(!plan.set_view(&across).unwrap());
    assert_eq!(plan.counters(), before);
    drop((plan, renderer));
    // Without the split a device that ends long loops draws a wrong picture: that is what the probe is for.
    let unlimited = gpu_with(GpuOptions { loop_limit: Some(u32::MAX), ..GpuOptions::default() });
    let (whole, dispatches) = alpha(&unlimited);
    assert_eq!(dispatches, 2, "the intervals of tiles, and one march");
    if limit == u32::MAX {
        assert!((whole - want).abs() <= bound, "{whole} is not {want}");
    } else {
        assert!(
            (whole - want).abs() > 5.0 * bound,
            "{whole}: this device's limit of {limit} should have cut the march short"
        );
    }
}

/// Marches that begin and end where their tile shows anything draw what others draw, to the bit, also where a pixel is larger than a brick,
/// where the eye is inside, and in sheared cells.
#[test]
fn tiles_show_what_their_pixels_show() {
    let gpu = gpu();
    let rows = [[0.5, 1.0, 0.5, 0.2, 0.0], [0.55, 1.0, 0.5, 0.2, 40.0], [0.6, 1.0, 0.5, 0.2, 0.0]];
    let plain = scene(Field::MarschnerLobb, 72, "f32", &rows);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.0, 0.5, 1.0).normalize());
    let grid = plain.grid().unwrap().clone();
    let sheared =
        grid.clone().with_placement(DVec3::new(0.02, 0.05, 0.03), DVec3::splat(-0.8), shear).unwrap();
    // Visible beside one face of the grid alone.
    let beside = |axis: usize, far: bool| {
        let place = |i: usize| [i % 72, i / 72 % 72, i / 72 / 72][axis];
        let at = |i: usize| if far { 71 - place(i) } else { place(i) };
        let samples = (0..72 * 72 * 72).map(|i| if at(i) < 3 { 0.55 } else { 0.0 }).collect();
        Scene::new(grid.with_samples(Samples::F32(samples)).unwrap(), plain.transfer.clone())
    };
    let faces = (0..6).map(|i| beside(i / 2, i % 2 == 1));
    let both = [plain.clone(), Scene::new(sheared, plain.transfer.clone())];
    for scene in both.into_iter().chain(taken(2, faces)) {
        let scene = GpuScene::new(&gpu, scene);
        let mut shown = 0;
        for (projection, distance, width, height) in [
            (perspective(), 1.0, 61, 43),
            (perspective(), 1.0, 9, 7),
            (perspective(), 0.1, 43, 29),
            (perspective(), 0.4, 30, 70),
            (perspective(), 8.0, 61, 43),
            (perspective(), 30.0, 17, 13),
            (orthographic(), 1.0, 61, 43),
            (orthographic(), 1.0, 5, 6),
        ] {
            let view = view(projection, distance, width, height);
            for technique in ["slices-2d", "slices-2d:step=0.7", "slices-3d", "slabs", "raycast"] {
                let joint = if technique.contains(':') { ',' } else { ':' };
                let [skip, march] = ["skip", "march"]
                    .map(|word| draw_on(&scene, &view, &format!("{technique}{joint}empty-space={word}")));
                assert!(skip == march, "{technique} {projection:?} x {distance}, {width} x {height}");
                shown += skip.pixels().iter().filter(|pixel| pixel[3] > 0.0).count();
            }
        }
        assert!(shown > 2000, "{shown}");
    }
}

/// What the device cannot hold is said before the driver is asked, with both numbers.
#[test]
fn limits_are_reported_with_both_numbers() {
    let small = gpu_with(GpuOptions { memory_budget: Some(100_000), ..GpuOptions::default() });
    let view = view(perspective(), 1.0, 64, 48);
    let big = scene(Field::Ramp, 64, "f32", &FOG);
    let error = Renderer::new(&GpuScene::new(&small, big), Technique::default()).render(&view).unwrap_err();
    assert_eq!(error.exit_code(), 3);
    let message = error.to_string();
    assert!(
        message.contains("volume")
            && message.contains(&(64 * 64 * 64 * 4).to_string())
            && message.contains("100000"),
        "{message}"
    );

    // What exceeds an image is drawn in pages, by compute.
    let gpu = gpu();
    let long = gpu.max_image_3d() + 1;
    let grid = Grid::new([long, 2, 2], Samples::U8(vec![1; 4 * long as usize])).unwrap();
    let scene = Scene::new(grid, TransferFunction::from_rows(&FOG).unwrap());
    let image = draw(&gpu, &scene, &view, "slices-3d:filter=exact");
    let found = errors(&image, &scene, &view).all;
    // The ends of a ray in the grid are off by the rounding of positions so far from the middle, in cells; the fog has an optical depth of 8
    // per cell. Few rays meet the ends.
    let rounding = 0.5 * f64::from(long) * f64::from(f32::EPSILON);
    assert!(
        found.rmse < 0.3 * rounding
            && found.max_abs < 8.0 * rounding
            && image.pixels().iter().any(|pixel| pixel[3] > 0.1),
        "{found:?}, of {rounding}"
    );
    let on_device = GpuScene::new(&gpu, scene);
    let error = Renderer::new(&on_device, technique("slices-3d:route=raster")).frames(&view).unwrap_err();
    assert!(error.to_string().contains("route=compute") && error.exit_code() == 3, "{error}");

    let scene = crate::common::scene(Field::Ramp, 8, "f32", &FOG);
    let error = Renderer::new(&GpuScene::new(&gpu, scene), technique("slices-3d:step=1e-9"))
        .render(&view)
        .unwrap_err();
    assert!(error.to_string().contains("step") && error.exit_code() == 2, "{error}");
}

/// A grid of one cell: along any ray the scalar is one smooth polynomial, curved in all directions.
fn one_cell() -> Grid {
    let corners = vec![0.1, 0.9, 0.8, 0.35, 0.75, 0.2, 0.3, 1.0];
    let grid = Grid::new([2, 2, 2], Samples::F32(corners)).unwrap();
    grid.with_placement(DVec3::splat(2.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap()
}

/// Whether the ray of a pixel meets the surface on which a scalar has a value.
fn meets(grid: &Grid, view: &View, pixel: DVec2, value: f64) -> bool {
    let (origin, direction) = view.ray(pixel);
    let inside = |t: &f64| (origin + direction * *t).abs().max_element() <= 1.0;
    let scalar = |t: f64| {
        let w = (origin + direction * t + DVec3::ONE) * 0.5;
        let corner = |i: u32| {
            let weight = |bit: u32, w: f64| if i >> bit & 1 == 1 { w } else { 1.0 - w };
            grid.value(i & 1, i >> 1 & 1, i >> 2) * weight(0, w.x) * weight(1, w.y) * weight(2, w.z)
        };
        (0..8).map(corner).sum::<f64>()
    };
    let along: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.02).filter(inside).map(scalar).collect();
    along.windows(2).any(|pair| (pair[0] < value) != (pair[1] < value))
}

/// The observed order of convergence of the median error over pixels, for each halving of the step. Rays that see
/// less than a quarter of the cube's diameter graze it, and are left out.
fn orders(
    seen_by: &dyn Fn(DVec2) -> bool,
    scene: &Scene,
    view: &View,
    gpu_scene: &std::sync::Arc<GpuScene>,
    spec: &str,
    steps: &[f64],
) -> Vec<f64> {
    let truth = truth(scene, view);
    let [width, _] = view.extent();
    let error = |step: f64| -> Vec<f64> {
        let t = technique(&with_option(&format!("{spec},step={step}"), "filter", "exact"));
        let image = Renderer::new(gpu_scene, t).render(view).unwrap();
        let difference = |(p, t): (&[f32; 4], &[f64; 4])| {
            (0..4).map(|c| (f64::from(p[c]) - t[c]).abs()).fold(0.0, f64::max)
        };
        image.pixels().iter().zip(truth.pixels()).map(difference).collect()
    };
    let all: Vec<Vec<f64>> = steps.iter().map(|&step| error(step)).collect();
    let seen = |i: &usize| {
        let (x, y) = (*i as u32 % width, *i as u32 / width);
        let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        chord(view, pixel) > 0.85 && seen_by(pixel)
    };
    let seen: Vec<usize> = (0..truth.pixels().len()).filter(seen).collect();
    assert!(seen.len() >= 1000, "{} pixels", seen.len());
    // Medians of errors, then their ratio. Of ratios the median would mislead at a jump: slabs are halved, so a
    // jump in a slab's first or last quarter is as far from an end as before.
    let median = |errors: &Vec<f64>| {
        let mut errors: Vec<f64> = seen.iter().map(|&i| errors[i]).collect();
        errors.sort_by(f64::total_cmp);
        errors[errors.len() / 2]
    };
    let medians: Vec<f64> = all.iter().map(median).collect();
    medians.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

/// Sampling in the middle and integrating between the ends are both second order in the step where field and
/// transfer function are smooth. The steps end where the error meets float32's floor, some 1e-6. Tables of
/// 4096 bins and 1024 nodes are fine enough for these steps.
#[test]
fn smooth_scenes_converge_at_second_order() {
    let gpu = gpu();
    let transfer =
        TransferFunction::from_rows(&[[0.0, 0.1, 0.9, 0.4, 0.0], [1.0, 0.9, 0.2, 0.5, 3.0]]).unwrap();
    let scene = Scene::new(one_cell(), transfer);
    let gpu_scene = GpuScene::new(&gpu, scene.clone());
    for projection in [perspective(), orthographic()] {
        let view = view(projection, 1.0, 64, 56);
        for spec in specs(&gpu).into_iter().filter(|spec| by_pixel(spec)) {
            let steps = [0.1, 0.05, 0.025, 0.0125, 0.00625];
            let spec = match spec.split_once("table=") {
                Some((before, after)) => {
                    format!("{before}table=1024{}", after.trim_start_matches(|c: char| c.is_ascii_digit()))
                }
                None => spec,
            };
            let orders = orders(&|_| true, &scene, &view, &gpu_scene, &spec, &steps);
            println!("{projection:?} {spec}: {orders:.3?}");
            for order in orders {
                assert!((order - 2.0).abs() <= 0.15, "{projection:?} {spec}: order {order}");
            }
        }
    }
}

/// At a jump of the transfer function a sample lands on one side or the other: first order. Integration between
/// the ends cuts there: what is left is the scalar's curvature along the ray, second order.
#[test]
fn a_jump_costs_sampling_an_order_and_integration_none() {
    let gpu = gpu();
    let rows = [
        [0.0, 0.1, 0.9, 0.4, 0.2],
        [0.5, 0.5, 0.5, 0.5, 0.5],
        [0.5, 0.9, 0.2, 0.1, 3.0],
        [1.0, 0.9, 0.2, 0.5, 1.0],
    ];
    let scene = Scene::new(one_cell(), TransferFunction::from_rows(&rows).unwrap());
    let gpu_scene = GpuScene::new(&gpu, scene.clone());
    let view = view(perspective(), 1.0, 108, 96);
    let steps = [0.2, 0.1, 0.05, 0.025, 0.0125];
    // Rays that do not meet the jump do not see it.
    let crosses = |pixel: DVec2| meets(scene.grid().unwrap(), &view, pixel, 0.5);
    for spec in specs(&gpu).iter().filter(|spec| !spec.contains("integrator") || spec.contains("midpoint")) {
        let orders = orders(&crosses, &scene, &view, &gpu_scene, spec, &steps);
        let mean = orders.iter().sum::<f64>() / 4.0;
        println!("{spec}: {orders:.3?}, mean {mean:.3}");
        assert!((mean - 1.0).abs() <= 0.25, "{spec}: orders {orders:?}");
    }
    for spec in specs(&gpu).iter().filter(|spec| spec.contains("exact") || spec.contains("integral")) {
        let orders = orders(&crosses, &scene, &view, &gpu_scene, spec, &steps);
        println!("{spec}: {orders:.3?}");
        for order in orders {
            assert!((order - 2.0).abs() <= 0.3, "{spec}: order {order}");
        }
    }
}

/// Where slabs of equal depth are segments of equal length, along an axis in parallel projection, rays and slabs
/// take the same samples: what differs is rounding. Each of some 60 slabs adds a few units in the last place,
/// and a scalar that is off by 1e-6 some 4e-4 * 0.03 of optical depth (tau rises by 375 per unit of scalar).
#[test]
fn rays_and_slabs_agree_where_the_geometry_is_the_same() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::MarschnerLobb, 32, "f32", &SHELLS));
    for eye in [DVec3::Z * 4.0, DVec3::X * -4.0] {
        let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection: orthographic() };
        let view = View::new(camera, 61, 53).unwrap();
        let render = |spec: &str| Renderer::new(&scene, technique(spec)).render(&view).unwrap();
        for (rays, others) in [
            ("midpoint", ["slices-3d:"].as_slice()),
            ("exact", &["slabs:integrator=exact,"]),
            ("integral", &["slabs:integrator=integral,"]),
            ("full", &["slabs:integrator=full,"]),
        ] {
            for step in ["1", "0.37"] {
                let cast = render(&format!("raycast:integrator={rays},filter=exact,step={step}"));
                for other in others {
                    let drawn = render(&format!("{other}filter=exact,step={step}"));
                    let errors = ImageErrors::between(&cast, &drawn).unwrap();
                    println!("{other} step {step}: {errors}");
                    assert!(errors.all.max_abs <= 3e-5, "{other} step {step}: {errors}");
                }
            }
        }
    }
}

/// Raster and compute cut the same slabs: see the test of the same name for slices of a volume.
#[test]
fn routes_agree() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::MarschnerLobb, 32, "f32", &SHELLS));
    let raster: Vec<String> = specs(&gpu).into_iter().filter(|spec| spec.contains("raster")).collect();
    for projection in [perspective(), orthographic()] {
        for distance in [1.0, 0.1] {
            let view = view(projection, distance, 65, 47);
            for spec in &raster {
                for options in ["step=0.5,filter=exact", "step=0.5", ""] {
                    let render = |spec: &str| {
                        Renderer::new(&scene, technique(&format!("{spec},{options}"))).render(&view).unwrap()
                    };
                    let errors =
                        ImageErrors::between(&render(spec), &render(&spec.replace("raster", "compute")))
                            .unwrap();
                    assert!(
                        errors.all.max_abs <= 4e-5,
                        "{projection:?} x {distance} {spec},{options}: {errors}"
                    );
                }
            }
        }
    }
}

/// A shell thinner than what lies between two samples: integration catches it with at most a third of the samples
/// that sampling needs for the same error.
#[test]
fn slabs_catch_a_thin_peak() {
    let gpu = gpu();
    let rows = [[0.49, 1.0, 0.8, 0.3, 0.0], [0.5, 1.0, 0.8, 0.3, 240.0], [0.51, 1.0, 0.8, 0.3, 0.0]];
    let scene = scene(Field::MarschnerLobb, 128, "f32", &rows);
    let view = view(perspective(), 1.0, 256, 256);
    let truth = truth(&scene, &view);
    let gpu_scene = GpuScene::new(&gpu, scene.clone());
    let measure = |spec: &str| {
        let mut frames = Renderer::new(&gpu_scene, technique(spec)).frames(&view).unwrap();
        frames.draw(&view).unwrap();
        let errors = ImageErrors::between_f64(&frames.read_back().unwrap(), &truth).unwrap();
        let slices = frames.plan().counters().iter().find(|c| c.0 == "slices").unwrap().1;
        println!("{spec}: {slices} slices, rmse {:.2e}", errors.all.rmse);
        (slices, errors.all.rmse)
    };
    let (slices, error) = measure(&format!("slices-3d:step={}", 1.35 / 3.0));
    assert!(error > 2e-2, "{slices} slices do: {error:e}");
    for integrator in ["integral", "full", "exact"] {
        let (slabs, error) = measure(&format!("slabs:integrator={integrator},step=1.35"));
        assert!(error <= 2e-2 && 3 * slabs <= slices + 3, "{integrator}: {slabs} slabs: {error:e}");
    }
}

/// Bricks in which nothing is visible are passed over, and the image is the same to the bit.
#[test]
fn empty_space_changes_nothing() {
    let gpu = gpu();
    let compute: Vec<String> = specs(&gpu).into_iter().filter(|spec| spec.contains("compute")).collect();
    // Nothing but thin shells, background, everything, nothing.
    let peak = [[0.49, 1.0, 0.8, 0.3, 0.0], [0.5, 1.0, 0.8, 0.3, 24.0], [0.51, 1.0, 0.8, 0.3, 0.0]];
    let jump = [[0.6, 1.0, 1.0, 1.0, 0.0], [0.6, 0.2, 0.6, 1.0, 9.0]];
    let low = [[0.1, 1.0, 0.5, 1.0, 5.0], [0.1, 1.0, 1.0, 1.0, 0.0]];
    let nothing = [[0.0, 1.0, 1.0, 1.0, 0.0]];
    let transfers: [(&str, &[[f64; 5]]); 6] = [
        ("fog", &FOG),
        ("shells", &SHELLS),
        ("peak", &peak),
        ("jump", &jump),
        ("low", &low),
        ("nothing", &nothing),
    ];
    let mut holes = Field::Blobs.sample([37, 30, 25], "f32").unwrap();
    if let Samples::F32(values) = holes.samples() {
        let mut values = values.clone();
        for i in (500..values.len()).step_by(4999) {
            values[i] = f32::NAN;
        }
        holes = Grid::new(holes.dims(), Samples::F32(values))
            .unwrap()
            .with_placement(DVec3::new(0.05, 0.07, 0.08), DVec3::new(-0.9, -1.0, -1.0), DMat3::IDENTITY)
            .unwrap();
    }
    let bytes: Vec<u8> =
        (0..holes.samples().len()).map(|i| (holes.samples().get(i).max(0.0) * 255.0).round() as u8).collect();
    let bytes = Grid::new(holes.dims(), Samples::U8(bytes))
        .unwrap()
        .with_rescale(Rescale { slope: 1.0 / 255.0, intercept: 0.0 })
        .unwrap()
        .with_placement(DVec3::new(0.05, 0.07, 0.08), DVec3::new(-0.9, -1.0, -1.0), DMat3::IDENTITY)
        .unwrap();
    let grids = [
        Field::Blobs.sample([41, 41, 41], "f32").unwrap(),
        Field::MarschnerLobb.sample([33, 40, 26], "f32").unwrap(),
        holes,
        bytes,
    ];
    for grid in taken(2, grids) {
        let first = Scene::new(grid, TransferFunction::from_rows(&FOG).unwrap());
        let first = GpuScene::new(&gpu, first);
        for (name, rows) in taken(2, transfers) {
            // Only the transfer function changes: samples and their ranges stay where they are.
            let scene = first.with_transfer(TransferFunction::from_rows(rows).unwrap());
            for view in [
                view(perspective(), 1.0, 34, 28),
                view(orthographic(), 1.0, 34, 28),
                view(perspective(), 0.15, 34, 28),
                View::new(Camera { eye: DVec3::X * 4.0, ..camera(orthographic(), 1.0) }, 30, 22).unwrap(),
            ] {
                for spec in &compute {
                    for step in taken(2, ["0.3", "1", "11"]) {
                        let render = |empty: &str| {
                            let spec = format!("{spec},step={step},empty-space={empty}");
                            Renderer::new(&scene, technique(&spec)).render(&view).unwrap()
                        };
                        let (skip, march) = (render("skip"), render("march"));
                        assert_eq!(
                            ImageErrors::between(&skip, &march).unwrap().all.max_abs,
                            0.0,
                            "{name} {spec} step {step} {:?}",
                            view.camera()
                        );
                        assert!(skip == march, "{name} {spec} step {step}");
                    }
                }
            }
        }
    }
}

/// Another transfer function over the same data draws what a new scene does, and uploads no samples.
#[test]
fn a_changed_transfer_function_keeps_the_samples() {
    let gpu = gpu();
    let view = view(perspective(), 1.0, 50, 42);
    let old = GpuScene::new(&gpu, scene(Field::Blobs, 24, "f32", &SHELLS));
    for spec in specs(&gpu) {
        let t = technique(&spec);
        Renderer::new(&old, t).render(&view).unwrap();
        let volumes = |gpu: &volraster::Gpu| {
            gpu.memory_report()
                .iter()
                .filter(|(name, _)| name == "volume" || name.starts_with("stack"))
                .count()
        };
        let before = volumes(&gpu);
        let new = old.with_transfer(TransferFunction::from_rows(&FOG).unwrap());
        let image = Renderer::new(&new, t).render(&view).unwrap();
        assert_eq!(volumes(&gpu), before, "{spec}");
        // Splats are those that show something: another transfer function has others.
        if has_option(&spec, "filter") {
            assert_eq!(new.times().upload, 0.0, "{spec}");
            assert!(new.times().tables > 0.0, "{spec}");
        }
        let fresh = GpuScene::new(&gpu, scene(Field::Blobs, 24, "f32", &FOG));
        assert_eq!(image, Renderer::new(&fresh, t).render(&view).unwrap(), "{spec}");
    }
    // Infinities were uploaded as the ends of a transfer function: they are uploaded anew.
    let mut values = vec![0.5_f32; 64];
    values[21] = f32::INFINITY;
    let grid = Grid::new([4, 4, 4], Samples::F32(values)).unwrap();
    let grid = grid.with_placement(DVec3::splat(2.0 / 3.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let with = |rows: &[[f64; 5]]| Scene::new(grid.clone(), TransferFunction::from_rows(rows).unwrap());
    let old = GpuScene::new(&gpu, with(&FOG));
    let t = technique("slices-3d:step=0.1");
    Renderer::new(&old, t).render(&view).unwrap();
    let wide = [[0.0, 1.0, 1.0, 1.0, 0.5], [9.0, 1.0, 1.0, 1.0, 9.0]];
    let new = old.with_transfer(TransferFunction::from_rows(&wide).unwrap());
    let errors = errors(&Renderer::new(&new, t).render(&view).unwrap(), &with(&wide), &view);
    assert!(errors.all.rmse < 1e-3, "{errors}");
}

/// Cells seen along an axis in one slab: each pixel is the integral of the transfer function from one scalar to
/// another over a length of 2. Scalars equal, nearly equal, across jumps and spikes, outside of all knots; each
/// both ways.
#[test]
fn integrators_are_right_at_the_extremes() {
    let gpu = gpu();
    let smooth: &[[f64; 5]] = &[
        [0.0, 0.2, 0.9, 0.1, 0.3],
        [0.31, 0.8, 0.3, 0.1, 9.0],
        [0.64, 0.1, 0.3, 0.9, 0.1],
        [1.0, 0.5, 0.5, 0.5, 2.0],
    ];
    let ramp: &[[f64; 5]] = &[[0.0, 1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0, 1.0]];
    let spike: &[[f64; 5]] = &[
        [0.0, 1.0, 0.5, 0.2, 0.0],
        [0.5, 1.0, 0.5, 0.2, 0.0],
        [0.5, 1.0, 0.5, 0.2, 4e3],
        [0.5001, 1.0, 0.5, 0.2, 4e3],
        [0.5001, 1.0, 0.5, 0.2, 0.0],
        [1.0, 1.0, 0.5, 0.2, 0.0],
    ];
    let jump: &[[f64; 5]] = &[[0.25, 1.0, 0.0, 0.0, 0.1], [0.25, 0.0, 0.0, 1.0, 2.0]];
    let constant: &[[f64; 5]] = &[[0.5, 0.2, 0.4, 0.8, 0.7]];
    let dense: &[[f64; 5]] = &[[0.0, 1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 1.0, 0.0, 40.0]];
    let many: Vec<[f64; 5]> = (0..=500)
        .map(|i| {
            let s = f64::from(i) / 500.0;
            [s, s, 1.0 - s, 0.5, 2.0 + (40.0 * s).sin()]
        })
        .collect();
    let ends = [
        (0.3, 0.3),
        (0.3, 0.3 + 6e-8),
        (0.3, 0.3 + 1e-5),
        (0.3, 0.301),
        (0.1, 0.9),
        (0.0, 1.0),
        (0.25, 0.25),
        (0.249, 0.251),
        (0.4, 0.6),
        (-0.5, 0.2),
        (0.8, 3.0),
        (-2.0, 2.5),
        (-3.0, -2.0),
        (1.0, 1.0),
        (2.0, 2.0),
    ];
    let pairs: Vec<(f64, f64)> = ends.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect();
    // One cell for each pair, and cells between; one pixel in the middle of each. The front is at z = 1.
    let mut samples = Vec::new();
    for z in 0..2 {
        for _ in 0..2 {
            for (front, back) in &pairs {
                samples.extend([if z == 1 { *front as f32 } else { *back as f32 }; 2]);
            }
        }
    }
    let count = pairs.len() as u32;
    let grid = Grid::new([2 * count, 2, 2], Samples::F32(samples)).unwrap();
    let grid = grid.with_placement(DVec3::new(1.0, 1.0, 2.0), DVec3::ZERO, DMat3::IDENTITY).unwrap();
    let projection = Projection::Orthographic { half_height: 1.0 };
    let eye = grid.centre() + DVec3::Z * 5.0;
    let view = View::new(Camera { eye, target: grid.centre(), up: DVec3::Y, projection }, count, 1).unwrap();
    // The tables' own error: bins smear a kink over a 4096th, nodes over a 1023rd of the domain, and what is
    // inside a bin or the slab's colour is taken as its mean (a second-order error in the optical depth, so not
    // asked of `integral` where that is large).
    for (name, rows, exact, table, full) in [
        ("smooth", smooth, 5e-6, 0.4, 1e-2),
        ("ramp", ramp, 2e-6, 2e-6, 2e-5),
        // 3e-8 of rounding in a knot, of a width of 1e-4.
        ("spike", spike, 2e-4, 5e-3, 5e-3),
        ("jump", jump, 5e-6, 0.2, 5e-3),
        ("constant", constant, 2e-6, 2e-6, 2e-6),
        ("dense", dense, 2e-5, 0.7, 2e-3),
        ("many", &many, 5e-6, 0.5, 2e-2),
    ] {
        let transfer = TransferFunction::from_rows(rows).unwrap();
        let mut worst = [0.0_f64; 4];
        let gpu_scene = GpuScene::new(&gpu, Scene::new(grid.clone(), transfer));
        let truth = truth(gpu_scene.scene(), &view);
        for (i, integrator) in ["exact", "integral", "full,table=512"].into_iter().enumerate() {
            let t = technique(&format!("slabs:integrator={integrator},filter=exact,step=2"));
            let image = Renderer::new(&gpu_scene, t).render(&view).unwrap();
            for (pixel, (front, back)) in (0..).zip(&pairs) {
                let (got, want) = (image.pixel(pixel, 0), truth.pixel(pixel, 0));
                let error = (0..4).map(|c| (f64::from(got[c]) - want[c]).abs()).fold(0.0, f64::max);
                let bound = [exact, table, full][i];
                assert!(error <= bound, "{name} {front} to {back} {integrator}: {got:?} is not {want:?}");
                worst[i] = worst[i].max(error);
                // Opacity alone is the table's strength.
                let alpha = (f64::from(got[3]) - want[3]).abs();
                if i == 1 {
                    let bound = if name == "spike" { 5e-3 } else { 2e-5 };
                    assert!(alpha <= bound, "{name} {front} to {back} {integrator}: {got:?} is not {want:?}");
                    worst[3] = worst[3].max(alpha);
                }
            }
        }
        println!(
            "{name}: exact {:.1e}, integral {:.1e} (opacity {:.1e}), full {:.1e}",
            worst[0], worst[1], worst[3], worst[2]
        );
    }
}

/// A ray that ends early is off by no more than the transmittance at which it ends, for colours up to 1, and in
/// proportion for brighter ones.
#[test]
fn early_ends_are_bounded() {
    let gpu = gpu();
    for brightness in [1.0, 20.0] {
        let rows: Vec<[f64; 5]> =
            FOG.iter().map(|&[s, r, g, b, tau]| [s, r * brightness, g, b, 4.0 * tau]).collect();
        let scene = GpuScene::new(&gpu, scene(Field::Blobs, 32, "f32", &rows));
        let view = view(perspective(), 1.0, 60, 50);
        for spec in specs(&gpu).iter().filter(|spec| spec.contains("compute")) {
            let render = |stop: &str| {
                Renderer::new(&scene, technique(&format!("{spec},step=0.25,stop={stop}")))
                    .render(&view)
                    .unwrap()
            };
            let whole = render("0");
            for (stop, most) in [("1e-2", 1e-2), ("1e-3", 1e-3), ("1e-4", 1e-4), ("2.4e-7", 2.4e-7)] {
                let errors = ImageErrors::between(&render(stop), &whole).unwrap();
                // And float32's rounding.
                assert!(errors.all.max_abs <= most * 1.001 + 1e-6, "{spec} stop={stop}: {errors}");
                assert!(
                    most < 1e-3 || errors.all.max_abs > 0.1 * most / brightness,
                    "{spec} stop={stop} ends nothing"
                );
            }
        }
    }
}

/// A march in many dispatches draws what one dispatch does, but for the rounding of what is kept between them.
#[test]
fn split_marches_resume_where_they_stopped() {
    let whole = gpu();
    let split = gpu_with(GpuOptions { loop_limit: Some(1500), ..GpuOptions::default() });
    let make = || scene(Field::Blobs, 24, "f32", &FOG);
    for view in [view(perspective(), 1.0, 40, 34), view(orthographic(), 0.2, 40, 34)] {
        for spec in specs(&whole).iter().filter(|spec| spec.contains("compute")) {
            let t = technique(&format!("{spec},step=0.05"));
            let want = Renderer::new(&GpuScene::new(&whole, make()), t).render(&view).unwrap();
            let mut frames = Renderer::new(&GpuScene::new(&split, make()), t).frames(&view).unwrap();
            frames.draw(&view).unwrap();
            let count = frames.plan().counters().iter().find(|c| c.0 == "dispatches_or_draws").unwrap().1;
            assert!(count > 3, "{spec}: {count} dispatches");
            let errors = ImageErrors::between(&frames.read_back().unwrap(), &want).unwrap();
            assert!(errors.all.max_abs <= 2e-6, "{spec}: {errors}");
        }
    }
}

/// A translucent surface where nothing else is visible is drawn by whichever dispatch reaches it.
#[test]
fn split_marches_draw_surfaces_in_empty_space() {
    let whole = gpu();
    let split = gpu_with(GpuOptions { loop_limit: Some(1500), ..GpuOptions::default() });
    // Only the lower end of the ramp is visible, behind most of the surface or before it. Pixels are small enough for intervals of tiles.
    let rows = [[0.0, 1.0, 0.5, 0.1, 1.0], [0.2, 0.2, 0.6, 1.0, 0.0], [1.0, 0.2, 0.6, 1.0, 0.0]];
    let make = || {
        let ball = Surface::sphere(DVec3::ZERO, 0.9, [0.9, 0.4, 0.3, 0.5], 3).unwrap();
        scene(Field::Ramp, 33, "f32", &rows).with_surfaces(vec![ball])
    };
    for view in [1.0, -1.0].map(|side| view(perspective(), side, 80, 68)) {
        for spec in
            specs(&whole).iter().filter(|spec| spec.contains("compute") && !spec.contains("shear-warp"))
        {
            let t = technique(&format!("{spec},step=0.05"));
            let want = Renderer::new(&GpuScene::new(&whole, make()), t).render(&view).unwrap();
            let found = Renderer::new(&GpuScene::new(&split, make()), t).render(&view).unwrap();
            let errors = ImageErrors::between(&found, &want).unwrap();
            assert!(errors.all.max_abs <= 2e-6, "{spec}: {errors}");
        }
    }
}

/// Wrong options are refused in one line that names option, value and range, before anything is drawn.
#[test]
fn wrong_options_are_named() {
    for (spec, parts) in [
        ("slabs:step=0", ["slabs", "step", "positive"]),
        ("slabs:step=NaN", ["step", "NaN", "finite"]),
        ("slabs:table=0", ["table", "\"0\"", "2 to 65536"]),
        ("slabs:integrator=full,table=4096", ["table", "4096", "2 to 1024"]),
        ("slabs:integrator=exact,table=16", ["table", "exact", "no table"]),
        ("slabs:integrator=midpoint", ["integrator", "midpoint", "integral, full, exact"]),
        ("slabs:integrator=simpson", ["integrator", "simpson", "integral"]),
        ("raycast:order=back-to-front", ["raycast", "order", "must be one of"]),
        ("raycast:route=raster", ["raycast", "route", "must be compute"]),
        ("slices-2d:hysteresis=1", ["hysteresis", "\"1\"", "below 1"]),
        ("slices-2d:step=half", ["step", "half", "number"]),
        ("slices-2d:stacks=two", ["stacks", "two", "used, all"]),
        ("slices-3d:stop=1", ["stop", "\"1\"", "below 1"]),
        ("slices-3d:dither=alpha", ["dither", "alpha", "rgba8"]),
        ("slices-3d:dither=alpha,target=rgba8,route=compute", ["route", "compute", "raster"]),
        ("slices-3d:seed=-1", ["seed", "-1", "4294967295"]),
        ("slabs:ends=plane", ["ends", "must be one of", "integrator"]),
    ] {
        let error = Technique::parse(spec).unwrap_err();
        let message = error.to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{spec}: {message}");
        assert_eq!(error.exit_code(), 2, "{spec}");
        assert_eq!(message.lines().count(), 1, "{spec}");
    }
}

/// A plain march builds one pipeline and takes the samples, the knots and the image; each thing more is asked for
/// by an option, and everything is given back.
#[test]
#[ignore = "make test-all"]
fn a_plain_scene_takes_what_it_needs() {
    const SAMPLES: u64 = 32 * 32 * 32 * 4;
    const PIXELS: u64 = 64 * 48;
    let view = view(perspective(), 1.0, 64, 48);
    let knots = ("transfer.knots", 16 * 48);
    let volume = ("volume", SAMPLES);
    let image = |name: &'static str| (name, PIXELS * 16);
    let march = image("slices-3d.accumulation");
    let table = ("transfer.table", 64 + 4096 * 64);
    let head = ("transfer.table-head", 64);
    // In place of a table, which shaders bind and leave alone; a word in place of what marches of a grid in pages write.
    let no_texels = ("stand-in", 16);
    let stand_in = ("stand-in", 4);
    // What the cube covers of the image, and room for views that need more.
    let texels = ("shear-warp.intermediate", 2000 * 16);
    type Wanted<'a> = (&'a str, &'a str, &'a [&'a str], Vec<(&'a str, u64)>);
    let cases: Vec<Wanted<'_>> = vec![
        ("slices-3d:empty-space=march", "f32", &["slices-3d.march"], vec![march, knots, volume]),
        (
            "slices-3d:",
            "f32",
            &["bricks.around", "bricks.mark", "slices-3d.march", "slices-3d.tiles"],
            vec![
                // A word for each row of 4 bricks.
                ("bricks", 16 * 4),
                ("bricks.around", 16 * 4),
                ("bricks.ranges", 64 * 8),
                march,
                // Of 8 x 8 pixels.
                ("slices-3d.tiles", 8 * 6 * 8),
                ("slices-3d.tiles.list", 8 * 6 * 4),
                knots,
                volume,
            ],
        ),
        ("slices-3d:route=raster", "f32", &["slices-3d.draw"], vec![march, knots, volume]),
        (
            "slices-3d:target=rgba8",
            "f32",
            &["slices-3d.draw"],
            vec![("slices-3d.accumulation", PIXELS * 4), knots, volume],
        ),
        (
            "slices-3d:target=rgba16,dither=alpha",
            "f32",
            &["slices-3d.dither"],
            vec![("slices-3d.accumulation", PIXELS * 8), ("slices-3d.texels", PIXELS * 8), knots, volume],
        ),
        (
            "slices-3d:target=rgba8,dither=blue",
            "f32",
            &["slices-3d.dither"],
            vec![
                ("blue-noise", 64 * 64 * 4),
                ("slices-3d.accumulation", PIXELS * 4),
                ("slices-3d.texels", PIXELS * 4),
                knots,
                volume,
            ],
        ),
        (
            "slices-3d:empty-space=march,filter=exact",
            "u8",
            &["slices-3d.march"],
            vec![march, knots, ("volume", SAMPLES / 4)],
        ),
        (
            "slices-3d:prefilter=mip",
            "f32",
            &["slices-3d.march"],
            vec![march, knots, ("volume", (32_768 + 4096 + 512 + 64 + 8 + 1) * 4)],
        ),
        (
            "slabs:empty-space=march,integrator=exact",
            "f32",
            &["slabs.march"],
            vec![image("slabs.accumulation"), knots, volume],
        ),
        (
            "slabs:empty-space=march,integrator=integral",
            "f32",
            &["slabs.march"],
            vec![image("slabs.accumulation"), knots, table, volume],
        ),
        (
            "slabs:route=raster,integrator=full,table=64",
            "f32",
            &["slabs.draw"],
            vec![image("slabs.accumulation"), knots, ("transfer.table", 64 * 64 * 12 * 16), head, volume],
        ),
        (
            "raycast:empty-space=march",
            "f32",
            &["raycast.march"],
            vec![image("raycast.accumulation"), knots, volume],
        ),
        (
            "slices-2d:empty-space=march",
            "f32",
            &["slices-2d.march"],
            vec![image("slices-2d.accumulation"), ("stack.z", SAMPLES), knots],
        ),
        (
            "shear-warp:empty-space=march",
            "f32",
            &["shear-warp.march", "shear-warp.warp"],
            vec![image("shear-warp.accumulation"), texels, ("stack.z", SAMPLES), knots, no_texels],
        ),
        (
            "shear-warp:empty-space=march,warp=mip",
            "f32",
            &["shear-warp.halve", "shear-warp.march", "shear-warp.warp"],
            vec![image("shear-warp.accumulation"), texels, ("stack.z", SAMPLES), knots, no_texels],
        ),
    ];
    for (options, kind, pipelines, mut want) in cases {
        let gpu = fresh_gpu();
        assert_eq!(gpu.pipelines(), Vec::<String>::new());
        assert_eq!(gpu.memory_report(), []);
        let gpu_scene = GpuScene::new(&gpu, scene(Field::MarschnerLobb, 32, kind, &SHELLS));
        let renderer = Renderer::new(&gpu_scene, technique(options));
        assert_eq!(gpu.memory_report(), [], "nothing is taken before it is needed");
        let frames = renderer.frames(&view).unwrap();
        let mut built = gpu.pipelines();
        built.sort();
        assert_eq!(built, pipelines, "{options}");
        let mut report = gpu.memory_report();
        report.sort();
        want.extend(pipelines.iter().any(|name| name.ends_with(".march")).then_some(stand_in));
        want.sort_unstable();
        let names = |list: Vec<&str>| list.join(", ");
        assert_eq!(
            names(report.iter().map(|(name, _)| name.as_str()).collect()),
            names(want.iter().map(|(name, _)| *name).collect()),
            "{options}"
        );
        for ((name, bytes), (_, least)) in report.iter().zip(&want) {
            // Texels, and at most what alignment adds: lavapipe rounds an image up to 64 bytes a row and 4 rows.
            assert!(
                (*least..=2 * least + 4096).contains(bytes),
                "{options}: {name} takes {bytes} for {least}"
            );
        }
        drop((frames, renderer, gpu_scene));
        assert_eq!(gpu.memory_report(), [], "everything is given back");
    }
}

/// A zero background in large and small worlds, marched: equal scalars over any length are one piece, and opaque
/// matter is opaque.
#[test]
fn equal_scalars_are_right_at_any_length() {
    let gpu = gpu();
    for unit in [1e21, 1.0, 1e-18] {
        for (tau, alpha) in [(0.0, 0.0), (1e300, 1.0), (0.5 / unit, 0.393_469)] {
            let grid = Grid::new([3, 3, 3], Samples::F32(vec![0.0; 27])).unwrap();
            let grid = grid.with_placement(DVec3::splat(unit), DVec3::splat(-unit), DMat3::IDENTITY).unwrap();
            let rows = [[0.0, 1.0, 1.0, 1.0, tau], [1.0, 1.0, 1.0, 1.0, 1.0 / unit]];
            let scene = GpuScene::new(&gpu, Scene::new(grid, TransferFunction::from_rows(&rows).unwrap()));
            let projection = Projection::Orthographic { half_height: unit };
            let eye = DVec3::Z * 5.0 * unit;
            let view =
                View::new(Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection }, 3, 3).unwrap();
            for spec in specs(&gpu) {
                let options = with_option(&format!("{spec},step=0.25"), "empty-space", "march");
                let image = draw_on(&scene, &view, &options);
                // Two units of length.
                let want = if tau == 0.5 / unit { -(-1.0_f64).exp_m1() } else { alpha };
                for p in [image.pixel(1, 1), image.pixel(0, 2)] {
                    assert!(
                        p.iter().all(|v| (f64::from(*v) - want).abs() < 1e-5),
                        "{unit:e} tau {tau:e} {spec}: {p:?} is not {want}"
                    );
                }
            }
        }
    }
}

/// A ray in a face of the domain sees all of it.
#[test]
fn a_ray_in_a_face_sees_the_whole_length() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Homogeneous(1.0), 5, "f32", &[[0.0, 1.0, 1.0, 1.0, 1.0]]));
    let projection = Projection::Orthographic { half_height: 1.25 };
    let camera = Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection };
    // Rows at y = 1, 0.5, 0, -0.5, -1.
    let view = View::new(camera, 5, 5).unwrap();
    let want = -(-2.0_f64).exp_m1();
    for spec in specs(&gpu).iter().filter(|spec| spec.contains("compute")) {
        let image = draw_on(&scene, &view, &format!("{spec},step=0.4"));
        for (x, y) in [(0, 0), (2, 0), (4, 2), (4, 4), (2, 2)] {
            let a = f64::from(image.pixel(x, y)[3]);
            assert!((a - want).abs() < 3e-6, "{spec} {x},{y}: {a} is not {want}");
        }
    }
}

/// A sheet of NaN between two sides that are both invisible: what a long segment makes of the scalars between them
/// is the same whether bricks are passed over or not.
#[test]
fn empty_space_beside_vacuum_changes_nothing() {
    let gpu = gpu();
    let value = |z: u32| match z {
        0..=14 => 0.1,
        15..=17 => f32::NAN,
        _ => 0.9,
    };
    let samples = (0..16 * 16 * 33).map(|i| value(i / 256)).collect();
    let grid = Grid::new([16, 16, 33], Samples::F32(samples)).unwrap();
    let grid =
        grid.with_placement(DVec3::splat(0.06), DVec3::new(-0.45, -0.45, -0.96), DMat3::IDENTITY).unwrap();
    let rows = [[0.45, 1.0, 0.8, 0.3, 0.0], [0.5, 1.0, 0.8, 0.3, 24.0], [0.55, 1.0, 0.8, 0.3, 0.0]];
    let scene = GpuScene::new(&gpu, Scene::new(grid, TransferFunction::from_rows(&rows).unwrap()));
    let view = view(perspective(), 1.0, 30, 26);
    for spec in specs(&gpu).iter().filter(|spec| spec.contains("compute")) {
        for step in ["1", "6", "9"] {
            let render =
                |empty: &str| draw_on(&scene, &view, &format!("{spec},step={step},empty-space={empty}"));
            assert_eq!(render("skip"), render("march"), "{spec} step {step}");
        }
    }
}

/// Empty bricks, of which the grid's sides cut some, hide nothing: small spots in different bricks and at their edges.
#[test]
fn empty_bricks_change_nothing() {
    let gpu = gpu();
    let dims = [70, 45, 101];
    let spots = [[33, 31, 30], [64, 32, 32], [2, 44, 100], [40, 7, 66], [69, 0, 97]];
    let value = |i: u32| {
        let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        let near = |spot: &[u32; 3]| (0..3).all(|axis| at[axis].abs_diff(spot[axis]) <= 1);
        if spots.iter().any(near) { 200_u8 } else { 0 }
    };
    let samples = (0..dims.iter().product()).map(value).collect();
    let grid = Grid::new(dims, Samples::U8(samples)).unwrap();
    let grid =
        grid.with_placement(DVec3::splat(0.02), DVec3::new(-0.7, -0.45, -1.0), DMat3::IDENTITY).unwrap();
    let rows = [[0.0, 1.0, 0.8, 0.3, 0.0], [10.0, 1.0, 0.8, 0.3, 0.0], [200.0, 0.4, 0.8, 1.0, 30.0]];
    let scene = GpuScene::new(&gpu, Scene::new(grid, TransferFunction::from_rows(&rows).unwrap()));
    for (projection, distance) in [(perspective(), 1.0), (orthographic(), -1.0), (perspective(), 0.1)] {
        let view = view(projection, distance, 60, 52);
        for spec in specs(&gpu).iter().filter(|spec| spec.contains("compute")) {
            let render = |empty: &str| draw_on(&scene, &view, &format!("{spec},empty-space={empty}"));
            let marched = render("march");
            assert!(marched.pixels().iter().any(|pixel| pixel[3] > 0.1), "{spec}: nothing to see");
            assert!(render("skip") == marched, "{spec} {projection:?} {distance}");
        }
    }
}

/// NaN in the stored slices themselves: cells on both sides of it are vacuum.
#[test]
fn stored_slices_keep_cells_with_nan_empty() {
    let gpu = gpu();
    let samples = (0..9 * 9 * 9).map(|i| if i / 81 == 4 { f32::NAN } else { 1.0 }).collect();
    let grid = Grid::new([9, 9, 9], Samples::F32(samples)).unwrap();
    let grid = grid.with_placement(DVec3::splat(0.25), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let scene = Scene::new(grid, TransferFunction::from_rows(&[[0.0, 1.0, 1.0, 1.0, 1.0]]).unwrap());
    let on_device = GpuScene::new(&gpu, scene.clone());
    for projection in [perspective(), orthographic()] {
        for distance in [1.0, -1.0] {
            let view = view(projection, distance, 40, 34);
            for route in ["raster", "compute"] {
                let errors =
                    errors(&draw_on(&on_device, &view, &format!("slices-2d:route={route}")), &scene, &view);
                // A homogeneous half on either side of two cells of vacuum.
                assert!(errors.all.p999 < 2e-2 && errors.all.rmse < 2e-3, "{projection:?} {route}: {errors}");
            }
        }
    }
}

/// Segments of a ray are equally long in every direction; slabs of equal depth are not, and at a wide angle their
/// samples lie far apart.
#[test]
fn rays_keep_their_spacing_at_wide_angles() {
    let gpu = gpu();
    let scene = scene(Field::Blobs, 24, "f32", &FOG);
    let projection = Projection::Perspective { fov_y_deg: 160.0 };
    let camera = Camera { eye: DVec3::new(0.1, 0.05, 0.6), target: DVec3::ZERO, up: DVec3::Y, projection };
    let view = View::new(camera, 48, 48).unwrap();
    let truth = truth(&scene, &view);
    let on_device = GpuScene::new(&gpu, scene);
    let error =
        |spec: &str| ImageErrors::between_f64(&draw_on(&on_device, &view, spec), &truth).unwrap().all.rmse;
    let (rays, slices) = (error("raycast:step=1"), error("slices-3d:step=1"));
    println!("rays {rays:.2e}, slices {slices:.2e}");
    assert!(rays < 0.5 * slices, "rays {rays:e}, slices {slices:e}");
}
