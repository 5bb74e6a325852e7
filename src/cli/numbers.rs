//! Short text forms of numbers.

use std::fmt::Display;

use volraster::glam::DVec3;

/// Formats a vector with [`number`].
pub(crate) fn triple(v: DVec3) -> String {
    format!("[{}, {}, {}]", number(v.x), number(v.y), number(v.z))
}

/// Formats a number with about six significant digits.
pub(crate) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        return "0".to_string();
    }
    if !(1e-4..1e6).contains(&magnitude) {
        return format!("{value:.5e}");
    }
    trimmed(value, if magnitude < 1.0 { 6 } else { 4 })
}

/// Formats a number with at most some decimal places.
fn trimmed(value: f64, places: usize) -> String {
    format!("{value:.places$}").trim_end_matches('0').trim_end_matches('.').to_string()
}

/// Formats a round number of an axis, with a suffix k, M or G from 10,000 up.
pub(crate) fn tick_label(value: f64) -> String {
    let trimmed = |value| trimmed(value, 3);
    match value {
        0.0 => "0".to_string(),
        v if v < 1e-3 * (1.0 - 1e-9) => {
            let exponent = (v.log10() + 1e-9).floor();
            format!("{}e{exponent}", trimmed(v / 10.0_f64.powf(exponent)))
        }
        v if v >= 1e9 => format!("{}G", trimmed(v / 1e9)),
        v if v >= 1e6 => format!("{}M", trimmed(v / 1e6)),
        v if v >= 1e4 => format!("{}k", trimmed(v / 1e3)),
        v => trimmed(v),
    }
}

/// Formats a count with three significant digits and a suffix.
pub(crate) fn count(value: f64) -> String {
    if !(value > 0.0 && value.is_finite()) {
        return "0".to_string();
    }
    let power = 10.0_f64.powf(value.log10().floor() - 2.0);
    tick_label((value / power).round() * power)
}

/// Formats a measured number with three significant digits.
pub(crate) fn three_digits(value: f64) -> String {
    let places = match value {
        v if v >= 99.95 => 0,
        v if v >= 9.995 => 1,
        v if v >= 0.9995 => 2,
        _ => 3,
    };
    format!("{value:.places$}")
}

/// Returns a number with the noun that it counts.
pub(crate) fn counted<N: Display + PartialEq + From<u8>>(number: N, noun: &str) -> String {
    let ending = if number == N::from(1) { "" } else { "s" };
    format!("{number} {noun}{ending}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.0, 0.1 + 0.2, 1e-7, -12.345_678, 3e9].map(number);
        assert_eq!(texts, ["0", "1", "0.3", "1.00000e-7", "-12.3457", "3.00000e9"]);
        assert_eq!([0.0, 262_144.0, 975_560.0, 1e6].map(count), ["0", "262k", "976k", "1M"]);
        assert_eq!([0.0, 2e-4, 0.5, 20_000.0, 1.5e6].map(tick_label), ["0", "2e-4", "0.5", "20k", "1.5M"]);
        assert_eq!(
            [0.1234, 1.234, 12.34, 123.4, 9.999].map(three_digits),
            ["0.123", "1.23", "12.3", "123", "10.0"]
        );
    }
}
