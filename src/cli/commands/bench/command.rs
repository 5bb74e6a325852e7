//! Arguments of `bench`, and the order of its work.
//!
//! An image that is wrong has no speed: each case is compared with the reference before it is timed. The frames of a
//! scene's cases are drawn in turn, forwards and backwards, so that warm-up and disturbances affect all cases alike.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use indicatif::ProgressBar;
use volraster::io::ReadOptions;
use volraster::io::scene_file::SceneFile;
use volraster::reference::ReferenceImage;
use volraster::scene::View;
use volraster::{Error, Gpu, GpuScene, Result};

use super::case::{Case, elements};
use super::ratios::Ratios;
use super::record::Record;
use super::required_k::RequiredK;
use super::results::Results;
use super::scenes::{SUITES, Suite};
use super::sweeps::{self, Sweep};
use super::workload::{Opened, ViewCases, Workload, files_in};
use crate::cli::cache::Cache;
use crate::cli::input::{self, ArraysArgs, DeviceArgs, Input, Size, is_refusal};
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::{interrupt, output};

/// Timed frames per case of scenes that belong to no suite.
const FRAMES: usize = 9;

/// Arguments of `bench`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The suite `smoke` (a little of everything, in less than a minute), `standard` (the scenes of the published
    /// figures), `gaussians` (trained splats by every rule), `peers` (the fastest settings, on scenes that other renderers were timed on) or `full` (more scenes, views
    /// and frames); or a scene file, a data file, or a folder of scene files.
    #[arg(value_name = "SUITE", default_value = "standard")]
    suite: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    /// Folder for the results: bench.jsonl (one line of JSON per case), fronts.json (times at equal error), table.md, and
    /// plots as SVG.
    #[arg(short, long, value_name = "DIR", required_unless_present = "compare")]
    output: Option<PathBuf>,
    /// Compare two earlier runs instead of measuring: print the ratio of medians, with its 95 % confidence interval, for
    /// every case that both runs timed. With --output, write ratios.json there.
    #[arg(long, num_args = 2, value_names = ["A.jsonl", "B.jsonl"], conflicts_with_all = ["suite", "array", "data", "only", "frames", "size", "device", "no_cache"])]
    compare: Option<Vec<PathBuf>>,
    /// Measure only scenes of a suite or folder whose names contain one of these texts.
    #[arg(long, value_name = "TEXT,...", value_delimiter = ',')]
    only: Vec<String>,
    /// Also measure every data file and scene file under this folder, with few cases each. Files that cannot be read, and
    /// volumes above 512 MiB, are skipped with a line on stderr.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Timed frames per case, after one warm-up frame [default: that of the suite, else 9]. Slow cases get fewer.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    frames: Option<u16>,
    /// Frames in flight: with 2 the host records one while the device draws the other, and the time of a frame is the mean of four.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    in_flight: u8,
    /// Image size [default: that of the scene file, else of the suite, else 512x512].
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    /// Draw reference images anew, and cache none.
    #[arg(long)]
    no_cache: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// An error in the arguments, the input, the device or the output; [`Failure::Finding`] when an image is wrong;
    /// [`Failure::Interrupted`] after Ctrl-C.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        if let Some([a, b]) = self.compare.as_deref() {
            return self.ratios([a, b], quiet);
        }
        let Some(folder) = &self.output else { return Ok(()) };
        output::check_folder(folder)?;
        let workloads = self.workloads(quiet)?;
        let (gpu, _) = self.device.open(false)?;
        output::make_folder(folder)?;
        let mut results = Results::begin(folder)?;
        interrupt::watch();
        let draws = |workload| Ok(self.frames_of(workload)?.1);
        let draws = workloads.iter().map(draws).sum::<Result<u64>>()?;
        let bar = output::progress(draws, "bench");
        for workload in workloads.into_iter().take_while(|_| !interrupt::requested()) {
            self.measure(&gpu, workload, &bar, &mut results, quiet)?;
        }
        bar.finish_and_clear();
        let is_stopped = interrupt::requested();
        results.finish(is_stopped)?;
        if is_stopped {
            let text = format!("stopped; partial results are in {}", folder.display());
            return Err(Failure::Interrupted(text));
        }
        match results.records.iter().filter(|record| record.failed.is_some()).count() {
            0 => Ok(()),
            n => {
                let cases = results.records.len();
                Err(Failure::Finding(format!("{n} of {cases} cases drew a wrong image")))
            }
        }
    }

    /// Compares two runs.
    fn ratios(&self, [a, b]: [&PathBuf; 2], quiet: bool) -> Outcome {
        if let Some(folder) = &self.output {
            output::check_folder(folder)?;
        }
        let runs = [Record::read(a)?, Record::read(b)?];
        let ratios = Ratios::new(runs.each_ref().map(Vec::as_slice));
        if ratios.pairs.is_empty() {
            let why = format!("{} and {} have no timed case in common", a.display(), b.display());
            return Err(invalid("compare", why).into());
        }
        if let Some(folder) = &self.output {
            output::make_folder(folder)?;
            output::write_json(&folder.join("ratios.json"), &ratios.json())?;
        }
        if !quiet || self.output.is_none() {
            output::print(&ratios.text())?;
        }
        Ok(())
    }

    /// Lists the scenes to measure.
    fn workloads(&self, quiet: bool) -> Result<Vec<Workload>> {
        let mut workloads = self.suite_workloads(quiet)?;
        if let Some(folder) = &self.data {
            let sweeps = self.known_suite().map_or(sweeps::DATA, |suite| suite.data);
            workloads.extend(Workload::of_files(files_in(folder, true)?, folder, sweeps));
        }
        workloads.retain(|workload| {
            let is_named = |text: &String| workload.name().contains(text.as_str());
            self.only.is_empty() || matches!(workload, Workload::File(..)) || self.only.iter().any(is_named)
        });
        if workloads.is_empty() {
            return Err(invalid("--only", format!("\"{}\": is in no scene's name", self.only.join(","))));
        }
        Ok(workloads)
    }

    /// Returns the suite that the argument SUITE names.
    fn known_suite(&self) -> Option<&'static Suite> {
        SUITES.iter().find(|suite| self.suite == Path::new(suite.name))
    }

    /// Lists the scenes of the argument SUITE.
    fn suite_workloads(&self, quiet: bool) -> Result<Vec<Workload>> {
        if let Some(suite) = self.known_suite() {
            if let Some((option, array)) = self.arrays.given().next() {
                let why = format!("\"{array}\": the scenes of {} come from no file", suite.name);
                return Err(invalid(&format!("--{option}"), why));
            }
            return Ok(suite.scenes().map(|scene| Workload::Standard(suite, scene)).collect());
        }
        if !self.suite.exists() {
            let names: Vec<&str> = SUITES.iter().map(|suite| suite.name).collect();
            let why = format!(
                "\"{}\": must be {}, a scene file, a data file or a folder of scene files",
                self.suite.display(),
                names.join(", ")
            );
            return Err(invalid("suite", why));
        }
        let mut scenes = if self.suite.is_dir() { files_in(&self.suite, false)? } else { Vec::new() };
        scenes.retain(|path| SceneFile::is_at(path, &ReadOptions::default()));
        if !scenes.is_empty() {
            return Ok(Workload::of_files(scenes, &self.suite, sweeps::STANDARD).collect());
        }
        let input = Input::load(&self.suite, self.size, &self.arrays, quiet)?;
        input::drawn(&input.scene)?;
        let name = self.suite.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(vec![Workload::File(name, Box::new(input))])
    }

    /// Returns the number of timed frames per case, and an upper bound of the frames that the workload draws.
    fn frames_of(&self, workload: &Workload) -> Result<(usize, u64)> {
        let own = if let Workload::Standard(suite, _) = workload { suite.frames } else { FRAMES };
        let frames = self.frames.map_or(own, usize::from);
        Ok((frames, (workload.case_count(self.size)? * (frames + 1)) as u64))
    }

    /// Measures every case of a workload, one view after the other.
    fn measure(
        &self,
        gpu: &Gpu,
        workload: Workload,
        bar: &ProgressBar,
        results: &mut Results,
        quiet: bool,
    ) -> Result<()> {
        let (frames, draws) = self.frames_of(&workload)?;
        let end = bar.position() + draws;
        let is_found = matches!(workload, Workload::Found(..));
        let Opened { name, family, scene, views } = match workload.open(self.size) {
            // The user named the folder, not this file: skip it.
            Err(error) if is_found => {
                bar.suspend(|| output::complain(&format!("skipped: {error}")));
                bar.set_position(end);
                return Ok(());
            }
            opened => opened?,
        };
        let scene = GpuScene::new(gpu, scene);
        for ViewCases { projection, view, sweeps } in
            views.into_iter().take_while(|_| !interrupt::requested())
        {
            let device = gpu.report();
            let record = Record {
                version: env!("CARGO_PKG_VERSION").to_string(),
                device: device.name.clone(),
                driver: device.driver.clone(),
                api: device.api.clone(),
                software: gpu.is_software(),
                scene: name.clone(),
                family: family.clone(),
                projection: projection.to_string(),
                size: view.extent(),
                data: scene.scene().data.kind().to_string(),
                elements: elements(&scene.scene().data),
                ..Record::default()
            };
            bar.set_message(output::plain(&format!("{name} {projection}")));
            let Some((records, required_k)) =
                self.measure_view(&scene, &view, &record, sweeps, frames, bar)?
            else {
                return Ok(());
            };
            // Written after every view, so that an interrupted run keeps its results so far.
            let text = results.add(&record, records, required_k.as_ref())?;
            if !quiet {
                bar.suspend(|| output::print(&text))?;
            }
        }
        bar.set_position(end);
        Ok(())
    }

    /// Checks, then times every case of a view; `None` if the run is stopped before all are checked. `record` has what
    /// the cases share.
    fn measure_view(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        record: &Record,
        sweeps: &[Sweep],
        frames: usize,
        bar: &ProgressBar,
    ) -> Result<Option<(Vec<Record>, Option<RequiredK>)>> {
        let Some(truth) = truth(scene, view, &Cache::of_user(!self.no_cache))? else { return Ok(None) };
        let mut settings = sweeps::settings(sweeps)?;
        settings.retain(|setting| setting.is_for(scene.scene()));
        let mut cases: Vec<Case> =
            settings.into_iter().map(|setting| Case::new(setting, record, self.in_flight)).collect();
        let mut weighed = Vec::new();
        for case in &mut cases {
            if interrupt::requested() {
                return Ok(None);
            }
            case.check(scene, view, &truth)?;
            if !weighed.contains(&case.kind()) {
                weighed.push(case.kind());
                case.measure_memory(scene, view);
            }
            case.count(scene, view)?;
            bar.inc(1);
        }
        time(&mut cases, view, frames, bar)?;
        let required_k = match RequiredK::measure(scene, view) {
            _ if interrupt::requested() => None,
            Err(error) if is_refusal(&error) => None,
            measured => measured?,
        };
        cases.retain(Case::is_done);
        Ok(Some((cases.into_iter().map(|case| case.finish(required_k.as_ref())).collect(), required_k)))
    }
}

/// Times cases in rounds of one frame each, in alternating directions, until the user requests a stop.
fn time(cases: &mut [Case], view: &View, frames: usize, bar: &ProgressBar) -> Result<()> {
    for round in 0..frames {
        for i in 0..cases.len() {
            if interrupt::requested() {
                return Ok(());
            }
            let place = if round % 2 == 0 { i } else { cases.len() - 1 - i };
            cases[place].time(view)?;
            bar.inc(1);
        }
    }
    Ok(())
}

/// Returns the reference image of a view, drawn on a thread of its own; `None` as soon as the user requests a stop.
fn truth(scene: &Arc<GpuScene>, view: &View, cache: &Cache) -> Result<Option<ReferenceImage>> {
    let (scene, view, cache) = (Arc::clone(scene), *view, cache.clone());
    let drawing = std::thread::spawn(move || cache.image(scene.scene(), &view, None).map(|(image, _)| image));
    while !drawing.is_finished() {
        if interrupt::requested() {
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    let ended = |_| invalid("reference", "its thread ended without an image".to_string());
    drawing.join().map_err(ended)?.map(Some)
}

fn invalid(what: &str, why: String) -> Error {
    Error::Invalid { what: what.to_string(), why }
}
