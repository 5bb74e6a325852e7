//! Gauss-Legendre rules on the unit interval.

use std::f64::consts::PI;

use crate::num;

/// A node in (0, 1) and its weight; the weights sum to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Position in (0, 1).
    pub(super) x: f64,
    /// Weight.
    pub(super) weight: f64,
}

/// Returns the Gauss-Legendre rule with a number of points, exact for polynomials of degree `2 points - 1`.
///
/// Newton's method finds the zeros of the Legendre polynomial from their asymptotic positions; the three-term
/// recurrence evaluates the polynomial.
pub(super) fn gauss_legendre(points: usize) -> Vec<Node> {
    let n = num::f64_of(points);
    (0..points)
        .map(|i| {
            let mut x = (PI * (num::f64_of(i) + 0.75) / (n + 0.5)).cos();
            let mut derivative = 1.0;
            // Convergence is quadratic from a start that is accurate to 1e-2: five steps reach rounding.
            for _ in 0..8 {
                let (mut previous, mut current) = (1.0, x);
                for k in 2..=points {
                    let k = num::f64_of(k);
                    (previous, current) =
                        (current, ((2.0 * k - 1.0) * x * current - (k - 1.0) * previous) / k);
                }
                derivative = n * (x * current - previous) / (x * x - 1.0);
                x -= current / derivative;
            }
            Node { x: 0.5 * (1.0 - x), weight: 1.0 / ((1.0 - x * x) * derivative * derivative) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_up_to_the_stated_degree_and_not_beyond() {
        for points in [2, 5, 8, 12] {
            let rule = gauss_legendre(points);
            let error = |degree: usize| {
                let sum: f64 = rule.iter().map(|n| n.weight * n.x.powi(i32::try_from(degree).unwrap())).sum();
                (sum * num::f64_of(degree + 1) - 1.0).abs()
            };
            for degree in 0..2 * points {
                assert!(error(degree) < 2e-14, "{points} points, degree {degree}: {:e}", error(degree));
            }
            assert!(error(2 * points) > 1e-13, "{points} points: {:e}", error(2 * points));
        }
    }
}
