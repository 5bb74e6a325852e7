//! Gaussians of points, of all sizes and from all places, by every order of splats, against their closed form.

use std::f64::consts::{FRAC_PI_2, SQRT_2};

use glam::{DVec2, DVec3};
use volraster::GpuScene;
use volraster::Image;
use volraster::scene::{Camera, KernelSize, Kernels, Points, Projection, Scene, TransferFunction, View};
use volraster::technique::Method;

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Frame, Run, Spec};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("splats", CASES);

/// What points are drawn by: a technique with the options that make it another.
pub type Mode = (Method, &'static [(&'static str, &'static str)]);

/// Integrals along each pixel's own line; opacity is exact in all of them.
pub const EXACT: [Mode; 5] = [
    (Method::SplatEwa, &[("order", "center")]),
    (Method::SplatEwa, &[("order", "pixel")]),
    (Method::SplatEwa, &[("order", "slabs")]),
    (Method::SplatSheets, &[("sheets", "image")]),
    (Method::SplatSheets, &[("sheets", "axis")]),
];

/// Affine ellipses.
pub const ELLIPSES: Mode = (Method::SplatEwa, &[("footprint", "ewa"), ("filter", "none")]);

/// What draws splats whole, in the order of their centres.
const CENTRES: [Mode; 3] = [EXACT[0], EXACT[1], ELLIPSES];

/// A Gaussian: centre, standard deviation, peak of its extinction.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    pub centre: DVec3,
    pub sigma: f64,
    pub tau: f64,
}

impl Ball {
    /// Rounded as points store it.
    pub fn new(centre: DVec3, sigma: f64, tau: f64) -> Self {
        Self { centre, sigma: f64::from((3.0 * sigma) as f32) / 3.0, tau: f64::from(tau as f32) }
    }
}

pub fn points_of(balls: &[Ball]) -> Points {
    Points::new(balls.iter().map(|ball| ball.centre).collect())
        .unwrap()
        .with_size(KernelSize::Radii(balls.iter().map(|ball| (3.0 * ball.sigma) as f32).collect()))
        .unwrap()
        .with_weights(balls.iter().map(|ball| ball.tau as f32).collect())
        .unwrap()
}

pub fn scene_of(balls: &[Ball], cut: f64, transfer: TransferFunction) -> Scene {
    Scene::new(points_of(balls), transfer).with_kernels(Kernels { cut, ..Kernels::of_points() }).unwrap()
}

/// Optical depth of Gaussians that are cut at so many sigmas, along a pixel's ray from the eye.
pub fn depth(balls: &[Ball], view: &View, pixel: DVec2, cut: f64) -> f64 {
    let (origin, direction) = view.ray(pixel);
    let of = |ball: &Ball| {
        let from = ball.centre - origin;
        let u = from.dot(direction);
        let aside = (from - direction * u).length() / ball.sigma;
        if aside >= cut {
            return 0.0;
        }
        let most = ((cut * cut - aside * aside) * 0.5).sqrt();
        let eye = if view.is_perspective() { -u / (ball.sigma * SQRT_2) } else { -most };
        let length = ball.sigma * FRAC_PI_2.sqrt() * (erf(most) - erf(eye.clamp(-most, most)));
        ball.tau * (-0.5 * aside * aside).exp() * length
    };
    balls.iter().map(of).sum()
}

/// Every pixel has the opacity of the closed form, and the one colour.
fn assert_balls(image: &Image, view: &View, balls: &[Ball], cut: f64, bound: f64) -> Result<(), String> {
    let mut worst = (0.0, String::new());
    for (i, pixel) in pixels(view) {
        let [r, g, b, a] = image.pixels()[i].map(f64::from);
        let want = opacity(depth(balls, view, pixel, cut));
        let [red, green, blue] = COLOUR.map(|c| c * want);
        for (got, want) in [(a, want), (r, red), (g, green), (b, blue)] {
            let off = (got - want).abs();
            let off = if off.is_nan() { f64::INFINITY } else { off };
            if off > worst.0 {
                worst = (off, format!("at {pixel}: {got} is not {want}"));
            }
        }
    }
    near(&worst.1, worst.0, 0.0, bound)
}

pub fn spec_of(mode: &Mode) -> Spec {
    Spec { method: mode.0, route: "compute", integrator: "" }
}

