//! Fronts of techniques in one view: their table, their JSON, and what their plot shows.

use serde_json::{Value, json};
use volraster::Technique;
use volraster::measure::{Cost, Front, TimeAt};
use volraster::technique::Method;

use super::{input, plot, table};

/// Errors at which times are told, with their names.
const ERRORS: [(&str, f64); 4] = [("1e-2", 1e-2), ("1/255", 1.0 / 255.0), ("1e-3", 1e-3), ("1e-4", 1e-4)];

/// A setting with its time and error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measured {
    pub(crate) technique: Technique,
    pub(crate) route: &'static str,
    /// Median wall time in milliseconds, and RMSE.
    pub(crate) cost: Cost,
}

/// The front of one technique, over all its routes and options.
#[derive(Debug)]
struct Line {
    method: Method,
    measured: Vec<Measured>,
    front: Front,
}

/// The fronts of all techniques.
#[derive(Debug)]
pub(crate) struct Fronts {
    lines: Vec<Line>,
}

impl Fronts {
    /// Takes what was measured in one view of some techniques.
    pub(crate) fn new(methods: &[Method], measured: &[Measured]) -> Self {
        let line = |method: Method| {
            let of_method = |one: &&Measured| one.technique.method() == method;
            let measured: Vec<Measured> = measured.iter().filter(of_method).copied().collect();
            let costs: Vec<Cost> = measured.iter().map(|one| one.cost).collect();
            Line { method, measured, front: Front::new(&costs) }
        };
        Self { lines: Method::ALL.into_iter().filter(|method| methods.contains(method)).map(line).collect() }
    }

    /// Times at the errors, one row for each technique.
    pub(crate) fn table(&self) -> String {
        let heading = ["ms at rmse"].into_iter().chain(ERRORS.map(|(name, _)| name));
        let mut rows = vec![heading.map(str::to_string).collect::<Vec<_>>()];
        for line in &self.lines {
            let cells = ERRORS.map(|(_, error)| cell(line.front.time_at(error)));
            rows.push([line.method.name().to_string()].into_iter().chain(cells).collect());
        }
        table::aligned(&rows, &[0])
    }

    /// Members of each front and times at the errors.
    pub(crate) fn json(&self) -> Value {
        let line = |line: &Line| {
            let member = |(place, cost): &(usize, Cost)| {
                let Measured { technique, route, .. } = &line.measured[*place];
                let options = input::options_json(technique);
                json!({"ms": cost.time, "rmse": cost.error, "route": route, "options": options})
            };
            let at = |(_, error): (&str, f64)| {
                let time = line.front.time_at(error);
                json!({"rmse": error, "ms": time.time(), "at_most": matches!(time, TimeAt::AtMost(_))})
            };
            json!({
                "technique": line.method.name(),
                "members": line.front.members().iter().map(member).collect::<Vec<_>>(),
                "at": ERRORS.map(at),
            })
        };
        Value::Array(self.lines.iter().map(line).collect())
    }

    /// The fronts as a picture; `None` where nothing has a time and an error that logarithms can show.
    pub(crate) fn svg(&self, title: &str) -> Option<std::result::Result<String, String>> {
        let shown = |cost: &Cost| cost.error > 0.0;
        let series = |line: &Line| plot::Series {
            name: line.method.name(),
            line: line.front.members().iter().map(|(_, cost)| *cost).filter(shown).collect(),
            dots: line.measured.iter().map(|one| one.cost).filter(shown).collect(),
        };
        let series: Vec<plot::Series> = self.lines.iter().map(series).collect();
        plot::log_log(title, "ms a frame (median)", "RMSE", &series)
    }
}

/// A time in a table.
fn cell(time: TimeAt) -> String {
    match time {
        TimeAt::Interpolated(ms) => format!("{ms:.1}"),
        TimeAt::AtMost(ms) => format!("<={ms:.1}"),
        TimeAt::NotReached => "-".to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(technique: &str, time: f64, error: f64) -> Measured {
        let technique = Technique::parse(technique).unwrap();
        Measured { technique, route: "compute", cost: Cost { time, error } }
    }

    #[test]
    fn a_technique_s_front_is_over_all_its_options() {
        let methods = [Method::Raycast, Method::Slices2d, Method::Slices3d, Method::Slabs];
        let fronts = Fronts::new(
            &methods,
            &[
                measured("slabs:step=2", 10.0, 1e-2),
                measured("slabs:integrator=full", 30.0, 2e-2),
                measured("raycast", 5.0, 5e-3),
                measured("slabs", 1000.0, 1e-4),
            ],
        );
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
    fn a_picture_names_what_it_shows() {
        let both = [measured("slabs", 10.0, 1e-2), measured("slabs:step=2", 3.0, 3e-2)];
        let fronts = Fronts::new(&Method::ALL, &both);
        let svg = fronts.svg("a <scene>").unwrap().unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{svg}");
        for part in ["a &lt;scene&gt;", "slabs", "RMSE", "0.01", "polyline"] {
            assert!(svg.contains(part), "{part}: {svg}");
        }
        assert!(!svg.contains("raycast"), "no line without a point");
        assert!(Fronts::new(&Method::ALL, &[measured("slabs", 10.0, 0.0)]).svg("t").is_none());
    }
}
