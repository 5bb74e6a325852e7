//! Pareto fronts of time and error of each technique in one view: table, JSON and plot.

use serde_json::{Value, json};
use volraster::measure::{Cost, Front, TimeAt};
use volraster::technique::Method;

use super::record::Record;
use crate::cli::plot::{self, Picture, Series, Stroke, Titles};
use crate::cli::table;

/// Errors at which times are interpolated, with their names.
const ERRORS: [(&str, f64); 4] = [("1e-2", 1e-2), ("1/255", 1.0 / 255.0), ("1e-3", 1e-3), ("1e-4", 1e-4)];

/// The front of one technique over all its routes and options.
#[derive(Debug)]
struct TechniqueFront<'a> {
    method: Method,
    /// Records with their median wall time in milliseconds and their RMSE.
    measured: Vec<(&'a Record, Cost)>,
    front: Front,
}

/// The fronts of all techniques.
#[derive(Debug)]
pub(super) struct Fronts<'a> {
    lines: Vec<TechniqueFront<'a>>,
}

/// Returns the members of a front without those that are slower at an error that is the same but for half a percent.
fn distinct(members: &[(usize, Cost)]) -> impl Iterator<Item = &(usize, Cost)> {
    let mut last = f64::INFINITY;
    members.iter().filter(move |(_, cost)| {
        let differs = cost.error < 0.995 * last;
        last = if differs { cost.error } else { last };
        differs
    })
}

impl<'a> Fronts<'a> {
    /// Computes the fronts of the cases of one view. Wrong images do not count.
    pub(super) fn new(records: &[&'a Record]) -> Self {
        let line = |method: Method| {
            let own = || records.iter().copied().filter(move |record| record.technique == method.name());
            let measured: Vec<(&Record, Cost)> = own()
                .filter_map(|record| {
                    let cost = Cost { time: record.wall_ms.as_ref()?.median, error: record.rmse()? };
                    Some((record, cost))
                })
                .collect();
            let costs: Vec<Cost> = measured.iter().map(|(_, cost)| *cost).collect();
            own().next().map(|_| TechniqueFront { method, measured, front: Front::new(&costs) })
        };
        Self { lines: Method::ALL.into_iter().filter_map(line).collect() }
    }

    /// Returns the time at each error, one row per technique, below a heading.
    pub(super) fn rows(&self) -> Vec<Vec<String>> {
        let heading = ["ms at rmse"].into_iter().chain(ERRORS.map(|(name, _)| name));
        let mut rows = vec![heading.map(str::to_string).collect::<Vec<_>>()];
        for line in &self.lines {
            let cells = ERRORS.map(|(_, error)| cell(line.front.time_at(error)));
            rows.push([line.method.name().to_string()].into_iter().chain(cells).collect());
        }
        rows
    }

    /// Returns the rows as aligned text.
    pub(super) fn table(&self) -> String {
        table::aligned(&self.rows(), &[0])
    }

    /// Returns the members of each front, and the time at each error.
    pub(super) fn json(&self) -> Value {
        let line = |line: &TechniqueFront<'_>| {
            let member = |(place, cost): &(usize, Cost)| {
                let record = line.measured[*place].0;
                let (route, options) = (&record.route, &record.options);
                json!({"ms": cost.time, "rmse": cost.error, "route": route, "options": options})
            };
            let at = |(_, error): (&str, f64)| {
                let time = line.front.time_at(error);
                json!({"rmse": error, "ms": time.time(), "at_most": matches!(time, TimeAt::AtMost(_))})
            };
            json!({
                "technique": line.method.name(),
                "members": distinct(line.front.members()).map(member).collect::<Vec<_>>(),
                "at": ERRORS.map(at),
            })
        };
        Value::Array(self.lines.iter().map(line).collect())
    }

    /// Returns the fronts as a plot; `None` if no case has a positive time and error.
    pub(super) fn picture(&self, title: &str, note: &str) -> Option<Picture> {
        let place = |cost: &Cost| [cost.time, cost.error];
        let series = |line: &TechniqueFront<'_>| Series {
            name: line.method.name().to_string(),
            style: style(line.method.name()),
            stroke: Stroke::Solid,
            line: distinct(line.front.members()).map(|(_, cost)| place(cost)).collect(),
            dots: line.measured.iter().map(|(_, cost)| place(cost)).collect(),
        };
        let titles = Titles {
            title: title.to_string(),
            note: note.to_string(),
            x: "ms per frame (median)",
            y: "RMSE against the reference",
        };
        plot::curves(&titles, self.lines.iter().map(series).collect())
    }
}

/// Returns the index of colour and mark of a technique, the same in all plots.
pub(super) fn style(technique: &str) -> usize {
    Method::ALL.iter().position(|method| method.name() == technique).unwrap_or(Method::ALL.len())
}

/// Formats a time.
fn cell(time: TimeAt) -> String {
    match time {
        TimeAt::Interpolated(ms) => format!("{ms:.1}"),
        TimeAt::AtMost(ms) => format!("<={ms:.1}"),
        TimeAt::NotReached => "-".to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::case;
    use super::*;

    fn measured(technique: &str, options: &str, time: f64, error: f64) -> Record {
        case(technique, "compute", options, error, &[time])
    }

    #[test]
    fn a_front_covers_all_options_of_a_technique() {
        let mut refused = measured("slices-2d", "", 1.0, 1e-2);
        refused.wall_ms = None;
        let mut wrong = measured("slices-3d", "", 1.0, 1e-5);
        wrong.wrong = true;
        let cases = [
            measured("slabs", "step=2", 10.0, 1e-2),
            measured("slabs", "integrator=full", 30.0, 2e-2),
            measured("raycast", "", 5.0, 5e-3),
            measured("slabs", "", 1000.0, 1e-4),
            refused,
            wrong,
        ];
        let fronts = Fronts::new(&cases.iter().collect::<Vec<_>>());
        let expected = "\
            ms at rmse   1e-2  1/255   1e-3    1e-4\n\
            slices-2d       -      -      -       -\n\
            slices-3d       -      -      -       -\n\
            slabs        10.0   25.5  100.0  1000.0\n\
            raycast     <=5.0      -      -       -";
        assert_eq!(fronts.table(), expected);
        let json = fronts.json();
        let slabs = &json[2];
        assert_eq!(slabs["technique"], "slabs");
        assert_eq!(slabs["members"].as_array().unwrap().len(), 2);
        assert_eq!(slabs["members"][0]["options"]["step"], 2.0);
        assert_eq!((&slabs["at"][3]["ms"], &slabs["at"][3]["at_most"]), (&json!(1000.0), &json!(false)));
        let rays = &json[3]["at"];
        assert_eq!((&rays[0]["ms"], &rays[0]["at_most"]), (&json!(5.0), &json!(true)));
        assert_eq!(rays[1]["ms"], Value::Null);
    }

    #[test]
    fn a_plot_names_its_curves() {
        let both = [measured("slabs", "", 10.0, 1e-2), measured("slabs", "step=2", 3.0, 3e-2)];
        let fronts = Fronts::new(&both.iter().collect::<Vec<_>>());
        let svg = fronts.picture("a <scene>", "note").unwrap().svg();
        for part in ["a &lt;scene&gt;", "slabs", "RMSE", ">0.01<", "polyline"] {
            assert!(svg.contains(part), "{part}: {svg}");
        }
        assert!(!svg.contains("raycast"), "no line without a point");
        let perfect = measured("slabs", "", 10.0, 0.0);
        assert!(Fronts::new(&[&perfect]).picture("t", "n").is_none());
    }
}
