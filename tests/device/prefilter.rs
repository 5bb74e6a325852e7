//! `prefilter=mip`: pictures in which a pixel covers many voxels.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use crate::common::*;
use glam::{DMat3, DVec3};
use volraster::GpuScene;
use volraster::Image;
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceImage, ReferenceOptions};
use volraster::scene::{Camera, Field, Grid, Projection, Samples, Scene, TransferFunction, View};
use volraster::technique::Renderer;

/// The techniques that have the option, by each of their routes.
fn prefiltered(gpu: &volraster::Gpu) -> Vec<String> {
    let has_it = |spec: &String| has_option(spec, "prefilter") && !spec.contains("full");
    specs(gpu).into_iter().filter(has_it).collect()
}

/// A small image, inside the cube's front face for an angle of 18 degrees.
fn small(eye: DVec3, fov_y_deg: f64, side: u32) -> View {
    let projection = Projection::Perspective { fov_y_deg };
    View::new(Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection }, side, side).unwrap()
}

/// The truth over a pixel's whole area: 8 x 8 rays.
fn area_truth(scene: &Scene, view: &View) -> ReferenceImage {
    reference::render(scene, view, &ReferenceOptions { samples: 8 }, None).unwrap()
}

/// A grid of values in the standard cube.
fn cube(n: u32, value: impl Fn(u32, u32, u32) -> f32) -> Grid {
    let samples = (0..n * n * n).map(|i| value(i % n, i / n % n, i / n / n)).collect();
    let grid = Grid::new([n, n, n], Samples::F32(samples)).unwrap();
    grid.with_placement(DVec3::splat(2.0 / f64::from(n - 1)), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap()
}

/// Hash of a sample's place, in [0, 1).
fn noise(x: u32, y: u32, z: u32) -> f32 {
    let mut h = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ z.wrapping_mul(0xc2b2_ae3d);
    for shift in [15, 13, 16] {
        h = (h ^ h >> shift).wrapping_mul(0x2c1b_3c6d);
    }
    f32::from(u16::try_from(h >> 16).unwrap()) / 65536.0
}

/// A fine field far away: without mip levels each pixel sees one ray of noise, with them the mean of what it
/// covers. The scalar is averaged before it is classified, which is the same where the transfer function is
/// linear.
#[test]
fn minified_noise_is_averaged() {
    let gpu = gpu();
    let rows = [[0.0, 0.3, 0.6, 1.0, 0.0], [1.0, 0.3, 0.6, 1.0, 1.0]];
    // Streaks along z, so that rays do not average by themselves.
    let grid = cube(96, |x, y, _| if noise(x, y, 7) < 0.5 { 0.0 } else { 1.0 });
    let scene = Scene::new(grid, TransferFunction::from_rows(&rows).unwrap());
    let gpu_scene = GpuScene::new(&gpu, scene.clone());
    let view = small(DVec3::new(0.03, 0.02, 6.0), 18.0, 16);
    let truth = area_truth(&scene, &view);
    for (i, spec) in prefiltered(&gpu).into_iter().enumerate() {
        for filter in taken_from(i, 2, ["hardware", "exact"]) {
            let error = |prefilter: &str| {
                let spec = format!("{spec},step=1,filter={filter},prefilter={prefilter}");
                let image = Renderer::new(&gpu_scene, technique(&spec)).render(&view).unwrap();
                ImageErrors::between_f64(&image, &truth).unwrap()
            };
            let (none, mip) = (error("none"), error("mip"));
            println!("{spec} {filter}: rmse {:.2e} without, {:.2e} with", none.all.rmse, mip.all.rmse);
            assert!(mip.all.rmse < 0.4 * none.all.rmse, "{spec} {filter}: {none} / {mip}");
            assert!(mip.all.bias.abs() < 1e-2, "{spec} {filter}: {mip}");
        }
        // The sampler and single fetches find the same places in every level.
        let image = |filter: &str| {
            let spec = format!("{spec},step=1,filter={filter},prefilter=mip");
            Renderer::new(&gpu_scene, technique(&spec)).render(&view).unwrap()
        };
        let errors = ImageErrors::between(&image("hardware"), &image("exact")).unwrap();
        println!("{spec}: filters differ by {:.1e}", errors.all.max_abs);
        assert!(errors.all.max_abs < 5e-3, "{spec}: {errors}");
    }
}

/// A checkerboard of single samples: its mean is one half, wherever the pixels lie.
#[test]
fn a_minified_checkerboard_keeps_its_mean() {
    let gpu = gpu();
    let rows = [[0.0, 1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0, 1.0]];
    let checker = |x: u32, y: u32, z: u32| if (x + y + z).is_multiple_of(2) { 0.0 } else { 1.0 };
    for n in [64, 63] {
        let scene = Scene::new(cube(n, checker), TransferFunction::from_rows(&rows).unwrap());
        let gpu_scene = GpuScene::new(&gpu, scene.clone());
        let projection = Projection::Orthographic { half_height: 1.6 };
        let camera = Camera { eye: DVec3::Z * 6.0, target: DVec3::ZERO, up: DVec3::Y, projection };
        let view = View::new(camera, 8, 8).unwrap();
        for spec in prefiltered(&gpu) {
            let spec = format!("{spec},step=0.25,prefilter=mip");
            let image = Renderer::new(&gpu_scene, technique(&spec)).render(&view).unwrap();
            // Two units of a mean extinction of one half, in the four pixels in the middle.
            let want = -(-1.0_f64).exp_m1();
            for (x, y) in [(3, 3), (4, 3), (3, 4), (4, 4)] {
                let a = f64::from(image.pixel(x, y)[3]);
                assert!((a - want).abs() < 1e-2, "{spec} {n}: {a} is not {want}");
            }
        }
    }
}

/// Smooth data in 8 x 8 pixels: the mean opacity is that of the supersampled truth, and a camera that drifts by
/// parts of a pixel does not make it sparkle.
#[test]
fn a_far_volume_does_not_sparkle() {
    let gpu = gpu();
    let grid = cube(128, |x, y, z| if noise(x, y, z) < 0.1 { 1.0 } else { 0.0 });
    let rows = [[0.0, 1.0, 0.9, 0.8, 0.0], [1.0, 1.0, 0.9, 0.8, 4.0]];
    let scene = Scene::new(grid, TransferFunction::from_rows(&rows).unwrap());
    let gpu_scene = GpuScene::new(&gpu, scene.clone());
    let mean = |image: &Image| image.pixels().iter().map(|p| f64::from(p[3])).sum::<f64>() / 64.0;
    let views: Vec<View> =
        (0..4).map(|i| small(DVec3::new(0.021 * f64::from(i), 0.013, 5.0), 42.0, 8)).collect();
    let truth = area_truth(&scene, &views[0]);
    let want = truth.pixels().iter().map(|p| p[3]).sum::<f64>() / 64.0;
    for spec in prefiltered(&gpu) {
        let variance = |prefilter: &str| {
            let t = technique(&format!("{spec},step=1,prefilter={prefilter}"));
            let images: Vec<Image> =
                views.iter().map(|view| Renderer::new(&gpu_scene, t).render(view).unwrap()).collect();
            let of_pixel = |i: usize| {
                let values: Vec<f64> = images.iter().map(|image| f64::from(image.pixels()[i][3])).collect();
                let mean = values.iter().sum::<f64>() / 4.0;
                values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 4.0
            };
            // Away from the outline, which sweeps over pixels.
            let inner = [27, 28, 35, 36];
            (inner.iter().map(|&i| of_pixel(i)).sum::<f64>() / 4.0, mean(&images[0]))
        };
        let ((none, _), (mip, alpha)) = (variance("none"), variance("mip"));
        println!(
            "{spec}: variance {none:.1e} without, {mip:.1e} with; mean opacity {alpha:.4}, truth {want:.4}"
        );
        assert!(mip < 0.1 * none, "{spec}: {none:e} / {mip:e}");
        assert!((alpha - want).abs() < 2e-2, "{spec}: {alpha} is not {want}");
    }
}

/// Where a voxel is larger than a pixel the option changes nothing; integers get levels of their own; and a grid
/// with NaN is refused.
#[test]
fn magnified_data_is_not_blurred() {
    let gpu = gpu();
    let view = view(perspective(), 1.0, 96, 80);
    for kind in ["f32", "u8"] {
        let top = if kind == "u8" { 255.0 } else { 1.0 };
        let rows: Vec<[f64; 5]> = FOG.iter().map(|&[s, r, g, b, tau]| [s * top, r, g, b, tau]).collect();
        let gpu_scene = GpuScene::new(&gpu, scene(Field::Blobs, 16, kind, &rows));
        for spec in prefiltered(&gpu) {
            let render = |prefilter: &str| {
                let t = technique(&format!("{spec},step=0.5,prefilter={prefilter}"));
                Renderer::new(&gpu_scene, t).render(&view).unwrap()
            };
            let errors = ImageErrors::between(&render("mip"), &render("none")).unwrap();
            // Coordinates round in another way. Where that turns the rounding of a coarse weight, one sample takes 2 errors of its
            // neighbours' difference more: here far below a tenth of an error in colour.
            let bound = 1e-5 + 0.1 * gpu.filter_error().unwrap();
            assert!(errors.all.max_abs < bound, "{kind} {spec}: {errors}");
        }
    }
    let grid = cube(8, |x, _, _| if x == 3 { f32::NAN } else { 0.5 });
    let scene = Scene::new(grid, TransferFunction::from_rows(&FOG).unwrap());
    let error = Renderer::new(&GpuScene::new(&gpu, scene), technique("slices-3d:prefilter=mip"))
        .render(&view)
        .unwrap_err();
    assert!(error.to_string().contains("NaN") && error.exit_code() == 3, "{error}");
}
