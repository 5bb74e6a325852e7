//! `volraster provoke`: commits faults that volume renderers make, each in a process of its own, and tells which the validation layer
//! hears.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::json;
use volraster::gpu::{Fault, GpuOptions, PipelineCache, Validation};
use volraster::{Error, Gpu, Result};

use crate::cli::input::DeviceArgs;
use crate::cli::outcome::{Failure, Outcome, id_of};
use crate::cli::output;
use crate::cli::table::aligned;

/// The longest time between looks at a process.
const LOOK: Duration = Duration::from_millis(5);

/// What a process prints before each message.
const MESSAGE: &str = "validation: ";

/// Arguments of `provoke`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Names of faults, or `all`.
    #[arg(value_name = "NAME", required_unless_present = "list")]
    names: Vec<String>,
    /// List the faults with the messages that are expected, and commit none.
    #[arg(long)]
    list: bool,
    /// Write the results as JSON.
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// Exit with 1 if a fault that was heard in these earlier results is committed and missed.
    #[arg(long, value_name = "FILE.json")]
    baseline: Option<PathBuf>,
    /// Time limit of each fault; a process that takes longer hangs.
    #[arg(long, value_name = "SECONDS", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..))]
    timeout: u64,
    #[command(flatten)]
    device: DeviceArgs,
    /// Commit one fault in this process. The command starts itself so.
    #[arg(long, hide = true)]
    here: bool,
}

/// How the process of a fault ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum End {
    /// All calls returned.
    Ok,
    /// A call failed, or the device lacks what the fault needs.
    Error(String),
    /// A signal ended it.
    Crash(String),
    /// The time limit ended it.
    Hang,
}

/// The result of a fault.
#[derive(Debug, Serialize)]
struct Heard {
    name: &'static str,
    what: &'static str,
    expected: &'static [&'static str],
    rule: &'static str,
    validation: String,
    /// The identifier of the message about the fault.
    heard: Option<String>,
    end: End,
    /// Identifiers of the other messages.
    others: Vec<String>,
}

/// Earlier results, as far as they are compared.
#[derive(Debug, Deserialize)]
struct Earlier {
    faults: Vec<EarlierFault>,
}

#[derive(Debug, Deserialize)]
struct EarlierFault {
    name: String,
    heard: Option<String>,
}

