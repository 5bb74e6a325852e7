//! `volraster bench`: time and error of every technique, all on one device in one run.
//!
//! An image that is wrong has no speed: each case is compared with the reference before it is timed.
//! The frames of a scene's cases are drawn in turn, forwards and backwards, so that a machine that
//! warms up or is disturbed treats all of them alike. What is drawn is listed in `suite`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use indicatif::ProgressBar;
use serde_json::{Map, Value, json};
use volraster::io::ReadOptions;
use volraster::measure::{Cost, ImageErrors};
use volraster::reference::{self, ReferenceImage, ReferenceOptions};
use volraster::scene::{Scene, View};
use volraster::technique::{FrameTime, Frames, Method};
use volraster::{Error, Gpu, GpuScene, Renderer, Result};

use super::compare::is_refusal;
use super::fronts::{Fronts, Measured};
use super::input::{self, ArrayArg, DeviceArgs, Input, Size};
use super::required_k::RequiredK;
use super::suite::{self, Setting, StandardScene, Sweep};
use super::timing::Times;
use super::{Failure, Outcome, output, table};

/// Frames of each case that are timed, after one that warms up.
const FRAMES: usize = 9;

/// A slow case has fewer: none more once it has had so many milliseconds, but never fewer than
/// [`FEWEST`].
const ENOUGH_MS: f64 = 4000.0;

/// Frames of the slowest case.
const FEWEST: usize = 5;

/// An image with a larger RMSE is wrong, not coarse: half of the whole range.
const WRONG: f64 = 0.5;

/// Most bytes that a volume found in a folder may take.
const MOST_BYTES: u64 = 512 << 20;

/// Arguments of `bench`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// `standard`: the scenes that the project's figures are quoted on; or a scene file or a data file.
    #[arg(value_name = "SUITE", default_value = "standard")]
    suite: PathBuf,
    #[command(flatten)]
    array: ArrayArg,
    /// Folder for bench.jsonl, one line of JSON for each case, fronts.json, times at equal error, and a
    /// plot of each view's fronts.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Two scenes, one view of each, and fewer cases.
    #[arg(long)]
    quick: bool,
    /// Also measure every volume file and scene file under this folder, with few cases each. Files that
    /// cannot be read, and volumes above 512 MiB, are passed over with a line on stderr.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Image size; otherwise 512x512, or that of the scene file.
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    #[command(flatten)]
    device: DeviceArgs,
}

/// A scene to measure.
enum Workload {
    /// A standard scene, not yet in memory.
    Standard(&'static StandardScene),
    /// What a file holds.
    File(Box<Input>),
    /// A file found in a folder, not yet opened, and its name from there.
    Found(PathBuf, String),
}

/// One technique with its options.
struct Case {
    setting: Setting,
    state: State,
    errors: Option<ImageErrors>,
    frames: Vec<FrameTime>,
}

/// What became of a case.
enum State {
    /// It is timed: its image is right, or wrong in a way that its low precision excuses.
    Ready(Box<Frames>),
    /// Its image is wrong.
    Failed(String),
    /// The device cannot draw it.
    Skipped(String),
}

/// Where results go.
struct Report {
    folder: PathBuf,
    quiet: bool,
    lines: String,
    fronts: Vec<Value>,
    /// Names of plots, so that no two views have one.
    plots: Vec<String>,
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
        let workloads = self.workloads(quiet)?;
        let (gpu, _) = self.device.open(false)?;
        output::make_folder(&self.output)?;
        let mut report = Report {
            folder: self.output.clone(),
            quiet,
            lines: String::new(),
            fronts: Vec::new(),
            plots: Vec::new(),
            failed: 0,
            cases: 0,
        };
        let mut draws = 0;
        for workload in &workloads {
            draws += self.views_of(workload) * self.draws_of(workload)?;
        }
        let bar = output::progress(draws as u64, "bench");
        for workload in workloads {
            self.measure(&gpu, workload, &bar, &mut report)?;
        }
        bar.finish_and_clear();
        match report.failed {
            0 => Ok(()),
            n => Err(Failure::Finding(format!("{n} of {} cases drew a wrong image", report.cases))),
        }
    }

