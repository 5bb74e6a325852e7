//! Writer of grids as NRRD, with header and samples in one file.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DVec3;

use crate::error::Result;
use crate::io::build::data_file::{Array, DataFile, Lattice};
use crate::io::file::sample_type::SampleType;
use crate::replace::replace;
use crate::scene::{Anatomy, Grid};

/// Writes a grid as NRRD0005 with gzip-compressed samples. Returns a note if values were converted.
///
/// The format has no rescale: a grid with one is written as values instead of stored numbers. These are whole numbers
/// of at most 16 bits if all values are, else 32-bit floats, or 64-bit floats if 32 bits cannot keep the values
/// distinct. NaN and infinities are kept.
///
/// # Errors
///
/// [`crate::Error::Io`] if the file cannot be written, [`crate::Error::File`] if it must not be replaced; no partial
/// file remains.
pub fn write_nrrd(path: impl AsRef<Path>, grid: &Grid) -> Result<Option<String>> {
    write(path.as_ref(), DataFile::of(&grid.clone().into(), ""))
}

/// Writes the one array of a lattice. Returns a note if values were converted.
pub(crate) fn write(path: &Path, data: DataFile) -> Result<Option<String>> {
    let (data, note) = data.rescaled();
    let (lattice, array) = data.one_array(path)?;
    let header = header(&lattice, array);
    replace(path, |writer| {
        writer.write_all(header.as_bytes())?;
        let mut packed = GzEncoder::new(writer, Compression::default());
        packed.write_all(&array.tuples.bytes)?;
        packed.finish().map(drop)
    })?;
    Ok(note)
}

fn header(lattice: &Lattice, array: &Array) -> String {
    let name = match array.info.kind {
        SampleType::U8 => "uint8",
        SampleType::I8 => "int8",
        SampleType::U16 => "uint16",
        SampleType::I16 => "int16",
        SampleType::U32 => "uint32",
        SampleType::I32 => "int32",
        SampleType::U64 => "uint64",
        SampleType::I64 => "int64",
        SampleType::F32 => "float",
        SampleType::F64 => "double",
    };
    // Without anatomy, nothing is said about the handedness of the world axes.
    let space = match lattice.anatomy {
        Anatomy::Unknown => "space dimension: 3",
        Anatomy::Ras => "space: right-anterior-superior",
        Anatomy::Lps => "space: left-posterior-superior",
        Anatomy::Las => "space: left-anterior-superior",
    };
    // The components of a tuple are the first axis.
    let [rank, size, none, kind] = match array.info.components {
        1 => ["3", "", "", ""].map(str::to_owned),
        n => ["4".to_owned(), format!("{n} "), "none ".to_owned(), "vector ".to_owned()],
    };
    let units = match lattice.unit.symbol() {
        "" => String::new(),
        unit => format!("space units: \"{unit}\" \"{unit}\" \"{unit}\"\n"),
    };
    let vector = |v: DVec3| format!("({:?},{:?},{:?})", v.x, v.y, v.z);
    let [nx, ny, nz] = lattice.dims;
    let [x, y, z] = lattice.steps().map(vector);
    format!(
        "NRRD0005\ntype: {name}\ndimension: {rank}\n{space}\nsizes: {size}{nx} {ny} {nz}\n\
         space directions: {none}{x} {y} {z}\nkinds: {kind}domain domain domain\nendian: little\nencoding: gzip\n\
         {units}space origin: {}\n\n",
        vector(lattice.origin)
    )
}
