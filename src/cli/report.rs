//! report.html of `compare`: one file that needs nothing else, with or without a network or scripts.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use volraster::measure::{HEAT_KNOTS, HEAT_NON_FINITE, ImageErrors};

use super::picture::escaped;
use super::plot::three_digits;
use super::timing::Spread;

/// What a page shows.
#[derive(Debug)]
pub(crate) struct Page {
    pub(crate) title: String,
    /// Names and values above everything.
    pub(crate) facts: Vec<(&'static str, String)>,
    /// The truth as PNG, and what it is.
    pub(crate) truth: (Vec<u8>, String),
    pub(crate) rows: Vec<Row>,
    /// Technique, route and why it did not draw.
    pub(crate) refused: Vec<[String; 3]>,
}

/// What a technique gave.
#[derive(Debug)]
pub(crate) struct Row {
    pub(crate) stem: String,
    pub(crate) technique: String,
    pub(crate) route: String,
    pub(crate) options: String,
    pub(crate) errors: ImageErrors,
    pub(crate) wall: Option<Spread>,
    pub(crate) gpu: Option<Spread>,
    pub(crate) passes: Vec<(String, f64)>,
    pub(crate) counters: Vec<(String, u64)>,
    pub(crate) device_bytes: u64,
    /// The picture and its error as PNG.
    pub(crate) pictures: [Vec<u8>; 2],
}

/// A column of the table: its head, what it is, a value to sort by and its text.
struct Column {
    head: &'static str,
    about: &'static str,
    cell: fn(&Row) -> (f64, String),
    /// Whether the smallest value is marked.
    marks_best: bool,
}

const COLUMNS: [Column; 11] = [
    Column {
        head: "RMSE",
        about: "root of the mean squared error",
        cell: |row| scientific(row.errors.all.rmse),
        marks_best: true,
    },
    Column {
        head: "max",
        about: "largest error",
        cell: |row| scientific(row.errors.all.max_abs),
        marks_best: true,
    },
    Column {
        head: "p99",
        about: "99 % of the samples have this error or less",
        cell: |row| scientific(row.errors.all.p99),
        marks_best: true,
    },
    Column {
        head: "p99.9",
        about: "99.9 % of the samples have this error or less",
        cell: |row| scientific(row.errors.all.p999),
        marks_best: true,
    },
    Column {
        head: "bias",
        about: "mean error, positive where the image is too bright",
        cell: |row| bias(row.errors.all.bias),
        marks_best: false,
    },
    Column {
        head: "> 1/255",
        about: "share of the pixels with a larger error in some channel",
        cell: |row| (row.errors.above_1_255, format!("{:.2} %", 100.0 * row.errors.above_1_255)),
        marks_best: false,
    },
    Column {
        head: "NaN",
        about: "samples that are NaN or infinite",
        cell: |row| (row.errors.non_finite as f64, row.errors.non_finite.to_string()),
        marks_best: false,
    },
    Column {
        head: "ms",
        about: "median wall time of a frame, from recording to fence",
        cell: |row| time(row.wall.as_ref()),
        marks_best: true,
    },
    Column {
        head: "95 %",
        about: "where that median lies with 95 % (bootstrap)",
        cell: |row| interval(row.wall.as_ref()),
        marks_best: false,
    },
    Column {
        head: "GPU ms",
        about: "median sum of the passes' times on the device",
        cell: |row| time(row.gpu.as_ref()),
        marks_best: true,
    },
    Column {
        head: "MiB",
        about: "device memory that scene and frame take",
        cell: |row| mebibytes(row.device_bytes),
        marks_best: true,
    },
];

/// The page as HTML.
pub(crate) fn html(page: &Page) -> String {
    let mut out = String::new();
    let title = escaped(&page.title);
    // Writing into a string cannot fail.
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <link rel=\"icon\" href=\"data:,\">\n<style>{STYLE}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n<dl class=\"facts\">\n"
    );
    for (name, value) in &page.facts {
        let _ = writeln!(out, "<div><dt>{}</dt><dd>{}</dd></div>", escaped(name), escaped(value));
    }
    out.push_str("</dl>\n</header>\n<main>\n");
    errors_table(&mut out, &page.rows);
    refusals(&mut out, &page.refused);
    passes(&mut out, &page.rows);
    pictures(&mut out, page);
    let _ = write!(out, "</main>\n<script>{SCRIPT}</script>\n</body>\n</html>\n");
    out
}

