//! A fault: its name, its messages and what commits it.

use ash::vk;

use super::ground::Ground;
use crate::error::{Error, Result};
use crate::gpu::device::Gpu;
use crate::gpu::feature::OptionalFeature;
use crate::gpu::validation::Validation;

/// A mistake, committed by calls that are right but for one.
#[derive(Debug)]
pub struct Fault {
    name: &'static str,
    what: &'static str,
    ids: &'static [&'static str],
    rule: &'static str,
    validation: Validation,
    without: &'static [OptionalFeature],
    commit: fn(&Ground<'_>) -> Outcome,
}

/// The result of the calls of a fault. Errors end it early; the layer may have reported it by then.
pub(super) type Outcome = std::result::Result<(), Failure>;

/// A failed call.
pub(super) enum Failure {
    Vulkan(vk::Result),
    Other(Error),
}

impl From<vk::Result> for Failure {
    fn from(result: vk::Result) -> Self {
        Self::Vulkan(result)
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Other(error)
    }
}

impl Fault {
    /// Returns the name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the mistake in a few words.
    #[must_use]
    pub fn what(&self) -> &'static str {
        self.what
    }

    /// Returns identifiers, or beginnings of them, of which a message about the fault has one; they differ between versions of the
    /// layer. Empty where no layer is known to report the fault.
    #[must_use]
    pub fn ids(&self) -> &'static [&'static str] {
        self.ids
    }

    /// Returns whether a message of a [`ValidationLog`](crate::gpu::ValidationLog) is about this fault.
    #[must_use]
    pub fn is_told_by(&self, message: &str) -> bool {
        self.ids.iter().any(|id| message.contains(id))
    }

    /// Returns the rule of the Vulkan specification that the fault breaks, where no identifier names one.
    #[must_use]
    pub fn rule(&self) -> &'static str {
        self.rule
    }

    /// Returns the least validation that reports it.
    #[must_use]
    pub fn validation(&self) -> Validation {
        self.validation
    }

    /// Returns the optional features that the device must be opened without
    /// ([`GpuOptions::without`](crate::gpu::GpuOptions::without)).
    #[must_use]
    pub fn without(&self) -> &'static [OptionalFeature] {
        self.without
    }

    /// Commits the fault. The driver may crash or hang; the objects that it uses are not destroyed, so that validation reports them when
    /// the device is.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`] when a call fails, which may be the right answer to the fault.
    pub fn commit(&self, gpu: &Gpu) -> Result<()> {
        (self.commit)(&Ground::new(gpu)).map_err(|failure| match failure {
            Failure::Vulkan(result) => Error::Vulkan { call: self.name, result },
            Failure::Other(error) => error,
        })
    }

    /// Describes a fault that core validation reports.
    pub(super) const fn new(
        name: &'static str,
        what: &'static str,
        ids: &'static [&'static str],
        commit: fn(&Ground<'_>) -> Outcome,
    ) -> Self {
        Self { name, what, ids, rule: "", validation: Validation::On, without: &[], commit }
    }

    /// Names the validation that reports the fault.
    pub(super) const fn by(self, validation: Validation) -> Self {
        Self { validation, ..self }
    }

    /// Leaves out features of the device.
    pub(super) const fn lacking(self, without: &'static [OptionalFeature]) -> Self {
        Self { without, ..self }
    }

    /// Cites the rule that the fault breaks.
    pub(super) const fn breaking(self, rule: &'static str) -> Self {
        Self { rule, ..self }
    }
}
