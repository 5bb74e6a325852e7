//! The counter of calls, and which of them fail.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk;

pub(super) const LOST: vk::Result = vk::Result::ERROR_DEVICE_LOST;

/// Counts the Vulkan calls of one [`Gpu`](crate::gpu::Gpu) and makes some of them fail; for tests. Given in
/// [`GpuOptions::inject`](crate::gpu::GpuOptions::inject), kept by whoever steers it: clones share one count.
///
/// Counted is every call that returns a `VkResult`, from the first one of the loader on, also those of the memory allocator
/// and of callers through [`Gpu::handles`](crate::gpu::Gpu::handles). A call that fails does not reach the driver; what it would
/// have written is left as it was, or null where Vulkan says so.
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

/// What becomes of a call.
pub(super) enum Verdict {
    Pass,
    Fail(vk::Result),
    /// The first call of a lost device.
    Lose,
}

impl Injection {
    /// Counts, and lets every call pass.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Calls so far, those that failed among them.
    #[must_use]
    pub fn calls(&self) -> u64 {
        self.lock().calls
    }

    /// Lets call number `call` fail once; the first is number 1. It returns `result` where Vulkan allows that call to, and
    /// else the first error that it may return; a call that cannot fail passes. `ERROR_DEVICE_LOST` is as [`Injection::lose_at`].
    pub fn fail_at(&self, call: u64, result: vk::Result) {
        if result == vk::Result::ERROR_DEVICE_LOST {
            return self.lose_at(call);
        }
        self.lock().fail = Some((call, result));
    }

    /// Loses the device at call number `call`: from there on every call that can return `ERROR_DEVICE_LOST` does. What was
    /// submitted before has ended then, as Vulkan has it of a lost device; calls that cannot tell of the loss pass.
    pub fn lose_at(&self, call: u64) {
        self.lock().lose = Some(call);
    }

    /// Begins to count anew, with nothing to fail. A device that was lost is found again.
    pub fn rewind(&self) {
        let mut state = self.lock();
        let names = state.names.take().map(|_| Vec::new());
        *state = State { names, ..State::default() };
    }

    /// The last call that failed on request.
    #[must_use]
    pub fn last_failed(&self) -> Option<&'static str> {
        self.lock().failed.map(|(name, _)| name)
    }

    /// What it returned.
    #[must_use]
    pub fn last_result(&self) -> Option<vk::Result> {
        self.lock().failed.map(|(_, result)| result)
    }

    /// How many calls have failed on request.
    #[must_use]
    pub fn failures(&self) -> u64 {
        self.lock().failures
    }

    /// Begins to keep the names of calls, or ends it.
    pub fn keep_names(&self, keep: bool) {
        self.lock().names = keep.then(Vec::new);
    }

    /// The names of the calls since [`Injection::keep_names`] or [`Injection::rewind`], in order.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.lock().names.clone().unwrap_or_default()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Counts and names stay right when a thread panicked elsewhere: nothing here panics half-way.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a call.
    pub(super) fn enter(&self, info: &Info) -> Verdict {
        let mut state = self.lock();
        state.calls += 1;
        if let Some(names) = &mut state.names {
            names.push(info.name);
        }
        let call = state.calls;
        if state.lose.is_some_and(|at| call >= at) && info.errors.contains(&LOST) {
            state.failed = Some((info.name, LOST));
            state.failures += 1;
            return if std::mem::replace(&mut state.lost, true) {
                Verdict::Fail(LOST)
            } else {
                Verdict::Lose
            };
        }
        let Some((_, wanted)) = state.fail.filter(|&(at, _)| at == call) else { return Verdict::Pass };
        let allowed = info.errors.iter().copied().filter(|&error| error != LOST);
        let Some(error) = allowed.clone().find(|&error| error == wanted).or_else(|| allowed.clone().next())
        else {
            return Verdict::Pass;
        };
        state.failed = Some((info.name, error));
        state.failures += 1;
        Verdict::Fail(error)
    }
}

/// A call, and the errors that Vulkan 1.3 lets it return, the likeliest first.
pub(super) struct Info {
    pub(super) name: &'static str,
    pub(super) errors: &'static [vk::Result],
}
