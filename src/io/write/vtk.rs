//! Writer of VTK's XML files: image data (`.vti`), rectilinear grids (`.vtr`) and unstructured grids (`.vtu`).
//!
//! Arrays are appended raw, in blocks that are compressed one by one. The offset of each array and the size of each
//! compressed block are written last, into space reserved for them, so that no array is held in memory twice.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::io::build::arrays::Association;
use crate::io::build::data_file::{self, DataFile, Lattice, Shape};
use crate::io::build::dataset::Dataset;
use crate::io::file::sample_type::SampleType;
use crate::num;
use crate::replace::replace;
use crate::scene::{Anatomy, Data};

/// The limit on the uncompressed size of a block, in bytes.
const BLOCK: usize = 1 << 16;

/// The number of blocks compressed in parallel.
const TOGETHER: usize = 64;

/// The number of digits of the largest offset.
const DIGITS: usize = 20;

/// Writes a mesh or points as VTU 1.0, little-endian and compressed with zlib: cells of type 10 (tetrahedra) or 1
/// (vertices), coordinates in 64-bit floats, arrays in their type in memory.
///
/// Scalars become the active array `name`, of points or cells as in memory. Points may also have the arrays `weight`,
/// `radius` and `covariance`; the last has 9 components, row by row.
///
/// # Errors
///
/// [`Error::File`] for a grid; [`Error::Io`] if the file cannot be written, [`Error::File`] if it must not be replaced; no partial
/// file remains.
pub fn write_vtu(path: impl AsRef<Path>, data: &Data, name: &str) -> Result<()> {
    if matches!(data, Data::Grid(_)) {
        return Err(Error::file(path.as_ref(), "content", "a grid: a VTU file holds a mesh or points"));
    }
    write(path.as_ref(), DataFile::of(data, name), false).map(drop)
}

/// Writes the kind of file that the shape of the data needs. Coordinates that a grid lists are written as such if
/// `listed`, or if they are uneven. Returns notes on values and meanings that are not kept.
pub(crate) fn write(path: &Path, data: DataFile, listed: bool) -> Result<Vec<String>> {
    let (DataFile { shape, arrays }, note) = data.rescaled();
    let mut notes: Vec<String> = note.into_iter().collect();
    let of = |association| {
        let own = arrays.iter().filter(move |array| array.info.association == association);
        own.map(Array::of).collect::<Vec<_>>()
    };
    let mut sections = vec![("PointData", of(Association::Point)), ("CellData", of(Association::Cell))];
    let rectilinear = |lists: &[Vec<f64>; 3]| {
        let extent = extent([0, 1, 2].map(|axis| lists[axis].len()));
        ("RectilinearGrid", format!(" WholeExtent=\"{extent}\""), format!("Extent=\"{extent}\""))
    };
    let (kind, set, piece) = match &shape {
        Shape::Uneven(lists) => {
            sections.push(coordinates(lists));
            rectilinear(lists)
        }
        Shape::Even(Lattice { listed: Some(lists), .. }) if listed => {
            sections.push(coordinates(lists));
            rectilinear(lists)
        }
        Shape::Even(lattice) => {
            notes.extend(unsaid(lattice));
            let extent = extent(lattice.dims.map(num::index));
            let set = format!(" WholeExtent=\"{extent}\" {}", placement(lattice));
            ("ImageData", set, format!("Extent=\"{extent}\""))
        }
        Shape::Cells(dataset) => {
            let Dataset { points, types, ends, nodes } = dataset;
            if ends.last().is_some_and(|&end| num::index(end) != nodes.len()) {
                return Err(Error::file(path, "cells", "more nodes than 32 bits can count"));
            }
            let places = |range: Range<usize>, bytes: &mut Vec<u8>| {
                bytes.extend(points[range].iter().flat_map(|p| p.to_array()).flat_map(f64::to_le_bytes));
            };
            let kinds = |range: Range<usize>, bytes: &mut Vec<u8>| bytes.extend(&types[range]);
            sections.push(("Points", vec![Array::new("Points", "Float64", [3, points.len(), 24], places)]));
            let kinds = Array::new("types", "UInt8", [1, types.len(), 1], kinds);
            sections.push(("Cells", vec![indices("connectivity", nodes), indices("offsets", ends), kinds]));
            let counts = format!("NumberOfPoints=\"{}\" NumberOfCells=\"{}\"", points.len(), types.len());
            ("UnstructuredGrid", String::new(), counts)
        }
    };
    let piece = Piece { kind, set, piece, sections };
    replace(path, |writer| piece.write(writer))?;
    Ok(notes)
}

