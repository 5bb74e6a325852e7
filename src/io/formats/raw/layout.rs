//! The layout of raw samples, and its description in JSON, in a file beside them or in a scene file.

use glam::{DMat3, DVec3};
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::error::{Error, Result};
use crate::io::file::json;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::source::Source;
use crate::io::file::text::shown;

/// The limit on the size of a sidecar, in bytes.
const MAX_JSON: u64 = 1 << 20;

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
    pub const fn new(dims: [u32; 3], kind: SampleType) -> Self {
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

/// A description of raw samples.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "the layout of raw samples: an object with `dims` and `type`")]
pub(crate) struct Sidecar {
    pub(crate) file: Option<String>,
    pub(crate) dims: [u32; 3],
    pub(crate) r#type: String,
    pub(crate) endian: Option<String>,
    pub(crate) spacing: Option<[f64; 3]>,
    pub(crate) origin: Option<[f64; 3]>,
    pub(crate) direction: Option<[f64; 9]>,
    pub(crate) offset: Option<u64>,
}

impl Sidecar {
    /// Parses a file. None if it is JSON that describes something else; what is no JSON at all may be a broken sidecar,
    /// so it is an error.
    pub(crate) fn parse(source: &Source) -> Result<Option<Self>> {
        let bytes = || source.bytes(0, source.len());
        let is_json = || bytes().is_ok_and(|bytes| serde_json::from_slice::<IgnoredAny>(&bytes).is_ok());
        if !is_sidecar(source) && (source.len() > MAX_JSON || is_json()) {
            return Ok(None);
        }
        json::parse(source.path(), &bytes()?).map(Some)
    }

    /// Reads a JSON file, which must be a sidecar.
    pub(crate) fn read(source: &Source) -> Result<Self> {
        let rule = || {
            format!(
                "no layout of raw samples, which is an object of at most {MAX_JSON} bytes with `dims` and `type` and \
                 without `volume`, `mesh`, `points` and `gaussians`"
            )
        };
        Self::parse(source)?.ok_or_else(|| source.error("content", rule()))
    }

    /// Converts the description to a layout. `refuse` makes an error of a key and the rule that its value breaks.
    pub(crate) fn layout(&self, refuse: impl Fn(&str, String) -> Error) -> Result<RawLayout> {
        let Some((kind, _)) = type_of(&self.r#type.to_lowercase()) else {
            let names = SampleType::ALL.map(SampleType::name).join(", ");
            return Err(refuse("type", format!("\"{}\": must be one of {names}", shown(&self.r#type))));
        };
        let plain = RawLayout::new(self.dims, kind);
        let endian = match self.endian.as_deref().map(str::to_lowercase) {
            None => plain.endian,
            Some(given) => {
                let known = ENDIANS.into_iter().find(|(name, _)| *name == given).map(|(_, endian)| endian);
                known.ok_or_else(|| {
                    refuse("endian", format!("\"{}\": must be little or big", shown(&given)))
                })?
            }
        };
        Ok(RawLayout {
            endian,
            offset: self.offset.unwrap_or(plain.offset),
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

/// Whether a JSON file describes raw samples and is not a scene file.
pub(crate) fn is_sidecar(source: &Source) -> bool {
    #[derive(Deserialize)]
    struct Keys {
        dims: Option<IgnoredAny>,
        volume: Option<IgnoredAny>,
        mesh: Option<IgnoredAny>,
        points: Option<IgnoredAny>,
        gaussians: Option<IgnoredAny>,
    }
    let fits = |keys: Keys| {
        let data = [&keys.volume, &keys.mesh, &keys.points, &keys.gaussians];
        keys.dims.is_some() && data.into_iter().all(Option::is_none)
    };
    source.len() <= MAX_JSON
        && source.bytes(0, source.len()).is_ok_and(|bytes| serde_json::from_slice(&bytes).is_ok_and(fits))
}

/// The byte orders by name, first the default.
pub(crate) const ENDIANS: [(&str, Endian); 2] = [("little", Endian::Little), ("big", Endian::Big)];

/// Names of sample types that may mean something else.
const AMBIGUOUS: [(&str, SampleType); 11] = [
    ("uchar", SampleType::U8),
    ("ubyte", SampleType::U8),
    ("byte", SampleType::U8),
    ("schar", SampleType::I8),
    ("sbyte", SampleType::I8),
    ("ushort", SampleType::U16),
    ("short", SampleType::I16),
    ("uint", SampleType::U32),
    ("int", SampleType::I32),
    ("float", SampleType::F32),
    ("double", SampleType::F64),
];

/// Lists the common names of sample types in lower case, and whether each is unambiguous: `int16` is, `short` may mean
/// something else.
pub(crate) fn type_names() -> impl Iterator<Item = (String, SampleType, bool)> {
    let plain = SampleType::ALL.into_iter().flat_map(|kind| {
        let name = kind.name();
        let (letter, bits) = name.split_at(1);
        let word = match letter {
            "u" => "uint",
            "i" => "int",
            _ => "float",
        };
        [name.to_string(), format!("{word}{bits}")].map(|name| (name, kind, true))
    });
    plain.chain(AMBIGUOUS.map(|(name, kind)| (name.to_string(), kind, false)))
}

/// Returns the sample type of a name in lower case, and whether the name is unambiguous.
pub(crate) fn type_of(name: &str) -> Option<(SampleType, bool)> {
    type_names().find(|(known, ..)| known == name).map(|(_, kind, plain)| (kind, plain))
}
