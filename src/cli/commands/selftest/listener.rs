//! Listeners, which are told of a run while it goes on, and the one that prints lines.

use indicatif::ProgressBar;
use volraster::Result;
use volraster::gpu::DeviceReport;

use super::cases::{Done, Status};
use super::controls::Controls;
use crate::cli::outcome::id_of;
use crate::cli::output;

/// The device and the validation of a run.
pub(super) struct Place<'a> {
    pub(super) device: &'a DeviceReport,
    pub(super) controls: &'a Controls,
}

impl Place<'_> {
    /// Returns a line about the device and one about validation.
    pub(super) fn lines(&self) -> [String; 2] {
        let DeviceReport { name, driver, api, .. } = self.device;
        let layer = self.controls.layer.as_deref().unwrap_or("none");
        let device = format!("device: {name}, {driver}, Vulkan {api}; layer: {layer}");
        [device, format!("validation: {}", self.controls.line())]
    }
}

/// A listener is told of a run while it goes on.
pub(super) trait Listener {
    /// The device is open, and validation was checked.
    fn place(&mut self, place: &Place<'_>) -> Result<()>;
    /// A case begins.
    fn begins(&mut self, case: &str) -> Result<()>;
    /// A case has ended.
    fn ends(&mut self, done: &Done) -> Result<()>;
}

/// Prints a line per case below a progress bar. Quiet runs print failures only.
pub(super) struct Lines {
    pub(super) bar: ProgressBar,
    pub(super) quiet: bool,
}

impl Listener for Lines {
    fn place(&mut self, place: &Place<'_>) -> Result<()> {
        if self.quiet {
            return Ok(());
        }
        place.lines().iter().try_for_each(|line| self.bar.suspend(|| output::print(line)))
    }

    fn begins(&mut self, _: &str) -> Result<()> {
        Ok(())
    }

    /// Prints the line of a case and one message of each id; the report has all messages.
    fn ends(&mut self, done: &Done) -> Result<()> {
        self.bar.inc(1);
        if self.quiet && done.status != Status::Fail {
            return Ok(());
        }
        self.bar.suspend(|| output::print(&done.line()))?;
        for (i, message) in done.messages.iter().enumerate() {
            if done.messages[..i].iter().all(|other| id_of(other) != id_of(message)) {
                self.bar.suspend(|| output::print(&format!("     {}", output::plain(message))))?;
            }
        }
        Ok(())
    }
}
