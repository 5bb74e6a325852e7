//! Failures on request: every Vulkan call that may fail is counted, and one of them, or all from one on, fails without
//! reaching the driver.
//!
//! A loader that is hooked hands out other entry points. Those are plain functions without data of their own, so each hooked
//! instance takes one of a few places, and each place has its own copy of them, by a constant parameter: which counts a call
//! goes to follows from the function alone, not from handles, whatever thread calls, and whichever layer made the handle.
//! Nothing of this is in the way of an instance that is opened without it.

mod calls;
mod hook;
mod injection;

pub(super) use hook::Hook;
pub use injection::Injection;
