//! The transfer function that a scene file gives: knots, a preset, or a file.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::de::{MapAccess, SeqAccess, Visitor, value};
use serde::{Deserialize, Deserializer};

use crate::error::{Error, Result};
use crate::io::file::json::parse_file;
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::beside;
use crate::scene::TransferFunction;
use crate::scene::presets::{PRESETS, stretch};

/// The value of `transfer`: knots, a preset, or a file that holds either.
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
}

impl<'de> Deserialize<'de> for TransferSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = TransferSpec;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a list of knots [s, r, g, b, tau], or an object with `preset` or `file`")
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

/// A transfer function that may still need the range of the data.
pub(crate) enum Recipe {
    Ready(TransferFunction),
    Stretched { path: PathBuf, rows: &'static [[f64; 5]], range: Option<[f64; 2]>, tau_scale: f64 },
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
                file: Some(file),
            }) => {
                let path = beside(path, &file);
                return match parse_file(&path, options)? {
                    TransferSpec::Preset(PresetSpec { file: Some(_), .. }) => {
                        Err(Error::file(&path, "file", "a transfer function file must not name another one"))
                    }
                    spec => Self::new(&path, spec, options),
                };
            }
            TransferSpec::Preset(PresetSpec { preset: Some(name), range, tau_scale, file: None }) => {
                (name, range, tau_scale.unwrap_or(1.0))
            }
            TransferSpec::Preset(_) => {
                let rule = "must have either `preset`, `range` and `tau_scale`, or `file`";
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

    /// Builds the transfer function for data with this range.
    pub(crate) fn build(self, data: [f64; 2]) -> Result<TransferFunction> {
        match self {
            Self::Ready(transfer) => Ok(transfer),
            Self::Stretched { path, rows, range, tau_scale } => {
                let range = range.unwrap_or(data);
                stretch(rows, range, tau_scale).map_err(|error| error.in_file(&path))
            }
        }
    }
}