    fn workloads(&self, quiet: bool) -> Result<Vec<Workload>> {
        let mut workloads: Vec<Workload> = if self.suite == Path::new("standard") {
            if let Some(array) = &self.array.array {
                return Err(Error::Invalid {
                    what: "--array".to_string(),
                    why: format!("\"{array}\": the standard scenes have no arrays"),
                });
            }
            let mut scenes = StandardScene::chosen(self.quick).collect::<Vec<_>>();
            scenes.retain(|scene| scene.is_drawn());
            scenes.into_iter().map(Workload::Standard).collect()
        } else {
            if !self.suite.exists() {
                return Err(Error::Invalid {
                    what: "suite".to_string(),
                    why: format!(
                        "\"{}\": must be standard, a scene file or a data file",
                        self.suite.display()
                    ),
                });
            }
            let input = Input::load(&self.suite, self.size, &self.array, quiet)?;
            input::drawn(&input.scene.data)?;
            vec![Workload::File(Box::new(input))]
        };
        if let Some(folder) = &self.data {
            let name =
                |path: &Path| path.strip_prefix(folder).unwrap_or(path).to_string_lossy().replace('\\', "/");
            workloads.extend(files_under(folder)?.into_iter().map(|path| {
                let name = name(&path);
                Workload::Found(path, name)
            }));
        }
        Ok(workloads)
    }

    /// Number of views of a workload.
    fn views_of(&self, workload: &Workload) -> usize {
        match workload {
            Workload::Standard(scene) => scene.view_count(self.quick),
            Workload::File(_) | Workload::Found(..) => 1,
        }
    }

    /// The cases of a workload.
    fn sweeps_of(&self, workload: &Workload) -> &'static [Sweep] {
        match workload {
            Workload::Found(..) => suite::DATA,
            _ if self.quick => suite::QUICK,
            _ => suite::STANDARD,
        }
    }

    /// Most frames that a view of a workload takes.
    fn draws_of(&self, workload: &Workload) -> Result<usize> {
        Ok(suite::settings(self.sweeps_of(workload))?.len() * (FRAMES + 1))
    }

    /// Name, scene and views of a workload.
    fn open(&self, workload: Workload) -> Result<(String, Scene, Vec<View>)> {
        let size = self.size.unwrap_or(suite::SIZE);
        match workload {
            Workload::File(input) => {
                let name = self.suite.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                Ok((name, input.scene, vec![input.settings.view]))
            }
            Workload::Found(path, name) => {
                let input = Input::load_within(&path, Some(size), &ReadOptions::within(MOST_BYTES))?;
                input::drawn(&input.scene.data).map_err(|error| error.in_file(&path))?;
                Ok((name, input.scene, vec![input.settings.view]))
            }
            Workload::Standard(scene) => {
                Ok((scene.name.to_string(), scene.load()?, scene.views(self.quick, size)?))
            }
        }
    }

    /// Measures every case of a workload, one view after the other.
    fn measure(&self, gpu: &Gpu, workload: Workload, bar: &ProgressBar, report: &mut Report) -> Result<()> {
        let mut settings = suite::settings(self.sweeps_of(&workload))?;
        let draws = self.views_of(&workload) * self.draws_of(&workload)?;
        let found = matches!(workload, Workload::Found(..));
        let views_of = self.views_of(&workload);
        let (name, scene, views) = match self.open(workload) {
            Ok(opened) => opened,
            // Nobody has asked for just this file.
            Err(error) if found => {
                bar.suspend(|| output::complain(&format!("skipped: {error}")));
                bar.inc(draws as u64);
                return Ok(());
            }
            Err(error) => return Err(error),
        };
        settings.retain(|setting| setting.technique.method().draws(&scene.data));
        bar.inc((draws - views_of * settings.len() * (FRAMES + 1)) as u64);
        let scene = GpuScene::new(gpu, scene);
        for view in &views {
            let projection = if view.is_perspective() { "perspective" } else { "orthographic" };
            bar.set_message(format!("{name} {projection}"));
            let truth = reference::render(scene.scene(), view, &ReferenceOptions::default(), None)?;
            let mut cases: Vec<Case> = settings.iter().map(|&setting| Case::new(setting)).collect();
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
            // After every view, so that a run that is stopped keeps what it has.
            let required_k = match RequiredK::measure(&scene, view) {
                Err(error) if is_refusal(&error) => None,
                measured => measured?,
            };
            let text = report.add(gpu, &name, projection, view, &cases, required_k.as_ref())?;
            if !report.quiet {
                bar.suspend(|| output::print(&text))?;
            }
        }
        Ok(())
    }
}

