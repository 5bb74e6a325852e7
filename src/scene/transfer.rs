//! Transfer functions: from a scalar to emitted colour and extinction.

use glam::DVec3;

use crate::error::{Error, Result};

/// A knot of a transfer function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot {
    /// Scalar, in the data's own units.
    pub s: f64,
    /// Emitted colour, linear RGB, not premultiplied.
    pub colour: DVec3,
    /// Extinction per unit of world length.
    pub tau: f64,
}

/// Emitted colour and extinction as functions of the scalar.
///
/// r, g, b and tau are each piecewise linear between knots and constant beyond the ends. Two knots with the
/// same `s` make a jump, where the later knot holds: the function is continuous from the right. Valid by
/// construction: there is at least one knot, `s` does not decrease, all numbers are finite, and only `s` may
/// be negative.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    knots: Vec<Knot>,
}

impl TransferFunction {
    /// Largest number of knots.
    pub const MAX_KNOTS: usize = 1 << 20;

    /// Checks the knots and makes a transfer function of them.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming the knot and the rule: at least one knot and at most [`Self::MAX_KNOTS`],
    /// `s` finite and non-decreasing, colour and tau finite and not negative.
    pub fn new(knots: Vec<Knot>) -> Result<Self> {
        let refuse = |why: String| Err(Error::invalid("transfer function", why));
        if knots.is_empty() || knots.len() > Self::MAX_KNOTS {
            return refuse(format!("{} knots: there must be 1 to {}", knots.len(), Self::MAX_KNOTS));
        }
        for (i, knot) in knots.iter().enumerate() {
            let Knot { s, colour, tau } = *knot;
            if !s.is_finite() {
                return refuse(format!("knot {i}: scalar {s} must be finite"));
            }
            if let Some(last) = i.checked_sub(1).filter(|&last| s < knots[last].s) {
                let below = format!("is below that of knot {last} ({})", knots[last].s);
                return refuse(format!("knot {i}: scalar {s} {below}: scalars must not decrease"));
            }
            if !(colour.is_finite() && colour.min_element() >= 0.0) {
                return refuse(format!("knot {i}: colour {colour} must be finite and not negative"));
            }
            if !(tau.is_finite() && tau >= 0.0) {
                return refuse(format!("knot {i}: extinction {tau} must be finite and not negative"));
            }
        }
        Ok(Self { knots })
    }

    /// Makes a transfer function from rows `[s, r, g, b, tau]`.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn from_rows(rows: &[[f64; 5]]) -> Result<Self> {
        let knot = |&[s, r, g, b, tau]: &[f64; 5]| Knot { s, colour: DVec3::new(r, g, b), tau };
        Self::new(rows.iter().map(knot).collect())
    }

    /// Returns the knots.
    #[must_use]
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// Returns the scalars of the first and the last knot.
    #[must_use]
    pub fn domain(&self) -> [f64; 2] {
        let ends = (self.knots.first(), self.knots.last());
        let (Some(first), Some(last)) = ends else { return [0.0, 0.0] };
        [first.s, last.s]
    }

    /// Returns colour and extinction at a scalar. NaN is vacuum.
    #[must_use]
    pub fn at(&self, s: f64) -> (DVec3, f64) {
        if s.is_nan() {
            return (DVec3::ZERO, 0.0);
        }
        // The last knot at or below s starts the piece that holds s.
        let below = self.knots.partition_point(|knot| knot.s <= s);
        let Some(start) = below.checked_sub(1) else {
            let first = &self.knots[0];
            return (first.colour, first.tau);
        };
        let a = &self.knots[start];
        let Some(b) = self.knots.get(below) else { return (a.colour, a.tau) };
        let w = (s - a.s) / (b.s - a.s);
        (a.colour + (b.colour - a.colour) * w, a.tau + (b.tau - a.tau) * w)
    }

    /// Returns the largest component of any knot's colour.
    #[must_use]
    pub fn max_colour(&self) -> f64 {
        self.knots.iter().map(|knot| knot.colour.max_element()).fold(0.0, f64::max)
    }

    /// Returns the largest extinction of any knot.
    #[must_use]
    pub fn max_tau(&self) -> f64 {
        self.knots.iter().map(|knot| knot.tau).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_between_knots_constant_beyond_right_continuous_at_jumps() {
        let tf = TransferFunction::from_rows(&[
            [0.0, 0.0, 0.0, 0.0, 1.0],
            [1.0, 1.0, 0.0, 0.5, 3.0],
            [1.0, 0.0, 1.0, 0.0, 7.0],
            [2.0, 0.0, 0.0, 0.0, 5.0],
        ])
        .unwrap();
        assert_eq!(tf.at(-9.0).1, 1.0);
        assert_eq!(tf.at(0.5), (DVec3::new(0.5, 0.0, 0.25), 2.0));
        assert_eq!(tf.at(1.0), (DVec3::Y, 7.0));
        assert_eq!(tf.at(1.0 - 1e-12).1, 3.0 - 2e-12);
        assert_eq!(tf.at(f64::INFINITY).1, 5.0);
        assert_eq!(tf.at(f64::NAN).1, 0.0);
        assert_eq!(tf.domain(), [0.0, 2.0]);
    }

    #[test]
    fn refuses_with_knot_and_rule() {
        let why = |rows: &[[f64; 5]]| TransferFunction::from_rows(rows).unwrap_err().to_string();
        assert!(why(&[]).contains("0 knots"));
        assert!(why(&[[1.0, 0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0, 0.0]]).contains("knot 1: scalar 0.5"));
        assert!(why(&[[f64::NAN, 0.0, 0.0, 0.0, 0.0]]).contains("finite"));
        assert!(why(&[[0.0, 0.0, 0.0, 0.0, -1.0]]).contains("extinction -1"));
        assert!(why(&[[0.0, 0.0, -0.1, 0.0, 1.0]]).contains("colour"));
    }
}
