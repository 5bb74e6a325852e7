//! Raw samples, with a layout that the caller gives.

use std::path::Path;

use glam::{DMat3, DVec3};

use super::ReadOptions;
use super::samples::{self, Endian, Layout, Part, SampleType};
use super::source::{Encoding, Source};
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
    read(&Source::open(path.as_ref(), options)?, layout, options)
}

pub(crate) fn read(source: &Source, layout: &RawLayout, options: &ReadOptions) -> Result<Grid> {
    let numbers = Layout::scalar(layout.dims, layout.kind, layout.endian);
    // Samples may begin with gzip's two magic bytes: a file of exactly the right size is raw.
    let (_, bytes) = samples::data_size(source, "dims", &numbers, options)?;
    let raw = layout.offset.checked_add(bytes) == Some(source.len());
    let encoding = if raw { Encoding::Raw } else { source.encoding() };
    let part = Part { skip: layout.offset, encoding, ..Part::whole(source.clone()) };
    let samples = samples::read(source, "dims", &numbers, 1, &|_| Ok(part.clone()), options)?;
    Grid::new(layout.dims, samples)
        .and_then(|grid| grid.with_placement(layout.spacing, layout.origin, layout.direction))
        .map_err(|error| error.in_file(source.path()))
}
