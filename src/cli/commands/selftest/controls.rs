//! Controls: a deliberate fault for each kind of validation, which must be reported.

use std::time::Instant;

use volraster::gpu::{Fault, GpuOptions, Validation};

use super::cases::{Done, Status};
use super::workbench::Workbench;
use crate::cli::input::DeviceArgs;
use crate::cli::outcome::id_of;
use crate::cli::timing::milliseconds_since;

/// Kinds of validation, each with a fault that it alone reports.
const KINDS: [(&str, &str); 5] = [
    ("core", "empty-buffer"),
    ("leaks", "leak"),
    ("synchronization", "buffer-cleared-twice"),
    ("gpu-assisted", "index-beyond-the-list"),
    ("best-practices", "pools-reset-one-by-one"),
];

/// The results of the controls.
pub(super) struct Controls {
    /// Name and version of the validation layer.
    pub(super) layer: Option<String>,
    /// The result for each kind of validation.
    pub(super) faults: Vec<(&'static str, Done)>,
}

impl Controls {
    /// Returns every control as skipped, for runs without the layer.
    pub(super) fn skipped() -> Self {
        let why = "--without-validation";
        let skipped = |(kind, _)| (kind, Done::new(name(kind), Status::Skip, 0.0, why.to_string()));
        Self { layer: None, faults: KINDS.map(skipped).into() }
    }

    /// Provokes a fault for each kind of validation, each on a new device with all kinds enabled.
    pub(super) fn run(device: &DeviceArgs) -> Self {
        let mut layer = None;
        let faults = KINDS.map(|(kind, fault)| {
            let start = Instant::now();
            let (status, detail) = match provoke(device, fault, &mut layer) {
                Ok(id) => (Status::Ok, format!("reported: {id}")),
                Err(reason) => (Status::Fail, reason),
            };
            (kind, Done::new(name(kind), status, milliseconds_since(start), detail))
        });
        Self { layer, faults: faults.into() }
    }

    /// Returns each kind of validation, and whether it works.
    pub(super) fn kinds(&self) -> impl Iterator<Item = (&'static str, bool)> {
        self.faults.iter().map(|(kind, done)| (*kind, done.status == Status::Ok))
    }

    /// Returns the most thorough validation that works; cases run under it.
    pub(super) fn validation(&self) -> Validation {
        let ok = |wanted: &str| self.kinds().any(|kind| kind == (wanted, true));
        match (ok("core"), ok("gpu-assisted"), ok("best-practices")) {
            (false, ..) => Validation::Off,
            (true, true, true) => Validation::Full,
            (true, true, false) => Validation::GpuAssisted,
            (true, false, true) => Validation::BestPractices,
            (true, false, false) => Validation::On,
        }
    }

    /// Returns one line: the kinds that work, and those that are missing.
    pub(super) fn line(&self) -> String {
        let list = |on: bool| {
            let names: Vec<&str> = self.kinds().filter(|kind| kind.1 == on).map(|(kind, _)| kind).collect();
            if names.is_empty() { "none".to_string() } else { names.join(", ") }
        };
        format!("on: {}; missing: {}", list(true), list(false))
    }
}

/// Returns the names of all controls.
pub(super) fn names() -> impl Iterator<Item = String> {
    KINDS.into_iter().map(|(kind, _)| name(kind))
}

fn name(kind: &str) -> String {
    format!("validation/{kind}")
}

/// Commits a fault on a new device and returns the id of its message, or why there is none.
fn provoke(
    device: &DeviceArgs,
    name: &str,
    layer: &mut Option<String>,
) -> std::result::Result<String, String> {
    let fault = Fault::named(name).ok_or_else(|| format!("there is no fault {name}"))?;
    let bench = Workbench::new(device.clone(), Validation::Full);
    bench.log.keep_silent();
    let gpu = bench.open_under(Validation::Full, GpuOptions::default()).map_err(|error| error.to_string())?;
    *layer = gpu.validation_layer().map(str::to_string);
    fault.commit(&gpu).map_err(|error| error.to_string())?;
    drop(gpu);
    let messages = bench.log.take();
    match messages.iter().find(|message| fault.is_told_by(message)) {
        Some(message) => Ok(id_of(message).to_string()),
        None => Err(format!("{name}: the fault was not reported ({} other messages)", messages.len())),
    }
}
