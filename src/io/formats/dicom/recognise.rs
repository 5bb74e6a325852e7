//! Recognition of DICOM files by their first bytes.

use crate::io::file::source::Source;

pub(crate) const NAME: &str = "DICOM";

/// Whether the file is DICOM: it has the preamble, or it begins with a data set whose first elements are those of
/// real files.
pub(crate) fn is_dicom(source: &Source) -> bool {
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
    // The file meta information always has explicit types.
    if head[0] == 0x02 && !explicit {
        return false;
    }
    let length = u32::from_le_bytes([a, b, c, d]);
    match element {
        // The group length, followed by an element of the same group.
        0 => {
            let second = if explicit { &b"UL\x04\0"[..] } else { &[4, 0, 0, 0] };
            head[4..8] == *second && head.get(12..14) == Some(&head[..2])
        }
        0x01 | 0x05 | 0x08 | 0x12 | 0x16 | 0x18 => explicit || (length <= 256 && length % 2 == 0),
        _ => false,
    }
}
