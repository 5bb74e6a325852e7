//! Sums of kernels against closed forms, and against an integrator that adds up all kernels at each place,
//! without events on the ray.

use super::*;
use crate::scene::{Kernel, KernelSize, Kernels, Model, Points, TetScalars, Tets};
use rayon::prelude::*;

/// Required accuracy of comparisons with closed forms.
const CLOSED: f64 = 1e-10;

/// Colours and extinctions that are linear over the range of the scalars.
const RAMP: [[f64; 5]; 2] = [[0.0, 0.9, 0.1, 0.3, 0.2], [1.0, 0.1, 0.8, 0.5, 3.0]];

fn points_scene(points: Points, rows: &[[f64; 5]], kernels: Option<Kernels>) -> Scene {
    let scene = Scene::new(points, TransferFunction::from_rows(rows).unwrap());
    kernels.map_or(scene.clone(), |kernels| scene.with_kernels(kernels).unwrap())
}

fn one_point(size: KernelSize, rows: &[[f64; 5]], kernels: Option<Kernels>) -> Scene {
    points_scene(Points::new(vec![DVec3::ZERO]).unwrap().with_size(size).unwrap(), rows, kernels)
}

/// The error function by its series of positive terms.
fn erf(x: f64) -> f64 {
    let (mut term, mut sum) = (x, x);
    for n in 1..200 {
        term *= 2.0 * x * x / f64::from(2 * n + 1);
        sum += term;
    }
    sum * 2.0 / std::f64::consts::PI.sqrt() * (-x * x).exp()
}

/// A cubic B-spline by its definition as a sum of truncated powers.
fn spline(x: f64) -> f64 {
    [1.0, -4.0, 6.0, -4.0, 1.0]
        .iter()
        .zip(-2..)
        .map(|(c, k)| c * (x - f64::from(k)).max(0.0).powi(3))
        .sum::<f64>()
        / 6.0
}

/// One kernel of a point, with peak 1, at a world distance.
fn peak_one(kernel: Kernel, cut: f64, radius: f64, distance: f64) -> f64 {
    match kernel {
        Kernel::Gaussian if 3.0 * distance <= cut * radius => (-4.5 * (distance / radius).powi(2)).exp(),
        Kernel::BSpline => 1.5 * spline((2.0 * distance / radius).min(2.0)),
        _ => 0.0,
    }
}

/// One kernel of a grid.
fn on_grid(kernels: &Kernels, offset: DVec3) -> f64 {
    let product = |f: &dyn Fn(f64) -> f64| offset.to_array().into_iter().map(f).product::<f64>();
    let pi = std::f64::consts::PI;
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (pi * x).sin() / (pi * x) };
    match kernels.kernel {
        Kernel::Gaussian => {
            let square = offset.length_squared() / kernels.sigma.powi(2);
            // Unit mass after the cut.
            let mass = erf(kernels.cut / 2.0_f64.sqrt())
                - (2.0 / pi).sqrt() * kernels.cut * (-0.5 * kernels.cut.powi(2)).exp();
            let all = (2.0 * pi * kernels.sigma.powi(2)).powf(-1.5) * (-0.5 * square).exp() / mass;
            if square <= kernels.cut.powi(2) { all } else { 0.0 }
        }
        Kernel::BSpline => product(&|x| spline(x.clamp(-2.0, 2.0))),
        Kernel::Tent => product(&|x| (1.0 - x.abs()).max(0.0)),
        Kernel::Sinc => product(&|x| if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 }),
    }
}

/// Colour and extinction of a model from kernels, each given as value, weight and scalar.
fn of_sum(
    all: impl Iterator<Item = (f64, f64, f64)>,
    transfer: &TransferFunction,
    kernels: &Kernels,
) -> (DVec3, f64) {
    let (mut weight, mut scalar, mut extinction, mut emission) = (0.0, 0.0, 0.0, DVec3::ZERO);
    for (k, w, s) in all {
        weight += w * k;
        scalar += w * k * s;
        let (colour, tau) = transfer.at(s);
        extinction += w.max(0.0) * k * tau;
        emission += colour * (w.max(0.0) * k * tau);
    }
    match kernels.model {
        Model::Interpolate if weight >= kernels.least => transfer.at(scalar / weight),
        Model::Density if extinction > 0.0 => (emission / extinction, extinction),
        _ => (DVec3::ZERO, 0.0),
    }
}

