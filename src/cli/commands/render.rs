//! `volraster render`: draws one image, and measures frame times.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Map, Value, json};
use volraster::choice::{Choice, Estimate, Goal, Profile, Source, Trial, TrialOutcome};
use volraster::scene::View;
use volraster::technique::FrameTime;
use volraster::{Error, GpuScene, Image, Renderer, Result, Technique, choice};

use crate::cli::input::{self, ArraysArgs, DeviceArgs, Input, Request, Size};
use crate::cli::memory::{peak_rss_bytes, summed};
use crate::cli::outcome::{Outcome, check_validation};
use crate::cli::output;
use crate::cli::timing::{Times, gpu_ms, milliseconds_since, passes};

/// Arguments of `render`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A scene file (.json) or a data file.
    #[arg(value_name = "SCENE|DATA")]
    scene: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    /// Output image: .exr (32-bit float, linear) or .png (for viewing).
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Technique and options, see `volraster techniques` [default: that of the scene, else the default for its data].
    #[arg(long, value_name = "NAME[:key=value,...]")]
    technique: Option<String>,
    /// Choose the fastest technique and options whose root mean square error is at most this (premultiplied linear
    /// colour). The search draws trial images and compares them with the float64 reference.
    #[arg(long, value_name = "RMSE", conflicts_with = "technique", value_parser = positive)]
    max_error: Option<f64>,
    /// Choose the most accurate technique and options that draw a frame within this many milliseconds.
    #[arg(long, value_name = "MS", conflicts_with_all = ["technique", "max_error"], value_parser = positive)]
    budget: Option<f64>,
    /// Image size [default: that of the scene].
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    /// Frames to time after one warm-up frame [default: 1 with --stats, else 0, which reports the time of the warm-up
    /// frame].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    frames: Option<u32>,
    /// Degrees by which the eye orbits the target around `up` from frame to frame. The image shows angle 0.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true, value_parser = input::finite)]
    orbit: f64,
    /// Write times, memory and counters as JSON.
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    /// Write an image of the k-buffer overflow: white where the k-buffer did not sort the faces of a pixel, whether
    /// repaired or not.
    #[arg(long, value_name = "FILE.png")]
    overflow_map: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
    /// Enable core and synchronization validation; any message makes the exit code 1.
    #[arg(long)]
    validate: bool,
}

/// The results of drawing, which outlive the device.
pub(super) struct Drawn {
    image: Image,
    /// Pixels that the k-buffer did not sort, if asked for.
    overflow: Option<Vec<bool>>,
    /// The warm-up frame.
    first: FrameTime,
    frames: Vec<FrameTime>,
    stats: Map<String, Value>,
    route: &'static str,
    device: String,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// An error in the arguments, the input, the device or the output.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        output::check_image(&self.output)?;
        if let Some(stats) = &self.stats {
            output::check_file(stats)?;
            apart("--stats", stats, &[(&self.output, "the image"), (&self.scene, "the input")])?;
        }
        if let Some(map) = &self.overflow_map {
            output::check_image(map)?;
            apart("--overflow-map", map, &[(&self.output, "the image"), (&self.scene, "the input")])?;
            if let Some(stats) = &self.stats {
                apart("--overflow-map", map, &[(stats, "the file of --stats")])?;
            }
        }
        let request = self.technique.as_deref().map(Request::parse).transpose()?;
        let Input { scene, settings } = Input::load(&self.scene, self.size, &self.arrays, quiet)?;
        let mut technique = settings.choose(request, &scene)?;
        let views = self.views(&settings.view)?;

