//! `volraster render`: draws one image, and measures frame times.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};
use volraster::choice::{Choice, Estimate, Goal, Profile, Source, Trial, TrialOutcome};
use volraster::scene::{Data, View};
use volraster::technique::FrameTime;
use volraster::{Error, GpuScene, Image, Renderer, Result, Technique, choice};

use crate::cli::in_flight::InFlight;
use crate::cli::input::{self, ArraysArgs, DeviceArgs, Input, LookArgs, Request, Size, finite, positive};
use crate::cli::memory::{peak_rss_bytes, summed};
use crate::cli::nothing::why_nothing;
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
    #[command(flatten)]
    look: LookArgs,
    /// Output image: .exr (32-bit float, linear) or .png (for viewing).
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Technique and options, see `volraster techniques` [default: that of the scene, else the default for its data].
    #[arg(long, value_name = "NAME[:key=value,...]")]
    technique: Option<String>,
    /// Choose the fastest technique and options whose root mean square error is at most this (premultiplied linear
    /// colour). The search draws trial images and compares them with the float64 reference.
    #[arg(long, value_name = "RMSE", conflicts_with = "technique", allow_negative_numbers = true,
        value_parser = positive)]
    max_error: Option<f64>,
    /// Choose the most accurate technique and options that draw a frame within this many milliseconds.
    #[arg(long, value_name = "MS", conflicts_with_all = ["technique", "max_error"], allow_negative_numbers = true,
        value_parser = positive)]
    budget: Option<f64>,
    /// Image size [default: that of the scene].
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    /// Frames to time after one warm-up frame [default: 1 with --stats, else 0, which reports the time of the warm-up
    /// frame].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    frames: Option<u32>,
    /// Frames in flight: with 2 the host records one while the device draws the other, and the time of a frame is the mean of four.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    in_flight: u8,
    /// Degrees by which the eye orbits the target around `up` from frame to frame. The image shows angle 0.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true, requires = "frames",
        value_parser = finite)]
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
struct Drawn {
    image: Image,
    /// The image of --overflow-map.
    map: Option<Image>,
    stats: Value,
    /// The line for stdout, without the file.
    line: String,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        self.check_paths()?;
        let request = self.technique.as_deref().map(Request::parse).transpose()?;
        let input = Input::load(&self.scene, self.size, &self.arrays, quiet)?;
        let Input { scene, settings } = self.look.apply(input)?;
        let mut technique = settings.choose(request, &scene)?;
        let views = self.views(&settings.view)?;

        let start = Instant::now();
        let (gpu, log) = self.device.open(self.validate)?;
        let open_ms = milliseconds_since(start);
        let scene = GpuScene::new(&gpu, scene);
        let mut chosen = None;
        if let Some(goal) = self.goal() {
            let profile = Profile::load(&gpu);
            let start = Instant::now();
            let choice = choice::choose(&scene, &settings.view, goal, &profile)?;
            technique = choice.technique;
            chosen = Some((choice, milliseconds_since(start)));
        }
        drop(gpu);
        let drawn = self.draw(&scene, technique, &settings.view, &views, [settings.load_ms, open_ms])?;
        let Drawn { image, map, mut stats, line } = drawn;
        let nothing = why_nothing(&image, scene.scene(), &settings.view);
        drop(scene);
        if let Some((choice, ms)) = &chosen {
            stats["choice"] = self.choice_json(choice, *ms);
        }
        stats["validation_messages"] = json!(log.messages().len());