fn random_points(count: usize, seed: u64, weights: bool) -> Points {
    let mut random = Random(seed);
    let centres =
        (0..count).map(|_| random.in_box(DVec3::splat(-0.7), DVec3::splat(0.7))).collect::<Vec<_>>();
    let mut list = |low: f64, high: f64| -> Vec<f32> {
        (0..count).map(|_| num::f32_of(low + (high - low) * random.next())).collect()
    };
    let (scalars, radii, w) = (list(0.0, 1.0), list(0.2, 0.8), list(0.1, 1.5));
    let points = Points::new(centres).unwrap().with_scalars(scalars).unwrap();
    let points = points.with_size(KernelSize::Radii(radii)).unwrap();
    if weights { points.with_weights(w).unwrap() } else { points }
}

// ---- closed forms ------------------------------------------------------------------------------------

/// Depth `w tau sqrt(2 pi) sigma exp(-b² / 2 sigma²) erf(h / sqrt(2) sigma)` along a chord of half-length h.
#[test]
fn one_gaussian_from_anywhere() {
    let mut random = Random(3);
    for cut in [0.5, 3.0, 6.0] {
        for distance in [0.0, 5.0, 1e4] {
            for _ in 0..20 {
                let (radius, tau) = (0.1 + 2.0 * random.next(), 10.0 * random.next());
                let rows = [[0.0, 0.8, 0.4, 0.1, tau]];
                let kernels = Kernels { cut, ..Kernels::of_points() };
                let scene = one_point(KernelSize::Radius(radius), &rows, Some(kernels));
                let d = random.in_box(DVec3::NEG_ONE, DVec3::ONE).normalize();
                let b = random.next() * 1.1 * cut * radius / 3.0;
                let origin = d.any_orthonormal_vector() * b - d * distance;
                let sigma = radius / 3.0;
                let half = (cut * cut * sigma * sigma - b * b).max(0.0).sqrt();
                let whole = tau * (2.0 * std::f64::consts::PI).sqrt() * sigma;
                let part = |t: f64| {
                    let u = (t - distance).clamp(-half, half);
                    0.5 * whole * (-0.5 * b * b / sigma / sigma).exp() * erf(u / sigma / 2.0_f64.sqrt())
                };
                let bound = CLOSED + 1e-15 * distance;
                let all = part(f64::MAX) - part(f64::MIN);
                same(everywhere(&scene, origin, d), uniform([0.8, 0.4, 0.1], all), bound);
                let ahead = ray(&scene, origin, d, [0.0, f64::INFINITY]).unwrap();
                same(ahead, uniform([0.8, 0.4, 0.1], part(f64::MAX) - part(0.0)), bound);
            }
        }
    }
}

/// The same with the distance of a covariance: `sqrt(2 pi / A) exp(-b² / 2)` with A = d · P d.
#[test]
fn one_ellipsoid_from_anywhere() {
    let covariance = [0.5_f32, 0.2, -0.1, 0.3, 0.05, 0.25];
    let [xx, xy, xz, yy, yz, zz] = covariance.map(f64::from);
    let inverse =
        DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz)).inverse();
    let mut random = Random(4);
    for cut in [2.0, 3.0, 6.0] {
        let kernels = Kernels { cut, ..Kernels::of_points() };
        let scene =
            one_point(KernelSize::Covariances(vec![covariance]), &[[0.0, 0.8, 0.4, 0.1, 2.0]], Some(kernels));
        let mut shown = 0;
        for _ in 0..60 {
            let d = random.in_box(DVec3::NEG_ONE, DVec3::ONE).normalize();
            let o = random.in_box(DVec3::splat(-2.0), DVec3::splat(2.0));
            let a = d.dot(inverse * d);
            let middle = -d.dot(inverse * o) / a;
            let near = o + d * middle;
            let square = near.dot(inverse * near);
            let half = (cut * cut - square).max(0.0).sqrt();
            let depth = 2.0 * (2.0 * std::f64::consts::PI / a).sqrt() * (-0.5 * square).exp();
            shown += i32::from(half > 0.0);
            let depth = depth * erf(half / 2.0_f64.sqrt());
            same(everywhere(&scene, o, d), uniform([0.8, 0.4, 0.1], depth), CLOSED);
        }
        assert!(shown > 10);
    }
}

