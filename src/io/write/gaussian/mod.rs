//! Writers of Gaussian splats: PLY, plain and compressed, and SPZ.

mod codes;
mod packed;
mod plain;
mod spz;

use std::path::Path;

use crate::error::{Error, Result};
use crate::io::write::OutputFormat;
use crate::scene::Gaussians;

/// How Gaussian splats are written.
#[derive(Clone, Debug)]
pub struct GaussiansOutput {
    /// The version of SPZ files: 3 or 4.
    pub spz_version: u32,
    /// Texts about licence and authors, which PLY files keep as comments.
    pub texts: Vec<String>,
}

impl Default for GaussiansOutput {
    fn default() -> Self {
        Self { spz_version: 4, texts: Vec::new() }
    }
}

/// Writes Gaussian splats in the format of the file name, turned into the axes of the format: right, down, front for PLY, right,
/// up, back for SPZ. Returns notes on what the format cannot hold as it is.
///
/// # Errors
///
/// [`Error::File`] for an ending other than `.ply`, `.compressed.ply` and `.spz`, or if the file must not be replaced;
/// [`Error::Invalid`] for another version than 3 or 4; [`Error::Io`] if it cannot be written. No partial file remains.
pub fn write_gaussians(
    path: impl AsRef<Path>,
    splats: &Gaussians,
    output: &GaussiansOutput,
) -> Result<Vec<String>> {
    let path = path.as_ref();
    match OutputFormat::of(path)? {
        OutputFormat::GaussianPly => plain::write(path, splats, &output.texts),
        OutputFormat::CompressedPly => packed::write(path, splats, &output.texts),
        OutputFormat::Spz => spz::write(path, splats, output.spz_version),
        _ => Err(Error::file(path, "file name", "must end in .ply, .compressed.ply or .spz for gaussians")),
    }
}
