//! Reading of data files, of folders and of files in memory, in any known format.

use std::path::Path;

use crate::error::{Error, Result};
use crate::io::file::source::Source;
use crate::io::folder;
use crate::io::formats::refused;
use crate::io::options::ReadOptions;
use crate::io::registry::{checked, read_source};
use crate::io::report::Loaded;
use crate::scene::{Data, Grid};

/// Reads a data file in any known format. The content selects the format; the file name extension is used only if no
/// format recognises the content. A folder is read as a stack of slices, or as the one data file in it.
///
/// # Errors
///
/// [`Error::Io`] if a file cannot be read; [`Error::File`] if no format fits, the contents break a rule of the
/// format, or the data would take more than `options.max_bytes`.
pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Loaded> {
    let path = path.as_ref();
    if let Some(refusal) = refused::folder(path) {
        return Err(refusal);
    }
    if path.is_dir() {
        return checked(path, folder::read(path, options)?, options);
    }
    read_source(&Source::open(path, options)?, options)
}

/// Reads a data file in memory: the first of `files`, given as name and content. Files that it names are looked up
/// among the others.
///
/// # Errors
///
/// As [`read`]; [`Error::Invalid`] if there is no file.
pub fn read_memory(files: &[(&str, &[u8])], options: &ReadOptions) -> Result<Loaded> {
    read_source(&Source::in_memory(files)?, options)
}

/// Reads a file that holds a grid, as [`read`] does.
///
/// # Errors
///
/// As [`read`], and [`Error::File`] if the file holds something else.
pub fn read_grid(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Grid> {
    let path = path.as_ref();
    match read(path, options)?.data {
        Data::Grid(grid) => Ok(grid),
        other => Err(Error::file(path, "content", format!("{}: must be a grid", other.kind()))),
    }
}
