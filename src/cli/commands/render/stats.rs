//! The measurements of drawing, as JSON and as a line.

use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};
use volraster::scene::{Data, View};
use volraster::technique::FrameTime;
use volraster::{GpuScene, Image, Plan, Renderer, Result, Technique};

use crate::cli::input;
use crate::cli::memory::{peak_rss_bytes, summed};
use crate::cli::output;
use crate::cli::timing::{Times, gpu_ms, milliseconds_since, passes};

/// The results of drawing, which outlive the device.
pub(super) struct Drawn {
    /// The image, of a film the first.
    pub(super) image: Image,
    pub(super) stats: Value,
    /// The line for stdout, without the file.
    pub(super) line: String,
}

/// The first plan, and how long its preparation took.
pub(super) struct Setup {
    technique: Technique,
    /// Milliseconds for preparing, without pipelines, and in all.
    pipelines_ms: f64,
    prepare_ms: f64,
    route: &'static str,
    counters: Vec<(&'static str, u64)>,
    pass_bytes: Value,
}

impl Setup {
    /// Takes the first plan, whose preparation began at `start` and has just ended.
    pub(super) fn of(scene: &GpuScene, technique: Technique, start: Instant, plan: &Plan) -> Self {
        let (prepare_ms, pipelines_ms) = (milliseconds_since(start), scene.gpu().pipeline_ms());
        let (route, counters, pass_bytes) = (plan.route(), plan.counters(), json!(plan.pass_bytes()));
        Self { technique, pipelines_ms, prepare_ms, route, counters, pass_bytes }
    }

    /// Describes drawing: the first frame, of the view given, and the timed ones. Draws once more to count samples if
    /// `counts`.
    pub(super) fn report(
        self,
        scene: &Arc<GpuScene>,
        image: Image,
        (view, first): (&View, FrameTime),
        frames: &[FrameTime],
        [load_ms, open_ms]: [f64; 2],
        counts: bool,
    ) -> Result<Drawn> {
        let name = self.technique.method().name();
        let time = match Times::wall(frames) {
            None => format!("first frame {:.1} ms", first.wall_ms),
            Some(times) if frames.len() == 1 => format!("{:.1} ms per frame", times.median()),
            Some(times) => format!("{:.1} ms per frame (median of {})", times.median(), frames.len()),
        };
        let gpu = scene.gpu();
        let report = gpu.report();
        // `prepare` excludes the parts that are reported separately.
        let (times, pipelines) = (scene.times(), gpu.pipeline_ms());
        let rest = (self.prepare_ms - times.upload - times.tables - self.pipelines_ms).max(0.0);
        let (width, height) = (image.width(), image.height());
        let [covered, mean_opacity] = coverage(&image);
        let mut stats = output::without_nulls(json!({
            "schema": 1,
            "technique": name,
            "route": self.route,
            "options": input::options_json(&self.technique),
            "device": {"name": report.name, "driver": report.driver, "api": report.api, "kind": report.kind},
            "image": [width, height],
            "picture": {"covered": covered, "mean_opacity": mean_opacity},
            "frames": frames.iter().map(frame_json).collect::<Value>(),
            "setup_ms": {
                "load": load_ms, "device": open_ms, "upload": times.upload, "tables": times.tables,
                "pipelines": pipelines, "prepare": rest,
            },
            "pass_bytes": self.pass_bytes,
            "device_bytes": summed(gpu.memory_report()),
            "peak_rss_bytes": peak_rss_bytes(),
            "pipelines": gpu.pipelines(),
        }));
        // Counters known from the plan, and those of the device. A frame that counts samples takes longer, so it is none of the timed ones.
        let counts = counts && matches!(scene.scene().data, Data::Grid(_));
        let counted = match counts.then(|| Renderer::new(scene, self.technique).count(view)) {
            Some(counted) if !counted.as_ref().is_err_and(input::is_refusal) => counted?,
            _ => first.counters,
        };
        stats["counters"] = self.counters.into_iter().chain(counted).collect::<Value>();
        let (route, device) = (self.route, &report.name);
        let covers = format!("covers {:.0} %", 100.0 * covered);
        let line = format!("{name} ({route}) on {device}: {width} x {height}, {covers}, {time}");
        Ok(Drawn { image, stats, line })
    }
}

/// Returns the share of pixels with an opacity that 8 bits show, and the mean opacity of all.
fn coverage(image: &Image) -> [f64; 2] {
    let opacities = || image.pixels().iter().map(|pixel| f64::from(pixel[3]));
    let share = |sum: f64| sum / image.pixels().len() as f64;
    [share(opacities().filter(|opacity| *opacity >= 0.5 / 255.0).count() as f64), share(opacities().sum())]
}

fn frame_json(frame: &FrameTime) -> Value {
    let gpu_ms = gpu_ms(frame);
    let passes = gpu_ms.map(|_| passes(frame).into_iter().collect::<Value>());
    let bound = frame.bound.map(|bound| json!({"rmse": bound.rmse, "greatest": bound.greatest}));
    output::without_nulls(
        json!({"wall_ms": frame.wall_ms, "gpu_ms": gpu_ms, "passes": passes, "error_bound": bound}),
    )
}
