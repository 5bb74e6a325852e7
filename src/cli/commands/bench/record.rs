//! A record: one line of bench.jsonl. Tables, plots and comparisons are made from records alone.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use volraster::technique::Method;
use volraster::{Error, Result};

use crate::cli::timing::{Quantiles, Times};

/// The results of one technique with its options in one view of one scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct Record {
    pub(super) version: String,
    pub(super) device: String,
    pub(super) driver: String,
    pub(super) api: String,
    pub(super) software: bool,
    pub(super) scene: String,
    /// Name that scenes share which differ only in size.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) family: Option<String>,
    pub(super) projection: String,
    pub(super) size: [u32; 2],
    /// `grid`, `mesh`, `points` or `gaussians`; `elements` is the number of voxels, tetrahedra, points or splats.
    pub(super) data: String,
    pub(super) elements: u64,
    pub(super) sweep: String,
    pub(super) technique: String,
    pub(super) route: String,
    pub(super) options: Map<String, Value>,
    /// The option `step`, if it is a number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) step: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) errors: Option<Value>,
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub(super) counters: Map<String, Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) required_k: Option<Value>,
    /// Device memory of scene and frame alone, measured for the first case of each technique and route.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) device_bytes: Option<u64>,
    /// Number of timed frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) frames: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) failed: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) skipped: Option<String>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(super) wrong: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) wall_ms: Option<Quantiles>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) gpu_ms: Option<Quantiles>,
    /// Median time of each pass, in milliseconds.
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub(super) passes_ms: Map<String, Value>,
}

impl Record {
    /// Reads bench.jsonl. Skips empty lines, and an incomplete last line of an interrupted run.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] when the file cannot be read, [`Error::File`] with the number of an invalid line.
    pub(super) fn read(path: &Path) -> Result<Vec<Self>> {
        let failed = |source| Error::Io { path: path.to_path_buf(), action: "cannot read", source };
        let bytes = std::fs::read(path).map_err(failed)?;
        let text = String::from_utf8_lossy(&bytes);
        let mut records = Vec::new();
        let mut lines = (1_usize..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()).peekable();
        while let Some((number, line)) = lines.next() {
            match Self::parse(line) {
                Ok(record) => records.push(record),
                Err(_) if lines.peek().is_none() && !text.ends_with('\n') && !records.is_empty() => {}
                Err(rule) => {
                    let place = format!("line {number}");
                    return Err(Error::File { path: path.to_path_buf(), place, rule });
                }
            }
        }
        if records.is_empty() {
            let rule = "contains no record: must be a bench.jsonl".to_string();
            return Err(Error::File { path: path.to_path_buf(), place: "bench".to_string(), rule });
        }
        Ok(records)
    }

    fn parse(line: &str) -> std::result::Result<Self, String> {
        let record: Self =
            serde_json::from_str(line).map_err(|error| format!("is not a record of bench.jsonl: {error}"))?;
        for (key, text) in
            [("scene", &record.scene), ("technique", &record.technique), ("route", &record.route)]
        {
            if text.is_empty() {
                return Err(format!("is not a record of bench.jsonl: has no \"{key}\""));
            }
        }
        let is_time = |ms: &f64| *ms > 0.0 && ms.is_finite();
        let is_sound = |spread: &Quantiles| !spread.times.is_empty() && spread.times.iter().all(is_time);
        if ![&record.wall_ms, &record.gpu_ms].into_iter().flatten().all(is_sound) {
            return Err("\"times\": must be numbers above 0".to_string());
        }
        Ok(record)
    }

    /// Returns the RMSE, unless the image is wrong.
    pub(super) fn rmse(&self) -> Option<f64> {
        self.error("rmse").filter(|_| !self.wrong && self.failed.is_none())
    }

    /// Returns an error statistic over all channels; infinite values are stored as text.
    pub(super) fn error(&self, statistic: &str) -> Option<f64> {
        match self.errors.as_ref()?.get("all")?.get(statistic)? {
            Value::String(_) => Some(f64::INFINITY),
            number => number.as_f64(),
        }
    }

    /// Returns an error statistic as text.
    pub(super) fn error_text(&self, statistic: &str) -> String {
        self.error(statistic).map_or_else(dash, |error| format!("{error:.2e}"))
    }

    /// Returns the wall times.
    pub(super) fn times(&self) -> Option<Times> {
        Times::new(self.wall_ms.as_ref()?.times.clone())
    }

    pub(super) fn counter(&self, name: &str) -> Option<f64> {
        self.counters.get(name)?.as_f64()
    }

