//! Readers and writers for data files, writers for images.
//!
//! A reader implements `Reader` and is listed in `READERS`; only `folder` names those that have slices in
//! files of their own. What formats share:
//!
//! | file | what |
//! |---|---|
//! | `source` | a file on disk or in memory, its siblings, packed streams, the budget of memory |
//! | `text`, `fields` | lines, words and numbers with their places; headers of named values |
//! | `samples` | types, byte orders, and decoding within the memory that the result takes |
//! | `volume` | components, and data in several files, of grids |
//! | `arrays`, `dataset` | which array is shown; from cells and arrays to a mesh or points |
//! | `lattice` | from points on a lattice to a grid; resampling |
//! | `folder` | slices in files of their own |
//! | `jpeg` | what a JPEG stream says of itself, before it is decoded |
//! | `columns` | vectors and tensors of columns that are named one by one |
//! | `triangles`, `obj` | triangle meshes, of PLY and OBJ |
//! | `refused` | formats that are known by name only |
//! | `write_nrrd`, `write_vtu`, `image` | what is written |
//!
//! Sizes are checked against the file and the memory limit before memory is taken, compressed streams are
//! read no further than one byte past what the header announces, and what is missing or left over is an
//! error.

mod arrays;
mod columns;
mod csv;
mod dataset;
mod dicom;
mod fields;
mod folder;
mod gmsh;
mod image;
mod jpeg;
mod lattice;
mod metaimage;
mod nifti;
mod npy;
mod nrrd;
mod obj;
mod options;
mod ply;
mod raw;
mod refused;
mod samples;
pub mod scene_file;
mod source;
mod text;
mod tiff;
mod triangles;
mod volume;
mod vtk_blocks;
mod vtk_document;
mod vtk_legacy;
mod vtk_xml;
mod write_nrrd;
mod write_vtu;

use std::io::Write as _;
use std::path::Path;

use crate::error::{Error, Result};
pub use crate::scene::Data;
use crate::scene::{Grid, Rescale};

pub use arrays::{ArrayInfo, Association, Pick};
pub(crate) use image::replace;
pub use image::{read_exr, write_exr, write_image, write_png};
pub use options::{Progress, ReadOptions};
pub(crate) use raw::{Described, describes_raw, load_raw};
pub use raw::{RawLayout, read_raw};
pub use samples::{Endian, SampleType};
use source::Source;
pub use triangles::{Triangles, read_triangles, read_triangles_memory};
pub use write_nrrd::write_nrrd;
pub use write_vtu::write_vtu;

/// What a person may want to know of how a file was read.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Report {
    /// The format.
    pub format: &'static str,
    /// The arrays of the file, where it has several or names them.
    pub arrays: Vec<ArrayInfo>,
    /// The array that was read, as [`ReadOptions::array`] would name it.
    pub shown: Option<String>,
    /// What was done to the data.
    pub notes: Vec<String>,
    /// What may not be as it seems.
    pub warnings: Vec<String>,
}

/// Data, and how it was read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The data.
    pub data: Data,
    /// How it was read.
    pub report: Report,
}

impl Loaded {
    fn new(format: &'static str, data: impl Into<Data>) -> Self {
        Self { data: data.into(), report: Report { format, ..Report::default() } }
    }
}

/// A file format.
trait Reader: Sync {
    /// The format's name, for messages.
    fn name(&self) -> &'static str;
    /// The usual endings of file names, without the leading dot.
    fn extensions(&self) -> &'static [&'static str];
    /// Whether the file's first bytes are this format's.
    fn recognises(&self, source: &Source) -> bool;
    /// Reads the file.
    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded>;
}

/// Every format that [`read`] knows, in the order in which they are asked.
static READERS: &[&dyn Reader] = &[
    &nrrd::Nrrd,
    &nifti::Nifti,
    &metaimage::MetaImage,
    &npy::Npy,
    &vtk_xml::VtkXml,
    &vtk_legacy::VtkLegacy,
    &gmsh::Gmsh,
    &ply::Ply,
    &csv::Csv,
    &tiff::Tiff,
    &dicom::Dicom,
    &raw::Raw,
];

