//! The program, the examples and a dependant crate, each run as a process.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::too_many_lines,
    unreachable_pub,
    missing_debug_implementations,
    reason = "a test fails by panicking"
)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/folder.rs"]
mod folder;

mod annotations;
mod captures;
mod cli;
mod dependant;
mod examples;
mod films;
mod gaussians;
mod large;
mod provoke;
#[cfg(feature = "mpi")]
mod ranks;
mod reports;
mod selftest;
mod splat_program;
mod surfaces;
