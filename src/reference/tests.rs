//! The reference against closed forms, against integrators that know nothing of cells and knots, and
//! against itself under changes that must not matter.

mod kernels;
mod mesh;
mod surfaces;

use glam::{DMat3, DQuat};

use super::*;
use crate::scene::{Camera, Field, Grid, Projection, Rescale, Samples, TransferFunction};

/// Accuracy that every comparison asks for.
const EXACT: f64 = 1e-9;

fn grid(dims: [u32; 3], value: impl Fn(u32, u32, u32) -> f32) -> Grid {
    let mut samples = Vec::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                samples.push(value(x, y, z));
            }
        }
    }
    Grid::new(dims, Samples::F32(samples)).unwrap()
}

fn scene(grid: Grid, rows: &[[f64; 5]]) -> Scene {
    Scene::new(grid, TransferFunction::from_rows(rows).unwrap())
}

/// The unit cube in one cell with s = x.
fn ramp_cell(rows: &[[f64; 5]]) -> Scene {
    scene(grid([2, 2, 2], |x, _, _| if x == 0 { 0.0 } else { 1.0 }), rows)
}

const SHELLS: [[f64; 5]; 7] = [
    [0.0, 0.1, 0.2, 0.6, 0.0],
    [0.42, 0.9, 0.4, 0.1, 0.0],
    [0.5, 1.0, 0.8, 0.3, 30.0],
    [0.58, 0.2, 0.6, 0.9, 0.0],
    [0.8, 0.2, 0.6, 0.9, 0.0],
    [0.9, 0.3, 0.4, 1.0, 2.0],
    [1.0, 0.6, 0.2, 0.8, 2.0],
];

fn marschner_lobb(n: u32) -> Scene {
    scene(Field::MarschnerLobb.sample([n; 3], "f32").unwrap(), &SHELLS)
}

fn everywhere(scene: &Scene, origin: DVec3, direction: DVec3) -> [f64; 4] {
    ray(scene, origin, direction, [f64::NEG_INFINITY, f64::INFINITY]).unwrap()
}

fn difference(a: [f64; 4], b: [f64; 4]) -> f64 {
    let worst = |worst: f64, (a, b): (f64, f64)| {
        if (a - b).is_finite() { worst.max((a - b).abs()) } else { f64::INFINITY }
    };
    a.into_iter().zip(b).fold(0.0, worst)
}

#[track_caller]
fn same(got: [f64; 4], want: [f64; 4], bound: f64) {
    let error = difference(got, want);
    assert!(error <= bound, "error {error:e} above {bound:e}: {got:?} instead of {want:?}");
}

/// What one colour of a medium with this optical depth looks like.
fn uniform(colour: [f64; 3], depth: f64) -> [f64; 4] {
    let alpha = -(-depth).exp_m1();
    [colour[0] * alpha, colour[1] * alpha, colour[2] * alpha, alpha]
}

/// Numbers in [0, 1) from a fixed seed.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        num::f64_of_u64(self.0 >> 33) / 2_147_483_648.0
    }

    fn in_box(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        low + (high - low) * DVec3::new(self.next(), self.next(), self.next())
    }
}

/// Extinction and colour at a place in the world, by eight weights; no cells, no knots.
fn medium(scene: &Scene, p: DVec3) -> (DVec3, f64) {
    let grid = scene.grid().unwrap();
    let m = grid.index_to_world();
    let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
    let r = p - grid.origin();
    let volume = a.dot(b.cross(c));
    let index = [r.dot(b.cross(c)) / volume, a.dot(r.cross(c)) / volume, a.dot(b.cross(r)) / volume];
    let dims = grid.dims();
    let mut base = [0_u32; 3];
    let mut w = [0.0; 3];
    for i in 0..3 {
        if index[i] < 0.0 || index[i] > f64::from(dims[i] - 1) {
            return (DVec3::ZERO, 0.0);
        }
        base[i] = num::u32_of(index[i]).min(dims[i] - 2);
        w[i] = index[i] - f64::from(base[i]);
    }
    let mut s = 0.0;
    for corner in 0..8_u32 {
        let bits = [corner & 1, (corner >> 1) & 1, corner >> 2];
        let weight: f64 = (0..3).map(|i| if bits[i] == 1 { w[i] } else { 1.0 - w[i] }).product();
        s += weight * grid.value(base[0] + bits[0], base[1] + bits[1], base[2] + bits[2]);
    }
    scene.transfer.at(s)
}

/// Optical depth and emission of a stretch; stretches compose front to back.
type Stretch = [f64; 4];

fn compose(front: Stretch, back: Stretch) -> Stretch {
    let t = (-front[3]).exp();
    [front[0] + t * back[0], front[1] + t * back[1], front[2] + t * back[2], front[3] + back[3]]
}

fn midpoint_step(scene: &Scene, origin: DVec3, direction: DVec3, a: f64, b: f64) -> Stretch {
    step_of(medium(scene, origin + direction * (0.5 * (a + b))), b - a)
}

fn step_of((c, tau): (DVec3, f64), length: f64) -> Stretch {
    let depth = tau * length;
    let alpha = -(-depth).exp_m1();
    [c.x * alpha, c.y * alpha, c.z * alpha, depth]
}

