//! The layout of raw samples, and its description in JSON.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::text;

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

/// The description of raw samples in JSON, in a sidecar or in a scene file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Described<'a> {
    pub(crate) dims: [u32; 3],
    pub(crate) kind: &'a str,
    pub(crate) endian: Option<&'a str>,
    pub(crate) spacing: Option<[f64; 3]>,
    pub(crate) origin: Option<[f64; 3]>,
    pub(crate) direction: Option<[f64; 9]>,
    pub(crate) offset: Option<u64>,
}

impl Described<'_> {
    /// Converts the description to a layout. `refuse` makes an error of a key and the rule that its value breaks.
    pub(crate) fn layout(&self, refuse: &dyn Fn(&str, String) -> Error) -> Result<RawLayout> {
        let Some((kind, _)) = type_of(&self.kind.to_lowercase()) else {
            let names = SampleType::ALL.map(SampleType::name).join(", ");
            let rule = format!("\"{}\": must be one of {names}", text::shown(self.kind));
            return Err(refuse("type", rule));
        };
        let endian = match self.endian.map(str::to_lowercase).as_deref() {
            None | Some("little") => Endian::Little,
            Some("big") => Endian::Big,
            Some(other) => {
                let rule = format!("\"{}\": must be little or big", text::shown(other));
                return Err(refuse("endian", rule));
            }
        };
        let plain = RawLayout::new(self.dims, kind);
        Ok(RawLayout {
            endian,
            offset: self.offset.unwrap_or(0),
            spacing: self.spacing.map_or(plain.spacing, DVec3::from_array),
            origin: self.origin.map_or(plain.origin, DVec3::from_array),
            // The file lists rows, the matrix has columns.
            direction: self
                .direction
                .map_or(plain.direction, |rows| DMat3::from_cols_array(&rows).transpose()),
            ..plain
        })
    }
}

/// Returns the sample type of a common name in lower case, and whether the name is unambiguous: `int16` is, `short`
/// may mean something else.
pub(crate) fn type_of(name: &str) -> Option<(SampleType, bool)> {
    let (kind, plain) = match name {
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
    };
    Some((kind, plain))
}
