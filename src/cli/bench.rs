//! `volraster bench`: time and error of every technique, all on one device in one run.
//!
//! An image that is wrong has no speed: each case is compared with the reference before it is timed.
//! The frames of a scene's cases are drawn in turn, forwards and backwards, so that a machine that
//! warms up or is disturbed treats all of them alike. What is drawn is listed in `suite`; what a case gives is a
//! `record`, and tables and plots are made from records alone.

use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use indicatif::ProgressBar;
use volraster::io::ReadOptions;
use volraster::io::scene_file::SceneFile;
use volraster::reference::ReferenceImage;
use volraster::scene::{Scene, View};
use volraster::{Error, Gpu, GpuScene, Result};

use super::cache::Cache;
use super::case::{Case, Shared};
use super::compare::is_refusal;
use super::input::{self, ArraysArgs, DeviceArgs, Input, Size};
use super::ratios::Ratios;
use super::required_k::RequiredK;
use super::results::Results;
use super::suite::{self, SUITES, StandardScene, Suite, Sweep};
use super::{Failure, Outcome, interrupt, output};

/// Frames of each case that are timed, of what no suite lists.
const FRAMES: usize = 9;

/// Most bytes that a volume found in a folder may take.
const MOST_BYTES: u64 = 512 << 20;

/// Arguments of `bench`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// `smoke`: a little of everything, in less than a minute. `standard`: the scenes that the project's figures are
    /// quoted on. `full`: more scenes, views and frames. Or a scene file, a data file, or a folder of scene files.
    #[arg(value_name = "SUITE", default_value = "standard")]
    suite: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    /// Folder for bench.jsonl, one line of JSON for each case, fronts.json, times at equal error, table.md, and
    /// plots as SVG.
    #[arg(short, long, value_name = "DIR", required_unless_present = "compare")]
    output: Option<PathBuf>,
    /// Compare two runs instead of measuring: the ratio of the medians of every case that both have timed, with the
    /// interval in which it lies with 95 %. With --output, ratios.json goes there.
    #[arg(long, num_args = 2, value_names = ["A.jsonl", "B.jsonl"], conflicts_with_all = ["suite", "array", "data", "only", "frames", "size", "device", "no_cache"])]
    compare: Option<Vec<PathBuf>>,
    /// Of a suite or folder only the scenes with one of these words in their names.
    #[arg(long, value_name = "WORD,...", value_delimiter = ',')]
    only: Vec<String>,
    /// Also measure every volume file and scene file under this folder, with few cases each. Files that
    /// cannot be read, and volumes above 512 MiB, are passed over with a line on stderr.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Frames of each case that are timed, after one that warms up; otherwise 9, or the suite's number. Slow cases
    /// have fewer.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    frames: Option<u16>,
    /// Image size; otherwise the suite's, 512x512, or that of the scene file.
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    /// Draw references anew, and keep none.
    #[arg(long)]
    no_cache: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

