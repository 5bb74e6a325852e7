//! Controls: deliberate faults, one for each kind of validation, each of which must be reported.

use std::sync::Arc;
use std::time::Instant;

use volraster::gpu::{Gpu, GpuOptions, Provocation, Validation, ValidationLog};

use super::allow::id_of;
use super::verdict::{Done, Status};

/// The results of the controls.
pub(super) struct Controls {
    /// Name and version of the validation layer.
    pub(super) layer: Option<String>,
    pub(super) cases: Vec<Done>,
    /// The most thorough validation that works; cases run under it.
    pub(super) validation: Validation,
}

impl Controls {
    /// Returns every control as skipped, for runs without the layer.
    pub(super) fn skipped() -> Self {
        let skipped = |what: &Provocation| Done {
            name: format!("validation/{}", what.name()),
            status: Status::Skip,
            ms: 0.0,
            detail: "--without-validation".to_string(),
            messages: Vec::new(),
            allowed: 0,
        };
        Self {
            layer: None,
            cases: Provocation::ALL.iter().map(skipped).collect(),
            validation: Validation::Off,
        }
    }

    /// Provokes a fault for each kind of validation, each on a new device with all kinds enabled.
    pub(super) fn run(device: Option<&str>) -> Self {
        let mut controls = Self { layer: None, cases: Vec::new(), validation: Validation::Full };
        for what in Provocation::ALL {
            let start = Instant::now();
            let outcome = provoke(device, what, &mut controls.layer);
            let (status, detail) = match outcome {
                Ok(id) => (Status::Ok, format!("reported: {id}")),
                Err(reason) => (Status::Fail, reason),
            };
            let ms = start.elapsed().as_secs_f64() * 1e3;
            let name = format!("validation/{}", what.name());
            controls.cases.push(Done { name, status, ms, detail, messages: Vec::new(), allowed: 0 });
        }
        let ok = |what: Provocation| {
            let name = format!("validation/{}", what.name());
            controls.cases.iter().any(|case| case.name == name && case.status == Status::Ok)
        };
        controls.validation =
            match (ok(Provocation::Core), ok(Provocation::GpuAssisted), ok(Provocation::BestPractices)) {
                (false, ..) => Validation::Off,
                (true, true, true) => Validation::Full,
                (true, true, false) => Validation::GpuAssisted,
                (true, false, true) => Validation::BestPractices,
                (true, false, false) => Validation::On,
            };
        controls
    }

    /// Returns one line: the kinds that work, and those that are missing.
    pub(super) fn line(&self) -> String {
        let names = |on: bool| -> Vec<&str> {
            let of = self.cases.iter().filter(|case| (case.status == Status::Ok) == on);
            of.filter_map(|case| case.name.strip_prefix("validation/")).collect()
        };
        let list = |names: Vec<&str>| if names.is_empty() { "none".to_string() } else { names.join(", ") };
        format!("on: {}; missing: {}", list(names(true)), list(names(false)))
    }
}

/// Causes a fault on a new device and returns the id of its message, or why there is none.
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
        None => Err(format!("{what:?}: the fault was not reported ({} other messages)", messages.len())),
    }
}
