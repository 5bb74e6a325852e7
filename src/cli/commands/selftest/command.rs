//! Arguments of `selftest`, its run and its report.

use std::path::PathBuf;
use std::time::Instant;

use indicatif::ProgressBar;
use serde_json::{Value, json};
use volraster::gpu::{DeviceReport, Provocation, Validation};
use volraster::technique::Method;
use volraster::{Error, Result};

use super::allow::{Allowed, id_of};
use super::case::Case;
use super::cases;
use super::controls::Controls;
use super::verdict::{Done, Status};
use super::workbench::{Stop, Workbench};
use crate::cli::input::DeviceArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;

/// Arguments of `selftest`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Write a report as JSON.
    #[arg(short, long, value_name = "REPORT.json")]
    output: Option<PathBuf>,
    /// Run only cases whose names contain TEXT; may be repeated. The checks of validation itself always run.
    #[arg(long, value_name = "TEXT")]
    filter: Vec<String>,
    /// Run only cases of these techniques, separated by commas.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    technique: Vec<String>,
    /// Let every Vulkan call of a session fail once, instead of a few calls of each function. Takes about an hour.
    #[arg(long)]
    every_call: bool,
    /// List the cases without running them.
    #[arg(long)]
    list: bool,
    /// Run without the validation layer; its checks are reported as skipped.
    #[arg(long)]
    without_validation: bool,
    #[command(flatten)]
    device: DeviceArgs,
    /// Cause a validation error in the cases whose names contain TEXT, to test this command.
    #[arg(long, value_name = "TEXT", hide = true)]
    provoke: Option<String>,
}

