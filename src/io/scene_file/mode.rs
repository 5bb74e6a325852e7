//! The keys `mode` and `lighting`: what the ray of a pixel shows.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::scene::{Lighting, Mode};

/// The light of the mode `lit`.
#[derive(Deserialize, JsonSchema)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with `ambient`, `diffuse`, `specular`, `shininess`, `direction` and `least_gradient`"
)]
pub(crate) struct LightingSpec {
    /// Sets the share of the colour that is seen in any light.
    #[schemars(range(min = 0), extend("default" = Lighting::default().ambient))]
    ambient: Option<f64>,
    /// Sets the share of the colour that is seen where a surface faces the light.
    #[schemars(range(min = 0), extend("default" = Lighting::default().diffuse))]
    diffuse: Option<f64>,
    /// Sets the brightness of the white highlight.
    #[schemars(range(min = 0), extend("default" = Lighting::default().specular))]
    specular: Option<f64>,
    /// Sets the exponent of the highlight: larger is smaller and sharper.
    #[schemars(
        range(min = Lighting::SHININESS[0], max = Lighting::SHININESS[1]),
        extend("default" = Lighting::default().shininess)
    )]
    shininess: Option<f64>,
    /// Sets the direction to the light, in world coordinates, of any length but 0. Left out: to the eye.
    direction: Option<[f64; 3]>,
    /// Sets the length of the gradient up to which nothing is lit, in scalars per world unit. Left out: 1e-4 of the range
    /// of the samples per voxel.
    #[schemars(range(min = 0))]
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
