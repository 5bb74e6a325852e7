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
use crate::scene::presets::{PRESETS, stretch};
use crate::scene::{Data, TransferFunction, auto};

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
    Stretched { path: PathBuf, rows: &'static [[f64; 5]], range: Option<[f64; 2]>, tau_scale: f64 },
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
            }) => (name, range, tau_scale.unwrap_or(1.0)),
            TransferSpec::Preset(_) => {
                let rule = "must have either `preset`, `range` and `tau_scale`, or `isosurface` and `colour`, or `file`";
                return refuse("transfer", rule.to_owned());
            }
        };
        let Some(preset) = PRESETS.iter().find(|preset| preset.name == name) else {
            let names = PRESETS.map(|preset| preset.name).join(", ");
            return refuse("transfer.preset", format!("\"{name}\": must be one of {names}"));
        };
        if let Some([lo, hi]) = range
            && !(lo < hi && (hi - lo).is_finite())
        {
            return refuse("transfer.range", format!("[{lo}, {hi}]: the first must be below the second"));
        }
        if !(tau_scale >= 0.0 && tau_scale.is_finite()) {
            return refuse("transfer.tau_scale", format!("{tau_scale}: must be finite and not negative"));
        }
        Ok(Self::Stretched { path: path.to_path_buf(), rows: preset.rows, range, tau_scale })
    }

    /// Returns whether it shows an isosurface.
    pub(crate) fn is_isosurface(&self) -> bool {
        matches!(self, Self::Isosurface { .. })
    }

    /// Builds the transfer function for data.
    pub(crate) fn build(self, data: &Data) -> Result<TransferFunction> {
        match self {
            Self::Ready(transfer) => Ok(transfer),
            Self::Stretched { path, rows, range, tau_scale } => {
                let range = range.unwrap_or_else(|| data.range());
                stretch(rows, range, tau_scale).map_err(|error| error.in_file(&path))
            }
            Self::Isosurface { path, s, colour } => auto::isosurface(data, s, colour)
                .map_err(|error| error.at_place(&path, "transfer.isosurface")),
        }
    }
}
