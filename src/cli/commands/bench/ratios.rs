//! `bench --compare`: the ratio of the times of two runs, case by case.

use serde_json::{Value, json};
use volraster::technique::Method;

use super::record::Record;
use crate::cli::numbers::counted;
use crate::cli::table;
use crate::cli::timing::{Ratio, Times, ratio};

/// What names a case: columns of the text and keys of the JSON.
const NAMES: [&str; 6] = ["scene", "projection", "size", "technique", "route", "options"];

/// The comparison of two runs, A and B.
#[derive(Debug)]
pub(super) struct Ratios<'a> {
    /// Cases that both runs timed.
    pub(super) pairs: Vec<Pair<'a>>,
    /// Cases that only one run timed.
    alone: [usize; 2],
    /// Device, driver and version of each run.
    devices: [String; 2],
}

/// A case that both runs timed.
#[derive(Debug)]
pub(super) struct Pair<'a> {
    records: [&'a Record; 2],
    times: [Times; 2],
    ratio: Ratio,
}

/// How much a time may differ from run to run of one program, and count as the same.
const SAME: f64 = 0.05;

/// Errors that differ by less may be those of one image that is rounded otherwise: relative and absolute.
const NEAR: [f64; 2] = [1e-3, 1e-6];

/// The class of a ratio that does not tell, and its mark.
const AMBIGUOUS: (&str, &str) = ("ambiguous", "?");

/// Returns the class of a ratio and its mark: slower, faster or the same where the interval tells, else ambiguous. A case is not slower
/// if the device as a whole was, by the time of fixed work: `drift` times as long in the second run as in the first.
fn class(&Ratio { low, high, .. }: &Ratio, drift: f64) -> (&'static str, &'static str) {
    if low.min(low / drift) > 1.0 + SAME {
        ("slower", "+")
    } else if high.max(high / drift) < 1.0 / (1.0 + SAME) {
        ("faster", "-")
    } else if low > 1.0 / (1.0 + 2.0 * SAME) && high < 1.0 + 2.0 * SAME {
        ("same", "")
    } else {
        AMBIGUOUS
    }
}

impl Pair<'_> {
    fn class(&self) -> &'static str {
        self.class_and_mark().0
    }

    /// Returns the class and its mark. Times of disturbed frames tell nothing.
    fn class_and_mark(&self) -> (&'static str, &'static str) {
        if self.is_noisy() { AMBIGUOUS } else { class(&self.ratio, self.drift()) }
    }

    fn is_noisy(&self) -> bool {
        self.records.iter().any(|record| record.noisy)
    }

    /// Returns how many times as long fixed work took in the second run as in the first, beside the case.
    fn drift(&self) -> f64 {
        let [a, b] = self.records.map(|record| record.pulse);
        a.zip(b).map_or(1.0, |(a, b)| a / b)
    }

    /// Returns `same` for images that are the same to the bit, `near` if only their errors hardly differ, else `changed`.
    fn image(&self) -> &'static str {
        let [a, b] = self.records;
        if a.image.is_some() && a.image == b.image {
            return "same";
        }
        let [a, b] = self.records.map(|record| record.error("rmse").unwrap_or(f64::INFINITY));
        let is_near = (a - b).abs() <= NEAR[1] + NEAR[0] * a.max(b);
        if is_near || (a.is_infinite() && b.is_infinite()) { "near" } else { "changed" }
    }

    fn technique(&self) -> &str {
        &self.records[0].technique
    }

    /// Returns the cells of [`NAMES`].
    fn names(&self) -> [String; 6] {
        let (scene, projection, [width, height]) = self.records[0].view();
        let [technique, route, options] = self.records[0].names();
        let size = format!("{width}x{height}");
        [scene.to_string(), projection.to_string(), size, technique, route, options]
    }
}

