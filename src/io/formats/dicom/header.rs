//! The contents of a DICOM file that place and decode its samples.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::error::Error;
use crate::io::file::sample_type::Endian;
use crate::io::formats::dicom::syntax::{Packing, Syntax};

/// The limit on frames of a file.
pub(crate) const MAX_FRAMES: usize = 1 << 16;

/// The plane of a frame and the rescale of its samples. Missing values may be given for several frames at once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Plane {
    pub(crate) position: Option<[f64; 3]>,
    pub(crate) orientation: Option<[f64; 6]>,
    /// Distance of rows, then of columns, in millimetres.
    pub(crate) spacing: Option<[f64; 2]>,
    pub(crate) slope: Option<f64>,
    pub(crate) intercept: Option<f64>,
}

impl Plane {
    /// Fills missing values from those that hold for several frames.
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

/// The location of the samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Pixels {
    /// Uncompressed bytes at an offset.
    Plain { at: u64, len: u64 },
    /// Offsets and lengths of the offset table and of the fragments.
    Fragments(Vec<(u64, u64)>),
}

/// The contents of a file without its samples.
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
    /// NumberOfFrames, if given.
    pub(crate) frames: Option<u64>,
    pub(crate) plane: Plane,
    /// The planes of single frames, if the file gives them.
    pub(crate) planes: Vec<Plane>,
    pub(crate) pixels: Option<Pixels>,
    /// Bytes taken from the budget for it.
    pub(crate) taken: u64,
    /// Bytes taken for its data set, if that is deflated.
    pub(crate) inflated: u64,
    /// Warnings about elements that are not applied.
    pub(crate) warnings: Vec<&'static str>,
}

impl Header {
    /// Returns an empty header; only the encoding is known.
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

    /// Returns an error that names the file.
    pub(crate) fn error(&self, place: impl Into<String>, rule: impl Into<String>) -> Error {
        Error::file(&self.path, place, rule)
    }

    /// Returns the plane of a frame.
    pub(crate) fn plane_of(&self, frame: usize) -> Plane {
        self.planes.get(frame).copied().unwrap_or_default().or(self.plane)
    }

    /// Returns the size of an uncompressed frame, in bytes.
    pub(crate) fn frame_bytes(&self) -> u64 {
        self.rows.saturating_mul(self.columns).saturating_mul(self.allocated / 8)
    }
}

/// Converts the first three numbers to a vector.
pub(crate) fn vector(numbers: &[f64]) -> DVec3 {
    DVec3::new(numbers[0], numbers[1], numbers[2])
}
