//! The structure of a document: pieces, and where the numbers of each array lie.

use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::text::shown;

/// What the points of a data set are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Image,
    Rectilinear,
    Unstructured,
}

/// The packing of blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compressor {
    Zlib,
    Lz4,
    Lzma,
}

/// How the bytes of arrays are stored.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Storage {
    pub(crate) endian: Endian,
    /// Bytes of a number in the header of an array: 4 or 8.
    pub(crate) word: u64,
    pub(crate) compressor: Option<Compressor>,
    pub(crate) appended: Option<Appended>,
}

/// Data after the document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Appended {
    /// Where offsets count from.
    pub(crate) begin: u64,
    pub(crate) base64: bool,
}

/// Text of the document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Text {
    pub(crate) begin: u64,
    pub(crate) end: u64,
    /// Lines before it.
    pub(crate) line: u64,
}

/// Where the numbers of an array lie.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// As words.
    Words(Text),
    /// As bytes in base64.
    Base64(Text),
    /// In the appended data.
    Appended(u64),
}

/// An array.
#[derive(Debug)]
pub(crate) struct Array {
    pub(crate) name: String,
    pub(crate) line: u64,
    /// The type of a number, or why it cannot be read.
    pub(crate) kind: std::result::Result<SampleType, String>,
    pub(crate) components: usize,
    pub(crate) place: Place,
}

impl Array {
    /// Where it is, for messages.
    pub(crate) fn at(&self) -> String {
        format!("line {}, DataArray \"{}\"", self.line, shown(&self.name))
    }
}

/// The parts of a piece that hold arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Section {
    PointData,
    CellData,
    Points,
    Cells,
    Coordinates,
}

impl Section {
    pub(crate) const ALL: [(&'static str, Self); 5] = [
        ("PointData", Self::PointData),
        ("CellData", Self::CellData),
        ("Points", Self::Points),
        ("Cells", Self::Cells),
        ("Coordinates", Self::Coordinates),
    ];
}

/// First and last index of points along each axis.
pub(crate) type Extent = [[i64; 2]; 3];

/// A part of the data set.
#[derive(Debug, Default)]
pub(crate) struct Piece {
    pub(crate) line: u64,
    /// Of an image or a rectilinear grid.
    pub(crate) extent: Extent,
    /// Of an unstructured grid.
    pub(crate) points: u64,
    /// Of an unstructured grid.
    pub(crate) cells: u64,
    /// Names of the scalars and the vectors to show: of points, and of cells.
    pub(crate) active: [[Option<String>; 2]; 2],
    pub(crate) arrays: Vec<(Section, Array)>,
}

impl Piece {
    /// The arrays of a part.
    pub(crate) fn arrays(&self, section: Section) -> impl Iterator<Item = &Array> {
        self.arrays.iter().filter(move |(own, _)| *own == section).map(|(_, array)| array)
    }

    /// An array by name.
    pub(crate) fn array(&self, section: Section, name: &str) -> Option<&Array> {
        self.arrays(section).find(|array| array.name == name)
    }
}

/// What a file holds.
#[derive(Debug)]
pub(crate) struct Document {
    pub(crate) kind: Kind,
    pub(crate) storage: Storage,
    /// Of an image or a rectilinear grid.
    pub(crate) whole: Extent,
    /// Of an image: the place of index 0, the spacing, and the direction, row by row.
    pub(crate) origin: [f64; 3],
    pub(crate) spacing: [f64; 3],
    pub(crate) direction: [f64; 9],
    pub(crate) pieces: Vec<Piece>,
    pub(crate) warnings: Vec<String>,
}
