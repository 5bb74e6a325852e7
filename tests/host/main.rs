//! Files, scenes and documents: tests that open no device.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::too_many_lines,
    unreachable_pub,
    missing_debug_implementations,
    reason = "a test fails by panicking"
)]

#[path = "../common/folder.rs"]
mod folder;

mod contract;
mod formats;
mod io;
mod mesh_scenes;
mod point_scenes;
mod rooms;
mod scenes;
