//! The keys `mode` and `lighting`: what the ray of a pixel shows.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::scene::{Lighting, Mode};

/// The object `lighting`. Keys left out keep their defaults.
#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with `ambient`, `diffuse`, `specular`, `shininess`, `direction` and `least_gradient`"
)]
pub(crate) struct LightingSpec {
    ambient: Option<f64>,
    diffuse: Option<f64>,
    specular: Option<f64>,
    shininess: Option<f64>,
    direction: Option<[f64; 3]>,
    least_gradient: Option<f64>,
}

impl LightingSpec {
    fn lighting(&self) -> Lighting {
        let usual = Lighting::default();
        Lighting {
            ambient: self.ambient.unwrap_or(usual.ambient),
            diffuse: self.diffuse.unwrap_or(usual.diffuse),
            specular: self.specular.unwrap_or(usual.specular),
            shininess: self.shininess.unwrap_or(usual.shininess),
            direction: self.direction.map(Into::into),
            least_gradient: self.least_gradient,
        }
    }
}

/// Returns the mode of the two keys; `None` where neither is given. `lighting` alone means lit.
pub(crate) fn mode(path: &Path, name: Option<&str>, lighting: Option<&LightingSpec>) -> Result<Option<Mode>> {
    let named =
        name.map(|name| Mode::from_name(name).map_err(|error| error.at_place(path, "mode"))).transpose()?;
    let mode = match (named, lighting) {
        (None | Some(Mode::Lit(_)), Some(spec)) => Some(Mode::Lit(spec.lighting())),
        (Some(other), Some(_)) => {
            return Err(Error::file(
                path,
                "lighting",
                format!("belongs to mode lit, not to {}", other.name()),
            ));
        }
        (named, None) => named,
    };
    mode.map_or(Ok(()), |mode| mode.check()).map_err(|error| match error {
        Error::Invalid { what, why } => Error::file(path, what.replacen(' ', ".", 1), why),
        other => other,
    })?;
    Ok(mode)
}
