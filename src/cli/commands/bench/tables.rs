//! The results of `bench` as Markdown (table.md) and as a page (report.html).

use super::bounds::Peaks;
use super::charts::{Chart, view_title};
use super::fronts::Fronts;
use super::record::{EVALUATIONS, Record, dash, views, word};
use crate::cli::markup::{escape_markdown, escape_xml, link_address};
use crate::cli::numbers::{count, counted, three_digits};
use crate::cli::report;
use crate::cli::sensors::Reading;
use crate::cli::timing::{Quantiles, Times, ratio};

/// Optional features: option and its value when off.
const FEATURES: [(&str, &str); 7] = [
    ("empty-space", "march"),
    ("stop", "0"),
    ("prefilter", "none"),
    ("filter", "hardware"),
    ("dither", "none"),
    ("repair", "none"),
    ("order", "front-to-back"),
];

/// A part of the results: table.md and report.html contain the same ones.
#[derive(Debug)]
pub(super) enum Part<'a> {
    Heading(String),
    Text(String),
    Warning(&'static str),
    /// Rows of cells, the first the heading. As many columns as the number says are text.
    Table(Vec<Vec<String>>, usize),
    Chart(&'a Chart),
}

/// Returns the parts of the results.
pub(super) fn parts<'a>(
    records: &[Record],
    charts: &'a [Chart],
    peaks: &Peaks,
    is_interrupted: bool,
) -> Vec<Part<'a>> {
    let mut parts = Vec::new();
    let text = |text: &str| Part::Text(text.to_string());
    if !records.is_empty() {
        parts.push(text(
            "Times are wall times from recording to fence, medians in ms, in brackets their 95 % confidence intervals, by ranks. Errors \
             are over premultiplied linear RGBA, relative to the float64 reference.",
        ));
    }
    if is_interrupted {
        parts.push(Part::Warning("The run was stopped early; the results are partial."));
    }
    for view in views(records) {
        let title = view_title(view[0]);
        let end = format!(": {title}");
        parts.push(Part::Heading(title));
        parts.push(Part::Text(format!("{} {}.", view[0].elements, view[0].elements_name())));
        parts.extend(charts.iter().filter(|chart| chart.title.ends_with(&end)).map(Part::Chart));
        parts.push(text("Time at equal error, in ms, of the best route and options (\"<=\": even the coarsest setting is more accurate; \"-\": not reached):"));
        parts.push(Part::Table(Fronts::new(&view).rows(), 1));
        parts.push(text("Every case:"));
        parts.push(Part::Table(cases(&view), 3));
        let features = features(&view);
        if features.len() > 1 {
            parts.push(text("Optional features off and on, all other options equal:"));
            parts.push(Part::Table(features, 4));
        }
        let refused: Vec<Vec<String>> = view.iter().filter_map(|record| refusal(record)).collect();
        if !refused.is_empty() {
            parts.push(text("Not drawn, or wrong:"));
            let heading = ["technique", "route", "options", "why"].map(str::to_string).to_vec();
            parts.push(Part::Table([vec![heading], refused].concat(), 4));
        }
    }
    let sizes: Vec<&Chart> = charts.iter().filter(|chart| chart.name.starts_with("size-")).collect();
    if !sizes.is_empty() {
        parts.push(Part::Heading("Time over size".to_string()));
        parts.extend(sizes.into_iter().map(Part::Chart));
    }
    let peaks = peaks.rows();
    if peaks.len() > 1 {
        parts.push(Part::Heading("Peaks of the device".to_string()));
        parts.push(text("A case is bound by the kind of work that takes longest at its peak; its share is that time over the measured one. Bytes are those of the buffers and images that the passes are given."));
        parts.push(Part::Table(peaks, 1));
    }
    parts
}

/// Returns the text of table.md.
pub(super) fn markdown(records: &[Record], parts: &[Part<'_>]) -> String {
    let part = |part: &Part<'_>| match part {
        Part::Heading(title) => format!("## {}\n\n", escape_markdown(title)),
        Part::Text(text) => format!("{}\n\n", escape_markdown(text)),
        Part::Warning(text) => format!("**{text}**\n\n"),
        Part::Table(rows, text) => format!("{}\n", table(rows, *text)),
        Part::Chart(Chart { title, name, .. }) => {
            format!("![{}]({}.svg)\n\n", escape_markdown(title), link_address(name))
        }
    };
    let fact = |(name, value): (&str, String)| format!("- {name}: {}\n", escape_markdown(&value));
    let facts: String = facts(records).into_iter().map(fact).collect();
    format!("# Benchmark\n\n{facts}\n{}", parts.iter().map(part).collect::<String>())
}

