//! The structure of a document: pieces, and where the numbers of each array lie.

use crate::error::Result;
use crate::io::build::arrays::Association;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::source::Source;
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

impl From<Association> for Section {
    fn from(association: Association) -> Self {
        match association {
            Association::Point => Self::PointData,
            Association::Cell => Self::CellData,
        }
    }
}

/// First and last index of points along each axis.
pub(crate) type Extent = [[i64; 2]; 3];

/// Returns the number of points or cells along each axis of an extent; 0 if it is empty.
pub(crate) fn shape(extent: Extent, association: Association) -> [u64; 3] {
    let less = u64::from(association == Association::Cell);
    extent.map(|[first, last]| u64::try_from(last - first + 1).unwrap_or(0).saturating_sub(less))
}

/// Returns the number of points or cells of an extent.
pub(crate) fn volume(extent: Extent, association: Association) -> u64 {
    shape(extent, association).into_iter().fold(1, u64::saturating_mul)
}

/// Formats an extent as files write it.
pub(crate) fn words(extent: Extent) -> String {
    let [[a, b], [c, d], [e, f]] = extent;
    format!("{a} {b} {c} {d} {e} {f}")
}

/// A piece of the data set.
#[derive(Debug, Default)]
pub(crate) struct Piece {
    pub(crate) line: u64,
    /// The extent, of an image or a rectilinear grid.
    pub(crate) extent: Extent,
    pub(crate) points: u64,
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
    pub(crate) fn array(&self, section: impl Into<Section>, name: &str) -> Option<&Array> {
        self.arrays(section.into()).find(|array| array.name == name)
    }

    /// Returns an array that must be there, by name or as the first, and have this number of components.
    pub(crate) fn part(
        &self,
        source: &Source,
        section: Section,
        name: Option<&str>,
        components: usize,
    ) -> Result<&Array> {
        let found = self.arrays(section).find(|array| name.is_none_or(|name| array.name == name));
        let Some(array) = found else {
            let rule = format!("no array of {}", name.unwrap_or("Points"));
            return Err(source.error(format!("line {}, Piece", self.line), rule));
        };
        if array.components != components {
            let rule = format!("{} components: must be {components}", array.components);
            return Err(source.error(array.at(), rule));
        }
        Ok(array)
    }

    /// Returns the number of tuples of point or cell data.
    pub(crate) fn tuples(&self, association: Association) -> u64 {
        match association {
            Association::Point => self.points,
            Association::Cell => self.cells,
        }
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
