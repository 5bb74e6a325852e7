//! table.md: the results of `bench` as Markdown.

use std::fmt::Write as _;

use super::charts::{Chart, view_title};
use super::fronts::Fronts;
use super::record::{Record, dash, views, word};
use crate::cli::markup::{escape_markdown, link_address};
use crate::cli::numbers::{count, three_digits};
use crate::cli::timing::{Quantiles, ratio};

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

/// Kernel evaluations per pair of a splat and a tile: one per pixel.
const EVALUATIONS: f64 = 64.0;

/// Returns the text of table.md.
pub(super) fn markdown(records: &[Record], charts: &[Chart], is_interrupted: bool) -> String {
    let mut text = String::from("# Benchmark\n\n");
    if let Some(first) = records.first() {
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "{}, {}, Vulkan {}; volraster {}. Times are wall times from recording to fence, medians in ms, in brackets \
             their 95 % confidence intervals (bootstrap). Errors are over premultiplied linear RGBA, relative to the float64 \
             reference.\n",
            escape_markdown(&first.device),
            escape_markdown(&first.driver),
            escape_markdown(&first.api),
            escape_markdown(&first.version)
        );
    }
    if is_interrupted {
        text.push_str("**The run was stopped early; the results are partial.**\n\n");
    }
    for view in views(records) {
        let _ = writeln!(text, "## {}\n", escape_markdown(&view_title(view[0])));
        let _ = writeln!(text, "{} {}.\n", view[0].elements, view[0].elements_name());
        let title = format!(": {}", view_title(view[0]));
        text.extend(charts.iter().filter(|chart| chart.title.ends_with(&title)).map(image));
        text.push_str("Time at equal error, in ms, of the best route and options (`<=`: even the coarsest setting is more accurate; `-`: not reached):\n\n");
        text.push_str(&table(&Fronts::new(&view).rows(), 1));
        text.push_str("\nEvery case:\n\n");
        text.push_str(&cases(&view));
        let features = features(&view);
        if features.len() > 1 {
            text.push_str("\nOptional features off and on, all other options equal:\n\n");
            text.push_str(&table(&features, 4));
        }
        let refused: Vec<Vec<String>> = view.iter().filter_map(|record| refusal(record)).collect();
        if !refused.is_empty() {
            text.push_str("\nNot drawn, or wrong:\n\n");
            let heading = ["technique", "route", "options", "why"].map(str::to_string).to_vec();
            text.push_str(&table(&[vec![heading], refused].concat(), 4));
        }
        text.push('\n');
    }
    let sizes: Vec<&Chart> = charts.iter().filter(|chart| chart.name.starts_with("size-")).collect();
    if !sizes.is_empty() {
        text.push_str("## Time over size\n\n");
        text.extend(sizes.into_iter().map(image));
    }
    text
}

fn image(chart: &Chart) -> String {
    format!("![{}]({}.svg)\n\n", escape_markdown(&chart.title), link_address(&chart.name))
}

/// Returns the table of all drawn cases of a view.
fn cases(view: &[&Record]) -> String {
    let median =
        |spread: &Option<Quantiles>| spread.as_ref().map_or_else(dash, |spread| three_digits(spread.median));
    let mebibytes = |bytes| three_digits(bytes as f64 / f64::from(1 << 20));
    let per_second = |record: &Record, number: Option<f64>| match (number, &record.wall_ms) {
        (Some(number), Some(spread)) => count(number / spread.median * 1e3),
        _ => dash(),
    };
    let (is_grid, is_mesh) = (view[0].data == "grid", view[0].data == "mesh");
    let has_splats = view.iter().any(|record| record.counter("pairs").is_some());
    let mut heading = vec!["technique", "route", "options", "RMSE", "max", "ms", "95 %", "gpu ms", "MiB"];
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
        row.extend([median(&record.gpu_ms), record.device_bytes.map_or_else(dash, mebibytes)]);
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
    table(&rows, 3)
}

/// Returns rows that compare cases that differ only in one feature.
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
                three_digits(before.median()),
                three_digits(after.median()),
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

#[cfg(test)]
mod tests {
    use super::super::charts::charts;
    use super::super::record::case;
    use super::*;

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
        assert!(texts[0].starts_with("empty-space: march → skip slabs compute  8.05 10.1 1.25"), "{texts:?}");
        assert!(texts[2].starts_with("stop: 0 → 0.01 slabs compute  10.1 5.05 0.50"), "{texts:?}");
    }

    #[test]
    fn splats_have_rates() {
        let mut ewa = case("splat-ewa", "compute", "order=center", 1e-3, &[10.0]);
        ewa.counters.insert("pairs".to_string(), serde_json::json!(50_000));
        let text = markdown(std::slice::from_ref(&ewa), &charts(std::slice::from_ref(&ewa)), false);
        assert!(text.contains("1000 points.") && text.contains("| pairs/s | evaluations/s |"), "{text}");
        assert!(text.contains("| splat-ewa | compute | order=center | 1.00e-3 | 2.00e-3 | 10.0 |"), "{text}");
        assert!(text.contains("| - | - | 5M | 320M |"), "{text}");
        ewa.counters.insert("splat_bytes".to_string(), serde_json::json!(88));
        let text = markdown(std::slice::from_ref(&ewa), &charts(std::slice::from_ref(&ewa)), false);
        assert!(text.contains("| bytes/splat |") && text.contains("| 320M | 88.0 |"), "{text}");
        let mut grid = case("slabs", "compute", "", 1e-3, &[10.0]);
        for (name, number) in [("samples", 20_000), ("fetches", 160_000)] {
            grid.counters.insert(name.to_string(), serde_json::json!(number));
        }
        let text = markdown(std::slice::from_ref(&grid), &charts(std::slice::from_ref(&grid)), false);
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
        let text = markdown(&records, &charts(&records), true);
        assert!(
            text.contains(
                "| havs | compute |  | 1.00e-3 | 2.00e-3 | 10.0 | \\[10.0, 10.0\\] | - | 3.00 | 100k | 5M |"
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
