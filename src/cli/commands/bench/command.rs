//! Arguments of `bench`, and the order of its work.
//!
//! An image that is wrong has no speed: each case is compared with the reference before it is timed. The frames of a
//! scene's cases are drawn in turn, forwards and backwards, so that warm-up and disturbances affect all cases alike.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use volraster::io::ReadOptions;
use volraster::io::scene_file::SceneFile;
use volraster::reference::ReferenceImage;
use volraster::scene::View;
use volraster::{Error, Gpu, GpuScene, Result};

use super::bounds::Peaks;
use super::case::{Case, elements};
use super::ratios::Ratios;
use super::record::{self, Record, Run, SCHEMA};
use super::required_k::RequiredK;
use super::results::Results;
use super::scenes::{SUITES, Suite};
use super::series::Limits;
use super::sweeps::{self, Sweep};
use super::workload::{Opened, ViewCases, Workload, files_in};
use crate::cli::cache::Cache;
use crate::cli::input::{self, ArraysArgs, DeviceArgs, Input, Size, is_refusal};
use crate::cli::load::Load;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::sensors::Sensors;
use crate::cli::{interrupt, output};

/// Least and most timed frames per case of scenes that belong to no suite.
const FRAMES: [usize; 2] = [9, 45];

/// Time after which a case is not timed further, in milliseconds, once it has its fewest frames.
const ENOUGH_MS: f64 = 4000.0;

/// Minimum number of timed frames of slow cases.
const FEWEST: usize = 5;

/// How long other work is watched before frames are judged by it: Linux counts it in steps of 10 ms.
const WATCH: Duration = Duration::from_millis(300);

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
    #[arg(short, long, value_name = "DIR", required_unless_present_any = ["compare", "schema"])]
    output: Option<PathBuf>,
    /// Also write bench.csv, a row per case.
    #[arg(long)]
    csv: bool,
    /// Print the JSON Schema of a line of bench.jsonl, and measure nothing.
    #[arg(long, exclusive = true)]
    schema: bool,
    /// Compare two earlier runs instead of measuring: print the ratio of medians, with its 95 % confidence interval, for
    /// every case that both runs timed. With --output, write ratios.json there.
    #[arg(long, num_args = 2, value_names = ["A.jsonl", "B.jsonl"], conflicts_with_all = ["suite", "array", "data", "only", "frames", "size", "device", "no_cache", "csv"])]
    compare: Option<Vec<PathBuf>>,
    /// With --compare: exit with 5 if an image has changed, else with 4 if a case is slower by more than this and beyond noise.
    #[arg(long, value_name = "PERCENT", requires = "compare", value_parser = per_cent)]
    fail_above: Option<f64>,
    /// Measure only scenes of a suite or folder whose names contain one of these texts.
    #[arg(long, value_name = "TEXT,...", value_delimiter = ',')]
    only: Vec<String>,
    /// Also measure every data file and scene file under this folder, with few cases each. Files that cannot be read, and
    /// volumes above 512 MiB, are skipped with a line on stderr.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Timed frames per case, after one warm-up frame; slow cases get fewer. Without it each case is timed from when its times have
    /// settled until its median is known within 1 %, within the limits of the suite.
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
        if self.schema {
            return Ok(output::print(&record::schema())?);
        }
        let Some(folder) = &self.output else { return Ok(()) };
        output::check_folder(folder)?;
        let workloads = self.workloads(quiet)?;
        let (gpu, _) = self.device.open(false)?;
        output::make_folder(folder)?;
        let peaks = Peaks::measure(&gpu)?;
        let mut results = Results::begin(folder, peaks)?;
        let run = Run::now(gpu.report());
        interrupt::watch();
        let cases = |workload: &Workload| Ok(2 * workload.case_count(self.size)? as u64);
        let bar = output::progress(workloads.iter().map(cases).sum::<Result<u64>>()?, "bench");
        for workload in workloads.into_iter().take_while(|_| !interrupt::requested()) {
            self.measure(&gpu, &run, workload, &bar, &mut results, quiet)?;
        }
        bar.finish_and_clear();
        let is_stopped = interrupt::requested();
        results.finish(is_stopped, self.csv)?;
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
        let Some(limit) = self.fail_above else { return Ok(()) };
        let [changed, slower] = [ratios.changed(), ratios.slower(limit)];
        let count = |names: &[String]| {
            if names.len() == 1 { "1 case".to_string() } else { format!("{} cases", names.len()) }
        };
        if let Some(first) = changed.first() {
            return Err(Failure::Changed(format!(
                "the image of {} has changed, the first {first}",
                count(&changed)
            )));
        }
        match slower.first() {
            Some(first) => {
                let text =
                    format!("{} slower by more than {} %, the first {first}", count(&slower), 100.0 * limit);
                Err(Failure::Slower(text))
            }
            None => Ok(()),
        }
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

    /// Returns how many frames are timed per case.
    fn limits(&self, workload: &Workload) -> Limits {
        let own = if let Workload::Standard(suite, _) = workload { suite.frames } else { FRAMES };
        let [fewest, most] = self.frames.map_or(own, |frames| [frames.into(); 2]);
        let adapts = self.frames.is_none() && most > fewest;
        Limits { fewest: fewest.min(if adapts { most } else { FEWEST }), most, enough_ms: ENOUGH_MS, adapts }
    }

    /// Measures every case of a workload, one view after the other.
    fn measure(
        &self,
        gpu: &Gpu,
        run: &Run,
        workload: Workload,
        bar: &ProgressBar,
        results: &mut Results,
        quiet: bool,
    ) -> Result<()> {
        let limits = self.limits(&workload);
        let end = bar.position() + 2 * workload.case_count(self.size)? as u64;
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
                schema: SCHEMA,
                run: run.clone(),
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
                self.measure_view(&scene, &view, &record, sweeps, limits, bar)?
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
        limits: Limits,
        bar: &ProgressBar,
    ) -> Result<Option<(Vec<Record>, Option<RequiredK>)>> {
        let Some(truth) = truth(scene, view, &Cache::of_user(!self.no_cache))? else { return Ok(None) };
        let mut settings = sweeps::settings(sweeps)?;
        settings.retain(|setting| setting.is_for(scene.scene()));
        let mut cases: Vec<Case> =
            settings.into_iter().map(|setting| Case::new(setting, record, self.in_flight, limits)).collect();
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
        time(&mut cases, view, scene.gpu(), bar)?;
        let required_k = match RequiredK::measure(scene, view) {
            _ if interrupt::requested() => None,
            Err(error) if is_refusal(&error) => None,
            measured => measured?,
        };
        cases.retain(Case::is_done);
        Ok(Some((cases.into_iter().map(|case| case.finish(required_k.as_ref())).collect(), required_k)))
    }
}

