//! Types of numbers in files, their byte orders, and the part of a tuple that is read.

use crate::error::{Error, Result};

/// The type of a sample in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleType {
    /// 8-bit unsigned.
    U8,
    /// 8-bit signed; kept as 32-bit float.
    I8,
    /// 16-bit unsigned.
    U16,
    /// 16-bit signed.
    I16,
    /// 32-bit unsigned; kept as 32-bit float.
    U32,
    /// 32-bit signed; kept as 32-bit float.
    I32,
    /// 64-bit unsigned; kept as 32-bit float.
    U64,
    /// 64-bit signed; kept as 32-bit float.
    I64,
    /// 32-bit float.
    F32,
    /// 64-bit float; kept as 32-bit float.
    F64,
}

/// Calls a macro with the Rust type of a [`SampleType`], and further arguments.
macro_rules! by_type {
    ($kind:expr, $call:ident $(, $argument:expr)*) => {
        match $kind {
            SampleType::U8 => $call!(u8 $(, $argument)*),
            SampleType::I8 => $call!(i8 $(, $argument)*),
            SampleType::U16 => $call!(u16 $(, $argument)*),
            SampleType::I16 => $call!(i16 $(, $argument)*),
            SampleType::U32 => $call!(u32 $(, $argument)*),
            SampleType::I32 => $call!(i32 $(, $argument)*),
            SampleType::U64 => $call!(u64 $(, $argument)*),
            SampleType::I64 => $call!(i64 $(, $argument)*),
            SampleType::F32 => $call!(f32 $(, $argument)*),
            SampleType::F64 => $call!(f64 $(, $argument)*),
        }
    };
}
pub(crate) use by_type;

impl SampleType {
    /// Every type.
    pub const ALL: [Self; 10] = {
        use SampleType::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
        [U8, I8, U16, I16, U32, I32, U64, I64, F32, F64]
    };

    /// Returns the name used in scene files.
    #[must_use]
    pub fn name(self) -> &'static str {
        by_type!(self, stringify)
    }

    /// Returns the type with this name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the allowed names, for any other name.
    pub fn from_name(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Error::invalid("type", format!("\"{name}\": must be one of {names}"))
        })
    }

    /// Returns the size in the file, in bytes.
    #[must_use]
    pub fn bytes(self) -> u64 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Returns the size in memory, in bytes.
    #[must_use]
    pub fn stored_bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::I16 => 2,
            _ => 4,
        }
    }
}

/// The order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Endian {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

impl Endian {
    /// The byte order of this machine.
    pub(crate) const NATIVE: Self = if cfg!(target_endian = "little") { Self::Little } else { Self::Big };

    /// Decodes an unsigned whole number of at most 8 bytes.
    pub(crate) fn whole(self, bytes: &[u8]) -> u64 {
        let add = |sum: u64, byte: &u8| (sum << 8) | u64::from(*byte);
        match self {
            Self::Little => bytes.iter().rev().fold(0, add),
            Self::Big => bytes.iter().fold(0, add),
        }
    }

    /// Returns the bytes of a number in this order as little-endian bytes.
    pub(crate) fn to_little<const N: usize>(self, mut bytes: [u8; N]) -> [u8; N] {
        if self == Self::Big {
            bytes.reverse();
        }
        bytes
    }
}

/// The part of each tuple that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pick {
    /// One component, counted from 0.
    Component(usize),
    /// The Euclidean length of the tuple.
    Magnitude,
    /// All components, in the type of the file.
    Whole,
}

impl Pick {
    /// Returns the memory that the part of a tuple takes, in bytes.
    pub(crate) fn bytes(self, kind: SampleType, components: usize) -> u64 {
        match self {
            Self::Component(_) => kind.stored_bytes(),
            Self::Magnitude => 4,
            Self::Whole => u64::try_from(components).map_or(u64::MAX, |n| n.saturating_mul(kind.bytes())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_scene_files() {
        for kind in SampleType::ALL {
            assert_eq!(SampleType::from_name(kind.name()).unwrap(), kind);
        }
        assert!(SampleType::from_name("int16").unwrap_err().to_string().contains("u8, i8, u16"));
    }
}