fn pixel(s: Stretch) -> [f64; 4] {
    [s[0], s[1], s[2], -(-s[3]).exp_m1()]
}

/// Plain midpoint rule.
fn midpoint(scene: &Scene, origin: DVec3, direction: DVec3, [a, b]: [f64; 2], steps: u32) -> [f64; 4] {
    let h = (b - a) / f64::from(steps);
    let mut sum = Stretch::default();
    for i in 0..steps {
        let t = a + h * f64::from(i);
        sum = compose(sum, midpoint_step(scene, origin, direction, t, t + h));
    }
    pixel(sum)
}

/// Midpoint rule that halves its steps where they matter, with one extrapolation: finds kinks by
/// halving, knows nothing of where they are. Good to about 1e-11, but for a peak that hides between two
/// of its 3000 first steps: finer grids than those of these tests need more of them.
fn adaptive(scene: &Scene, origin: DVec3, direction: DVec3, range: [f64; 2]) -> [f64; 4] {
    adaptive_in(&|p| medium(scene, p), origin, direction, range)
}

/// The same in any medium of colour and extinction.
fn adaptive_in(
    medium: &dyn Fn(DVec3) -> (DVec3, f64),
    origin: DVec3,
    direction: DVec3,
    [a, b]: [f64; 2],
) -> [f64; 4] {
    // Emission and extinction at the ends belong to the test: a kink near an end is seen by no midpoint.
    type Function<'a> = &'a dyn Fn(f64) -> [f64; 4];
    type Step<'a> = &'a dyn Fn(f64, f64) -> Stretch;
    fn refine(at: Function<'_>, step: Step<'_>, [a, b]: [f64; 2], coarse: Stretch, left: u32) -> Stretch {
        let m = 0.5 * (a + b);
        let (front, back) = (step(a, m), step(m, b));
        let fine = compose(front, back);
        let (low, middle, high) = (at(a), at(m), at(b));
        let bend = (0..4).map(|i| (low[i] - 2.0 * middle[i] + high[i]).abs()).fold(0.0, f64::max) * (b - a);
        if left == 0 || (difference(fine, coarse) < 5e-13 && bend < 2e-12) {
            return std::array::from_fn(|i| fine[i] + (fine[i] - coarse[i]) / 3.0);
        }
        compose(refine(at, step, [a, m], front, left - 1), refine(at, step, [m, b], back, left - 1))
    }
    let at = |t: f64| {
        let (c, tau) = medium(origin + direction * t);
        [tau * c.x, tau * c.y, tau * c.z, tau]
    };
    let step = |a: f64, b: f64| step_of(medium(origin + direction * (0.5 * (a + b))), b - a);
    let steps = 3000;
    let h = (b - a) / f64::from(steps);
    let mut sum = Stretch::default();
    for i in 0..steps {
        let t = a + h * f64::from(i);
        sum = compose(sum, refine(&at, &step, [t, t + h], step(t, t + h), 40));
    }
    pixel(sum)
}

/// A ray from a random point on a sphere around [-1, 1]^3 through a random point near its middle, and
/// its range up to beyond the box.
fn chord(random: &mut Random) -> (DVec3, DVec3, [f64; 2]) {
    let from = random.in_box(DVec3::NEG_ONE, DVec3::ONE).normalize() * 1.8;
    let through = random.in_box(DVec3::splat(-0.6), DVec3::splat(0.6));
    (from, (through - from).normalize(), [0.0, 3.7])
}

// ---- closed forms ------------------------------------------------------------------------------------

#[test]
fn homogeneous_box_is_its_closed_form_in_both_projections_and_from_inside() {
    let (colour, tau) = ([0.8, 0.4, 0.1], 1.7);
    let mut box_ =
        scene(Field::Homogeneous(1.0).sample([9, 6, 4], "u8").unwrap(), &[[0.0, 0.8, 0.4, 0.1, tau]]);
    // Length of a ray in [-1, 1]^3 by the slab method, from the eye on for perspective.
    let length = |o: DVec3, d: DVec3, from: f64| {
        let (a, b) = ((DVec3::NEG_ONE - o) / d, (DVec3::ONE - o) / d);
        (a.max(b).min_element() - a.min(b).max_element().max(from)).max(0.0)
    };
    for projection in
        [Projection::Perspective { fov_y_deg: 70.0 }, Projection::Orthographic { half_height: 1.6 }]
    {
        for eye in [DVec3::new(2.0, 1.5, 3.8), DVec3::new(0.3, -0.2, 0.6), DVec3::new(0.0, 0.0, 1.0)] {
            let camera = Camera { eye, target: DVec3::new(0.05, 0.02, -0.03), up: DVec3::Y, projection };
            let view = View::new(camera, 23, 17).unwrap();
            let image = render(&box_, &view, &ReferenceOptions::default(), None).unwrap();
            let mut covered = 0;
            for y in 0..17 {
                for x in 0..23 {
                    let (o, d) = view.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                    let from = if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY };
                    let depth = tau * length(o, d, from);
                    covered += u32::from(depth > 0.0);
                    same(image.pixel(x, y), uniform(colour, depth), 1e-14);
                }
            }
            assert!(covered > 40, "{projection:?}: {covered} pixels covered");
        }
    }
    // Optical depths from nothing to far beyond opaque.
    for tau in [0.0, 1e-12, 1e-8, 1.0, 44.0, 1e8, 1e300] {
        box_.transfer = TransferFunction::from_rows(&[[0.0, 0.8, 0.4, 0.1, tau]]).unwrap();
        let got = everywhere(&box_, DVec3::new(0.1, 0.2, -5.0), DVec3::Z);
        let want = uniform(colour, 2.0 * tau);
        for (got, want) in got.into_iter().zip(want) {
            assert!((got - want).abs() <= 1e-14 * want, "tau {tau:e}: {got:e} instead of {want:e}");
        }
    }
}

