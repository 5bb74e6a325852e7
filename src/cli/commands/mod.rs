//! The commands, one file or folder each.
//!
//! Commands use `input`, `plot` and the files beside this folder, never one another; `dispatch` runs them.

pub(crate) mod bench;
pub(crate) mod calibrate;
pub(crate) mod compare;
pub(crate) mod convert;
pub(crate) mod devices;
pub(crate) mod info;
pub(crate) mod pipelines;
pub(crate) mod provoke;
pub(crate) mod reference;
pub(crate) mod render;
pub(crate) mod schema;
pub(crate) mod selftest;
pub(crate) mod techniques;
#[cfg(any(test, feature = "window"))]
pub(crate) mod view;
