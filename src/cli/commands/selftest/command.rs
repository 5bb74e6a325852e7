//! Arguments of `selftest`, its run and its report.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;
use serde_json::json;
use volraster::Result;
use volraster::gpu::{DeviceReport, Fault, Validation};
use volraster::technique::Method;

use super::allow::Allowed;
use super::cases::{Case, Done, Status};
use super::catalogue::{END, all, names};
use super::controls::Controls;
use super::googletest::{self, Flags};
use super::listener::{Lines, Listener, Place};
use super::session;
use super::sweeps;
use super::workbench::{Stop, Workbench};
use crate::cli::input::DeviceArgs;
use crate::cli::numbers::counted;
use crate::cli::outcome::{Failure, Outcome, id_of};
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
    #[command(flatten)]
    googletest: Flags,
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
            return sweeps::run(
                name,
                &session::Place { validation, ..self.device.options() },
                self.every_call,
            );
        }
        if let Some(request) = self.googletest.request()? {
            self.check_alone()?;
            return self.speak(request);
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
        let all = all()?;
        let whole = all.iter().all(wanted);
        let cases: Vec<Case> = all.into_iter().filter(wanted).collect();
        if cases.is_empty() {
            let why = "no case matches this name and technique; --list prints all cases".to_string();
            return Err(output::invalid("filter", why).into());
        }
        if self.list {
            for case in &cases {
                output::print(&case.name)?;
            }
            return Ok(());
        }
        let bar = output::progress(cases.len() as u64 + 1, "selftest");
        let mut lines = Lines { bar, quiet };
        let run = self.test(&cases, &|_| true, &mut lines)?;
        lines.bar.finish_and_clear();
        self.conclude(&run, whole, quiet)
    }

    /// Refuses the options in place of which googletest's protocol has its own.
    fn check_alone(&self) -> Result<()> {
        let given = [
            ("--output", self.output.is_some()),
            ("--filter", !self.filter.is_empty()),
            ("--technique", !self.technique.is_empty()),
            ("--list", self.list),
        ];
        let why = "is not for runs by googletest's protocol, which a --gtest_ flag, GTEST_FILTER, GTEST_OUTPUT or GTEST_TOTAL_SHARDS selects";
        match given.iter().find(|(_, given)| *given) {
            Some((option, _)) => Err(output::invalid(option, why.to_string())),
            None => Ok(()),
        }
    }

    /// Lists or runs what a runner of googletest programs asks for.
    fn speak(&self, request: googletest::Request) -> Outcome {
        let names = names()?;
        let selected = request.select(names.iter().map(String::as_str));
        if request.lists() {
            return Ok(googletest::list(&selected)?);
        }
        let is_selected = |name: &str| selected.contains(&name);
        let mut cases = all()?;
        cases.retain(|case| is_selected(&case.name));
        let mut protocol = request.begin(&selected)?;
        let run = match selected.is_empty() {
            true => None,
            false => Some(self.test(&cases, &is_selected, &mut protocol)?),
        };
        protocol.end()?;
        match run {
            Some(run) => run.verdict(),
            None => Ok(()),
        }
    }

    /// Checks validation itself, then runs the cases, and tells the listener of all that is selected.
    fn test(
        &self,
        cases: &[Case],
        is_selected: &dyn Fn(&str) -> bool,
        listener: &mut dyn Listener,
    ) -> Result<Run> {
        let start = Instant::now();
        // Fails here if there is no device.
        let device = self.device.open(false)?.0.report().clone();
        let controls =
            if self.without_validation { Controls::skipped() } else { Controls::run(&self.device) };
        let validation = controls.validation();
        let allowed = Allowed::of_crate()?;
        listener.place(&Place { device: &device, controls: &controls })?;
        let workbench = Workbench::new(self.device.clone(), validation);
        let mut done = Vec::new();
        // A kind of validation that is silent fails every run, also one that did not ask for it.
        let told = |control: &Done| is_selected(&control.name) || control.status == Status::Fail;
        for (_, control) in controls.faults.iter().filter(|(_, control)| told(control)) {
            listener.begins(&control.name)?;
            listener.ends(control)?;
            done.push(control.clone());
        }
        for case in cases {
            listener.begins(&case.name)?;
            let result = self.run_case(&workbench, case, &allowed);
            listener.ends(&result)?;
            done.push(result);
        }
        // Leaks are reported when the device is destroyed.
        let end = |workbench: &Workbench| {
            workbench.end();
            Ok("nothing is left".to_string())
        };
        let end = Case { name: END.to_string(), method: None, run: Box::new(end) };
        let result = self.run_case(&workbench, &end, &allowed);
        if is_selected(END) || result.status == Status::Fail {
            listener.begins(END)?;
            listener.ends(&result)?;
            done.push(result);
        }
        Ok(Run { device, controls, validation, done, allowed, seconds: start.elapsed().as_secs_f64() })
    }

    /// Writes the report, prints the counts, and fails if a case failed.
    fn conclude(&self, run: &Run, whole: bool, quiet: bool) -> Outcome {
        let is_complete = whole && run.validation == Validation::Full;
        let report = Report {
            schema: "volraster-selftest/1",
            volraster: env!("CARGO_PKG_VERSION"),
            device: &run.device,
            layer: run.controls.layer.as_deref(),
            validation: run.controls.kinds().collect(),
            whole,
            every_call: self.every_call,
            cases: &run.done,
            allowed: &run.allowed,
            unused: if is_complete { run.allowed.unused() } else { Vec::new() },
            passed: run.count(Status::Ok),
            failed: run.count(Status::Fail),
            skipped: run.count(Status::Skip),
            seconds: run.seconds,
        };
        if let Some(path) = &self.output {
            output::write_json(path, &json!(report))?;
        }
        let Report { passed, failed, skipped, seconds, .. } = report;
        if !quiet {
            for id in &report.unused {
                output::print(&format!("note: the allowed message {id} never appeared"))?;
            }
            output::print(&format!("{passed} ok, {failed} failed, {skipped} skipped in {seconds:.1} s"))?;
        }
        run.verdict()
    }

    /// Runs a case, and fails it if the layer gave messages that are not allowed.
    fn run_case(&self, workbench: &Workbench, case: &Case, allowed: &Allowed) -> Done {
        let start = Instant::now();
        let mut verdict = (case.run)(workbench);
        if self.provoke.as_ref().is_some_and(|text| case.name.contains(text)) {
            let fault = Fault::named("empty-buffer");
            let provoked = workbench.gpu().and_then(|gpu| fault.map_or(Ok(()), |fault| fault.commit(&gpu)));
            verdict = provoked.map_err(Stop::from).and(verdict);
        }
        let ms = milliseconds_since(start);
        let (known, messages): (Vec<String>, Vec<String>) =
            workbench.log.take().into_iter().partition(|message| allowed.allows(&case.name, message));
        let (mut status, mut detail) = match verdict {
            Ok(detail) => (Status::Ok, detail),
            Err(Stop::Skip(reason)) => (Status::Skip, reason),
            // Emulated limits are there to be met.
            Err(Stop::Refused(reason)) if self.device.options().is_tightened() => (Status::Skip, reason),
            Err(Stop::Refused(reason)) => (Status::Fail, reason),
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

/// The results of a run.
struct Run {
    device: DeviceReport,
    controls: Controls,
    validation: Validation,
    done: Vec<Done>,
    allowed: Allowed,
    seconds: f64,
}

impl Run {
    fn count(&self, status: Status) -> usize {
        self.done.iter().filter(|case| case.status == status).count()
    }

    /// Fails if a case failed.
    fn verdict(&self) -> Outcome {
        match self.count(Status::Fail) {
            0 => Ok(()),
            failed => Err(Failure::Finding(format!(
                "selftest: {failed} of {} failed",
                counted(self.done.len(), "case")
            ))),
        }
    }
}
