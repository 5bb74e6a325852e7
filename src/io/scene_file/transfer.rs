//! The transfer function that a scene file gives: knots, a preset, an isosurface, or a file.

use std::fmt;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::de::{MapAccess, SeqAccess, Visitor, value};
use serde::{Deserialize, Deserializer};

use crate::error::{Error, Result};
use crate::io::file::json::parse_file;
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::beside;
use crate::scene::presets::Preset;
use crate::scene::transfer::check_range;
use crate::scene::{Data, Kernels, Mode, TransferFunction, auto};

/// The value of `transfer`: knots, a preset, an isosurface, or a file that holds one of them.
pub(crate) enum TransferSpec {
    Rows(Vec<[f64; 5]>),
    Preset(PresetSpec),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PresetSpec {
    preset: Option<String>,
    range: Option<[f64; 2]>,
    tau_scale: Option<f64>,
    file: Option<String>,
    isosurface: Option<f64>,
    colour: Option<[f64; 3]>,
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
