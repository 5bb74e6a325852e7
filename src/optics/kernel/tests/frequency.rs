//! Frequency responses of kernels.
//!
//! Share of a wave's amplitude that remains at a quarter of the sampling rate (0.25 cycles per voxel, along
//! an axis):
//!
//! | kernel | remaining share |
//! |---|---|
//! | Gaussian, sigma 0.5 / 0.6 / 0.7 voxels | 0.73 / 0.64 / 0.55 |
//! | tent | 0.81 |
//! | cubic B-spline, without prefilter | 0.66 |
//! | cubic B-spline, prefiltered | 0.99 |
//! | Lanczos-3 | 1.01 |

use std::f64::consts::PI;

use super::super::footprint::{self, cubic, lanczos};
use crate::num;
use crate::scene::Kernel;

/// Returns the share of a wave's amplitude along an axis that a sum of kernels keeps, at `frequency` cycles
/// per voxel.
///
/// This is the kernel's Fourier transform: 1 for a constant, or 0.997 for Lanczos. `sigma` is that of an
/// uncut Gaussian.
fn response(kernel: Kernel, sigma: f64, frequency: f64) -> f64 {
    let x = PI * frequency;
    let sinc = if x.abs() < 1e-9 { 1.0 } else { x.sin() / x };
    match kernel {
        Kernel::Gaussian => (-2.0 * (x * sigma).powi(2)).exp(),
        Kernel::Tent => sinc.powi(2),
        Kernel::BSpline => sinc.powi(4),
        // Twice one half of the kernel. The 16-point rule is exact for a few cycles per piece, so the number
        // of pieces grows with the frequency.
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

#[test]
fn responses_are_the_known_ones() {
    let at = |kernel, sigma| response(kernel, sigma, 0.25);
    for (sigma, share) in [(0.4, 0.82), (0.5, 0.735), (0.6, 0.64), (0.7, 0.55)] {
        assert!((at(Kernel::Gaussian, sigma) - share).abs() < 6e-3, "{sigma}");
    }
    assert!((at(Kernel::Tent, 1.0) - 0.810_569_469_138_702).abs() < 1e-14);
    assert!((at(Kernel::BSpline, 1.0) - 0.657_022_864_299_797).abs() < 1e-14);
    // A prefiltered spline also divides by the response at the samples, (4 + 2 cos) / 6.
    assert!((at(Kernel::BSpline, 1.0) * 6.0 / 4.0 - 0.9855).abs() < 1e-4);
    let lanczos = at(Kernel::Sinc, 1.0);
    assert!((lanczos - 1.0084).abs() < 1e-4, "{lanczos}");
    // The responses are the transforms of the kernels, by a plain sum.
    for kernel in [Kernel::Tent, Kernel::BSpline, Kernel::Sinc] {
        for frequency in [0.0, 0.25, 0.5, 1.3] {
            let n = 60_000;
            let sum: f64 = (0..n)
                .map(|i| {
                    let x = (f64::from(i) + 0.5) * 6.0 / f64::from(n) - 3.0;
                    let k = match kernel {
                        Kernel::Tent => (1.0 - x.abs()).max(0.0),
                        Kernel::BSpline => cubic(x),
                        _ => footprint::lanczos(x),
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