/// Returns the text of report.html.
pub(super) fn html(records: &[Record], parts: &[Part<'_>]) -> String {
    let part = |part: &Part<'_>| match part {
        Part::Heading(title) => format!("<h2>{}</h2>\n", escape_xml(title)),
        Part::Text(text) => format!("<p class=\"note\">{}</p>\n", escape_xml(text)),
        Part::Warning(text) => format!("<p><strong>{text}</strong></p>\n"),
        Part::Table(rows, text) => html_table(rows, *text),
        Part::Chart(chart) => {
            format!("<figure class=\"chart\">\n{}</figure>\n", chart.picture.svg())
        }
    };
    report::page("Benchmark", &facts(records), &parts.iter().map(part).collect::<String>())
}

/// Returns what a report says of the run and its machine.
fn facts(records: &[Record]) -> Vec<(&'static str, String)> {
    let Some(Record { device, driver, api, version, run, .. }) = records.first() else { return Vec::new() };
    let revision = run.commit.as_ref().map_or_else(String::new, |commit| format!(" ({commit})"));
    let mut facts = vec![
        ("Device", device.clone()),
        ("Driver", format!("{driver}, Vulkan {api}")),
        ("Program", format!("volraster {version}{revision}")),
        ("Processor", format!("{}, {} usable", run.processor, run.processors)),
        ("System", run.system.clone()),
        ("Begin", run.begin.clone()),
        ("Arguments", run.arguments.join(" ")),
    ];
    let sensors = || records.iter().filter_map(|record| record.sensors.as_ref());
    let middle = |of: fn(&Reading) -> Option<f64>, unit: &str| {
        let values = Times::new(sensors().filter_map(of).collect())?;
        Some(format!("{} {unit}", three_digits(values.median())))
    };
    let readings = [
        ("Clock", middle(|reading| reading.clock_mhz, "MHz")),
        ("Temperature", middle(|reading| reading.temperature_c, "°C")),
        ("Power", middle(|reading| reading.power_w, "W")),
        ("Governor", sensors().find_map(|reading| reading.governor.clone())),
        ("Throttled", sensors().find_map(|reading| reading.throttled.clone())),
    ];
    facts.extend(readings.into_iter().filter_map(|(name, value)| Some((name, value?))));
    let disturbed = records.iter().filter(|record| record.disturbed.is_some()).count();
    if disturbed > 0 {
        facts.push((
            "Disturbed",
            format!("frames of {disturbed} of {}, repeated", counted(records.len(), "case")),
        ));
    }
    facts.retain(|(_, value)| !value.is_empty());
    facts
}

