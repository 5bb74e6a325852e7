//! `volraster bench`: time and error of every technique, all on one device in one run.
//!
//! An image that is wrong has no speed: each case is compared with the reference before it is timed.
//! The frames of a scene's cases are drawn in turn, forwards and backwards, so that a machine that
//! warms up or is disturbed treats all of them alike.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use indicatif::ProgressBar;
use serde_json::{Map, Value, json};
use volraster::glam::DVec3;
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceImage, ReferenceOptions};
use volraster::scene::file::PRESETS;
use volraster::scene::{Camera, Field, Projection, Scene, View};
use volraster::technique::{FrameTime, Frames};
use volraster::{Error, Gpu, GpuScene, Renderer, Result, Technique};

use super::compare::{by_route, is_refusal};
use super::input::{self, DeviceArgs, Input, Size};
use super::timing::Times;
use super::{Failure, Outcome, output, table};

/// Frames of each case that are timed, after one that warms up.
const FRAMES: usize = 9;

/// Sample spacings, in units of the smallest voxel spacing.
const STEPS: [&str; 4] = ["2", "1", "0.5", "0.25"];

/// An image with a larger RMSE is wrong, not coarse: half of the whole range.
const WRONG: f64 = 0.5;

/// Image size of the standard scenes.
const SIZE: Size = Size { width: 512, height: 512 };

/// Arguments of `bench`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// `standard`: the scenes that the project's figures are quoted on; or a scene file or a data file.
    #[arg(value_name = "SUITE", default_value = "standard")]
    suite: PathBuf,
    /// Folder for bench.jsonl: one line of JSON for each case.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Leave out the largest volume and the orthographic views.
    #[arg(long)]
    quick: bool,
    /// Image size; otherwise 512x512, or that of the scene file.
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    #[command(flatten)]
    device: DeviceArgs,
}

/// A scene to measure, not yet in memory.
enum Workload {
    /// A standard scene: a field, samples along each side, and the preset of its transfer function.
    Standard { field: &'static str, side: u32, preset: &'static str },
    /// What a file holds.
    File(Box<Input>),
}

/// One technique with its options.
struct Case {
    technique: Technique,
    /// The route that was asked for; the plan has the last word.
    route: &'static str,
    step: Option<&'static str>,
    state: State,
    errors: Option<ImageErrors>,
    frames: Vec<FrameTime>,
}

/// What became of a case.
enum State {
    /// Its image is right; it is timed.
    Ready(Box<Frames>),
    /// Its image is wrong.
    Failed(String),
    /// The device cannot draw it.
    Skipped(String),
}

