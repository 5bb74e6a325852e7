//! Splats against closed forms and the float64 reference of the same kernels.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of test images")]

mod common;

use common::*;
use glam::{DVec2, DVec3};
use volraster::scene::{
    Camera, Field, Grid, Kernel, KernelSize, Kernels, Model, Points, Projection, Samples, Scene,
    TransferFunction, View,
};

fn erf(x: f64) -> f64 {
    // Its series, for the arguments of these tests.
    let (mut sum, mut term) = (0.0, x);
    for k in 0..200 {
        sum += term / f64::from(2 * k + 1);
        term *= -x * x / f64::from(k + 1);
    }
    sum * 2.0 / std::f64::consts::PI.sqrt()
}

/// Optical depth along a ray of a Gaussian of peak `tau` that is cut at `cut` sigmas.
fn gaussian(view: &View, pixel: DVec2, centre: DVec3, sigma: f64, cut: f64, tau: f64) -> f64 {
    let (origin, direction) = view.ray(pixel);
    let from = centre - origin;
    let aside = (from - direction * from.dot(direction)).length() / sigma;
    if aside >= cut {
        return 0.0;
    }
    let most = ((cut * cut - aside * aside) * 0.5).sqrt();
    tau * sigma * std::f64::consts::TAU.sqrt() * (-0.5 * aside * aside).exp() * erf(most)
}

fn constant(tau: f64) -> TransferFunction {
    TransferFunction::from_rows(&[[0.0, 0.8, 0.4, 0.1, tau]]).unwrap()
}

#[test]
fn single_gaussians_are_their_closed_form() {
    let gpu = gpu();
    for sigma in [0.02, 0.2] {
        for (distance, projection) in [
            (1.0, perspective()),
            (1.0, orthographic()),
            (100.0, Projection::Perspective { fov_y_deg: 0.5 }),
            (1e4, Projection::Perspective { fov_y_deg: 0.005 }),
        ] {
            for aside in [0.0, 0.7] {
                let centre = DVec3::new(0.3, aside, -0.2);
                let points = Points::new(vec![centre]).unwrap();
                let points = points.with_size(KernelSize::Radius(3.0 * sigma)).unwrap();
                let scene = Scene::new(points, constant(2.0 / sigma));
                let view = view(projection, distance, 48, 32);
                for spec in ["order=center,stop=0", "order=window,stop=0", "order=slabs,step=0.7,stop=0"] {
                    let image = draw(&gpu, &scene, &view, &format!("splat-ewa:{spec}"));
                    let mut worst = 0.0_f64;
                    for y in 0..32 {
                        for x in 0..48 {
                            let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                            let alpha = -(-gaussian(&view, pixel, centre, sigma, 3.0, 2.0 / sigma)).exp_m1();
                            worst = worst.max((f64::from(image.pixel(x, y)[3]) - alpha).abs());
                        }
                    }
                    println!("{sigma} {distance} {aside} {spec}: {worst:e}");
                    let length = DVec3::new(2.0, 1.5, 3.8).length() * distance;
                    assert!(worst < 1e-5_f64.max(6e-8 * length / sigma));
                }
            }
        }
    }
}

#[test]
fn a_homogeneous_box_is_exact_in_sheets() {
    let gpu = gpu();
    let scene = scene(Field::Homogeneous(1.0), 12, "f32", &[[0.0, 0.8, 0.4, 0.1, 1.5]]);
    for view in [
        view(perspective(), 1.0, 64, 48),
        view(orthographic(), 1.0, 64, 48),
        view(perspective(), 0.1, 64, 48),
    ] {
        for spec in [
            "sheets=image",
            "sheets=image,kernel=gaussian",
            "sheets=axis",
            "sheets=axis,kernel=gaussian,step=2",
        ] {
            let image = draw(&gpu, &scene, &view, &format!("splat-sheets:stop=0,{spec}"));
            let mut worst = 0.0_f64;
            for y in 0..48 {
                for x in 0..64 {
                    let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                    if on_outline(&view, pixel) {
                        continue;
                    }
                    let alpha = -(-1.5 * chord(&view, pixel)).exp_m1();
                    worst = worst.max((f64::from(image.pixel(x, y)[3]) - alpha).abs());
                }
            }
            println!("{spec}: {worst:e}");
        }
    }
}
