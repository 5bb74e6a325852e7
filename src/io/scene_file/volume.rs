//! The key `volume`: a data file, raw samples, or an analytic field on a grid.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::formats::raw;
use crate::io::formats::raw::layout::Described;
use crate::io::options::ReadOptions;
use crate::io::read_data;
use crate::io::report::Report;
use crate::io::scene_file::data::{SceneData, beside};
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
    /// Returns the keys of raw data, and whether they are given.
    fn raw_keys(&self) -> [(&'static str, bool); 5] {
        [
            ("volume.endian", self.endian.is_some()),
            ("volume.spacing", self.spacing.is_some()),
            ("volume.origin", self.origin.is_some()),
            ("volume.direction", self.direction.is_some()),
            ("volume.offset", self.offset.is_some()),
        ]
    }

    pub(crate) fn load(&self, scene: &Path, options: &ReadOptions) -> Result<SceneData> {
        let refuse = |place: &str, rule: String| Err(Error::file(scene, place, rule));
        options.check_kernels("a grid").map_err(|error| error.in_file(scene))?;
        let named = self.file.is_some() && self.dims.is_none() && self.r#type.is_none();
        if !named {
            // Arrays may be selected in the scene or in the options.
            let wanted = [("volume.array", &self.array), ("array", &options.array)];
            if let Some((key, array)) = wanted.into_iter().find_map(|(key, a)| Some((key, a.as_ref()?))) {
                let rule = format!("\"{array}\": fields and raw data have no arrays with names");
                return refuse(key, rule);
            }
        }
        let stray = || self.raw_keys().into_iter().find(|(_, given)| *given).map(|(key, _)| key);
        match (&self.file, &self.field) {
            (Some(_), Some(_)) => refuse("volume", "must have either `file` or `field`, not both".into()),
            (None, None) => refuse("volume", "must have `file` or `field`".into()),
            (None, Some(field)) => {
                if let Some(key) = stray() {
                    return refuse(key, "belongs to raw data: a field fills the cube from -1 to 1".into());
                }
                Ok(SceneData {
                    data: self.analytic(scene, field, options)?.into(),
                    file: scene.to_path_buf(),
                    report: Report { format: "analytic field", ..Report::default() },
                })
            }
            (Some(file), None) => match (self.dims, &self.r#type) {
                (Some(dims), Some(kind)) => self.raw(scene, &beside(scene, file), dims, kind, options),
                (Some(_), None) => refuse("volume.type", "missing: raw data has `dims` and `type`".into()),
                (None, Some(_)) => refuse("volume.dims", "missing: raw data has `dims` and `type`".into()),
                (None, None) => match stray() {
                    Some(key) => {
                        refuse(key, "belongs to raw data, which has `dims` and `type` as well".into())
                    }
                    None => {
                        let file = beside(scene, file);
                        let array = options.array.clone().or_else(|| self.array.clone());
                        SceneData::grid(
                            &file,
                            read_data::read(&file, &ReadOptions { array, ..options.clone() })?,
                        )
                    }
                },
            },
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
        let described = Described {
            dims,
            kind,
            endian: self.endian.as_deref(),
            spacing: self.spacing,
            origin: self.origin,
            direction: self.direction,
            offset: self.offset,
        };
        let layout = described.layout(&|key, rule| Error::file(scene, format!("volume.{key}"), rule))?;
        SceneData::grid(file, raw::load_raw(file, &layout, options)?)
    }
}
