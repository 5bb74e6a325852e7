//! The result of reading: scene data, and a report of how it was read.

use std::path::PathBuf;

use crate::io::build::arrays::ArrayInfo;
use crate::io::build::data_file::DataFile;
use crate::scene::{Data, Dropped};

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
    /// The steps of the series that the file is; else empty.
    pub steps: Vec<Step>,
    /// Facts about Gaussian splats.
    pub gaussians: Option<GaussiansReport>,
    /// Changes made to the data.
    pub notes: Vec<String>,
    /// Assumptions and ignored contents that may make the result wrong.
    pub warnings: Vec<String>,
}

/// A report of how Gaussian splats were read.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct GaussiansReport {
    /// Where the axes come from, as a phrase.
    pub axes_from: &'static str,
    /// Texts of the file about its licence and authors.
    pub texts: Vec<String>,
    /// Splats that were left out or changed.
    pub dropped: Dropped,
}

/// A step of a time series.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// The data file.
    pub file: PathBuf,
    /// The time, if the series tells it.
    pub time: Option<f64>,
}

impl Report {
    /// Returns the name of the array that was read, without the prefix `point:` or `cell:`.
    #[must_use]
    pub fn shown_name(&self) -> &str {
        let shown = self.shown.as_deref().unwrap_or_default();
        shown.strip_prefix("point:").or_else(|| shown.strip_prefix("cell:")).unwrap_or(shown)
    }
}

/// Data with the report of how it was read: scene data, or the contents of a file.
#[derive(Clone, Debug)]
pub struct Loaded<D = Data> {
    /// The data.
    pub data: D,
    /// How it was read.
    pub report: Report,
}

impl Loaded {
    pub(crate) fn new(format: &'static str, data: impl Into<Data>) -> Self {
        Self { data: data.into(), report: Report { format, ..Report::default() } }
    }
}

/// The data that a reader returns.
#[derive(Clone, Debug)]
pub(crate) enum Content {
    Scene(Data),
    /// Returned on request, except by readers that had to compute the values.
    Arrays(DataFile),
}

/// The result of a reader.
pub(crate) type Found = Loaded<Content>;

impl From<Loaded> for Found {
    fn from(Loaded { data, report }: Loaded) -> Self {
        Self { data: Content::Scene(data), report }
    }
}

impl Found {
    /// Wraps the contents of a file.
    pub(crate) fn of_arrays(format: &'static str, data: DataFile) -> Self {
        Self { data: Content::Arrays(data), report: Report { format, ..Report::default() } }
    }
}
