//! The C interface: its header, a C program that uses it, and its functions called as C would.

#![allow(missing_debug_implementations, unreachable_pub, reason = "a test of several files")]
#![allow(unsafe_code, reason = "plays a C program")]
#![allow(clippy::unwrap_used, clippy::panic, clippy::too_many_lines, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

#[path = "../common/mod.rs"]
mod common;
#[path = "../embed/engine.rs"]
mod engine;
#[macro_use]
mod support;

mod frames;
mod handles;
mod programs;
mod refusals;
