//! Frames of data that the device has no room for: how many parts they are drawn in.

use crate::error::{Error, Result};

/// Most parts that are chosen; options allow as many.
pub(crate) const MOST_PARTS: u32 = 4096;

/// How often the parts are doubled where the device has less room than was estimated.
const MOST_TRIES: u32 = 6;

/// Prepares a frame in the parts that an option asks for; without one in as many as were estimated, and in twice as many as often as the
/// device lacks memory. `forget` frees what an attempt has left.
pub(crate) fn in_parts<T>(
    asked: Option<u32>,
    estimate: impl FnOnce() -> Result<u32>,
    mut prepare: impl FnMut(u32) -> Result<T>,
    forget: impl Fn(u32),
) -> Result<T> {
    let first = asked.map_or_else(estimate, Ok)?;
    let mut parts = first;
    loop {
        match prepare(parts) {
            Err(Error::Memory { .. })
                if asked.is_none() && parts >> MOST_TRIES < first && parts < MOST_PARTS =>
            {
                forget(parts);
                parts = (2 * parts).min(MOST_PARTS);
            }
            outcome => return outcome,
        }
    }
}
