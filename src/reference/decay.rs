//! Taylor series of the transmittance, which the compiler vectorises, unlike calls of `exp`.

use crate::num;

/// A series of exp(-x) with this number of terms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decay<const TERMS: usize> {
    /// The place around which the series is taken, and its coefficients, constant first.
    centre: f64,
    series: [f64; TERMS],
}

/// The series for x from 0 to 0.002, with a rest below 2^-56 as the others.
pub(super) const FAINT: Decay<6> = Decay::around(0.0, 1.0);

/// Largest x of [`WEAK`].
pub(super) const WEAK_DEPTH: f64 = 0.05;

/// The series for x from 0 to [`WEAK_DEPTH`].
pub(super) const WEAK: Decay<9> = Decay::around(0.0, 1.0);

/// The series for x from 0 to 1.
pub(super) const STRONG: Decay<16> = Decay::around(0.5, 0.606_530_659_712_633_4);

impl<const TERMS: usize> Decay<TERMS> {
    /// Takes a place and exp(-x) there.
    const fn around(centre: f64, value: f64) -> Self {
        let mut series = [value; TERMS];
        let mut k = 1;
        while k < TERMS {
            series[k] = -series[k - 1] / num::f64_of(k);
            k += 1;
        }
        Self { centre, series }
    }

    #[inline]
    pub(super) fn at(&self, x: f64) -> f64 {
        let x = x - self.centre;
        self.series.iter().rev().fold(0.0, |sum, c| sum * x + c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_are_exact_to_rounding() {
        let worst = |at: &dyn Fn(f64) -> f64, reach: f64| {
            let error = |i: u32| {
                let x = reach * f64::from(i) / 1e4;
                (at(x) / (-x).exp() - 1.0).abs()
            };
            (0..=10_000).map(error).fold(0.0, f64::max)
        };
        for (name, error, bound) in [
            ("faint", worst(&|x| FAINT.at(x), 0.002), 1.5),
            ("weak", worst(&|x| WEAK.at(x), WEAK_DEPTH), 1.5),
            ("strong", worst(&|x| STRONG.at(x), 1.0), 2.5),
        ] {
            println!("{name}: {error:e}");
            assert!(error <= bound * f64::EPSILON, "{name}: {error:e}");
        }
    }
}
