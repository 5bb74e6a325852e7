//! Transfer syntaxes: how a data set is encoded, and how its samples are compressed.

use crate::io::file::sample_type::Endian;

/// The encoding of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Syntax {
    pub(crate) explicit: bool,
    pub(crate) endian: Endian,
}

/// The compression of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Packing {
    Native,
    Jpeg,
    RunLength,
    /// A compression that is not supported.
    Other,
}

impl Syntax {
    /// The encoding of a data set with this transfer syntax.
    pub(crate) fn of(uid: &str) -> Self {
        match uid {
            "1.2.840.10008.1.2" => Self { explicit: false, endian: Endian::Little },
            "1.2.840.10008.1.2.2" => Self { explicit: true, endian: Endian::Big },
            _ => Self { explicit: true, endian: Endian::Little },
        }
    }
}

impl Packing {
    /// The compression of samples with this transfer syntax.
    pub(crate) fn of(uid: &str) -> Self {
        match uid {
            "1.2.840.10008.1.2"
            | "1.2.840.10008.1.2.2"
            | "1.2.840.10008.1.2.1"
            | "1.2.840.10008.1.2.1.98"
            | "1.2.840.10008.1.2.1.99" => Self::Native,
            "1.2.840.10008.1.2.5" => Self::RunLength,
            "1.2.840.10008.1.2.4.50"
            | "1.2.840.10008.1.2.4.51"
            | "1.2.840.10008.1.2.4.57"
            | "1.2.840.10008.1.2.4.70" => Self::Jpeg,
            _ => Self::Other,
        }
    }
}

/// The name of a transfer syntax that is not read, with a blank before it.
pub(crate) fn named(uid: &str) -> &'static str {
    match uid {
        "1.2.840.10008.1.2.4.80" | "1.2.840.10008.1.2.4.81" => " (JPEG-LS)",
        "1.2.840.10008.1.2.4.90" | "1.2.840.10008.1.2.4.91" => " (JPEG 2000)",
        "1.2.840.10008.1.2.4.92" | "1.2.840.10008.1.2.4.93" => " (JPEG 2000 of several components)",
        "1.2.840.10008.1.2.4.110" | "1.2.840.10008.1.2.4.111" | "1.2.840.10008.1.2.4.112" => " (JPEG XL)",
        "1.2.840.10008.1.2.4.201" | "1.2.840.10008.1.2.4.202" | "1.2.840.10008.1.2.4.203" => {
            " (high-throughput JPEG 2000)"
        }
        "1.2.840.10008.1.2.4.100" | "1.2.840.10008.1.2.4.101" => " (MPEG-2)",
        "1.2.840.10008.1.2.4.102" | "1.2.840.10008.1.2.4.103" => " (MPEG-4)",
        _ => "",
    }
}