/// Through the centre a radial B-spline has the depth 3/4 radius; its parts are those of the spline.
#[test]
fn one_spline_through_its_centre() {
    let kernels = Kernels { kernel: Kernel::BSpline, ..Kernels::of_points() };
    let scene = one_point(KernelSize::Radius(1.6), &[[0.0, 0.8, 0.4, 0.1, 2.5]], Some(kernels));
    let d = DVec3::new(1.0, -2.0, 0.5);
    same(everywhere(&scene, d, d), uniform([0.8, 0.4, 0.1], 2.5 * 0.75 * 1.6), CLOSED);
    // From the inner knot on: 1/24 of the spline's unit mass.
    let outer = ray(&scene, DVec3::ZERO, d, [0.8, f64::INFINITY]).unwrap();
    same(outer, uniform([0.8, 0.4, 0.1], 2.5 * 0.75 * 1.6 / 24.0), CLOSED);
}

#[test]
fn layers_far_apart_cover_each_other() {
    let centres = vec![DVec3::Z * 10.0, DVec3::ZERO];
    let points = Points::new(centres).unwrap().with_scalars(vec![0.0, 1.0]).unwrap();
    let points = points.with_weights(vec![0.5, 2.0]).unwrap().with_size(KernelSize::Radius(3.0)).unwrap();
    let scene = points_scene(points, &[[0.0, 1.0, 0.0, 0.2, 0.8], [1.0, 0.0, 1.0, 0.6, 1.1]], None);
    let mass = (2.0 * std::f64::consts::PI).sqrt() * erf(3.0 / 2.0_f64.sqrt());
    let (far, near) = (uniform([1.0, 0.0, 0.2], 0.4 * mass), uniform([0.0, 1.0, 0.6], 2.2 * mass));
    let over =
        |front: [f64; 4], back: [f64; 4]| std::array::from_fn(|i| front[i] + (1.0 - front[3]) * back[i]);
    same(everywhere(&scene, DVec3::Z * -20.0, DVec3::Z), over(near, far), CLOSED);
    same(everywhere(&scene, DVec3::Z * 20.0, -DVec3::Z), over(far, near), CLOSED);
}

/// If any step is opaque, the colour is that of the front.
#[test]
fn extreme_extinctions_end_the_ray() {
    for tau in [1e6, 1e30, 1e300] {
        let scene = one_point(KernelSize::Radius(1.0), &[[0.0, 0.8, 0.4, 0.1, tau]], None);
        same(everywhere(&scene, DVec3::ZERO, DVec3::ONE), uniform([0.8, 0.4, 0.1], 1e3), 1e-9);
    }
    for radius in [1e-40, 1e-12, 1e12, 1e40] {
        let scene = one_point(KernelSize::Radius(radius), &[[0.0, 0.8, 0.4, 0.1, 1.0 / radius]], None);
        let depth = (2.0 * std::f64::consts::PI).sqrt() / 3.0 * erf(3.0 / 2.0_f64.sqrt());
        same(everywhere(&scene, DVec3::ZERO, DVec3::ONE), uniform([0.8, 0.4, 0.1], depth), CLOSED);
    }
}

/// One sample of a grid: tent and spline have unit mass along an axis, the Gaussian is isotropic in index
/// space.
#[test]
fn one_voxel_on_a_stretched_grid() {
    let spacing = DVec3::new(0.5, 1.0, 3.0);
    let lattice = grid([7, 7, 7], |x, y, z| f32::from([x, y, z] == [3, 3, 3]));
    let lattice = lattice.with_placement(spacing, DVec3::ZERO, DMat3::IDENTITY).unwrap();
    let base = scene(lattice, &[[0.0, 0.8, 0.4, 0.1, 0.0], [1.0, 0.8, 0.4, 0.1, 2.0]]);
    let centre = spacing * 3.0;
    let gauss = Kernels { sigma: 0.8, cut: 2.5, ..Kernels::of_points() };
    for axis in 0..3 {
        let d = DVec3::AXES[axis];
        let tau = 2.0 * spacing[axis];
        for (kernel, depth) in [
            (Kernel::Tent, tau),
            (Kernel::BSpline, tau * 4.0 / 9.0),
            (
                Kernel::Gaussian,
                tau * erf(2.5 / 2.0_f64.sqrt())
                    / (2.0 * std::f64::consts::PI * 0.64)
                    / 0.899_939_166_880_604_9,
            ),
        ] {
            let one = base.clone().with_kernels(Kernels { kernel, ..gauss }).unwrap();
            same(everywhere(&one, centre + d * 50.0, -d), uniform([0.8, 0.4, 0.1], depth), CLOSED);
        }
    }
}

