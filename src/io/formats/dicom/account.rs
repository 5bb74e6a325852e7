//! Memory taken for headers, counted file by file.

use crate::error::Result;
use crate::io::file::budget::Budget;
use crate::num;

/// Counts the memory taken from a budget for each file.
pub(crate) struct Account<'b> {
    pub(crate) budget: Budget<'b>,
    /// Bytes taken for the current file.
    pub(crate) taken: u64,
    /// Whether the budget was exceeded, which does not mean that a file is damaged.
    pub(crate) full: bool,
}

impl<'b> Account<'b> {
    pub(crate) fn new(budget: Budget<'b>) -> Self {
        Self { budget, taken: 0, full: false }
    }

    pub(crate) fn take(&mut self, place: &str, bytes: u64) -> Result<()> {
        self.budget.take(place, bytes).inspect_err(|_| self.full = true)?;
        self.taken = self.taken.saturating_add(bytes);
        Ok(())
    }

    /// Takes the memory of `count` values of a type.
    pub(crate) fn take_for<T>(&mut self, count: usize) -> Result<()> {
        self.take("header", num::wide(count.saturating_mul(size_of::<T>())))
    }
}
