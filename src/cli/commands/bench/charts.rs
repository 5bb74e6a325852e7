//! The plots of `bench`: fronts, share of the device's peaks, time per pass, time over size.

use volraster::technique::Method;

use super::fronts::{Fronts, style};
use super::record::{Record, views};
use crate::cli::numbers::count;
use crate::cli::plot::{self, Bar, Picture, Series, Stroke, Titles};

/// A plot, and the name of its file without the ending.
#[derive(Debug)]
pub(super) struct Chart {
    pub(super) name: String,
    /// Title in table.md.
    pub(super) title: String,
    pub(super) picture: Picture,
}

/// Makes all plots of some records.
pub(super) fn charts(records: &[Record]) -> Vec<Chart> {
    let mut charts = Vec::new();
    let mut add = |kind, of: &str, size: Option<[u32; 2]>, title, picture: Option<Picture>| {
        if let Some(picture) = picture {
            charts.push(Chart { name: file_name(&charts, kind, of, size), title, picture });
        }
    };
    type Draw = fn(&[&Record]) -> Option<Picture>;
    let kinds: [(&str, &str, Draw); 3] = [
        ("fronts", "Error over time", fronts),
        ("roof", "Time over what peaks allow", roof),
        ("passes", "Time per pass", passes),
    ];
    for (kind, what, draw) in kinds {
        for view in views(records) {
            let title = format!("{what}: {}", view_title(view[0]));
            add(kind, &view_name(view[0]), Some(view[0].size), title, draw(&view));
        }
    }
    for (of, picture, title) in growths(records) {
        add("size", &of, None, format!("Time over size: {title}"), picture);
    }
    charts
}

fn device(record: &Record) -> String {
    format!("{}, {}", record.device, record.driver)
}

/// Returns the title of a view.
pub(super) fn view_title(record: &Record) -> String {
    let [width, height] = record.size;
    format!("{}, {}, {width} x {height}", record.scene, record.projection)
}

fn view_name(record: &Record) -> String {
    format!("{}-{}", record.scene, record.projection)
}

/// Returns an unused file name; a second view of a scene has its size in it.
fn file_name(charts: &[Chart], kind: &str, of: &str, size: Option<[u32; 2]>) -> String {
    // Names of scenes in folders contain separators.
    let plain = |c: char| if c.is_alphanumeric() || "._-".contains(c) { c } else { '-' };
    let stem = format!("{kind}-{}", of.chars().map(plain).collect::<String>());
    let sized = size.map(|[width, height]| format!("{stem}-{width}x{height}"));
    let numbered = (2..).map(|n| format!("{stem}-{n}"));
    let mut names = std::iter::once(stem.clone()).chain(sized).chain(numbered);
    let free = names.find(|name| !charts.iter().any(|chart| chart.name == *name));
    // The numbered names never run out.
    free.unwrap_or(stem)
}

/// Selects one record per technique and route: the one with default options, else the first.
fn typical<'a>(view: &[&'a Record]) -> Vec<&'a Record> {
    let mut found: Vec<&Record> = Vec::new();
    for &record in view.iter().filter(|record| record.wall_ms.is_some() && record.rmse().is_some()) {
        let same = |known: &&mut &Record| known.technique == record.technique && known.route == record.route;
        match found.iter_mut().find(same) {
            Some(known) if record.options_text().is_empty() => *known = record,
            Some(_) => {}
            None => found.push(record),
        }
    }
    let place = |record: &&Record| (style(&record.technique), record.route != "compute");
    found.sort_by_key(place);
    found
}

fn name_of(record: &Record) -> String {
    let single = Method::from_name(&record.technique).is_ok_and(|method| method.routes().len() == 1);
    let name =
        if single { record.technique.clone() } else { format!("{} {}", record.technique, record.route) };
    match record.options_text() {
        options if options.is_empty() => name,
        options => format!("{name} {options}"),
    }
}

/// Returns the name of a pass without that of its technique.
fn short(pass: &str, record: &Record) -> String {
    let own = pass.strip_prefix(record.technique.as_str()).and_then(|rest| rest.strip_prefix('.'));
    own.unwrap_or(pass).to_string()
}

fn fronts(view: &[&Record]) -> Option<Picture> {
    Fronts::new(view).picture(&view_title(view[0]), &format!("Error over time; {}", device(view[0])))
}

/// Returns a plot of the measured times over those that the device's peaks allow; what is given to passes and not used may put a case below the roof.
fn roof(view: &[&Record]) -> Option<Picture> {
    let mut series: Vec<Series> = Vec::new();
    for record in view {
        let (Some(bound), Some(ms)) = (&record.bound, record.ms()) else { continue };
        let point = [bound.ms(), ms];
        match series.iter_mut().find(|one| one.name == record.technique) {
            Some(one) => one.line.push(point),
            None => series.push(Series {
                name: record.technique.clone(),
                style: style(&record.technique),
                stroke: Stroke::None,
                line: vec![point],
                dots: Vec::new(),
            }),
        }
    }
    let guide = |(name, share): (&str, f64)| Series {
        name: name.to_string(),
        style: 0,
        stroke: Stroke::Guide,
        line: [1e-9, 1e9].map(|least| [least, least / share]).to_vec(),
        dots: Vec::new(),
    };
    series.extend([("100 %", 1.0), ("10 %", 0.1), ("1 %", 0.01)].map(guide));
    let titles = Titles {
        title: view_title(view[0]),
        note: format!("Share of the device's peaks; {}", device(view[0])),
        x: "ms that the peaks allow",
        y: "ms per frame (median)",
    };
    plot::curves(&titles, series)
}

