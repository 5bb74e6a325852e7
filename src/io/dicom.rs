//! DICOM: a series of slices, one for each file of a folder, or the frames of one file.
//!
//! Data elements are walked through here: what a file announces is compared with what is there before
//! memory is taken, and nothing is recursive. Frames in JPEG are handed to `dicom-pixeldata` one at a
//! time, each as a small data set of its own whose size has been checked.
//!
//! World coordinates are those of the patient, in millimetres. Slices are put in the order of their
//! positions along their normal; file names and instance numbers mean nothing. A gantry's tilt makes a
//! lattice whose axes are not at right angles, which a grid holds exactly; uneven distances are resampled.

#[cfg(feature = "dicom")]
mod frames;
#[cfg(feature = "dicom")]
mod header;
#[cfg(feature = "dicom")]
mod series;

use super::source::Source;
use super::{Loaded, ReadOptions, Reader};
use crate::error::Result;

pub(super) struct Dicom;

const NAME: &str = "DICOM";

impl Reader for Dicom {
    fn name(&self) -> &'static str {
        NAME
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["dcm", "dicom"]
    }

    fn recognises(&self, source: &Source) -> bool {
        is(source)
    }

    #[cfg(feature = "dicom")]
    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        series::read(source, options)
    }

    #[cfg(not(feature = "dicom"))]
    fn read(&self, source: &Source, _: &ReadOptions) -> Result<Loaded> {
        Err(source.error("format", "DICOM: this program was built without the feature \"dicom\""))
    }
}

#[cfg(feature = "dicom")]
pub(super) use series::read_files;

/// Without the feature, the first of the files says so.
#[cfg(not(feature = "dicom"))]
pub(super) fn read_files(
    folder: &std::path::Path,
    files: &[std::path::PathBuf],
    options: &ReadOptions,
) -> Result<Loaded> {
    match files.first() {
        Some(path) => Dicom.read(&Source::open(path, options)?, options),
        None => Err(crate::error::Error::file(folder, "files", "there is none")),
    }
}

/// Whether the file is one: with its preamble, or with a data set from the first byte on that begins with
/// the elements that real ones begin with.
pub(super) fn is(source: &Source) -> bool {
    let head = source.head();
    if source.is_gzip() {
        return false;
    }
    if head.get(128..132) == Some(b"DICM") {
        return true;
    }
    let &[0x02 | 0x08, 0, element, 0, a, b, c, d, ..] = head else {
        return false;
    };
    let explicit = a.is_ascii_uppercase() && b.is_ascii_uppercase();
    // The group that says how the others are written names its types always.
    if head[0] == 0x02 && !explicit {
        return false;
    }
    let length = u32::from_le_bytes([a, b, c, d]);
    match element {
        // The length of the group, and an element of it.
        0 => {
            let second = if explicit { &b"UL\x04\0"[..] } else { &[4, 0, 0, 0] };
            head[4..8] == *second && head.get(12..14) == Some(&head[..2])
        }
        0x01 | 0x05 | 0x08 | 0x12 | 0x16 | 0x18 => explicit || (length <= 256 && length % 2 == 0),
        _ => false,
    }
}
