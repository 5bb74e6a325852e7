//! Exact signs of determinants, so that rounding never decides which of two primitives is in front.
//!
//! The determinant is computed in float64 with an error bound first. Where the bound leaves the sign open, it
//! is summed exactly as an expansion (Shewchuk 1997, Adaptive Precision Floating-Point Arithmetic).

use std::cmp::Ordering;

use glam::DVec3;

/// A vector as the difference of two positions, `[to, from]`, which float64 may not represent exactly.
pub(crate) type Span = [DVec3; 2];

/// Returns a direction as a span.
pub(crate) fn along(direction: DVec3) -> Span {
    [direction, DVec3::ZERO]
}

/// Returns the sign of det[u, v, w].
///
/// Exact unless products of three components leave the range of float64 after each vector was scaled to about
/// 1.
pub(crate) fn sign(rows: [Span; 3]) -> Ordering {
    certain(rows.map(|[to, from]| to - from)).unwrap_or_else(|| exact(rows))
}

/// Returns the sign of det[u, v, w] where float64 is certain of it.
pub(super) fn certain([u, v, w]: [DVec3; 3]) -> Option<Ordering> {
    let (vw, wv) = (v * DVec3::new(w.y, w.z, w.x), w * DVec3::new(v.y, v.z, v.x));
    // Components of v x w: x from (y, z), y from (z, x), z from (x, y).
    let cross = vw - wv;
    let determinant = u.x * cross.y + u.y * cross.z + u.z * cross.x;
    let sizes = vw.abs() + wv.abs();
    let magnitude = u.x.abs() * sizes.y + u.y.abs() * sizes.z + u.z.abs() * sizes.x;
    // Bound A of orient3d. Directions have no rounding of differences, so the bound holds for them too.
    const EPSILON: f64 = f64::EPSILON / 2.0;
    const BOUND: f64 = (7.0 + 56.0 * EPSILON) * EPSILON;
    determinant.partial_cmp(&0.0).filter(|_| determinant.abs() > BOUND * magnitude)
}

/// Returns the sign by exact arithmetic.
#[cold]
fn exact(rows: [Span; 3]) -> Ordering {
    let [u, v, w] = rows.map(scaled);
    let mut sum = Expansion { parts: [0.0; 192], len: 0 };
    for (i, j, k, positive) in [
        (0, 1, 2, true),
        (1, 2, 0, true),
        (2, 0, 1, true),
        (0, 2, 1, false),
        (1, 0, 2, false),
        (2, 1, 0, false),
    ] {
        for a in parts(u[i]) {
            for b in parts(v[j]) {
                let product = two_product(a, b);
                for c in parts(w[k]) {
                    for term in parts(product) {
                        for part in parts(two_product(term, c)) {
                            sum.add(if positive { part } else { -part });
                        }
                    }
                }
            }
        }
    }
    sum.sign()
}

/// Returns the components of a span, each as an unevaluated sum of two, times a power of two that brings the
/// largest to about 1.
fn scaled([to, from]: Span) -> [[f64; 2]; 3] {
    let exponent = (to - from).abs().max_element().to_bits() >> 52;
    let factor = if (1..2046).contains(&exponent) { f64::from_bits((2046 - exponent) << 52) } else { 1.0 };
    let (to, from) = (to.to_array(), from.to_array());
    [0, 1, 2].map(|i| two_sum(to[i], -from[i]).map(|part| part * factor))
}

/// Returns the rounded sum a + b and its error.
fn two_sum(a: f64, b: f64) -> [f64; 2] {
    let sum = a + b;
    let b_part = sum - a;
    [sum, (a - (sum - b_part)) + (b - b_part)]
}

/// Returns the rounded product a b and its error.
fn two_product(a: f64, b: f64) -> [f64; 2] {
    let product = a * b;
    [product, a.mul_add(b, -product)]
}

/// Returns the parts of an unevaluated sum that are not zero.
fn parts(sum: [f64; 2]) -> impl Iterator<Item = f64> {
    sum.into_iter().filter(|&part| part != 0.0)
}

/// An exact sum of float64 numbers: ascending parts that do not overlap, none of them zero.
struct Expansion {
    /// Capacity: six products of three sums of two, with four parts each.
    parts: [f64; 192],
    len: usize,
}

impl Expansion {
    fn add(&mut self, term: f64) {
        let mut carry = term;
        let mut kept = 0;
        for i in 0..self.len {
            let [sum, error] = two_sum(carry, self.parts[i]);
            carry = sum;
            if error != 0.0 {
                self.parts[kept] = error;
                kept += 1;
            }
        }
        if carry != 0.0 {
            self.parts[kept] = carry;
            kept += 1;
        }
        self.len = kept;
    }

    fn sign(&self) -> Ordering {
        let last = self.parts[..self.len].last();
        last.and_then(|last| last.partial_cmp(&0.0)).unwrap_or(Ordering::Equal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num;

    /// The sign of the determinant of multiples of 2^-36, in integers.
    fn truth(rows: [Span; 3]) -> Ordering {
        let [u, v, w] = rows.map(|[to, from]| {
            [0, 1, 2].map(|i| {
                let of = |v: DVec3| i128::from(num::u64_of((v.to_array()[i] + 64.0) * 2.0_f64.powi(36)));
                of(to) - of(from)
            })
        });
        let det = u[0] * (v[1] * w[2] - v[2] * w[1])
            + u[1] * (v[2] * w[0] - v[0] * w[2])
            + u[2] * (v[0] * w[1] - v[1] * w[0]);
        det.cmp(&0)
    }

    #[test]
    fn signs_are_those_of_integers() {
        let mut state = 1_u64;
        let mut next = |bits: u32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % (1 << bits)) as f64 - f64::from(1 << (bits - 1))
        };
        let (mut zeros, mut rounded) = (0, 0);
        for trial in 0..20_000 {
            // Small integers give zeros; the same moved by multiples of 2^-36 give values close to zero.
            let bits = 2 + trial % 3;
            let mut vector = || {
                let whole = DVec3::new(next(bits), next(bits), next(bits));
                let parts = DVec3::new(next(2), next(2), next(2)) * 2.0_f64.powi(-36);
                if trial % 2 == 0 { whole } else { whole + parts }
            };
            let from = vector();
            let rows = [[vector(), from], [vector(), from], [vector(), from]];
            assert_eq!(sign(rows), truth(rows), "{rows:?}");
            assert_eq!(exact(rows), truth(rows), "{rows:?}");
            zeros += usize::from(truth(rows).is_eq());
            let [u, v, w] = rows.map(|[to, from]| to - from);
            rounded += usize::from(u.cross(v).dot(w).total_cmp(&0.0) != truth(rows) && truth(rows).is_ne());
        }
        assert!(zeros > 100 && rounded > 10, "{zeros} {rounded}");
    }

    #[test]
    fn scale_does_not_matter() {
        for scale in [1e-200, 1e-30, 1.0, 1e30, 1e200] {
            let at = |x: f64, y: f64, z: f64| [DVec3::new(x, y, z) * scale, DVec3::ZERO];
            assert_eq!(exact([at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0), at(0.0, 0.0, 1.0)]), Ordering::Greater);
            assert_eq!(exact([at(0.0, 1.0, 0.0), at(1.0, 0.0, 0.0), at(0.0, 0.0, 1.0)]), Ordering::Less);
            assert_eq!(exact([at(1.0, 2.0, 3.0), at(2.0, 4.0, 6.0), at(0.0, 0.0, 1.0)]), Ordering::Equal);
        }
    }
}