fn passes(view: &[&Record]) -> Option<Picture> {
    let bar = |record: &&Record| Bar {
        name: name_of(record),
        parts: record
            .passes_ms
            .iter()
            .filter_map(|(name, ms)| Some((short(name, record), ms.as_f64().filter(|ms| *ms > 0.0)?)))
            .collect(),
    };
    let titles = Titles {
        title: view_title(view[0]),
        note: format!("Time per pass on the device; {}", device(view[0])),
        x: "ms per frame (median of each pass)",
        y: "",
    };
    plot::bars(&titles, typical(view).iter().map(bar).collect())
}

/// The name and value of what varies along the x axis.
type Size = (&'static str, fn(&Record) -> f64);

/// Returns name, plot and title of time over voxels, tetrahedra, points and pixels; `None` for the plot where only one
/// size was measured.
fn growths(records: &[Record]) -> Vec<(String, Option<Picture>, String)> {
    let elements: fn(&Record) -> f64 = |record| record.elements as f64;
    let pixels: fn(&Record) -> f64 = |record| f64::from(record.size[0]) * f64::from(record.size[1]);
    let mut groups: Vec<(String, String, Size, Vec<Vec<&Record>>)> = Vec::new();
    for view in views(records) {
        let first = view[0];
        let [width, height] = first.size;
        let axis = first.elements_name();
        let family = first.family.as_ref().map(|family| {
            let title = format!("{family}, {}, {width} x {height}", first.projection);
            (format!("{axis}-{family}-{}", first.projection), title, (axis, elements))
        });
        let title = format!("{}, {}, {} {axis}", first.scene, first.projection, count(elements(first)));
        let scene = (format!("pixels-{}", view_name(first)), title, ("pixels", pixels));
        for (name, title, size) in family.into_iter().chain([scene]) {
            match groups.iter_mut().find(|group| group.0 == name && group.1 == title) {
                Some(group) => group.3.push(view.clone()),
                None => groups.push((name, title, size, vec![view.clone()])),
            }
        }
    }
    let groups = groups.into_iter();
    groups.map(|(name, title, size, views)| (name, growth(&title, size, &views), title)).collect()
}

fn growth(title: &str, (axis, size): Size, views: &[Vec<&Record>]) -> Option<Picture> {
    let mut series: Vec<Series> = Vec::new();
    for record in views.iter().flat_map(|view| typical(view)) {
        let Some(times) = &record.wall_ms else { continue };
        let (name, point) = (name_of(record), [size(record), times.median]);
        match series.iter_mut().find(|one| one.name == name) {
            Some(one) => one.line.push(point),
            None => series.push(Series {
                name,
                style: style(&record.technique),
                stroke: if record.route == "compute" { Stroke::Solid } else { Stroke::Dashed },
                line: vec![point],
                dots: Vec::new(),
            }),
        }
    }
    for one in &mut series {
        one.line.sort_by(|a, b| a[0].total_cmp(&b[0]));
        one.line.dedup_by(|a, b| a[0].total_cmp(&b[0]).is_eq());
    }
    series.retain(|one| one.line.len() > 1);
    let titles = Titles {
        title: title.to_string(),
        note: format!("Time over {axis}; {}", device(views[0][0])),
        x: axis,
        y: "ms per frame (median)",
    };
    plot::curves(&titles, series)
}

#[cfg(test)]
mod tests {
    use super::super::record::case;
    use super::*;
    use serde_json::json;

    fn sized(scene: &str, elements: u64, side: u32, technique: &str, route: &str, ms: f64) -> Record {
        let mut one = case(technique, route, "", 1e-3, &[ms]);
        (one.scene, one.elements, one.size) = (scene.to_string(), elements, [side, side]);
        one.family = Some("f".to_string());
        one.passes_ms.insert("draw".to_string(), json!(ms));
        one
    }

    #[test]
    fn every_size_that_varies_alone_has_a_plot() {
        let records = [
            sized("a", 1000, 64, "slabs", "compute", 1.0),
            sized("a", 1000, 64, "slices-3d", "raster", 3.0),
            sized("b/b", 8000, 64, "slabs", "compute", 4.0),
            sized("a", 1000, 128, "slabs", "compute", 5.0),
        ];
        let charts = charts(&records);
        let names: Vec<&str> = charts.iter().map(|chart| chart.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "fronts-a-perspective",
                "fronts-b-b-perspective",
                "fronts-a-perspective-128x128",
                "passes-a-perspective",
                "passes-b-b-perspective",
                "passes-a-perspective-128x128",
                "size-voxels-f-perspective",
                "size-pixels-a-perspective"
            ]
        );
        let svg = charts[6].picture.svg();
        assert!(svg.contains(">slabs compute<") && svg.contains(">voxels<"), "{svg}");
        // A single point is no curve.
        assert!(!svg.contains("slices-3d"), "{svg}");
    }

    #[test]
    fn a_technique_is_shown_by_its_defaults() {
        let mut cases = [
            case("slabs", "compute", "step=2", 1e-3, &[1.0]),
            case("slabs", "compute", "", 1e-3, &[2.0]),
            case("slabs", "compute", "step=4", 1e-3, &[3.0]),
            case("slices-2d", "raster", "filter=exact", 1e-3, &[3.0]),
        ];
        let names = |cases: &[Record]| {
            typical(&cases.iter().collect::<Vec<_>>()).into_iter().map(name_of).collect::<Vec<_>>()
        };
        assert_eq!(names(&cases), ["slices-2d raster filter=exact", "slabs compute"]);
        cases[1].wrong = true;
        assert_eq!(names(&cases)[1], "slabs compute step=2");
    }
}
