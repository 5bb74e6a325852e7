//! `volraster selftest`: every technique, route and resource path, under every kind of validation.
//!
//! | file | what |
//! |---|---|
//! | `cases`, `limits` | what is checked |
//! | `session` | whole sessions in which calls fail and devices are lost |
//! | `stage` | devices, scenes and truths that cases share |
//! | `allow`, `allowed.json` | messages that are no fault |

mod allow;
mod cases;
mod limits;
mod session;
mod stage;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};
use volraster::gpu::{Gpu, GpuOptions, Provocation, Validation, ValidationLog};
use volraster::technique::Method;
use volraster::{Error, Result};

use super::input::DeviceArgs;
use super::{Failure, Outcome, output};
use crate::cli::selftest::allow::{Allowed, id_of};
use crate::cli::selftest::cases::Case;
use crate::cli::selftest::stage::{Stage, Stop};

/// Arguments of `selftest`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Write a report.
    #[arg(short, long, value_name = "REPORT.json")]
    output: Option<PathBuf>,
    /// Run the cases whose names contain TEXT; may be repeated. The checks of validation itself always run.
    #[arg(long, value_name = "TEXT")]
    filter: Vec<String>,
    /// Run the cases of these techniques, separated by commas.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    technique: Vec<String>,
    /// Let every call of the sessions fail in turn, and not some of each name: takes an hour.
    #[arg(long)]
    every_call: bool,
    /// List the cases, and run none.
    #[arg(long)]
    list: bool,
    /// Run without the validation layer, and say so.
    #[arg(long)]
    without_validation: bool,
    #[command(flatten)]
    device: DeviceArgs,
    /// Make a fault in the cases whose names contain TEXT: for the test of this command.
    #[arg(long, value_name = "TEXT", hide = true)]
    provoke: Option<String>,
}

/// What came of a case.
struct Done {
    name: String,
    status: Status,
    ms: f64,
    detail: String,
    /// Messages that are a fault, and how many are none.
    messages: Vec<String>,
    allowed: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Status {
    Ok,
    Fail,
    Skip,
}

impl Status {
    fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Fail => "FAIL",
            Self::Skip => "skip",
        }
    }
}

impl Done {
    fn line(&self) -> String {
        format!(
            "{:4} {:60} {:8.1} ms  {}",
            self.status.name(),
            self.name,
            self.ms,
            output::plain(&self.detail)
        )
    }

    fn json(&self) -> Value {
        json!({
            "name": self.name,
            "status": self.status.name().to_lowercase(),
            "ms": self.ms,
            "detail": self.detail,
            "messages": self.messages,
            "allowed_messages": self.allowed,
        })
    }
}

/// The kinds of validation, and whether each hears what it is for.
struct Heard {
    layer: Option<String>,
    cases: Vec<Done>,
    /// The most that is heard, under which cases run.
    validation: Validation,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// What is wrong with the arguments, the device or the output; [`Failure::Finding`] when a case fails.
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
            let why = "no case has such a name and technique: --list tells all".to_string();
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

    fn test(&self, cases: &[Case], whole: bool, quiet: bool) -> Outcome {
        let start = Instant::now();
        let device = self.device.device.clone();
        // Without a device there is nothing to test.
        let report = self.device.open(false)?.0.report().clone();
        let heard = if self.without_validation { Heard::nothing() } else { hear(device.as_deref()) };
        let allowed = Allowed::of_crate()?;
        let bar = output::progress(u64::try_from(cases.len()).unwrap_or(0), "selftest");
        let tell = |done: &Done| -> Result<()> {
            if quiet && done.status != Status::Fail {
                return Ok(());
            }
            bar.suspend(|| output::print(&done.line()))?;
            for (i, message) in done.messages.iter().enumerate() {
                // One of each id is enough here; the report has all.
                if done.messages[..i].iter().all(|other| id_of(other) != id_of(message)) {
                    bar.suspend(|| output::print(&format!("     {}", output::plain(message))))?;
                }
            }
            Ok(())
        };
        if !quiet {
            let layer = heard.layer.as_deref().unwrap_or("none");
            output::print(&format!(
                "device: {}, {}, Vulkan {}; layer: {layer}",
                report.name, report.driver, report.api
            ))?;
            output::print(&format!("validation: {}", heard.line()))?;
        }
        let stage = Stage::new(device, heard.validation);
        let mut done: Vec<Done> = Vec::new();
        for case in heard.cases {
            tell(&case)?;
            done.push(case);
        }
        for case in cases {
            let result = self.one(&stage, case, &allowed);
            bar.inc(1);
            tell(&result)?;
            done.push(result);
        }
        // What is left on the device is heard when it goes.
        let end = Case::new("end of the device", None, |stage| {
            stage.end();
            Ok("nothing is left".to_string())
        })?;
        let end = self.one(&stage, &end, &allowed);
        bar.finish_and_clear();
        tell(&end)?;
        done.push(end);

        let count = |status: Status| done.iter().filter(|case| case.status == status).count();
        let unused: Vec<&str> =
            if whole && heard.validation == Validation::Full { allowed.unused() } else { Vec::new() };
        let [passed, failed, skipped] = [Status::Ok, Status::Fail, Status::Skip].map(count);
        if let Some(path) = &self.output {
            let json = json!({
                "schema": "volraster-selftest/1",
                "volraster": env!("CARGO_PKG_VERSION"),
                "device": report,
                "layer": heard.layer,
                "validation": done
                    .iter()
                    .filter_map(|case| Some((case.name.strip_prefix("validation/")?, case.status == Status::Ok)))
                    .collect::<std::collections::BTreeMap<_, _>>(),
                "whole": whole,
                "every_call": self.every_call,
                "cases": done.iter().map(Done::json).collect::<Value>(),
                "allowed": allowed.json(),
                "unused": unused,
                "passed": passed,
                "failed": failed,
                "skipped": skipped,
                "seconds": start.elapsed().as_secs_f64(),
            });
            output::write_json(path, &json)?;
        }
        if !quiet {
            for id in &unused {
                output::print(&format!("note: {id} is allowed, and never came"))?;
            }
            let seconds = start.elapsed().as_secs_f64();
            output::print(&format!("{passed} ok, {failed} failed, {skipped} skipped in {seconds:.1} s"))?;
        }
        match failed {
            0 => Ok(()),
            failed => Err(Failure::Finding(format!("selftest: {failed} of {} cases failed", done.len()))),
        }
    }

