//! DICOM: a series of slices, one for each file of a folder, or the frames of one file.
//!
//! This module parses data elements itself, without recursion, and compares announced sizes with the file before it
//! allocates memory. `dicom-pixeldata` decodes frames in JPEG one at a time, each as a minimal data set of checked size.
//!
//! World coordinates are those of the patient, in millimetres. Slices are sorted by their positions along their normal;
//! file names and instance numbers are ignored. A tilted gantry makes a lattice with axes that are not at right angles,
//! which a grid represents exactly. Uneven slice distances are resampled.

#[cfg(feature = "dicom")]
mod assemble;
#[cfg(feature = "dicom")]
mod data_set;
#[cfg(feature = "dicom")]
mod elements;
#[cfg(feature = "dicom")]
mod frames;
#[cfg(feature = "dicom")]
mod header;
#[cfg(feature = "dicom")]
mod placement;
pub(crate) mod recognise;
#[cfg(feature = "dicom")]
mod series;
#[cfg(feature = "dicom")]
mod syntax;

#[cfg(feature = "dicom")]
pub(crate) use series::read_files;

use crate::error::Result;
use crate::io::file::source::Source;
use crate::io::formats::dicom::recognise::{NAME, is_dicom};
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;

pub(crate) struct Dicom;

impl Reader for Dicom {
    fn name(&self) -> &'static str {
        NAME
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["dcm", "dicom"]
    }

    fn recognises(&self, source: &Source) -> bool {
        is_dicom(source)
    }

    #[cfg(feature = "dicom")]
    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        series::read(source, request)
    }

    #[cfg(not(feature = "dicom"))]
    fn read(&self, source: &Source, _: &Request) -> Result<Found> {
        Err(source.error("format", "DICOM: this program was built without the feature \"dicom\""))
    }
}

/// Reports the missing feature for the first file.
#[cfg(not(feature = "dicom"))]
pub(crate) fn read_files(
    folder: &std::path::Path,
    files: &[std::path::PathBuf],
    request: &Request,
) -> Result<Found> {
    match files.first() {
        Some(path) => Dicom.read(&Source::open(path, request)?, request),
        None => Err(crate::error::Error::file(folder, "files", "there is none")),
    }
}
