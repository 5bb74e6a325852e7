//! Values that are built when they are first asked for.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Result;

/// The place of one value; empty until a build has succeeded.
type Slot<V> = Arc<Mutex<Option<V>>>;

/// A value for each key, built when it is first asked for. Clones share the values.
#[derive(Clone, Debug)]
pub(crate) struct Cache<K, V>(Arc<Mutex<HashMap<K, Slot<V>>>>);

impl<K, V> Default for Cache<K, V> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<K: Eq + Hash, V: Clone> Cache<K, V> {
    /// Returns the value of a key, built unless it is known.
    ///
    /// If several threads ask for a key at once, one builds the value and the others wait; other keys are not blocked.
    /// After a failed build the next caller tries again. `build` must not ask for its own key.
    pub(crate) fn get(&self, key: K, build: impl FnOnce() -> Result<V>) -> Result<V> {
        let mut slots = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let slot = Arc::clone(slots.entry(key).or_default());
        drop(slots);
        let mut value = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = &*value {
            return Ok(known.clone());
        }
        Ok(value.insert(build()?).clone())
    }

    /// Forgets the value of a key.
    pub(crate) fn forget(&self, key: &K) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(key);
    }

    /// Returns whether the value of a key is known, or is being built.
    pub(crate) fn has(&self, key: &K) -> bool {
        let slots = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A value that is being built holds the lock; one whose build has failed is not there.
        slots.get(key).is_some_and(|slot| slot.try_lock().map_or(true, |value| value.is_some()))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::sync::{Barrier, mpsc};
    use std::time::Duration;

    use super::*;
    use crate::error::Error;

    #[test]
    fn eight_threads_build_a_value_once() {
        let (cache, built, start) = (Cache::default(), AtomicU32::new(0), Barrier::new(8));
        let ask = |cache: Cache<u32, u32>| {
            start.wait();
            cache.get(5, || {
                std::thread::sleep(Duration::from_millis(50));
                Ok(built.fetch_add(1, Ordering::Relaxed))
            })
        };
        std::thread::scope(|scope| {
            let threads = [(); 8].map(|()| scope.spawn(|| ask(cache.clone())));
            assert!(threads.into_iter().all(|thread| thread.join().unwrap().unwrap() == 0));
        });
        assert_eq!(built.into_inner(), 1);
    }

    #[test]
    fn a_failed_build_is_tried_again() {
        let cache = Cache::default();
        let failed = cache.get((), || Err(Error::invalid("value", "too large")));
        assert_eq!(failed.unwrap_err().to_string(), "invalid value: too large");
        let panics = std::panic::AssertUnwindSafe(|| cache.get((), || panic!("ends the build")));
        assert!(std::panic::catch_unwind(panics).is_err());
        assert_eq!(cache.get((), || Ok(7)).unwrap(), 7);
        assert_eq!(cache.get((), || Ok(8)).unwrap(), 7);
    }

    #[test]
    fn a_build_blocks_no_other_key() {
        let cache = Cache::default();
        assert_eq!(cache.get(1, || Ok(10)).unwrap(), 10);
        let (send, receive) = mpsc::channel();
        std::thread::scope(|scope| {
            let slow = cache.get(0, || {
                scope.spawn(|| {
                    let known = cache.get(1, || Ok(11)).unwrap();
                    let made = cache.get(2, || Ok(20)).unwrap();
                    send.send([known, made]).unwrap();
                });
                Ok(i32::from(receive.recv_timeout(Duration::from_secs(5)) == Ok([10, 20])))
            });
            assert_eq!(slow.unwrap(), 1);
        });
    }
}