    /// Runs a case, and judges what was heard meanwhile.
    fn one(&self, stage: &Stage, case: &Case, allowed: &Allowed) -> Done {
        let start = Instant::now();
        let mut verdict = (case.run)(stage);
        if self.provoke.as_ref().is_some_and(|text| case.name.contains(text)) {
            let provoked = stage.gpu().and_then(|gpu| gpu.provoke(Provocation::Core));
            verdict = provoked.map_err(Stop::from).and(verdict);
        }
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let (known, messages): (Vec<String>, Vec<String>) =
            stage.log.take().into_iter().partition(|message| allowed.allows(&case.name, message));
        let (mut status, mut detail) = match verdict {
            Ok(detail) => (Status::Ok, detail),
            Err(Stop::Skip(reason)) => (Status::Skip, reason),
            Err(Stop::Fail(reason)) => (Status::Fail, reason),
        };
        if let Some(first) = messages.first() {
            if status != Status::Fail {
                detail = format!("{} messages of validation, {} the first", messages.len(), id_of(first));
            }
            status = Status::Fail;
        }
        Done { name: case.name.clone(), status, ms, detail, messages, allowed: known.len() }
    }
}

impl Heard {
    /// Without the layer: each kind is told as skipped.
    fn nothing() -> Self {
        let skipped = |what: &Provocation| Done {
            name: format!("validation/{}", what.name()),
            status: Status::Skip,
            ms: 0.0,
            detail: "asked for without validation".to_string(),
            messages: Vec::new(),
            allowed: 0,
        };
        Self {
            layer: None,
            cases: Provocation::ALL.iter().map(skipped).collect(),
            validation: Validation::Off,
        }
    }

    /// Which kinds are on, and which are missing.
    fn line(&self) -> String {
        let names = |on: bool| -> Vec<&str> {
            let of = self.cases.iter().filter(|case| (case.status == Status::Ok) == on);
            of.filter_map(|case| case.name.strip_prefix("validation/")).collect()
        };
        let told = |names: Vec<&str>| if names.is_empty() { "none".to_string() } else { names.join(", ") };
        format!("on: {}; missing: {}", told(names(true)), told(names(false)))
    }
}

/// Provokes a fault for each kind of validation, on a device of its own, under all kinds where that can be.
fn hear(device: Option<&str>) -> Heard {
    let mut heard = Heard { layer: None, cases: Vec::new(), validation: Validation::Full };
    for what in Provocation::ALL {
        let start = Instant::now();
        let outcome = provoke(device, what, &mut heard.layer);
        let (status, detail) = match outcome {
            Ok(id) => (Status::Ok, format!("heard: {id}")),
            Err(reason) => (Status::Fail, reason),
        };
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let name = format!("validation/{}", what.name());
        heard.cases.push(Done { name, status, ms, detail, messages: Vec::new(), allowed: 0 });
    }
    let ok = |what: Provocation| {
        let name = format!("validation/{}", what.name());
        heard.cases.iter().any(|case| case.name == name && case.status == Status::Ok)
    };
    heard.validation =
        match (ok(Provocation::Core), ok(Provocation::GpuAssisted), ok(Provocation::BestPractices)) {
            (false, ..) => Validation::Off,
            (true, true, true) => Validation::Full,
            (true, true, false) => Validation::GpuAssisted,
            (true, false, true) => Validation::BestPractices,
            (true, false, false) => Validation::On,
        };
    heard
}

/// Makes a fault and waits for its message.
fn provoke(
    device: Option<&str>,
    what: Provocation,
    layer: &mut Option<String>,
) -> std::result::Result<String, String> {
    let log = Arc::new(ValidationLog::default());
    log.keep_silent();
    let options = GpuOptions {
        device: device.map(str::to_string),
        validation: Validation::Full,
        validation_log: Some(Arc::clone(&log)),
        no_pipeline_cache: true,
        ..GpuOptions::default()
    };
    let gpu = Gpu::new(&options).map_err(|error| error.to_string())?;
    *layer = gpu.validation_layer().map(str::to_string);
    gpu.provoke(what).map_err(|error| error.to_string())?;
    drop(gpu);
    let messages = log.take();
    let is_it = |message: &&String| what.message().iter().any(|part| message.contains(part));
    match messages.iter().find(is_it) {
        Some(message) => Ok(id_of(message).to_string()),
        None => Err(format!("{what:?} was provoked, and not heard ({} other messages)", messages.len())),
    }
}
