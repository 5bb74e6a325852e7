//! `bench --compare`: the ratio of the times of two runs, case by case.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};
use volraster::technique::Method;
use volraster::{Error, Result};

use super::record::Record;
use crate::cli::table;
use crate::cli::timing::{Ratio, Times, ratio};

/// The comparison of two runs, A and B.
#[derive(Debug)]
pub(crate) struct Ratios {
    pairs: Vec<Pair>,
    /// Cases that only one run timed.
    alone: [usize; 2],
    /// Device, driver and version of each run.
    devices: [String; 2],
}

/// A case that both runs timed.
#[derive(Debug)]
struct Pair {
    name: [String; 6],
    method: String,
    times: [Times; 2],
    errors: [Option<f64>; 2],
    ratio: Ratio,
}

impl Ratios {
    /// Compares the cases of two files.
    ///
    /// # Errors
    ///
    /// As [`Record::read`]; [`Error::Invalid`] if both runs have no timed case in common.
    pub(crate) fn of_files(files: [&Path; 2]) -> Result<Self> {
        let [a, b] = files.map(Record::read);
        let this = Self::new(&a?, &b?);
        if this.pairs.is_empty() {
            let why =
                format!("{} and {} have no timed case in common", files[0].display(), files[1].display());
            return Err(Error::Invalid { what: "compare".to_string(), why });
        }
        Ok(this)
    }

    fn new(a: &[Record], b: &[Record]) -> Self {
        let [timed_a, timed_b] = [a, b].map(|records| keyed(records));
        let mut pairs = Vec::new();
        for (key, one) in &timed_a {
            let Some((_, other)) = timed_b.iter().find(|(known, _)| known == key) else { continue };
            let times = [one, other]
                .map(|record| record.wall_ms.as_ref().and_then(|spread| Times::new(spread.times.clone())));
            let [Some(first), Some(second)] = times else { continue };
            let Some(ratio) = ratio(&[[&first, &second]]) else { continue };
            let [width, height] = one.size;
            pairs.push(Pair {
                name: [
                    one.scene.clone(),
                    one.projection.clone(),
                    format!("{width}x{height}"),
                    one.technique.clone(),
                    one.route.clone(),
                    one.options_text(),
                ],
                method: one.technique.clone(),
                times: [first, second],
                errors: [one, other].map(|record| record.error("rmse")),
                ratio,
            });
        }
        let alone = [timed_a.len() - pairs.len(), timed_b.len() - pairs.len()];
        let device = |records: &[Record]| {
            records.first().map_or_else(String::new, |one| {
                format!("{}, {}, version {}", one.device, one.driver, one.version)
            })
        };
        Self { pairs, alone, devices: [device(a), device(b)] }
    }

    /// Returns the geometric mean of the ratios and the number of cases of each technique, then of all.
    fn means(&self) -> Vec<(String, usize, Ratio)> {
        let mut names: Vec<&str> = Method::ALL.map(Method::name).to_vec();
        for pair in &self.pairs {
            if !names.contains(&pair.method.as_str()) {
                names.push(&pair.method);
            }
        }
        let mean = |name: String, wanted: &dyn Fn(&Pair) -> bool| {
            let times: Vec<[&Times; 2]> = self
                .pairs
                .iter()
                .filter(|pair| wanted(pair))
                .map(|pair| [&pair.times[0], &pair.times[1]])
                .collect();
            Some((name, times.len(), ratio(&times)?))
        };
        let of = |name: &str| mean(name.to_string(), &|pair: &Pair| pair.method == name);
        names.into_iter().filter_map(of).chain(mean("all".to_string(), &|_| true)).collect()
    }

    /// Returns the comparison as aligned text.
    pub(crate) fn text(&self) -> String {
        let heading = [
            "",
            "scene",
            "projection",
            "size",
            "technique",
            "route",
            "options",
            "ms A",
            "ms B",
            "B/A",
            "95 %",
            "rmse A",
            "rmse B",
        ];
        let mut rows = vec![heading.map(str::to_string).to_vec()];
        for pair in &self.pairs {
            let error = |error: Option<f64>| error.map_or_else(|| "-".to_string(), |e| format!("{e:.2e}"));
            let mut row = vec![mark(&pair.ratio).to_string()];
            row.extend(pair.name.clone());
            row.extend(pair.times.each_ref().map(|times| format!("{:.2}", times.median())));
            row.extend([number(&pair.ratio), interval(&pair.ratio)]);
            row.extend(pair.errors.map(error));
            rows.push(row);
        }
        let mut means = vec![["", "geometric mean", "cases", "B/A", "95 %"].map(str::to_string).to_vec()];
        for (name, count, ratio) in self.means() {
            means.push(vec![
                mark(&ratio).to_string(),
                name,
                count.to_string(),
                number(&ratio),
                interval(&ratio),
            ]);
        }
        let outside = self.pairs.iter().filter(|pair| pair.ratio.is_outside_noise()).count();
        let mut text = format!(
            "{}\n\n{}\n\n+ slower, - faster in B than in A, with a 95 % interval that excludes 1: {outside} of {} cases. Without any \
             change, about 1 case in 20 is marked by chance.",
            table::aligned(&rows, &[0, 1, 2, 4, 5, 6]),
            table::aligned(&means, &[0, 1]),
            self.pairs.len()
        );
        let [a, b] = &self.devices;
        // Writing into a string cannot fail.
        let _ = if a == b { write!(text, "\nA and B: {a}") } else { write!(text, "\nA: {a}\nB: {b}") };
        for (name, count) in ["A", "B"].into_iter().zip(self.alone).filter(|(_, count)| *count > 0) {
            let _ = write!(text, "\nTimed in {name} alone: {count}");
        }
        text
    }