    /// Returns the options that differ from their defaults, as `key=value,...`, without the route.
    pub(super) fn options_text(&self) -> String {
        let infos = Method::from_name(&self.technique).map_or(&[][..], Method::options);
        let number = |text: &str| text.parse::<f64>().ok();
        let same = |a: &str, b: &str| a == b || (number(a).is_some() && number(a) == number(b));
        let is_default =
            |key: &str, text: &str| infos.iter().any(|info| info.key == key && same(&info.default, text));
        let pairs = self.options.iter().map(|(key, value)| (key, word(value)));
        let shown: Vec<String> = pairs
            .filter(|(key, text)| *key != "route" && !is_default(key, text))
            .map(|(key, text)| format!("{key}={}", text.strip_suffix(".0").unwrap_or(&text)))
            .collect();
        shown.join(",")
    }

    /// Returns technique, route and options for a row of a table.
    pub(super) fn names(&self) -> [String; 3] {
        [self.technique.clone(), self.route.clone(), self.options_text()]
    }

    /// Returns the plural name of the elements.
    pub(super) fn elements_name(&self) -> &'static str {
        match self.data.as_str() {
            "mesh" => "tetrahedra",
            "points" => "points",
            "gaussians" => "splats",
            _ => "voxels",
        }
    }

    /// Returns scene, projection and size.
    pub(super) fn view(&self) -> (&str, &str, [u32; 2]) {
        (&self.scene, &self.projection, self.size)
    }
}

/// Returns the value of an option as text.
pub(super) fn word(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_string)
}

/// Returns what a table shows where there is no value.
pub(super) fn dash() -> String {
    "-".to_string()
}

/// Groups records by view, in order of first appearance.
pub(super) fn views(records: &[Record]) -> Vec<Vec<&Record>> {
    let mut views: Vec<Vec<&Record>> = Vec::new();
    for record in records {
        match views.iter_mut().find(|view| view[0].view() == record.view()) {
            Some(view) => view.push(record),
            None => views.push(vec![record]),
        }
    }
    views
}

#[cfg(test)]
pub(super) use tests::case;

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Returns a record with times, for tests.
    pub(crate) fn case(technique: &str, route: &str, options: &str, rmse: f64, times: &[f64]) -> Record {
        let wanted = volraster::Technique::parse(&format!("{technique}:{options}")).unwrap();
        let Value::Object(options) = crate::cli::input::options_json(&wanted) else { panic!() };
        Record {
            scene: "s".to_string(),
            projection: "perspective".to_string(),
            size: [64, 48],
            data: match wanted.method() {
                Method::Havs => "mesh",
                Method::SplatEwa => "points",
                _ => "grid",
            }
            .to_string(),
            elements: 1000,
            technique: technique.to_string(),
            route: route.to_string(),
            options,
            errors: Some(json!({"all": {"rmse": rmse, "max_abs": 2.0 * rmse}})),
            frames: Some(times.len()),
            wall_ms: Quantiles::new(times.to_vec()),
            ..Record::default()
        }
    }

    #[test]
    fn a_record_reads_back_as_it_was_written() {
        let one = case("slabs", "compute", "step=2", 1e-3, &[3.0, 1.0, 2.0]);
        let line = serde_json::to_string(&one).unwrap();
        let again = Record::parse(&line).unwrap();
        assert_eq!(serde_json::to_string(&again).unwrap(), line);
        assert_eq!(again.wall_ms.as_ref().unwrap().times, [3.0, 1.0, 2.0]);
        assert_eq!((again.rmse(), again.options_text().as_str()), (Some(1e-3), "step=2"));
        assert_eq!(case("slabs", "compute", "stop=0", 1e-3, &[1.0]).options_text(), "stop=0");
        assert!(!line.contains("failed") && !line.contains("wrong") && !line.contains("counters"));
    }

    #[test]
    fn errors_name_the_invalid_line() {
        let folder = std::env::temp_dir().join(format!("volraster-record-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("a.jsonl");
        let good = serde_json::to_string(&case("slabs", "compute", "", 1e-3, &[1.0])).unwrap();
        let read = |text: String| {
            std::fs::write(&path, text).unwrap();
            Record::read(&path).map(|records| records.len()).map_err(|error| error.to_string())
        };
        assert_eq!(read(format!("{good}\n\n{good}\n")), Ok(2));
        // The last line of an interrupted run is incomplete.
        assert_eq!(read(format!("{good}\n{}", &good[..40])), Ok(1));
        let wrong = read(format!("{good}\n{{\n{good}\n")).unwrap_err();
        assert!(wrong.contains("line 2") && wrong.contains("not a record"), "{wrong}");
        for (text, part) in [
            (String::new(), "no record"),
            ("{}\n".to_string(), "no \"scene\""),
            (good.replace("[1.0]", "[0.0]"), "above 0"),
            (good.replace(",\"times\":[1.0]", ""), "times"),
            (good.replace("[64,48]", "[64]"), "length 1"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(part) && error.lines().count() == 1, "{error}");
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}
