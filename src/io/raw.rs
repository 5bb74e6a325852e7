//! Raw samples, with a layout that the caller gives.

use std::path::Path;

use glam::{DMat3, DVec3};

use super::ReadOptions;
use super::samples::{self, Endian, SampleType, Stream};
use super::source::Source;
use crate::error::Result;
use crate::scene::Grid;

/// Everything that a raw file does not say about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawLayout {
    /// Samples along x, y and z; x is fastest.
    pub dims: [u32; 3],
    /// The type of a sample.
    pub kind: SampleType,
    /// The byte order.
    pub endian: Endian,
    /// Bytes before the first sample.
    pub offset: u64,
    /// Distance between samples along each axis, in world units.
    pub spacing: DVec3,
    /// World position of the first sample.
    pub origin: DVec3,
    /// World directions of the index axes, as columns.
    pub direction: DMat3,
}

impl RawLayout {
    /// Unit spacing along the world's axes at the origin, little-endian, no offset.
    #[must_use]
    pub fn new(dims: [u32; 3], kind: SampleType) -> Self {
        Self {
            dims,
            kind,
            endian: Endian::Little,
            offset: 0,
            spacing: DVec3::ONE,
            origin: DVec3::ZERO,
            direction: DMat3::IDENTITY,
        }
    }
}

/// Reads a file that holds `layout.offset` bytes, then exactly the samples. A file that is a gzip stream
/// is inflated first; the offset counts inflated bytes then.
///
/// # Errors
///
/// [`crate::Error::Io`] if the file cannot be read; [`crate::Error::File`] if its size does not fit the
/// layout, the layout makes no grid, or the samples would take more than `options.max_bytes`.
pub fn read_raw(path: impl AsRef<Path>, layout: &RawLayout, options: &ReadOptions) -> Result<Grid> {
    let source = Source::open(path.as_ref())?;
    // Samples may begin with gzip's two magic bytes: a file of exactly the right size is raw.
    let (_, bytes) = samples::data_size(&source, "dims", layout.dims, layout.kind, options)?;
    let gzip = source.is_gzip() && layout.offset.checked_add(bytes) != Some(source.len());
    let stream = Stream {
        dims: layout.dims,
        kind: layout.kind,
        endian: layout.endian,
        offset: 0,
        gzip,
        skip: layout.offset,
    };
    let samples = samples::read(&source, "dims", &stream, options)?;
    Grid::new(layout.dims, samples)
        .and_then(|grid| grid.with_placement(layout.spacing, layout.origin, layout.direction))
        .map_err(|error| error.in_file(source.path()))
}
