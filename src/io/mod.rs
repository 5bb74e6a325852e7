//! Readers for volume files, writers for images.
//!
//! A reader implements `GridReader` and is listed in `READERS`; nothing else names it. Readers see
//! their file through `source::Source` and decode samples with `samples::read`, which hold the rules
//! that all formats share: sizes are checked against the file and the memory limit before memory is
//! taken, compressed streams are read no further than one byte past what the header announces, and what
//! is missing or left over is an error.

mod image;
mod nifti;
mod nrrd;
mod raw;
mod samples;
mod source;

use std::io::Write as _;
use std::path::Path;

use crate::error::{Error, Result};
use crate::scene::Grid;

pub(crate) use image::replace;
pub use image::{read_exr, write_exr, write_image, write_png};
pub use raw::{RawLayout, read_raw};
pub use samples::{Endian, SampleType};
use source::Source;

/// What a reader may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadOptions {
    /// Most bytes of memory that the samples of one volume, or the pixels of one image, may occupy.
    pub max_bytes: u64,
}

impl Default for ReadOptions {
    /// 16 GiB.
    fn default() -> Self {
        Self { max_bytes: 16 << 30 }
    }
}

/// A file format that holds a regular grid.
trait GridReader: Sync {
    /// The format's name, for messages.
    fn name(&self) -> &'static str;
    /// The usual endings of file names, without the leading dot.
    fn extensions(&self) -> &'static [&'static str];
    /// Whether the file's first bytes are this format's.
    fn recognises(&self, source: &Source) -> bool;
    /// Reads the file.
    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Grid>;
}

/// Every format that [`read_grid`] knows, in the order in which they are asked.
static READERS: [&dyn GridReader; 2] = [&nrrd::Nrrd, &nifti::Nifti];

/// One line that names the formats that [`read_grid`] knows, with their file name endings.
#[must_use]
pub fn known_formats() -> String {
    let one = |reader: &&dyn GridReader| {
        let endings: Vec<String> = reader.extensions().iter().map(|ending| format!(".{ending}")).collect();
        format!("{} ({})", reader.name(), endings.join(", "))
    };
    READERS.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Reads a volume file in any known format. Content decides; the file name's ending is asked only when
/// no format knows the content.
///
/// # Errors
///
/// [`Error::Io`] if a file cannot be read; [`Error::File`] if no format fits, the contents break a rule
/// of the format, or the samples would take more than `options.max_bytes`.
pub fn read_grid(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Grid> {
    let path = path.as_ref();
    let source = Source::open(path)?;
    let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
    let named = |reader: &&&dyn GridReader| {
        reader
            .extensions()
            .iter()
            .any(|ending| name.strip_suffix(ending).is_some_and(|stem| stem.ends_with('.')))
    };
    let reader =
        READERS.iter().find(|reader| reader.recognises(&source)).or_else(|| READERS.iter().find(named));
    let Some(reader) = reader else {
        return Err(Error::file(
            path,
            "content",
            format!(
                "of no known format: known are {}; raw samples need a scene file with dims and type",
                known_formats()
            ),
        ));
    };
    reader.read(&source, options)
}

/// Writes a text file, complete or not at all.
///
/// # Errors
///
/// [`Error::File`] when the place is a folder, [`Error::Io`] when it cannot be written; nothing is left
/// behind then.
pub fn write_text(path: impl AsRef<Path>, text: &str) -> Result<()> {
    replace(path.as_ref(), |writer| writer.write_all(text.as_bytes()))
}
