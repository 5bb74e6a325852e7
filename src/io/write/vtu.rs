//! Writer of meshes and points as VTU, VTK's XML format of unstructured grids.
//!
//! Arrays are appended raw, in blocks that are compressed one by one. The offset of each array and the size of each
//! compressed block are written last, into space reserved for them, so that no array is held in memory twice.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::num;
use crate::replace::replace;
use crate::scene::{Data, KernelSize, Points, TetScalars, Tets};

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
    let path = path.as_ref();
    let file = match data {
        Data::Mesh(mesh) => of_mesh(mesh, name),
        Data::Points(points) => of_points(points, name),
        Data::Grid(_) => {
            return Err(Error::file(path, "content", "a grid: a VTU file holds a mesh or points"));
        }
    };
    replace(path, |writer| file.write(writer))
}

/// Appends the bytes of some tuples.
type Put<'a> = Box<dyn Fn(Range<usize>, &mut Vec<u8>) + Sync + 'a>;

struct Array<'a> {
    name: String,
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
        name: impl Into<String>,
        kind: &'static str,
        [components, tuples, bytes]: [usize; 3],
        put: impl Fn(Range<usize>, &mut Vec<u8>) + Sync + 'a,
    ) -> Self {
        Self { name: name.into(), kind, components, tuples, bytes, put: Box::new(put) }
    }
}

/// The one piece of a file.
struct Piece<'a> {
    points: usize,
    cells: usize,
    /// The name of the active array; may be empty.
    active: String,
    /// The elements of the piece and their arrays, in their order in the file.
    sections: [(&'static str, Vec<Array<'a>>); 4],
}

fn of_mesh<'a>(mesh: &'a Tets, name: &str) -> Piece<'a> {
    let (points, cells) = (mesh.points().len(), mesh.cells().len());
    let scalars = |values: &'a [f32]| vec![floats(title(name), values)];
    let (point_data, cell_data) = match mesh.scalars() {
        TetScalars::Point(values) => (scalars(values), Vec::new()),
        TetScalars::Cell(values) => (Vec::new(), scalars(values)),
    };
    let corners = move |range: Range<usize>, bytes: &mut Vec<u8>| {
        let all = mesh.cells()[range].iter().flatten();
        bytes.extend(all.flat_map(|&corner| i64::from(corner).to_le_bytes()));
    };
    let corners = Array::new("connectivity", "Int64", [1, cells, 32], corners);
    Piece {
        points,
        cells,
        active: title(name),
        sections: [
            ("PointData", point_data),
            ("CellData", cell_data),
            ("Points", vec![coordinates(mesh.points())]),
            ("Cells", vec![corners, counting("offsets", cells, 4, 4), types(cells, 10)]),
        ],
    }
}

fn of_points<'a>(points: &'a Points, name: &str) -> Piece<'a> {
    let count = points.centres().len();
    let mut arrays = Vec::new();
    if let Some(scalars) = points.scalars() {
        arrays.push(floats(title(name), scalars));
    }
    if let Some(weights) = points.weights() {
        arrays.push(floats(unused("weight", &arrays), weights));
    }
    match points.size() {
        KernelSize::Unknown => {}
        KernelSize::Radius(radius) => {
            let all = |range: Range<usize>, bytes: &mut Vec<u8>| {
                bytes.extend(range.flat_map(|_| radius.to_le_bytes()));
            };
            arrays.push(Array::new(unused("radius", &arrays), "Float64", [1, count, 8], all));
        }
        KernelSize::Radii(radii) => arrays.push(floats(unused("radius", &arrays), radii)),
        KernelSize::Covariances(all) => {
            // VTK orders six components differently; nine have the same order everywhere.
            let rows = |range: Range<usize>, bytes: &mut Vec<u8>| {
                let row = |[xx, xy, xz, yy, yz, zz]: [f32; 6]| [xx, xy, xz, xy, yy, yz, xz, yz, zz];
                bytes.extend(all[range].iter().flat_map(|&c| row(c)).flat_map(f32::to_le_bytes));
            };
            arrays.push(Array::new(unused("covariance", &arrays), "Float32", [9, count, 36], rows));
        }
    }
    let active = if points.scalars().is_some() { title(name) } else { String::new() };
    Piece {
        points: count,
        cells: count,
        active,
        sections: [
            ("PointData", arrays),
            ("CellData", Vec::new()),
            ("Points", vec![coordinates(points.centres())]),
            (
                "Cells",
                vec![
                    counting("connectivity", count, 0, 1),
                    counting("offsets", count, 1, 1),
                    types(count, 1),
                ],
            ),
        ],
    }
}

/// Returns the name of the scalars.
fn title(name: &str) -> String {
    if name.is_empty() { "scalar".to_owned() } else { name.to_owned() }
}

/// Returns a name that no array has yet.
fn unused(name: &str, arrays: &[Array]) -> String {
    let mut name = name.to_owned();
    while arrays.iter().any(|array| array.name == name) {
        name.push('_');
    }
    name
}

fn floats(name: String, values: &[f32]) -> Array<'_> {
    let put = |range: Range<usize>, bytes: &mut Vec<u8>| {
        bytes.extend(values[range].iter().flat_map(|x| x.to_le_bytes()));
    };
    Array::new(name, "Float32", [1, values.len(), 4], put)
}

fn coordinates(points: &[DVec3]) -> Array<'_> {
    let put = |range: Range<usize>, bytes: &mut Vec<u8>| {
        bytes.extend(points[range].iter().flat_map(|p| p.to_array()).flat_map(f64::to_le_bytes));
    };
    Array::new("Points", "Float64", [3, points.len(), 24], put)
}

/// Returns an array of `first`, `first + step`, and so on.
fn counting(name: &str, tuples: usize, first: u64, step: u64) -> Array<'static> {
    let put = move |range: Range<usize>, bytes: &mut Vec<u8>| {
        let number = |i: usize| num::wide(i).saturating_mul(step).saturating_add(first);
        bytes.extend(range.flat_map(|i| number(i).to_le_bytes()));
    };
    Array::new(name, "Int64", [1, tuples, 8], put)
}

fn types(cells: usize, number: u8) -> Array<'static> {
    let put = move |range: Range<usize>, bytes: &mut Vec<u8>| bytes.extend(range.map(|_| number));
    Array::new("types", "UInt8", [1, cells, 1], put)
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
        let mut slots = Vec::new();
        let mut text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" \
             byte_order=\"LittleEndian\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n  \
             <UnstructuredGrid>\n    <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n",
            self.points, self.cells
        );
        for (element, arrays) in &self.sections {
            let active = match arrays.iter().find(|array| array.name == self.active) {
                Some(array) if element.ends_with("Data") && !array.name.is_empty() => {
                    format!(" Scalars=\"{}\"", escaped(&array.name))
                }
                _ => String::new(),
            };
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
        text.push_str("    </Piece>\n  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n   _");
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
