//! Shapes of extinction over a range of scalars.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::scene::{Knot, TransferFunction};

/// How extinction depends on the scalar between the ends of a range, relative to its largest value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Opacity {
    /// Everywhere the same.
    Constant,
    /// Proportional to the scalar's share of the range.
    Linear,
    /// Proportional to the square of the share.
    Square,
    /// Proportional to the share of the scalar's logarithm; for scalars above zero.
    Log,
    /// Proportional to the distance from the middle of the range.
    Both,
    /// Largest at a scalar, and zero from a distance on: by default a twentieth of the range.
    Peak(f64, Option<f64>),
    /// Constant from a scalar on, and zero below it.
    Above(f64),
}

impl Opacity {
    /// The number of pieces that stand for a curve.
    const PIECES: u32 = 32;

    /// Returns the shape of a text: `constant`, `linear`, `square`, `log`, `both`, `peak@S`, `peak@S,WIDTH` or `above@S`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the rule.
    pub fn parse(text: &str) -> Result<Self> {
        let number = |text: &str| text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        let shape = match text.split_once('@') {
            None => match text {
                "constant" => Some(Self::Constant),
                "linear" => Some(Self::Linear),
                "square" => Some(Self::Square),
                "log" => Some(Self::Log),
                "both" => Some(Self::Both),
                _ => None,
            },
            Some(("above", at)) => number(at).map(Self::Above),
            Some(("peak", at)) => match at.split_once(',') {
                None => number(at).map(|at| Self::Peak(at, None)),
                Some((at, width)) => {
                    number(at).zip(number(width)).map(|(at, width)| Self::Peak(at, Some(width)))
                }
            },
            Some(_) => None,
        };
        let valid = shape.filter(|shape| !matches!(shape, Self::Peak(_, Some(width)) if *width <= 0.0));
        valid.ok_or_else(|| {
            let why = format!(
                "\"{text}\": must be constant, linear, square, log, both, peak@S, peak@S,WIDTH or above@S"
            );
            Error::invalid("opacity", why)
        })
    }

    /// Returns a transfer function with this extinction from the first knot of `transfer` to the last, at most 1, and its colours.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for [`Self::Log`] where the range begins at zero or below.
    pub fn over(self, transfer: &TransferFunction) -> Result<TransferFunction> {
        let [low, high] = transfer.domain();
        let knot = |(s, tau): (f64, f64)| Knot { s, colour: DVec3::ZERO, tau };
        let even = |place: &dyn Fn(f64) -> f64, of: &dyn Fn(f64) -> f64| {
            let shares = (0..=Self::PIECES).map(|i| f64::from(i) / f64::from(Self::PIECES));
            shares.map(|share| (place(share), of(share))).collect::<Vec<_>>()
        };
        let linear = |share: f64| low + (high - low) * share;
        let places = match self {
            _ if low >= high => vec![(low, 1.0)],
            Self::Constant => vec![(low, 1.0)],
            Self::Linear => vec![(low, 0.0), (high, 1.0)],
            Self::Square => even(&linear, &|share| share * share),
            Self::Log if low > 0.0 => even(&|share| low * (high / low).powf(share), &|share| share),
            Self::Log => {
                let why = format!("log: requires a range above zero, this one begins at {low}");
                return Err(Error::invalid("opacity", why));
            }
            Self::Both => vec![(low, 1.0), (linear(0.5), 0.0), (high, 1.0)],
            Self::Peak(at, width) => {
                let width = width.unwrap_or(0.05 * (high - low));
                vec![(at - width, 0.0), (at, 1.0), (at + width, 0.0)]
            }
            Self::Above(at) => vec![(at, 0.0), (at, 1.0)],
        };
        let extinction = TransferFunction::new(places.into_iter().map(knot).collect())?;
        Ok(TransferFunction::combined(transfer, &extinction))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_lie_over_the_range() {
        let ramp =
            TransferFunction::from_rows(&[[1.0, 0.0, 0.0, 0.0, 0.0], [100.0, 1.0, 0.0, 0.0, 3.0]]).unwrap();
        let taus = |text: &str, at: [f64; 4]| {
            let shaped = Opacity::parse(text).unwrap().over(&ramp).unwrap();
            assert_eq!(shaped.at(100.0).0, DVec3::X, "{text}");
            at.map(|s| (shaped.at(s).1 * 100.0).round() / 100.0)
        };
        assert_eq!(taus("constant", [1.0, 2.0, 50.0, 100.0]), [1.0; 4]);
        assert_eq!(taus("linear", [0.0, 1.0, 50.5, 200.0]), [0.0, 0.0, 0.5, 1.0]);
        assert_eq!(taus("square", [1.0, 50.5, 75.25, 100.0]), [0.0, 0.25, 0.56, 1.0]);
        assert_eq!(taus("log", [1.0, 10.0, 31.62, 100.0]), [0.0, 0.5, 0.75, 1.0]);
        assert_eq!(taus("both", [1.0, 50.5, 75.25, 100.0]), [1.0, 0.0, 0.5, 1.0]);
        assert_eq!(taus("peak@50", [40.0, 50.0, 52.475, 60.0]), [0.0, 1.0, 0.5, 0.0]);
        assert_eq!(taus("peak@50,20", [30.0, 40.0, 50.0, 80.0]), [0.0, 0.5, 1.0, 0.0]);
        assert_eq!(taus("above@-5", [-6.0, -5.0, 0.0, 100.0]), [0.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn wrong_shapes_are_refused() {
        for wrong in
            ["", "cube", "peak", "peak@", "peak@x", "peak@1,0", "peak@1,-2", "peak@nan", "above@", "linear@2"]
        {
            let why = Opacity::parse(wrong).unwrap_err().to_string();
            assert!(why.contains(&format!("\"{wrong}\": must be constant, ")), "{why}");
        }
        let signed =
            TransferFunction::from_rows(&[[-1.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0, 3.0]]).unwrap();
        assert!(Opacity::Log.over(&signed).unwrap_err().to_string().contains("above zero"));
    }
}
