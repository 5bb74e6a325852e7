//! The structure of a document: pieces, and where the numbers of each array lie.

use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::text::shown;

/// The kind of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Image,
    Rectilinear,
    Unstructured,
}

/// The compression of blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compressor {
    Zlib,
    Lz4,
    Lzma,
}

/// The encoding of binary arrays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Storage {
    pub(crate) endian: Endian,
    /// The size of a number in the header of an array: 4 or 8 bytes.
    pub(crate) word: u64,
    pub(crate) compressor: Option<Compressor>,
    pub(crate) appended: Option<Appended>,
}

/// The appended data.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Appended {
    /// The file offset that array offsets are relative to.
    pub(crate) begin: u64,
    pub(crate) base64: bool,
}

/// A range of text in the document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Text {
    pub(crate) begin: u64,
    pub(crate) end: u64,
    /// The number of lines before it.
    pub(crate) line: u64,
}

/// The place of the numbers of an array.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// As text.
    Words(Text),
    /// As base64.
    Base64(Text),
    /// At an offset in the appended data.
    Appended(u64),
}

/// An array of a piece.
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
    /// Describes its place, for messages.
    pub(crate) fn at(&self) -> String {
        format!("line {}, DataArray \"{}\"", self.line, shown(&self.name))
    }
}

/// The elements of a piece that hold arrays.
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

/// A piece of the data set.
#[derive(Debug, Default)]
pub(crate) struct Piece {
    pub(crate) line: u64,
    /// The extent, of an image or a rectilinear grid.
    pub(crate) extent: Extent,
    /// The number, of an unstructured grid.
    pub(crate) points: u64,
    /// The number, of an unstructured grid.
    pub(crate) cells: u64,
    /// Names of the scalars and the vectors to show: of points, and of cells.
    pub(crate) active: [[Option<String>; 2]; 2],
    pub(crate) arrays: Vec<(Section, Array)>,
}

impl Piece {
    /// Returns the arrays of a section.
    pub(crate) fn arrays(&self, section: Section) -> impl Iterator<Item = &Array> {
        self.arrays.iter().filter(move |(own, _)| *own == section).map(|(_, array)| array)
    }

    /// Returns an array of a section by name.
    pub(crate) fn array(&self, section: Section, name: &str) -> Option<&Array> {
        self.arrays(section).find(|array| array.name == name)
    }
}

/// The contents of a file.
#[derive(Debug)]
pub(crate) struct Document {
    pub(crate) kind: Kind,
    pub(crate) storage: Storage,
    /// The extent, of an image or a rectilinear grid.
    pub(crate) whole: Extent,
    /// For an image: the position of index 0, the spacing, and the direction, row by row.
    pub(crate) origin: [f64; 3],
    pub(crate) spacing: [f64; 3],
    pub(crate) direction: [f64; 9],
    pub(crate) pieces: Vec<Piece>,
    pub(crate) warnings: Vec<String>,
}
