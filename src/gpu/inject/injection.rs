//! The counter of calls, and the decision which of them fail.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk;

pub(super) const LOST: vk::Result = vk::Result::ERROR_DEVICE_LOST;

/// Counts the Vulkan calls of one [`Gpu`](crate::gpu::Gpu) and makes some of them fail; for tests.
///
/// A test passes a clone in [`GpuOptions::inject`](crate::gpu::GpuOptions::inject) and keeps another: clones share one
/// count. It counts every call that returns a `VkResult`, from the first call of the loader on, including calls of the memory
/// allocator and of callers through [`Gpu::handles`](crate::gpu::Gpu::handles). A call that fails does not reach the driver;
/// its outputs are unchanged, or null where Vulkan requires that.
#[derive(Clone, Debug, Default)]
pub struct Injection {
    state: Arc<Mutex<State>>,
}

#[derive(Debug, Default)]
struct State {
    calls: u64,
    fail: Option<(u64, vk::Result)>,
    lose: Option<u64>,
    lost: bool,
    failed: Option<(&'static str, vk::Result)>,
    failures: u64,
    names: Option<Vec<&'static str>>,
}

impl Injection {
    /// Makes a counter that lets every call pass.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the number of calls so far, including those that failed.
    #[must_use]
    pub fn calls(&self) -> u64 {
        self.lock().calls
    }

    /// Makes call number `call` fail once; the first is number 1. It returns `result` if Vulkan allows that for the call, else
    /// the first error that it may return; a call that cannot fail passes. `ERROR_DEVICE_LOST` acts as
    /// [`Injection::lose_at`].
    pub fn fail_at(&self, call: u64, result: vk::Result) {
        if result == vk::Result::ERROR_DEVICE_LOST {
            return self.lose_at(call);
        }
        self.lock().fail = Some((call, result));
    }

    /// Loses the device at call number `call`: from there on every call that can return `ERROR_DEVICE_LOST` does, and other
    /// calls pass. Earlier submissions have ended then.
    pub fn lose_at(&self, call: u64) {
        self.lock().lose = Some(call);
    }

    /// Restarts the count, with no failure and no loss.
    pub fn rewind(&self) {
        let mut state = self.lock();
        let names = state.names.take().map(|_| Vec::new());
        *state = State { names, ..State::default() };
    }

    /// Returns the last call that was made to fail.
    #[must_use]
    pub fn last_failed(&self) -> Option<&'static str> {
        self.lock().failed.map(|(name, _)| name)
    }

    /// Returns the result of the last call that was made to fail.
    #[must_use]
    pub fn last_result(&self) -> Option<vk::Result> {
        self.lock().failed.map(|(_, result)| result)
    }

    /// Returns how many calls were made to fail.
    #[must_use]
    pub fn failures(&self) -> u64 {
        self.lock().failures
    }

    /// Starts or stops keeping the names of calls.
    pub fn keep_names(&self, keep: bool) {
        self.lock().names = keep.then(Vec::new);
    }

    /// Returns the names of the calls since [`Injection::keep_names`] or [`Injection::rewind`], in order.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.lock().names.clone().unwrap_or_default()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Poison is ignored: no statement here panics half-way.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a call. Returns the error with which it fails, and whether it is the first call of a lost device.
    pub(super) fn enter(&self, info: &Info) -> Option<(vk::Result, bool)> {
        let mut state = self.lock();
        state.calls += 1;
        if let Some(names) = &mut state.names {
            names.push(info.name);
        }
        let call = state.calls;
        let error = if state.lose.is_some_and(|at| call >= at) && info.errors.contains(&LOST) {
            LOST
        } else {
            let (_, wanted) = state.fail.filter(|&(at, _)| at == call)?;
            let mut allowed = info.errors.iter().copied().filter(|&error| error != LOST);
            allowed.clone().find(|&error| error == wanted).or_else(|| allowed.next())?
        };
        state.failed = Some((info.name, error));
        state.failures += 1;
        Some((error, error == LOST && !std::mem::replace(&mut state.lost, true)))
    }
}

/// A call, and the errors that Vulkan 1.3 allows for it, the likeliest first.
pub(super) struct Info {
    pub(super) name: &'static str,
    pub(super) errors: &'static [vk::Result],
}
