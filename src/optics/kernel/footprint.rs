//! Line integrals of kernels.

use std::f64::consts::PI;

use glam::DVec3;

use super::erf::erf;
use super::quadrature::rule;
use super::shape::{cubic, lanczos};
use crate::scene::{Kernel, Kernels};

/// A line that passes a radial kernel, in the kernel's own unit of distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chord {
    /// Parameter of the point nearest to the centre.
    pub(crate) middle: f64,
    /// Squared distance from the centre at that point.
    pub(crate) nearest: f64,
    /// Distance along the line per unit of the parameter; positive.
    pub(crate) speed: f64,
}

impl Chord {
    /// Makes the chord of the line `start + slope u`, both relative to the centre and in the kernel's unit of
    /// distance.
    ///
    /// The squared distance is that of the residual: `|start|²` minus the square of the projection would lose
    /// its digits far from the centre.
    pub(crate) fn new(start: DVec3, slope: DVec3) -> Self {
        let speed = slope.length();
        let middle = -start.dot(slope) / (speed * speed);
        Self { middle, nearest: (start + slope * middle).length_squared(), speed }
    }

    /// Clips a range of the parameter to the ball of radius `support`; returns signed distances from the
    /// nearest point.
    fn inside(&self, support: f64, range: [f64; 2]) -> Option<[f64; 2]> {
        let half = (support * support - self.nearest).max(0.0).sqrt();
        let [from, to] = range.map(|u| ((u - self.middle) * self.speed).clamp(-half, half));
        (from < to).then_some([from, to])
    }
}

/// Integrates a Gaussian of peak 1 over `range` of the parameter, with distances in standard deviations.
///
/// `cut` and the ends of the range may be infinite. The result is `sqrt(pi / 2) exp(-b² / 2) (erf(v1 / sqrt
/// 2) - erf(v0 / sqrt 2)) / speed`, where b is the least distance and v is measured from the nearest point.
pub(crate) fn gaussian(chord: Chord, cut: f64, range: [f64; 2]) -> f64 {
    let Some([from, to]) = chord.inside(cut, range) else { return 0.0 };
    let root = 0.5_f64.sqrt();
    (0.5 * PI).sqrt() * (-0.5 * chord.nearest).exp() * (erf(to * root) - erf(from * root)) / chord.speed
}

/// Integrates the radial cubic B-spline of peak 1 over `range` of the parameter, with distances in halves of
/// the radius.
///
/// The closed form follows from q² = b² + v²: the integrals of q and q³ are (v q + b² asinh(v / b)) / 2 and v
/// q³ / 4 + 3 b² (v q + b² asinh(v / b)) / 8.
pub(crate) fn spline(chord: Chord, range: [f64; 2]) -> f64 {
    let Some([from, to]) = chord.inside(2.0, range) else { return 0.0 };
    let square = chord.nearest;
    let moments = |v: f64| {
        let q = (square + v * v).sqrt();
        let bend = if square > 1e-40 { square * (v / square.sqrt()).asinh() } else { 0.0 };
        let first = 0.5 * (v * q + bend);
        [v, first, v * (square + v * v / 3.0), 0.25 * v * q * q * q + 0.75 * square * first]
    };
    let sum = |c: [f64; 4], from: f64, to: f64| -> f64 {
        let (a, b) = (moments(from), moments(to));
        (0..4).map(|i| c[i] * (b[i] - a[i])).sum()
    };
    // 1 - 3/2 q² + 3/4 q³ inside 1, (2 - q)³ / 4 outside.
    let (near, far) = ([1.0, 0.0, -1.5, 0.75], [2.0, -3.0, 1.5, -0.25]);
    let knot = (1.0 - square).max(0.0).sqrt();
    // Before, inside and behind the sphere of radius 1, where the formula changes; each part may be empty.
    let part = |c, low: f64, high: f64| {
        let (from, to) = (from.max(low), to.min(high));
        if from < to { sum(c, from, to) } else { 0.0 }
    };
    let all = part(far, -2.0, -knot) + part(near, -knot, knot) + part(far, knot, 2.0);
    all.max(0.0) / chord.speed
}

/// A kernel on a lattice, in index space.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    kernels: Kernels,
    /// Quadrature rule that is exact between two planes of samples.
    rule: Vec<(f64, f64)>,
}

impl Lattice {
    /// Prepares a kernel; its model has no effect.
    pub(crate) fn new(kernels: Kernels) -> Self {
        let points = match kernels.kernel {
            Kernel::Gaussian => 0,
            // Polynomials of degree 3 and 9; six sines of at most one period between two planes.
            Kernel::Tent => 2,
            Kernel::BSpline => 5,
            Kernel::Sinc => 16,
        };
        Self { kernels, rule: rule(points) }
    }

