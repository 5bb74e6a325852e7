//! The result of reading: scene data, and a report of how it was read.

use crate::io::build::arrays::ArrayInfo;
use crate::scene::Data;

/// A report of how a file was read.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Report {
    /// The format.
    pub format: &'static str,
    /// The arrays of the file, if it has several or names them.
    pub arrays: Vec<ArrayInfo>,
    /// The array that was read, in the syntax of [`ReadOptions::array`](crate::io::ReadOptions::array).
    pub shown: Option<String>,
    /// The range of the file's finite values, where those of the data were computed from them: resampled, or of cells that were cut.
    pub file_range: Option<[f64; 2]>,
    /// Changes made to the data.
    pub notes: Vec<String>,
    /// Assumptions and ignored contents that may make the result wrong.
    pub warnings: Vec<String>,
}

/// Scene data with the report of how it was read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The data.
    pub data: Data,
    /// How it was read.
    pub report: Report,
}

impl Loaded {
    pub(crate) fn new(format: &'static str, data: impl Into<Data>) -> Self {
        Self { data: data.into(), report: Report { format, ..Report::default() } }
    }
}
