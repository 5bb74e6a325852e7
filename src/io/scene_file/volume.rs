//! The key `volume`: a data file, raw samples, or an analytic field on a grid.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::json;

use crate::error::{Error, Result};
use crate::io::file::sample_type::SampleType;
use crate::io::file::source::Source;
use crate::io::formats::raw;
use crate::io::formats::raw::layout::{ENDIANS, RawLayout, Sidecar, type_names};
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::{Given, SceneData, read, refuse_arrays};
use crate::io::scene_file::schema::{
    any_case, entries, lacks, names, needs, one_of, only, rules, with, words,
};
use crate::scene::{Field, Grid};

/// A grid: a data file, raw samples, or an analytic field.
// One struct has the keys of all three, so that every error names its key.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `file` or `field`")]
#[schemars(transform = rules(vec![
    one_of(&["file", "field"]),
    with("file", with("dims", needs(&["type"]))),
    with("file", with("type", needs(&["dims"]))),
    with("field", needs(&["dims"])),
    with("field", lacks(&RAW)),
    with("field", only("type", Field::TYPES)),
    with("dims", lacks(&["array"])),
    json!({"anyOf": [needs(&["dims"]), lacks(&RAW)]}),
]))]
pub(crate) struct VolumeSpec {
    /// Names a file that holds a grid, or raw samples.
    file: Option<String>,
    /// Selects the array of the file that is shown. Left out: that which the file marks as active, else the first
    /// suitable one.
    array: Option<String>,
    /// Selects an analytic field, which fills [-1, 1]³ with values from 0 to 1; in integers these are stretched over the
    /// positive numbers of the type.
    #[schemars(transform = words(Field::NAMES))]
    field: Option<String>,
    /// Sets the samples along x, y and z, of raw samples or a field; x is fastest.
    #[schemars(transform = entries(json!({"minimum": Grid::MIN_SIDE, "maximum": u32::MAX})))]
    dims: Option<[u32; 3]>,
    /// Selects the type of raw samples, which need it, or of a field, which have `u8`, `u16`, `i16` and `f32`. Names such
    /// as `uint8` and `float` are also read.
    #[schemars(
        transform = any_case(SampleType::ALL.map(SampleType::name), written_types()),
        extend("default" = FIELD_TYPE)
    )]
    r#type: Option<String>,
    /// Selects the byte order of raw samples.
    #[schemars(
        transform = any_case(names(ENDIANS), names(ENDIANS)),
        extend("default" = ENDIANS[0].0)
    )]
    endian: Option<String>,
    /// Sets the distance of raw samples along each axis, in world units.
    #[schemars(transform = entries(json!({"exclusiveMinimum": 0})), extend("default" = PLAIN.spacing.to_array()))]
    spacing: Option<[f64; 3]>,
    /// Sets the position of the first raw sample, in world coordinates.
    #[schemars(extend("default" = PLAIN.origin.to_array()))]
    origin: Option<[f64; 3]>,
    /// Sets a matrix, row by row, whose columns are the world directions of the index axes of raw samples. They span
    /// space.
    #[schemars(extend("default" = PLAIN.direction.transpose().to_cols_array()))]
    direction: Option<[f64; 9]>,
    /// Sets the number of bytes before the first raw sample.
    #[schemars(extend("default" = PLAIN.offset))]
    offset: Option<u64>,
}

fn written_types() -> impl Iterator<Item = String> {
    type_names().map(|(name, ..)| name)
}

/// The keys that place raw samples in their file and in the world.
const RAW: [&str; 5] = ["endian", "spacing", "origin", "direction", "offset"];

/// The default type of the samples of a field.
const FIELD_TYPE: &str = "f32";

/// The layout of raw samples of which only extent and type are given; these are any.
const PLAIN: RawLayout = RawLayout::new([Grid::MIN_SIDE; 3], SampleType::U8);

impl VolumeSpec {
    pub(crate) fn load(&self, scene: &Path, options: &ReadOptions) -> Result<SceneData> {
        let refuse = |place: &str, rule: &str| Err(Error::file(scene, place, rule));
        options.check_kernels("a grid").map_err(|error| error.in_file(scene))?;
        if self.file.is_none() || self.dims.is_some() || self.r#type.is_some() {
            let wanted = [("volume.array", &self.array), ("array", &options.array)];
            refuse_arrays(scene, "fields and raw data", &wanted)?;
        }
        let given = [
            self.endian.is_some(),
            self.spacing.is_some(),
            self.origin.is_some(),
            self.direction.is_some(),
            self.offset.is_some(),
        ];
        let stray =
            RAW.into_iter().zip(given).find(|(_, given)| *given).map(|(key, _)| format!("volume.{key}"));
        let file = match (Given::of(scene, "volume", &self.file, &self.field)?, &stray) {
            (Given::Field(_), Some(key)) => {
                return refuse(key, "belongs to raw data: a field fills the cube from -1 to 1");
            }
            (Given::Field(field), None) => {
                return Ok(SceneData::analytic(scene, self.analytic(scene, field, options)?));
            }
            (Given::File(file), _) => file,
        };
        match (self.dims, &self.r#type, &stray) {
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
        let kind = self.r#type.as_deref().unwrap_or(FIELD_TYPE);
        if !Field::TYPES.contains(&kind) {
            let rule = format!("\"{kind}\": must be one of {} for a field", Field::TYPES.join(", "));
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
