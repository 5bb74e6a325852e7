//! Pieces: their sizes, and reading of their arrays.

use crate::error::Result;
use crate::io::build::arrays::Association;
use crate::io::file::decode::{self, Layout};
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::file::text::index;
use crate::io::formats::vtk_xml::document::{Array, Extent, Kind, Piece, Section};
use crate::io::formats::vtk_xml::store::Store;
use crate::scene::Samples;

/// Returns the number of points of an extent along each axis; 0 if it is empty.
pub(crate) fn counts(extent: Extent) -> [u64; 3] {
    extent.map(|[first, last]| u64::try_from(last - first + 1).unwrap_or(0))
}

/// Returns the number of tuples of point or cell data in a piece.
pub(crate) fn tuples(kind: Kind, piece: &Piece, association: Association) -> u64 {
    match (kind, association) {
        (Kind::Unstructured, Association::Point) => piece.points,
        (Kind::Unstructured, Association::Cell) => piece.cells,
        _ => shape(piece.extent, association).into_iter().fold(1, u64::saturating_mul),
    }
}

/// Returns the number of samples along each axis of an extent.
pub(crate) fn shape(extent: Extent, association: Association) -> [u64; 3] {
    let points = counts(extent);
    match association {
        Association::Point => points,
        Association::Cell => points.map(|count| count.saturating_sub(1)),
    }
}

pub(crate) fn section(association: Association) -> Section {
    match association {
        Association::Point => Section::PointData,
        Association::Cell => Section::CellData,
    }
}

/// Reads the selected part of each tuple of an array in a piece.
pub(crate) fn append(
    store: &mut Store,
    array: &Array,
    count: u64,
    pick: Pick,
    samples: &mut Samples,
    source: &Source,
) -> Result<()> {
    let tuples = index(source, &array.at(), count)?;
    let numbers = numbers(source, array, count, array.components)?;
    store.take(array, numbers, &mut |reader, kind, endian| {
        let layout = Layout { dims: [0; 3], kind, endian, components: array.components, pick };
        decode::append(reader, tuples, &layout, samples)
    })
}

/// Returns the number of values in `count` tuples.
pub(crate) fn numbers(source: &Source, array: &Array, count: u64, components: usize) -> Result<u64> {
    u64::try_from(components)
        .ok()
        .and_then(|components| count.checked_mul(components))
        .ok_or_else(|| source.error(array.at(), format!("{count} tuples: more than memory can address")))
}

/// Returns an array that a piece must have, with this number of components.
pub(crate) fn part<'d>(
    source: &Source,
    piece: &'d Piece,
    section: Section,
    name: Option<&str>,
    components: usize,
) -> Result<&'d Array> {
    let found = match name {
        Some(name) => piece.array(section, name),
        None => piece.arrays(section).next(),
    };
    let place = || format!("line {}, Piece", piece.line);
    let array = found.ok_or_else(|| {
        source.error(place(), format!("no array of {}", name.map_or("Points", |name| name)))
    })?;
    if array.components != components {
        let rule = format!("{} components: must be {components}", array.components);
        return Err(source.error(array.at(), rule));
    }
    Ok(array)
}

/// Converts an index of an extent, which fits 32 bits, to a coordinate.
pub(crate) fn f64_of(index: i64) -> f64 {
    i32::try_from(index).map_or(f64::NAN, f64::from)
}

/// Formats an extent as files write it.
pub(crate) fn words(extent: Extent) -> String {
    let [[a, b], [c, d], [e, f]] = extent;
    format!("{a} {b} {c} {d} {e} {f}")
}
