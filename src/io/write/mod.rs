//! Writers: grids as NRRD, meshes and points as VTU, text.
//!
//! They use scene data and `replace`; the program uses them, to convert files and to write reports.

pub(crate) mod nrrd;
pub(crate) mod vtu;

use std::io::Write as _;
use std::path::Path;

use crate::error::Result;
use crate::replace::replace;

/// Writes a text file completely or not at all.
///
/// # Errors
///
/// [`Error::File`](crate::Error::File) if the path is a folder, [`Error::Io`](crate::Error::Io) if it cannot be written; no partial file remains.
pub fn write_text(path: impl AsRef<Path>, text: &str) -> Result<()> {
    replace(path.as_ref(), |writer| writer.write_all(text.as_bytes()))
}