impl Earlier {
    fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read(path).map_err(output::unreadable(path))?;
        serde_json::from_slice(&text).map_err(|error| {
            output::refuse(
                path,
                &format!("line {}", error.line()),
                &format!("must be results of provoke: {error}"),
            )
        })
    }
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// An unknown name, a missing layer or device, or output that cannot be written; [`Failure::Finding`] for a fault that the layer
    /// misses though it was heard before. Else a missed fault is a result.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        let faults = self.faults()?;
        if self.list {
            return Ok(output::print(&list(&faults))?);
        }
        if let (true, [fault]) = (self.here, &faults[..]) {
            return self.commit(fault);
        }
        if let Some(path) = &self.output {
            volraster::io::check_writable(path)?;
        }
        let before = self.baseline.as_deref().map(Earlier::read).transpose()?;
        // Fails here if there is no device or no layer.
        let gpu = self.open(Validation::On, GpuOptions::default())?;
        let device = gpu.report().clone();
        let layer = gpu.validation_layer().unwrap_or("none").to_string();
        drop(gpu);
        let bar = output::progress(faults.len() as u64, "provoke");
        let mut results = Vec::new();
        for fault in faults {
            bar.set_message(fault.name());
            results.push(self.provoke(fault)?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        if let Some(path) = &self.output {
            let report = json!({
                "schema": "volraster-provoke/1",
                "volraster": env!("CARGO_PKG_VERSION"),
                "device": device,
                "layer": layer,
                "faults": results,
            });
            output::write_json(path, &report)?;
        }
        if !quiet {
            output::print(&format!(
                "device: {}, {}, Vulkan {}; layer: {layer}",
                device.name, device.driver, device.api
            ))?;
            output::print(&table(&results))?;
            let heard = results.iter().filter(|result| result.heard.is_some()).count();
            output::print(&format!("{heard} heard, {} missed", results.len() - heard))?;
        }
        let was_heard = |name: &str| {
            before
                .iter()
                .flat_map(|before| &before.faults)
                .any(|fault| fault.name == name && fault.heard.is_some())
        };
        let is_lost = |result: &&Heard| result.heard.is_none() && was_heard(result.name);
        match &results.iter().filter(is_lost).map(|result| result.name).collect::<Vec<_>>()[..] {
            [] => Ok(()),
            lost => Err(Failure::Finding(format!("heard before, and missed now: {}", lost.join(", ")))),
        }
    }

    /// Returns the faults that the arguments name, each once.
    fn faults(&self) -> Result<Vec<&'static Fault>> {
        if self.names.is_empty() || self.names.iter().any(|name| name == "all") {
            return Ok(Fault::all().collect());
        }
        let named = |name: &String| {
            let why = format!("\"{name}\": is no fault; --list prints all");
            Fault::named(name).ok_or_else(|| Error::Invalid { what: "name".to_string(), why })
        };
        self.names.iter().map(named).collect()
    }

    fn open(&self, validation: Validation, options: GpuOptions) -> Result<Gpu> {
        let mut given = self.device.options();
        given.without.extend(options.without);
        Gpu::new(&GpuOptions { validation, pipeline_cache: PipelineCache::Off, ..given })
    }

    /// Commits a fault in this process, and ends it without undoing anything.
    fn commit(&self, fault: &Fault) -> Outcome {
        let options = GpuOptions { without: fault.without().to_vec(), ..GpuOptions::default() };
        let gpu = self.open(fault.validation(), options)?;
        let log = gpu.validation_log();
        let outcome = fault.commit(&gpu);
        if log.messages().iter().any(|message| fault.is_told_by(message)) {
            // The driver may not survive the end of the device.
            std::mem::forget(gpu);
        } else {
            drop(gpu);
        }
        // Other messages were printed as they arrived, on stderr.
        for advice in log.messages().iter().filter(|message| message.contains("BestPractices")) {
            output::print(&format!("{MESSAGE}{}", output::plain(advice)))?;
        }
        match outcome {
            Ok(()) => std::process::exit(0),
            Err(error) => {
                output::complain(&error.to_string());
                std::process::exit(i32::from(error.exit_code()))
            }
        }
    }

    /// Starts this command for a fault and listens to it.
    fn provoke(&self, fault: &'static Fault) -> Result<Heard> {
        let failed = |source| Error::Io { path: "volraster".into(), action: "cannot start", source };
        let mut child = Command::new(std::env::current_exe().map_err(failed)?)
            .args(["provoke", fault.name(), "--here"])
            .args(self.device.arguments())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(failed)?;
        let lines = [child.stdout.take().map(lines), child.stderr.take().map(lines)];
        let mut end = self.wait(&mut child).map_err(failed)?;
        let lines: Vec<String> =
            lines.into_iter().flatten().filter_map(|thread| thread.join().ok()).flatten().collect();
        if let End::Error(why) = &mut end {
            *why = lines.iter().filter_map(|line| line.strip_prefix("volraster: ")).collect();
        }
        let messages: Vec<&str> = lines.iter().filter_map(|line| line.strip_prefix(MESSAGE)).collect();
        let heard = messages
            .iter()
            .find(|message| fault.is_told_by(message))
            .map(|message| id_of(message).to_string());
        let mut others: Vec<String> = messages.iter().map(|message| id_of(message).to_string()).collect();
        others.sort_unstable();
        others.dedup();
        // The process ends without undoing anything: that objects are left is no news.
        let left: &[&str] = Fault::named("leak").map_or(&[], |fault| fault.ids());
        others.retain(|id| Some(id) != heard.as_ref() && !left.contains(&id.as_str()));
        let (name, what, expected, rule) = (fault.name(), fault.what(), fault.ids(), fault.rule());
        let validation = format!("{:?}", fault.validation());
        Ok(Heard { name, what, expected, rule, validation, heard, end, others })
    }

    /// Waits for a process, and ends it at the time limit.
    fn wait(&self, child: &mut Child) -> std::io::Result<End> {
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(self.timeout) {
            if let Some(status) = child.try_wait()? {
                return Ok(match status.code() {
                    Some(0) => End::Ok,
                    Some(_) => End::Error(String::new()),
                    None => End::Crash(status.to_string()),
                });
            }
            thread::sleep(LOOK);
        }
        child.kill()?;
        child.wait()?;
        Ok(End::Hang)
    }
}

/// Reads the lines of a pipe on a thread of its own.
fn lines(pipe: impl Read + Send + 'static) -> thread::JoinHandle<Vec<String>> {
    thread::spawn(move || {
        let lines = BufReader::new(pipe).split(b'\n').map_while(std::result::Result::ok);
        lines.map(|line| String::from_utf8_lossy(&line).into_owned()).collect()
    })
}

/// Returns the name, the mistake and the first expected identifier of each fault, or the rule that it breaks.
fn list(faults: &[&Fault]) -> String {
    let row = |fault: &&Fault| {
        let expected = fault.ids().first().copied().unwrap_or(fault.rule());
        [fault.name(), expected, fault.what()].map(str::to_string)
    };
    let heading = ["fault", "message", "mistake"].map(str::to_string);
    aligned(&std::iter::once(heading).chain(faults.iter().map(row)).collect::<Vec<_>>(), &[0, 1, 2])
}

/// Returns the table of results.
fn table(results: &[Heard]) -> String {
    let row = |result: &Heard| {
        let expected = result.expected.first().copied().unwrap_or(result.rule);
        let verdict = if result.heard.is_some() { "heard" } else { "missed" };
        let end = match &result.end {
            End::Ok => String::new(),
            End::Error(why) => output::plain(why),
            End::Crash(status) => format!("crash: {status}"),
            End::Hang => "hang".to_string(),
        };
        let others = match (&result.heard, &result.others[..]) {
            (Some(_), _) | (None, []) => String::new(),
            (None, others) => format!("instead {}", others.join(", ")),
        };
        let note: Vec<String> = [others, end].into_iter().filter(|text| !text.is_empty()).collect();
        let message = result.heard.clone().unwrap_or_else(|| expected.to_string());
        [result.name.to_string(), verdict.to_string(), message, note.join("; ")]
    };
    let heading = ["fault", "", "message", "note"].map(str::to_string);
    aligned(&std::iter::once(heading).chain(results.iter().map(row)).collect::<Vec<_>>(), &[0, 1, 2, 3])
}
