//! Gauss-Legendre quadrature.

use std::f64::consts::PI;

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
