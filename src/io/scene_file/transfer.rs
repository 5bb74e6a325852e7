//! The transfer function that a scene file names, and those that are ready-made.

use std::fmt;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::de::{MapAccess, SeqAccess, Visitor, value};
use serde::{Deserialize, Deserializer};

use crate::error::{Error, Result};
use crate::io::ReadOptions;
use crate::io::scene_file::{beside, parse};
use crate::scene::{Knot, TransferFunction};

/// Knots, a preset, or a file that holds one of them.
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

/// A transfer function that may still need the data's range.
pub(crate) enum Recipe {
    Ready(TransferFunction),
    Stretched { path: PathBuf, rows: &'static [[f64; 5]], range: Option<[f64; 2]>, tau_scale: f64 },
}

impl Recipe {
    pub(crate) fn new(path: &Path, spec: TransferSpec, options: &ReadOptions) -> Result<Self> {
        let spec = match spec {
            TransferSpec::Preset(PresetSpec {
                preset: None,
                range: None,
                tau_scale: None,
                file: Some(file),
            }) => {
                let path = beside(path, &file);
                return match parse(&path, options)? {
                    TransferSpec::Preset(PresetSpec { file: Some(_), .. }) => {
                        Err(Error::file(&path, "file", "a transfer function file must not name another one"))
                    }
                    spec => Self::new(&path, spec, options),
                };
            }
            TransferSpec::Preset(spec) => spec,
            TransferSpec::Rows(rows) => {
                return TransferFunction::from_rows(&rows)
                    .map(Self::Ready)
                    .map_err(|error| error.in_file(path));
            }
        };
        let refuse = |place: &str, rule: String| Err(Error::file(path, place, rule));
        let name = match (&spec.preset, &spec.file) {
            (Some(name), None) => name,
            _ => {
                return refuse(
                    "transfer",
                    "must have either `preset`, `range` and `tau_scale`, or `file`".into(),
                );
            }
        };
        let Some(preset) = PRESETS.iter().find(|preset| preset.name == name) else {
            let names = PRESETS.map(|preset| preset.name).join(", ");
            return refuse("transfer.preset", format!("\"{name}\": must be one of {names}"));
        };
        if let Some([lo, hi]) = spec.range
            && !(lo < hi && (hi - lo).is_finite())
        {
            return refuse("transfer.range", format!("[{lo}, {hi}]: the first must be below the second"));
        }
        let tau_scale = spec.tau_scale.unwrap_or(1.0);
        if !(tau_scale >= 0.0 && tau_scale.is_finite()) {
            return refuse("transfer.tau_scale", format!("{tau_scale}: must be finite and not negative"));
        }
        Ok(Self::Stretched { path: path.to_path_buf(), rows: preset.rows, range: spec.range, tau_scale })
    }

    /// The transfer function for data of a range.
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

/// A ready-made transfer function on [0, 1].
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Its name in scene files.
    pub name: &'static str,
    /// What it is for.
    pub purpose: &'static str,
    rows: &'static [[f64; 5]],
}

impl Preset {
    /// The transfer function with its [0, 1] stretched over `range` and its extinction, which is meant
    /// for a box of side 2, times `tau_scale`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a number is not finite or `tau_scale` is negative.
    pub fn transfer(&self, range: [f64; 2], tau_scale: f64) -> Result<TransferFunction> {
        stretch(self.rows, range, tau_scale)
    }
}

fn stretch(rows: &[[f64; 5]], [lo, hi]: [f64; 2], tau_scale: f64) -> Result<TransferFunction> {
    let knot = |&[s, r, g, b, tau]: &[f64; 5]| Knot {
        s: lo + (hi - lo) * s,
        colour: DVec3::new(r, g, b),
        tau: tau * tau_scale,
    };
    TransferFunction::new(rows.iter().map(knot).collect())
}

/// The presets that scene files may name. Extinction is per unit of length in a box of side 2:
/// for other boxes `tau_scale` is about 2 over the side.
pub const PRESETS: [Preset; 5] = [
    Preset {
        name: "grey",
        purpose: "brightness and extinction grow with the value",
        rows: &[[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0, 4.0]],
    },
    Preset {
        name: "fog",
        purpose: "translucent, from blue over cream to red",
        rows: &[
            [0.0, 0.1, 0.2, 0.7, 0.0],
            [0.06, 0.1, 0.2, 0.7, 0.0],
            [0.3, 0.2, 0.6, 0.9, 1.0],
            [0.6, 0.9, 0.85, 0.3, 3.0],
            [1.0, 1.0, 0.25, 0.1, 8.0],
        ],
    },
    Preset {
        name: "shells",
        purpose: "a bright shell about 0.5 and a faint violet body above 0.8",
        rows: &[
            [0.0, 0.1, 0.2, 0.6, 0.0],
            [0.42, 0.9, 0.4, 0.1, 0.0],
            [0.5, 1.0, 0.8, 0.3, 30.0],
            [0.58, 0.2, 0.6, 0.9, 0.0],
            [0.8, 0.2, 0.6, 0.9, 0.0],
            [0.9, 0.3, 0.4, 1.0, 2.0],
            [1.0, 0.6, 0.2, 0.8, 2.0],
        ],
    },
    Preset {
        name: "bone",
        purpose: "computed tomography from air to dense bone: faint soft tissue, solid bone",
        rows: &[
            [0.0, 0.35, 0.12, 0.06, 0.0],
            [0.22, 0.35, 0.12, 0.06, 0.0],
            [0.30, 0.55, 0.20, 0.10, 0.4],
            [0.38, 0.75, 0.42, 0.25, 0.6],
            [0.50, 0.95, 0.85, 0.65, 12.0],
            [1.0, 1.0, 0.98, 0.92, 40.0],
        ],
    },
    Preset {
        name: "surface",
        purpose: "an opaque body from the middle of the range up, as from a mask",
        rows: &[
            [0.0, 0.6, 0.3, 0.15, 0.0],
            [0.45, 0.6, 0.3, 0.15, 0.0],
            [0.55, 0.85, 0.6, 0.4, 60.0],
            [1.0, 1.0, 0.95, 0.85, 60.0],
        ],
    },
];