#[test]
fn ramp_of_extinction_with_one_colour() {
    let colour = [0.3, 0.9, 0.5];
    for (t0, t1) in [(0.0, 2.0), (5.0, 1.0), (0.0, 1e8), (1e8, 0.0), (1e-9, 3e-9), (f64::MAX, 0.0)] {
        let box_ = ramp_cell(&[[0.0, 0.3, 0.9, 0.5, t0], [1.0, 0.3, 0.9, 0.5, t1]]);
        // An oblique ray through the faces x = 0 and x = 1: s is linear in its length.
        let direction = DVec3::new(1.0, 0.3, 0.2);
        let want = uniform(colour, 0.5 * (t0 + t1) * direction.length());
        same(everywhere(&box_, DVec3::new(-1.0, 0.0, 0.1), direction), want, 1e-13);
        same(everywhere(&box_, DVec3::new(2.0, 0.9, 0.7), -direction), want, 1e-13);
    }
}

#[test]
fn a_jump_makes_two_layers() {
    let (c1, c2) = ([0.9, 0.1, 0.2], [0.1, 0.4, 1.0]);
    for (tau1, tau2) in [(0.7, 2.5), (0.0, 3.0), (1e8, 1.0), (1e-3, 1e8)] {
        let box_ = ramp_cell(&[
            [0.0, 0.9, 0.1, 0.2, tau1],
            [0.4, 0.9, 0.1, 0.2, tau1],
            [0.4, 0.1, 0.4, 1.0, tau2],
            [1.0, 0.1, 0.4, 1.0, tau2],
        ]);
        let (first, second) = (uniform(c1, 0.4 * tau1), uniform(c2, 0.6 * tau2));
        let over = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|i| a[i] + (1.0 - a[3]) * b[i]);
        same(everywhere(&box_, DVec3::new(-2.0, 0.3, 0.6), DVec3::X), over(first, second), 1e-13);
        same(everywhere(&box_, DVec3::new(7.0, 0.3, 0.6), DVec3::NEG_X), over(second, first), 1e-13);
    }
}

/// The transfer function is continuous from the right: a scalar that sits on the jump belongs to the
/// later knot.
#[test]
fn a_scalar_that_stays_on_a_jump_takes_the_later_knot() {
    let rows = [
        [0.0, 1.0, 0.0, 0.0, 1.0],
        [0.5, 1.0, 0.0, 0.0, 1.0],
        [0.5, 0.0, 1.0, 0.0, 4.0],
        [1.0, 0.0, 1.0, 0.0, 4.0],
    ];
    // The whole cell on the jump; then a field s = y / 2 and rays inside the face y = 1.
    let constant = scene(grid([2, 2, 2], |_, _, _| 0.5), &rows);
    let direction = DVec3::new(0.6, 0.2, 0.7);
    let length = 1.0 / 0.7 * direction.length();
    same(everywhere(&constant, DVec3::ZERO, direction), uniform([0.0, 1.0, 0.0], 4.0 * length), 1e-14);
    let ramp = scene(grid([3, 3, 3], |_, y, _| [0.0, 0.5, 1.0][num::index(y)]), &rows);
    for direction in [DVec3::X, DVec3::NEG_Z, DVec3::new(0.6, 0.0, 0.8)] {
        let got = everywhere(&ramp, DVec3::ONE, direction);
        let length = 2.0 / direction.abs().max_element();
        same(got, uniform([0.0, 1.0, 0.0], 4.0 * length), 1e-13);
    }
}

/// Colour and extinction both linear: no closed form without the error function, so composite Simpson.
#[test]
fn linear_extinction_and_linear_colour_equal_simpson() {
    let (ca, cb) = ([0.1, 1.0, 0.5], [0.9, 0.0, 0.5]);
    for (ta, tb) in [(0.0, 1.0), (3.0, 0.5), (0.0, 40.0), (700.0, 0.0), (0.0, 700.0), (1e-7, 2e-7)] {
        let box_ = ramp_cell(&[[0.0, 0.1, 1.0, 0.5, ta], [1.0, 0.9, 0.0, 0.5, tb]]);
        let emission = |t: f64, channel: usize| {
            let tau = ta + (tb - ta) * t;
            tau * (ca[channel] + (cb[channel] - ca[channel]) * t)
                * (-(ta * t + 0.5 * (tb - ta) * t * t)).exp()
        };
        let steps = 200_000_u32;
        let h = 1.0 / f64::from(steps);
        let simpson = |channel: usize| -> f64 {
            let inner: f64 =
                (1..steps).map(|i| f64::from(2 + 2 * (i % 2)) * emission(h * f64::from(i), channel)).sum();
            (emission(0.0, channel) + inner + emission(1.0, channel)) * h / 3.0
        };
        let want = [simpson(0), simpson(1), simpson(2), -(-0.5 * (ta + tb)).exp_m1()];
        same(everywhere(&box_, DVec3::new(-1.0, 0.5, 0.5), DVec3::X), want, 1e-12);
    }
    // Opaque at once: the colour of the first knot.
    for tau in [1e30, f64::MAX] {
        let box_ = ramp_cell(&[[0.0, 0.1, 1.0, 0.5, tau], [1.0, 0.9, 0.0, 0.5, tau]]);
        same(everywhere(&box_, DVec3::new(-1.0, 0.5, 0.5), DVec3::X), [0.1, 1.0, 0.5, 1.0], 1e-13);
    }
}

