//! Results of a technique, and how the report formats them: a value to sort by, and its text.

use volraster::measure::{ErrorStatistics, ImageErrors};

use crate::cli::numbers::three_digits;
use crate::cli::timing::Quantiles;

/// Results of a technique.
#[derive(Debug)]
pub(crate) struct Row {
    pub(crate) stem: String,
    pub(crate) technique: String,
    pub(crate) route: String,
    pub(crate) options: String,
    pub(crate) errors: ImageErrors,
    pub(crate) wall: Option<Quantiles>,
    pub(crate) gpu: Option<Quantiles>,
    pub(crate) passes: Vec<(String, f64)>,
    pub(crate) counters: Vec<(String, u64)>,
    pub(crate) device_bytes: u64,
    /// The image and its heat map as PNG.
    pub(crate) pictures: [Vec<u8>; 2],
}

/// The heading of the table on stdout.
pub(super) const HEADING: [&str; 10] =
    ["technique", "route", "options", "rmse", "max", "bias", "p99", "p99.9", ">1/255", "ms"];

impl Row {
    /// Returns the row of the table on stdout.
    pub(super) fn line(&self) -> [String; 10] {
        let ErrorStatistics { max_abs, rmse, bias, p99, p999 } = self.errors.all;
        [
            self.technique.clone(),
            self.route.clone(),
            self.options.clone(),
            format!("{rmse:.2e}"),
            format!("{max_abs:.2e}"),
            format!("{bias:+.2e}"),
            format!("{p99:.2e}"),
            format!("{p999:.2e}"),
            format!("{:.2} %", 100.0 * self.errors.above_1_255),
            self.wall.as_ref().map_or_else(String::new, |times| format!("{:.1}", times.median)),
        ]
    }
}

pub(super) fn scientific(value: f64) -> (f64, String) {
    (value, format!("{value:.2e}"))
}

pub(super) fn bias(value: f64) -> (f64, String) {
    // Sorted by magnitude.
    (value.abs(), format!("{value:+.2e}").replace('-', "\u{2212}").replace("e\u{2212}", "e-"))
}

pub(super) fn time(spread: Option<&Quantiles>) -> (f64, String) {
    spread.map_or((f64::INFINITY, "–".to_string()), |spread| (spread.median, three_digits(spread.median)))
}

pub(super) fn interval(spread: Option<&Quantiles>) -> (f64, String) {
    spread.map_or((f64::INFINITY, "–".to_string()), |spread| {
        (spread.high - spread.low, format!("{} – {}", three_digits(spread.low), three_digits(spread.high)))
    })
}

pub(super) fn mebibytes(bytes: u64) -> (f64, String) {
    let value = bytes as f64 / f64::from(1 << 20);
    (value, three_digits(value))
}
