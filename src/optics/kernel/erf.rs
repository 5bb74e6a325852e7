//! The error function.

use std::f64::consts::PI;

/// Returns `2 / sqrt(pi) ∫ exp(-t²) dt` from 0 to x, accurate to 5e-16; NaN for NaN.
///
/// Below 2 it sums the series of Kummer's function, whose terms are all positive; above, it evaluates the
/// continued fraction of the complement (Abramowitz and Stegun 1964, 7.1.6 and 7.1.14).
pub(crate) fn erf(x: f64) -> f64 {
    let y = x.abs();
    if y < 2.0 {
        let square = x * x;
        let (mut term, mut sum, mut n) = (x, x, 1.0);
        // At 2 the terms fall below rounding after 40 iterations.
        for _ in 0..48 {
            n += 2.0;
            term *= 2.0 * square / n;
            sum += term;
        }
        2.0 / PI.sqrt() * (-square).exp() * sum
    } else if y < 6.0 {
        let mut tail = y;
        // From the innermost level outwards: 70 levels are enough at 2.
        for k in (1..=70).rev() {
            tail = y + 0.5 * f64::from(k) / tail;
        }
        (1.0 - (-y * y).exp() / (tail * PI.sqrt())).copysign(x)
    } else if y.is_nan() {
        x
    } else {
        1.0_f64.copysign(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        let known = [
            (0.0, 0.0),
            (1e-10, 1.128_379_167_095_512_6e-10),
            (0.1, 0.112_462_916_018_284_9),
            (0.5, 0.520_499_877_813_046_5),
            (0.84, 0.765_142_711_454_994_6),
            (1.0, 0.842_700_792_949_714_9),
            (1.5, 0.966_105_146_475_310_8),
            (1.99, 0.995_111_413_199_617),
            (2.0, 0.995_322_265_018_952_7),
            (2.01, 0.995_524_849_355_248_2),
            (2.5, 0.999_593_047_982_555),
            (3.0, 0.999_977_909_503_001_4),
            (3.5, 0.999_999_256_901_627_6),
            (4.2, 0.999_999_997_144_505_8),
            (5.0, 0.999_999_999_998_462_6),
            (5.9, 0.999_999_999_999_999_9),
            (f64::INFINITY, 1.0),
        ];
        let mut worst = 0.0_f64;
        for (x, value) in known {
            for (got, want) in [(erf(x), value), (erf(-x), -value)] {
                let error = (got - want).abs();
                worst = worst.max(error);
                assert!(error <= 5e-16 && error <= 1e-15 * value.abs(), "erf({x}): {got} instead of {want}");
            }
        }
        println!("{worst:e}");
        assert!(erf(f64::NAN).is_nan());
    }

    #[test]
    fn rises_across_the_switches() {
        for switch in [2.0_f64, 6.0] {
            assert!((erf(switch) - erf(switch.next_down())).abs() < 1e-15, "{switch}");
        }
        for i in 0..1500 {
            let x = f64::from(i) * 0.004;
            assert!(erf(x + 0.004) >= erf(x), "{x}");
        }
    }
}
