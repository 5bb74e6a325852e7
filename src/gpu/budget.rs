//! The account of device memory: every allocation is checked against the budget first, because some drivers never report
//! that memory is exhausted.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};

/// The account of one device.
#[derive(Debug)]
pub(crate) struct Budget {
    total: u64,
    live: Mutex<Live>,
}

#[derive(Debug, Default)]
struct Live {
    next: u64,
    used: u64,
    entries: BTreeMap<u64, (String, u64)>,
}

/// The memory of one object, returned to the budget on drop.
#[derive(Debug)]
pub(crate) struct Reservation {
    budget: Arc<Budget>,
    key: u64,
}

impl Budget {
    pub(crate) fn new(total: u64) -> Arc<Self> {
        Arc::new(Self { total, live: Mutex::default() })
    }

    /// Returns the whole budget, in bytes.
    pub(crate) fn total(&self) -> u64 {
        self.total
    }

    /// Returns the bytes in use.
    pub(crate) fn used(&self) -> u64 {
        self.lock().used
    }

    /// Returns name and bytes of the live allocations, oldest first.
    pub(crate) fn entries(&self) -> Vec<(String, u64)> {
        self.lock().entries.values().cloned().collect()
    }

    /// Checks that `bytes` more fit, without reserving them.
    pub(crate) fn check(&self, object: &str, bytes: u64) -> Result<()> {
        self.fits(self.used(), object, bytes)
    }

    /// Reserves `bytes` for `object`.
    pub(crate) fn reserve(self: &Arc<Self>, object: &str, bytes: u64) -> Result<Reservation> {
        let mut live = self.lock();
        self.fits(live.used, object, bytes)?;
        let key = live.next;
        live.next += 1;
        live.used += bytes;
        live.entries.insert(key, (object.to_string(), bytes));
        Ok(Reservation { budget: Arc::clone(self), key })
    }

    fn fits(&self, used: u64, object: &str, bytes: u64) -> Result<()> {
        let available = self.total.saturating_sub(used);
        if bytes > available {
            return Err(Error::Memory {
                object: object.to_string(),
                needed: bytes,
                available,
                budget: self.total,
            });
        }
        Ok(())
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Live> {
        // Poison is ignored: the account stays consistent, since no statement here panics half-way.
        self.live.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        let mut live = self.budget.lock();
        if let Some((_, bytes)) = live.entries.remove(&self.key) {
            live.used -= bytes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_what_does_not_fit_and_gives_back_on_drop() {
        let budget = Budget::new(100);
        let first = budget.reserve("first", 60).unwrap();
        let error = budget.reserve("second", 41).unwrap_err();
        assert_eq!(
            error.to_string(),
            "second: needs 41 bytes of device memory, 40 are left of the budget of 100"
        );
        assert!(budget.check("second", 41).is_err());
        let second = budget.reserve("second", 40).unwrap();
        assert_eq!(budget.entries(), [("first".to_string(), 60), ("second".to_string(), 40)]);
        drop(first);
        assert_eq!(budget.used(), 40);
        drop(second);
        assert_eq!(budget.used(), 0);
        assert!(budget.entries().is_empty());
    }
}