        let start = Instant::now();
        let (gpu, log) = self.device.open(self.validate)?;
        let open_ms = milliseconds_since(start);
        let profile = self.goal().map(|_| Profile::load(&gpu));
        let scene = GpuScene::new(&gpu, scene);
        drop(gpu);
        let mut chosen = None;
        if let (Some(goal), Some(profile)) = (self.goal(), profile) {
            let start = Instant::now();
            let choice = choice::choose(&scene, &settings.view, goal, &profile)?;
            technique = choice.technique;
            chosen = Some((choice, milliseconds_since(start)));
        }
        let Drawn { image, overflow, first, frames, mut stats, route, device } = draw(
            &scene,
            technique,
            &settings.view,
            &views,
            self.overflow_map.is_some(),
            [settings.load_ms, open_ms],
        )?;
        let map = self.overflow_map.as_ref().map(|path| {
            let Some(overflow) = overflow else {
                let why = format!("\"{}\": has no k-buffer", technique.method().name());
                return Err(Error::Invalid { what: "--overflow-map".to_string(), why });
            };
            let grey = |is_set| [f32::from(u8::from(is_set)), 1.0];
            let pixels = overflow.into_iter().map(grey).map(|[v, a]| [v, v, v, a]).collect();
            Ok((path, Image::new(image.width(), image.height(), pixels)?))
        });
        let map = map.transpose()?;
        drop(scene);
        if let Some((choice, ms)) = &chosen {
            stats.insert("choice".to_string(), self.choice_json(choice, *ms));
        }
        stats.insert("validation_messages".to_string(), json!(log.messages().len()));

        volraster::io::write_image(&self.output, &image, settings.background)?;
        if let Some((path, map)) = map {
            volraster::io::write_image(path, &map, [0.0, 0.0, 0.0, 1.0])?;
        }
        if let Some(path) = &self.stats {
            output::write_json(path, &Value::Object(stats))?;
        }
        if !quiet {
            let name = technique.method().name();
            let time = match Times::wall(&frames) {
                None => format!("first frame {:.1} ms", first.wall_ms),
                Some(times) if frames.len() == 1 => format!("{:.1} ms per frame", times.median()),
                Some(times) => format!("{:.1} ms per frame (median of {})", times.median(), frames.len()),
            };
            if let Some((choice, _)) = &chosen {
                output::print(&reason(choice))?;
            }
            output::print(&format!(
                "{name} ({route}) on {device}: {} x {}, {time}: {}",
                image.width(),
                image.height(),
                self.output.display()
            ))?;
        }
        check_validation(&log)
    }

    /// Returns the goal of an automatic choice.
    fn goal(&self) -> Option<Goal> {
        self.max_error.map(Goal::MaxError).or_else(|| self.budget.map(Goal::Budget))
    }

    /// Describes an automatic choice and its trials.
    fn choice_json(&self, choice: &Choice, ms: f64) -> Value {
        let trial = |trial: &Trial| {
            let mut json = Map::new();
            json.insert("technique".to_string(), json!(trial.spec));
            json.insert(
                "predicted".to_string(),
                json!({"rmse": trial.predicted_error, "ms": trial.predicted_ms}),
            );
            match &trial.outcome {
                TrialOutcome::Drawn { error, ms } => json.insert(
                    "measured".to_string(),
                    json!({"rmse": error.rmse, "rmse_bound": error.bound, "pixels": error.pixels, "ms": ms}),
                ),
                TrialOutcome::Refused(why) => json.insert("refused".to_string(), json!(why)),
            };
            Value::Object(json)
        };
        json!({
            "max_error": self.max_error,
            "budget_ms": self.budget,
            "chosen": choice.trials.get(choice.chosen).map(|trial| &trial.spec),
            "candidates": choice.candidates,
            "confidence": CONFIDENCE,
            "predictions": source(choice.source),
            "search_ms": ms,
            "trials": choice.trials.iter().map(trial).collect::<Vec<_>>(),
        })
    }

    /// Returns the view of each timed frame; the first is that of the image.
    fn views(&self, first: &View) -> Result<Vec<View>> {
        let view = |i: u32| {
            if i == 0 {
                return Ok(*first);
            }
            first.with_camera(first.camera().orbit(self.orbit * f64::from(i))?)
        };
        let count = self.frames.unwrap_or(u32::from(self.stats.is_some()));
        (0..count).map(view).collect()
    }
}

/// Probability that the bound of an estimated error holds.
const CONFIDENCE: f64 = 0.95;

/// Parses a positive number.
fn positive(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse().ok().filter(|n: &f64| n.is_finite() && *n > 0.0);
    number.ok_or_else(|| "must be a positive number".to_string())
}

