//! The queue and its lock.

use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;

/// A lock that serialises uses of a queue by the caller and by this crate; Vulkan forbids that two threads use a queue at the
/// same time. The crate holds it around each of its submissions. [`Plan::record`](crate::Plan::record) submits nothing.
///
/// A closure implements it:
///
/// ```
/// # use std::sync::{Arc, Mutex};
/// # use volraster::gpu::QueueLock;
/// let mine = Arc::new(Mutex::new(())); // the engine's
/// let lock: Arc<dyn QueueLock> = Arc::new({
///     let mine = Arc::clone(&mine);
///     move |work: &mut dyn FnMut()| {
///         let _held = mine.lock();
///         work();
///     }
/// });
/// ```
pub trait QueueLock: Send + Sync {
    /// Runs `work` once, before it returns, while no other thread uses the queue.
    fn hold(&self, work: &mut dyn FnMut());
}

impl<F: Fn(&mut dyn FnMut()) + Send + Sync> QueueLock for F {
    fn hold(&self, work: &mut dyn FnMut()) {
        self(work);
    }
}

/// A queue and its lock.
pub(super) struct Queue {
    raw: vk::Queue,
    lock: Arc<dyn QueueLock>,
}

impl Queue {
    /// Wraps a queue; without a lock it gets one of its own.
    pub(super) fn new(raw: vk::Queue, lock: Option<Arc<dyn QueueLock>>) -> Self {
        let own = Mutex::new(());
        let hold = move |work: &mut dyn FnMut()| {
            // Poison is ignored: the lock guards no data that a panic could leave half changed.
            let _held = own.lock().unwrap_or_else(PoisonError::into_inner);
            work();
        };
        Self { raw, lock: lock.unwrap_or_else(|| Arc::new(hold)) }
    }

    /// Runs `work` with the queue, under the lock.
    pub(super) fn with<R>(&self, work: impl FnOnce(vk::Queue) -> R) -> R {
        let mut work = Some(work);
        let mut result = None;
        let mut once = || {
            if let Some(work) = work.take() {
                result = Some(work(self.raw));
            }
        };
        self.lock.hold(&mut once);
        // A lock that did not run the work broke its contract; the work is run nevertheless.
        once();
        match result {
            Some(result) => result,
            // Work that has begun has no result only if it panicked and the lock caught the panic.
            None => std::panic::resume_unwind(Box::new("the work with a queue panicked")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_runs_once_under_the_lock_whatever_the_lock_does() {
        let held = Arc::new(Mutex::new(()));
        let inside = Arc::clone(&held);
        let lock: Arc<dyn QueueLock> = Arc::new(move |work: &mut dyn FnMut()| {
            let _held = inside.lock();
            work();
        });
        let none: Arc<dyn QueueLock> = Arc::new(|_: &mut dyn FnMut()| {});
        let twice: Arc<dyn QueueLock> = Arc::new(|work: &mut dyn FnMut()| {
            work();
            work();
        });
        for (lock, locked) in [(None, false), (Some(lock), true), (Some(none), false), (Some(twice), false)] {
            let queue = Queue::new(vk::Queue::null(), lock);
            let mut count = 0;
            let seen = queue.with(|_| {
                count += 1;
                held.try_lock().is_err()
            });
            assert_eq!((count, seen), (1, locked));
        }
    }
}
