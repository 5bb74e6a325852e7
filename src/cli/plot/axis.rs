//! Ranges and ticks of axes, mostly logarithmic.

use std::ops::Range;

use super::picture::{LINE, text_width};
use crate::cli::numbers::tick_label;

/// Returns the position of a value in a range, 0 to 1, on a logarithmic scale.
pub(super) fn share(range: &Range<f64>, value: f64) -> f64 {
    (value / range.start).ln() / (range.end / range.start).ln()
}

/// Returns a range that contains the values with a margin; its ends are 1, 2 or 5 times a power of ten. `None`
/// without values.
pub(super) fn bounds(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let (lo, hi) = values.fold((f64::INFINITY, 0.0_f64), |(lo, hi), value| (lo.min(value), hi.max(value)));
    if lo > hi {
        return None;
    }
    let round = |value: f64, is_up: bool| {
        let power = 10.0_f64.powf(value.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
        let found = if is_up {
            steps.into_iter().find(|step| *step >= value)
        } else {
            steps.into_iter().rev().find(|step| *step <= value)
        };
        found.unwrap_or(value)
    };
    // The margin keeps points off the frame.
    let (start, end) = (round(lo / 1.1, false), round(hi * 1.1, true));
    Some(start..end)
}

/// Returns grid lines of a logarithmic axis with a length in units; lines without a label have an empty text. Chooses
/// as many labels as fit without overlap.
pub(super) fn ticks(range: &Range<f64>, length: f64, is_x: bool) -> Vec<(f64, String)> {
    let inside = |value: f64| value >= range.start * (1.0 - 1e-9) && value <= range.end * (1.0 + 1e-9);
    let of = |digits: &[f64], every: i32| -> Vec<f64> {
        (-300..=300)
            .filter(|exponent| exponent % every == 0)
            .flat_map(|exponent| digits.iter().map(move |digit| digit * 10.0_f64.powi(exponent)))
            .filter(|value| inside(*value))
            .collect()
    };
    let all = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
    let choices =
        [of(&all, 1), of(&[1.0, 2.0, 5.0], 1), of(&[1.0], 1), of(&[1.0], 2), of(&[1.0], 3), of(&[1.0], 5)];
    // Labels lie side by side along x, one above the other along y.
    let extent = |value: f64| if is_x { text_width(&tick_label(value)) + 12.0 } else { 2.0 * LINE };
    let fits = |values: &&Vec<f64>| {
        let gap = |pair: &[f64]| length * (share(range, pair[1]) - share(range, pair[0]));
        values.windows(2).all(|pair| gap(pair) >= 0.5 * (extent(pair[0]) + extent(pair[1])))
    };
    let labelled = choices.iter().find(fits).cloned().unwrap_or_default();
    // Minor lines are drawn only over few decades, where they are not too dense.
    let lines = if choices[2].len() <= 8 { of(&all, 1) } else { choices[2].clone() };
    let is_labelled = |value: f64| labelled.iter().any(|known| (known / value - 1.0).abs() < 1e-9);
    let label = |value| if is_labelled(value) { tick_label(value) } else { String::new() };
    lines.into_iter().map(|value| (value, label(value))).collect()
}

/// Returns a round step of at least some size.
pub(crate) fn nice_step(least: f64) -> f64 {
    let power = 10.0_f64.powf(least.log10().floor());
    [1.0, 2.0, 2.5, 5.0]
        .map(|step| step * power)
        .into_iter()
        .find(|step| *step >= least)
        .unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_extend_beyond_their_values() {
        assert_eq!(bounds([3.0, 150.0].into_iter()), Some(2.0..200.0));
        assert_eq!(bounds([0.01].into_iter()), Some(0.005..0.02));
        assert_eq!(bounds(std::iter::empty()), None);
    }

    #[test]
    fn labels_do_not_overlap_and_mark_round_numbers() {
        let labels = |range: Range<f64>, is_x: bool| -> Vec<String> {
            let length = if is_x { 600.0 } else { 404.0 };
            ticks(&range, length, is_x)
                .into_iter()
                .map(|(_, label)| label)
                .filter(|l| !l.is_empty())
                .collect()
        };
        assert_eq!(labels(2.0..20.0, true), ["2", "3", "4", "5", "6", "7", "8", "9", "10", "20"]);
        // The labels 90k and 100k would overlap.
        assert_eq!(labels(1e4..1e5, true), ["10k", "20k", "50k", "100k"]);
        assert_eq!(labels(2.0..200.0, false), ["2", "5", "10", "20", "50", "100", "200"]);
        assert_eq!(labels(1e-5..1.0, false), ["1e-5", "1e-4", "0.001", "0.01", "0.1", "1"]);
        assert_eq!(labels(1e-12..1.0, false).len(), 7);
    }
}
