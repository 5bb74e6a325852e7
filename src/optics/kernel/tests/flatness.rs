//! The deviation from a constant of a sum of Gaussians on a lattice.

use std::f64::consts::PI;

use super::super::footprint::erf;

/// Returns the largest deviation from 1 of the sum of uncut Gaussians of unit weight on a lattice in three
/// dimensions.
///
/// The largest deviation is at the samples: `(1 + r)³ - 1` with `r = 2 Σ exp(-2 π² sigma² k²)` (Poisson's
/// summation formula). `sigma` is in voxels.
///
/// | sigma | 0.4 | 0.5 | 0.6 | 0.7 | 0.8 | 1.0 |
/// |---|---|---|---|---|---|---|
/// | ripple | 0.28 | 4.4e-2 | 4.9e-3 | 3.8e-4 | 2.0e-5 | 1.6e-8 |
fn ripple(sigma: f64) -> f64 {
    let r: f64 = (1..=40).map(|k| 2.0 * (-2.0 * (PI * sigma * f64::from(k)).powi(2)).exp()).sum();
    r * (3.0 + r * (3.0 + r))
}

/// The sum of cut Gaussians on a lattice, each of weight 1 before the cut.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Deviation {
    /// Smallest sum, minus 1.
    low: f64,
    /// Largest sum, minus 1.
    high: f64,
    /// Mean of the sum, minus 1: the share that the cut removes, negative.
    mean: f64,
}

impl Deviation {
    /// Returns the largest deviation from 1: the relative error of a homogeneous field's extinction.
    fn largest(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// Returns the largest deviation from 1 after the kernels are scaled to a mean of 1.
    fn scaled(self) -> f64 {
        (self.high - self.mean).max(self.mean - self.low) / (1.0 + self.mean)
    }
}

/// Measures the sum of Gaussians on a lattice, cut at `cut` standard deviations, at 969 places of a cell.
///
/// `sigma` is in voxels. If the kernels reach farther than 8 voxels, the deviation is that of the mean. The
/// table shows the largest deviation from 1 without and with scaling, for cuts at a radius in voxels:
///
/// | sigma | 2 | 2.5 | 3 |
/// |---|---|---|---|
/// | 0.5 | 4.4e-2, 4.4e-2 | 4.4e-2, 4.4e-2 | 4.4e-2, 4.4e-2 |
/// | 0.6 | 1.7e-2, 7.8e-3 | 5.9e-3, 5.5e-3 | 4.9e-3, 4.9e-3 |
/// | 0.7 | 6.0e-2, 1.9e-2 | 9.1e-3, 4.3e-3 | 7.7e-4, 5.1e-4 |
/// | 0.8 | 0.13, 3.7e-2 | 3.2e-2, 1.3e-2 | 4.2e-3, 1.8e-3 |
/// | 1.0 | 0.31, 7.5e-2 | 0.13, 4.7e-2 | 3.7e-2, 1.4e-2 |
fn deviation(sigma: f64, cut: f64) -> Deviation {
    // A closed ball, whatever the rounding of its radius.
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

#[test]
fn ripples_are_the_known_ones() {
    let table = [(0.4, 2.8e-1), (0.5, 4.4e-2), (0.6, 4.9e-3), (0.7, 3.8e-4), (0.8, 2.0e-5), (1.0, 1.6e-8)];
    for (sigma, known) in table {
        assert!((ripple(sigma) / known - 1.0).abs() < 0.03, "{sigma}: {:e}", ripple(sigma));
        // With hardly any cut, the deviation is the ripple.
        if sigma > 0.45 && sigma < 0.75 {
            let high = deviation(sigma, 6.0).high;
            assert!((high / ripple(sigma) - 1.0).abs() < 1e-2, "{sigma}: {high:e}");
        }
    }
}

/// Known values for cuts at 2, 2.5 and 3 voxels, without and with scaling.
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
    // Wide Gaussians deviate by the mass beyond the cut. Both sides of the switch agree.
    let (near, far) = (deviation(3.9, 2.0), deviation(4.1, 2.0));
    assert!((near.largest() - far.largest()).abs() < 0.02, "{near:?} {far:?}");
}
