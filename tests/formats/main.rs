//! Data files: every format in every encoding, real files, hostile ones.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    unreachable_pub,
    dead_code,
    reason = "a test fails by panicking, and makes its own numbers"
)]

mod container;
mod csv;
mod gmsh;
mod metaimage;
mod mutations;
mod nifti;
mod npy;
mod nrrd;
mod ply;
mod raw;
mod real;
mod refused;
mod support;
mod tiff;
mod vtk_legacy;
mod vtk_xml;
mod write;

/// The samples of each fuzz target.
fn seeds() -> Vec<(&'static str, Vec<support::Sample>)> {
    vec![("nifti", nifti::samples())]
}
