//! A record: one line of bench.jsonl. Tables, plots and comparisons are made from records alone.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::SystemTime;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use volraster::Result;
use volraster::gpu::DeviceReport;
use volraster::technique::Method;

use crate::cli::output;
use crate::cli::sensors::Reading;
use crate::cli::timing::{Quantiles, Times};

/// The version of the form of a record.
pub(super) const SCHEMA: u32 = 1;

/// The results of one technique with its options in one view of one scene: a line of bench.jsonl.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(title = "Line of bench.jsonl", deny_unknown_fields)]
pub(super) struct Record {
    /// Version of this form: 1. Later versions may add fields; one that changes a field has another number.
    pub(super) schema: u32,
    /// Version of volraster.
    pub(super) version: String,
    /// Name of the device.
    pub(super) device: String,
    /// Name and version of the driver.
    pub(super) driver: String,
    /// Version of Vulkan that the device supports.
    pub(super) api: String,
    /// Whether the device is a processor.
    pub(super) software: bool,
    /// Identity of the run, the device and the machine.
    pub(super) run: Run,
    /// Name of the scene.
    pub(super) scene: String,
    /// Name that scenes share which differ only in size.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) family: Option<String>,
    /// Name of the view: its projection, or of several views a name of its own.
    pub(super) projection: String,
    /// Width and height of the image in pixels.
    pub(super) size: [u32; 2],
    /// Kind of the data: `grid`, `mesh`, `points` or `gaussians`.
    pub(super) data: String,
    /// Number of voxels, tetrahedra, points or splats.
    pub(super) elements: u64,
    /// Name of the series of settings that the case belongs to.
    pub(super) sweep: String,
    /// Technique.
    pub(super) technique: String,
    /// The way in which the technique uses the device.
    pub(super) route: String,
    /// All options of the technique, with their values.
    pub(super) options: Map<String, Value>,
    /// The option `step`, if it is a number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) step: Option<Value>,
    /// Errors relative to the float64 reference, over all channels and for each: `rmse`, `max_abs` and others; an infinite one is text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) errors: Option<Value>,
    /// The first 16 digits of the SHA-256 of the image, its samples as 32-bit floats: equal where two images are the same to the bit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) image: Option<String>,
    /// Counters of the plan and of the device.
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub(super) counters: Map<String, Value>,
    /// Bytes that the passes of a frame read and that they write: the sizes of their buffers and images, each once a pass.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) bytes: Option<[u64; 2]>,
    /// Size of the k-buffer that pixels of a mesh need.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) required_k: Option<Value>,
    /// Bytes of device memory of scene and frame alone, measured for the first case of each technique and route.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) device_bytes: Option<u64>,
    /// Number of timed frames, without those that were disturbed unless too few others were left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) frames: Option<usize>,
    /// Number of frames that were drawn before their times had settled.
    pub(super) warm: usize,
    /// How many frames were disturbed, and by what; they were repeated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) disturbed: Option<String>,
    /// Whether almost all frames were disturbed: fewer were not than half of those that a case has at least.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(super) noisy: bool,
    /// How fast the device was while the cases of the view were timed: the most trilinear samples per second of a fixed amount of work
    /// between frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) pulse: Option<f64>,
    /// Medians of the readings of sensors during the frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) sensors: Option<Reading>,
    /// Why the image is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) failed: Option<String>,
    /// Why the case was not drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) skipped: Option<String>,
    /// Whether the target format is too imprecise for the scene.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(super) wrong: bool,
    /// Milliseconds of a frame from the start of recording to the fence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) wall_ms: Option<Quantiles>,
    /// Milliseconds of a frame on the device, where it has timestamps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) gpu_ms: Option<Quantiles>,
    /// Share of the device's peaks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) bound: Option<Bound>,
    /// Median milliseconds of each pass.
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub(super) passes_ms: Map<String, Value>,
}

/// Kernel evaluations per pair of a splat and a tile: one per pixel.
pub(super) const EVALUATIONS: f64 = 64.0;

/// The bound of a frame's time.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct Bound {
    /// Kind of work that takes longest at the device's peak, as in peaks.json.
    pub(super) by: String,
    /// Milliseconds that each kind of work takes at the device's peak.
    pub(super) least_ms: BTreeMap<String, f64>,
    /// Those of `by` over the median time on the device, where it has timestamps, else over the median wall time.
    pub(super) share: f64,
}

