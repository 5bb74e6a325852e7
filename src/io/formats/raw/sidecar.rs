//! The JSON file that describes raw samples.

use std::path::Path;

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::error::Result;
use crate::io::file::json;
use crate::io::file::source::Source;
use crate::io::formats::raw::layout::{Described, RawLayout};
use crate::io::options::ReadOptions;

/// The limit on the size of a sidecar, in bytes.
const MAX_JSON: u64 = 1 << 20;

/// A JSON file that describes raw samples.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "the layout of raw samples: an object with `dims` and `type`")]
pub(crate) struct Sidecar {
    pub(crate) file: Option<String>,
    dims: [u32; 3],
    r#type: String,
    endian: Option<String>,
    spacing: Option<[f64; 3]>,
    origin: Option<[f64; 3]>,
    direction: Option<[f64; 9]>,
    offset: Option<u64>,
}

impl Sidecar {
    pub(crate) fn parse(source: &Source) -> Result<Self> {
        if !is_sidecar(source) && is_json(source) {
            return Err(source.error(
                "content",
                format!(
                    "no layout of raw samples, which is an object of at most {MAX_JSON} bytes with `dims` and \
                     `type` and without `volume`, `mesh` and `points`"
                ),
            ));
        }
        let bytes = source.bytes(0, source.len().min(MAX_JSON))?;
        json::parse(source.path(), &bytes)
    }

    pub(crate) fn layout(&self, source: &Source) -> Result<RawLayout> {
        let described = Described {
            dims: self.dims,
            kind: &self.r#type,
            endian: self.endian.as_deref(),
            spacing: self.spacing,
            origin: self.origin,
            direction: self.direction,
            offset: self.offset,
        };
        described.layout(&|key, rule| source.error(key, rule))
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
    }
    let fits = |keys: Keys| {
        keys.dims.is_some() && keys.volume.is_none() && keys.mesh.is_none() && keys.points.is_none()
    };
    source.len() <= MAX_JSON
        && source.bytes(0, source.len()).is_ok_and(|bytes| serde_json::from_slice(&bytes).is_ok_and(fits))
}

/// Whether a file is well-formed JSON, or larger than the limit.
pub(crate) fn is_json(source: &Source) -> bool {
    source.len() > MAX_JSON
        || source
            .bytes(0, source.len())
            .is_ok_and(|bytes| serde_json::from_slice::<IgnoredAny>(&bytes).is_ok())
}

/// Whether a file is JSON that describes raw samples and is not a scene file.
pub(crate) fn describes_raw(path: &Path, options: &ReadOptions) -> bool {
    Source::open(path, options).is_ok_and(|source| is_sidecar(&source))
}
