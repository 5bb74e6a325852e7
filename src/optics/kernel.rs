//! Kernels in float64: shapes, line integrals (footprints), and how flat their sum on a lattice is.
//!
//! A kernel on a lattice lives in index space, where samples are one unit apart; its reach and its peak are those of
//! [`crate::scene::Kernels`]. Shares no code with the reference.
//!
//! # How kernels treat a signal
//!
//! Share of a wave that is left, at a quarter of the sampling rate (0.25 cycles for each voxel, along an axis): see
//! [`response`].
//!
//! | kernel | share left |
//! |---|---|
//! | Gaussian, sigma 0.5 / 0.6 / 0.7 voxels | 0.73 / 0.64 / 0.55 |
//! | tent | 0.81 |
//! | cubic B-spline, without prefilter | 0.66 |
//! | cubic B-spline, prefiltered | 0.99 |
//! | Lanczos-3 | 1.01 |
//!
//! Tents and B-splines sum to one exactly. Gaussians do not, see [`ripple`] and [`deviation`].

mod erf;
mod footprint;
mod prefilter;
mod template;

pub(crate) use erf::erf;
pub(crate) use footprint::{Chord, Lattice, gaussian, spline};
pub(crate) use prefilter::prefilter;
pub(crate) use template::Template;

use std::f64::consts::PI;

use crate::num;
use crate::scene::Kernel;

/// The cubic B-spline of unit mass.
pub(crate) fn cubic(x: f64) -> f64 {
    let x = x.abs();
    if x < 1.0 { 2.0 / 3.0 + x * x * (0.5 * x - 1.0) } else { (2.0 - x).max(0.0).powi(3) / 6.0 }
}

/// Lanczos' window of three lobes on the sinc.
pub(crate) fn lanczos(x: f64) -> f64 {
    let sinc = |x: f64| if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
    if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 }
}

/// Share of a wave along an axis that a sum of kernels keeps, at `frequency` cycles for each voxel: the kernel's
/// Fourier transform, 1 for a constant but for Lanczos (0.997). `sigma` is a Gaussian's, which is taken as not cut.
pub(crate) fn response(kernel: Kernel, sigma: f64, frequency: f64) -> f64 {
    let x = PI * frequency;
    let sinc = if x.abs() < 1e-9 { 1.0 } else { x.sin() / x };
    match kernel {
        Kernel::Gaussian => (-2.0 * (x * sigma).powi(2)).exp(),
        Kernel::Tent => sinc.powi(2),
        Kernel::BSpline => sinc.powi(4),
        // Both halves, a lobe each by the rule of 16 points, which is exact for some cycles in a lobe.
        Kernel::Sinc => {
            let pieces = 3.0 + (6.0 * frequency.abs()).ceil().min(1e6);
            let width = 3.0 / pieces;
            let rule = footprint::rule(16);
            let mut sum = 0.0;
            for piece in 0..num::u32_of(pieces) {
                for (node, weight) in &rule {
                    let t = (f64::from(piece) + node) * width;
                    sum += 2.0 * width * weight * lanczos(t) * (2.0 * x * t).cos();
                }
            }
            sum
        }
    }
}

/// Largest deviation from 1 of the sum of Gaussians of unit weight at the points of a lattice, in three dimensions,
/// not cut: `(1 + r)³ - 1` with `r = 2 Σ exp(-2 π² sigma² k²)` (Poisson's summation formula), where the place is a
/// sample. `sigma` in voxels.
///
/// | sigma | 0.4 | 0.5 | 0.6 | 0.7 | 0.8 | 1.0 |
/// |---|---|---|---|---|---|---|
/// | ripple | 0.28 | 4.4e-2 | 4.9e-3 | 3.8e-4 | 2.0e-5 | 1.6e-8 |
pub(crate) fn ripple(sigma: f64) -> f64 {
    let r: f64 = (1..=40).map(|k| 2.0 * (-2.0 * (PI * sigma * f64::from(k)).powi(2)).exp()).sum();
    r * (3.0 + r * (3.0 + r))
}