/// A scene by each of some modes.
pub fn by(
    run: &mut Run<'_>,
    modes: &[Mode],
    scene: &Scene,
    view: &View,
    options: &[(&str, &str)],
    mut check: impl FnMut(&Mode, &Frame) -> Result<(), String>,
) {
    let on_gpu = GpuScene::new(run.gpu, scene.clone());
    for mode in modes {
        let options = [mode.1, options].concat();
        if let Some(frame) = run.frame(&on_gpu, view, &spec_of(mode), &options)
            && let Err(wrong) = check(mode, &frame)
        {
            run.fail(format!("{} {options:?}: {wrong}", mode.0.name()));
        }
    }
}

/// A dozen Gaussians in the cube, of optical depth about 1 each.
pub fn cloud(unit: f64, place: DVec3) -> Vec<Ball> {
    let mut next = random(11);
    let mut one = |i: u32| {
        let sigma = 0.05 + 0.2 * f64::from(i) / 12.0;
        let centre = 0.8 * DVec3::new(next(), next(), next());
        Ball::new(place + unit * centre, unit * sigma, 0.4 / (sigma * unit))
    };
    (0..12).map(&mut one).collect()
}

/// The cloud from views, by all that is exact.
fn clouds(run: &mut Run<'_>, unit: f64, place: DVec3, views: &[View], bound: f64) {
    let balls = cloud(unit, place);
    let scene = scene_of(&balls, 3.0, fog(1.0));
    for view in views {
        by(run, &EXACT, &scene, view, &[("stop", "0")], |_, frame| {
            finite(&frame.image)?;
            if !frame.image.pixels().iter().any(|p| p[3] > 0.01) {
                return Err(format!("{:?}: nothing to see", view.camera()));
            }
            assert_balls(&frame.image, view, &balls, 3.0, bound)
                .map_err(|wrong| format!("{:?}: {wrong}", view.camera()))
        });
    }
}

/// One Gaussian beside a point of no weight a voxel away: the data's extent is that of both. The image is a strip along
/// the direction off the axis.
fn gaussians(run: &mut Run<'_>, sigma: f64, by_mode: &[Mode]) {
    let cut = 6.0;
    let peak = 0.5;
    let tau = peak / (sigma * (4.0 * FRAC_PI_2).sqrt());
    let ball = Ball::new(DVec3::ZERO, sigma, tau);
    let beside = Ball::new(DVec3::new(0.6, 0.64, 0.48), sigma, 0.0);
    let scene = scene_of(&[ball, beside], cut, fog(1.0));
    let mut settings = Vec::new();
    for rho in [1e-3, 0.03, 0.1] {
        for angle in [0.0_f64, 30.0, 60.0, 80.0] {
            let theta = angle.to_radians();
            let eye = DVec3::new(0.3, -0.4, 0.5).normalize() * (sigma / rho);
            let (to, up) = (-eye.normalize(), eye.cross(DVec3::Y).normalize());
            let ahead = to * theta.cos() + up.cross(to) * theta.sin();
            // No line is flatter than 85 degrees: places on it round as they are far.
            let pixel = (1.3 * theta.tan() / 1024.0).max((rho / (2.0 * theta.cos())).min(11.4 / 1024.0));
            let fov_y_deg = 2.0 * (4.0 * pixel).atan().to_degrees();
            let camera = Camera {
                eye,
                target: eye + ahead * eye.length(),
                up,
                projection: Projection::Perspective { fov_y_deg },
            };
            settings.push((rho, theta, View::new(camera, 2048, 8).unwrap()));
        }
    }
    let views: Vec<View> = settings.iter().map(|(_, _, view)| *view).collect();
    let on_gpu = GpuScene::new(run.gpu, scene);
    for mode in by_mode {
        let options = [mode.1, &[("stop", "0")]].concat();
        let Some(images) = run.views(&on_gpu, &views, &spec_of(mode), &options) else { continue };
        for ((rho, theta, view), image) in settings.iter().zip(&images) {
            let affine = *mode == ELLIPSES;
            // Places round to 2^-24 of the distance, and of the data's extent times the slope of the flattest line; a depth changes by
            // 0.6 of its peak in a sigma, at most.
            let slope = 1024.0 * view.pixel_size();
            let exact = 1e-5_f64.max(6e-8 / rho).max(0.6 * peak * 6e-8 * slope / sigma);
            let bound = if affine { peak * ellipse_bound(*rho, *theta) + 1e-5 } else { exact };
            let (mut worst, mut most, mut at) = (0.0_f64, 0.0_f64, DVec2::ZERO);
            for (i, pixel) in pixels(view) {
                let want = depth(&[ball], view, pixel, cut);
                let got = -(-f64::from(image.pixels()[i][3])).ln_1p();
                let off = if got.is_finite() { (got - want).abs() } else { f64::INFINITY };
                most = most.max(want);
                if off > worst {
                    (worst, at) = (off, pixel);
                }
            }
            println!(
                "13 {:?} sigma {sigma} rho {rho} theta {:.0}: {:.2e} of the peak, bound {:.2e}",
                mode.1,
                theta.to_degrees(),
                worst / peak,
                bound / peak
            );
            let what = format!("{options:?} rho {rho} theta {:.0} deg at {at}", theta.to_degrees());
            if most < 0.5 * peak {
                run.fail(format!("{what}: only {most} is in sight"));
            }
            if let Err(wrong) = near(&what, worst, 0.0, bound) {
                run.fail(wrong);
            }
        }
    }
}