/// tau = x y z along the cell's diagonal is t^3 / sqrt(27) in length: the cubic case.
#[test]
fn cubic_extinction_along_a_diagonal() {
    let corner = grid([2, 2, 2], |x, y, z| if x * y * z == 1 { 1.0 } else { 0.0 });
    let box_ = scene(corner, &[[0.0, 0.2, 0.5, 1.0, 0.0], [1.0, 0.2, 0.5, 1.0, 8.0]]);
    let want = uniform([0.2, 0.5, 1.0], 8.0 * 3.0_f64.sqrt() / 4.0);
    same(everywhere(&box_, DVec3::NEG_ONE, DVec3::ONE), want, 1e-14);
}

// ---- other integrators -------------------------------------------------------------------------------

#[test]
fn random_rays_equal_an_adaptive_integrator() {
    let mut random = Random(7);
    let fog = [
        [0.0, 0.1, 0.2, 0.7, 0.0],
        [0.06, 0.1, 0.2, 0.7, 0.0],
        [0.3, 0.2, 0.6, 0.9, 1.0],
        [0.6, 0.9, 0.85, 0.3, 3.0],
        [1.0, 1.0, 0.25, 0.1, 8.0],
    ];
    let jumps = [
        [0.1, 1.0, 0.0, 0.0, 2.0],
        [0.5, 0.0, 1.0, 0.0, 0.5],
        [0.5, 0.0, 0.0, 1.0, 9.0],
        [0.7, 1.0, 1.0, 0.0, 0.0],
    ];
    let scenes = [
        marschner_lobb(14),
        scene(
            Field::Sphere.sample([9, 11, 8], "f32").unwrap(),
            &[[0.0, 0.9, 0.5, 0.1, 0.0], [1.0, 0.2, 0.5, 0.9, 6.0]],
        ),
        scene(Field::Blobs.sample([10; 3], "f32").unwrap(), &fog),
        scene(Field::MarschnerLobb.sample([7, 8, 9], "f32").unwrap(), &jumps),
    ];
    let mut worst = 0.0_f64;
    for (i, scene) in scenes.iter().enumerate() {
        let mut visible = 0;
        for _ in 0..12 {
            let (o, d, range) = chord(&mut random);
            let got = ray(scene, o, d, range).unwrap();
            let error = difference(got, adaptive(scene, o, d, range));
            assert!(error < EXACT, "scene {i}, from {o} along {d}: error {error:e}");
            worst = worst.max(error);
            visible += u32::from(got[3] > 0.01);
        }
        assert!(visible >= 6, "scene {i}: {visible} rays saw something");
    }
    println!("worst difference from the adaptive integrator: {worst:e}");
}

/// Midpoint sampling converges to the reference at its own second order, down to where only a wrong
/// reference would stop it.
#[test]
fn midpoint_rule_converges_to_the_reference_at_second_order() {
    let smooth = [[0.0, 0.9, 0.5, 0.1, 0.2], [1.0, 0.2, 0.5, 0.9, 3.0]];
    let scene = scene(Field::MarschnerLobb.sample([6; 3], "f32").unwrap(), &smooth);
    let mut random = Random(3);
    let mut orders = Vec::new();
    let mut finest = 0.0_f64;
    for _ in 0..40 {
        // Inside the box, so that the only kinks are those at the voxel faces.
        let (a, b) = (
            random.in_box(DVec3::splat(-0.99), DVec3::splat(0.99)),
            random.in_box(DVec3::splat(-0.99), DVec3::splat(0.99)),
        );
        let (direction, range) = ((b - a).normalize(), [0.0, (b - a).length()]);
        let truth = ray(&scene, a, direction, range).unwrap();
        let errors =
            [256, 512, 1024, 2048, 4096].map(|n| difference(midpoint(&scene, a, direction, range, n), truth));
        // Kinks fall anywhere in a step, so single halvings are noisy: the slope over four of them.
        orders.push((errors[0] / errors[4]).log2() / 4.0);
        finest = finest.max(errors[4]);
    }
    orders.sort_by(f64::total_cmp);
    let median = orders[20];
    assert!((median - 2.0).abs() < 0.15, "median order {median:.3}, expected 2");
    assert!(finest < 1e-6, "error of the finest: {finest:e}");
}

// ---- changes that must not matter --------------------------------------------------------------------

