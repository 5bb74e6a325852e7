//! Arguments of `selftest`, its run and its report.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use indicatif::ProgressBar;
use serde::Serialize;
use serde_json::json;
use volraster::gpu::{DeviceReport, Provocation, Validation};
use volraster::technique::Method;
use volraster::{Error, Result};

use super::allow::{Allowed, id_of};
use super::cases::{self, Case, Done, Status};
use super::controls::Controls;
use super::session::Place;
use super::sweeps;
use super::workbench::{Stop, Workbench};
use crate::cli::input::DeviceArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::cli::timing::milliseconds_since;

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
    /// Run only this sweep of failures, in this process. The command starts itself so.
    #[arg(long, value_name = "NAME", hide = true)]
    sweep: Option<String>,
}

/// The report as JSON.
#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    volraster: &'static str,
    device: &'a DeviceReport,
    layer: Option<&'a str>,
    /// Whether each kind of validation works.
    validation: BTreeMap<&'static str, bool>,
    /// Whether no case was filtered out.
    whole: bool,
    every_call: bool,
    cases: &'a [Done],
    allowed: &'a Allowed,
    /// Allowed messages that never appeared.
    unused: Vec<&'a str>,
    passed: usize,
    failed: usize,
    skipped: usize,
    seconds: f64,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// An error in the arguments, the device or the output; [`Failure::Finding`] when a case fails.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        if let Some(name) = &self.sweep {
            // Best-practice advice and instrumented shaders do not matter there, and cost time.
            let validation = if self.without_validation { Validation::Off } else { Validation::On };
            return sweeps::run(name, &Place { validation, ..self.device.options() }, self.every_call);
        }
        if let Some(path) = &self.output {
            volraster::io::check_writable(path)?;
        }
        let methods =
            self.technique.iter().map(|name| Method::from_name(name)).collect::<Result<Vec<_>>>()?;
        let wanted = |case: &Case| {
            let named = self.filter.is_empty() || self.filter.iter().any(|text| case.name.contains(text));
            named && (methods.is_empty() || case.method.is_some_and(|method| methods.contains(&method)))
        };
        let all: Vec<Case> = cases::all()?.into_iter().chain(sweeps::all()?).collect();
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
        // Fails here if there is no device.
        let report = self.device.open(false)?.0.report().clone();
        let controls =
            if self.without_validation { Controls::skipped() } else { Controls::run(&self.device) };
        let validation = controls.validation();
        let allowed = Allowed::of_crate()?;
        let bar = output::progress(cases.len() as u64 + 1, "selftest");
        let layer = controls.layer.as_deref();
        if !quiet {
            let DeviceReport { name, driver, api, .. } = &report;
            let layer = layer.unwrap_or("none");
            output::print(&format!("device: {name}, {driver}, Vulkan {api}; layer: {layer}"))?;
            output::print(&format!("validation: {}", controls.line()))?;
        }
        let workbench = Workbench::new(self.device.clone(), validation);
        let kinds = controls.kinds().map(|(what, works)| (what.name(), works)).collect();
        let mut done: Vec<Done> = controls.faults.into_iter().map(|(_, control)| control).collect();
        for control in &done {
            print_result(control, &bar, quiet)?;
        }
        // Leaks are reported when the device is destroyed.
        let end = |workbench: &Workbench| {
            workbench.end();
            Ok("nothing is left".to_string())
        };
        let end = Case { name: "end of the device".to_string(), method: None, run: Box::new(end) };
        for case in cases.iter().chain([&end]) {
            let result = self.run_case(&workbench, case, &allowed);
            bar.inc(1);
            print_result(&result, &bar, quiet)?;
            done.push(result);
        }
        bar.finish_and_clear();
        let count = |status: Status| done.iter().filter(|case| case.status == status).count();
        let is_complete = whole && validation == Validation::Full;
        let report = Report {
            schema: "volraster-selftest/1",
            volraster: env!("CARGO_PKG_VERSION"),
            device: &report,
            layer,
            validation: kinds,
            whole,
            every_call: self.every_call,
            cases: &done,
            allowed: &allowed,
            unused: if is_complete { allowed.unused() } else { Vec::new() },
            passed: count(Status::Ok),
            failed: count(Status::Fail),
            skipped: count(Status::Skip),
            seconds: start.elapsed().as_secs_f64(),
        };
        self.conclude(&report, quiet)
    }

    /// Writes the report, prints the counts, and fails if a case failed.
    fn conclude(&self, report: &Report<'_>, quiet: bool) -> Outcome {
        if let Some(path) = &self.output {
            output::write_json(path, &json!(report))?;
        }
        let &Report { passed, failed, skipped, seconds, .. } = report;
        if !quiet {
            for id in &report.unused {
                output::print(&format!("note: the allowed message {id} never appeared"))?;
            }
            output::print(&format!("{passed} ok, {failed} failed, {skipped} skipped in {seconds:.1} s"))?;
        }
        match failed {
            0 => Ok(()),
            _ => Err(Failure::Finding(format!("selftest: {failed} of {} cases failed", report.cases.len()))),
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
        let ms = milliseconds_since(start);
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
        Done { messages, allowed_messages: known.len(), ..Done::new(case.name.clone(), status, ms, detail) }
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