/// Every file under a folder, sorted. Links to files count, links to folders are not followed.
fn files_under(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let failed = |source| Error::Io { path: folder.clone(), action: "cannot list", source };
        for entry in std::fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let path = entry.path();
            if entry.file_type().map_err(failed)?.is_dir() {
                folders.push(path);
            } else if path.is_file() {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

impl Case {
    fn new(setting: Setting) -> Self {
        Self { setting, state: State::Skipped(String::new()), errors: None, frames: Vec::new() }
    }

    /// Whether colours are kept in float32 until the image is done, as they are unless `target` says
    /// otherwise. Formats of lower precision lose thin media, which is their known fault and no finding.
    fn is_precise(&self) -> bool {
        let pairs = self.setting.technique.option_pairs();
        pairs.iter().all(|(key, value)| *key != "target" || value == "rgba32f")
    }

    /// Whether the image is too far from the truth to count.
    fn is_wrong(&self) -> bool {
        // A sample that is NaN has an infinite error, and so has the image.
        self.errors.as_ref().is_some_and(|errors| errors.all.rmse > WRONG)
    }

    /// Draws the frame that warms up and compares it with the truth.
    fn check(&mut self, scene: &Arc<GpuScene>, view: &View, truth: &ReferenceImage) -> Result<()> {
        let draw = || {
            let mut frames = Renderer::new(scene, self.setting.technique).frames(view)?;
            frames.draw(view)?;
            let image = frames.read_back()?;
            Ok((frames, image))
        };
        match draw() {
            Ok((frames, image)) => {
                self.setting.route = frames.plan().route();
                let errors = ImageErrors::between_f64(&image, truth)?;
                let (non_finite, rmse) = (errors.non_finite, errors.all.rmse);
                self.errors = Some(errors);
                self.state = if non_finite > 0 {
                    State::Failed(format!("{non_finite} samples NaN or infinite"))
                } else if self.is_wrong() && self.is_precise() {
                    State::Failed(format!("rmse {rmse:.2e} is above {WRONG}"))
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

    /// Draws one frame for its time, unless the case has had enough of it.
    fn time(&mut self, view: &View) -> Result<()> {
        if let State::Ready(frames) = &mut self.state {
            let spent: f64 = self.frames.iter().map(|frame| frame.wall_ms).sum();
            if self.frames.len() < FEWEST || spent < ENOUGH_MS {
                self.frames.push(frames.draw(view)?);
            }
        }
        Ok(())
    }

    /// Time and error for the front; nothing for a wrong image.
    fn measured(&self) -> Option<Measured> {
        let Setting { technique, route, .. } = self.setting;
        let errors = self.errors.as_ref().filter(|_| !self.is_wrong())?;
        let cost = Cost { time: Times::wall(&self.frames)?.median(), error: errors.all.rmse };
        Some(Measured { technique, route, cost })
    }

    /// The line of JSON.
    fn json(
        &self,
        gpu: &Gpu,
        scene: &str,
        projection: &str,
        view: &View,
        required_k: Option<&RequiredK>,
    ) -> Value {
        let Setting { sweep, technique, route } = &self.setting;
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
        put("sweep", json!(sweep));
        put("technique", json!(technique.method().name()));
        put("route", json!(route));
        let options = input::options_json(technique);
        // Where slices are the grid's own there is no step.
        let step = options.get("step").filter(|step| step.is_number()).cloned();
        put("options", options);
        if let Some(step) = step {
            put("step", step);
        }
        if let Some(errors) = &self.errors {
            put("errors", json!(errors));
        }
        if let Some(frame) = self.frames.last().filter(|frame| !frame.counters.is_empty()) {
            let counters = frame.counters.iter().map(|(name, n)| ((*name).to_string(), json!(n)));
            put("counters", counters.collect::<Map<_, _>>().into());
        }
        if let Some(required_k) = required_k.filter(|_| technique.method() == Method::Havs) {
            put("required_k", required_k.json());
        }
        match &self.state {
            State::Ready(_) => put("frames", json!(self.frames.len())),
            State::Failed(why) => put("failed", json!(why)),
            State::Skipped(why) => put("skipped", json!(why)),
        };
        if self.is_wrong() {
            put("wrong", json!(true));
        }
        for (key, times) in [("wall_ms", Times::wall(&self.frames)), ("gpu_ms", Times::gpu(&self.frames))] {
            if let Some(times) = times {
                put(key, times.json());
            }
        }
        Value::Object(line)
    }

    /// The row of the table.
    fn row(&self, scene: &str, projection: &str) -> Vec<String> {
        let Setting { technique, route, .. } = &self.setting;
        let error = |pick: fn(&ImageErrors) -> f64| {
            self.errors.as_ref().map_or_else(|| "-".to_string(), |errors| format!("{:.2e}", pick(errors)))
        };
        let time = |times: &Option<Times>, per_cent: u32| {
            times.as_ref().map_or_else(|| "-".to_string(), |times| format!("{:.1}", times.quantile(per_cent)))
        };
        let mut row = [scene, projection, technique.method().name(), route].map(str::to_string).to_vec();
        row.push(input::options_text(technique));
        row.extend([error(|e| e.all.rmse), error(|e| e.all.max_abs)]);
        match &self.state {
            State::Ready(_) => {
                let (wall, gpu_ms) = (Times::wall(&self.frames), Times::gpu(&self.frames));
                row.extend([time(&wall, 50), time(&wall, 10), time(&wall, 90), time(&gpu_ms, 50)]);
                row.extend(self.is_wrong().then(|| "wrong".to_string()));
            }
            State::Failed(_) => row.push("FAILED".to_string()),
            State::Skipped(_) => row.push("skipped".to_string()),
        }
        row
    }
}

/// Headings of the table of cases.
const HEADING: [&str; 11] =
    ["scene", "projection", "technique", "route", "options", "rmse", "max", "ms", "p10", "p90", "gpu ms"];

impl Report {
    /// Writes what a view's cases gave, and returns its tables.
    fn add(
        &mut self,
        gpu: &Gpu,
        scene: &str,
        projection: &str,
        view: &View,
        cases: &[Case],
        required_k: Option<&RequiredK>,
    ) -> Result<String> {
        let mut rows = vec![HEADING.map(str::to_string).to_vec()];
        for case in cases {
            self.lines.push_str(&case.json(gpu, scene, projection, view, required_k).to_string());
            self.lines.push('\n');
            self.cases += 1;
            self.failed += usize::from(matches!(case.state, State::Failed(_)));
            rows.push(case.row(scene, projection));
        }
        volraster::io::write_text(self.folder.join("bench.jsonl"), &self.lines)?;

        let measured: Vec<Measured> = cases.iter().filter_map(Case::measured).collect();
        let methods: Vec<Method> = cases.iter().map(|case| case.setting.technique.method()).collect();
        let fronts = Fronts::new(&methods, &measured);
        let device = &gpu.report().name;
        let [width, height] = view.extent();
        let title = format!("{scene}, {projection}, {width} x {height}: {device}");
        let mut entry = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "device": device,
            "driver": gpu.report().driver,
            "scene": scene,
            "projection": projection,
            "size": view.extent(),
            "time": "wall_ms",
            "fronts": fronts.json(),
        });
        if let Some(svg) = fronts.svg(&title) {
            let name = self.plot_name(scene, projection);
            let why = |why| Error::Invalid { what: format!("plot {name}"), why };
            volraster::io::write_text(self.folder.join(&name), &svg.map_err(why)?)?;
            entry["plot"] = json!(name);
            self.plots.push(name);
        }
        self.fronts.push(entry);
        output::write_json(&self.folder.join("fronts.json"), &json!(self.fronts))?;
        let cases = table::aligned(&rows, &[0, 1, 2, 3, 4, 11]);
        let required_k = required_k.map_or_else(String::new, |required| format!("\n{}\n", required.text()));
        Ok(format!("{cases}\n\nfronts of {scene} {projection}\n{}\n{required_k}", fronts.table()))
    }

    /// A name for a view's plot that no other has.
    fn plot_name(&self, scene: &str, projection: &str) -> String {
        // What a scene in a folder is called has separators.
        let plain = |c: char| if c.is_alphanumeric() || "._-".contains(c) { c } else { '-' };
        let stem = format!("fronts-{}-{projection}", scene.chars().map(plain).collect::<String>());
        let numbered = (2..).map(|n| format!("{stem}-{n}.svg"));
        let mut names = std::iter::once(format!("{stem}.svg")).chain(numbered);
        let free = names.find(|name| !self.plots.contains(name));
        // There are more numbers than plots.
        free.unwrap_or(stem)
    }
}
