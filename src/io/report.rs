//! The result of reading: scene data, and a report of how it was read.

use crate::io::build::arrays::ArrayInfo;
use crate::scene::Data;

/// What a person may want to know of how a file was read.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Report {
    /// The format.
    pub format: &'static str,
    /// The arrays of the file, where it has several or names them.
    pub arrays: Vec<ArrayInfo>,
    /// The array that was read, as [`ReadOptions::array`] would name it.
    pub shown: Option<String>,
    /// What was done to the data.
    pub notes: Vec<String>,
    /// What may not be as it seems.
    pub warnings: Vec<String>,
}

/// Data, and how it was read.
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