/// A scene to measure.
enum Workload {
    /// A scene of a suite, not yet in memory.
    Standard(&'static Suite, &'static StandardScene),
    /// What a file holds.
    File(Box<Input>),
    /// A file found in a folder, not yet opened, its name from there, and its cases.
    Found(PathBuf, String, &'static [Sweep]),
}

/// A view with its cases.
struct Shot {
    projection: &'static str,
    view: View,
    sweeps: &'static [Sweep],
}

/// A scene in memory, with its views.
struct Opened {
    name: String,
    family: Option<String>,
    scene: Scene,
    shots: Vec<Shot>,
}

/// Whether to go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Going {
    On,
    Stopped,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// What is wrong with the arguments, the input, the device or the output; a finding when an image
    /// is wrong; [`Failure::Interrupted`].
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        if let Some([a, b]) = self.compare.as_deref() {
            return self.ratios([a, b], quiet);
        }
        let Some(folder) = &self.output else { return Ok(()) };
        output::check_folder(folder)?;
        let workloads = self.workloads(quiet)?;
        let (gpu, _) = self.device.open(false)?;
        output::make_folder(folder)?;
        let mut results = Results::begin(folder, quiet)?;
        interrupt::watch();
        let mut draws = 0;
        for workload in &workloads {
            draws += self.draws_of(workload)?;
        }
        let bar = output::progress(draws, "bench");
        let mut going = Going::On;
        for workload in workloads {
            going = self.measure(&gpu, workload, &bar, &mut results)?;
            if going == Going::Stopped {
                break;
            }
        }
        bar.finish_and_clear();
        results.finish(going == Going::Stopped)?;
        if going == Going::Stopped {
            return Err(Failure::Interrupted(format!(
                "stopped; what was measured is in {}",
                folder.display()
            )));
        }
        match results.failed() {
            0 => Ok(()),
            n => Err(Failure::Finding(format!("{n} of {} cases drew a wrong image", results.cases()))),
        }
    }

    fn ratios(&self, [a, b]: [&PathBuf; 2], quiet: bool) -> Outcome {
        if let Some(folder) = &self.output {
            output::check_folder(folder)?;
        }
        let ratios = Ratios::of_files([a, b])?;
        if let Some(folder) = &self.output {
            output::make_folder(folder)?;
            output::write_json(&folder.join("ratios.json"), &ratios.json())?;
        }
        if !quiet || self.output.is_none() {
            output::print(&ratios.text())?;
        }
        Ok(())
    }

    fn workloads(&self, quiet: bool) -> Result<Vec<Workload>> {
        let invalid = |what: &str, why: String| Error::Invalid { what: what.to_string(), why };
        let suite = SUITES.iter().find(|suite| self.suite == Path::new(suite.name));
        let mut workloads: Vec<Workload> = if let Some(suite) = suite {
            if let Some((option, array)) = self.arrays.first() {
                let why = format!("\"{array}\": the scenes of {} have no arrays", suite.name);
                return Err(invalid(&format!("--{option}"), why));
            }
            suite.scenes().map(|scene| Workload::Standard(suite, scene)).collect()
        } else {
            if !self.suite.exists() {
                let names: Vec<&str> = SUITES.iter().map(|suite| suite.name).collect();
                let why = format!(
                    "\"{}\": must be {}, a scene file, a data file or a folder of scene files",
                    self.suite.display(),
                    names.join(", ")
                );
                return Err(invalid("suite", why));
            }
            let scenes = if self.suite.is_dir() { scene_files(&self.suite)? } else { Vec::new() };
            if scenes.is_empty() {
                let input = Input::load(&self.suite, self.size, &self.arrays, quiet)?;
                input::drawn(&input.scene)?;
                vec![Workload::File(Box::new(input))]
            } else {
                found(scenes, &self.suite, suite::STANDARD)
            }
        };
        if let Some(folder) = &self.data {
            workloads.extend(found(files_under(folder)?, folder, suite::DATA));
        }
        let is_wanted =
            |name: &str| self.only.is_empty() || self.only.iter().any(|word| name.contains(word.as_str()));
        workloads.retain(|workload| match workload {
            Workload::Standard(_, scene) => is_wanted(scene.name),
            Workload::Found(_, name, _) => is_wanted(name),
            Workload::File(_) => true,
        });
        if workloads.is_empty() {
            return Err(invalid("--only", format!("\"{}\": is in no scene's name", self.only.join(","))));
        }
        Ok(workloads)
    }

    /// Number of frames of each case.
    fn frames_of(&self, workload: &Workload) -> usize {
        let own = if let Workload::Standard(suite, _) = workload { suite.frames } else { FRAMES };
        self.frames.map_or(own, usize::from)
    }

    /// Most frames that a workload takes.
    fn draws_of(&self, workload: &Workload) -> Result<u64> {
        let cases = match workload {
            Workload::Standard(suite, scene) => {
                let views = scene.views(suite.size)?.len();
                let sizes = if self.size.is_some() { 0 } else { scene.sizes().count() };
                views * suite::settings(suite.sweeps)?.len() + sizes * suite::settings(suite::SIZES)?.len()
            }
            Workload::File(_) => suite::settings(suite::STANDARD)?.len(),
            Workload::Found(_, _, sweeps) => suite::settings(sweeps)?.len(),
        };
        Ok((cases * (self.frames_of(workload) + 1)) as u64)
    }

    /// Name, scene and views of a workload.
    fn open(&self, workload: Workload) -> Result<Opened> {
        let of_file = |name: String, input: Input, sweeps: &'static [Sweep]| {
            let view = input.settings.view;
            let projection = if view.is_perspective() { "perspective" } else { "orthographic" };
            Opened { name, family: None, scene: input.scene, shots: vec![Shot { projection, view, sweeps }] }
        };
        match workload {
            Workload::File(input) => {
                let name = self.suite.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                Ok(of_file(name, *input, suite::STANDARD))
            }
            Workload::Found(path, name, sweeps) => {
                // Scene files say how large their images are; for data of all kinds one size is taken.
                let is_scene = SceneFile::is_at(&path, &ReadOptions::default());
                let size = self.size.or_else(|| (!is_scene).then_some(suite::SIZE));
                let input = Input::load_within(&path, size, &ReadOptions::within(MOST_BYTES))?;
                input::drawn(&input.scene).map_err(|error| error.in_file(&path))?;
                Ok(of_file(name, input, sweeps))
            }
            Workload::Standard(suite, scene) => {
                let shot = |sweeps| move |(projection, view)| Shot { projection, view, sweeps };
                let views = scene.views(self.size.unwrap_or(suite.size))?;
                let mut shots: Vec<Shot> = views.into_iter().map(shot(suite.sweeps)).collect();
                for size in scene.sizes().filter(|_| self.size.is_none()) {
                    shots.extend(scene.views(size)?.into_iter().take(1).map(shot(suite::SIZES)));
                }
                let family = Some(scene.family.to_string());
                Ok(Opened { name: scene.name.to_string(), family, scene: scene.load()?, shots })
            }
        }
    }

    /// Measures every case of a workload, one view after the other.
    fn measure(
        &self,
        gpu: &Gpu,
        workload: Workload,
        bar: &ProgressBar,
        results: &mut Results,
    ) -> Result<Going> {
        let (draws, frames) = (self.draws_of(&workload)?, self.frames_of(&workload));
        let end = bar.position() + draws;
        let is_found = matches!(workload, Workload::Found(..));
        match self.open(workload) {
            Ok(Opened { name, family, scene, shots }) => {
                let scene = GpuScene::new(gpu, scene);
                for Shot { projection, view, sweeps } in shots {
                    let (scene_name, family) = (name.clone(), family.clone());
                    let projection = projection.to_string();
                    let shared = Shared { scene: scene_name, family, projection, view };
                    if self.measure_view(&scene, &shared, sweeps, frames, bar, results)? == Going::Stopped {
                        return Ok(Going::Stopped);
                    }
                }
            }
            // Nobody has asked for just this file.
            Err(error) if is_found => bar.suspend(|| output::complain(&format!("skipped: {error}"))),
            Err(error) => return Err(error),
        }
        bar.set_position(end);
        Ok(Going::On)
    }

    fn measure_view(
        &self,
        scene: &Arc<GpuScene>,
        shared: &Shared,
        sweeps: &[Sweep],
        frames: usize,
        bar: &ProgressBar,
        results: &mut Results,
    ) -> Result<Going> {
        let view = &shared.view;
        bar.set_message(output::plain(&format!("{} {}", shared.scene, shared.projection)));
        let Some(truth) = truth(scene, view, &Cache::of_user(!self.no_cache))? else {
            return Ok(Going::Stopped);
        };
        let mut settings = suite::settings(sweeps)?;
        settings.retain(|setting| setting.is_for(scene.scene()));
        let mut cases: Vec<Case> = settings.into_iter().map(Case::new).collect();
        let mut weighed = Vec::new();
        for case in &mut cases {
            if interrupt::requested() {
                return Ok(Going::Stopped);
            }
            case.check(scene, view, &truth)?;
            let kind = (case.setting.technique.method(), case.setting.route);
            if !weighed.contains(&kind) {
                weighed.push(kind);
                case.weigh(scene, view);
            }
            bar.inc(1);
        }
        let going = time(&mut cases, view, frames, bar)?;
        let required_k = match RequiredK::measure(scene, view) {
            _ if going == Going::Stopped => None,
            Err(error) if is_refusal(&error) => None,
            measured => measured?,
        };
        cases.retain(Case::is_done);
        // After every view, so that a run that is stopped keeps what it has.
        let text = results.add(scene, shared, &cases, required_k.as_ref())?;
        if !results.is_quiet() {
            bar.suspend(|| output::print(&text))?;
        }
        Ok(going)
    }
}

