//! `slices-3d` against closed forms and the float64 reference, on every route.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of test images")]

use crate::common::*;
use glam::{DMat3, DVec2, DVec3};
use volraster::GpuScene;
use volraster::measure::ImageErrors;
use volraster::scene::{Field, Grid, Samples, Scene};
use volraster::technique::{Method, Renderer};
use volraster::{Gpu, Image};

/// Options of this technique.
fn spec(options: &str) -> String {
    format!("slices-3d:{options}")
}

fn routes(gpu: &Gpu) -> Vec<&'static str> {
    routes_of(gpu, Method::Slices3d)
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
                let t = technique(&spec(&format!("filter=exact,route={route},step={step}")));
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
            let t = technique(&spec(&format!("step={step},route={route}")));
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
                                &spec(&format!("step=0.5,route={route},ends={ends},filter={filter}")),
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

/// Low-precision accumulation: near rgba32f where the design says it is good, and worse than it.
#[test]
fn targets_differ_by_their_precision() {
    let gpu = gpu();
    let scene = scene(Field::Blobs, 16, "f32", &FOG);
    let view = view(perspective(), 1.0, 60, 50);
    if !routes(&gpu).contains(&"raster") {
        return;
    }
    let best = draw(&gpu, &scene, &view, &spec("step=1,route=raster"));
    for order in ["back-to-front", "front-to-back"] {
        // 30 slices: each blend rounds by half a unit, 2^-12 relative for half floats near 1, 1/510 for 8 bits.
        for (target, bound) in
            [("rgba16f", 30.0 * (-12.0_f64).exp2()), ("rgba8", 30.0 / 510.0), ("rgba32f", 1e-5)]
        {
            let image = draw(&gpu, &scene, &view, &spec(&format!("step=1,target={target},order={order}")));
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
        let clip = errors(
            &draw(&gpu, &scene, &view, &spec(&format!("step=1,ends=clip,route={route}"))),
            &scene,
            &view,
        );
        let plane = errors(
            &draw(&gpu, &scene, &view, &spec(&format!("step=1,ends=plane,route={route}"))),
            &scene,
            &view,
        );
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
    println!("filters in 8 bit: {coarse}, error {:.1e}", gpu.filter_error().unwrap());
    if gpu.report().name.contains("llvmpipe") {
        assert!(coarse, "lavapipe filters 8-bit volumes in 8-bit fixed point, and the probe must see it");
    }
    let rows: Vec<[f64; 5]> = SHELLS.iter().map(|&[s, r, g, b, tau]| [s * 255.0, r, g, b, tau]).collect();
    let scene = scene(Field::MarschnerLobb, 32, "u8", &rows);
    let view = view(perspective(), 1.0, 96, 80);
    let truth = truth(&scene, &view);
    let rmse = |filter: &str| {
        let image = draw(&gpu, &scene, &view, &spec(&format!("step=0.25,filter={filter}")));
        ImageErrors::between_f64(&image, &truth).unwrap().all.rmse
    };
    let (hardware, exact) = (rmse("hardware"), rmse("exact"));
    // The same numbers as floats: exact fetches make no difference between the types.
    let Samples::U8(codes) = scene.grid().unwrap().samples() else { panic!("u8 was asked for") };
    let floats =
        Grid::new(scene.grid().unwrap().dims(), Samples::F32(codes.iter().map(|&v| f32::from(v)).collect()))
            .unwrap();
    let floats = floats.with_placement(DVec3::splat(2.0 / 31.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let floats = Scene::new(floats, scene.transfer.clone());
    let twin = errors(&draw(&gpu, &floats, &view, &spec("step=0.25,filter=exact")), &scene, &view).all.rmse;
    assert!((exact - twin).abs() < 1e-6, "exact {exact:e} of u8, {twin:e} of the same as f32");
    // Sampling dominates: 8-bit rounding (0.75/255 at tau slopes of 375) would add some 1e-2.
    println!("hardware {hardware:e}, exact {exact:e}");
    // Coarse weights add a random error to each sample, of which some twenty are summed with weights below one.
    let floor = 1e-4 + 0.2 * gpu.filter_error().unwrap();
    assert!(!coarse || hardware < 1.2 * exact + floor, "hardware {hardware:e}, exact {exact:e}");
}
