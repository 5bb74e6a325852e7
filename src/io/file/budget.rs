//! The memory that reading one data set may still allocate.

use std::cell::Cell;
use std::rc::Rc;

use crate::error::Result;
use crate::io::file::source::Source;
use crate::io::options::ReadOptions;

/// The memory that a data set may still allocate. Clones share one account.
#[derive(Clone)]
pub(crate) struct Budget<'a> {
    source: &'a Source,
    limit: u64,
    left: Rc<Cell<u64>>,
}

impl<'a> Budget<'a> {
    pub(crate) fn new(source: &'a Source, options: &ReadOptions) -> Self {
        Self { source, limit: options.max_bytes, left: Rc::new(Cell::new(options.max_bytes)) }
    }

    /// Takes bytes from the budget, before they are allocated.
    pub(crate) fn take(&mut self, place: &str, bytes: u64) -> Result<()> {
        let left = self.left.get();
        let Some(rest) = left.checked_sub(bytes) else {
            let rule = format!("{bytes} bytes of memory: {left} are left of the limit of {}", self.limit);
            return Err(self.source.error(place, rule));
        };
        self.left.set(rest);
        Ok(())
    }

    /// Checks that bytes may be taken which are freed again.
    pub(crate) fn borrow(&mut self, place: &str, bytes: u64) -> Result<()> {
        self.take(place, bytes)?;
        self.put_back(bytes);
        Ok(())
    }

    /// Returns the bytes that may still be taken.
    pub(crate) fn left(&self) -> u64 {
        self.left.get()
    }

    /// Returns bytes to the budget after they are freed.
    pub(crate) fn put_back(&mut self, bytes: u64) {
        self.left.set(self.left.get().saturating_add(bytes).min(self.limit));
    }
}