/// Where the lines go.
struct Report {
    file: PathBuf,
    lines: String,
    rows: Vec<Vec<String>>,
    failed: usize,
    cases: usize,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// What is wrong with the arguments, the input, the device or the output; a finding when an image
    /// is wrong.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        output::check_folder(&self.output)?;
        let workloads = self.workloads()?;
        let (gpu, _) = self.device.open(false)?;
        output::make_folder(&self.output)?;
        let heading = [
            "scene",
            "projection",
            "technique",
            "route",
            "options",
            "rmse",
            "max",
            "ms",
            "p10",
            "p90",
            "gpu ms",
        ];
        let mut report = Report {
            file: self.output.join("bench.jsonl"),
            lines: String::new(),
            rows: vec![heading.map(str::to_string).to_vec()],
            failed: 0,
            cases: 0,
        };
        let views: usize = workloads.iter().map(|workload| self.views_of(workload)).sum();
        let draws = views * cases()?.len() * (FRAMES + 1);
        let bar = output::progress(draws as u64, "bench");
        for workload in workloads {
            self.measure(&gpu, workload, &bar, &mut report)?;
        }
        bar.finish_and_clear();
        if !quiet {
            output::print(&table::aligned(&report.rows, &[0, 1, 2, 3, 4]))?;
        }
        match report.failed {
            0 => Ok(()),
            n => Err(Failure::Finding(format!("{n} of {} cases drew a wrong image", report.cases))),
        }
    }

    fn workloads(&self) -> Result<Vec<Workload>> {
        if self.suite != Path::new("standard") {
            if !self.suite.exists() {
                return Err(Error::Invalid {
                    what: "suite".to_string(),
                    why: format!(
                        "\"{}\": must be standard, a scene file or a data file",
                        self.suite.display()
                    ),
                });
            }
            return Ok(vec![Workload::File(Box::new(Input::load(&self.suite, self.size)?))]);
        }
        let standard = |field, side, preset| Workload::Standard { field, side, preset };
        let mut workloads = vec![
            standard("marschner-lobb", 64, "shells"),
            standard("marschner-lobb", 128, "shells"),
            standard("blobs", 128, "fog"),
        ];
        if !self.quick {
            workloads.push(standard("marschner-lobb", 256, "shells"));
        }
        Ok(workloads)
    }

    /// Number of views of a workload.
    fn views_of(&self, workload: &Workload) -> usize {
        match workload {
            Workload::Standard { .. } if !self.quick => 2,
            _ => 1,
        }
    }

    /// Name, scene and views of a workload.
    fn open(&self, workload: Workload) -> Result<(String, Scene, Vec<View>)> {
        match workload {
            Workload::File(input) => {
                let name = self.suite.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                Ok((name, input.scene, vec![input.settings.view]))
            }
            Workload::Standard { field, side, preset } => {
                let Size { width, height } = self.size.unwrap_or(SIZE);
                let perspective = Projection::Perspective { fov_y_deg: 42.0 };
                let orthographic = Projection::Orthographic { half_height: 1.6 };
                let projections: &[Projection] =
                    if self.quick { &[perspective] } else { &[perspective, orthographic] };
                let view = |&projection: &Projection| {
                    let eye = DVec3::new(2.0, 1.5, 3.8);
                    View::new(Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection }, width, height)
                };
                let views = projections.iter().map(view).collect::<Result<_>>()?;
                let Some(preset) = PRESETS.iter().find(|known| known.name == preset) else {
                    let why = format!("\"{preset}\": is no preset");
                    return Err(Error::Invalid { what: "transfer function".to_string(), why });
                };
                let grid = Field::from_name(field)?.sample([side; 3], "f32")?;
                let scene = Scene { grid, transfer: preset.transfer([0.0, 1.0], 1.0)? };
                Ok((format!("{field}-{side}"), scene, views))
            }
        }
    }

    /// Measures every case of a workload, one view after the other.
    fn measure(&self, gpu: &Gpu, workload: Workload, bar: &ProgressBar, report: &mut Report) -> Result<()> {
        let (name, scene, views) = self.open(workload)?;
        let scene = GpuScene::new(gpu, scene);
        for view in &views {
            let projection = if view.is_perspective() { "perspective" } else { "orthographic" };
            bar.set_message(format!("{name} {projection}"));
            let truth = reference::render(scene.scene(), view, &ReferenceOptions::default(), None)?;
            let mut cases = cases()?;
            for case in &mut cases {
                case.check(&scene, view, &truth)?;
                bar.inc(1);
            }
            for round in 0..FRAMES {
                for i in 0..cases.len() {
                    let place = if round % 2 == 0 { i } else { cases.len() - 1 - i };
                    cases[place].time(view)?;
                    bar.inc(1);
                }
            }
            for case in &cases {
                report.add(gpu, &name, projection, view, case);
            }
            // After every scene, so that a run that is stopped keeps what it has.
            volraster::io::write_text(&report.file, &report.lines)?;
        }
        Ok(())
    }
}

/// Every technique by every route, at every spacing; with the exact filter at spacing 1 as well.
fn cases() -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    for (method, route) in by_route() {
        let has = |key: &str| method.options().iter().any(|info| info.key == key);
        let mut add = |step: Option<&'static str>, more: &[(&str, &str)]| -> Result<()> {
            let mut options = vec![("route", route)];
            options.extend(step.map(|step| ("step", step)));
            options.extend(more);
            let technique = input::with_options(method, &[], &options)?;
            cases.push(Case {
                technique,
                route,
                step,
                state: State::Skipped(String::new()),
                errors: None,
                frames: Vec::new(),
            });
            Ok(())
        };
        if has("step") {
            for step in STEPS {
                add(Some(step), &[])?;
            }
        } else {
            add(None, &[])?;
        }
        if has("filter") {
            add(has("step").then_some("1"), &[("filter", "exact")])?;
        }
    }
    Ok(cases)
}

