//! The sections of report.html about errors and times, and about techniques that did not draw.

use std::fmt::Write as _;

use super::row::{Row, bias, interval, mebibytes, scientific, time};
use crate::cli::markup::escape_xml;

/// Returns a cell's value to sort by, and its text.
type Cell = fn(&Row) -> (f64, String);

/// A column of the table.
struct Column {
    head: &'static str,
    about: &'static str,
    cell: Cell,
    /// Whether the smallest value is highlighted.
    marks_best: bool,
}

const fn plain(head: &'static str, about: &'static str, cell: Cell) -> Column {
    Column { head, about, cell, marks_best: false }
}

const fn ranked(head: &'static str, about: &'static str, cell: Cell) -> Column {
    Column { head, about, cell, marks_best: true }
}

const COLUMNS: [Column; 11] = [
    ranked("RMSE", "root of the mean squared error", |row| scientific(row.errors.all.rmse)),
    ranked("max", "largest error", |row| scientific(row.errors.all.max_abs)),
    ranked("p99", "99th percentile of the absolute error", |row| scientific(row.errors.all.p99)),
    ranked("p99.9", "99.9th percentile of the absolute error", |row| scientific(row.errors.all.p999)),
    plain("bias", "mean error, positive where the image is too bright", |row| bias(row.errors.all.bias)),
    plain("> 1/255", "share of pixels with a larger error in some channel", |row| {
        (row.errors.above_1_255, format!("{:.2} %", 100.0 * row.errors.above_1_255))
    }),
    plain("NaN", "samples that are NaN or infinite", |row| {
        (row.errors.non_finite as f64, row.errors.non_finite.to_string())
    }),
    ranked("ms", "median wall time of a frame, from recording to fence", |row| time(row.wall.as_ref())),
    plain("95 %", "95 % confidence interval of that median, by ranks", |row| interval(row.wall.as_ref())),
    ranked("GPU ms", "median of the summed pass times on the device", |row| time(row.gpu.as_ref())),
    ranked("MiB", "device memory of scene and frame", |row| mebibytes(row.device_bytes)),
];

/// Writes the table of errors and times.
pub(super) fn errors_table(out: &mut String, rows: &[Row]) {
    out.push_str(
        "<section>\n<h2>Errors and times</h2>\n<p class=\"note\">Errors are over all pixels and the four channels of premultiplied \
         linear RGBA. The best of a column is bold. <span class=\"js\">Click a heading to sort.</span></p>\n<div class=\"scroll\">\n<table class=\"sortable\">\n<thead><tr>",
    );
    // Columns without information are left out: no options, no NaN.
    let has_options = rows.iter().any(|row| !row.options.is_empty());
    for head in ["technique", "route"].into_iter().chain(has_options.then_some("options")) {
        let _ = write!(out, "<th scope=\"col\" class=\"text\">{head}</th>");
    }
    let has_nan = rows.iter().any(|row| row.errors.non_finite > 0);
    let columns: Vec<&Column> = COLUMNS.iter().filter(|column| has_nan || column.head != "NaN").collect();
    for Column { head, about, .. } in &columns {
        let _ = write!(out, "<th scope=\"col\" title=\"{}\">{}</th>", escape_xml(about), escape_xml(head));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    // Cells with the same text count as equal.
    let best = columns.iter().map(|column| {
        let cells = rows.iter().map(|row| (column.cell)(row)).filter(|(value, _)| value.is_finite());
        let best = cells.min_by(|a, b| a.0.total_cmp(&b.0));
        best.filter(|_| column.marks_best && rows.len() > 1).map(|(_, text)| text)
    });
    let best: Vec<Option<String>> = best.collect();
    for row in rows {
        let (stem, technique) = (escape_xml(&row.stem), escape_xml(&row.technique));
        let _ = write!(
            out,
            "<tr><th scope=\"row\" class=\"text\"><a href=\"#{stem}\">{technique}</a></th><td class=\"text route\">{}</td>",
            escape_xml(&row.route)
        );
        if has_options {
            let _ = write!(out, "<td class=\"text options\">{}</td>", escape_xml(&row.options));
        }
        for (column, best) in columns.iter().zip(&best) {
            let (value, text) = (column.cell)(row);
            let class = if best.as_ref() == Some(&text) { " class=\"best\"" } else { "" };
            let _ = write!(out, "<td data-v=\"{value:e}\"{class}>{}</td>", escape_xml(&text));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody>\n</table>\n</div>\n</section>\n");
}

/// Writes the table of techniques that did not draw, with reasons.
pub(super) fn refusals(out: &mut String, refused: &[[String; 3]]) {
    if refused.is_empty() {
        return;
    }
    out.push_str("<section>\n<h2>Not drawn</h2>\n<div class=\"scroll\">\n<table>\n<thead><tr><th class=\"text\">technique</th><th class=\"text\">route</th><th class=\"text\">why</th></tr></thead>\n<tbody>\n");
    for cells in refused {
        let cells: String =
            cells.iter().map(|cell| format!("<td class=\"text\">{}</td>", escape_xml(cell))).collect();
        let _ = writeln!(out, "<tr>{cells}</tr>");
    }
    out.push_str("</tbody>\n</table>\n</div>\n</section>\n");
}