/// What affine ellipses may lose of the peak's optical depth.
fn ellipse_bound(rho: f64, theta: f64) -> f64 {
    1.2 * rho * theta.tan() + 1.1 * rho * rho
}

/// Ten thousand faint Gaussians on one pixel: none is dropped, and all are opaque. Each of some 300 that are near to the end
/// adds a share that rounds to 2^-24.
fn layers(run: &mut Run<'_>) {
    let view = through(1, 1);
    for (count, bound) in [(1000, t32(1000.0)), (10_000, 2e-5)] {
        let mut next = random(3);
        let mut balls: Vec<Ball> =
            (0..count).map(|_| Ball::new(view.camera().target + DVec3::Z * next(), 0.1, 1.0)).collect();
        let one = depth(&balls[..1], &view, DVec2::splat(0.5), 3.0);
        let tau = -(-0.003_f64).ln_1p() / one;
        balls.iter_mut().for_each(|ball| ball.tau = f64::from(tau as f32));
        let scene = scene_of(&balls, 3.0, fog(1.0));
        let want = opacity(depth(&balls, &view, DVec2::splat(0.5), 3.0));
        by(run, &[EXACT.as_slice(), &[ELLIPSES]].concat(), &scene, &view, &[("stop", "0")], |mode, frame| {
            let [r, g, b, a] = frame.image.pixel(0, 0).map(f64::from);
            // The ellipse has no rim where the integral ends early: 3e-3 of the depth.
            let ellipse = if *mode == ELLIPSES {
                3e-3 * depth(&balls, &view, DVec2::splat(0.5), 3.0) * (1.0 - want)
            } else {
                0.0
            };
            near("opacity", a, want, bound + ellipse)?;
            let colours = [r, g, b].into_iter().zip(COLOUR);
            colours.into_iter().try_for_each(|(got, c)| near("colour", got, c * a, t32(count.into())))
        });
    }
}

/// What is behind an opaque splat does not show, to the bit.
fn hidden(run: &mut Run<'_>) {
    let front = Ball::new(DVec3::new(0.0, 0.0, 2.0), 0.3, 1e9);
    let mut balls = cloud(1.0, DVec3::NEG_Z);
    balls.push(front);
    let rows = transfer(&[[0.0, 0.1, 0.9, 0.4, 1.0], [0.5, 0.9, 0.1, 0.2, 1.0], [1.0, 0.3, 0.6, 0.9, 1.0]]);
    let scalars = |k: f32| (0..13).map(|i| if i == 12 { 1.0 } else { k * i as f32 / 12.0 }).collect();
    let [a, b] = [1.0, 0.2].map(|k| {
        GpuScene::new(run.gpu, Scene::new(points_of(&balls).with_scalars(scalars(k)).unwrap(), rows.clone()))
    });
    let view = through(5, 5);
    for mode in EXACT.iter().chain([&ELLIPSES]) {
        for stop in ["0", "0.001"] {
            let options = [mode.1, &[("stop", stop)]].concat();
            let [a, b] = [&a, &b].map(|scene| run.frame(scene, &view, &spec_of(mode), &options));
            let (Some(a), Some(b)) = (a, b) else { continue };
            let opaque = a.image.pixels().iter().all(|p| p[3] == 1.0);
            run.check(opaque, || format!("{options:?}: opacity {}", a.image.pixel(2, 2)[3]));
            run.check(a.image == b.image, || format!("{options:?}: off by {:e}", apart(&a.image, &b.image)));
        }
    }
}