/// Times cases in rounds of one frame each, in alternating directions, until each has enough frames or the user requests a stop.
fn time(cases: &mut [Case], view: &View, gpu: &Gpu, bar: &ProgressBar) -> Result<()> {
    let mut watch = Watch::begin(gpu);
    let mut open: Vec<usize> = (0..cases.len()).collect();
    while !open.is_empty() {
        for &place in &open {
            if interrupt::requested() {
                return Ok(());
            }
            if let Some(frame) = cases[place].time(view)? {
                watch.frame(cases, place, frame);
            }
        }
        let before = open.len();
        let wanting =
            |cases: &[Case]| open.iter().copied().filter(|&place| cases[place].wants_more()).collect();
        let mut next: Vec<usize> = wanting(cases);
        if next.is_empty() {
            // The last frames may have to be repeated.
            watch.judge(cases);
            next = wanting(cases);
        }
        open = next;
        open.reverse();
        bar.inc((before - open.len()) as u64);
    }
    Ok(())
}

/// Watches what disturbs frames: other programs' work on the processors of a software device, and a device that holds its clock down.
struct Watch {
    is_software: bool,
    sensors: Option<Sensors>,
    load: Option<Load>,
    since: Instant,
    /// The frames since, each with its case.
    frames: Vec<(usize, usize)>,
}

impl Watch {
    fn begin(gpu: &Gpu) -> Self {
        Self {
            is_software: gpu.is_software(),
            sensors: Sensors::of(gpu.report()),
            load: Load::watch(),
            since: Instant::now(),
            frames: Vec::new(),
        }
    }

    /// Notes a frame that a case has drawn, and judges it with those before once they have taken long enough.
    fn frame(&mut self, cases: &mut [Case], case: usize, frame: usize) {
        self.frames.push((case, frame));
        if self.since.elapsed() >= WATCH {
            self.judge(cases);
        }
    }

    /// Judges the frames since the last judgement.
    fn judge(&mut self, cases: &mut [Case]) {
        let reading = self.sensors.as_ref().map(Sensors::read);
        let throttled = reading.as_ref().and_then(|reading| reading.throttled.as_ref());
        let throttled = throttled.map(|why| format!("the device was throttled: {why}"));
        let loaded = self.load.as_ref().and_then(Load::note).filter(|_| self.is_software);
        let why = throttled.or(loaded);
        for (case, frame) in self.frames.drain(..) {
            if let Some(why) = &why {
                cases[case].disturb(frame, why);
            }
            if let Some(reading) = &reading {
                cases[case].sensed(reading.clone());
            }
        }
        self.load = Load::watch();
        self.since = Instant::now();
    }
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

/// Parses a percentage, with or without its sign; returns the fraction.
fn per_cent(text: &str) -> std::result::Result<f64, String> {
    let number = text.trim_end().trim_end_matches('%').trim_end().parse::<f64>().ok();
    let number = number.filter(|number| (0.0..=1000.0).contains(number));
    number.map(|number| number / 100.0).ok_or_else(|| "must be a percentage from 0 to 1000".to_string())
}

fn invalid(what: &str, why: String) -> Error {
    Error::Invalid { what: what.to_string(), why }
}
