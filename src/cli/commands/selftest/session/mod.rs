//! Whole sessions with a device, from data to images, and the same sessions with calls that fail and devices that are lost.
//!
//! Uses nothing but the library: `tests/failures.rs` compiles this folder too.

mod harness;
mod sessions;
mod sweeps;

pub(crate) use harness::{Place, Swept};
pub(crate) use sessions::{Session, sessions};
pub(crate) use sweeps::{fail_each, fail_frames, fail_opening, lose};