/// A line that ends early is off by no more than what it says. Where each pixel has its own order, an opaque one waits for all that may come
/// before: far behind the first balls is a cloud.
fn early(run: &mut Run<'_>) {
    // Tiles end as a whole: each lies within the balls.
    let view = view(Projection::Orthographic { half_height: 0.2 }, 1.0, 24, 24);
    // Of optical depth 1.5 each: a share of 1e-4 is left of what is behind them.
    let wide = |k: i32| Ball::new(0.1 * f64::from(k) * view.forward(), 0.5, 0.6 / 0.5);
    let mut balls: Vec<Ball> = (0..6).map(wide).collect();
    let behind = cloud(1.0, 8.0 * view.forward());
    balls.extend(behind.into_iter().map(|ball| Ball { tau: 100.0 * ball.tau, ..ball }));
    let rows = transfer(&[[0.0, 0.1, 0.9, 0.4, 1.0], [1.0, 0.3, 0.6, 0.9, 1.0]]);
    let points = points_of(&balls).with_scalars((0..18).map(|i| i as f32 / 18.0).collect()).unwrap();
    let scene = GpuScene::new(run.gpu, Scene::new(points, rows));
    for mode in EXACT.iter().chain([&ELLIPSES]) {
        let Some(whole) = run.frame(&scene, &view, &spec_of(mode), &[mode.1, &[("stop", "0")]].concat())
        else {
            continue;
        };
        let mut ends = 0.0_f64;
        for stop in [1e-2, 1e-3, 1e-4] {
            let text = stop.to_string();
            let Some(early) =
                run.frame(&scene, &view, &spec_of(mode), &[mode.1, &[("stop", &text)]].concat())
            else {
                continue;
            };
            let off = apart(&early.image, &whole.image);
            ends = ends.max(off);
            run.check(off <= stop + 2e-6, || format!("{mode:?}: off by {off:e} at {stop}"));
        }
        run.check(ends > 0.0, || format!("{mode:?} ends nothing"));
    }
}

/// Half-opaque splats at distances of five decades, each three times as far as the one before, of colours of their own.
/// Their order is that of float32's keys: those of the nearest are some units of rounding of the farthest apart.
fn keys(run: &mut Run<'_>) {
    let count = 10;
    let colour = |i: usize| [i as f64 / 9.0, 1.0 - i as f64 / 9.0, f64::from(u8::from(i.is_multiple_of(2)))];
    let rows: Vec<[f64; 5]> = (0..count)
        .map(|i| {
            let [r, g, b] = colour(i);
            [i as f64, r, g, b, 1.0]
        })
        .collect();
    for unit in [1e-9, 1.0, 1e9] {
        let far = |i: usize| unit * 10.0_f64.powf(i as f64 * 0.5 - 2.0);
        let half = |sigma: f64| 2.0_f64.ln() / (sigma * (4.0 * FRAC_PI_2).sqrt() * erf(3.0 / SQRT_2));
        // Nearest last: the input has them in reverse.
        let balls: Vec<Ball> = (0..count)
            .rev()
            .map(|i| {
                let sigma = far(i) * 0.06;
                Ball::new(DVec3::NEG_Z * far(i), sigma, half(sigma))
            })
            .collect();
        let points = points_of(&balls).with_scalars((0..count).rev().map(|i| i as f32).collect()).unwrap();
        let scene = Scene::new(points, transfer(&rows));
        let view = look(DVec3::ZERO, DVec3::NEG_Z * unit, DVec3::Y, 0.01, 1);
        let mut want = [0.0; 3];
        for i in 0..count {
            let share = (-f64::from(i as u32 + 1)).exp2();
            for (want, c) in want.iter_mut().zip(colour(i)) {
                *want += share * c;
            }
        }
        by(run, &CENTRES, &scene, &view, &[("stop", "0")], |_, frame| {
            let got = frame.image.pixel(0, 0).map(f64::from);
            // The ellipse has no rim, 0.3 % of the depth; the nearest is 0.006 units of size at a place of 2^-24 of 1000.
            let bound = 4e-3;
            got.into_iter()
                .zip(want)
                .try_for_each(|(got, want)| near(&format!("colour, unit {unit:e}"), got, want, bound))
        });
    }
}