/// One line that names the formats that [`read`] knows, with their file name endings.
#[must_use]
pub fn known_formats() -> String {
    let one = |reader: &&dyn Reader| {
        let endings: Vec<String> = reader.extensions().iter().map(|ending| format!(".{ending}")).collect();
        format!("{} ({})", reader.name(), endings.join(", "))
    };
    READERS.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Reads a data file in any known format. Content decides; the file name's ending is asked only when no
/// format knows the content. A folder is read as the slices in it, or as the one data file that it holds.
///
/// # Errors
///
/// [`Error::Io`] if a file cannot be read; [`Error::File`] if no format fits, the contents break a rule
/// of the format, or the data would take more than `options.max_bytes`.
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

/// The same for files in memory: the first is read, and finds the others by the names that it has for
/// them.
///
/// # Errors
///
/// As [`read`]; [`Error::Invalid`] if there is no file.
pub fn read_memory(files: &[(&str, &[u8])], options: &ReadOptions) -> Result<Loaded> {
    read_source(&Source::in_memory(files)?, options)
}

/// Reads a file that holds a grid: see [`read`].
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

fn read_source(source: &Source, options: &ReadOptions) -> Result<Loaded> {
    let known = by_content(source);
    if known.is_none()
        && let Some(refusal) = refused::by_content(source)
    {
        return Err(refusal);
    }
    let Some(reader) = known.or_else(|| by_name(source)) else {
        return Err(refused::by_name(source).unwrap_or_else(|| {
            if source.is_gzip() {
                return source.error(
                    "content",
                    "a gzip stream: only NIfTI-1, raw samples, VTK, Gmsh, PLY and CSV are read packed, unpack it \
                     first",
                );
            }
            source.error(
                "content",
                format!(
                    "of no known format: known are {}; raw samples need size and type in their name, as \
                     head_256x256x128_int16.raw, in a JSON file beside them, or in a scene file",
                    known_formats()
                ),
            )
        }));
    };
    checked(source.path(), reader.read(source, options)?, options)
}

/// What was asked for must not be passed over in silence: a grid has no kernels, and a format without names
/// reads what there is.
fn checked(path: &Path, mut loaded: Loaded, options: &ReadOptions) -> Result<Loaded> {
    if let Data::Grid(grid) = &loaded.data {
        options.check_kernels("a grid").map_err(|error| error.in_file(path))?;
        let Rescale { slope, intercept } = grid.rescale();
        if !grid.range().iter().all(|value| value.is_finite()) {
            let rule = format!("{slope:e} * stored + {intercept:e}: goes beyond the range of numbers");
            return Err(Error::file(path, "rescale", rule));
        }
        if grid.infinite_count() > 0 {
            loaded.report.warnings.push(format!(
                "{} samples are infinite, or beyond f32: they take the transfer function's ends",
                grid.infinite_count()
            ));
        }
    }
    if let Some(array) = &options.array
        && loaded.report.arrays.is_empty()
        && loaded.report.shown.is_none()
    {
        let rule = "no such array: there is one without a name";
        return Err(Error::file(path, format!("array \"{array}\""), rule));
    }
    Ok(loaded)
}

/// The reader that knows a file's content.
fn by_content(source: &Source) -> Option<&'static dyn Reader> {
    READERS.iter().find(|reader| reader.recognises(source)).copied()
}

/// The reader whose files have such a name.
fn by_name(source: &Source) -> Option<&'static dyn Reader> {
    let name = source.path().file_name()?.to_string_lossy().to_lowercase();
    let is = |ending: &&str| name.strip_suffix(ending).is_some_and(|stem| stem.ends_with('.'));
    READERS.iter().find(|reader| reader.extensions().iter().any(is)).copied()
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