/// The sum of cut Gaussians on a lattice, whose weights are 1 before they are cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Deviation {
    /// Least sum, less 1.
    pub(crate) low: f64,
    /// Largest sum, less 1.
    pub(crate) high: f64,
    /// Mean of the sum, less 1: what is cut off, as a share.
    pub(crate) mean: f64,
}

impl Deviation {
    /// Largest deviation from 1: error of a homogeneous field's extinction.
    pub(crate) fn largest(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// Largest deviation from 1 where kernels are scaled such that the mean is 1.
    pub(crate) fn scaled(self) -> f64 {
        (self.high - self.mean).max(self.mean - self.low) / (1.0 + self.mean)
    }
}

/// The sum of Gaussians on a lattice, cut at `cut` standard deviations, over 969 places of a cell. `sigma` in voxels.
/// Beyond a reach of 8 voxels its mean.
///
/// Largest deviation from 1, and that which scaling leaves, where the cut is at a radius in voxels:
///
/// | sigma | 2 | 2.5 | 3 |
/// |---|---|---|---|
/// | 0.5 | 4.4e-2, 4.4e-2 | 4.4e-2, 4.4e-2 | 4.4e-2, 4.4e-2 |
/// | 0.6 | 1.7e-2, 7.8e-3 | 5.9e-3, 5.5e-3 | 4.9e-3, 4.9e-3 |
/// | 0.7 | 6.0e-2, 1.9e-2 | 9.1e-3, 4.3e-3 | 7.7e-4, 5.1e-4 |
/// | 0.8 | 0.13, 3.7e-2 | 3.2e-2, 1.3e-2 | 4.2e-3, 1.8e-3 |
/// | 1.0 | 0.31, 7.5e-2 | 0.13, 4.7e-2 | 3.7e-2, 1.4e-2 |
pub(crate) fn deviation(sigma: f64, cut: f64) -> Deviation {
    // A closed ball, whatever rounding does to its radius.
    let reach = sigma * cut * (1.0 + 1e-12);
    let mean = erf(cut / 2.0_f64.sqrt()) - (2.0 / PI).sqrt() * cut * (-0.5 * cut * cut).exp() - 1.0;
    if reach > 8.0 {
        return Deviation { low: mean, high: mean, mean };
    }
    const PLACES: i32 = 16;
    let place = |i: i32| f64::from(i) / f64::from(2 * PLACES);
    let around = -9..=10;
    let peak = (sigma * (2.0 * PI).sqrt()).powi(-3);
    let mut found = Deviation { low: f64::INFINITY, high: f64::NEG_INFINITY, mean };
    for i in 0..=PLACES {
        for j in 0..=i {
            for k in 0..=j {
                let mut sum = 0.0;
                for x in around.clone().map(|x| f64::from(x) - place(i)).filter(|x| x.abs() <= reach) {
                    for y in around.clone().map(|y| f64::from(y) - place(j)) {
                        let rest = reach * reach - x * x - y * y;
                        if rest < 0.0 {
                            continue;
                        }
                        let column =
                            around.clone().map(|z| f64::from(z) - place(k)).filter(|z| z * z <= rest);
                        let scale = -0.5 / (sigma * sigma);
                        sum += column.map(|z| (scale * (x * x + y * y + z * z)).exp()).sum::<f64>();
                    }
                }
                found.low = found.low.min(peak * sum - 1.0);
                found.high = found.high.max(peak * sum - 1.0);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn responses_are_the_known_ones() {
        let at = |kernel, sigma| response(kernel, sigma, 0.25);
        for (sigma, share) in [(0.4, 0.82), (0.5, 0.735), (0.6, 0.64), (0.7, 0.55)] {
            assert!((at(Kernel::Gaussian, sigma) - share).abs() < 6e-3, "{sigma}");
        }
        assert!((at(Kernel::Tent, 1.0) - 0.810_569_469_138_702).abs() < 1e-14);
        assert!((at(Kernel::BSpline, 1.0) - 0.657_022_864_299_797).abs() < 1e-14);
        // A prefiltered spline: by the samples' own (4 + 2 cos) / 6.
        assert!((at(Kernel::BSpline, 1.0) * 6.0 / 4.0 - 0.9855).abs() < 1e-4);
        let lanczos = at(Kernel::Sinc, 1.0);
        assert!((lanczos - 1.0084).abs() < 1e-4, "{lanczos}");
        // The transforms are those of the kernels, by a plain sum.
        for kernel in [Kernel::Tent, Kernel::BSpline, Kernel::Sinc] {
            for frequency in [0.0, 0.25, 0.5, 1.3] {
                let n = 60_000;
                let sum: f64 = (0..n)
                    .map(|i| {
                        let x = (f64::from(i) + 0.5) * 6.0 / f64::from(n) - 3.0;
                        let k = match kernel {
                            Kernel::Tent => (1.0 - x.abs()).max(0.0),
                            Kernel::BSpline => cubic(x),
                            _ => super::lanczos(x),
                        };
                        k * (2.0 * PI * frequency * x).cos() * 6.0 / f64::from(n)
                    })
                    .sum();
                let error = (sum - response(kernel, 1.0, frequency)).abs();
                assert!(error < 2e-8, "{kernel:?} at {frequency}: {error:e}");
            }
        }
        assert!((response(Kernel::Sinc, 1.0, 0.0) - 0.997).abs() < 1e-3);
    }

    #[test]
    fn ripples_are_the_known_ones() {
        let table =
            [(0.4, 2.8e-1), (0.5, 4.4e-2), (0.6, 4.9e-3), (0.7, 3.8e-4), (0.8, 2.0e-5), (1.0, 1.6e-8)];
        for (sigma, known) in table {
            assert!((ripple(sigma) / known - 1.0).abs() < 0.03, "{sigma}: {:e}", ripple(sigma));
            // What is left of the sum when Gaussians are hardly cut.
            if sigma > 0.45 && sigma < 0.75 {
                let high = deviation(sigma, 6.0).high;
                assert!((high / ripple(sigma) - 1.0).abs() < 1e-2, "{sigma}: {high:e}");
            }
        }
    }

    /// Against the table for cuts at 2, 2.5 and 3 voxels that is known where they are scaled.
    #[test]
    fn cut_gaussians_deviate_as_known() {
        let table = [
            (0.5, [4.4e-2, 4.4e-2, 4.4e-2], [4.4e-2, 4.4e-2, 4.4e-2]),
            (0.6, [7.8e-3, 5.5e-3, 4.9e-3], [1.7e-2, 5.9e-3, 4.9e-3]),
            (0.7, [1.9e-2, 4.3e-3, 5.1e-4], [6.0e-2, 9.1e-3, 7.7e-4]),
            (0.8, [3.7e-2, 1.3e-2, 1.8e-3], [0.13, 3.2e-2, 4.2e-3]),
            (1.0, [7.5e-2, 4.7e-2, 1.4e-2], [0.31, 0.13, 3.7e-2]),
        ];
        for (sigma, scaled, largest) in table {
            for ((radius, scaled), largest) in [2.0, 2.5, 3.0].into_iter().zip(scaled).zip(largest) {
                let found = deviation(sigma, radius / sigma);
                println!("sigma {sigma}, cut at {radius}: {:.2e} {:.2e}", found.largest(), found.scaled());
                assert!((found.scaled() / scaled - 1.0).abs() < 0.1, "sigma {sigma}, {radius}: {found:?}");
                assert!((found.largest() / largest - 1.0).abs() < 0.1, "sigma {sigma}, {radius}: {found:?}");
            }
        }
        // Wide Gaussians: the mass beyond the cut. The two sides of the switch agree.
        let (near, far) = (deviation(3.9, 2.0), deviation(4.1, 2.0));
        assert!((near.largest() - far.largest()).abs() < 0.02, "{near:?} {far:?}");
    }
}