/// Returns a note on the meaning of the world axes, which VTK's files do not say.
fn unsaid(lattice: &Lattice) -> Option<String> {
    let anatomy = match lattice.anatomy {
        Anatomy::Unknown => String::new(),
        anatomy => format!(" {anatomy:?}").to_uppercase(),
    };
    let unit = match lattice.unit.symbol() {
        "" => String::new(),
        unit => format!(" in {unit}"),
    };
    let said = [anatomy, unit].concat();
    (!said.is_empty()).then(|| format!("VTK's files do not say that the world axes are{said}"))
}

/// Returns the attributes that place a lattice.
fn placement(Lattice { origin, spacing, direction, .. }: &Lattice) -> String {
    let numbers = |numbers: &[f64]| numbers.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ");
    let (origin, spacing) = (numbers(&origin.to_array()), numbers(&spacing.to_array()));
    // Row by row.
    let direction = numbers(&direction.transpose().to_cols_array());
    format!("Origin=\"{origin}\" Spacing=\"{spacing}\" Direction=\"{direction}\"")
}

/// Returns the extent of a lattice with these numbers of points.
fn extent(counts: [usize; 3]) -> String {
    counts.map(|count| format!("0 {}", count.saturating_sub(1))).join(" ")
}

/// Appends the bytes of some tuples.
type Put<'a> = Box<dyn Fn(Range<usize>, &mut Vec<u8>) + Sync + 'a>;

struct Array<'a> {
    name: String,
    active: bool,
    /// The type of a component.
    kind: &'static str,
    components: usize,
    tuples: usize,
    /// The size of a tuple, in bytes.
    bytes: usize,
    put: Put<'a>,
}

impl<'a> Array<'a> {
    /// Makes an array of `[components, tuples, bytes of a tuple]`.
    fn new(
        name: &str,
        kind: &'static str,
        [components, tuples, bytes]: [usize; 3],
        put: impl Fn(Range<usize>, &mut Vec<u8>) + Sync + 'a,
    ) -> Self {
        Self { name: name.to_owned(), active: false, kind, components, tuples, bytes, put: Box::new(put) }
    }

    fn of(array: &'a data_file::Array) -> Self {
        let (info, tuples) = (&array.info, &array.tuples);
        let kind = match info.kind {
            SampleType::U8 => "UInt8",
            SampleType::I8 => "Int8",
            SampleType::U16 => "UInt16",
            SampleType::I16 => "Int16",
            SampleType::U32 => "UInt32",
            SampleType::I32 => "Int32",
            SampleType::U64 => "UInt64",
            SampleType::I64 => "Int64",
            SampleType::F32 => "Float32",
            SampleType::F64 => "Float64",
        };
        let size = tuples.size;
        let put = move |range: Range<usize>, bytes: &mut Vec<u8>| {
            bytes.extend_from_slice(&tuples.bytes[range.start * size..range.end * size]);
        };
        let name = if info.name.is_empty() { "scalar" } else { &info.name };
        let shape = [info.components, tuples.bytes.len() / size, size];
        Self { active: info.active, ..Self::new(name, kind, shape, put) }
    }
}

/// The one piece of a file.
struct Piece<'a> {
    /// The element of the data set, and its attributes.
    kind: &'static str,
    set: String,
    /// The attributes of the piece.
    piece: String,
    /// The elements of the piece and their arrays, in their order in the file.
    sections: Vec<(&'static str, Vec<Array<'a>>)>,
}

/// Returns the element of the coordinates along each axis.
fn coordinates(lists: &[Vec<f64>; 3]) -> (&'static str, Vec<Array<'_>>) {
    let mut arrays = Vec::new();
    for (axis, list) in ["x", "y", "z"].into_iter().zip(lists) {
        let put = |range: Range<usize>, bytes: &mut Vec<u8>| {
            bytes.extend(list[range].iter().flat_map(|x| x.to_le_bytes()));
        };
        arrays.push(Array::new(axis, "Float64", [1, list.len(), 8], put));
    }
    ("Coordinates", arrays)
}

