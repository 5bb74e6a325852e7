//! Formats that raster accumulates in: what they lose, and what dithering gives back.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use crate::common::*;
use glam::DVec3;
use volraster::GpuScene;
use volraster::gpu::OptionalFeature;
use volraster::measure::ImageErrors;
use volraster::scene::{Camera, Field, Projection, View};
use volraster::technique::Renderer;
use volraster::{Gpu, Image};

/// A square image inside the cube's front face, seen along an axis: every pixel crosses the same 2 units.
fn view(side: u32) -> View {
    let projection = Projection::Orthographic { half_height: 0.5 };
    let camera = Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection };
    View::new(camera, side, side).unwrap()
}

/// A homogeneous cube of an optical depth and of one colour in all channels, in so many layers.
fn layers(gpu: &Gpu, od: f64, layers: u32, colour: f64, side: u32, options: &str) -> Image {
    let rows = [[0.0, colour, colour, colour, od / 2.0]];
    let scene = GpuScene::new(gpu, scene(Field::Homogeneous(1.0), 2, "f32", &rows));
    // One voxel is 2 units wide.
    let spec = format!("slices-3d:route=raster,step={},{options}", 1.0 / f64::from(layers));
    Renderer::new(&scene, technique(&spec)).render(&view(side)).unwrap()
}

/// Optical depths and numbers of layers of the table in the numerics notes (4.1).
const CASES: [(f64, u32); 10] = [
    (0.1, 64),
    (0.1, 1024),
    (0.1, 10_000),
    (1.0, 64),
    (1.0, 256),
    (1.0, 1024),
    (1.0, 10_000),
    (5.0, 256),
    (5.0, 1024),
    (5.0, 10_000),
];

/// Step of a format at a value.
fn quantum(target: &str, value: f64) -> f64 {
    match target {
        "rgba8" => 1.0 / 255.0,
        "rgba16" => 1.0 / 65535.0,
        "rgba16f" => (value.log2().floor() - 10.0).exp2(),
        _ => (value.log2().floor() - 23.0).exp2(),
    }
}

/// What N layers of one optical depth lose when every blend rounds to the format: opacity front to back and a
/// colour of 0.8 back to front. Where a layer's share is below half a step of the format from the first blend on,
/// all is lost, and growth stops where `a (1 - A)` falls below a step.
/// (How a device rounds is its own matter: nearest, or, for half floats on lavapipe, towards zero.)
#[test]
fn layers_are_lost_where_a_format_s_step_is_too_coarse() {
    let gpu = gpu();
    for target in ["rgba8", "rgba16", "rgba16f", "rgba32f"] {
        if target == "rgba32f" && !gpu.has(OptionalFeature::BlendRgba32f) {
            println!("skipped: the device does not blend into 32-bit float");
            continue;
        }
        for (od, n) in CASES {
            let share = -(-od / f64::from(n)).exp_m1();
            let want = -(-od).exp_m1();
            let under = layers(&gpu, od, n, 1.0, 2, &format!("target={target},order=front-to-back"));
            let over = layers(&gpu, od, n, 0.8, 2, &format!("target={target},order=back-to-front"));
            let (alpha, colour) = (f64::from(under.pixel(0, 0)[3]), f64::from(over.pixel(0, 0)[0]));
            println!("{target} od {od} layers {n}: {:+.1e} {:+.1e}", alpha - want, colour - 0.8 * want);
            if target != "rgba16f" && target != "rgba32f" && share < 0.49 * quantum(target, 1.0) {
                assert_eq!((alpha, colour), (0.0, 0.0), "{target} od {od} layers {n}");
            }
            // No blend is off by more than one step.
            let most = f64::from(n) * quantum(target, want);
            if most < want {
                assert!((alpha - want).abs() <= most, "{target} od {od} layers {n}: {alpha} is not {want}");
                assert!((colour - 0.8 * want).abs() <= most, "{target} od {od} layers {n}: {colour}");
            }
            // The table: eight bits have lost most of a thousand layers, half floats of ten thousand; sixteen
            // bits are good to 1e-2 for a thousand, and 32-bit floats always.
            match (target, n) {
                ("rgba8", 1024) => assert!(alpha < 0.6 * want, "{od}: {alpha}"),
                ("rgba16f", 10_000) => assert!(alpha < 0.7 * want, "{od}: {alpha}"),
                ("rgba16", 64..=1024) => assert!((alpha - want).abs() < 1e-2, "{od}: {alpha}"),
                ("rgba32f", _) => {
                    assert!((alpha - want).abs() <= (1.2e-7 * f64::from(n)).max(2e-6), "{od}: {alpha}")
                }
                _ => {}
            }
        }
    }
}

