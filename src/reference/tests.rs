//! The reference against closed forms, against independent integrators, and against itself under changes
//! without effect.

mod gaussians;
mod grid;
mod images;
mod invariance;
mod kernels;
mod mesh;
mod skipping;
mod surfaces;

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::surfaces::SurfaceRays;
use super::*;
use crate::num;
use crate::scene::{Camera, Field, Grid, Projection, Rescale, Samples, Scene, TransferFunction, View};

use super::view_ray::view_range;

/// Required accuracy of every comparison.
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

/// Returns the colour of a medium of one colour and this optical depth.
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

/// Extinction and colour at a world position from eight weights, without cells and knots.
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

/// Emission and optical depth of a segment; segments compose front to back.
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

/// Adaptive midpoint rule with one extrapolation. It finds kinks by halving, without knowing where they are.
///
/// Good to about 1e-11, except for a peak that hides between two of its 3000 first steps: finer grids than
/// those of these tests need more of them.
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
    // The test also uses emission and extinction at the ends: midpoints miss a kink near an end.
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

/// A ray from a random point on a sphere around [-1, 1]^3 through a random point near its middle, and a range
/// that ends beyond the box.
fn chord(random: &mut Random) -> (DVec3, DVec3, [f64; 2]) {
    let from = random.in_box(DVec3::NEG_ONE, DVec3::ONE).normalize() * 1.8;
    let through = random.in_box(DVec3::splat(-0.6), DVec3::splat(0.6));
    (from, (through - from).normalize(), [0.0, 3.7])
}