/// Times cases in turn.
fn time(cases: &mut [Case], view: &View, frames: usize, bar: &ProgressBar) -> Result<Going> {
    for round in 0..frames {
        for i in 0..cases.len() {
            if interrupt::requested() {
                return Ok(Going::Stopped);
            }
            let place = if round % 2 == 0 { i } else { cases.len() - 1 - i };
            cases[place].time(view)?;
            bar.inc(1);
        }
    }
    Ok(Going::On)
}

/// The reference of a view; `None` when it is to stop, which long drawing is not waited for.
fn truth(scene: &Arc<GpuScene>, view: &View, cache: &Cache) -> Result<Option<ReferenceImage>> {
    let (send, drawn) = mpsc::channel();
    let (scene, view, cache) = (Arc::clone(scene), *view, cache.clone());
    let drawing = std::thread::spawn(move || {
        let image = cache.image(scene.scene(), &view, None).map(|(image, _)| image);
        // Whoever does not wait has stopped.
        let _ = send.send(image);
    });
    loop {
        match drawn.recv_timeout(Duration::from_millis(50)) {
            Ok(image) => {
                // It has sent, and ends: the scene is nobody else's again.
                let _ = drawing.join();
                return image.map(Some);
            }
            Err(mpsc::RecvTimeoutError::Timeout) if !interrupt::requested() => {}
            Err(mpsc::RecvTimeoutError::Timeout) => return Ok(None),
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                let why = "its thread ended without an image".to_string();
                return Err(Error::Invalid { what: "reference".to_string(), why });
            }
        }
    }
}

fn found(files: Vec<PathBuf>, folder: &Path, sweeps: &'static [Sweep]) -> Vec<Workload> {
    let name = |path: &Path| path.strip_prefix(folder).unwrap_or(path).to_string_lossy().replace('\\', "/");
    files
        .into_iter()
        .map(|path| {
            let name = name(&path);
            Workload::Found(path, name, sweeps)
        })
        .collect()
}

/// The scene files in a folder, sorted.
fn scene_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = |source| Error::Io { path: folder.to_path_buf(), action: "cannot list", source };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_file() && SceneFile::is_at(&path, &ReadOptions::default()) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
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
