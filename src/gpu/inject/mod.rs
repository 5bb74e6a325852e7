//! Injected failures, for tests: every Vulkan call that may fail is counted, and one of them, or all from one on, fails without
//! reaching the driver.
//!
//! A hooked loader returns other entry points. Entry points are plain functions without data, so each hooked instance takes
//! one of a few slots, and each slot has its own copy of the functions, by a constant parameter. The function alone thus
//! decides which counter a call belongs to, independent of handles, threads and layers. Instances without a hook are not
//! affected.

mod calls;
mod hook;
mod injection;

pub(super) use hook::Hook;
pub use injection::Injection;