    /// Returns the kernel at an offset from its sample, in voxels.
    pub(crate) fn at(&self, offset: DVec3) -> f64 {
        let product = |f: fn(f64) -> f64| f(offset.x) * f(offset.y) * f(offset.z);
        match self.kernels.kernel {
            Kernel::Gaussian => {
                let square = offset.length_squared() / (self.kernels.sigma * self.kernels.sigma);
                let inside = square <= self.kernels.cut * self.kernels.cut;
                if inside { self.kernels.peak_on_grid() * (-0.5 * square).exp() } else { 0.0 }
            }
            Kernel::BSpline => product(cubic),
            Kernel::Tent => product(|x| (1.0 - x.abs()).max(0.0)),
            Kernel::Sinc => product(lanczos),
        }
    }

    /// Integrates the kernel over `range` of u along `start + slope u`, an offset from the sample in voxels.
    ///
    /// An infinite range gives the whole footprint, a finite one that of a slab. Exact up to rounding.
    pub(crate) fn line(&self, start: DVec3, slope: DVec3, range: [f64; 2]) -> f64 {
        if self.kernels.kernel == Kernel::Gaussian {
            let chord = Chord::new(start / self.kernels.sigma, slope / self.kernels.sigma);
            return self.kernels.peak_on_grid() * gaussian(chord, self.kernels.cut, range);
        }
        let reach = self.kernels.reach();
        let [mut from, mut to] = range;
        for axis in 0..3 {
            if slope[axis] == 0.0 {
                if start[axis].abs() >= reach {
                    return 0.0;
                }
                continue;
            }
            let ends = [-reach, reach].map(|x| (x - start[axis]) / slope[axis]);
            from = from.max(ends[0].min(ends[1]));
            to = to.min(ends[0].max(ends[1]));
        }
        if from >= to {
            return 0.0;
        }
        // Split at the planes of samples: at most 7 for each axis, and the ends.
        let mut cuts = [to; 24];
        cuts[0] = from;
        let mut count = 1;
        for axis in 0..3 {
            let mut plane = 1.0 - reach;
            while plane < reach {
                let u = (plane - start[axis]) / slope[axis];
                if u > from && u < to {
                    cuts[count] = u;
                    count += 1;
                }
                plane += 1.0;
            }
        }
        cuts[..count].sort_unstable_by(f64::total_cmp);
        let mut sum = 0.0;
        for ends in cuts[..=count].windows(2) {
            let width = ends[1] - ends[0];
            for (node, weight) in &self.rule {
                sum += width * weight * self.at(start + slope * (ends[0] + width * node));
            }
        }
        sum
    }

    /// Returns the half-width of the kernel along a linear function of the offset, such as an image's x.
    pub(super) fn extent(&self, function: DVec3) -> f64 {
        self.kernels.reach()
            * if self.kernels.kernel == Kernel::Gaussian {
                function.length()
            } else {
                function.abs().element_sum()
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num;
    use crate::reference;
    use crate::scene::{Grid, Model, Samples, Scene, TransferFunction};

    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    /// Numbers in [-1, 1) from a fixed seed.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            num::f64_of_u64(self.0 >> 33) / 1_073_741_824.0 - 1.0
        }

        fn vector(&mut self) -> DVec3 {
            DVec3::new(self.next(), self.next(), self.next())
        }
    }

    /// Romberg's rule on equal parts.
    fn romberg(f: &dyn Fn(f64) -> f64, from: f64, to: f64, parts: u32) -> f64 {
        let sum = |n: u32| -> f64 {
            let h = (to - from) / f64::from(n);
            (0..n).map(|i| f(from + h * (f64::from(i) + 0.5))).sum::<f64>() * h
        };
        let (a, b, c) = (sum(parts), sum(2 * parts), sum(4 * parts));
        let (ab, bc) = ((4.0 * b - a) / 3.0, (4.0 * c - b) / 3.0);
        (16.0 * bc - ab) / 15.0
    }

    #[test]
    fn radial_kernels_are_the_integrals_of_their_shapes() {
        let spline_at = |q: f64| 1.5 * cubic(q);
        let mut random = Random(1);
        for i in 0..60 {
            let square = if i < 4 { [0.0, 1.0, 4.0, 1e-20][i] } else { 2.2 * (1.0 + random.next()) };
            let chord = Chord { middle: random.next(), nearest: square, speed: 1.5 + random.next() };
            let range = [random.next() - 0.5, random.next() + 0.8];
            let v = |u: f64| (square + ((u - chord.middle) * chord.speed).powi(2)).sqrt();
            // Split where the shapes change.
            let cuts = |support: f64| {
                let mut cuts = vec![range[0], range[1]];
                for distance in [0.0, 1.0, support] {
                    let half = (distance * distance - square).max(0.0).sqrt() / chord.speed;
                    cuts.extend([chord.middle - half, chord.middle + half]);
                }
                cuts.retain(|u| *u >= range[0] && *u <= range[1]);
                cuts.sort_unstable_by(f64::total_cmp);
                cuts
            };
            let numeric = |f: &dyn Fn(f64) -> f64, support: f64| -> f64 {
                let cuts = cuts(support);
                let parts = cuts.windows(2).filter(|ends| v(0.5 * (ends[0] + ends[1])) < support);
                parts.map(|ends| romberg(f, ends[0], ends[1], 400)).sum()
            };
            if range[0] >= range[1] {
                assert_eq!(spline(chord, range), 0.0);
                continue;
            }
            let error = spline(chord, range) - numeric(&|u| spline_at(v(u)), 2.0);
            assert!(error.abs() < 1e-11, "spline, {chord:?}, {range:?}: {error:e}");
            for cut in [1.8, 3.0, f64::INFINITY] {
                let want = numeric(&|u| (-0.5 * v(u) * v(u)).exp(), cut);
                let error = gaussian(chord, cut, range) - want;
                assert!(error.abs() < 1e-11, "gaussian cut at {cut}, {chord:?}, {range:?}: {error:e}");
            }
        }
        // The whole chord through the centre.
        let chord = Chord::new(DVec3::new(1e6, 0.0, 0.0), DVec3::new(-3.0, 0.0, 0.0));
        assert!((gaussian(chord, f64::INFINITY, ALL) - (2.0 * PI).sqrt() / 3.0).abs() < 1e-15);
        assert!((spline(chord, ALL) - 0.5).abs() < 1e-15);
    }

