//! The contents of a DICOM file that place and decode its samples.

use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::io::file::budget::Budget;
use crate::io::formats::dicom::syntax::{Packing, Syntax};
use crate::num;

/// The limit on frames of a file.
pub(crate) const MAX_FRAMES: usize = 1 << 16;

/// The plane of a frame and the rescale of its samples. Missing values may be given for several frames at once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Plane {
    pub(crate) position: Option<[f64; 3]>,
    pub(crate) orientation: Option<[f64; 6]>,
    /// Distance of rows, then of columns, in millimetres.
    pub(crate) spacing: Option<[f64; 2]>,
    /// SliceThickness, in millimetres.
    pub(crate) thickness: Option<f64>,
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
            thickness: self.thickness.or(other.thickness),
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
#[derive(Clone, Debug, Default)]
pub(crate) struct Header {
    /// The file, for messages.
    pub(crate) path: PathBuf,
    pub(crate) syntax: Syntax,
    pub(crate) packing: Packing,
    /// The transfer syntax.
    pub(crate) uid: String,
    pub(crate) series: String,
    pub(crate) photometric: String,
    pub(crate) rows: u64,
    pub(crate) columns: u64,
    pub(crate) samples: u64,
    pub(crate) allocated: u64,
    pub(crate) stored: u64,
    pub(crate) high: u64,
    pub(crate) signed: bool,
    pub(crate) float: bool,
    pub(crate) frames: u64,
    pub(crate) plane: Plane,
    /// The planes of single frames, if the file gives them.
    pub(crate) planes: Vec<Plane>,
    pub(crate) pixels: Option<Pixels>,
    /// Bytes taken from the budget for it.
    pub(crate) taken: u64,
    /// Bytes taken for its data set, if that is deflated.
    pub(crate) inflated: u64,
    /// Whether there is a modality table, which is not applied.
    pub(crate) table: bool,
}

impl Header {
    pub(crate) fn error(&self, place: impl Into<String>, rule: impl Into<String>) -> Error {
        Error::file(&self.path, place, rule)
    }

    pub(crate) fn plane_of(&self, frame: usize) -> Plane {
        self.planes.get(frame).copied().unwrap_or_default().or(self.plane)
    }

    /// Returns the size of an uncompressed frame, in bytes.
    pub(crate) fn frame_bytes(&self) -> u64 {
        self.rows.saturating_mul(self.columns).saturating_mul(self.allocated / 8)
    }
}

/// Counts the memory taken from a budget for the header of each file.
pub(crate) struct Account<'b> {
    pub(crate) budget: Budget<'b>,
    /// Bytes taken for the current file.
    pub(crate) taken: u64,
    /// Whether the budget was exceeded, which does not mean that a file is damaged.
    pub(crate) full: bool,
}

impl<'b> Account<'b> {
    pub(crate) fn new(budget: Budget<'b>) -> Self {
        Self { budget, taken: 0, full: false }
    }

    pub(crate) fn take(&mut self, place: &str, bytes: u64) -> Result<()> {
        self.budget.take(place, bytes).inspect_err(|_| self.full = true)?;
        self.taken = self.taken.saturating_add(bytes);
        Ok(())
    }

    /// Takes the memory of `count` values of a type.
    pub(crate) fn take_for<T>(&mut self, count: usize) -> Result<()> {
        self.take("header", num::wide(count.saturating_mul(size_of::<T>())))
    }
}