/// Returns the geometric mean of the drifts of cases.
fn drift(pairs: &[&Pair<'_>]) -> f64 {
    let logs: f64 = pairs.iter().map(|pair| pair.drift().ln()).sum();
    (logs / pairs.len().max(1) as f64).exp()
}

impl<'a> Ratios<'a> {
    /// Compares the cases of two runs. Equal cases of a run are paired in order.
    pub(super) fn new(runs: [&'a [Record]; 2]) -> Self {
        let timed = |records: &'a [Record]| -> Vec<&Record> {
            records.iter().filter(|record| record.wall_ms.is_some()).collect()
        };
        let [ours, mut theirs] = runs.map(timed);
        let identity =
            |record: &'a Record| (record.view(), &record.technique, &record.route, &record.options);
        let mut pairs = Vec::new();
        for &one in &ours {
            let same = theirs.iter().position(|&other| identity(other) == identity(one));
            let Some(place) = same else { continue };
            let records = [one, theirs.remove(place)];
            let [Some(a), Some(b)] = records.map(Record::times) else { continue };
            let Some(ratio) = ratio(&[[&a, &b]]) else { continue };
            pairs.push(Pair { records, times: [a, b], ratio });
        }
        let device = |records: &[Record]| {
            let of = |one: &Record| format!("{}, {}, version {}", one.device, one.driver, one.version);
            records.first().map_or_else(String::new, of)
        };
        Self { alone: [ours.len() - pairs.len(), theirs.len()], pairs, devices: runs.map(device) }
    }

    /// Returns the names of cases whose image has changed.
    pub(super) fn changed(&self) -> Vec<String> {
        self.pairs
            .iter()
            .filter(|pair| pair.image() == "changed")
            .map(|pair| pair.names().join(" "))
            .collect()
    }

    /// Returns the names of cases of the class *slower* whose ratio is above 1 by more than a fraction.
    pub(super) fn slower(&self, limit: f64) -> Vec<String> {
        let is_slower = |pair: &&Pair<'_>| pair.class() == "slower" && pair.ratio.value > 1.0 + limit;
        self.pairs.iter().filter(is_slower).map(|pair| pair.names().join(" ")).collect()
    }

    /// Returns the geometric mean of the drifts of cases.
    pub(super) fn drift(&self) -> f64 {
        drift(&self.pairs.iter().collect::<Vec<_>>())
    }

    /// Returns the geometric mean of the ratios, the number of cases and the mean drift of each technique, then of all.
    fn means(&self) -> Vec<(&str, usize, Ratio, f64)> {
        let mut names: Vec<&str> = Method::ALL.map(Method::name).to_vec();
        for pair in &self.pairs {
            if !names.contains(&pair.technique()) {
                names.push(pair.technique());
            }
        }
        let every: Vec<&Pair<'_>> = self.pairs.iter().collect();
        let groups = names.into_iter().map(|name| {
            let own = every.iter().copied().filter(|pair| pair.technique() == name);
            (name, own.collect())
        });
        let mean = |(name, pairs): (_, Vec<&Pair<'_>>)| {
            let times: Vec<[&Times; 2]> = pairs.iter().map(|pair| pair.times.each_ref()).collect();
            Some((name, times.len(), ratio(&times)?, drift(&pairs)))
        };
        groups.chain([("all", every.clone())]).filter_map(mean).collect()
    }

    /// Returns the comparison as aligned text.
    pub(super) fn text(&self) -> String {
        let cells =
            |ratio: &Ratio| [format!("{:.3}", ratio.value), format!("{:.3}..{:.3}", ratio.low, ratio.high)];
        let heading =
            [&[""], &NAMES[..], &["ms A", "ms B", "B/A", "95 %", "rmse A", "rmse B", "image"]].concat();
        let mut rows = vec![heading.into_iter().map(str::to_string).collect::<Vec<_>>()];
        for pair in &self.pairs {
            let mut row = vec![pair.class_and_mark().1.to_string()];
            row.extend(pair.names());
            row.extend(pair.times.each_ref().map(|times| format!("{:.2}", times.low())));
            row.extend(cells(&pair.ratio));
            row.extend(pair.records.map(|record| record.error_text("rmse")));
            row.push(pair.image().to_string());
            rows.push(row);
        }
        let mut means = vec![["", "geometric mean", "cases", "B/A", "95 %"].map(str::to_string).to_vec()];
        for (name, count, ratio, drift) in self.means() {
            let mut row = vec![class(&ratio, drift).1.to_string(), name.to_string(), count.to_string()];
            row.extend(cells(&ratio));
            means.push(row);
        }
        let count = |class| self.pairs.iter().filter(|pair| pair.class() == class).count();
        let mut text = format!(
            "{}\n\n{}\n\nTimes are 5th percentiles. + slower ({}), - faster ({}) in B than in A: the whole 95 % interval differs by more \
             than {} %; ? ambiguous ({}): it tells neither that nor that times are the same; of {}.",
            table::aligned(&rows, &[0, 1, 2, 4, 5, 6, 13]),
            table::aligned(&means, &[0, 1]),
            count("slower"),
            count("faster"),
            100.0 * SAME,
            count("ambiguous"),
            counted(self.pairs.len(), "case")
        );
        let noisy = self.pairs.iter().filter(|pair| pair.is_noisy()).count();
        if noisy > 0 {
            text += &format!(
                "\nAlmost all frames of {} were disturbed in A or B: ambiguous.",
                counted(noisy, "case")
            );
        }
        let drift = self.drift();
        if (drift.ln()).abs() > SAME {
            text += &format!(
                "\nThe device as a whole was slower in {}: fixed work beside the cases took {drift:.2} times as long in B as in A.",
                if drift > 1.0 { "B" } else { "A" }
            );
        }
        let [a, b] = &self.devices;
        text += &if a == b { format!("\nA and B: {a}") } else { format!("\nA: {a}\nB: {b}") };
        for (name, count) in ["A", "B"].into_iter().zip(self.alone).filter(|(_, count)| *count > 0) {
            text += &format!("\nTimed in {name} alone: {count}");
        }
        text
    }

    /// Returns the comparison as JSON.
    pub(super) fn json(&self) -> Value {
        let case = |pair: &Pair<'_>| {
            let mut case = json!(pair.ratio);
            for (key, name) in NAMES.into_iter().zip(pair.names()) {
                case[key] = json!(name);
            }
            case["ms"] = json!(pair.times.each_ref().map(Times::low));
            case["rmse"] = json!(pair.records.map(|record| record.error("rmse")));
            case["class"] = json!(pair.class());
            case["image"] = json!(pair.image());
            case
        };
        let mean = |(name, count, ratio, _): &(&str, usize, Ratio, f64)| {
            let mut mean = json!(ratio);
            mean["technique"] = json!(name);
            mean["cases"] = json!(count);
            mean
        };
        json!({
            "cases": self.pairs.iter().map(case).collect::<Value>(),
            "means": self.means().iter().map(mean).collect::<Value>(),
            "alone": self.alone,
            "drift": self.drift(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::case;
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
            case("raycast", "compute", "", 1e-3, &[4.1, 3.9, 4.0]),
            case("slabs", "compute", "step=1", 1e-3, &[20.0, 20.2, 19.8]),
            case("slabs", "compute", "step=2", 2e-3, &[20.0, 20.2, 19.8]),
            case("slices-2d", "compute", "", 1e-3, &[1.0]),
        ];
        let ratios = Ratios::new([&a, &b]);
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
        assert!(
            text.contains("+ slower (2), - faster (0)") && text.contains("Timed in A alone: 1"),
            "{text}"
        );
        assert_eq!((ratios.changed().len(), ratios.slower(0.5).len(), ratios.slower(1.5).len()), (1, 2, 0));
        assert_eq!(json["cases"][2]["class"], "same");
        assert!(text.lines().nth(1).unwrap().starts_with("+  s"), "{text}");
    }

    #[test]
    fn repeated_cases_are_paired_in_order() {
        let twice =
            [case("raycast", "compute", "", 1e-3, &[1.0]), case("raycast", "compute", "", 1e-3, &[8.0])];
        let ratios = Ratios::new([&twice, &twice]);
        assert_eq!(ratios.pairs.len(), 2);
        assert!(ratios.pairs.iter().all(|pair| pair.ratio.value == 1.0));
    }

    /// Twenty runs of one program hardly ever differ, and a step that takes a tenth longer is slower in 19 of 20.
    #[test]
    fn recorded_runs_are_told_apart() {
        let recorded: Value = serde_json::from_str(include_str!("../../recorded.json")).unwrap();
        let runs = recorded["runs"].as_array().unwrap();
        let record = |run: &Value, name: &str| {
            let times: Vec<f64> = serde_json::from_value(run[name].clone()).unwrap();
            [Record { pulse: run["pulse"].as_f64(), ..case("raycast", "compute", "", 1e-3, &times) }]
        };
        let class = |a: (usize, &str), b: (usize, &str)| {
            let pair = [record(&runs[a.0], a.1), record(&runs[b.0], b.1)];
            Ratios::new(pair.each_ref().map(|run| &run[..])).pairs[0].class()
        };
        let count = |classes: &[&str], class: &str| classes.iter().filter(|other| **other == class).count();
        let mut same = Vec::new();
        for name in ["raycast", "slabs", "raycast-slower", "slabs-slower"] {
            for i in 0..runs.len() {
                same.extend([1, 7].map(|step| class((i, name), ((i + step) % runs.len(), name))));
            }
        }
        let different = count(&same, "slower") + count(&same, "faster");
        assert!(same.len() == 160 && different <= 1, "{different}");
        assert!(count(&same, "ambiguous") <= 32, "{same:?}");
        for (name, slower) in [("raycast", "raycast-slower"), ("slabs", "slabs-slower")] {
            let pair = |i: usize| class((i, name), ((i + 1) % runs.len(), slower));
            let classes: Vec<&str> = (0..runs.len()).map(pair).collect();
            assert!(count(&classes, "slower") >= 19, "{name}: {classes:?}");
        }
    }

    #[test]
    fn classes_follow_from_the_interval_and_images_from_digest_and_error() {
        let spread = |centre: f64, part: f64| -> Vec<f64> {
            (0..21).map(|i| centre * (1.0 + part * (f64::from(i) / 10.0 - 1.0))).collect()
        };
        let class = |b: &[f64]| {
            let runs =
                [spread(10.0, 0.02), b.to_vec()].map(|times| [case("raycast", "compute", "", 1e-3, &times)]);
            Ratios::new(runs.each_ref().map(|run| &run[..])).pairs[0].class()
        };
        assert_eq!(class(&spread(10.0, 0.02)), "same");
        assert_eq!(class(&spread(10.1, 0.02)), "same");
        assert_eq!(class(&spread(11.0, 0.02)), "slower");
        assert_eq!(class(&spread(9.0, 0.02)), "faster");
        assert_eq!(class(&[9.0, 11.0, 12.0, 13.0, 14.0]), "ambiguous");
        // All of the device was slower: the case need not be.
        let beside = |pulse: f64| {
            let case = |centre, pulse| Record {
                pulse: Some(pulse),
                ..case("raycast", "compute", "", 1e-3, &spread(centre, 0.02))
            };
            let runs = [[case(10.0, 1e9)], [case(12.0, pulse)]];
            let ratios = Ratios::new(runs.each_ref().map(|run| &run[..]));
            let is_told = ratios.text().contains("fixed work");
            (ratios.pairs[0].class(), is_told)
        };
        let noisy = [false, true].map(|noisy| {
            [Record {
                noisy,
                ..case("raycast", "compute", "", 1e-3, &spread(if noisy { 12.0 } else { 10.0 }, 0.02))
            }]
        });
        assert_eq!(Ratios::new(noisy.each_ref().map(|run| &run[..])).pairs[0].class(), "ambiguous");
        assert_eq!(beside(1e9), ("slower", false));
        assert_eq!(beside(0.99e9), ("slower", false));
        assert_eq!(beside(0.83e9), ("ambiguous", true));
        assert_eq!(beside(1.2e9), ("slower", true));
        let image = |rmse: [f64; 2], digests: [&str; 2]| {
            let runs = [0, 1].map(|i| {
                [Record {
                    image: Some(digests[i].to_string()),
                    ..case("raycast", "compute", "", rmse[i], &[1.0])
                }]
            });
            Ratios::new(runs.each_ref().map(|run| &run[..])).pairs[0].image()
        };
        assert_eq!(image([1e-3, 1e-3], ["a", "a"]), "same");
        assert_eq!(image([1e-3, 1.0005e-3], ["a", "b"]), "near");
        assert_eq!(image([1e-7, 9e-7], ["a", "b"]), "near");
        assert_eq!(image([1e-3, 1.1e-3], ["a", "b"]), "changed");
    }
}