/// A finished run, for the report.
struct Run<'a> {
    device: &'a DeviceReport,
    layer: Option<&'a str>,
    /// Whether no case was filtered out.
    whole: bool,
    done: &'a [Done],
    allowed: &'a Allowed,
    /// Allowed messages that never appeared.
    unused: &'a [&'a str],
    seconds: f64,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// An error in the arguments, the device or the output; [`Failure::Finding`] when a case fails.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        if let Some(path) = &self.output {
            output::check_file(path)?;
        }
        let methods =
            self.technique.iter().map(|name| Method::from_name(name)).collect::<Result<Vec<_>>>()?;
        let wanted = |case: &Case| {
            let named = self.filter.is_empty() || self.filter.iter().any(|text| case.name.contains(text));
            named && (methods.is_empty() || case.method.is_some_and(|method| methods.contains(&method)))
        };
        let all = cases::all(self.every_call)?;
        let whole = all.iter().all(wanted);
        let cases: Vec<Case> = all.into_iter().filter(wanted).collect();
        if cases.is_empty() {
            let why = "no case matches this name and technique; --list prints all cases".to_string();
            return Err(Error::Invalid { what: "filter".to_string(), why }.into());
        }
        if self.list {
            for case in &cases {
                output::print(&case.name)?;
            }
            return Ok(());
        }
        self.test(&cases, whole, quiet)
    }

    /// Checks validation itself, runs the cases, and reports.
    fn test(&self, cases: &[Case], whole: bool, quiet: bool) -> Outcome {
        let start = Instant::now();
        let device = self.device.device.clone();
        // Fails here if there is no device.
        let report = self.device.open(false)?.0.report().clone();
        let controls =
            if self.without_validation { Controls::skipped() } else { Controls::run(device.as_deref()) };
        let allowed = Allowed::of_crate()?;
        let bar = output::progress(u64::try_from(cases.len()).unwrap_or(0), "selftest");
        if !quiet {
            let layer = controls.layer.as_deref().unwrap_or("none");
            let (name, driver, api) = (&report.name, &report.driver, &report.api);
            output::print(&format!("device: {name}, {driver}, Vulkan {api}; layer: {layer}"))?;
            output::print(&format!("validation: {}", controls.line()))?;
        }
        let workbench = Workbench::new(device, controls.validation);
        let mut done = controls.cases;
        for control in &done {
            print_result(control, &bar, quiet)?;
        }
        for case in cases {
            let result = self.run_case(&workbench, case, &allowed);
            bar.inc(1);
            print_result(&result, &bar, quiet)?;
            done.push(result);
        }
        // Leaks are reported when the device is destroyed.
        let end = Case::new("end of the device", None, |workbench| {
            workbench.end();
            Ok("nothing is left".to_string())
        })?;
        let end = self.run_case(&workbench, &end, &allowed);
        bar.finish_and_clear();
        print_result(&end, &bar, quiet)?;
        done.push(end);
        let is_complete = whole && controls.validation == Validation::Full;
        let run = Run {
            device: &report,
            layer: controls.layer.as_deref(),
            whole,
            done: &done,
            allowed: &allowed,
            unused: &if is_complete { allowed.unused() } else { Vec::new() },
            seconds: start.elapsed().as_secs_f64(),
        };
        self.conclude(&run, quiet)
    }

    /// Writes the report, prints the counts, and fails if a case failed.
    fn conclude(&self, run: &Run<'_>, quiet: bool) -> Outcome {
        let count = |status: Status| run.done.iter().filter(|case| case.status == status).count();
        let [passed, failed, skipped] = [Status::Ok, Status::Fail, Status::Skip].map(count);
        if let Some(path) = &self.output {
            let control = |case: &Done| {
                let kind = case.name.strip_prefix("validation/")?;
                Some((kind.to_string(), json!(case.status == Status::Ok)))
            };
            let mut controls: Vec<(String, Value)> = run.done.iter().filter_map(control).collect();
            controls.sort_by(|a, b| a.0.cmp(&b.0));
            let json = json!({
                "schema": "volraster-selftest/1",
                "volraster": env!("CARGO_PKG_VERSION"),
                "device": run.device,
                "layer": run.layer,
                "validation": Value::Object(controls.into_iter().collect()),
                "whole": run.whole,
                "every_call": self.every_call,
                "cases": run.done.iter().map(Done::json).collect::<Value>(),
                "allowed": run.allowed.json(),
                "unused": run.unused,
                "passed": passed,
                "failed": failed,
                "skipped": skipped,
                "seconds": run.seconds,
            });
            output::write_json(path, &json)?;
        }
        if !quiet {
            for id in run.unused {
                output::print(&format!("note: the allowed message {id} never appeared"))?;
            }
            let seconds = run.seconds;
            output::print(&format!("{passed} ok, {failed} failed, {skipped} skipped in {seconds:.1} s"))?;
        }
        match failed {
            0 => Ok(()),
            failed => Err(Failure::Finding(format!("selftest: {failed} of {} cases failed", run.done.len()))),
        }
    }

    /// Runs a case, and fails it if the layer gave messages that are not allowed.
    fn run_case(&self, workbench: &Workbench, case: &Case, allowed: &Allowed) -> Done {
        let start = Instant::now();
        let mut verdict = (case.run)(workbench);
        if self.provoke.as_ref().is_some_and(|text| case.name.contains(text)) {
            let provoked = workbench.gpu().and_then(|gpu| gpu.provoke(Provocation::Core));
            verdict = provoked.map_err(Stop::from).and(verdict);
        }
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let (known, messages): (Vec<String>, Vec<String>) =
            workbench.log.take().into_iter().partition(|message| allowed.allows(&case.name, message));
        let (mut status, mut detail) = match verdict {
            Ok(detail) => (Status::Ok, detail),
            Err(Stop::Skip(reason)) => (Status::Skip, reason),
            Err(Stop::Fail(reason)) => (Status::Fail, reason),
        };
        if let Some(first) = messages.first() {
            if status != Status::Fail {
                detail = format!("{} validation messages, the first {}", messages.len(), id_of(first));
            }
            status = Status::Fail;
        }
        Done { name: case.name.clone(), status, ms, detail, messages, allowed: known.len() }
    }
}

/// Prints the line of a case and one message of each id; the report has all messages. Quiet runs print failures only.
fn print_result(done: &Done, bar: &ProgressBar, quiet: bool) -> Result<()> {
    if quiet && done.status != Status::Fail {
        return Ok(());
    }
    bar.suspend(|| output::print(&done.line()))?;
    for (i, message) in done.messages.iter().enumerate() {
        if done.messages[..i].iter().all(|other| id_of(other) != id_of(message)) {
            bar.suspend(|| output::print(&format!("     {}", output::plain(message))))?;
        }
    }
    Ok(())
}
