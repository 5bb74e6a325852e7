//! Writers: grids as NRRD, meshes and points as VTU, text.
//!
//! They use scene data and `replace`; the program uses them, to convert files and to write reports.

pub(crate) mod nrrd;
pub(crate) mod vtu;

use std::io::Write as _;
use std::path::Path;

use crate::error::Result;
use crate::replace::{self, replace};

/// Writes a text file completely or not at all.
///
/// # Errors
///
/// [`Error::File`](crate::Error::File) if the path must not be replaced, [`Error::Io`](crate::Error::Io) if it cannot be written; no partial file remains.
pub fn write_text(path: impl AsRef<Path>, text: &str) -> Result<()> {
    replace(path.as_ref(), |writer| writer.write_all(text.as_bytes()))
}

/// Checks that a file of this path can be written, without writing it: programs ask before long work.
///
/// Regular files are written beside their place and renamed when they are complete; a symbolic link stays, and its target is replaced.
/// Pipes and character devices are written into.
///
/// # Errors
///
/// [`Error::File`](crate::Error::File) for a folder, a write-protected file, a block device and the like; [`Error::Io`](crate::Error::Io) where no file can be made.
pub fn check_writable(path: impl AsRef<Path>) -> Result<()> {
    replace::check_writable(path.as_ref())
}
