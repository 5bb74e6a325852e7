//! A device on which calls fail, and the checks after each failure.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::Arc;

use volraster::ash::vk;
use volraster::gpu::{Gpu, GpuOptions, Injection, PipelineCache, ValidationLog};
use volraster::{Error, Result};

use super::sessions::{Pictures, Session};

/// Calls whose failure is not reported to the caller.
const HARMLESS: [&str; 7] = [
    // The object has no name.
    "vkSetDebugUtilsObjectNameEXT",
    // Staging memory is requested again from a slower memory type.
    "vkAllocateMemory",
    "vkMapMemory",
    // The pipeline cache is not stored; pipelines are compiled again the next time.
    "vkGetPipelineCacheData",
    // Called before the device is destroyed, when every submission has completed already.
    "vkDeviceWaitIdle",
    // Called when an object with a pending submission is dropped; it waits again.
    "vkWaitForFences",
    // Called between the parts of a frame, which goes on in the same command buffer.
    "vkEndCommandBuffer",
];

/// The device and validation for sessions with failures.
pub(crate) type Place = GpuOptions;

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

/// The result of a check; the error is the first finding as one line of text.
pub(super) type Outcome<T> = std::result::Result<T, String>;

impl Swept {
    /// Counts a run in which a call was made to fail, and checks that the failure is reported or harmless.
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
            Ok(pictures) if HARMLESS.contains(&name) => {
                self.harmless += 1;
                harness.same(what, &pictures, expected)
            }
            Ok(_) => harness.finding(what, "failed, but no error was returned"),
            Err(error) => harness.check_error(what, &error),
        }
    }
}

/// Error codes, used in turn; a code that a call may not return is replaced by one that it may.
const RESULTS: [vk::Result; 4] = [
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

    /// Opens the device, without a pipeline cache.
    pub(super) fn open(&self) -> Result<Gpu> {
        Gpu::new(&GpuOptions {
            validation_log: Some(Arc::clone(&self.log)),
            inject: Some(self.injection.clone()),
            pipeline_cache: PipelineCache::Off,
            poison: true,
            ..self.place.clone()
        })
    }

    pub(super) fn finding<T>(&self, what: &str, text: impl Display) -> Outcome<T> {
        Err(format!("{}: {what}: {text}", self.session.name))
    }

    pub(super) fn at<T>(&self, what: &str, result: Result<T>) -> Outcome<T> {
        result.or_else(|error| self.finding(what, error))
    }

    /// Runs some work from call number 1 on, and returns its result with the names of its calls.
    pub(super) fn recorded<T>(&self, work: impl FnOnce() -> Outcome<T>) -> Outcome<(T, Vec<&'static str>)> {
        self.injection.rewind();
        self.injection.keep_names(true);
        let result = work()?;
        let names = self.injection.names();
        self.injection.keep_names(false);
        Ok((result, names))
    }

    /// Checks that the device holds no memory and that validation is silent.
    pub(super) fn clean(&self, what: &str, gpu: Option<&Gpu>) -> Outcome<()> {
        let held = gpu.map(Gpu::memory_report).unwrap_or_default();
        if !held.is_empty() {
            return self.finding(what, format!("memory is still allocated: {held:?}"));
        }
        self.silent(what)
    }

    /// Checks that validation is silent.
    pub(super) fn silent(&self, what: &str) -> Outcome<()> {
        self.log.take().first().map_or(Ok(()), |message| self.finding(what, message))
    }

    pub(super) fn same(&self, what: &str, pictures: &Pictures, expected: &Pictures) -> Outcome<()> {
        // Frames in flight share a name: each image must equal one of them.
        match pictures.iter().find(|picture| !expected.contains(picture)) {
            Some((name, _)) => self.finding(what, format!("{name} is a different image")),
            None => Ok(()),
        }
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
        if fits { Ok(()) } else { self.finding(what, format!("reported as: {error}")) }
    }
}

/// Selects at most `most` calls of each function, evenly spaced and including the last, with their names and the errors
/// that they are to return. Two calls that name objects are enough.
pub(super) fn spread(
    names: &[&'static str],
    most: usize,
    wanted: impl Fn(u64, &str) -> bool,
) -> Vec<(u64, &'static str, vk::Result)> {
    let mut of: BTreeMap<&'static str, Vec<u64>> = BTreeMap::new();
    for (call, &name) in (1..).zip(names).filter(|(call, name)| wanted(*call, name)) {
        of.entry(name).or_default().push(call);
    }
    let few = |(name, calls): (&'static str, Vec<u64>)| {
        let most = if name == "vkSetDebugUtilsObjectNameEXT" { most.min(2) } else { most };
        let step = calls.len().div_ceil(most.max(1)).max(1);
        calls.into_iter().rev().step_by(step).map(move |call| (call, name))
    };
    let mut calls: Vec<_> = of.into_iter().flat_map(few).collect();
    calls.sort_unstable();
    let errors = RESULTS.into_iter().cycle();
    calls.into_iter().zip(errors).map(|((call, name), error)| (call, name, error)).collect()
}
