//! A device on which calls fail, and the checks after each failure.

use std::collections::BTreeMap;
use std::sync::Arc;

use volraster::ash::vk;
use volraster::gpu::{Gpu, Injection, Validation, ValidationLog};
use volraster::{Error, Result};

use super::sessions::{Pictures, Session, open};

/// Calls whose failure is not reported to the caller, with the reason.
pub(crate) const HARMLESS: [(&str, &str); 7] = [
    ("vkSetDebugUtilsObjectNameEXT", "the object has no name"),
    ("vkAllocateMemory", "staging memory is requested again from a slower memory type"),
    ("vkMapMemory", "as vkAllocateMemory"),
    (
        "vkGetPipelineCacheData",
        "the pipeline cache is not stored; pipelines are compiled again the next time",
    ),
    (
        "vkDeviceWaitIdle",
        "called before the device is destroyed, when every submission has completed already",
    ),
    ("vkWaitForFences", "called when an object with a pending submission is dropped; it waits again"),
    ("vkEndCommandBuffer", "called between the parts of a frame, which goes on in the same command buffer"),
];

/// The device and validation for sessions with failures.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    pub(crate) device: Option<String>,
    pub(crate) validation: Validation,
}

/// Counts of a sweep of failures.
#[derive(Debug, Default)]
pub(crate) struct Swept {
    /// Calls of the session.
    pub(crate) calls: u64,
    /// Calls that were made to fail, by function.
    pub(crate) failed: BTreeMap<&'static str, u32>,
    /// Failed calls after which the session went on.
    pub(crate) harmless: u32,
}

impl Swept {
    pub(super) fn count_failure(
        &mut self,
        harness: &Harness<'_>,
        what: &str,
        run: Result<Pictures>,
        expected: &Pictures,
    ) -> Outcome<()> {
        let name = harness.injection.last_failed().unwrap_or("none");
        *self.failed.entry(name).or_default() += 1;
        match run {
            Ok(pictures) => {
                if !HARMLESS.iter().any(|(harmless, _)| *harmless == name) {
                    return Err(format!(
                        "{}: {what}: failed, but no error was returned",
                        harness.session.name
                    ));
                }
                self.harmless += 1;
                harness.same(what, &pictures, expected)
            }
            Err(error) => harness.check_error(what, &error),
        }
    }
}

/// A finding as one line of text.
pub(crate) type Finding = String;

/// The result of a check.
pub(super) type Outcome<T> = std::result::Result<T, Finding>;

/// Error codes, used in turn; a code that a call may not return is replaced by one that it may.
pub(super) const RESULTS: [vk::Result; 4] = [
    vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
    vk::Result::ERROR_OUT_OF_HOST_MEMORY,
    vk::Result::ERROR_OUT_OF_POOL_MEMORY,
    vk::Result::ERROR_INITIALIZATION_FAILED,
];

/// A device with injected failures, and its validation log.
pub(super) struct Harness<'a> {
    pub(super) place: &'a Place,
    pub(super) session: &'a Session,
    pub(super) injection: Injection,
    pub(super) log: Arc<ValidationLog>,
}

impl<'a> Harness<'a> {
    pub(super) fn new(place: &'a Place, session: &'a Session) -> Self {
        Self { place, session, injection: Injection::new(), log: Arc::default() }
    }

    pub(super) fn open(&self) -> Result<Gpu> {
        open(self.place.device.as_deref(), self.place.validation, &self.log, &self.injection)
    }

    pub(super) fn at<T>(&self, what: &str, result: Result<T>) -> Outcome<T> {
        result.map_err(|error| format!("{}: {what}: {error}", self.session.name))
    }

    /// Checks that the device holds no memory and that validation is silent.
    pub(super) fn clean(&self, what: &str, gpu: Option<&Gpu>) -> Outcome<()> {
        let held = gpu.map(Gpu::memory_report).unwrap_or_default();
        if !held.is_empty() {
            return Err(format!("{}: {what}: memory is still allocated: {held:?}", self.session.name));
        }
        match self.log.take().first() {
            Some(message) => Err(format!("{}: {what}: {message}", self.session.name)),
            None => Ok(()),
        }
    }

    pub(super) fn same(&self, what: &str, pictures: &Pictures, expected: &Pictures) -> Outcome<()> {
        for (name, picture) in pictures {
            // Frames in flight share a name: each image must equal one of them.
            if !expected.iter().any(|(other, bytes)| other == name && bytes == picture) {
                return Err(format!("{}: {what}: {name} is a different image", self.session.name));
            }
        }
        Ok(())
    }

    /// Checks that an error names the injected failure.
    pub(super) fn check_error(&self, what: &str, error: &Error) -> Outcome<()> {
        let failed = self.injection.last_failed().unwrap_or("none");
        let fits = match error {
            Error::Vulkan { call, result } => {
                *call == failed && Some(*result) == self.injection.last_result()
            }
            Error::Allocation { .. } => ["vkAllocateMemory", "vkMapMemory"].contains(&failed),
            Error::Unsupported { .. } => failed == "vkGetPhysicalDeviceImageFormatProperties",
            _ => false,
        };
        if fits { Ok(()) } else { Err(format!("{}: {what}: reported as: {error}", self.session.name)) }
    }
}

pub(super) fn name_of(names: &[&'static str], call: u64) -> &'static str {
    usize::try_from(call)
        .ok()
        .and_then(|i| names.get(i.checked_sub(1)?))
        .copied()
        .unwrap_or("beyond the last call")
}

/// Selects at most `most` calls of each function, evenly spaced and including the last. Two calls that name objects
/// are enough.
pub(super) fn spread(names: &[&'static str], most: usize, wanted: impl Fn(u64, &str) -> bool) -> Vec<u64> {
    let mut of: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for (call, name) in (1..).zip(names).filter(|(call, name)| wanted(*call, name)) {
        of.entry(name).or_default().push(call);
    }
    let few = |(name, calls): (&str, Vec<u64>)| {
        let most = if name == "vkSetDebugUtilsObjectNameEXT" { most.min(2) } else { most };
        let step = calls.len().div_ceil(most.max(1)).max(1);
        calls.into_iter().rev().step_by(step).collect::<Vec<_>>()
    };
    let mut calls: Vec<u64> = of.into_iter().flat_map(few).collect();
    calls.sort_unstable();
    calls
}