fn errors_table(out: &mut String, rows: &[Row]) {
    out.push_str(
        "<section>\n<h2>Errors and times</h2>\n<p class=\"note\">Errors are over all pixels and the four channels of premultiplied \
         linear RGBA. The best of a column is bold. <span class=\"js\">Click a head to sort.</span></p>\n<div class=\"scroll\">\n<table class=\"sortable\">\n<thead><tr>",
    );
    // A column that is empty, or in which all is well, is no news.
    let has_options = rows.iter().any(|row| !row.options.is_empty());
    for head in ["technique", "route"].into_iter().chain(has_options.then_some("options")) {
        let _ = write!(out, "<th scope=\"col\" class=\"text\">{head}</th>");
    }
    let has_nan = rows.iter().any(|row| row.errors.non_finite > 0);
    let columns: Vec<&Column> = COLUMNS.iter().filter(|column| has_nan || column.head != "NaN").collect();
    for Column { head, about, .. } in &columns {
        let _ = write!(out, "<th scope=\"col\" title=\"{}\">{}</th>", escaped(about), escaped(head));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    // What reads the same is as good.
    let best = columns.iter().map(|column| {
        let cells = rows.iter().map(|row| (column.cell)(row)).filter(|(value, _)| value.is_finite());
        let best = cells.min_by(|a, b| a.0.total_cmp(&b.0));
        best.filter(|_| column.marks_best && rows.len() > 1).map(|(_, text)| text)
    });
    let best: Vec<Option<String>> = best.collect();
    for row in rows {
        let (stem, technique) = (escaped(&row.stem), escaped(&row.technique));
        let _ = write!(
            out,
            "<tr><th scope=\"row\" class=\"text\"><a href=\"#{stem}\">{technique}</a></th><td class=\"text route\">{}</td>",
            escaped(&row.route)
        );
        if has_options {
            let _ = write!(out, "<td class=\"text options\">{}</td>", escaped(&row.options));
        }
        for (column, best) in columns.iter().zip(&best) {
            let (value, text) = (column.cell)(row);
            let class = if best.as_ref() == Some(&text) { " class=\"best\"" } else { "" };
            let _ = write!(out, "<td data-v=\"{value:e}\"{class}>{}</td>", escaped(&text));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody>\n</table>\n</div>\n</section>\n");
}

fn refusals(out: &mut String, refused: &[[String; 3]]) {
    if refused.is_empty() {
        return;
    }
    out.push_str("<section>\n<h2>Not drawn</h2>\n<div class=\"scroll\">\n<table>\n<thead><tr><th class=\"text\">technique</th><th class=\"text\">route</th><th class=\"text\">why</th></tr></thead>\n<tbody>\n");
    for cells in refused {
        let cells: String =
            cells.iter().map(|cell| format!("<td class=\"text\">{}</td>", escaped(cell))).collect();
        let _ = writeln!(out, "<tr>{cells}</tr>");
    }
    out.push_str("</tbody>\n</table>\n</div>\n</section>\n");
}

/// Passes of a row with their names without the technique's; those below a hundredth of their sum are one, at the end.
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

fn passes(out: &mut String, rows: &[Row]) {
    let sum = |row: &Row| row.passes.iter().map(|(_, ms)| ms).sum::<f64>();
    let most = rows.iter().map(sum).fold(0.0, f64::max);
    if most <= 0.0 {
        return;
    }
    out.push_str(
        "<section>\n<h2>Time per pass</h2>\n<p class=\"note\">Medians on the device, in ms; errors.json has every pass. \
         All bars have one scale.</p>\n<div class=\"passes\">\n",
    );
    // A pass has one colour in all rows.
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
            let (name, time) = (escaped(name), three_digits(*ms));
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
            escaped(&row.technique),
            escaped(&row.route),
            three_digits(sum(row))
        );
    }
    out.push_str("</div>\n</section>\n");
}

fn pictures(out: &mut String, page: &Page) {
    out.push_str("<section>\n<h2>Pictures</h2>\n");
    legend(out);
    let small = page.rows.first().is_some_and(|row| row.errors.width < 256);
    let _ = writeln!(out, "<div class=\"cards{}\">", if small { " small" } else { "" });
    let image = |bytes: &[u8], about: &str| {
        format!("<img src=\"data:image/png;base64,{}\" alt=\"{}\">", BASE64.encode(bytes), escaped(about))
    };
    let (truth, what) = &page.truth;
    let _ = writeln!(
        out,
        "<article>\n<h3>Truth</h3>\n<div class=\"pair\"><figure>{}<figcaption>{}</figcaption></figure></div>\n</article>",
        image(truth, "The truth"),
        escaped(what)
    );
    for row in &page.rows {
        let [picture, heat] = &row.pictures;
        let name = format!("{} by {}", row.technique, row.route);
        let _ = write!(
            out,
            "<article id=\"{}\">\n<h3>{} <span>{}</span></h3>\n<p class=\"options\">{}</p>\n<div class=\"pair\">\
             <figure>{}<figcaption>{} ms</figcaption></figure><figure>{}<figcaption>RMSE {}, max {}</figcaption></figure></div>\n",
            escaped(&row.stem),
            escaped(&row.technique),
            escaped(&row.route),
            escaped(&row.options),
            image(picture, &name),
            time(row.wall.as_ref()).1,
            image(heat, &format!("Error of {name}")),
            scientific(row.errors.all.rmse).1,
            scientific(row.errors.all.max_abs).1,
        );
        if !row.counters.is_empty() {
            out.push_str("<details><summary>Counters</summary><table>\n");
            for (name, count) in &row.counters {
                let _ = writeln!(out, "<tr><td class=\"text\">{}</td><td>{count}</td></tr>", escaped(name));
            }
            out.push_str("</table></details>\n");
        }
        out.push_str("</article>\n");
    }
    out.push_str("</div>\n</section>\n");
}

/// The scale of the error pictures, which is the same in every report.
fn legend(out: &mut String) {
    let css = |colour: [f64; 3]| {
        let [r, g, b] = colour.map(|c| format!("{:.0}", 255.0 * c));
        format!("rgb({r},{g},{b})")
    };
    let stops: Vec<String> = HEAT_KNOTS.iter().map(|(_, colour)| css(*colour)).collect();
    let _ = write!(
        out,
        "<div class=\"legend\"><p>Error pictures show the largest absolute error of a pixel's four channels, on one scale for all:</p>\
         <div class=\"scale\" style=\"background:linear-gradient(to right,{})\"></div><div class=\"marks\">",
        stops.join(",")
    );
    for (error, _) in HEAT_KNOTS {
        let _ =
            write!(out, "<span>{}</span>", if error < 1.0 { format!("{error:e}") } else { "1".to_string() });
    }
    let _ = writeln!(
        out,
        "</div><p><i class=\"swatch\" style=\"background:{}\"></i> NaN or infinite. Black: at most 1e-6.</p></div>",
        css(HEAT_NON_FINITE)
    );
}

fn scientific(value: f64) -> (f64, String) {
    (value, format!("{value:.2e}"))
}

fn bias(value: f64) -> (f64, String) {
    // Sorted by size: either sign is as wrong.
    (value.abs(), format!("{value:+.2e}").replace('-', "\u{2212}").replace("e\u{2212}", "e-"))
}

fn time(spread: Option<&Spread>) -> (f64, String) {
    spread.map_or((f64::INFINITY, "–".to_string()), |spread| (spread.median, three_digits(spread.median)))
}

fn interval(spread: Option<&Spread>) -> (f64, String) {
    spread.map_or((f64::INFINITY, "–".to_string()), |spread| {
        (spread.high - spread.low, format!("{} – {}", three_digits(spread.low), three_digits(spread.high)))
    })
}

fn mebibytes(bytes: u64) -> (f64, String) {
    let value = bytes as f64 / f64::from(1 << 20);
    (value, three_digits(value))
}

const STYLE: &str = include_str!("report.css");

const SCRIPT: &str = include_str!("report.js");

#[cfg(test)]
mod tests {
    use super::*;
    use volraster::Image;

    fn row(stem: &str, error: f32, ms: f64) -> Row {
        let image = |value: f32| Image::new(2, 1, vec![[value; 4]; 2]).unwrap();
        Row {
            stem: stem.to_string(),
            technique: "slabs<".to_string(),
            route: "compute".to_string(),
            options: "step=\"2\"".to_string(),
            errors: ImageErrors::between(&image(error), &image(0.0)).unwrap(),
            wall: Spread::new(vec![ms]),
            gpu: None,
            passes: [("a&b", 1.0), ("slabs<.c", 3.0), ("x", 0.01), ("y", 0.02)]
                .map(|(name, ms)| (name.to_string(), ms))
                .to_vec(),
            counters: vec![("samples".to_string(), 77)],
            device_bytes: 3 << 20,
            pictures: [b"one".to_vec(), b"two".to_vec()],
        }
    }

    fn page() -> Page {
        Page {
            title: "<script>alert(1)</script>".to_string(),
            facts: vec![("Data", "a & b".to_string())],
            truth: (b"truth".to_vec(), "float64".to_string()),
            rows: vec![row("slabs", 0.25, 4.0), row("slabs-2", 0.5, 2.0)],
            refused: vec![["havs".to_string(), "interlock".to_string(), "has no <it>".to_string()]],
        }
    }

    #[test]
    fn everything_stands_in_the_page_and_text_stays_text() {
        let html = html(&page());
        for part in [
            "&lt;script&gt;alert(1)",
            "a &amp; b",
            "slabs&lt;",
            "step=&quot;2&quot;",
            "a&amp;b",
            "has no &lt;it&gt;",
            "data:image/png;base64,b25l",
            "data:image/png;base64,dHdv",
            "data:image/png;base64,dHJ1dGg=",
            ">77<",
            ">3.00<",
            ">2 more <b>0.030<",
            "</i>c <b>",
            "rgb(0,255,255)",
            "href=\"#slabs-2\"",
            "id=\"slabs-2\"",
            "width:74.442%",
        ] {
            assert!(html.contains(part), "{part}");
        }
        assert!(!html.contains("<script>alert") && html.matches("<script>").count() == 1);
        // Nothing is fetched.
        assert!(!html.contains("http://") && !html.contains("https://") && !html.contains("url("), "{html}");
        // The better of each: one error, one time; what is equal is both.
        let best: Vec<&str> =
            html.split("class=\"best\">").skip(1).map(|rest| rest.split('<').next().unwrap()).collect();
        assert_eq!(best, ["2.50e-1", "2.50e-1", "2.50e-1", "2.50e-1", "3.00", "2.00", "3.00"]);
    }

    #[test]
    fn columns_without_news_are_left_out() {
        let heads = |page: &Page| html(page).split("<tbody>").next().unwrap().matches("<th ").count();
        let mut page = page();
        let all = heads(&page);
        for row in &mut page.rows {
            row.options.clear();
        }
        assert_eq!(heads(&page), all - 1);
        page.rows[1].errors.non_finite = 3;
        assert_eq!(heads(&page), all);
    }

    #[test]
    fn tags_are_closed_in_order() {
        let html = html(&page());
        let mut open: Vec<&str> = Vec::new();
        let mut rest = html.split("<script>").next().unwrap();
        while let Some((_, tail)) = rest.split_once('<') {
            let (tag, after) = tail.split_once('>').unwrap();
            rest = after;
            let name = tag.trim_start_matches('/').split([' ', '\n']).next().unwrap();
            if ["!doctype", "meta", "link", "img"].contains(&name) {
                continue;
            }
            if tag.starts_with('/') {
                assert_eq!(open.pop(), Some(name), "{tag}");
            } else {
                open.push(name);
            }
        }
        assert_eq!(open, ["html", "body"]);
    }
}
