//! Kernels of one coordinate, and the line integrals of kernels.

use std::f64::consts::PI;

use glam::DVec3;

use crate::scene::{Kernel, Kernels};

/// A kernel on a lattice, in index space.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    kernels: Kernels,
    /// Quadrature rule that is exact between two planes of samples.
    rule: Vec<(f64, f64)>,
}

impl Lattice {
    /// Prepares a kernel; its model has no effect.
    pub(super) fn new(kernels: Kernels) -> Self {
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
    pub(super) fn at(&self, offset: DVec3) -> f64 {
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
    pub(super) fn line(&self, start: DVec3, slope: DVec3, range: [f64; 2]) -> f64 {
        if self.kernels.kernel == Kernel::Gaussian {
            let Kernels { sigma, cut, .. } = self.kernels;
            return self.kernels.peak_on_grid() * gaussian(start / sigma, slope / sigma, cut, range);
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

/// Integrates a Gaussian of peak 1 along `start + slope u` over `range` of u.
///
/// `start` and `slope` are relative to the centre, in standard deviations. `cut` and the ends of the range may
/// be infinite. The result is `sqrt(pi / 2) exp(-b² / 2) (erf(v1 / sqrt 2) - erf(v0 / sqrt 2)) / |slope|`,
/// where b is the least distance and v is measured from the nearest point.
fn gaussian(start: DVec3, slope: DVec3, cut: f64, range: [f64; 2]) -> f64 {
    let speed = slope.length();
    let middle = -start.dot(slope) / (speed * speed);
    // The residual keeps the digits that `|start|²` minus the square of the projection loses far away.
    let nearest = (start + slope * middle).length_squared();
    let half = (cut * cut - nearest).max(0.0).sqrt();
    let [from, to] = range.map(|u| ((u - middle) * speed).clamp(-half, half));
    let root = 0.5_f64.sqrt();
    if from < to {
        (0.5 * PI).sqrt() * (-0.5 * nearest).exp() * (erf(to * root) - erf(from * root)) / speed
    } else {
        0.0
    }
}

/// Returns `2 / sqrt(pi) ∫ exp(-t²) dt` from 0 to x, accurate to 5e-16; NaN for NaN.
///
/// Below 2 it sums the series of Kummer's function, whose terms are all positive; above, it evaluates the
/// continued fraction of the complement (Abramowitz and Stegun 1964, 7.1.6 and 7.1.14).
pub(super) fn erf(x: f64) -> f64 {
    let y = x.abs();
    if y < 2.0 {
        let square = x * x;
        let (mut term, mut sum, mut n) = (x, x, 1.0);
        // At 2 the terms fall below rounding after 40 iterations.
        for _ in 0..48 {
            n += 2.0;
            term *= 2.0 * square / n;
            sum += term;
        }
        2.0 / PI.sqrt() * (-square).exp() * sum
    } else if y < 6.0 {
        let mut tail = y;
        // From the innermost level outwards: 70 levels are enough at 2.
        for k in (1..=70).rev() {
            tail = y + 0.5 * f64::from(k) / tail;
        }
        (1.0 - (-y * y).exp() / (tail * PI.sqrt())).copysign(x)
    } else if y.is_nan() {
        x
    } else {
        1.0_f64.copysign(x)
    }
}

/// Returns the cubic B-spline of unit mass.
pub(super) fn cubic(x: f64) -> f64 {
    let x = x.abs();
    if x < 1.0 { 2.0 / 3.0 + x * x * (0.5 * x - 1.0) } else { (2.0 - x).max(0.0).powi(3) / 6.0 }
}

/// Returns the sinc with Lanczos' window of three lobes.
pub(super) fn lanczos(x: f64) -> f64 {
    let sinc = |x: f64| if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
    if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 }
}

/// Returns nodes and weights of the Gauss-Legendre rule on the unit interval, exact for polynomials of degree
/// `2 points - 1`.
///
/// Newton's method on Legendre's recurrence finds the nodes, from Tricomi's estimates.
pub(super) fn rule(points: u32) -> Vec<(f64, f64)> {
    let n = f64::from(points);
    (1..=points)
        .map(|i| {
            let mut x = -(PI * (f64::from(i) - 0.25) / (n + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..10 {
                let [mut p, mut before] = [1.0, 0.0];
                for k in 0..points {
                    let k = f64::from(k);
                    [p, before] = [((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0), p];
                }
                slope = n * (before - x * p) / (1.0 - x * x);
                x -= p / slope;
            }
            (0.5 + 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
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
    fn gaussians_are_the_integrals_of_their_shape() {
        let mut random = Random(1);
        for i in 0..60 {
            let square = if i < 4 { [0.0, 1.0, 4.0, 1e-20][i] } else { 2.2 * (1.0 + random.next()) };
            let (middle, speed) = (random.next(), 1.5 + random.next());
            let start = DVec3::new(-middle * speed, f64::sqrt(square), 0.0);
            let slope = DVec3::X * speed;
            let range = [random.next() - 0.5, random.next() + 0.8];
            let v = |u: f64| (square + ((u - middle) * speed).powi(2)).sqrt();
            // Split where the shapes change.
            let cuts = |support: f64| {
                let mut cuts = vec![range[0], range[1]];
                for distance in [0.0, 1.0, support] {
                    let half = (distance * distance - square).max(0.0).sqrt() / speed;
                    cuts.extend([middle - half, middle + half]);
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
                assert_eq!(gaussian(start, slope, f64::INFINITY, range), 0.0);
                continue;
            }
            for cut in [1.8, 3.0, f64::INFINITY] {
                let want = numeric(&|u| (-0.5 * v(u) * v(u)).exp(), cut);
                let error = gaussian(start, slope, cut, range) - want;
                assert!(error.abs() < 1e-11, "cut at {cut}, {start} + {slope} u, {range:?}: {error:e}");
            }
        }
        // The whole chord through the centre.
        let whole = gaussian(DVec3::X * 1e6, DVec3::X * -3.0, f64::INFINITY, ALL);
        assert!((whole - (2.0 * PI).sqrt() / 3.0).abs() < 1e-15);
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

    #[test]
    fn known_values() {
        let known = [
            (0.0, 0.0),
            (1e-10, 1.128_379_167_095_512_6e-10),
            (0.1, 0.112_462_916_018_284_9),
            (0.5, 0.520_499_877_813_046_5),
            (0.84, 0.765_142_711_454_994_6),
            (1.0, 0.842_700_792_949_714_9),
            (1.5, 0.966_105_146_475_310_8),
            (1.99, 0.995_111_413_199_617),
            (2.0, 0.995_322_265_018_952_7),
            (2.01, 0.995_524_849_355_248_2),
            (2.5, 0.999_593_047_982_555),
            (3.0, 0.999_977_909_503_001_4),
            (3.5, 0.999_999_256_901_627_6),
            (4.2, 0.999_999_997_144_505_8),
            (5.0, 0.999_999_999_998_462_6),
            (5.9, 0.999_999_999_999_999_9),
            (f64::INFINITY, 1.0),
        ];
        let mut worst = 0.0_f64;
        for (x, value) in known {
            for (got, want) in [(erf(x), value), (erf(-x), -value)] {
                let error = (got - want).abs();
                worst = worst.max(error);
                assert!(error <= 5e-16 && error <= 1e-15 * value.abs(), "erf({x}): {got} instead of {want}");
            }
        }
        println!("{worst:e}");
        assert!(erf(f64::NAN).is_nan());
    }

    #[test]
    fn rises_across_the_switches() {
        for switch in [2.0_f64, 6.0] {
            assert!((erf(switch) - erf(switch.next_down())).abs() < 1e-15, "{switch}");
        }
        for i in 0..1500 {
            let x = f64::from(i) * 0.004;
            assert!(erf(x + 0.004) >= erf(x), "{x}");
        }
    }

    #[test]
    fn rules_are_exact_up_to_their_degree() {
        for points in [2, 5, 16] {
            for degree in 0..2 * points {
                let sum: f64 = rule(points).iter().map(|(x, w)| w * x.powi(degree.try_into().unwrap())).sum();
                let error = sum * f64::from(degree + 1) - 1.0;
                assert!(error.abs() < 2e-14, "{points} points, degree {degree}: {error:e}");
            }
        }
    }
}
