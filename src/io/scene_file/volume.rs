//! The key `volume`: a data file, raw samples, or an analytic field on a grid.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::file::source::Source;
use crate::io::formats::raw;
use crate::io::formats::raw::layout::Sidecar;
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::{Given, SceneData, read, refuse_arrays};
use crate::scene::{Field, Grid};

/// The keys of all three kinds of volume, in one struct so that every error names its key.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `file` or `field`")]
pub(crate) struct VolumeSpec {
    file: Option<String>,
    array: Option<String>,
    field: Option<String>,
    dims: Option<[u32; 3]>,
    r#type: Option<String>,
    endian: Option<String>,
    spacing: Option<[f64; 3]>,
    origin: Option<[f64; 3]>,
    direction: Option<[f64; 9]>,
    offset: Option<u64>,
}

impl VolumeSpec {
    pub(crate) fn load(&self, scene: &Path, options: &ReadOptions) -> Result<SceneData> {
        let refuse = |place: &str, rule: &str| Err(Error::file(scene, place, rule));
        options.check_kernels("a grid").map_err(|error| error.in_file(scene))?;
        if self.file.is_none() || self.dims.is_some() || self.r#type.is_some() {
            let wanted = [("volume.array", &self.array), ("array", &options.array)];
            refuse_arrays(scene, "fields and raw data", &wanted)?;
        }
        let keys = [
            ("volume.endian", self.endian.is_some()),
            ("volume.spacing", self.spacing.is_some()),
            ("volume.origin", self.origin.is_some()),
            ("volume.direction", self.direction.is_some()),
            ("volume.offset", self.offset.is_some()),
        ];
        let stray = keys.into_iter().find(|(_, given)| *given).map(|(key, _)| key);
        let file = match (Given::of(scene, "volume", &self.file, &self.field)?, stray) {
            (Given::Field(_), Some(key)) => {
                return refuse(key, "belongs to raw data: a field fills the cube from -1 to 1");
            }
            (Given::Field(field), None) => {
                return Ok(SceneData::analytic(scene, self.analytic(scene, field, options)?));
            }
            (Given::File(file), _) => file,
        };
        match (self.dims, &self.r#type, stray) {
            (Some(dims), Some(kind), _) => self.raw(scene, &file, dims, kind, options),
            (Some(_), None, _) => refuse("volume.type", "missing: raw data has `dims` and `type`"),
            (None, Some(_), _) => refuse("volume.dims", "missing: raw data has `dims` and `type`"),
            (None, None, Some(key)) => {
                refuse(key, "belongs to raw data, which has `dims` and `type` as well")
            }
            (None, None, None) => {
                let array = options.array.clone().or_else(|| self.array.clone());
                let loaded = read("volume", &file, &ReadOptions { array, ..options.clone() })?;
                Ok(SceneData::new(&file, loaded))
            }
        }
    }

    fn analytic(&self, scene: &Path, field: &str, options: &ReadOptions) -> Result<Grid> {
        let Some(dims) = self.dims else {
            return Err(Error::file(scene, "volume.dims", "missing: a field needs dims"));
        };
        let at = |key: &'static str| move |error: Error| error.at_place(scene, key);
        let field = Field::from_name(field).map_err(at("volume.field"))?;
        let kind = self.r#type.as_deref().unwrap_or("f32");
        let kinds = ["u8", "u16", "i16", "f32"];
        if !kinds.contains(&kind) {
            let rule = format!("\"{kind}\": must be one of {} for a field", kinds.join(", "));
            return Err(Error::file(scene, "volume.type", rule));
        }
        // Sampling holds float64 values in addition to the result of at most four bytes per sample.
        let bytes = dims.iter().try_fold(12_u64, |n, &extent| n.checked_mul(u64::from(extent)));
        if bytes.is_none_or(|bytes| bytes > options.max_bytes) {
            let rule = format!("{dims:?}: takes 12 bytes a sample, the limit is {} bytes", options.max_bytes);
            return Err(Error::file(scene, "volume.dims", rule));
        }
        field.sample(dims, kind).map_err(at("volume.dims"))
    }

    fn raw(
        &self,
        scene: &Path,
        file: &Path,
        dims: [u32; 3],
        kind: &str,
        options: &ReadOptions,
    ) -> Result<SceneData> {
        let description = Sidecar {
            file: None,
            dims,
            r#type: kind.to_owned(),
            endian: self.endian.clone(),
            spacing: self.spacing,
            origin: self.origin,
            direction: self.direction,
            offset: self.offset,
        };
        let layout = description.layout(|key, rule| Error::file(scene, format!("volume.{key}"), rule))?;
        let loaded = raw::load(&Source::open(file, options)?, &layout, options, Vec::new())?;
        Ok(SceneData::new(file, loaded))
    }
}