#[test]
fn a_placed_grid_equals_the_plain_one_seen_from_the_placed_camera() {
    let plain = marschner_lobb(8);
    let mut random = Random(11);
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0));
    let mirror = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
    for direction in [turn, mirror, turn * mirror] {
        let origin = DVec3::new(30.0, -20.0, 7.0);
        let spacing = DVec3::splat(2.0 / 7.0);
        let mut placed = plain.clone();
        placed.data =
            placed.grid().unwrap().clone().with_placement(spacing, origin, direction).unwrap().into();
        for _ in 0..20 {
            let (o, d, range) = chord(&mut random);
            let want = ray(&plain, o, d, range).unwrap();
            let moved = origin + direction * (o + DVec3::ONE);
            same(ray(&placed, moved, direction * d, range).unwrap(), want, 1e-11);
        }
    }
    // A shear changes lengths: the affine field s = x + 2y - z / 2 in world terms must not notice.
    let affine = |p: DVec3| p.x + 2.0 * p.y - 0.5 * p.z;
    let rows = [
        [-4.0, 1.0, 0.0, 0.3, 0.0],
        [0.0, 0.2, 0.8, 0.3, 1.0],
        [1.0, 0.2, 0.1, 0.9, 4.0],
        [1.5, 0.0, 1.0, 0.0, 0.1],
    ];
    let shear =
        DMat3::from_cols(DVec3::new(1.0, 0.0, 0.0), DVec3::new(0.5, 1.0, 0.25), DVec3::new(-0.25, 0.5, -1.0));
    let lattice =
        grid([9, 9, 9], |_, _, _| 0.0).with_placement(DVec3::splat(0.5), DVec3::NEG_ONE, shear).unwrap();
    let fill = |lattice: &Grid| {
        let place = |x: u32, y: u32, z: u32| {
            lattice.world_of_index(DVec3::new(f64::from(x), f64::from(y), f64::from(z)))
        };
        // Every number involved is a small multiple of 1/16: exact in f32.
        grid(lattice.dims(), |x, y, z| num::f32_of(affine(place(x, y, z))))
            .with_placement(
                DVec3::splat(0.5),
                lattice.origin(),
                DMat3::from_cols(
                    lattice.index_to_world().x_axis * 2.0,
                    lattice.index_to_world().y_axis * 2.0,
                    lattice.index_to_world().z_axis * 2.0,
                ),
            )
            .unwrap()
    };
    let sheared = scene(fill(&lattice), &rows);
    let centre = lattice.centre();
    let straight =
        lattice.with_placement(DVec3::splat(0.5), centre - DVec3::splat(2.0), DMat3::IDENTITY).unwrap();
    let straight = scene(fill(&straight), &rows);
    for _ in 0..20 {
        // Stay within what both boxes contain.
        let (a, b) = (
            random.in_box(DVec3::splat(-0.4), DVec3::splat(0.4)),
            random.in_box(DVec3::splat(-0.4), DVec3::splat(0.4)),
        );
        let range = [0.0, (b - a).length()];
        let want = ray(&straight, centre + a, b - a, range).unwrap();
        assert!(want[3] > 0.0);
        same(ray(&sheared, centre + a, b - a, range).unwrap(), want, 1e-12);
    }
}

