//! Controls: deliberate faults, one for each kind of validation, each of which must be reported.

use std::time::Instant;

use volraster::gpu::{GpuOptions, Provocation, Validation};

use super::allow::id_of;
use super::cases::{Done, Status};
use super::workbench::Workbench;
use crate::cli::input::DeviceArgs;
use crate::cli::timing::milliseconds_since;

/// The results of the controls.
pub(super) struct Controls {
    /// Name and version of the validation layer.
    pub(super) layer: Option<String>,
    /// The result of each fault.
    pub(super) faults: Vec<(Provocation, Done)>,
}

impl Controls {
    /// Returns every control as skipped, for runs without the layer.
    pub(super) fn skipped() -> Self {
        let why = "--without-validation";
        let skipped = |what| (what, Done::new(name(what), Status::Skip, 0.0, why.to_string()));
        Self { layer: None, faults: Provocation::ALL.map(skipped).into() }
    }

    /// Provokes a fault for each kind of validation, each on a new device with all kinds enabled.
    pub(super) fn run(device: &DeviceArgs) -> Self {
        let mut layer = None;
        let faults = Provocation::ALL.map(|what| {
            let start = Instant::now();
            let (status, detail) = match provoke(device, what, &mut layer) {
                Ok(id) => (Status::Ok, format!("reported: {id}")),
                Err(reason) => (Status::Fail, reason),
            };
            (what, Done::new(name(what), status, milliseconds_since(start), detail))
        });
        Self { layer, faults: faults.into() }
    }

    /// Returns each kind of validation, and whether it works.
    pub(super) fn kinds(&self) -> impl Iterator<Item = (Provocation, bool)> {
        self.faults.iter().map(|(what, done)| (*what, done.status == Status::Ok))
    }

    /// Returns the most thorough validation that works; cases run under it.
    pub(super) fn validation(&self) -> Validation {
        let ok = |wanted: Provocation| self.kinds().any(|kind| kind == (wanted, true));
        match (ok(Provocation::Core), ok(Provocation::GpuAssisted), ok(Provocation::BestPractices)) {
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
            let names: Vec<&str> =
                self.kinds().filter(|kind| kind.1 == on).map(|(what, _)| what.name()).collect();
            if names.is_empty() { "none".to_string() } else { names.join(", ") }
        };
        format!("on: {}; missing: {}", list(true), list(false))
    }
}

/// Returns the names of all controls.
pub(super) fn names() -> [String; Provocation::ALL.len()] {
    Provocation::ALL.map(name)
}

fn name(what: Provocation) -> String {
    format!("validation/{}", what.name())
}

/// Causes a fault on a new device and returns the id of its message, or why there is none.
fn provoke(
    device: &DeviceArgs,
    what: Provocation,
    layer: &mut Option<String>,
) -> std::result::Result<String, String> {
    let bench = Workbench::new(device.clone(), Validation::Full);
    bench.log.keep_silent();
    let gpu = bench.open_under(Validation::Full, GpuOptions::default()).map_err(|error| error.to_string())?;
    *layer = gpu.validation_layer().map(str::to_string);
    gpu.provoke(what).map_err(|error| error.to_string())?;
    drop(gpu);
    let messages = bench.log.take();
    let is_it = |message: &&String| what.message().iter().any(|part| message.contains(part));
    match messages.iter().find(is_it) {
        Some(message) => Ok(id_of(message).to_string()),
        None => Err(format!("{what:?}: the fault was not reported ({} other messages)", messages.len())),
    }
}
