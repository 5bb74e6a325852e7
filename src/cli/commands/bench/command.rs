//! Arguments of `bench`.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use volraster::io::ReadOptions;
use volraster::io::scene_file::SceneFile;
use volraster::{Gpu, Result};

use super::bounds::Peaks;
use super::ratios::Ratios;
use super::record::{self, Record, Run};
use super::results::Results;
use super::scenes::{SUITES, StandardScene, Suite};
use super::series::Limits;
use super::session::Session;
use super::sizes::{self, Pace, Sizes};
use super::sweeps::{self, Given};
use super::workload::{Workload, files_in};
use crate::cli::cache::Cache;
use crate::cli::input::{self, ArraysArgs, DeviceArgs, Input, Size};
use crate::cli::numbers::counted;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::{interrupt, output};

/// Arguments of `bench`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The suite `smoke` (a little of everything, in a minute), `standard` (the scenes of the published figures, in an hour),
    /// `gaussians` (trained splats by every rule, in half an hour), `peers` (the fastest settings, on scenes that other renderers were
    /// timed on, in a quarter of an hour) or `full` (more scenes, views and frames, in four hours); or a scene file, a data file, or a
    /// folder of scene files.
    #[arg(value_name = "SUITE", default_value = "standard")]
    suite: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    /// Folder for the results: bench.jsonl (one line of JSON per case), report.html, table.md, fronts.json (times at equal error),
    /// peaks.json (the most that the device does), and plots as SVG; with --compare ratios.json.
    #[arg(short, long, value_name = "DIR", required_unless_present_any = ["compare", "schema"])]
    output: Option<PathBuf>,
    /// Also write bench.csv, a row per case.
    #[arg(long)]
    csv: bool,
    /// Print the JSON Schema of a line of bench.jsonl, and measure nothing.
    #[arg(long, exclusive = true)]
    schema: bool,
    /// Compare two earlier runs instead of measuring: print the ratio of 5th percentiles of times, with its 95 % confidence interval, for
    /// every case that both runs timed. With --output, write ratios.json there.
    #[arg(long, num_args = 2, value_names = ["A.jsonl", "B.jsonl"], conflicts_with_all = ["suite", "array", "data", "only", "techniques", "frames", "size", "within", "device", "no_cache", "csv"])]
    compare: Option<Vec<PathBuf>>,
    /// With --compare: exit with 5 if an image has changed, else with 4 if a case is slower by more than this and beyond noise, or the
    /// device as a whole.
    #[arg(long, value_name = "PERCENT", requires = "compare", value_parser = per_cent)]
    fail_above: Option<f64>,
    /// Measure only scenes whose names contain one of these texts.
    #[arg(long, value_name = "TEXT,...", value_delimiter = ',')]
    only: Vec<String>,
    /// Measure these techniques with options in place of those of the suite; separated by `;` or `,`, may be repeated. `all`: every
    /// technique by every route.
    #[arg(long, value_name = "all|NAME[:key=value,...];...")]
    techniques: Vec<String>,
    /// Also measure every data file and scene file under this folder, with few cases each. Files that cannot be read, and
    /// volumes above 512 MiB, are skipped with a line on stderr.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Timed frames per case, after one warm-up frame; slow cases get fewer. Without it each case is timed from when its times have
    /// settled until its median is known within 1 %, within the limits of the suite.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    frames: Option<u16>,
    /// Time within which the suite ends, such as 10min [default: that of the suite].
    #[arg(long, value_name = "TIME", conflicts_with = "size", value_parser = humantime::parse_duration)]
    within: Option<Duration>,
    /// Frames in flight: with 2 the host records one while the device draws the other, and the time of a frame is the mean of four.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    in_flight: u8,
    /// Image size [default: that of the scene file, else of the suite, else 512x512]. A suite's images are smaller on a device on
    /// which it would not end within its time.
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
        let begin = Instant::now();
        output::check_folder(folder)?;
        let given = Given::parse(&self.techniques)?;
        let workloads = self.workloads(quiet)?;
        let (gpu, _) = self.device.open_with(false, |options| self.arrays.limit(options))?;
        output::make_folder(folder)?;
        let results = Results::begin(folder, Peaks::measure(&gpu)?)?;
        interrupt::watch();
        let sizes = self.sizes(&gpu, &workloads, &given, begin)?;
        let session = Session {
            given,
            frames: self.frames.map(usize::from),
            in_flight: self.in_flight,
            cache: Cache::of_user(!self.no_cache),
            run: Run::now(gpu.report()),
            gpu,
            quiet,
        };
        let results = session.measure(workloads, sizes, results)?;
        let is_stopped = interrupt::requested();
        results.finish(is_stopped, self.csv)?;
        if is_stopped {
            let text = format!("stopped; partial results are in {}", folder.display());
            return Err(Failure::Interrupted(text));
        }
        if results.records.is_empty() && !self.techniques.is_empty() {
            let why = format!("\"{}\": draws none of the scenes", self.techniques.join(";"));
            return Err(output::invalid("--techniques", why).into());
        }
        match results.records.iter().filter(|record| record.failed.is_some()).count() {
            0 => Ok(()),
            n => {
                let cases = counted(results.records.len(), "case");
                Err(Failure::Finding(format!("{n} of {cases} drew a wrong image")))
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
            return Err(output::invalid("compare", why).into());
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
        let count = |names: &[String]| counted(names.len(), "case");
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
            None if ratios.drift() > 1.0 + limit => Err(Failure::Slower(format!(
                "the device as a whole is slower: fixed work beside the cases takes {:.2} times as long, and hides what cases do",
                ratios.drift()
            ))),
            None => Ok(()),
        }
    }

    /// Returns the sizes of images, and how the time of a suite is shared. A suite that does not end within its time has smaller images.
    fn sizes(
        &self,
        gpu: &Gpu,
        workloads: &[Workload],
        given: &Given,
        begin: Instant,
    ) -> Result<(Sizes, Option<Pace>)> {
        let Some(suite) = self.known_suite() else {
            let all = self.size.map_or(Sizes::OWN, Sizes::All);
            let why = format!("\"{}\" is no suite, and has no time", self.suite.display());
            return if self.within.is_some() {
                Err(output::invalid("--within", why))
            } else {
                Ok((all, None))
            };
        };
        if let Some(size) = self.size {
            return Ok((Sizes::All(size), None));
        }
        let scenes: Vec<&StandardScene> = workloads.iter().filter_map(Workload::standard).collect();
        let limits = Limits::of(Some(suite), self.frames.map(usize::from));
        let within = self.within.unwrap_or(Duration::from_secs(60 * suite.minutes));
        let (pace, eighths) = Pace::of(gpu, suite, &scenes, given, &limits, begin + within)?;
        let sizes = Sizes::Eighths(eighths.unwrap_or(sizes::LEAST));
        let [own, chosen] = [Sizes::OWN, sizes].map(|sizes| sizes.of(suite.size));
        let (name, within) = (suite.name, humantime::format_duration(within));
        if eighths.is_none() {
            output::complain(&format!("{name} may take longer than {within}, with images of {chosen} too"));
        } else if chosen != own {
            output::complain(&format!(
                "images of {chosen}, not {own}: {name} is to end within {within} (--within TIME, --size WxH)"
            ));
        }
        Ok((sizes, Some(pace)))
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
            self.only.is_empty() || self.only.iter().any(is_named)
        });
        if workloads.is_empty() {
            return Err(output::invalid(
                "--only",
                format!("\"{}\": is in no scene's name", self.only.join(",")),
            ));
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
                return Err(output::invalid(&format!("--{option}"), why));
            }
            return Ok(suite.scenes().map(|scene| Workload::Standard(suite, scene)).collect());
        }
        if !self.suite.exists() {
            let names: Vec<&str> = SUITES.iter().map(|suite| suite.name).collect();
            let why = format!(
                "\"{}\": is no suite, and no such file is there: must be {}, a scene file, a data file or a folder of scene files",
                self.suite.display(),
                names.join(", ")
            );
            return Err(output::invalid("suite", why));
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
}

/// Parses a percentage, with or without its sign; returns the fraction.
fn per_cent(text: &str) -> std::result::Result<f64, String> {
    let number = text.trim_end().trim_end_matches('%').trim_end().parse::<f64>().ok();
    let number = number.filter(|number| (0.0..=1000.0).contains(number));
    number.map(|number| number / 100.0).ok_or_else(|| "must be a percentage from 0 to 1000".to_string())
}