#[test]
fn integer_types_and_rescale_equal_their_float_values() {
    let mut random = Random(5);
    let stored = Field::MarschnerLobb.sample([7; 3], "u8").unwrap();
    let Samples::U8(codes) = stored.samples().clone() else { panic!("asked for u8") };
    let rescale = Rescale { slope: -2.0, intercept: 300.0 };
    let place =
        |grid: Grid| grid.with_placement(DVec3::splat(2.0 / 6.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let float = place(
        Grid::new([7; 3], Samples::F32(codes.iter().map(|&c| 300.0 - 2.0 * f32::from(c)).collect())).unwrap(),
    );
    let wide = place(Grid::new([7; 3], Samples::I16(codes.iter().map(|&c| i16::from(c)).collect())).unwrap());
    let rows = [[-210.0, 0.2, 0.2, 1.0, 2.0], [0.0, 1.0, 0.5, 0.0, 0.0], [250.0, 1.0, 0.5, 0.0, 3.0]];
    let want = scene(float, &rows);
    for grid in [stored.with_rescale(rescale).unwrap(), wide.with_rescale(rescale).unwrap()] {
        let rescaled = scene(grid, &rows);
        for _ in 0..10 {
            let (o, d, range) = chord(&mut random);
            assert_eq!(ray(&rescaled, o, d, range).unwrap(), ray(&want, o, d, range).unwrap());
        }
    }
}

#[test]
fn axis_aligned_and_face_grazing_rays_are_limits_of_their_neighbours() {
    let scene = marschner_lobb(9);
    // Index 4 is the centre: 0 lies on faces along every axis, 1/4 too, 0.1 does not.
    for a in [-0.25, 0.0, 0.1, 0.25] {
        for b in [-0.5, 0.0, 0.3] {
            for (o, d) in [
                (DVec3::new(-3.0, a, b), DVec3::X),
                (DVec3::new(a, 3.0, b), DVec3::NEG_Y),
                (DVec3::new(a, b, -3.0), DVec3::Z),
                // In a face, along its diagonal; along the body's diagonal through edges and corners.
                (DVec3::new(-2.0, -2.0, a), DVec3::new(1.0, 1.0, 0.0)),
                (DVec3::splat(-2.0), DVec3::ONE),
            ] {
                let got = everywhere(&scene, o, d);
                let side = d.any_orthonormal_vector() * 1e-11;
                same(everywhere(&scene, o + side, d), got, EXACT);
                same(everywhere(&scene, o - side, d), got, EXACT);
                same(adaptive(&scene, o, d.normalize(), [0.0, 7.0]), got, EXACT);
                // A direction with a component that is almost nothing.
                same(everywhere(&scene, o, d + DVec3::new(1e-300, -1e-17, 5e-324)), got, EXACT);
            }
        }
    }
    // The box is closed: a ray in an outer face sees it, one beside it sees nothing.
    let box_ = ramp_cell(&[[0.0, 1.0, 1.0, 1.0, 1.0]]);
    for (y, depth) in [(0.0, 1.0), (1.0, 1.0), (-1e-12, 0.0), (1.0 + 1e-12, 0.0)] {
        same(everywhere(&box_, DVec3::new(-1.0, y, 1.0), DVec3::X), uniform([1.0; 3], depth), 1e-14);
    }
}

#[test]
fn a_nan_sample_empties_its_cells_and_no_other() {
    // No vacuum at any scalar: what is empty is so because of the NaN.
    let rows = [[0.0, 0.1, 0.2, 0.6, 1.0], [0.5, 1.0, 0.8, 0.3, 0.3], [1.0, 0.3, 0.4, 1.0, 2.0]];
    let whole = scene(Field::MarschnerLobb.sample([6; 3], "f32").unwrap(), &rows);
    let Samples::F32(mut samples) = whole.grid().unwrap().samples().clone() else { panic!("asked for f32") };
    // Sample (2, 3, 1): the cells [1, 3] x [2, 4] x [0, 2] are vacuum.
    samples[(6 + 3) * 6 + 2] = f32::NAN;
    let place = |samples| {
        let grid = Grid::new([6; 3], Samples::F32(samples)).unwrap();
        let grid = grid.with_placement(DVec3::ONE, DVec3::ZERO, DMat3::IDENTITY).unwrap();
        Scene::new(grid, whole.transfer.clone())
    };
    let holed = place(samples);
    let Samples::F32(samples) = whole.grid().unwrap().samples().clone() else { panic!("asked for f32") };
    let whole = place(samples);
    let mut hit = 0;
    for y in 0..10 {
        for z in 0..10 {
            let o = DVec3::new(-1.0, f64::from(y) * 0.5 + 0.25, f64::from(z) * 0.5 + 0.25);
            let got = everywhere(&holed, o, DVec3::X);
            if o.y > 2.0 && o.y < 4.0 && o.z < 2.0 {
                let front = ray(&whole, o, DVec3::X, [0.0, 2.0]).unwrap();
                let back = ray(&whole, o, DVec3::X, [4.0, 9.0]).unwrap();
                let want = std::array::from_fn(|i| front[i] + (1.0 - front[3]) * back[i]);
                same(got, want, 1e-14);
                hit += 1;
            } else {
                assert_eq!(got, everywhere(&whole, o, DVec3::X), "beside the hole, at {o}");
            }
        }
    }
    assert_eq!(hit, 16);
}

#[test]
fn infinite_samples_take_the_end_knots_before_interpolation() {
    let rows = [[-2.0, 1.0, 0.0, 0.0, 0.5], [3.0, 0.0, 0.5, 1.0, 6.0]];
    let value =
        |at_ends: [f32; 2]| move |x: u32, y: u32, _: u32| if y == 0 { at_ends[num::index(x)] } else { 1.0 };
    let infinite = scene(grid([2, 2, 2], value([f32::NEG_INFINITY, f32::INFINITY])), &rows);
    let finite = scene(grid([2, 2, 2], value([-2.0, 3.0])), &rows);
    for d in [DVec3::X, DVec3::new(1.0, 0.4, 0.3), DVec3::new(-1.0, 0.2, 0.1)] {
        let o = DVec3::new(0.5, 0.3, 0.5) - d * 3.0;
        assert_eq!(everywhere(&infinite, o, d), everywhere(&finite, o, d));
    }
    // A negative slope turns the infinities round.
    let turned = scene(grid([2, 2, 2], value([f32::INFINITY, f32::NEG_INFINITY])), &rows);
    let rescaled =
        turned.grid().unwrap().clone().with_rescale(Rescale { slope: -1.0, intercept: 2.0 }).unwrap();
    let turned = Scene::new(rescaled, turned.transfer);
    assert_eq!(
        everywhere(&turned, DVec3::new(-1.0, 0.3, 0.5), DVec3::X),
        everywhere(&finite, DVec3::new(-1.0, 0.3, 0.5), DVec3::X)
    );
}

#[test]
fn splitting_reversing_and_scaling() {
    let scene = marschner_lobb(10);
    let mut random = Random(21);
    for _ in 0..30 {
        let (o, d, [a, b]) = chord(&mut random);
        let whole = ray(&scene, o, d, [a, b]).unwrap();
        let cut = a + (b - a) * random.next();
        let (front, back) = (ray(&scene, o, d, [a, cut]).unwrap(), ray(&scene, o, d, [cut, b]).unwrap());
        same(std::array::from_fn(|i| front[i] + (1.0 - front[3]) * back[i]), whole, 1e-11);
        let reversed = ray(&scene, o + d * b, -d, [0.0, b - a]).unwrap();
        assert!((reversed[3] - whole[3]).abs() < 1e-12);
        // Extinction times k, lengths over k.
        let k = 1000.0;
        let grid = scene.grid().unwrap();
        let m = grid.spacing();
        let small = Scene::new(
            grid.clone().with_placement(m / k, grid.origin() / k, DMat3::IDENTITY).unwrap(),
            TransferFunction::from_rows(&SHELLS.map(|[s, r, g, b, tau]| [s, r, g, b, tau * k])).unwrap(),
        );
        same(ray(&small, o / k, d, [a / k, b / k]).unwrap(), whole, 1e-11);
        // Twice the colour is twice the image.
        let bright =
            TransferFunction::from_rows(&SHELLS.map(|[s, r, g, b, tau]| [s, 2.0 * r, 2.0 * g, 2.0 * b, tau]))
                .unwrap();
        let bright = ray(&Scene::new(grid.clone(), bright), o, d, [a, b]).unwrap();
        same(bright, [2.0 * whole[0], 2.0 * whole[1], 2.0 * whole[2], whole[3]], 1e-14);
    }
}

/// A peak of extinction far narrower than a cell is met exactly: depth = peak width / |ds/dx|.
#[test]
fn narrow_peaks_and_many_knots() {
    for width in [1e-4, 1e-9] {
        let peak = 0.5 / width;
        let rows = [
            [0.0, 1.0, 1.0, 1.0, 0.0],
            [0.5 - width, 1.0, 1.0, 1.0, 0.0],
            [0.5, 1.0, 1.0, 1.0, peak],
            [0.5 + width, 1.0, 1.0, 1.0, 0.0],
        ];
        // The knots themselves are rounded: 1e-16 of 1e-9.
        same(
            everywhere(&ramp_cell(&rows), DVec3::new(-1.0, 0.2, 0.2), DVec3::X),
            uniform([1.0; 3], 0.5),
            1e-6 * 1e-9 / width + 1e-11,
        );
    }
    let rows: Vec<[f64; 5]> = (0..=65536)
        .map(|i| {
            let s = f64::from(i) / 65536.0;
            [s, s, 1.0 - s, 0.5, 3.0 * s]
        })
        .collect();
    let few = ramp_cell(&[[0.0, 0.0, 1.0, 0.5, 0.0], [1.0, 1.0, 0.0, 0.5, 3.0]]);
    let d = DVec3::new(1.0, 0.2, 0.3);
    same(
        everywhere(&ramp_cell(&rows), DVec3::new(-0.1, 0.2, 0.2), d),
        everywhere(&few, DVec3::new(-0.1, 0.2, 0.2), d),
        1e-12,
    );
}

#[test]
fn extreme_values_stay_finite() {
    let huge = grid([2, 2, 2], |x, y, z| [3e38, -3e38, 1e-40][num::index((x + y + z) % 3)]);
    let huge = huge.with_rescale(Rescale { slope: 1e280, intercept: 0.0 }).unwrap();
    let box_ = scene(
        huge,
        &[
            [-1.0, 0.2, 0.1, 0.4, 0.5],
            [-1.0, 1.0, 0.1, 0.4, 1e300],
            [0.0, 0.4, 0.1, 0.4, 0.0],
            [5e-324, 1.0, 1.0, 0.0, 1e8],
            [1e-300, 1.0, 0.0, 0.0, 2.0],
        ],
    );
    let mut random = Random(2);
    for _ in 0..50 {
        let (o, d, range) = chord(&mut random);
        let got = ray(&box_, o + DVec3::splat(0.5), d, range).unwrap();
        assert!(got.iter().all(|c| (0.0..=1.0 + 1e-12).contains(c)), "{got:?}");
    }
    // Values whose difference overflows, from a rescale: a jump half-way is met half-way.
    let steep = grid([2, 2, 2], |x, _, _| if x == 0 { -3e38 } else { 3e38 });
    let steep = steep.with_rescale(Rescale { slope: 4e269, intercept: 0.0 }).unwrap();
    let box_ = scene(steep, &[[0.0, 1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 0.0, 0.0]]);
    same(everywhere(&box_, DVec3::new(-1.0, 0.5, 0.5), DVec3::X), uniform([1.0, 0.0, 0.0], 1.0), 1e-14);
}

/// The rounding of the eye's distance is all that a far eye costs.
#[test]
fn a_far_eye_sees_the_same_ray() {
    let scene = marschner_lobb(8);
    let d = DVec3::new(0.36, 0.48, 0.8);
    let near = everywhere(&scene, DVec3::new(0.1, -0.2, 0.05), d);
    for distance in [1e3, 1e6] {
        let o = DVec3::new(0.1, -0.2, 0.05) - d * distance;
        // Two roundings of the distance, times the largest slope of the image across rays (about 1e3).
        same(ray(&scene, o, d, [0.0, f64::INFINITY]).unwrap(), near, 1e-12 + distance * 2e-16 * 1e3);
    }
    // Along an axis the distance is exact, and so is the ray.
    let o = DVec3::new(0.25, -0.125, 0.0625);
    let near = everywhere(&scene, o, DVec3::X);
    same(ray(&scene, o - DVec3::X * 1_048_576.0, DVec3::X, [0.0, f64::INFINITY]).unwrap(), near, 1e-13);
}

// ---- images ------------------------------------------------------------------------------------------

#[test]
fn box_filter_is_the_mean_of_its_rays() {
    let scene = marschner_lobb(8);
    let camera = Camera {
        eye: DVec3::new(2.0, 1.5, 3.8),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 42.0 },
    };
    let (coarse, fine) = (View::new(camera, 12, 10).unwrap(), View::new(camera, 24, 20).unwrap());
    let one = ReferenceOptions::default();
    let got = render(&scene, &coarse, &ReferenceOptions { samples: 2 }, None).unwrap();
    let rays = render(&scene, &fine, &one, None).unwrap();
    for y in 0..10 {
        for x in 0..12 {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| rays.pixel(2 * x + i, 2 * y + j));
            same(
                got.pixel(x, y),
                std::array::from_fn(|c| four.iter().map(|p| p[c]).sum::<f64>() / 4.0),
                1e-12,
            );
        }
    }
    // One sample is the pixel's centre.
    let centre = render(&scene, &coarse, &one, None).unwrap();
    let (o, d) = coarse.ray(DVec2::new(5.5, 4.5));
    same(centre.pixel(5, 4), ray(&scene, o, d, [0.0, f64::INFINITY]).unwrap(), 1e-13);
    assert!(difference(centre.pixel(5, 4), got.pixel(5, 4)) > 1e-4);
    let image = centre.to_image().unwrap();
    assert_eq!((image.width(), image.height()), (12, 10));
    assert_eq!(image.pixel(5, 4), centre.pixel(5, 4).map(num::f32_of));
}