/// With any kernel a constant field is a box, because sums are divided by their weights.
#[test]
fn homogeneous_grids_are_boxes() {
    let mut random = Random(8);
    let samples = grid([5, 4, 6], |_, _, _| 0.5);
    let placed = samples
        .with_placement(DVec3::new(0.5, 0.7, 0.4), DVec3::new(-1.0, -1.05, -1.0), DMat3::IDENTITY)
        .unwrap();
    let (low, high) = (placed.origin(), placed.origin() + placed.last_index() * placed.spacing());
    let base = scene(placed, &[[0.0, 0.8, 0.4, 0.1, 0.0], [1.0, 0.8, 0.4, 0.1, 3.0]]);
    for (_, kernel) in Kernel::ALL {
        let scene = base.clone().with_kernels(Kernels { kernel, ..Kernels::of_samples() }).unwrap();
        for _ in 0..20 {
            let (o, d, _) = chord(&mut random);
            let (a, b) = ((low - o) / d, (high - o) / d);
            let length = a.max(b).min_element() - a.min(b).max_element();
            same(everywhere(&scene, o, d), uniform([0.8, 0.4, 0.1], 1.5 * length.max(0.0)), CLOSED);
        }
    }
}

// ---- other integrators -------------------------------------------------------------------------------

/// The tent kernel gives the trilinear field.
#[test]
fn tents_are_trilinear() {
    let mut random = Random(11);
    let base = marschner_lobb(12);
    let tents = base.clone().with_kernels(Kernels { kernel: Kernel::Tent, ..Kernels::of_samples() }).unwrap();
    let mut worst = 0.0_f64;
    for _ in 0..60 {
        let (o, d, _) = chord(&mut random);
        worst = worst.max(difference(everywhere(&base, o, d), everywhere(&tents, o, d)));
    }
    // In planes of samples and along their edges.
    let places = [DVec3::new(-1.0, 0.3, 0.2), DVec3::new(-1.0, -1.0, 0.1), DVec3::ZERO];
    for o in places {
        for d in [DVec3::Z, DVec3::Y, DVec3::new(0.0, 1.0, 1.0)] {
            worst = worst.max(difference(everywhere(&base, o, d), everywhere(&tents, o, d)));
        }
    }
    println!("tents: {worst:e}");
    assert!(worst < 1e-10, "{worst:e}");
}

#[test]
fn random_points_equal_an_adaptive_integrator() {
    let mut random = Random(21);
    let transfer = TransferFunction::from_rows(&RAMP).unwrap();
    for kernel in [Kernel::Gaussian, Kernel::BSpline] {
        for model in [Model::Density, Model::Interpolate] {
            for cut in [2.0, 3.0].into_iter().take(if crate::exhaustive() { 2 } else { 1 }) {
                let kernels = Kernels { kernel, model, cut, ..Kernels::of_points() };
                let points = random_points(25, 5, true);
                let scene = points_scene(points.clone(), &RAMP, Some(kernels));
                let KernelSize::Radii(radii) = points.size() else { panic!() };
                let (scalars, weights) = (points.scalars().unwrap(), points.weights().unwrap());
                let medium = |p: DVec3| {
                    let all = points.centres().iter().enumerate().map(|(i, c)| {
                        let k = peak_one(kernel, cut, f64::from(radii[i]), c.distance(p));
                        (k, f64::from(weights[i]), f64::from(scalars[i]))
                    });
                    of_sum(all, &transfer, &kernels)
                };
                let mut worst = 0.0_f64;
                for _ in 0..6 {
                    let (o, d, range) = chord(&mut random);
                    let got = ray(&scene, o, d, range).unwrap();
                    assert!(got[3] > 0.01, "{got:?}");
                    worst = worst.max(difference(got, adaptive_in(&medium, o, d, range)));
                }
                println!("{kernel:?} {model:?} cut {cut}: {worst:e}");
                assert!(worst < EXACT, "{kernel:?} {model:?} cut {cut}: {worst:e}");
            }
        }
    }
}

