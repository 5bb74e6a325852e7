//! Harness.

use std::collections::BTreeMap;
use std::sync::Arc;

use volraster::ash::vk;
use volraster::gpu::{Gpu, Injection, Validation, ValidationLog};
use volraster::{Error, Result};

use super::sessions::{Pictures, Session, open};

/// Calls whose failure need not be told, and what is done instead.
pub(crate) const HARMLESS: [(&str, &str); 7] = [
    ("vkSetDebugUtilsObjectNameEXT", "the object has no name"),
    (
        "vkAllocateMemory",
        "staging memory is asked for a second time, of a kind that the device need not be fast at",
    ),
    ("vkMapMemory", "the same"),
    ("vkGetPipelineCacheData", "pipelines are built anew the next time"),
    ("vkDeviceWaitIdle", "before the device's end, when every submission has been waited for already"),
    ("vkWaitForFences", "where an object is dropped with a submission that may run: waited for again"),
    ("vkEndCommandBuffer", "between the parts of a frame: it goes on in the same command buffer"),
];

/// Where sessions with failures are run.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    pub(crate) device: Option<String>,
    pub(crate) validation: Validation,
}

/// What a sweep has gone through.
#[derive(Debug, Default)]
pub(crate) struct Swept {
    /// Calls of the session.
    pub(crate) calls: u64,
    /// Calls that were made to fail, by name.
    pub(crate) failed: BTreeMap<&'static str, u32>,
    /// Those of them after which the session went on.
    pub(crate) harmless: u32,
}

impl Swept {
    pub(super) fn tell(
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
                    return Err(format!("{}: {what}: failed, and nobody was told", harness.session.name));
                }
                self.harmless += 1;
                harness.same(what, &pictures, expected)
            }
            Err(error) => harness.told(what, &error),
        }
    }
}

/// What is wrong, in one line.
pub(crate) type Finding = String;

/// What came of a session with failures in the way.
pub(super) type Outcome<T> = std::result::Result<T, Finding>;

/// The errors that take turns; what a call may not return becomes what it may.
pub(super) const RESULTS: [vk::Result; 4] = [
    vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
    vk::Result::ERROR_OUT_OF_HOST_MEMORY,
    vk::Result::ERROR_OUT_OF_POOL_MEMORY,
    vk::Result::ERROR_INITIALIZATION_FAILED,
];

/// A device on which calls fail, with what is heard of it.
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

    /// A finding, unless nothing is held and nothing was said.
    pub(super) fn clean(&self, what: &str, gpu: Option<&Gpu>) -> Outcome<()> {
        let held = gpu.map(Gpu::memory_report).unwrap_or_default();
        if !held.is_empty() {
            return Err(format!("{}: {what}: memory is held: {held:?}", self.session.name));
        }
        match self.log.take().first() {
            Some(message) => Err(format!("{}: {what}: {message}", self.session.name)),
            None => Ok(()),
        }
    }

    pub(super) fn same(&self, what: &str, pictures: &Pictures, expected: &Pictures) -> Outcome<()> {
        for (name, picture) in pictures {
            // Frames in flight have the same name: each must be one of them.
            if !expected.iter().any(|(other, bytes)| other == name && bytes == picture) {
                return Err(format!("{}: {what}: {name} is another picture", self.session.name));
            }
        }
        Ok(())
    }

    /// Whether an error is what is to be told of a call that failed on request.
    pub(super) fn told(&self, what: &str, error: &Error) -> Outcome<()> {
        let failed = self.injection.last_failed().unwrap_or("none");
        let fits = match error {
            Error::Vulkan { call, result } => {
                *call == failed && Some(*result) == self.injection.last_result()
            }
            Error::Allocation { .. } => ["vkAllocateMemory", "vkMapMemory"].contains(&failed),
            Error::Unsupported { .. } => failed == "vkGetPhysicalDeviceImageFormatProperties",
            _ => false,
        };
        if fits { Ok(()) } else { Err(format!("{}: {what}: told as: {error}", self.session.name)) }
    }
}

pub(super) fn name_of(names: &[&'static str], call: u64) -> &'static str {
    usize::try_from(call)
        .ok()
        .and_then(|i| names.get(i.checked_sub(1)?))
        .copied()
        .unwrap_or("beyond the last call")
}

/// At most `most` calls of each name, as far from each other as can be, the last one among them. Two namings of objects stand
/// for all.
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