#[test]
fn refuses_bad_options_and_rays_and_reports_every_row() {
    let scene = marschner_lobb(4);
    let camera = Camera {
        eye: DVec3::Z * 4.0,
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Orthographic { half_height: 1.6 },
    };
    let view = View::new(camera, 3, 7).unwrap();
    for samples in [0, 65] {
        let error = render(&scene, &view, &ReferenceOptions { samples }, None).unwrap_err().to_string();
        assert!(error.contains(&format!("{samples}: must be 1 to 64")), "{error}");
    }
    let why = |o, d, range| ray(&scene, o, d, range).unwrap_err().to_string();
    assert!(why(DVec3::NAN, DVec3::X, [0.0, 1.0]).contains("origin"));
    assert!(why(DVec3::ZERO, DVec3::ZERO, [0.0, 1.0]).contains("direction"));
    assert!(why(DVec3::ZERO, DVec3::X, [f64::NAN, 1.0]).contains("range"));
    assert!(ReferenceImage::new(2, 2, vec![[0.0; 4]; 3]).is_err());

    let rows = std::sync::Mutex::new(Vec::new());
    let progress = |done: u32, all: u32| rows.lock().unwrap().push((done, all));
    render(&scene, &view, &ReferenceOptions::default(), Some(&progress)).unwrap();
    let mut rows = rows.into_inner().unwrap();
    rows.sort_unstable();
    assert_eq!(rows, (1..=7).map(|row| (row, 7)).collect::<Vec<_>>());
}

