//! report.html of `compare`: a single file that works offline and without scripts.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use volraster::measure::{HEAT_KNOTS, HEAT_NON_FINITE};

use super::error_table::{errors_table, refusals};
use super::pass_bars::passes;
use super::row::{Row, scientific, time};
use super::truth::{Distance, Picture};
use crate::cli::markup::escape_xml;
use crate::cli::report;

/// The content of the report.
#[derive(Debug)]
pub(crate) struct Page {
    pub(crate) title: String,
    /// Names and values at the head.
    pub(crate) facts: Vec<(&'static str, String)>,
    /// The ground truth; of trained splats one of each rule.
    pub(crate) truths: Vec<Picture>,
    /// How far each two of them are apart.
    pub(crate) distances: Vec<Distance>,
    pub(crate) rows: Vec<Row>,
    /// Technique, route and reason of each technique that did not draw.
    pub(crate) refused: Vec<[String; 3]>,
}

impl Page {
    /// Returns the distances between rules as a table with headings, where there are several.
    pub(crate) fn matrix(&self) -> Option<Vec<Vec<String>>> {
        let names: Vec<&str> = self.truths.iter().filter_map(|truth| truth.name).collect();
        let cell = |row: &str, column: &str| {
            let between =
                |distance: &&Distance| distance.rules.contains(&row) && distance.rules.contains(&column);
            let found = self.distances.iter().find(between).filter(|_| row != column);
            found.map_or_else(|| "0".to_string(), |distance| scientific(distance.rmse).1)
        };
        let line = |row: &str| {
            std::iter::once(row.to_string()).chain(names.iter().map(|column| cell(row, column))).collect()
        };
        let head = std::iter::once("rule").chain(names.iter().copied()).map(str::to_string).collect();
        (!self.distances.is_empty())
            .then(|| std::iter::once(head).chain(names.iter().map(|row| line(row))).collect())
    }
}

/// Returns the report as HTML.
pub(crate) fn html(page: &Page) -> String {
    let mut out = String::new();
    errors_table(&mut out, &page.rows);
    refusals(&mut out, &page.refused);
    passes(&mut out, &page.rows);
    pictures(&mut out, page);
    differences(&mut out, page);
    report::page(&page.title, &page.facts, &out)
}

/// Writes the images of the ground truth and of each technique, with heat maps and counters.
fn pictures(out: &mut String, page: &Page) {
    out.push_str("<section>\n<h2>Images</h2>\n");
    legend(out);
    let small = page.rows.first().is_some_and(|row| row.errors.width < 256);
    let _ = writeln!(out, "<div class=\"cards{}\">", if small { " small" } else { "" });
    for Picture { name, png, what } in &page.truths {
        let rule = name.map_or_else(String::new, |name| format!(" <span>{name}</span>"));
        let _ = writeln!(
            out,
            "<article>\n<h3>Ground truth{rule}</h3>\n<div class=\"pair\"><figure>{}<figcaption>{}</figcaption></figure></div>\n</article>",
            image(png, "The ground truth"),
            escape_xml(what)
        );
    }
    for row in &page.rows {
        let [picture, heat] = &row.pictures;
        let name = format!("{} by {}", row.technique, row.route);
        let _ = write!(
            out,
            "<article id=\"{}\">\n<h3>{} <span>{}</span></h3>\n<p class=\"options\">{}</p>\n<div class=\"pair\">\
             <figure>{}<figcaption>{} ms</figcaption></figure><figure>{}<figcaption>RMSE {}, max {}</figcaption></figure></div>\n",
            escape_xml(&row.stem),
            escape_xml(&row.technique),
            escape_xml(&row.route),
            escape_xml(&row.options),
            image(picture, &name),
            time(row.wall.as_ref()).1,
            image(heat, &format!("Error of {name}")),
            scientific(row.errors.all.rmse).1,
            scientific(row.errors.all.max_abs).1,
        );
        if !row.counters.is_empty() {
            out.push_str("<details><summary>Counters</summary><table>\n");
            for (name, count) in &row.counters {
                let _ =
                    writeln!(out, "<tr><td class=\"text\">{}</td><td>{count}</td></tr>", escape_xml(name));
            }
            out.push_str("</table></details>\n");
        }
        out.push_str("</article>\n");
    }
    out.push_str("</div>\n</section>\n");
}

/// Returns the element of a PNG.
fn image(bytes: &[u8], about: &str) -> String {
    format!("<img src=\"data:image/png;base64,{}\" alt=\"{}\">", BASE64.encode(bytes), escape_xml(about))
}

/// Writes how far the rules of trained splats are apart, in numbers and pictures.
fn differences(out: &mut String, page: &Page) {
    let Some(matrix) = page.matrix() else { return };
    out.push_str(
        "<section>\n<h2>Distances between rules</h2>\n<p class=\"note\">RMSE between ground truths.</p>\n<div class=\"scroll\">\n<table>\n<tbody>\n",
    );
    for line in &matrix {
        let cells = line.iter().map(|text| format!("<td>{}</td>", escape_xml(text)));
        let _ = writeln!(out, "<tr>{}</tr>", cells.collect::<String>());
    }
    out.push_str("</tbody>\n</table>\n</div>\n<div class=\"cards small\">\n");
    for Distance { rules: [one, other], rmse, heat } in &page.distances {
        let about = format!("{one} – {other}");
        let _ = writeln!(
            out,
            "<article>\n<h3>{about}</h3>\n<figure>{}<figcaption>RMSE {}</figcaption></figure>\n</article>",
            image(heat, &about),
            scientific(*rmse).1
        );
    }
    out.push_str("</div>\n</section>\n");
}

/// Writes the colour scale of the heat maps, which is the same in every report.
fn legend(out: &mut String) {
    let css = |colour: [f64; 3]| {
        let [r, g, b] = colour.map(|c| format!("{:.0}", 255.0 * c));
        format!("rgb({r},{g},{b})")
    };
    let stops: Vec<String> = HEAT_KNOTS.iter().map(|(_, colour)| css(*colour)).collect();
    let _ = write!(
        out,
        "<div class=\"legend\"><p>Heat maps show the largest absolute error of a pixel's four channels, on one scale for all:</p>\
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::timing::Quantiles;
    use volraster::Image;
    use volraster::measure::ImageErrors;

    fn row(stem: &str, error: f32, ms: f64) -> Row {
        let image = |value: f32| Image::new(2, 1, vec![[value; 4]; 2]).unwrap();
        Row {
            stem: stem.to_string(),
            technique: "slabs<".to_string(),
            route: "compute".to_string(),
            options: "step=\"2\"".to_string(),
            errors: ImageErrors::between(&image(error), &image(0.0)).unwrap(),
            wall: Quantiles::new(vec![ms]),
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
            truths: vec![Picture { name: None, png: b"truth".to_vec(), what: "float64".to_string() }],
            distances: Vec::new(),
            rows: vec![row("slabs", 0.25, 4.0), row("slabs-2", 0.5, 2.0)],
            refused: vec![["havs".to_string(), "interlock".to_string(), "has no <it>".to_string()]],
        }
    }

    #[test]
    fn the_page_contains_everything_and_escapes_text() {
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
        // The page loads nothing from elsewhere.
        assert!(!html.contains("http://") && !html.contains("https://") && !html.contains("url("), "{html}");
        // The best of each column is highlighted; equal values are all highlighted.
        let best: Vec<&str> =
            html.split("class=\"best\">").skip(1).map(|rest| rest.split('<').next().unwrap()).collect();
        assert_eq!(best, ["2.50e-1", "2.50e-1", "2.50e-1", "2.50e-1", "3.00", "2.00", "3.00"]);
    }

    #[test]
    fn rules_have_a_matrix_of_distances_and_pictures() {
        let picture =
            |name| Picture { name: Some(name), png: b"truth".to_vec(), what: "float64".to_string() };
        let distance = Distance { rules: ["khr", "ray"], rmse: 0.0125, heat: b"heat".to_vec() };
        let page = Page { truths: vec![picture("khr"), picture("ray")], distances: vec![distance], ..page() };
        let lines = page.matrix().unwrap();
        assert_eq!(lines, [["rule", "khr", "ray"], ["khr", "0", "1.25e-2"], ["ray", "1.25e-2", "0"]]);
        let html = html(&page);
        for part in ["<td>1.25e-2</td>", "khr – ray", "aGVhdA==", "Ground truth <span>ray</span>"] {
            assert!(html.contains(part), "{part}");
        }
        assert!(self::page().matrix().is_none());
    }

    #[test]
    fn columns_without_information_are_left_out() {
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
