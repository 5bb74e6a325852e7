//! `slices-3d` against closed forms and the float64 reference, on every route.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of test images")]

mod common;

use common::*;
use glam::{DMat3, DVec2, DVec3};
use volraster::gpu::{GpuOptions, OptionalFeature};
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceOptions};
use volraster::scene::{Camera, Field, Grid, Projection, Rescale, Samples, Scene, TransferFunction, View};
use volraster::technique::{GpuScene, Method, Renderer, Technique};
use volraster::{Gpu, Image, TargetDesc};

/// The routes that this device offers; the others are named aloud.
fn routes(gpu: &Gpu) -> Vec<&'static str> {
    let offered = |route: &&str| *route != "raster" || gpu.has(OptionalFeature::BlendRgba32f);
    for route in Method::Slices3d.routes().iter().filter(|route| !offered(route)) {
        println!("skipped: slices-3d/{route}: the device does not blend into 32-bit float");
    }
    Method::Slices3d.routes().iter().copied().filter(offered).collect()
}

fn technique(options: &str) -> Technique {
    Technique::parse(&format!("slices-3d:{options}")).unwrap()
}

fn draw(gpu: &Gpu, scene: &Scene, view: &View, options: &str) -> Image {
    Renderer::new(&GpuScene::new(gpu, scene.clone()), technique(options)).render(view).unwrap()
}

fn truth(scene: &Scene, view: &View) -> reference::ReferenceImage {
    reference::render(scene, view, &ReferenceOptions::default(), None).unwrap()
}

fn errors(image: &Image, scene: &Scene, view: &View) -> ImageErrors {
    ImageErrors::between_f64(image, &truth(scene, view)).unwrap()
}

/// Length of the ray inside the cube [-1, 1]³; perspective rays start at the eye.
fn chord(view: &View, pixel: DVec2) -> f64 {
    let (origin, direction) = view.ray(pixel);
    let mut range = [if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY }, f64::INFINITY];
    for axis in 0..3 {
        let (a, b) = ((-1.0 - origin[axis]) / direction[axis], (1.0 - origin[axis]) / direction[axis]);
        range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
    }
    (range[1] - range[0]).max(0.0)
}

/// Whether the outline of the cube passes within 1/64 pixel of a pixel's centre.
fn on_outline(view: &View, pixel: DVec2) -> bool {
    let hit = chord(view, pixel) > 0.0;
    (0..16).any(|i| {
        let angle = f64::from(i) / 16.0 * std::f64::consts::TAU;
        (chord(view, pixel + DVec2::new(angle.cos(), angle.sin()) / 64.0) > 0.0) != hit
    })
}