/// Time of the standard image; run with `--release -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement: some seconds in release, minutes otherwise"]
fn time_of_the_standard_image() {
    let camera = Camera {
        eye: DVec3::new(2.0, 1.5, 3.8),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 42.0 },
    };
    let view = View::new(camera, 512, 512).unwrap();
    for n in [128, 256] {
        let scene = marschner_lobb(n);
        let start = std::time::Instant::now();
        let image = render(&scene, &view, &ReferenceOptions::default(), None).unwrap();
        println!(
            "marschner-lobb {n}^3, 512 x 512: {:.2} s, centre {:?}",
            start.elapsed().as_secs_f64(),
            image.pixel(256, 256)
        );
    }
}

/// Single pixels are those of the image, whatever their order and number.
#[test]
fn some_pixels_are_those_of_the_image() {
    let transfer = marschner_lobb(2).transfer;
    let mesh = Scene::new(Field::MarschnerLobb.tets(5).unwrap(), transfer);
    for scene in [marschner_lobb(9), mesh] {
        for distance in [1.0, 0.1] {
            let camera = Camera {
                eye: DVec3::new(2.0, 1.5, 3.8) * distance,
                target: DVec3::ZERO,
                up: DVec3::Y,
                projection: Projection::Perspective { fov_y_deg: 42.0 },
            };
            let view = View::new(camera, 23, 17).unwrap();
            let image = render(&scene, &view, &ReferenceOptions::default(), None).unwrap();
            let mut places: Vec<[u32; 2]> = (0..23 * 17).map(|i| [i * 5 % 23, i * 7 % 17]).collect();
            places.push([3, 4]);
            let found = pixels(&scene, &view, &places).unwrap();
            for ([x, y], pixel) in places.into_iter().zip(found) {
                assert_eq!(pixel, image.pixel(x, y), "({x}, {y}) from {distance}");
            }
            let error = pixels(&scene, &view, &[[0, 0], [23, 0]]).unwrap_err().to_string();
            assert!(error.contains("(23, 0): must lie inside 23 x 17"), "{error}");
        }
    }
}
