//! Polynomials on the unit interval: evaluation, change of interval, turning points and crossings of cubics, and
//! Gauss-Legendre rules.

use std::f64::consts::PI;

use crate::num;

/// Coefficients of a cubic, constant first.
pub(super) type Cubic = [f64; 4];

/// Evaluates the cubic.
pub(super) fn value(c: &Cubic, x: f64) -> f64 {
    ((c[3] * x + c[2]) * x + c[1]) * x + c[0]
}

/// Evaluates the slope.
pub(super) fn slope(c: &Cubic, x: f64) -> f64 {
    (3.0 * c[3] * x + 2.0 * c[2]) * x + c[1]
}

/// Integrates the cubic from 0 to x; the result is a quartic.
pub(super) fn integral(c: &Cubic, x: f64) -> f64 {
    x * (c[0] + x * (c[1] * (1.0 / 2.0) + x * (c[2] * (1.0 / 3.0) + x * (c[3] * (1.0 / 4.0)))))
}

/// Returns the same cubic over [start, start + width], reparametrised to [0, 1].
pub(super) fn part(c: &Cubic, start: f64, width: f64) -> Cubic {
    [
        value(c, start),
        slope(c, start) * width,
        (3.0 * c[3] * start + c[2]) * width * width,
        c[3] * width * width * width,
    ]
}

/// Returns the zeros of the slope inside (0, 1), ascending; NaN stands for "none".
///
/// Uses the form of the quadratic formula that never subtracts nearly equal numbers.
pub(super) fn turning_points(c: &Cubic) -> [f64; 2] {
    let scale = c[1].abs().max(c[2].abs()).max(c[3].abs());
    // Where the constant of the slope outweighs the rest, its zeros lie outside, also after rounding.
    if scale == 0.0 || 2.0 * c[2].abs() + 3.0 * c[3].abs() < 0.999 * c[1].abs() {
        return [f64::NAN; 2];
    }
    // a x^2 + 2 h x + b = 0, scaled so that the squares cannot overflow.
    let (a, h, b) = (3.0 * (c[3] / scale), c[2] / scale, c[1] / scale);
    let discriminant = h * h - a * b;
    if discriminant <= 0.0 {
        // A double zero is a saddle: the cubic is monotone there.
        return [f64::NAN; 2];
    }
    let q = -(h + discriminant.sqrt().copysign(h));
    // Divides only where the quotient may be inside.
    let inside = |a: f64, b: f64| {
        let x = if a.abs() < b.abs() { a / b } else { f64::NAN };
        if x > 0.0 { x } else { f64::NAN }
    };
    let (first, second) = (inside(q, a), inside(b, q));
    if first > second || first.is_nan() { [second, first] } else { [first, second] }
}

/// Returns the place in [low, high] where a monotone cubic takes a value between the values at the ends.
///
/// Takes Newton steps inside a shrinking bracket, and bisects otherwise.
///
/// # Accuracy
///
/// Accurate to the last bits of x where the slope is not small; elsewhere the value is reached up to
/// rounding.
pub(super) fn crossing(c: &Cubic, wanted: f64, low: f64, high: f64) -> f64 {
    let (mut low, mut high) = (low, high);
    let (at_low, at_high) = (value(c, low) - wanted, value(c, high) - wanted);
    let rising = at_high > at_low;
    let mut x = low + (high - low) * (at_low / (at_low - at_high));
    // 60 bisections of an interval inside [0, 1] leave less than its rounding.
    for _ in 0..60 {
        if !(x > low && x < high) {
            x = 0.5 * (low + high);
            if !(x > low && x < high) {
                break;
            }
        }
        let residual = value(c, x) - wanted;
        if residual == 0.0 {
            break;
        }
        if (residual > 0.0) == rising {
            high = x;
        } else {
            low = x;
        }
        let newton = x - residual / slope(c, x);
        if (newton - x).abs() <= f64::EPSILON * x {
            break;
        }
        // Take a Newton step only where it at least halves the larger side; otherwise bisect.
        x = if newton > low && newton < high && (newton - x).abs() < 0.5 * (high - low) {
            newton
        } else {
            0.5 * (low + high)
        };
    }
    x
}

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

    /// (x - p)(x - q)(x - r) k.
    fn from_roots(k: f64, p: f64, q: f64, r: f64) -> Cubic {
        [-k * p * q * r, k * (p * q + p * r + q * r), -k * (p + q + r), k]
    }

    #[test]
    fn finds_all_three_crossings_between_turning_points() {
        let roots = [0.1, 0.35, 0.9];
        for k in [3.0, -1e-3, 1e200] {
            let c = from_roots(k, roots[0], roots[1], roots[2]);
            let [a, b] = turning_points(&c);
            assert!(a > 0.1 && a < 0.35 && b > 0.35 && b < 0.9, "{a} {b}");
            for (root, low, high) in [(0.1, 0.0, a), (0.35, a, b), (0.9, b, 1.0)] {
                let found = crossing(&c, 0.0, low, high);
                assert!((found - root).abs() < 4e-15, "k {k}: {found} instead of {root}");
            }
        }
    }

    #[test]
    fn turning_points_of_degenerate_cubics() {
        let none = |c: Cubic| turning_points(&c).iter().all(|x| x.is_nan());
        assert!(none([1.0, 0.0, 0.0, 0.0]), "constant");
        assert!(none([1.0, 2.0, 0.0, 0.0]), "linear");
        assert!(none(from_roots(1.0, 0.5, 0.5, 0.5)), "saddle");
        let [x, other] = turning_points(&[0.0, -1.0, 1.0, 0.0]);
        assert!((x - 0.5).abs() < 1e-16 && other.is_nan(), "parabola");
        assert!(none([0.0, 0.0, -1.5, 1.0]), "zeros of the slope at both ends are not inside");
        // Nearly linear: one far zero, one just inside, without cancellation.
        let [x, _] = turning_points(&[0.0, -1e-9, 1.0, 1e-12]);
        assert!((x - 5e-10).abs() < 1e-20, "{x}");
    }

    #[test]
    fn crossing_of_a_flat_cubic_meets_the_value() {
        // (x - 1/2)^3 has slope 0 at its root: Newton's method converges slowly, the bracket does not.
        let c = from_roots(1.0, 0.5, 0.5, 0.5);
        let x = crossing(&c, 0.0, 0.0, 1.0);
        assert!(value(&c, x).abs() < 1e-16, "{x}");
        let x = crossing(&c, 1e-9, 0.0, 1.0);
        assert!((x - 0.501).abs() < 1e-9, "{x}");
    }

    #[test]
    fn a_part_is_the_same_cubic() {
        let c = [0.3, -1.0, 2.0, 0.7];
        let p = part(&c, 0.25, 0.5);
        for i in 0..=8 {
            let y = f64::from(i) / 8.0;
            assert!((value(&p, y) - value(&c, 0.25 + 0.5 * y)).abs() < 1e-15);
        }
        let whole = integral(&c, 0.75) - integral(&c, 0.25);
        assert!((0.5 * integral(&p, 1.0) - whole).abs() < 1e-15);
    }

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