impl Bound {
    /// Returns the milliseconds of the kind of work that takes longest.
    pub(super) fn ms(&self) -> f64 {
        self.least_ms.get(&self.by).copied().unwrap_or(f64::NAN)
    }
}

/// The identity of a run, its device and its machine.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub(super) struct Run {
    /// Begin of the run in UTC, as RFC 3339 writes it.
    pub(super) begin: String,
    /// The revision that the program was built from, as `git describe` names it; null where `make build` did not build it.
    pub(super) commit: Option<String>,
    /// Arguments of the program.
    pub(super) arguments: Vec<String>,
    /// The driver's identifier of the device, in hexadecimal digits.
    pub(super) device_uuid: String,
    /// Name of the driver in Vulkan.
    pub(super) driver_id: String,
    /// Version of the driver, in a form of its own.
    pub(super) driver_version: u32,
    /// Operating system and, on Linux, the version of its kernel.
    pub(super) system: String,
    /// Model of the processor, on Linux.
    pub(super) processor: String,
    /// Number of processors that the program may use.
    pub(super) processors: usize,
}

impl Run {
    /// Returns the run that begins now on a device.
    pub(super) fn now(device: &DeviceReport) -> Self {
        let file = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        let release = file("/proc/sys/kernel/osrelease");
        let model = file("/proc/cpuinfo").lines().find_map(|line| {
            line.strip_prefix("model name").map(|rest| rest.trim_start_matches(['\t', ' ', ':']).to_string())
        });
        Self {
            begin: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            commit: option_env!("VOLRASTER_COMMIT").filter(|commit| !commit.is_empty()).map(str::to_string),
            arguments: std::env::args().skip(1).collect(),
            device_uuid: device.uuid.clone(),
            driver_id: device.driver_id.clone(),
            driver_version: device.driver_version,
            system: format!("{} {}", std::env::consts::OS, release.trim()).trim().to_string(),
            processor: model.unwrap_or_default(),
            processors: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }
}

/// Returns the JSON Schema of a line of bench.jsonl.
pub(super) fn schema() -> String {
    format!("{:#}", json!(schemars::schema_for!(Record)))
}

impl Record {
    /// Reads bench.jsonl. Skips empty lines, and an incomplete last line of an interrupted run.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] when the file cannot be read, [`Error::File`] with the number of an invalid line.
    pub(super) fn read(path: &Path) -> Result<Vec<Self>> {
        let bytes = std::fs::read(path).map_err(output::unreadable(path))?;
        let text = String::from_utf8_lossy(&bytes);
        let mut records = Vec::new();
        let mut lines = (1_usize..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()).peekable();
        while let Some((number, line)) = lines.next() {
            match Self::parse(line) {
                Ok(record) => records.push(record),
                Err(_) if lines.peek().is_none() && !text.ends_with('\n') && !records.is_empty() => {}
                Err(rule) => return Err(output::refuse(path, &format!("line {number}"), &rule)),
            }
        }
        if records.is_empty() {
            return Err(output::refuse(path, "bench", "contains no record: must be a bench.jsonl"));
        }
        Ok(records)
    }

    fn parse(line: &str) -> std::result::Result<Self, String> {
        let record: Self =
            serde_json::from_str(line).map_err(|error| format!("is not a record of bench.jsonl: {error}"))?;
        if record.schema > SCHEMA {
            return Err(format!("\"schema\": is {}; this version reads up to {SCHEMA}", record.schema));
        }
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

    /// Returns the median time of a frame: on the device, where it has timestamps, else the wall time.
    pub(super) fn ms(&self) -> Option<f64> {
        Some(self.gpu_ms.as_ref().or(self.wall_ms.as_ref())?.median)
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

    /// Returns a record with times, for tests.
    pub(crate) fn case(technique: &str, route: &str, options: &str, rmse: f64, times: &[f64]) -> Record {
        let wanted = volraster::Technique::parse(&format!("{technique}:{options}")).unwrap();
        let Value::Object(options) = crate::cli::input::options_json(&wanted) else { panic!() };
        Record {
            schema: SCHEMA,
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
            (good.replace("\"schema\":1", "\"schema\":2"), "reads up to 1"),
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
