//! The layout of raw samples, and common names of their types.

use glam::{DMat3, DVec3};

use crate::io::file::sample_type::{Endian, SampleType};

/// The layout of raw samples, which their file does not contain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawLayout {
    /// Samples along x, y and z; x is fastest.
    pub dims: [u32; 3],
    /// The type of a sample.
    pub kind: SampleType,
    /// The byte order.
    pub endian: Endian,
    /// Bytes before the first sample.
    pub offset: u64,
    /// Distance between samples along each axis, in world units.
    pub spacing: DVec3,
    /// World position of the first sample.
    pub origin: DVec3,
    /// World directions of the index axes, as columns.
    pub direction: DMat3,
}

impl RawLayout {
    /// Returns a little-endian layout without offset, with unit spacing along the world axes and the first sample at
    /// the origin.
    #[must_use]
    pub fn new(dims: [u32; 3], kind: SampleType) -> Self {
        Self {
            dims,
            kind,
            endian: Endian::Little,
            offset: 0,
            spacing: DVec3::ONE,
            origin: DVec3::ZERO,
            direction: DMat3::IDENTITY,
        }
    }
}

/// Returns the sample type of a common name in lower case, and whether the name is unambiguous: `int16` is, `short`
/// may mean something else.
pub(crate) fn type_of(name: &str) -> Option<(SampleType, bool)> {
    Some(match name {
        "u8" | "uint8" => (SampleType::U8, true),
        "uchar" | "ubyte" | "byte" => (SampleType::U8, false),
        "i8" | "int8" => (SampleType::I8, true),
        "schar" | "sbyte" => (SampleType::I8, false),
        "u16" | "uint16" => (SampleType::U16, true),
        "ushort" => (SampleType::U16, false),
        "i16" | "int16" => (SampleType::I16, true),
        "short" => (SampleType::I16, false),
        "u32" | "uint32" => (SampleType::U32, true),
        "uint" => (SampleType::U32, false),
        "i32" | "int32" => (SampleType::I32, true),
        "int" => (SampleType::I32, false),
        "u64" | "uint64" => (SampleType::U64, true),
        "i64" | "int64" => (SampleType::I64, true),
        "f32" | "float32" => (SampleType::F32, true),
        "float" => (SampleType::F32, false),
        "f64" | "float64" => (SampleType::F64, true),
        "double" => (SampleType::F64, false),
        _ => return None,
    })
}