/// Coefficients of splines by Richardson's iteration on the sum itself, at all samples at once.
fn coefficients(dims: [u32; 3], samples: &[f64], kernels: &Kernels) -> Vec<f64> {
    let places: Vec<DVec3> = (0..samples.len())
        .map(|i| {
            let i = num::count(i);
            DVec3::new(
                f64::from(i % dims[0]),
                f64::from(i / dims[0] % dims[1]),
                f64::from(i / dims[0] / dims[1]),
            )
        })
        .collect();
    let rows: Vec<Vec<(usize, f64)>> = places
        .iter()
        .map(|p| {
            let all = places.iter().map(|q| on_grid(kernels, *p - *q)).enumerate().filter(|(_, w)| *w > 0.0);
            let row: Vec<(usize, f64)> = all.collect();
            let sum: f64 = row.iter().map(|(_, w)| w).sum();
            row.into_iter().map(|(i, w)| (i, w / sum)).collect()
        })
        .collect();
    let mut c = samples.to_vec();
    for _ in 0..1500 {
        let sums: Vec<f64> = rows.iter().map(|row| row.iter().map(|(i, w)| w * c[*i]).sum()).collect();
        for ((c, sum), sample) in c.iter_mut().zip(sums).zip(samples) {
            *c += sample - sum;
        }
    }
    c
}

#[test]
fn random_grids_equal_an_adaptive_integrator() {
    let dims = [4, 3, 5];
    let mut random = Random(31);
    let samples: Vec<f32> = (0..60).map(|_| num::f32_of(random.next())).collect();
    let axes =
        DMat3::from_cols(DVec3::new(0.5, 0.1, 0.0), DVec3::new(-0.1, 0.6, 0.1), DVec3::new(0.05, 0.0, -0.4));
    let placed = Grid::new(dims, Samples::F32(samples.clone()))
        .unwrap()
        .with_placement(DVec3::ONE, DVec3::new(-0.8, -0.6, 0.7), axes)
        .unwrap();
    let (to_index, origin) = (axes.inverse(), placed.origin());
    let base = scene(placed, &RAMP);
    for (_, kernel) in Kernel::ALL.into_iter().step_by(if crate::exhaustive() { 1 } else { 5 }) {
        for model in [Model::Density, Model::Interpolate] {
            let kernels = Kernels { kernel, model, cut: 2.6, ..Kernels::of_samples() };
            let Ok(scene) = base.clone().with_kernels(kernels) else { continue };
            let mut values: Vec<f64> = samples.iter().map(|&s| f64::from(s)).collect();
            if kernel == Kernel::BSpline && model == Model::Interpolate {
                values = coefficients(dims, &values, &kernels);
            }
            let medium = |p: DVec3| {
                let at = to_index * (p - origin);
                let inside = at.cmpge(DVec3::ZERO).all() && at.cmple(DVec3::new(3.0, 2.0, 4.0)).all();
                if model == Model::Interpolate && !inside {
                    return (DVec3::ZERO, 0.0);
                }
                let all = values.iter().enumerate().map(|(i, &s)| {
                    let i = num::count(i);
                    let sample = DVec3::new(f64::from(i % 4), f64::from(i / 4 % 3), f64::from(i / 12));
                    (on_grid(&kernels, at - sample), 1.0, s)
                });
                of_sum(all, &base.transfer, &kernels)
            };
            let chords: Vec<_> = (0..2).map(|_| chord(&mut random)).collect();
            let differences = chords.into_par_iter().map(|(o, d, range)| {
                let got = ray(&scene, o, d, range).unwrap();
                assert!(got[3] > 0.01, "{got:?}");
                difference(got, adaptive_in(&medium, o, d, range))
            });
            let worst = differences.reduce(|| 0.0, f64::max);
            println!("{kernel:?} {model:?}: {worst:e}");
            assert!(worst < EXACT, "{kernel:?} {model:?}: {worst:e}");
        }
    }
}

/// Splines of a linear field are linear inside. At the ends the sum is divided by the remaining weights; the
/// coefficients that compensate for this decay by 2 - sqrt(3) from sample to sample.
#[test]
fn splines_of_a_linear_field() {
    let n = 41_u32;
    let field = grid([n, 3, 3], |x, _, _| num::f32_of(f64::from(x)));
    let kernels = Kernels { kernel: Kernel::BSpline, ..Kernels::of_samples() };
    let scene = scene(field, &[[0.0, 1.0, 1.0, 1.0, 0.0], [40.0, 1.0, 1.0, 1.0, 0.04]]);
    let scene = scene.with_kernels(kernels).unwrap();
    // Mean of the scalar between two places.
    let mean = |from: f64, to: f64| {
        let pixel = ray(&scene, DVec3::new(0.0, 0.8, 1.3), DVec3::X, [from, to]).unwrap();
        -(-pixel[3]).ln_1p() / (to - from) * 1000.0
    };
    for i in 0..40 {
        let place = f64::from(i) + 0.3;
        let error = mean(place, place + 0.5) - (place + 0.25);
        let decay = (2.0 - 3.0_f64.sqrt()).powi(i.min(39 - i));
        assert!(error.abs() < 0.2 * decay + 1e-10, "{place}: {error:e}");
        assert!(error.abs() > 1e-3 * decay, "{place}: {error:e}");
    }
}

