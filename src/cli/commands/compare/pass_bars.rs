//! The section of report.html about the time of each pass.

use std::fmt::Write as _;

use super::row::Row;
use crate::cli::markup::escape_xml;
use crate::cli::numbers::three_digits;

/// Returns the passes of a row, without the technique in their names; passes below 1 % of the total are merged at the
/// end.
fn shown_passes(row: &Row) -> Vec<(String, f64)> {
    let sum: f64 = row.passes.iter().map(|(_, ms)| ms).sum();
    let (shown, small): (Vec<_>, Vec<_>) = row.passes.iter().partition(|(_, ms)| *ms >= 0.01 * sum);
    let short = |name: &str| {
        let own = name.strip_prefix(row.technique.as_str()).and_then(|rest| rest.strip_prefix('.'));
        own.unwrap_or(name).to_string()
    };
    let rest = match small.len() {
        0 => None,
        n => Some((format!("{n} more"), small.iter().map(|(_, ms)| ms).sum())),
    };
    shown.into_iter().map(|(name, ms)| (short(name), *ms)).chain(rest).collect()
}

/// Writes a stacked bar of pass times for each technique.
pub(super) fn passes(out: &mut String, rows: &[Row]) {
    let sum = |row: &Row| row.passes.iter().map(|(_, ms)| ms).sum::<f64>();
    let most = rows.iter().map(sum).fold(0.0, f64::max);
    if most <= 0.0 {
        return;
    }
    out.push_str(
        "<section>\n<h2>Time per pass</h2>\n<p class=\"note\">Medians on the device, in ms; errors.json has every pass. \
         All bars have one scale.</p>\n<div class=\"passes\">\n",
    );
    // A pass has the same colour in all rows.
    let mut names: Vec<String> = Vec::new();
    for row in rows.iter().filter(|row| !row.passes.is_empty()) {
        let passes = shown_passes(row);
        let mut bar = String::new();
        let mut parts = String::new();
        for (name, ms) in &passes {
            if !names.contains(name) {
                names.push(name.clone());
            }
            let colour = if name.ends_with(" more") {
                "p8".to_string()
            } else {
                format!("p{}", names.iter().position(|known| known == name).unwrap_or(0) % 8)
            };
            let (name, time) = (escape_xml(name), three_digits(*ms));
            // Writing into a string cannot fail.
            let _ = write!(
                bar,
                "<i class=\"{colour}\" style=\"width:{:.3}%\" title=\"{name} {time} ms\"></i>",
                100.0 * ms / most
            );
            let _ = write!(parts, "<span><i class=\"{colour}\"></i>{name} <b>{time}</b></span> ");
        }
        let _ = writeln!(
            out,
            "<div class=\"name\">{} <span>{}</span></div><div><div class=\"bar\">{bar}</div><div class=\"parts\">{parts}</div></div><div class=\"sum\">{}</div>",
            escape_xml(&row.technique),
            escape_xml(&row.route),
            three_digits(sum(row))
        );
    }
    out.push_str("</div>\n</section>\n");
}