        volraster::io::write_image(&self.output, &image, settings.background)?;
        if let (Some(path), Some(map)) = (&self.overflow_map, map) {
            volraster::io::write_image(path, &map, [0.0, 0.0, 0.0, 1.0])?;
        }
        if let Some(path) = &self.stats {
            output::write_json(path, &stats)?;
        }
        if !quiet {
            if let Some(why) = nothing {
                output::complain(&format!("warning: the picture shows nothing: {why}"));
            }
            if let Some((choice, _)) = &chosen {
                output::print(&reason(choice))?;
            }
            output::print(&format!("{line}: {}", self.output.display()))?;
        }
        check_validation(&log)
    }

    /// Checks the output paths.
    fn check_paths(&self) -> Result<()> {
        output::check_image(&self.output)?;
        let mut taken = vec![(&self.output, "the image"), (&self.scene, "the input")];
        if let Some(stats) = &self.stats {
            volraster::io::check_writable(stats)?;
            output::check_apart("--stats", stats, &taken)?;
            taken.push((stats, "the file of --stats"));
        }
        if let Some(map) = &self.overflow_map {
            output::check_image(map)?;
            output::check_apart("--overflow-map", map, &taken)?;
        }
        Ok(())
    }

    /// Returns the goal of an automatic choice.
    fn goal(&self) -> Option<Goal> {
        self.max_error.map(Goal::MaxError).or_else(|| self.budget.map(Goal::Budget))
    }

    /// Describes an automatic choice and its trials.
    fn choice_json(&self, choice: &Choice, ms: f64) -> Value {
        let trial = |trial: &Trial| {
            let (measured, refused) = match &trial.outcome {
                TrialOutcome::Drawn { error: Estimate { rmse, bound, pixels }, ms } => {
                    (json!({"rmse": rmse, "rmse_bound": bound, "pixels": pixels, "ms": ms}), None)
                }
                TrialOutcome::Refused(why) => (Value::Null, Some(why)),
            };
            output::without_nulls(json!({
                "technique": trial.spec,
                "predicted": {"rmse": trial.predicted_error, "ms": trial.predicted_ms},
                "measured": measured,
                "refused": refused,
            }))
        };
        json!({
            "max_error": self.max_error,
            "budget_ms": self.budget,
            "chosen": choice.trials.get(choice.chosen).map(|trial| &trial.spec),
            "candidates": choice.candidates,
            "confidence": CONFIDENCE,
            "predictions": source(choice.source),
            "search_ms": ms,
            "trials": choice.trials.iter().map(trial).collect::<Value>(),
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

    /// Draws one warm-up frame, which gives the image, then every timed view once.
    fn draw(
        &self,
        scene: &Arc<GpuScene>,
        technique: Technique,
        view: &View,
        timed: &[View],
        [load_ms, open_ms]: [f64; 2],
    ) -> Result<Drawn> {
        let name = technique.method().name();
        let start = Instant::now();
        let mut plans = InFlight::new(scene, technique, view, self.in_flight)?;
        let (prepare_ms, prepared_pipelines) = (milliseconds_since(start), scene.gpu().pipeline_ms());
        let drawing = plans.first();
        let first = drawing.draw(view)?;
        let image = drawing.read_back()?;
        let (width, height) = (image.width(), image.height());
        let overflow = if self.overflow_map.is_some() { Some(drawing.overflow_map()?) } else { None };
        let (route, known) = (drawing.plan().route(), drawing.plan().counters());
        let pass_bytes = drawing.plan().pass_bytes();
        let frames: Vec<FrameTime> = timed.iter().map(|view| plans.draw(view)).collect::<Result<_>>()?;
        let map = overflow.map(|overflow| {
            let Some(overflow) = overflow else {
                let why = format!("\"{name}\": has no k-buffer");
                return Err(Error::Invalid { what: "--overflow-map".to_string(), why });
            };
            let grey = overflow.into_iter().map(|is_set| f32::from(u8::from(is_set)));
            Image::new(width, height, grey.map(|v| [v, v, v, 1.0]).collect())
        });
        let time = match Times::wall(&frames) {
            None => format!("first frame {:.1} ms", first.wall_ms),
            Some(times) if frames.len() == 1 => format!("{:.1} ms per frame", times.median()),
            Some(times) => format!("{:.1} ms per frame (median of {})", times.median(), frames.len()),
        };

        let gpu = scene.gpu();
        let report = gpu.report();
        // `prepare` excludes the parts that are reported separately.
        let (times, pipelines) = (scene.times(), gpu.pipeline_ms());
        let rest = (prepare_ms - times.upload - times.tables - prepared_pipelines).max(0.0);
        let mut stats = output::without_nulls(json!({
            "schema": 1,
            "technique": name,
            "route": route,
            "options": input::options_json(&technique),
            "device": {"name": report.name, "driver": report.driver, "api": report.api, "kind": report.kind},
            "image": [width, height],
            "frames": frames.iter().map(frame_json).collect::<Value>(),
            "setup_ms": {
                "load": load_ms, "device": open_ms, "upload": times.upload, "tables": times.tables,
                "pipelines": pipelines, "prepare": rest,
            },
            "pass_bytes": pass_bytes,
            "device_bytes": summed(gpu.memory_report()),
            "peak_rss_bytes": peak_rss_bytes(),
            "pipelines": gpu.pipelines(),
        }));
        // Counters known from the plan, and those of the device. A frame that counts samples takes longer, so it is none of the timed ones.
        let counts = self.stats.is_some() && matches!(scene.scene().data, Data::Grid(_));
        drop(plans);
        let counted = match counts.then(|| Renderer::new(scene, technique).count(view)) {
            Some(counted) if !counted.as_ref().is_err_and(input::is_refusal) => counted?,
            _ => first.counters,
        };
        stats["counters"] = known.into_iter().chain(counted).collect::<Value>();
        let line = format!("{name} ({route}) on {}: {width} x {height}, {time}", report.name);
        Ok(Drawn { image, map: map.transpose()?, stats, line })
    }
}

/// Probability that the bound of an estimated error holds.
const CONFIDENCE: f64 = 0.95;

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

fn frame_json(frame: &FrameTime) -> Value {
    let gpu_ms = gpu_ms(frame);
    let passes = gpu_ms.map(|_| passes(frame).into_iter().collect::<Value>());
    output::without_nulls(json!({"wall_ms": frame.wall_ms, "gpu_ms": gpu_ms, "passes": passes}))
}