/// Where the transfer function has a narrow peak, cubics of the stated error still find it.
#[test]
fn narrow_peaks_of_a_smooth_field() {
    let rows = [
        [0.0, 0.1, 0.2, 0.6, 0.0],
        [0.499, 0.9, 0.4, 0.1, 0.0],
        [0.5, 1.0, 0.8, 0.3, 50.0],
        [0.501, 0.2, 0.6, 0.9, 0.0],
    ];
    // Two Gaussians of different scalars, on their axis: s rises from 0 to 1 as the logistic function of 2 t
    // / sigma² and takes each value once.
    let points = Points::new(vec![DVec3::NEG_X, DVec3::X]).unwrap().with_scalars(vec![0.0, 1.0]).unwrap();
    let points = points.with_size(KernelSize::Radius(6.0)).unwrap();
    let kernels = Kernels { model: Model::Interpolate, ..Kernels::of_points() };
    let scene = points_scene(points, &rows, Some(kernels));
    // Depth: the integral of tau over ds / (ds/dt), ds/dt = (2 / sigma²) s (1 - s), sigma = 2.
    let n = 20_000;
    let depth: f64 = (0..n)
        .map(|i| {
            let s = 0.499 + 0.002 * (f64::from(i) + 0.5) / f64::from(n);
            scene.transfer.at(s).1 / (0.5 * s * (1.0 - s)) * (0.002 / f64::from(n))
        })
        .sum();
    let got = everywhere(&scene, DVec3::ZERO, DVec3::X);
    assert!((got[3] + (-depth).exp_m1()).abs() < 1e-8, "{got:?}, depth {depth}");
}

// ---- what must not matter ----------------------------------------------------------------------------

#[test]
fn order_and_splitting_do_not_matter() {
    let points = random_points(200, 9, true);
    let reversed = {
        fn back(list: &[f32]) -> Vec<f32> {
            list.iter().rev().copied().collect()
        }
        let KernelSize::Radii(radii) = points.size() else { panic!() };
        let centres = points.centres().iter().rev().copied().collect();
        let points = Points::new(centres).unwrap().with_size(KernelSize::Radii(back(radii))).unwrap();
        points
            .with_scalars(back(self::random_points(200, 9, true).scalars().unwrap()))
            .unwrap()
            .with_weights(back(self::random_points(200, 9, true).weights().unwrap()))
            .unwrap()
    };
    let mut random = Random(2);
    for model in [Model::Density, Model::Interpolate] {
        for kernel in [Kernel::Gaussian, Kernel::BSpline] {
            let kernels = Some(Kernels { kernel, model, ..Kernels::of_points() });
            let (scene, other) = (
                points_scene(points.clone(), &RAMP, kernels),
                points_scene(reversed.clone(), &RAMP, kernels),
            );
            for _ in 0..10 {
                let (o, d, range) = chord(&mut random);
                let whole = ray(&scene, o, d, range).unwrap();
                same(ray(&other, o, d, range).unwrap(), whole, 1e-12);
                let middle = 1.2 + random.next();
                let front = ray(&scene, o, d, [range[0], middle]).unwrap();
                let back = ray(&scene, o, d, [middle, range[1]]).unwrap();
                let both = std::array::from_fn(|i| front[i] + (1.0 - front[3]) * back[i]);
                same(both, whole, 1e-10);
                assert_eq!(ray(&scene, o, d, [range[1], range[0]]).unwrap(), [0.0; 4]);
            }
        }
    }
}

