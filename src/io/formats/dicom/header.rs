//! The contents of a DICOM file that place and decode its samples.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::error::Error;
use crate::io::file::sample_type::Endian;
use crate::io::formats::dicom::syntax::{Packing, Syntax};

/// Most frames of a file.
pub(crate) const MAX_FRAMES: usize = 1 << 16;

/// Where a frame lies, and what its numbers mean. What is left out may stand in a place that holds for
/// more frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Plane {
    pub(crate) position: Option<[f64; 3]>,
    pub(crate) orientation: Option<[f64; 6]>,
    /// Distance of rows, then of columns.
    pub(crate) spacing: Option<[f64; 2]>,
    pub(crate) slope: Option<f64>,
    pub(crate) intercept: Option<f64>,
}

impl Plane {
    /// Filled up from what holds for more frames.
    pub(crate) fn or(self, other: Self) -> Self {
        Self {
            position: self.position.or(other.position),
            orientation: self.orientation.or(other.orientation),
            spacing: self.spacing.or(other.spacing),
            slope: self.slope.or(other.slope),
            intercept: self.intercept.or(other.intercept),
        }
    }
}

/// Where the samples are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Pixels {
    /// So many bytes from a place.
    Plain { at: u64, len: u64 },
    /// Places and lengths of the offset table and of fragments.
    Fragments(Vec<(u64, u64)>),
}

/// A file without its samples.
#[derive(Clone, Debug)]
pub(crate) struct Header {
    /// The file, for messages.
    pub(crate) path: PathBuf,
    pub(crate) endian: Endian,
    pub(crate) packing: Packing,
    pub(crate) syntax: String,
    pub(crate) series: String,
    pub(crate) photometric: String,
    pub(crate) rows: u64,
    pub(crate) columns: u64,
    pub(crate) samples: u64,
    pub(crate) allocated: u64,
    pub(crate) stored: u64,
    pub(crate) high: u64,
    pub(crate) signed: bool,
    /// Whether samples are floats.
    pub(crate) float: bool,
    /// NumberOfFrames, where there is one.
    pub(crate) frames: Option<u64>,
    pub(crate) plane: Plane,
    /// Of a file that says it for each frame.
    pub(crate) planes: Vec<Plane>,
    pub(crate) pixels: Option<Pixels>,
    /// Bytes that were taken from the budget for it.
    pub(crate) taken: u64,
    /// Bytes that were taken for its data set, where that is deflated.
    pub(crate) inflated: u64,
    /// What is not applied.
    pub(crate) warnings: Vec<&'static str>,
}

impl Header {
    /// The header of a file of which nothing is known but its encoding.
    pub(crate) fn empty(path: &Path, syntax: Syntax, packing: Packing, syntax_uid: String) -> Self {
        Self {
            path: path.to_path_buf(),
            endian: syntax.endian,
            packing,
            syntax: syntax_uid,
            series: String::new(),
            photometric: String::new(),
            rows: 0,
            columns: 0,
            samples: 1,
            allocated: 0,
            stored: 0,
            high: 0,
            signed: false,
            float: false,
            frames: None,
            plane: Plane::default(),
            planes: Vec::new(),
            pixels: None,
            taken: 0,
            inflated: 0,
            warnings: Vec::new(),
        }
    }

    /// An error that names the file.
    pub(crate) fn error(&self, place: impl Into<String>, rule: impl Into<String>) -> Error {
        Error::file(&self.path, place, rule)
    }

    /// Where a frame lies.
    pub(crate) fn plane_of(&self, frame: usize) -> Plane {
        self.planes.get(frame).copied().unwrap_or_default().or(self.plane)
    }

    /// Bytes of a frame that is not packed.
    pub(crate) fn frame_bytes(&self) -> u64 {
        self.rows.saturating_mul(self.columns).saturating_mul(self.allocated / 8)
    }
}

/// A position as a vector.
pub(crate) fn vector(numbers: &[f64]) -> DVec3 {
    DVec3::new(numbers[0], numbers[1], numbers[2])
}