/// A homogeneous cube has opacity `1 - exp(-tau d)` at any spacing: what is left is rounding. The bound
/// is that of every technique in rgba32f: `max(2e-6, 1.2e-7 N)` for N blended pieces, and the rounding of
/// the depth at the eye's distance.
#[test]
fn a_homogeneous_cube_is_exact() {
    let gpu = gpu();
    let mut worst: f64 = 0.0;
    for tau in [0.05, 1.0, 25.0] {
        let rows = [[0.0, 0.25, 0.5, 1.0, tau]];
        let scene = scene(Field::Homogeneous(1.0), 9, "f32", &rows);
        for (projection, distance) in [
            (perspective(), 1.0),
            (perspective(), 0.12),
            (perspective(), 0.3),
            (orthographic(), 1.0),
            (orthographic(), 0.1),
        ] {
            let view = view(projection, distance, 72, 60);
            let eye = view.camera().eye.length();
            for step in ["4", "0.37", "0.02"] {
                for route in routes(&gpu) {
                    for order in if route == "raster" {
                        ["order=back-to-front,", "order=front-to-back,"].as_slice()
                    } else {
                        &[""]
                    } {
                        let options = format!("{order}step={step},route={route}");
                        let renderer =
                            Renderer::new(&GpuScene::new(&gpu, scene.clone()), technique(&options));
                        let mut frames = renderer.frames(&view).unwrap();
                        frames.draw(&view).unwrap();
                        let image = frames.read_back().unwrap();
                        let slices =
                            frames.plan().counters().iter().find(|c| c.0 == "slices").unwrap().1 as f64;
                        let bound = (1.2e-7 * slices).max(2e-6) + 4.0 * (-24.0_f64).exp2() * tau * eye;
                        for y in 0..60 {
                            for x in 0..72 {
                                let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                                if on_outline(&view, pixel) {
                                    continue;
                                }
                                let alpha = -(-tau * chord(&view, pixel)).exp_m1();
                                let [r, g, b, a] = image.pixel(x, y).map(f64::from);
                                let error = (a - alpha).abs();
                                worst = worst.max(error / bound);
                                assert!(
                                    error <= bound,
                                    "tau {tau} {projection:?} x {distance} {options} at {x},{y}: {a} is not {alpha} within {bound:e}"
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
    }
    println!("largest error: {worst:.3} of the bound");
    assert!(worst > 0.0, "the comparison saw nothing");
}

/// Midpoint sampling of clipped pieces is second order where the field is affine (trilinear
/// reconstruction is exact and has no kinks) and colour and extinction are linear in the scalar. The
/// phase of the slices differs from pixel to pixel because each ray enters elsewhere, so the median over
/// the pixels is taken. Steps stop before the float32 floor: the last error is some 1e-6.
#[test]
fn sampling_converges_at_second_order() {
    let gpu = gpu();
    let scene = scene(Field::Ramp, 9, "f32", &[[0.0, 0.1, 0.9, 0.4, 0.0], [1.0, 0.9, 0.2, 0.5, 3.0]]);
    for projection in [perspective(), orthographic()] {
        let view = view(projection, 1.0, 96, 80);
        let truth = truth(&scene, &view);
        for route in routes(&gpu) {
            let gpu_scene = GpuScene::new(&gpu, scene.clone());
            // Error of each pixel at each step: the largest over the channels.
            let error = |step: f64| -> Vec<f64> {
                let t = technique(&format!("filter=exact,route={route},step={step}"));
                let image = Renderer::new(&gpu_scene, t).render(&view).unwrap();
                image
                    .pixels()
                    .iter()
                    .zip(truth.pixels())
                    .map(|(p, t)| (0..4).map(|c| (f64::from(p[c]) - t[c]).abs()).fold(0.0, f64::max))
                    .collect()
            };
            let steps = [0.8, 0.4, 0.2, 0.1, 0.05];
            let all: Vec<Vec<f64>> = steps.iter().map(|&step| error(step)).collect();
            for (pair, step) in all.windows(2).zip(steps) {
                // Rays that graze an edge of the cube see less than one slab.
                let mut orders: Vec<f64> = (0..truth.pixels().len())
                    .filter(|&i| {
                        let pixel = DVec2::new((i % 96) as f64 + 0.5, (i / 96) as f64 + 0.5);
                        chord(&view, pixel) > 0.5 && pair[1][i] > 0.0
                    })
                    .map(|i| (pair[0][i] / pair[1][i]).log2())
                    .collect();
                assert!(orders.len() >= 1000, "{} pixels", orders.len());
                orders.sort_by(f64::total_cmp);
                let median = orders[orders.len() / 2];
                println!(
                    "{projection:?} {route} step {step} to {}: order {median:.3} over {} pixels",
                    step / 2.0,
                    orders.len()
                );
                assert!((median - 2.0).abs() <= 0.15, "{projection:?} {route} step {step}: order {median}");
            }
        }
    }
}

/// The figures that are promised: marschner-lobb 128³ in float32 under *shells*, 512² perspective.
#[test]
fn marschner_lobb_meets_its_errors() {
    let gpu = gpu();
    let scene = scene(Field::MarschnerLobb, 128, "f32", &SHELLS);
    let view = view(perspective(), 1.0, 512, 512);
    let truth = truth(&scene, &view);
    let gpu_scene = GpuScene::new(&gpu, scene.clone());
    for (step, bound) in [(1.0, 3.5e-3), (0.5, 1.5e-3)] {
        for route in routes(&gpu) {
            let t = technique(&format!("step={step},route={route}"));
            let image = Renderer::new(&gpu_scene, t).render(&view).unwrap();
            let errors = ImageErrors::between_f64(&image, &truth).unwrap();
            println!("step {step} {route}: {errors}");
            assert!(errors.all.rmse <= bound, "step {step} {route}: {errors}");
        }
    }
}

/// Both routes cut the same slabs and classify the same samples. What differs is the order of float32
/// additions: a few rounding errors for each of N slices, and where the two compilers' rounding puts a
/// sample on either side of a steep knot (tau rises by 30 over 0.08: 1e-6 in s is 4e-4 in tau, times the
/// step of 0.03: 1e-5).
#[test]
fn routes_agree() {
    let gpu = gpu();
    let scene = scene(Field::MarschnerLobb, 32, "f32", &SHELLS);
    for projection in [perspective(), orthographic()] {
        for distance in [1.0, 0.1] {
            let view = view(projection, distance, 65, 47);
            for ends in ["clip", "plane"] {
                for filter in ["exact", "hardware"] {
                    let images: Vec<Image> = routes(&gpu)
                        .iter()
                        .map(|route| {
                            draw(
                                &gpu,
                                &scene,
                                &view,
                                &format!("step=0.5,route={route},ends={ends},filter={filter}"),
                            )
                        })
                        .collect();
                    for pair in images.windows(2) {
                        let errors = ImageErrors::between(&pair[0], &pair[1]).unwrap();
                        // Classic polygons end at edges: there one pixel may have a slice more or less.
                        let worst = if ends == "clip" { errors.all.max_abs } else { errors.all.p999 };
                        assert!(worst <= 4e-5, "{projection:?} x {distance} {ends} {filter}: {errors}");
                    }
                }
            }
        }
    }
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
    for (name, grid, rescale) in grids {
        for direction in [DMat3::IDENTITY, DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), shear] {
            let centre = direction * (DVec3::new(0.15, 0.18, 0.2) * grid.last_index() * 0.5);
            let grid = grid.clone().with_rescale(rescale).unwrap();
            let grid = grid.with_placement(DVec3::new(0.15, 0.18, 0.2), -centre, direction).unwrap();
            let scene = Scene { grid, transfer: TransferFunction::from_rows(&rows).unwrap() };
            let view = view(perspective(), 1.0, 60, 50);
            let truth = truth(&scene, &view);
            for options in ["filter=hardware", "filter=exact", "filter=exact,route=raster"] {
                let image = draw(&gpu, &scene, &view, &format!("step=0.1,{options}"));
                let errors = ImageErrors::between_f64(&image, &truth).unwrap();
                assert!(errors.all.rmse < 3e-4, "{name} {direction} {options}: {errors}");
            }
        }
    }
    // The comparison sees a mirrored axis.
    let view = view(perspective(), 1.0, 60, 50);
    let scene = Scene { grid: base.clone(), transfer: TransferFunction::from_rows(&rows).unwrap() };
    let mirrored = base
        .with_placement(
            DVec3::new(2.0 / 13.0, 2.0 / 11.0, 2.0 / 9.0),
            DVec3::new(1.0, -1.0, -1.0),
            DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)),
        )
        .unwrap();
    let mirrored = Scene { grid: mirrored, transfer: scene.transfer.clone() };
    assert!(errors(&draw(&gpu, &mirrored, &view, "step=0.1"), &scene, &view).all.rmse > 1e-2);
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
        let scene = Scene { grid, transfer };
        for projection in [perspective(), orthographic()] {
            let view = view(projection, 1.0, 90, 70);
            let (expected, _) = view.project(position).unwrap();
            for route in routes(&gpu) {
                let image = draw(&gpu, &scene, &view, &format!("step=0.25,route={route}"));
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
        for (projection, transfer) in [(perspective(), &few), (orthographic(), &few), (perspective(), &many)]
        {
            let scene = Scene { grid: grid.clone(), transfer: transfer.clone() };
            let view = view(projection, 1.0, 60, 50);
            for route in routes(&gpu) {
                for filter in ["exact", "hardware"] {
                    let image =
                        draw(&gpu, &scene, &view, &format!("step=0.02,route={route},filter={filter}"));
                    let errors = errors(&image, &scene, &view);
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
        for route in routes(&gpu) {
            let image = |transfer: &TransferFunction| {
                let scene = Scene { grid: grid.clone(), transfer: transfer.clone() };
                draw(&gpu, &scene, &view, &format!("step=0.5,route={route}"))
            };
            let errors = ImageErrors::between(&image(&few), &image(&many)).unwrap();
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
    for padding in [0, 1, 2, 30] {
        // The jump at the data's value is the last of the knots, or followed by others.
        for after in [0, 1] {
            let mut rows = vec![[0.0, 1.0, 1.0, 1.0, 9.0]; 1 + padding];
            rows.extend([[1.0, 1.0, 1.0, 1.0, 9.0], [1.0, 1.0, 1.0, 1.0, 0.25]]);
            rows.extend(vec![[2.0, 1.0, 1.0, 1.0, 5.0]; after]);
            let scene = scene(Field::Homogeneous(1.0), 3, "f32", &rows);
            for route in routes(&gpu) {
                let a =
                    f64::from(draw(&gpu, &scene, &view, &format!("step=0.5,route={route}")).pixel(1, 1)[3]);
                let want = -(-0.5_f64).exp_m1();
                assert!(
                    (a - want).abs() < 2e-6,
                    "{route} padding {padding} after {after}: {a} is not {want}"
                );
            }
        }
    }
}

/// Low-precision accumulation: near rgba32f where the design says it is good, and worse than it.
#[test]
fn targets_differ_by_their_precision() {
    let gpu = gpu();
    let scene = scene(Field::Blobs, 16, "f32", &FOG);
    let view = view(perspective(), 1.0, 60, 50);
    if !routes(&gpu).contains(&"raster") {
        return;
    }
    let best = draw(&gpu, &scene, &view, "step=1,route=raster");
    for order in ["back-to-front", "front-to-back"] {
        // 30 slices: each blend rounds by half a unit, 2^-12 relative for half floats near 1, 1/510 for 8 bits.
        for (target, bound) in
            [("rgba16f", 30.0 * (-12.0_f64).exp2()), ("rgba8", 30.0 / 510.0), ("rgba32f", 1e-5)]
        {
            let image = draw(&gpu, &scene, &view, &format!("step=1,target={target},order={order}"));
            let errors = ImageErrors::between(&image, &best).unwrap();
            assert!(errors.all.max_abs <= bound, "{target} {order}: {errors}");
            assert!(
                target == "rgba32f" || errors.all.max_abs > 1e-4,
                "{target} {order} is suspiciously exact: {errors}"
            );
        }
    }
}

/// The classic polygons, without clipping, are worse at the domain's faces but the same inside.
#[test]
fn plane_ends_are_the_classic_polygons() {
    let gpu = gpu();
    let scene = scene(Field::Homogeneous(1.0), 9, "f32", &[[0.0, 1.0, 1.0, 1.0, 1.0]]);
    let view = view(orthographic(), 1.0, 60, 50);
    for route in routes(&gpu) {
        let clip =
            errors(&draw(&gpu, &scene, &view, &format!("step=1,ends=clip,route={route}")), &scene, &view);
        let plane =
            errors(&draw(&gpu, &scene, &view, &format!("step=1,ends=plane,route={route}")), &scene, &view);
        // One slice too many or too few at each end: at most a whole step of 0.25 at tau 1.
        assert!(
            plane.all.max_abs > 100.0 * clip.alpha.p99 && plane.alpha.max_abs < 0.25,
            "{route}: {clip} / {plane}"
        );
    }
}

/// 8-bit data: a device whose filter rounds to 8 bits is found out and avoided.
#[test]
fn eight_bit_data_is_filtered_finely() {
    let gpu = gpu();
    let coarse = gpu.filters_in_8_bit().unwrap();
    println!("filters in 8 bit: {coarse}");
    if gpu.report().name.contains("llvmpipe") {
        assert!(coarse, "lavapipe filters 8-bit volumes in 8-bit fixed point, and the probe must see it");
    }
    let rows: Vec<[f64; 5]> = SHELLS.iter().map(|&[s, r, g, b, tau]| [s * 255.0, r, g, b, tau]).collect();
    let scene = scene(Field::MarschnerLobb, 32, "u8", &rows);
    let view = view(perspective(), 1.0, 96, 80);
    let truth = truth(&scene, &view);
    let rmse = |filter: &str| {
        let image = draw(&gpu, &scene, &view, &format!("step=0.25,filter={filter}"));
        ImageErrors::between_f64(&image, &truth).unwrap().all.rmse
    };
    let (hardware, exact) = (rmse("hardware"), rmse("exact"));
    // The same numbers as floats: exact fetches make no difference between the types.
    let Samples::U8(codes) = scene.grid.samples() else { panic!("u8 was asked for") };
    let floats =
        Grid::new(scene.grid.dims(), Samples::F32(codes.iter().map(|&v| f32::from(v)).collect())).unwrap();
    let floats = floats.with_placement(DVec3::splat(2.0 / 31.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let floats = Scene { grid: floats, transfer: scene.transfer.clone() };
    let twin = errors(&draw(&gpu, &floats, &view, "step=0.25,filter=exact"), &scene, &view).all.rmse;
    assert!((exact - twin).abs() < 1e-6, "exact {exact:e} of u8, {twin:e} of the same as f32");
    // Sampling dominates: 8-bit rounding (0.75/255 at tau slopes of 375) would add some 1e-2.
    println!("hardware {hardware:e}, exact {exact:e}");
    assert!(!coarse || hardware < 1.2 * exact + 1e-4, "hardware {hardware:e}, exact {exact:e}");
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
    let view = View::new(camera, 9, 7).unwrap();
    // Two units of depth, 140,000 slabs; voxels are two units wide.
    let options = technique("step=7.142857e-6,route=compute");
    let alpha = |gpu: &Gpu| {
        let renderer = Renderer::new(&GpuScene::new(gpu, scene.clone()), options);
        let mut frames = renderer.frames(&view).unwrap();
        frames.draw(&view).unwrap();
        let dispatches = frames.plan().counters().iter().find(|c| c.0 == "dispatches_or_draws").unwrap().1;
        (f64::from(frames.read_back().unwrap().pixel(4, 3)[3]), dispatches)
    };
    let want = -(-tau * 2.0_f64).exp_m1();
    // 1.2e-7 a piece is the worst case, which rounding in one direction would reach.
    let bound = 1.2e-7 * 140_000.0;
    let (split, dispatches) = alpha(&gpu);
    assert!((split - want).abs() <= bound, "{split} is not {want} in {dispatches} dispatches");
    // The same with a limit of our own, on any device.
    let limited = gpu_with(GpuOptions { loop_limit: Some(10_000), ..GpuOptions::default() });
    let (pieces, dispatches) = alpha(&limited);
    assert!(dispatches >= 14, "{dispatches} dispatches");
    assert!((pieces - want).abs() <= bound, "{pieces} is not {want} in {dispatches} dispatches");
    // A plan for one dispatch has no room for a view that needs two, and keeps its own.
    let long = technique("step=6e-4,route=compute");
    let renderer = Renderer::new(&GpuScene::new(&limited, scene.clone()), long);
    let mut plan = renderer.prepare(&view, &TargetDesc::own()).unwrap();
    let before = plan.counters();
    let across = View::new(Camera { eye: DVec3::new(3.0, 3.0, 3.0), ..camera }, 9, 7).unwrap();
    assert!(!plan.set_view(&across).unwrap());
    assert_eq!(plan.counters(), before);
    drop((plan, renderer));
    // Without the split a device that ends long loops draws a wrong picture: that is what the probe is for.
    let unlimited = gpu_with(GpuOptions { loop_limit: Some(u32::MAX), ..GpuOptions::default() });
    let (whole, dispatches) = alpha(&unlimited);
    assert_eq!(dispatches, 1);
    if limit == u32::MAX {
        assert!((whole - want).abs() <= bound, "{whole} is not {want}");
    } else {
        assert!(
            (whole - want).abs() > 10.0 * bound,
            "{whole}: this device's limit of {limit} should have cut the march short"
        );
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
    let centre = |tau: f64, view: &View, options: &str| {
        let scene = scene(Field::Homogeneous(1.0), 3, "f32", &[[0.0, 1.0, 1.0, 1.0, tau]]);
        draw(&gpu, &scene, view, options).pixel(0, 0).map(f64::from)
    };
    for route in routes(&gpu) {
        let parallel = square(orthographic(), 4.0, 1);
        // Thin: 1 - exp(-od) would give 0. One slab of 2 units, then 1000.
        for (step, tolerance) in [("9", 1e-6), ("0.002", 1e-3)] {
            let a = centre(0.5e-8, &parallel, &format!("step={step},route={route}"))[3];
            assert!((a / 1e-8 - 1.0).abs() <= tolerance, "{route} step {step}: {a}");
        }
        // Thick: alpha is 1 and the colour is the colour.
        for tau in [60.0, 1e4, 1e30, 1e300] {
            let p = centre(tau, &parallel, &format!("step=0.5,route={route}"));
            assert_eq!(p, [1.0; 4], "{route} tau {tau}");
        }
        // Nothing: exactly transparent black.
        assert_eq!(centre(0.0, &parallel, &format!("route={route}")), [0.0; 4]);
        // A million sizes away, through a small angle; the cube is 20.2 pixels of 31 wide.
        let far = square(
            Projection::Perspective { fov_y_deg: (3.07e-6_f64 / 2.0).atan().to_degrees() * 2.0 },
            1e6,
            31,
        );
        let scene = scene(Field::Blobs, 16, "f32", &FOG);
        let errors =
            errors(&draw(&gpu, &scene, &far, &format!("step=0.05,route={route},filter=exact")), &scene, &far);
        assert!(errors.all.rmse < 1e-4, "{route}: {errors}");
        // A wide angle from inside, a very narrow image, and the view along an axis from a face.
        for view in [
            square(Projection::Perspective { fov_y_deg: 170.0 }, 0.5, 40),
            View::new(camera(perspective(), 1.0), 1, 64).unwrap(),
            square(perspective(), 1.0, 33),
        ] {
            let errors = self::errors(
                &draw(&gpu, &scene, &view, &format!("step=0.05,route={route},filter=exact")),
                &scene,
                &view,
            );
            // At 85 degrees off the axis planar slices lie 1/cos = 11 times as far apart along the ray.
            assert!(
                errors.non_finite == 0 && errors.all.rmse < 1e-3,
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
    for projection in [perspective(), orthographic()] {
        let base = camera(projection, 1.0);
        let view = View::new(base, 60, 50).unwrap();
        for route in routes(&gpu) {
            let options = format!("step=0.5,route={route}");
            let want = draw(&gpu, &plain, &view, &options);
            for unit in [3e18, 1e-10] {
                let grid = plain.grid.clone();
                let grid = grid
                    .with_placement(DVec3::splat(2.0 / 15.0 * unit), DVec3::NEG_ONE * unit, DMat3::IDENTITY)
                    .unwrap();
                let rows: Vec<[f64; 5]> =
                    FOG.iter().map(|&[s, r, g, b, tau]| [s, r, g, b, tau / unit]).collect();
                let scene = Scene { grid, transfer: TransferFunction::from_rows(&rows).unwrap() };
                let projection = match projection {
                    Projection::Orthographic { half_height } => {
                        Projection::Orthographic { half_height: half_height * unit }
                    }
                    perspective => perspective,
                };
                let view = View::new(Camera { eye: base.eye * unit, projection, ..base }, 60, 50).unwrap();
                let errors = ImageErrors::between(&draw(&gpu, &scene, &view, &options), &want).unwrap();
                // The same numbers but for the rounding of the scaled ones.
                assert!(errors.all.max_abs < 2e-5, "{unit:e} {route} {projection:?}: {errors}");
            }
        }
    }
    // Beyond float32 it is refused, not drawn wrong.
    let far =
        View::new(Camera { eye: DVec3::new(0.0, 0.0, 1e39), ..camera(perspective(), 1.0) }, 8, 8).unwrap();
    let error = Renderer::new(&GpuScene::new(&gpu, plain), Technique::default()).render(&far).unwrap_err();
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
    let scene = Scene { grid, transfer: TransferFunction::from_rows(&rows).unwrap() };
    let camera =
        Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection: orthographic() };
    let view = View::new(camera, 9, 9).unwrap();
    let want = truth(&scene, &view).pixel(4, 4)[0];
    assert!(want > 1e-3, "the scene shows what it should: {want}");
    for route in routes(&gpu) {
        let got = f64::from(draw(&gpu, &scene, &view, &format!("step=0.01,route={route}")).pixel(4, 4)[0]);
        // Sampling places the jump to half a step: 16 * 0.003 of optical depth in front of it.
        assert!((got / want - 1.0).abs() < 0.1, "{route}: {got} is not {want}");
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
        let scene = Scene { grid, transfer: TransferFunction::from_rows(&rows).unwrap() };
        // A sampler's filter may round even between equal samples.
        for options in ["filter=exact", "filter=exact,route=raster"] {
            let a = f64::from(draw(&gpu, &scene, &view, options).pixel(1, 1)[3]);
            let want = -(-0.5_f64).exp_m1();
            assert!((a - want).abs() < 2e-6, "{} {value} {options}: {a} is not {want}", samples.type_name());
        }
    }
}

/// A plain scene builds one pipeline and takes the volume, the knots and the image; what is not used adds
/// nothing.
#[test]
fn a_plain_scene_takes_what_it_needs() {
    let view = view(perspective(), 1.0, 64, 48);
    // Texels, and at most what alignment adds: lavapipe rounds an image up to 64 bytes a row and 4 rows.
    let check = |options: &str, scene: Scene, pipelines: &[&str], volume_bytes: u64, image_bytes: u64| {
        let gpu = gpu();
        assert_eq!(gpu.pipelines(), Vec::<String>::new());
        assert_eq!(gpu.memory_report(), []);
        let gpu_scene = GpuScene::new(&gpu, scene);
        let renderer = Renderer::new(&gpu_scene, technique(options));
        assert_eq!(gpu.memory_report(), [], "nothing is taken before it is needed");
        let frames = renderer.frames(&view).unwrap();
        assert_eq!(gpu.pipelines(), pipelines, "{options}");
        let mut report = gpu.memory_report();
        report.sort();
        let want =
            [("slices-3d.accumulation", image_bytes), ("transfer.knots", 16 * 48), ("volume", volume_bytes)];
        assert_eq!(report.len(), want.len(), "{options}: {report:?}");
        for ((name, bytes), (wanted, least)) in report.iter().zip(want) {
            assert_eq!(name, wanted, "{options}");
            assert!(
                (least..=least + least / 4 + 4096).contains(bytes),
                "{options}: {name} takes {bytes} for {least}"
            );
        }
        drop(frames);
        drop(renderer);
        drop(gpu_scene);
        assert_eq!(gpu.memory_report(), [], "everything is given back");
    };
    let float = || scene(Field::MarschnerLobb, 32, "f32", &SHELLS);
    let pixels = 64 * 48;
    check("route=compute", float(), &["slices-3d.march"], 32 * 32 * 32 * 4, pixels * 16);
    check("route=raster", float(), &["slices-3d.draw"], 32 * 32 * 32 * 4, pixels * 16);
    check("target=rgba8", float(), &["slices-3d.draw"], 32 * 32 * 32 * 4, pixels * 4);
    check(
        "filter=exact",
        scene(Field::MarschnerLobb, 64, "u8", &SHELLS),
        &["slices-3d.march"],
        64 * 64 * 64,
        pixels * 16,
    );
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

    let gpu = gpu();
    let limit = gpu.max_image_3d();
    let long = limit + 1;
    let grid = Grid::new([long, 2, 2], Samples::U8(vec![1; 4 * long as usize])).unwrap();
    let scene = Scene { grid, transfer: TransferFunction::from_rows(&FOG).unwrap() };
    let error =
        Renderer::new(&GpuScene::new(&gpu, scene), technique("filter=exact")).render(&view).unwrap_err();
    let message = error.to_string();
    assert!(message.contains(&limit.to_string()) && message.contains(&long.to_string()), "{message}");
    assert_eq!(error.exit_code(), 3);

    let scene = common::scene(Field::Ramp, 8, "f32", &FOG);
    let error = Renderer::new(&GpuScene::new(&gpu, scene), technique("step=1e-9")).render(&view).unwrap_err();
    assert!(error.to_string().contains("step") && error.exit_code() == 2, "{error}");
}

/// The same frame is the same picture, bit by bit, and a plan turned to a view draws what a new plan does.
#[test]
fn frames_repeat_exactly() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::MarschnerLobb, 24, "f32", &SHELLS));
    for route in routes(&gpu) {
        let renderer = Renderer::new(&scene, technique(&format!("route={route}")));
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
        assert!(plan.set_view(&a).unwrap() && slices(&plan) > before, "{route}: {before} slices");
        assert!(
            !plan.set_view(&view(perspective(), 1.0, 51, 40)).unwrap(),
            "another size needs another plan"
        );
        assert_eq!(frames.read_back().unwrap(), frames.read_back().unwrap());
    }
}