/// Invisible kernels have no effect, infinite scalars are the transfer function's ends, and negative weights
/// have no density.
#[test]
fn what_shows_nothing_and_what_is_infinite() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let centres: Vec<DVec3> = (0..7).map(|i| DVec3::X * (0.3 * f64::from(i))).collect();
    let full = Points::new(centres.clone()).unwrap();
    let full = full.with_scalars(vec![nan, 0.3, inf, 0.5, -inf, 0.2, 0.9]).unwrap();
    let full = full.with_weights(vec![1.0, nan, 1.0, 0.0, 1.0, 1.0, -1.0]).unwrap();
    let full = full.with_size(KernelSize::Radii(vec![1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0])).unwrap();
    let two = Points::new(vec![centres[2], centres[4]]).unwrap().with_scalars(vec![1.0, 0.0]).unwrap();
    let two = two.with_size(KernelSize::Radius(1.0)).unwrap();
    let (o, d) = (DVec3::new(-4.0, 0.1, 0.05), DVec3::new(1.0, 0.02, -0.01));
    let (got, want) = (
        everywhere(&points_scene(full.clone(), &RAMP, None), o, d),
        everywhere(&points_scene(two, &RAMP, None), o, d),
    );
    assert!(want[3] > 0.3);
    same(got, want, 1e-14);

    let flat = |covariance: [f32; 6]| {
        let scene = one_point(KernelSize::Covariances(vec![covariance]), &RAMP, None);
        everywhere(&scene, DVec3::ZERO, DVec3::new(0.3, 1.0, 0.2))
    };
    assert!(flat([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])[3] > 0.9);
    for covariance in [
        [1.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0, 1.0, 0.0, 1.0],
        [1.0, 2.0, 0.0, 1.0, 0.0, 1.0],
        [1.0, nan, 0.0, 1.0, 0.0, 1.0],
        [0.0; 6],
    ] {
        assert_eq!(flat(covariance), [0.0; 4], "{covariance:?}");
    }
    // Nothing visible; then a grid with one half missing: its kernels have no effect, others extend into it.
    let none = Points::new(vec![DVec3::ZERO]).unwrap().with_size(KernelSize::Radii(vec![0.0])).unwrap();
    assert_eq!(everywhere(&points_scene(none, &RAMP, None), DVec3::ZERO, DVec3::X), [0.0; 4]);
    let half = grid([4, 4, 4], |x, _, _| if x < 2 { 0.5 } else { nan });
    let base = scene(half, &[[0.0, 0.8, 0.4, 0.1, 2.0]]);
    for (kernel, length) in [(Kernel::Tent, 1.95), (Kernel::Gaussian, 1.0)] {
        let scene = base.clone().with_kernels(Kernels { kernel, ..Kernels::of_samples() }).unwrap();
        let got = everywhere(&scene, DVec3::new(-1.0, 1.5, 1.5), DVec3::X);
        if kernel == Kernel::Tent {
            // The field is 1 up to the last sample, then 2 - x: it falls to 0.05 at 1.95.
            same(got, uniform([0.8, 0.4, 0.1], 2.0 * length), CLOSED);
        } else {
            assert!(got[3] > uniform([0.8, 0.4, 0.1], 2.0 * length)[3] + 0.01, "{got:?}");
        }
    }
}

#[test]
fn refuses_what_has_no_kernels() {
    let why = |scene: &Scene| ray(scene, DVec3::ZERO, DVec3::X, [0.0, 1.0]).unwrap_err().to_string();
    assert!(why(&one_point(KernelSize::Unknown, &RAMP, None)).contains("radius"));
    let spline = Kernels { kernel: Kernel::BSpline, ..Kernels::of_points() };
    let covariances = KernelSize::Covariances(vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]]);
    assert!(why(&one_point(covariances, &RAMP, Some(spline))).contains("covariances"));
    let holed = grid([3, 3, 3], |x, _, _| if x == 0 { f32::NAN } else { 1.0 });
    let holed = scene(holed, &RAMP).with_kernels(Kernels { model: Model::Interpolate, ..spline }).unwrap();
    assert!(why(&holed).contains("9 of the grid's are NaN"), "{}", why(&holed));
}