/// Returns a row for each drawn case of a view, below a heading.
fn cases(view: &[&Record]) -> Vec<Vec<String>> {
    let median =
        |spread: &Option<Quantiles>| spread.as_ref().map_or_else(dash, |spread| three_digits(spread.median));
    let mebibytes = |bytes| three_digits(bytes as f64 / f64::from(1 << 20));
    let per_second = |record: &Record, number: Option<f64>| match (number, &record.wall_ms) {
        (Some(number), Some(spread)) => count(number / spread.median * 1e3),
        _ => dash(),
    };
    let (is_grid, is_mesh) = (view[0].data == "grid", view[0].data == "mesh");
    let has_splats = view.iter().any(|record| record.counter("pairs").is_some());
    let mut heading = vec!["technique", "route", "options", "RMSE", "max", "ms", "95 %"];
    let is_stamped = view.iter().any(|record| record.gpu_ms.is_some());
    let has_bounds = view.iter().any(|record| record.bound.is_some());
    heading.extend(is_stamped.then_some("gpu ms"));
    heading.extend(has_bounds.then_some(["bound", "share"]).into_iter().flatten());
    heading.push("MiB");
    heading.extend(is_grid.then_some(["samples", "fetches", "samples/s"]).into_iter().flatten());
    heading.extend(is_mesh.then_some(["tets/s", "fragments/s"]).into_iter().flatten());
    heading.extend(has_splats.then_some(["pairs/s", "evaluations/s"]).into_iter().flatten());
    let has_bytes = view.iter().any(|record| record.counter("splat_bytes").is_some());
    heading.extend(has_bytes.then_some("bytes/splat"));
    let mut rows = vec![heading.into_iter().map(str::to_string).collect::<Vec<_>>()];
    for record in view.iter().filter(|record| record.skipped.is_none() && record.failed.is_none()) {
        let mut row = record.names().to_vec();
        row.extend(["rmse", "max_abs"].map(|statistic| record.error_text(statistic)));
        row.extend([median(&record.wall_ms), record.wall_ms.as_ref().map_or_else(dash, interval)]);
        row.extend(is_stamped.then(|| median(&record.gpu_ms)));
        if has_bounds {
            let bound = record.bound.as_ref();
            row.push(bound.map_or_else(dash, |bound| bound.by.clone()));
            row.push(bound.map_or_else(dash, |bound| format!("{} %", three_digits(100.0 * bound.share))));
        }
        row.push(record.device_bytes.map_or_else(dash, mebibytes));
        let rate = |number| per_second(record, number);
        if is_grid {
            let [samples, fetches] = ["samples", "fetches"].map(|name| record.counter(name));
            row.extend([samples, fetches].map(|number| number.map_or_else(dash, count)));
            row.push(rate(samples));
        }
        if is_mesh {
            row.extend([Some(record.elements as f64), record.counter("fragments")].map(rate));
        }
        if has_splats {
            let pairs = record.counter("pairs");
            row.extend([pairs, pairs.map(|pairs| pairs * EVALUATIONS)].map(rate));
        }
        if has_bytes {
            row.push(record.counter("splat_bytes").map_or_else(dash, three_digits));
        }
        rows.push(row);
    }
    rows
}

/// Returns rows that compare cases that differ only in one feature, by the 5th percentiles of their times.
fn features(view: &[&Record]) -> Vec<Vec<String>> {
    let names = ["feature", "technique", "route", "options"];
    let values = ["off ms", "on ms", "on/off", "95 %", "off RMSE", "on RMSE"];
    let mut rows = vec![names.into_iter().chain(values).map(str::to_string).collect::<Vec<_>>()];
    for (key, off) in FEATURES {
        for record in view.iter().filter(|record| record.wall_ms.is_some()) {
            // Missing options are off: `dither` is recorded only when on.
            let state = |record: &Record| {
                let text = record.options.get(key).map(word);
                text.map_or_else(|| off.to_string(), |text| text.trim_end_matches(".0").to_string())
            };
            let on = state(record);
            // Orders of splats are no feature that is on or off.
            if on == off || (key == "order" && record.data != "mesh") {
                continue;
            }
            let others = |record: &Record| {
                // The seed has no effect without dithering.
                let kept = record.options.iter().filter(|(name, _)| *name != key && *name != "seed");
                kept.map(|(name, value)| (name.clone(), value.clone())).collect::<Vec<_>>()
            };
            let same = |other: &&&Record| {
                other.wall_ms.is_some()
                    && (&other.technique, &other.route) == (&record.technique, &record.route)
                    && state(other) == off
                    && others(other) == others(record)
            };
            let Some(base) = view.iter().find(same) else { continue };
            let (Some(before), Some(after)) = (base.times(), record.times()) else { continue };
            let Some(ratio) = ratio(&[[&before, &after]]) else { continue };
            let [technique, route, options] = base.names();
            // The column of the feature shows its value.
            let others: Vec<&str> =
                options.split(',').filter(|pair| pair.split('=').next() != Some(key)).collect();
            rows.push(vec![
                format!("{key}: {off} → {on}"),
                technique,
                route,
                others.join(","),
                three_digits(before.low()),
                three_digits(after.low()),
                format!("{:.2}", ratio.value),
                format!("{:.2}..{:.2}", ratio.low, ratio.high),
                base.error_text("rmse"),
                record.error_text("rmse"),
            ]);
        }
    }
    rows
}