/// Rounded at random, the expected value is exact whatever the format and the number of layers: over 4096 pixels
/// the mean is within 4 standard errors, and the noise stays below sqrt(step * opacity), for steps are taken
/// with a chance in proportion. Without dithering the same layers are lost.
#[test]
fn dithering_is_unbiased() {
    let gpu = gpu();
    if !gpu.has(OptionalFeature::FragmentStores) {
        println!("skipped: the device does not store from fragment shaders");
        return;
    }
    for target in ["rgba8", "rgba16", "rgba16f"] {
        for dither in ["alpha", "blue"] {
            for order in ["front-to-back", "back-to-front"] {
                for (od, n) in [(0.1_f64, 64), (1.0, 128), (1.0, 256), (5.0, 128)] {
                    let want = -(-od).exp_m1();
                    let image = layers(
                        &gpu,
                        od,
                        n,
                        0.8,
                        64,
                        &format!("target={target},order={order},dither={dither},seed=3"),
                    );
                    for (channel, want) in [(3, want), (0, 0.8 * want)] {
                        let errors = || image.pixels().iter().map(|p| f64::from(p[channel]) - want);
                        let mean = errors().sum::<f64>() / 4096.0;
                        let rms = (errors().map(|e| e * e).sum::<f64>() / 4096.0).sqrt();
                        let what = format!("{target} {dither} {order} od {od} layers {n} channel {channel}");
                        println!("{what}: mean {mean:+.1e} rms {rms:.1e}");
                        // And float32's rounding of the blend.
                        assert!(mean.abs() <= 4.0 * rms / 64.0 + 2e-6, "{what}: mean {mean:e}, rms {rms:e}");
                        let most = (quantum(target, want) * want).sqrt();
                        assert!(rms > 0.0 && rms <= 1.2 * most, "{what}: rms {rms:e} above {most:e}");
                    }
                }
            }
        }
    }
    let lost = layers(&gpu, 1.0, 1024, 0.8, 2, "target=rgba8");
    assert_eq!(lost.pixel(0, 0), [0.0; 4]);
}

/// One seed, one picture; another seed, another one. Every technique that has the option dithers by every order, colour stays below opacity,
/// and the picture is the undithered float one but for noise.
#[test]
fn dithered_pictures_repeat_and_every_technique_dithers() {
    let gpu = gpu();
    let gpu_scene = GpuScene::new(&gpu, scene(Field::Blobs, 24, "f32", &FOG));
    for projection in [perspective(), orthographic()] {
        for distance in taken(2, [1.0, 0.2]) {
            let view = crate::common::view(projection, distance, 60, 50);
            let dithers = |spec: &&String| spec.contains("raster") && has_option(spec, "dither");
            for spec in specs(&gpu).iter().filter(dithers) {
                let render = |options: &str| {
                    Renderer::new(&gpu_scene, technique(&format!("{spec},{options}"))).render(&view).unwrap()
                };
                let exact = render("step=0.25");
                for order in ["front-to-back", "back-to-front"] {
                    let with = |options: &str| render(&format!("step=0.25,order={order},{options}"));
                    let first = with("target=rgba8,dither=alpha,seed=1");
                    assert_eq!(first, with("target=rgba8,dither=alpha,seed=1"), "{spec}");
                    assert_ne!(first, with("target=rgba8,dither=alpha,seed=2"), "{spec}");
                    let errors = ImageErrors::between(&first, &exact).unwrap();
                    assert!(
                        errors.all.rmse < 3e-2 && errors.all.bias.abs() < 2e-3,
                        "{spec} {order}: {errors}"
                    );
                    let rounded = ImageErrors::between(&with("target=rgba8"), &exact).unwrap();
                    assert!(
                        rounded.all.bias.abs() > 5.0 * errors.all.bias.abs(),
                        "{spec} {order}: {rounded}"
                    );
                    assert!(
                        first.pixels().iter().all(|p| p[..3].iter().all(|c| *c <= p[3])),
                        "{spec} {order}"
                    );
                }
            }
        }
    }
}

/// Blue noise has its error where the eye does not look: averaged over 4 x 4 pixels less is left than of white
/// noise, though single pixels are as noisy.
#[test]
fn blue_noise_averages_out_sooner() {
    let gpu = gpu();
    let blurred = |dither: &str| {
        let image = layers(&gpu, 0.1, 64, 1.0, 64, &format!("target=rgba8,dither={dither},seed=9"));
        let want = -(-0.1_f64).exp_m1();
        let at = |x: u32, y: u32| f64::from(image.pixel(x, y)[3]) - want;
        let block = |i: u32| {
            let (x, y) = (i % 16 * 4, i / 16 * 4);
            (0..16).map(|k| at(x + k % 4, y + k / 4)).sum::<f64>() / 16.0
        };
        let single = (0..4096).map(|i| at(i % 64, i / 64).powi(2)).sum::<f64>() / 4096.0;
        let mean = (0..256).map(|i| block(i).powi(2)).sum::<f64>() / 256.0;
        (single.sqrt(), mean.sqrt())
    };
    let ((white, white_mean), (blue, blue_mean)) = (blurred("alpha"), blurred("blue"));
    println!("white {white:.2e}, blurred {white_mean:.2e}; blue {blue:.2e}, blurred {blue_mean:.2e}");
    assert!((blue / white - 1.0).abs() < 0.2, "{blue:e} {white:e}");
    assert!(blue_mean < 0.7 * white_mean, "{blue_mean:e} {white_mean:e}");
}
