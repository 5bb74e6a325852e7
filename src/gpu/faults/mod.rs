//! Deliberate faults: mistakes that volume renderers make, each with the message that a validation layer should give. They show what a
//! layer hears, and that it listens.

mod commands;
mod descriptors;
mod ground;
mod objects;
mod synchronization;

use ash::vk;

use super::device::Gpu;
use super::feature::OptionalFeature;
use super::validation::Validation;
use crate::error::{Error, Result};
use ground::Ground;

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
type Outcome = std::result::Result<(), Failure>;

/// A failed call.
enum Failure {
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
    /// Returns all faults.
    pub fn all() -> impl Iterator<Item = &'static Self> {
        let lists = [
            &synchronization::FAULTS[..],
            &objects::FAULTS[..],
            &descriptors::FAULTS[..],
            &commands::FAULTS[..],
        ];
        lists.into_iter().flatten()
    }

    /// Returns the fault of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::all().find(|fault| fault.name == name)
    }

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

    /// Returns whether a message of a [`ValidationLog`](super::ValidationLog) is about this fault.
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
    /// ([`GpuOptions::without`](super::GpuOptions::without)).
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
    const fn new(
        name: &'static str,
        what: &'static str,
        ids: &'static [&'static str],
        commit: fn(&Ground<'_>) -> Outcome,
    ) -> Self {
        Self { name, what, ids, rule: "", validation: Validation::On, without: &[], commit }
    }

    /// Names the validation that reports the fault.
    const fn by(self, validation: Validation) -> Self {
        Self { validation, ..self }
    }

    /// Leaves out features of the device.
    const fn lacking(self, without: &'static [OptionalFeature]) -> Self {
        Self { without, ..self }
    }

    /// Cites the rule that the fault breaks.
    const fn breaking(self, rule: &'static str) -> Self {
        Self { rule, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_has_a_name_of_its_own_and_a_message_or_a_rule() {
        let faults: Vec<&Fault> = Fault::all().collect();
        assert!(faults.len() >= 30);
        for fault in &faults {
            assert_eq!(faults.iter().filter(|other| other.name == fault.name).count(), 1, "{}", fault.name);
            assert!(fault.ids.is_empty() != fault.rule.is_empty(), "{}", fault.name);
            assert!(fault.name.chars().all(|c| c.is_ascii_lowercase() || c == '-'), "{}", fault.name);
        }
    }
}