/// Returns the row of a case without a valid image: technique, route, options and reason.
fn refusal(record: &Record) -> Option<Vec<String>> {
    let why = match (&record.skipped, &record.failed) {
        (Some(why), _) | (_, Some(why)) => why.clone(),
        _ if record.wrong => {
            let rmse = record.error_text("rmse");
            format!("RMSE {rmse}: the target format is too imprecise for this scene")
        }
        _ => return None,
    };
    Some(record.names().into_iter().chain([why]).collect())
}

fn interval(spread: &Quantiles) -> String {
    format!("[{}, {}]", three_digits(spread.low), three_digits(spread.high))
}

/// Formats a Markdown table; the first row is the heading. The first `text` columns are left-aligned, the others
/// right-aligned.
fn table(rows: &[Vec<String>], text: usize) -> String {
    let line = |row: &Vec<String>| {
        let cells: Vec<String> = row.iter().map(|cell| escape_markdown(cell)).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let columns = rows.first().map_or(0, Vec::len);
    let rule: Vec<&str> = (0..columns).map(|i| if i < text { "---" } else { "---:" }).collect();
    let mut lines = rows.iter().map(line);
    let heading = lines.next().unwrap_or_default();
    format!("{heading}|{}|\n{}", rule.join("|"), lines.collect::<String>())
}

/// Formats a table of HTML; columns sort by their numbers.
fn html_table(rows: &[Vec<String>], text: usize) -> String {
    let Some((heading, rows)) = rows.split_first() else { return String::new() };
    let class = |column: usize| if column < text { " class=\"text\"" } else { "" };
    let cells = |name: &str, row: &[String], sorts: bool| {
        let cell = |(column, cell): (usize, &String)| {
            let value =
                if sorts && column >= text { format!(" data-v=\"{}\"", number(cell)) } else { String::new() };
            format!("<{name}{}{value}>{}</{name}>", class(column), escape_xml(cell))
        };
        format!("<tr>{}</tr>\n", row.iter().enumerate().map(cell).collect::<String>())
    };
    let body: String = rows.iter().map(|row| cells("td", row, true)).collect();
    let head = cells("th", heading, false);
    format!(
        "<div class=\"scroll\">\n<table class=\"sortable\">\n<thead>\n{head}</thead>\n<tbody>\n{body}</tbody>\n</table>\n</div>\n"
    )
}

/// Returns the first number of a cell, to sort by; the greatest where it has none.
fn number(cell: &str) -> f64 {
    let is_part = |c: char| c.is_ascii_digit() || ".e-".contains(c);
    let cell = cell.trim_start_matches(['<', '=', '[']);
    let cell = cell.split_once("..").map_or(cell, |(low, _)| low);
    let (digits, rest) = cell.split_at(cell.find(|c| !is_part(c)).unwrap_or(cell.len()));
    let scale = match rest.chars().next() {
        Some('k') => 1e3,
        Some('M') => 1e6,
        Some('G') => 1e9,
        _ => 1.0,
    };
    digits.parse().map_or(f64::MAX, |number: f64| number * scale)
}

#[cfg(test)]
mod tests {
    use super::super::charts::charts;
    use super::super::record::case;
    use super::*;

    fn markdown(records: &[Record], is_interrupted: bool) -> String {
        super::markdown(records, &parts(records, &charts(records), &Peaks::default(), is_interrupted))
    }

    #[test]
    fn a_feature_is_compared_with_the_same_case_without_it() {
        let records = [
            case("slabs", "compute", "", 1e-3, &[10.0, 10.1]),
            case("slabs", "compute", "stop=0", 1e-3, &[10.0, 10.1]),
            case("slabs", "compute", "empty-space=march", 1e-3, &[8.0, 8.1]),
            case("slabs", "compute", "step=2,stop=0.01", 2e-3, &[5.0]),
            case("slabs", "compute", "stop=0.01", 2e-3, &[5.0, 5.1]),
            case("slabs", "raster", "empty-space=march", 1e-3, &[1.0]),
            case("slices-3d", "raster", "target=rgba8", 1e-3, &[4.0]),
            case("slices-3d", "raster", "target=rgba8,dither=blue", 1e-3, &[5.0]),
        ];
        let rows = features(&records.iter().collect::<Vec<_>>());
        let texts: Vec<String> = rows.iter().skip(1).map(|row| row.join(" ")).collect();
        // The default of `stop` is not 0 and gives a row too.
        assert_eq!(texts.len(), 4, "{texts:?}");
        assert!(
            texts[3].starts_with("dither: none → blue slices-3d raster target=rgba8 4.00 5.00 1.25"),
            "{texts:?}"
        );
        assert!(texts[0].starts_with("empty-space: march → skip slabs compute  8.01 10.0 1.25"), "{texts:?}");
        assert!(texts[2].starts_with("stop: 0 → 0.01 slabs compute  10.0 5.00 0.50"), "{texts:?}");
    }

    #[test]
    fn columns_sort_by_numbers() {
        let cells = ["12.5", "<=3", "-", "1.5e-3", "[9.5, 10.5]", "0.91..1.02", "5.2M", "40.1 %"];
        assert_eq!(cells.map(number), [12.5, 3.0, f64::MAX, 1.5e-3, 9.5, 0.91, 5.2e6, 40.1]);
    }

    #[test]
    fn the_page_has_all_parts_and_loads_nothing() {
        let mut one = case("slabs", "compute", "", 1e-3, &[10.0]);
        (one.scene, one.run.processor) = ("<a>".to_string(), "p & q".to_string());
        let records = [one];
        let charts = charts(&records);
        let html = html(&records, &parts(&records, &charts, &Peaks::default(), true));
        for part in
            ["<h2>&lt;a&gt;, perspective", "p &amp; q, 0 usable", "<svg", ">stopped early", "data-v=\"10\""]
        {
            assert!(html.contains(part.trim_start_matches('>')), "{part}: {html}");
        }
        assert!(!html.contains("https://") && !html.contains("src="), "{html}");
    }

    #[test]
    fn splats_have_rates() {
        let mut ewa = case("splat-ewa", "compute", "order=center", 1e-3, &[10.0]);
        ewa.counters.insert("pairs".to_string(), serde_json::json!(50_000));
        let text = markdown(std::slice::from_ref(&ewa), false);
        assert!(text.contains("1000 points.") && text.contains("| pairs/s | evaluations/s |"), "{text}");
        assert!(text.contains("| splat-ewa | compute | order=center | 1.00e-3 | 2.00e-3 | 10.0 |"), "{text}");
        assert!(text.contains("| - | 5M | 320M |"), "{text}");
        ewa.counters.insert("splat_bytes".to_string(), serde_json::json!(88));
        let text = markdown(std::slice::from_ref(&ewa), false);
        assert!(text.contains("| bytes/splat |") && text.contains("| 320M | 88.0 |"), "{text}");
        let mut grid = case("slabs", "compute", "", 1e-3, &[10.0]);
        for (name, number) in [("samples", 20_000), ("fetches", 160_000)] {
            grid.counters.insert(name.to_string(), serde_json::json!(number));
        }
        let text = markdown(std::slice::from_ref(&grid), false);
        assert!(!text.contains("pairs/s") && text.contains("| samples | fetches | samples/s |"), "{text}");
        assert!(text.contains("| 20k | 160k | 2M |"), "{text}");
    }

    #[test]
    fn meshes_have_rates_and_refused_cases_their_reason() {
        let mut havs = case("havs", "compute", "", 1e-3, &[10.0]);
        havs.counters.insert("fragments".to_string(), serde_json::json!(50_000));
        havs.device_bytes = Some(3 << 20);
        havs.scene = "a|b".to_string();
        let mut refused = havs.clone();
        refused.skipped = Some("no <memory>".to_string());
        refused.wall_ms = None;
        let records = [havs, refused];
        let text = markdown(&records, true);
        assert!(
            text.contains(
                "| havs | compute |  | 1.00e-3 | 2.00e-3 | 10.0 | \\[10.0, 10.0\\] | 3.00 | 100k | 5M |"
            ),
            "{text}"
        );
        assert!(
            text.contains("| havs | compute |  | no \\<memory> |") && text.contains("was stopped"),
            "{text}"
        );
        assert!(
            text.contains("## a\\|b, perspective, 64 x 48") && text.contains("(fronts-a-b-perspective.svg)"),
            "{text}"
        );
    }
}