impl Case {
    /// Draws the frame that warms up and compares it with the truth.
    fn check(&mut self, scene: &Arc<GpuScene>, view: &View, truth: &ReferenceImage) -> Result<()> {
        let draw = || {
            let mut frames = Renderer::new(scene, self.technique).frames(view)?;
            frames.draw(view)?;
            let image = frames.read_back()?;
            Ok((frames, image))
        };
        match draw() {
            Ok((frames, image)) => {
                self.route = frames.plan().route();
                let errors = ImageErrors::between_f64(&image, truth)?;
                self.errors = Some(errors);
                self.state = if errors.non_finite > 0 {
                    State::Failed(format!("{} samples NaN or infinite", errors.non_finite))
                } else if errors.all.rmse > WRONG {
                    State::Failed(format!("rmse {:.2e} is above {WRONG}", errors.all.rmse))
                } else {
                    State::Ready(Box::new(frames))
                };
                Ok(())
            }
            Err(error) if is_refusal(&error) => {
                self.state = State::Skipped(error.to_string());
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    /// Draws one frame for its time.
    fn time(&mut self, view: &View) -> Result<()> {
        if let State::Ready(frames) = &mut self.state {
            self.frames.push(frames.draw(view)?);
        }
        Ok(())
    }
}

impl Report {
    /// A line of JSON and a row of the table.
    fn add(&mut self, gpu: &Gpu, scene: &str, projection: &str, view: &View, case: &Case) {
        let device = gpu.report();
        let mut line = Map::new();
        let mut put = |key: &str, value: Value| line.insert(key.to_string(), value);
        put("version", json!(env!("CARGO_PKG_VERSION")));
        put("device", json!(device.name));
        put("driver", json!(device.driver));
        put("api", json!(device.api));
        put("software", json!(gpu.is_software()));
        put("scene", json!(scene));
        put("projection", json!(projection));
        put("size", json!(view.extent()));
        put("technique", json!(case.technique.method().name()));
        put("route", json!(case.route));
        put("options", input::options_json(&case.technique));
        if let Some(step) = case.step.and_then(|step| step.parse::<f64>().ok()) {
            put("step", json!(step));
        }
        if let Some(errors) = &case.errors {
            put("errors", json!(errors));
        }
        let (wall, gpu_ms) = (Times::wall(&case.frames), Times::gpu(&case.frames));
        match &case.state {
            State::Ready(_) => put("frames", json!(case.frames.len())),
            State::Failed(why) => put("failed", json!(why)),
            State::Skipped(why) => put("skipped", json!(why)),
        };
        for (key, times) in [("wall_ms", &wall), ("gpu_ms", &gpu_ms)] {
            if let Some(times) = times {
                put(key, times.json());
            }
        }
        self.lines.push_str(&Value::Object(line).to_string());
        self.lines.push('\n');
        self.cases += 1;
        self.failed += usize::from(matches!(case.state, State::Failed(_)));

        let error = |pick: fn(&ImageErrors) -> f64| {
            case.errors.as_ref().map_or_else(|| "-".to_string(), |errors| format!("{:.2e}", pick(errors)))
        };
        let time = |times: &Option<Times>, per_cent: u32| {
            times.as_ref().map_or_else(|| "-".to_string(), |times| format!("{:.1}", times.quantile(per_cent)))
        };
        let mut row =
            [scene, projection, case.technique.method().name(), case.route].map(str::to_string).to_vec();
        row.push(input::options_text(&case.technique));
        row.extend([error(|e| e.all.rmse), error(|e| e.all.max_abs)]);
        match &case.state {
            State::Ready(_) => {
                row.extend([time(&wall, 50), time(&wall, 10), time(&wall, 90), time(&gpu_ms, 50)]);
            }
            State::Failed(_) => row.push("FAILED".to_string()),
            State::Skipped(_) => row.push("skipped".to_string()),
        }
        self.rows.push(row);
    }
}
