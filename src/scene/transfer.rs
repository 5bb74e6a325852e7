//! Transfer functions: from a scalar to emitted colour and extinction.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::scene::colour_map::ColourMap;

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

    /// Returns the values just below a scalar and at it; they differ at a jump.
    fn limits(&self, s: f64) -> [(DVec3, f64); 2] {
        let at = self.at(s);
        let below = match self.knots.iter().find(|knot| knot.s >= s) {
            Some(knot) if knot.s == s => (knot.colour, knot.tau),
            _ => at,
        };
        [below, at]
    }

    /// Returns the function with the colours of one function and the extinction of another.
    #[must_use]
    pub fn combined(colours: &Self, extinction: &Self) -> Self {
        let mut scalars: Vec<f64> =
            [colours, extinction].iter().flat_map(|f| f.knots.iter().map(|knot| knot.s)).collect();
        scalars.sort_unstable_by(f64::total_cmp);
        scalars.dedup();
        let mut knots = Vec::with_capacity(scalars.len());
        for s in scalars {
            let [below, at] = [0, 1].map(|side| Knot {
                s,
                colour: colours.limits(s)[side].0,
                tau: extinction.limits(s)[side].1,
            });
            knots.extend(std::iter::once(below).chain((at != below).then_some(at)));
        }
        Self { knots }
    }

    /// Returns the function with the colours of a map, linear in the scalar from the first knot to the last.
    #[must_use]
    pub fn coloured(&self, map: ColourMap) -> Self {
        const STEPS: u8 = 64;
        let [low, high] = self.domain();
        let place = |i: u8| low + (high - low) * (f64::from(i) / f64::from(STEPS));
        let colours = map.colours(usize::from(STEPS) + 1);
        let mut knots: Vec<Knot> =
            (0..=STEPS).zip(colours).map(|(i, colour)| Knot { s: place(i), colour, tau: 0.0 }).collect();
        if low == high {
            knots.drain(..usize::from(STEPS));
        }
        Self::combined(&Self { knots }, self)
    }

    /// Returns the function with one colour.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a component is negative or not finite.
    pub fn in_colour(&self, colour: DVec3) -> Result<Self> {
        Self::new(self.knots.iter().map(|knot| Knot { colour, ..*knot }).collect())
    }

    /// Returns the function stretched linearly, so that it begins and ends at the bounds of a range. A function of one scalar is constant and stays.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] unless the lower bound is below the upper one, and both are finite.
    pub fn stretched(&self, [low, high]: [f64; 2]) -> Result<Self> {
        check_range([low, high])?;
        let [from, to] = self.domain();
        if from == to {
            return Ok(self.clone());
        }
        let place = |s: f64| low + (high - low) * ((s - from) / (to - from));
        Self::new(self.knots.iter().map(|knot| Knot { s: place(knot.s), ..*knot }).collect())
    }

    /// Returns the function with its extinction multiplied by a factor.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a product is negative or not finite.
    pub fn thickened(&self, factor: f64) -> Result<Self> {
        Self::new(self.knots.iter().map(|knot| Knot { tau: knot.tau * factor, ..*knot }).collect())
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

/// Checks that the lower bound of a range of scalars is below the upper one, and both are finite.
pub(crate) fn check_range([low, high]: [f64; 2]) -> Result<()> {
    if low < high && (high - low).is_finite() {
        return Ok(());
    }
    Err(Error::invalid("range", format!("[{low}, {high}]: the first must be below the second")))
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
    fn colours_and_extinction_combine_and_keep_their_jumps() {
        let row = |s: f64, r: f64, tau: f64| [s, r, 0.0, 0.0, tau];
        let colours = TransferFunction::from_rows(&[row(0.0, 0.0, 9.0), row(4.0, 1.0, 9.0)]).unwrap();
        let jump = TransferFunction::from_rows(&[row(1.0, 5.0, 0.0), row(2.0, 5.0, 1.0), row(2.0, 5.0, 7.0)])
            .unwrap();
        let both = TransferFunction::combined(&colours, &jump);
        let rows: Vec<[f64; 3]> = both.knots().iter().map(|knot| [knot.s, knot.colour.x, knot.tau]).collect();
        assert_eq!(
            rows,
            [[0.0, 0.0, 0.0], [1.0, 0.25, 0.0], [2.0, 0.5, 1.0], [2.0, 0.5, 7.0], [4.0, 1.0, 7.0]]
        );
        let grey = jump.coloured(ColourMap::Grey);
        assert_eq!((grey.at(1.0).0, grey.at(2.0).0), (DVec3::ZERO, DVec3::ONE));
        assert_eq!(
            [0.0, 1.5, 2.0 - 1e-12, 2.0, 3.0].map(|s| grey.at(s).1),
            [0.0, 1.5, 2.0 - 1e-12, 2.0, 3.0].map(|s| jump.at(s).1)
        );
        let constant = TransferFunction::from_rows(&[row(3.0, 1.0, 1.0)]).unwrap();
        assert_eq!(constant.coloured(ColourMap::Grey).at(0.0), (DVec3::ONE, 1.0));
        assert_eq!(jump.stretched([-10.0, 10.0]).unwrap().domain(), [-10.0, 10.0]);
        assert_eq!(jump.thickened(2.0).unwrap().at(2.0).1, 14.0);
        for range in [[1.0, 1.0], [2.0, 1.0], [f64::NAN, 1.0], [-1e308, 1e308]] {
            assert!(jump.stretched(range).is_err(), "{range:?}");
        }
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