    #[test]
    fn products_are_the_integrals_of_their_shapes() {
        let mut random = Random(2);
        for (_, kernel) in Kernel::ALL {
            let lattice = Lattice::new(Kernels { kernel, cut: 2.4, ..Kernels::of_points() });
            let mut shown = 0;
            for i in 0..40 {
                let mut slope = random.vector() * 1.5;
                if i < 12 {
                    slope[i % 3] = 0.0;
                }
                let start = random.vector() - slope * (2.0 * random.next());
                let ends = [5.0 * random.next() - 1.0, 5.0 * random.next() + 1.0];
                let slab = [ends[0].min(ends[1]), ends[0].max(ends[1])];
                // The integrals over parts of the slab add up, whatever planes they cross.
                let n = 64;
                let edge = |j: i32| slab[0] + (slab[1] - slab[0]) * f64::from(j) / f64::from(n);
                let parts: f64 = (0..n).map(|j| lattice.line(start, slope, [edge(j), edge(j + 1)])).sum();
                let whole = lattice.line(start, slope, slab);
                assert!((parts - whole).abs() < 1e-13, "{kernel:?}: {parts} {whole}");
                let f = |u: f64| lattice.at(start + slope * u);
                // Gaussians jump at the cut, by 2 % of the peak.
                let (n, bound) = if kernel == Kernel::Gaussian { (400_000, 1e-6) } else { (40_000, 1e-8) };
                let h = (slab[1] - slab[0]) / f64::from(n);
                let plain = (0..n).map(|j| f(slab[0] + h * (f64::from(j) + 0.5))).sum::<f64>() * h;
                assert!((plain - whole).abs() < bound, "{kernel:?}: {plain} {whole}");
                shown += i32::from(whole.abs() > 1e-3);
            }
            assert!(shown > 10, "{kernel:?}: {shown}");
            assert_eq!(lattice.line(DVec3::new(9.0, 0.0, 0.0), DVec3::Z, ALL), 0.0);
        }
    }

    /// The footprint of a voxel equals a table of cast rays through a field of one sample.
    #[test]
    fn footprints_are_those_of_cast_rays() {
        const N: u32 = 24;
        let mut samples = vec![0.0_f32; 9 * 9 * 9];
        samples[4 * 91] = 1.0;
        let grid = Grid::new([9, 9, 9], Samples::F32(samples)).unwrap();
        let transfer = [[0.0, 1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0, 0.5]];
        let scene = Scene::new(grid, TransferFunction::from_rows(&transfer).unwrap());
        let direction = DVec3::new(0.4, -0.7, 1.0).normalize();
        let right = direction.any_orthonormal_vector();
        let up = direction.cross(right);
        for kernel in [Kernel::Gaussian, Kernel::BSpline, Kernel::Tent] {
            let kernels = Kernels { kernel, model: Model::Density, ..Kernels::of_points() };
            let scene = scene.clone().with_kernels(kernels).unwrap();
            let lattice = Lattice::new(kernels);
            let step = 2.0 * lattice.extent(right).max(lattice.extent(up)) / f64::from(N - 1);
            let place = |i: u32| {
                let at = |i: u32| (f64::from(i) - 0.5 * f64::from(N - 1)) * step;
                right * at(i % N) + up * at(i / N)
            };
            let table: Vec<f64> = (0..N * N)
                .map(|i| {
                    let origin = DVec3::splat(4.0) + place(i) - direction * 20.0;
                    let pixel = reference::ray(&scene, origin, direction, ALL).unwrap();
                    -(-pixel[3]).ln_1p() / 0.5
                })
                .collect();
            let worst = (0..N * N).zip(&table).fold(0.0_f64, |worst, (i, cast)| {
                worst.max((lattice.line(place(i), direction, ALL) - cast).abs())
            });
            println!("{kernel:?}: {worst:e}");
            assert!(worst < 1e-13, "{kernel:?}: {worst:e}");
            // The mass of the footprint is that of the kernel.
            let mass: f64 = table.iter().sum::<f64>() * step * step;
            assert!((mass - 1.0).abs() < 4e-3, "{kernel:?}: {mass}");
        }
    }
}