fn source(source: Source) -> &'static str {
    match source {
        Source::BuiltIn => "built in",
        Source::Measured => "measured on this device",
    }
}

/// Returns the line about an automatic choice.
fn reason(choice: &Choice) -> String {
    let Some((Estimate { rmse, bound, pixels }, ms)) = choice.measured() else {
        return String::new();
    };
    let spec = choice.trials.get(choice.chosen).map_or("", |trial| &trial.spec);
    format!(
        "chosen: {spec}, the best of {} settings; error {rmse:.2e}, below {bound:.2e} with 95 % confidence, at {pixels} pixels; \
         {ms:.1} ms; {} tried, predictions {}",
        choice.candidates,
        choice.trials.len(),
        source(choice.source)
    )
}

/// Refuses an output path that is also another file of the run.
fn apart(what: &str, path: &Path, others: &[(&PathBuf, &str)]) -> Result<()> {
    match others.iter().find(|(other, _)| output::same_place(path, other)) {
        None => Ok(()),
        Some((_, role)) => {
            let why = format!("{}: is also {role}", path.display());
            Err(Error::Invalid { what: what.to_string(), why })
        }
    }
}

/// Draws one warm-up frame, which gives the image, then every timed view once.
fn draw(
    scene: &Arc<GpuScene>,
    technique: Technique,
    view: &View,
    timed: &[View],
    wants_map: bool,
    [load_ms, open_ms]: [f64; 2],
) -> Result<Drawn> {
    let renderer = Renderer::new(scene, technique);
    let start = Instant::now();
    let mut drawing = renderer.frames(view)?;
    let prepare_ms = milliseconds_since(start);
    let first = drawing.draw(view)?;
    let image = drawing.read_back()?;
    let overflow = if wants_map { drawing.overflow_map()? } else { None };
    // Counters known from the plan, and those that the device counted in the first frame.
    let (route, counters) = (drawing.plan().route(), drawing.plan().counters());
    let counters = counters.into_iter().chain(first.counters.iter().copied());
    let frames: Vec<FrameTime> = timed.iter().map(|view| drawing.draw(view)).collect::<Result<_>>()?;

    let gpu = scene.gpu();
    let report = gpu.report();
    let mut stats = Map::new();
    let mut put = |key: &str, value: Value| stats.insert(key.to_string(), value);
    put("schema", json!(1));
    put("technique", json!(technique.method().name()));
    put("route", json!(route));
    put("options", input::options_json(&technique));
    put(
        "device",
        json!({"name": report.name, "driver": report.driver, "api": report.api, "kind": report.kind}),
    );
    put("image", json!([image.width(), image.height()]));
    put("frames", frames.iter().map(frame_json).collect());
    // `prepare` excludes the parts that are reported separately.
    let (times, pipelines) = (scene.times(), gpu.pipeline_ms());
    let rest = (prepare_ms - times.upload - times.tables - pipelines).max(0.0);
    put(
        "setup_ms",
        json!({
            "load": load_ms, "device": open_ms, "upload": times.upload, "tables": times.tables,
            "pipelines": pipelines, "prepare": rest,
        }),
    );
    put("device_bytes", summed(gpu.memory_report()));
    if let Some(bytes) = peak_rss_bytes() {
        put("peak_rss_bytes", json!(bytes));
    }
    put("pipelines", json!(gpu.pipelines()));
    put("counters", counters.map(|(name, n)| (name.to_string(), json!(n))).collect::<Map<_, _>>().into());
    Ok(Drawn { image, overflow, first, frames, stats, route, device: report.name.clone() })
}

fn frame_json(frame: &FrameTime) -> Value {
    let mut json = Map::new();
    json.insert("wall_ms".to_string(), json!(frame.wall_ms));
    if let Some(ms) = gpu_ms(frame) {
        json.insert("gpu_ms".to_string(), json!(ms));
        let passes: Map<String, Value> =
            passes(frame).into_iter().map(|(name, ms)| (name.to_string(), json!(ms))).collect();
        json.insert("passes".to_string(), Value::Object(passes));
    }
    Value::Object(json)
}