fn eye_views(eyes: &[DVec3], fov: f64, side: u32) -> Vec<View> {
    let ahead = DVec3::new(-0.3, 0.2, -1.0);
    eyes.iter().map(|&eye| look(eye, eye + ahead, DVec3::Y, fov, side)).collect()
}

fn narrow_view(distance: f64, half: f64, place: DVec3, side: u32) -> View {
    let eye = place + DVec3::new(0.31, 0.22, 0.92).normalize() * distance;
    look(eye, place, DVec3::Y, 2.0 * (half / distance).atan().to_degrees(), side)
}

const CASES: &[Case] = &[
    Case {
        number: "13a",
        name: "a Gaussian of 0.01, 1 and 1000 voxels, 0 to 80 degrees off the axis",
        expect: "closed form",
        tolerance: "1e-5, 6e-8 distance / sigma, 1.8e-8 slope extent / sigma",
        run: |run| [0.01, 1.0, 1e3].into_iter().for_each(|sigma| gaussians(run, sigma, &EXACT)),
    },
    Case {
        number: "13b",
        name: "the same as an affine ellipse",
        expect: "closed form",
        tolerance: "1.2 rho tan(theta) + 1.1 rho² of the peak",
        run: |run| gaussians(run, 1.0, &[ELLIPSES]),
    },
    Case {
        number: "31",
        name: "1,000 and 10,000 splats of opacity 0.003 on one pixel",
        expect: "0.9504; 1",
        tolerance: "t32(1000); 2e-5",
        run: layers,
    },
    Case {
        number: "32b",
        name: "the first splat is opaque",
        expect: "what lies behind has no effect",
        tolerance: "exact",
        run: hidden,
    },
    Case {
        number: "33d",
        name: "rays through splats that end at 1e-2, 1e-3, 1e-4",
        expect: "off by that at most",
        tolerance: "2e-6",
        run: early,
    },
    Case {
        number: "35e",
        name: "splats from 1e3, 1e6 and 1e9 sizes away",
        expect: "closed form",
        tolerance: "1e-5",
        run: |run| {
            let views = [1e3, 1e6, 1e9].map(|distance| narrow_view(distance, 1.5, DVec3::ZERO, 20));
            clouds(run, 1.0, DVec3::ZERO, &views, 1e-5);
        },
    },
    Case {
        number: "37d",
        name: "splats under angles of view of 1e-3 and 179 degrees",
        expect: "closed form",
        tolerance: "1e-5; 5e-5",
        run: |run| {
            let ball = cloud(1.0, DVec3::ZERO)[5];
            let narrow = look(DVec3::new(2.0, 1.5, 3.8), ball.centre, DVec3::Y, 1e-3, 9);
            clouds(run, 1.0, DVec3::ZERO, &[narrow], 1e-5);
            let eyes = [DVec3::new(0.2, -0.1, 0.35), DVec3::new(0.3, 0.2, 1.3)];
            clouds(run, 1.0, DVec3::ZERO, &eye_views(&eyes, 179.0, 17), 5e-5);
        },
    },
    Case {
        number: "38b",
        name: "splats at distances of 1e-2 to 300, in units of 1e-9, 1 and 1e9",
        expect: "in order",
        tolerance: "4e-3",
        run: keys,
    },
    Case {
        number: "39i",
        name: "eye at a splat's centre, in several splats, at the edge of one",
        expect: "closed form",
        tolerance: "1e-5",
        run: |run| {
            let balls = cloud(1.0, DVec3::ZERO);
            let edge = balls[3].centre + DVec3::Z * 3.0 * balls[3].sigma;
            let eyes = [balls[0].centre, balls[11].centre, DVec3::ZERO, edge];
            clouds(run, 1.0, DVec3::ZERO, &eye_views(&eyes, 70.0, 20), 1e-5);
        },
    },
    Case {
        number: "5.7",
        name: "splats in units of 1e-20, 1e-9, 1e9 and 1e20, and 1e6 sizes from the origin",
        expect: "closed form",
        tolerance: "1e-5",
        run: |run| {
            for unit in [1e-20, 1e-9, 1e9, 1e20] {
                clouds(run, unit, DVec3::ZERO, &[narrow_view(4.0 * unit, 1.5 * unit, DVec3::ZERO, 20)], 1e-5);
            }
            let place = DVec3::new(1e6, -2e6, 5e5);
            clouds(run, 1.0, place, &[narrow_view(4.0, 1.5, place, 20)], 1e-5);
        },
    },
];
