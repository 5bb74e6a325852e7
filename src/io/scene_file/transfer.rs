//! The transfer function that a scene file gives: knots, a preset, an isosurface, or a file.

use std::fmt;
use std::path::{Path, PathBuf};

use glam::DVec3;
use schemars::JsonSchema;
use serde::de::{MapAccess, SeqAccess, Visitor, value};
use serde::{Deserialize, Deserializer};
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::io::file::json::parse_file;
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::beside;
use crate::io::scene_file::schema::{entries, lacks, one_of, positive, rules, with, words};
use crate::scene::presets::{PRESETS, Preset};
use crate::scene::transfer::check_range;
use crate::scene::{Data, Kernels, Mode, TransferFunction, auto};

/// The value of `transfer`: knots, a preset, an isosurface, or a file that holds one of them.
#[derive(JsonSchema)]
#[schemars(untagged)]
pub(crate) enum TransferSpec {
    /// Lists knots, between which colour and extinction are linear: scalar, linear red, green and blue, extinction per
    /// world unit. Scalars do not decrease; two equal ones make a jump.
    Rows(
        #[schemars(length(min = 1, max = TransferFunction::MAX_KNOTS), transform = entries(knot()))]
        Vec<[f64; 5]>,
    ),
    /// Selects a preset, an isosurface, or a file that holds the transfer function.
    Preset(PresetSpec),
}

/// Returns the keywords of a knot.
fn knot() -> Value {
    let scalar = json!({"type": "number", "description": "scalar"});
    let [red, green, blue] = ["linear red", "linear green", "linear blue"].map(positive);
    json!({"prefixItems": [scalar, red, green, blue, positive("extinction per world unit")], "items": false})
}

/// A preset, an isosurface, or a file that holds the transfer function.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = rules(vec![
    one_of(&["preset", "isosurface", "file"]),
    with("isosurface", lacks(&["range", "tau_scale"])),
    with("file", lacks(&["range", "tau_scale", "colour"])),
    with("preset", lacks(&["colour"])),
]))]
pub(crate) struct PresetSpec {
    /// Selects a preset.
    #[schemars(transform = words(preset_names()))]
    preset: Option<String>,
    /// Sets the scalars over which a preset is stretched, the first below the second. Left out: those that suit the
    /// data.
    range: Option<[f64; 2]>,
    /// Multiplies the extinction of a preset. Left out: 1, or 2 / the longest side of the data's box for presets of fixed
    /// extinction.
    #[schemars(range(min = 0))]
    tau_scale: Option<f64>,
    /// Names a JSON file that holds the value of `transfer`, other than a further `file`.
    file: Option<String>,
    /// Sets the scalar of a surface, which is opaque: above the least scalar of the data, at most the greatest.
    isosurface: Option<f64>,
    /// Sets the colour of the isosurface: linear red, green and blue.
    #[schemars(inner(range(min = 0)), extend("default" = auto::ISOSURFACE_COLOUR.to_array()))]
    colour: Option<[f64; 3]>,
}

fn preset_names() -> [&'static str; PRESETS.len()] {
    PRESETS.map(|preset| preset.name)
}

impl<'de> Deserialize<'de> for TransferSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = TransferSpec;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str(
                    "a list of knots [s, r, g, b, tau], or an object with `preset`, `isosurface` or `file`",
                )
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> std::result::Result<TransferSpec, A::Error> {
                Vec::deserialize(value::SeqAccessDeserializer::new(seq)).map(TransferSpec::Rows)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> std::result::Result<TransferSpec, A::Error> {
                PresetSpec::deserialize(value::MapAccessDeserializer::new(map)).map(TransferSpec::Preset)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// A transfer function that may still need the data.
pub(crate) enum Recipe {
    Ready(TransferFunction),
    Preset { path: PathBuf, preset: Preset, range: Option<[f64; 2]>, tau_scale: Option<f64> },
    Isosurface { path: PathBuf, s: f64, colour: DVec3 },
}

impl Recipe {
    pub(crate) fn new(path: &Path, spec: TransferSpec, options: &ReadOptions) -> Result<Self> {
        let refuse = |place: &str, rule: String| Err(Error::file(path, place, rule));
        let (name, range, tau_scale) = match spec {
            TransferSpec::Rows(rows) => {
                let transfer = TransferFunction::from_rows(&rows).map_err(|error| error.in_file(path))?;
                return Ok(Self::Ready(transfer));
            }
            TransferSpec::Preset(PresetSpec {
                preset: None,
                range: None,
                tau_scale: None,
                file: None,
                isosurface: Some(s),
                colour,
            }) => {
                let colour = colour.map_or(auto::ISOSURFACE_COLOUR, DVec3::from);
                return Ok(Self::Isosurface { path: path.to_path_buf(), s, colour });
            }
            TransferSpec::Preset(PresetSpec {
                preset: None,
                range: None,
                tau_scale: None,
                file: Some(file),
                isosurface: None,
                colour: None,
            }) => {
                let path = beside(path, &file);
                return match parse_file(&path, options)? {
                    TransferSpec::Preset(PresetSpec { file: Some(_), .. }) => {
                        Err(Error::file(&path, "file", "a transfer function file must not name another one"))
                    }
                    spec => Self::new(&path, spec, options),
                };
            }
            TransferSpec::Preset(PresetSpec {
                preset: Some(name),
                range,
                tau_scale,
                file: None,
                isosurface: None,
                colour: None,
            }) => (name, range, tau_scale),
            TransferSpec::Preset(_) => {
                let rule = "must have either `preset`, `range` and `tau_scale`, or `isosurface` and `colour`, or `file`";
                return refuse("transfer", rule.to_owned());
            }
        };
        let preset = Preset::named(&name).map_err(|error| error.at_place(path, "transfer.preset"))?;
        range.map_or(Ok(()), check_range).map_err(|error| error.at_place(path, "transfer.range"))?;
        if let Some(scale) = tau_scale
            && !(scale >= 0.0 && scale.is_finite())
        {
            return refuse("transfer.tau_scale", format!("{scale}: must be finite and not negative"));
        }
        Ok(Self::Preset { path: path.to_path_buf(), preset, range, tau_scale })
    }

    /// Returns the mode that suits it.
    pub(crate) fn mode(&self, data: &Data, kernels: Option<&Kernels>) -> Mode {
        match self {
            Self::Ready(_) => Mode::Emission,
            Self::Preset { preset, .. } => preset.mode(data, kernels),
            Self::Isosurface { .. } => auto::lit(data, kernels),
        }
    }

    /// Builds the transfer function for data.
    pub(crate) fn build(self, data: &Data, kernels: Option<&Kernels>) -> Result<TransferFunction> {
        match self {
            Self::Ready(transfer) => Ok(transfer),
            Self::Preset { path, preset, range, tau_scale } => preset
                .transfer(data, kernels, range, tau_scale)
                .map_err(|error| error.at_place(&path, "transfer")),
            Self::Isosurface { path, s, colour } => auto::isosurface(data, s, colour)
                .map_err(|error| error.at_place(&path, "transfer.isosurface")),
        }
    }
}