fn indices<'a>(name: &str, list: &'a [u32]) -> Array<'a> {
    let put = |range: Range<usize>, bytes: &mut Vec<u8>| {
        bytes.extend(list[range].iter().flat_map(|&index| i64::from(index).to_le_bytes()));
    };
    Array::new(name, "Int64", [1, list.len(), 8], put)
}

impl Piece<'_> {
    fn write(&self, writer: &mut BufWriter<File>) -> std::io::Result<()> {
        let (header, slots) = self.header();
        writer.write_all(header.as_bytes())?;
        let begin = writer.stream_position()?;
        let mut places = Vec::new();
        for array in self.sections.iter().flat_map(|(_, arrays)| arrays) {
            places.push(writer.stream_position()? - begin);
            array.write(writer)?;
        }
        writer.write_all(b"\n  </AppendedData>\n</VTKFile>\n")?;
        for (slot, place) in slots.into_iter().zip(places) {
            writer.seek(SeekFrom::Start(slot))?;
            writer.write_all(format!("{place}\"").as_bytes())?;
        }
        Ok(())
    }

    /// Returns the text before the data, and the positions in it that receive the offsets of arrays.
    fn header(&self) -> (String, Vec<u64>) {
        let Self { kind, set, piece, sections } = self;
        let mut slots = Vec::new();
        let mut text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" version=\"1.0\" \
             byte_order=\"LittleEndian\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n  \
             <{kind}{set}>\n    <Piece {piece}>\n"
        );
        for (element, arrays) in sections {
            let active = arrays.iter().find(|array| array.active);
            let active =
                active.map_or_else(String::new, |array| format!(" Scalars=\"{}\"", escaped(&array.name)));
            text.push_str(&format!("      <{element}{active}>\n"));
            for array in arrays {
                text.push_str(&format!(
                    "        <DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" \
                     offset=\"",
                    array.kind,
                    escaped(&array.name),
                    array.components
                ));
                slots.push(num::wide(text.len()));
                // Space for the number and its closing quote.
                text.push_str(&" ".repeat(DIGITS + 1));
                text.push_str("/>\n");
            }
            text.push_str(&format!("      </{element}>\n"));
        }
        text.push_str(&format!("    </Piece>\n  </{kind}>\n  <AppendedData encoding=\"raw\">\n   _"));
        (text, slots)
    }
}

impl Array<'_> {
    /// Writes the table of blocks and the packed blocks.
    fn write(&self, writer: &mut BufWriter<File>) -> std::io::Result<()> {
        let each = BLOCK / self.bytes;
        let blocks = self.tuples.div_ceil(each);
        let table = writer.stream_position()?;
        let mut words = vec![blocks, each * self.bytes, self.tuples % each * self.bytes];
        writer.write_all(&vec![0; 8 * (words.len() + blocks)])?;
        for first in (0..blocks).step_by(TOGETHER) {
            let packed = (first..blocks.min(first + TOGETHER)).into_par_iter().map(|block| {
                let range = block * each..self.tuples.min((block + 1) * each);
                let mut bytes = Vec::with_capacity(range.len() * self.bytes);
                (self.put)(range, &mut bytes);
                let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
                encoder.write_all(&bytes).and_then(|()| encoder.finish())
            });
            for block in packed.collect::<std::io::Result<Vec<_>>>()? {
                words.push(block.len());
                writer.write_all(&block)?;
            }
        }
        let end = writer.stream_position()?;
        writer.seek(SeekFrom::Start(table))?;
        let word = |word: usize| num::wide(word).to_le_bytes();
        writer.write_all(&words.into_iter().flat_map(word).collect::<Vec<u8>>())?;
        writer.seek(SeekFrom::Start(end)).map(drop)
    }
}

/// Escapes text as an attribute value. Characters that XML cannot represent become `_`.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\t' => escaped.push_str("&#9;"),
            '\n' => escaped.push_str("&#10;"),
            '\r' => escaped.push_str("&#13;"),
            '\u{fffe}' | '\u{ffff}' => escaped.push('_'),
            control if control < ' ' => escaped.push('_'),
            other => escaped.push(other),
        }
    }
    escaped
}
