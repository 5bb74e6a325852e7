//! Transfer syntaxes: how a data set is encoded, and how its samples are compressed.

use crate::io::file::sample_type::Endian;

/// The encoding of a data set: whether types are explicit, and the byte order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Syntax {
    pub(crate) explicit: bool,
    pub(crate) endian: Endian,
}

impl Default for Syntax {
    /// Returns the encoding of the file meta information, and of most data sets.
    fn default() -> Self {
        Self { explicit: true, endian: Endian::Little }
    }
}

/// The compression of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Packing {
    #[default]
    Native,
    Jpeg,
    RunLength,
    /// A compression that is not supported.
    Other,
}

/// The beginning of the identifiers of transfer syntaxes.
const COMMON: &str = "1.2.840.10008.1.2";

impl Syntax {
    pub(crate) fn of(uid: &str) -> Self {
        match uid.strip_prefix(COMMON) {
            Some("") => Self { explicit: false, endian: Endian::Little },
            Some(".2") => Self { explicit: true, endian: Endian::Big },
            _ => Self::default(),
        }
    }
}

impl Packing {
    pub(crate) fn of(uid: &str) -> Self {
        match uid.strip_prefix(COMMON) {
            Some("" | ".1" | ".1.98" | ".1.99" | ".2") => Self::Native,
            Some(".5") => Self::RunLength,
            Some(".4.50" | ".4.51" | ".4.57" | ".4.70") => Self::Jpeg,
            _ => Self::Other,
        }
    }
}

/// The name of a transfer syntax that is not read, with a blank before it.
pub(crate) fn named(uid: &str) -> &'static str {
    match uid.strip_prefix(COMMON) {
        Some(".4.80" | ".4.81") => " (JPEG-LS)",
        Some(".4.90" | ".4.91") => " (JPEG 2000)",
        Some(".4.92" | ".4.93") => " (JPEG 2000 of several components)",
        Some(".4.110" | ".4.111" | ".4.112") => " (JPEG XL)",
        Some(".4.201" | ".4.202" | ".4.203") => " (high-throughput JPEG 2000)",
        Some(".4.100" | ".4.101") => " (MPEG-2)",
        Some(".4.102" | ".4.103") => " (MPEG-4)",
        _ => "",
    }
}