    /// Returns the comparison as JSON.
    pub(crate) fn json(&self) -> Value {
        let of = |ratio: &Ratio| json!({"ratio": ratio.value, "low": ratio.low, "high": ratio.high, "outside_noise": ratio.is_outside_noise()});
        let case = |pair: &Pair| {
            let mut case = of(&pair.ratio);
            let keys = ["scene", "projection", "size", "technique", "route", "options"];
            for (key, value) in keys.into_iter().zip(&pair.name) {
                case[key] = json!(value);
            }
            case["ms"] = json!(pair.times.each_ref().map(Times::median));
            case["rmse"] = json!(pair.errors);
            case
        };
        let mean = |(name, count, ratio): &(String, usize, Ratio)| {
            let mut mean = of(ratio);
            mean["technique"] = json!(name);
            mean["cases"] = json!(count);
            mean
        };
        json!({
            "cases": self.pairs.iter().map(case).collect::<Value>(),
            "means": self.means().iter().map(mean).collect::<Value>(),
            "alone": self.alone,
        })
    }
}

fn mark(ratio: &Ratio) -> &'static str {
    match ratio {
        ratio if !ratio.is_outside_noise() => "",
        ratio if ratio.value > 1.0 => "+",
        _ => "-",
    }
}

pub(super) fn number(ratio: &Ratio) -> String {
    format!("{:.3}", ratio.value)
}

fn interval(ratio: &Ratio) -> String {
    format!("{:.3}..{:.3}", ratio.low, ratio.high)
}

/// The identity of a case: scene, projection, size, technique, route, options, and a number among equal ones.
type Key = (String, String, [u32; 2], String, String, String, usize);

/// Returns the timed records with their keys; equal cases of a run are numbered.
fn keyed(records: &[Record]) -> Vec<(Key, &Record)> {
    let mut keyed: Vec<(Key, &Record)> = Vec::new();
    for record in records.iter().filter(|record| record.wall_ms.is_some()) {
        let mut options: Vec<String> =
            record.options.iter().map(|(key, value)| format!("{key}={value}")).collect();
        options.sort();
        let mut key = (
            record.scene.clone(),
            record.projection.clone(),
            record.size,
            record.technique.clone(),
            record.route.clone(),
            options.join(","),
            0,
        );
        while keyed.iter().any(|(known, _)| *known == key) {
            key.6 += 1;
        }
        keyed.push((key, record));
    }
    keyed
}

#[cfg(test)]
mod tests {
    use super::super::record::tests::case;
    use super::*;

    #[test]
    fn equal_cases_are_paired_and_means_are_by_technique() {
        let a = [
            case("slabs", "compute", "step=2", 1e-3, &[10.0, 10.1, 9.9]),
            case("slabs", "compute", "step=1", 1e-3, &[10.0, 10.1, 9.9]),
            case("raycast", "compute", "", 1e-3, &[4.0, 4.1, 3.9]),
            case("slices-2d", "raster", "", 1e-3, &[1.0]),
        ];
        let b = [
            case("raycast", "compute", "", 1e-3, &[4.05, 3.95, 4.0]),
            case("slabs", "compute", "step=1", 1e-3, &[20.0, 20.2, 19.8]),
            case("slabs", "compute", "step=2", 2e-3, &[20.0, 20.2, 19.8]),
            case("slices-2d", "compute", "", 1e-3, &[1.0]),
        ];
        let ratios = Ratios::new(&a, &b);
        assert_eq!((ratios.pairs.len(), ratios.alone), (3, [1, 1]));
        let json = ratios.json();
        assert_eq!(json["cases"][0]["options"], "step=2");
        assert_eq!(json["cases"][0]["rmse"], json!([1e-3, 2e-3]));
        let close = |value: &Value, wanted: f64| {
            assert!((value.as_f64().unwrap() / wanted - 1.0).abs() < 1e-9, "{value}")
        };
        close(&json["cases"][0]["ratio"], 2.0);
        close(&json["means"][0]["ratio"], 2.0);
        assert_eq!(json["means"][0]["technique"], "slabs");
        close(&json["means"][2]["ratio"], 4.0_f64.cbrt());
        assert_eq!(
            (&json["cases"][0]["outside_noise"], &json["cases"][2]["outside_noise"]),
            (&json!(true), &json!(false))
        );
        let text = ratios.text();
        assert!(text.contains("2 of 3 cases") && text.contains("Timed in A alone: 1"), "{text}");
        assert!(text.lines().nth(1).unwrap().starts_with("+  s"), "{text}");
    }

    #[test]
    fn repeated_cases_are_paired_in_order() {
        let twice =
            [case("raycast", "compute", "", 1e-3, &[1.0]), case("raycast", "compute", "", 1e-3, &[8.0])];
        let ratios = Ratios::new(&twice, &twice);
        assert_eq!(ratios.pairs.len(), 2);
        assert!(ratios.pairs.iter().all(|pair| pair.ratio.value == 1.0));
    }
}