/// A mesh's kernels are those of its vertices; a grid's Gaussians are ellipsoids in the world.
#[test]
fn meshes_and_grids_are_points_too() {
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
    let cells = vec![[0, 1, 2, 3], [1, 2, 3, 4]];
    let (mesh, _) = Tets::new(corners, cells, TetScalars::Point(vec![0.1, 0.9, 0.4, 0.6, 0.3])).unwrap();
    let points = Points::of_vertices(&mesh).unwrap();
    let (o, d) = (DVec3::new(-3.0, 0.2, 0.5), DVec3::new(1.0, 0.05, -0.02));
    for kernels in [Kernels::of_points(), Kernels::of_samples()] {
        let of_mesh = Scene::new(mesh.clone(), TransferFunction::from_rows(&RAMP).unwrap());
        let of_mesh = of_mesh.with_kernels(kernels).unwrap();
        let pixel = everywhere(&of_mesh, o, d);
        assert!(pixel[3] > 0.3);
        assert_eq!(pixel, everywhere(&points_scene(points.clone(), &RAMP, Some(kernels)), o, d));
    }

    let axes =
        DMat3::from_cols(DVec3::new(1.0, 0.25, 0.0), DVec3::new(-0.5, 0.5, 0.0), DVec3::new(0.0, 0.25, 2.0));
    let values = [0.5_f32, 0.75, 0.25, 1.0, 0.0, 0.125, 0.5, 0.625];
    let placed = Grid::new([2, 2, 2], Samples::F32(values.to_vec())).unwrap();
    let placed = placed.with_placement(DVec3::ONE, DVec3::new(0.5, -0.25, 1.0), axes).unwrap();
    let centres = (0..8).map(|i| {
        placed.world_of_index(DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)))
    });
    let covariance = axes * axes.transpose() * 0.5625;
    let columns = covariance.to_cols_array().map(num::f32_of);
    let size = [columns[0], columns[1], columns[2], columns[4], columns[5], columns[8]];
    let points = Points::new(centres.collect()).unwrap().with_scalars(values.to_vec()).unwrap();
    let points = points.with_size(KernelSize::Covariances(vec![size; 8])).unwrap();
    let kernels = Kernels { sigma: 0.75, ..Kernels::of_points() };
    let peak = kernels.peak_on_grid();
    let rows = RAMP.map(|[s, r, g, b, tau]| [s, r, g, b, tau * peak]);
    let of_points = points_scene(points, &rows, Some(kernels));
    let of_grid = scene(placed, &RAMP).with_kernels(kernels).unwrap();
    let mut random = Random(77);
    for _ in 0..20 {
        let o = random.in_box(DVec3::splat(-3.0), DVec3::splat(3.0));
        let d = DVec3::new(0.5, 0.25, 2.0) - o;
        let want = everywhere(&of_points, o, d);
        assert!(want[3] > 0.05);
        same(everywhere(&of_grid, o, d), want, 1e-12);
    }
}

/// Images, single pixels and rays agree, in both projections and with the eye among the kernels.
#[test]
fn images_are_made_of_rays() {
    let scene = points_scene(random_points(60, 4, false), &RAMP, None);
    for projection in
        [Projection::Perspective { fov_y_deg: 60.0 }, Projection::Orthographic { half_height: 1.0 }]
    {
        for eye in [DVec3::new(0.1, 0.2, 0.3), DVec3::new(2.0, 1.0, 2.0)] {
            let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection };
            let view = View::new(camera, 9, 7).unwrap();
            let image = render(&scene, &view, &ReferenceOptions::default(), None).unwrap();
            let places: Vec<[u32; 2]> = (0..63).map(|i| [i % 9, i / 9]).collect();
            let some = pixels(&scene, &view, &places).unwrap();
            let mut shown = 0;
            for ([x, y], pixel) in places.into_iter().zip(some) {
                assert_eq!(pixel, image.pixel(x, y));
                let (o, d) = view.ray(DVec2::new(f64::from(x), f64::from(y)) + 0.5);
                same(ray(&scene, o, d, view_range(&view)).unwrap(), pixel, 1e-13);
                shown += i32::from(pixel[3] > 0.1);
            }
            assert!(shown > 5, "{shown}");
        }
    }
}

/// Time of images of 64 x 64; run with `-- --ignored --nocapture`.
#[test]
#[ignore = "a measurement: about a minute"]
fn measure_time_of_kernels() {
    let camera = Camera {
        eye: DVec3::new(2.0, 1.5, 3.8),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 42.0 },
    };
    let view = View::new(camera, 64, 64).unwrap();
    let time = |name: &str, scene: &Scene| {
        let start = std::time::Instant::now();
        let image = render(scene, &view, &ReferenceOptions::default(), None).unwrap();
        println!("{name}: {:.2} s, {:?}", start.elapsed().as_secs_f64(), image.pixel(32, 32));
    };
    let points = random_points(20_000, 1, true).with_size(KernelSize::Radius(0.08)).unwrap();
    for model in [Model::Density, Model::Interpolate] {
        let kernels = Kernels { model, ..Kernels::of_points() };
        time(&format!("20,000 points, {model:?}"), &points_scene(points.clone(), &SHELLS, Some(kernels)));
        for (name, kernel) in Kernel::ALL {
            let kernels = Kernels { kernel, model, ..Kernels::of_samples() };
            if let Ok(scene) = marschner_lobb(128).with_kernels(kernels) {
                time(&format!("128^3 {name}, {model:?}"), &scene);
            }
        }
    }
}
