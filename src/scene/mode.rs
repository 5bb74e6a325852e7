//! What the ray of a pixel shows of a grid: emission and absorption, the same lit, or the greatest scalar.

use glam::DVec3;

use super::grid::Grid;
use crate::error::{Error, Result};

/// What the ray of a pixel shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Mode {
    /// Emission and absorption of the transfer function along the ray.
    #[default]
    Emission,
    /// The same, with the emitted colour lit; for grids.
    Lit(Lighting),
    /// Maximum intensity projection: colour and opacity of the greatest scalar along the ray, with the path of one
    /// voxel (the least spacing of samples); for grids. A ray that meets no sample but NaN shows nothing.
    Maximum,
}

impl Mode {
    /// The names in scene files and on the command line.
    pub const NAMES: [&'static str; 3] = ["emission", "lit", "maximum"];

    /// Returns the mode's name in scene files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        let [emission, lit, maximum] = Self::NAMES;
        match self {
            Self::Emission => emission,
            Self::Lit(_) => lit,
            Self::Maximum => maximum,
        }
    }

    /// Returns the mode of a name; lit with the default lighting.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for an unknown name; it lists the known ones.
    pub fn from_name(name: &str) -> Result<Self> {
        let all = [Self::Emission, Self::Lit(Lighting::default()), Self::Maximum];
        all.into_iter().find(|mode| mode.name() == name).ok_or_else(|| {
            let names = Self::NAMES.join(", ");
            Error::invalid("mode", format!("\"{name}\": must be one of {names}"))
        })
    }

    /// Checks the numbers of the lighting.
    ///
    /// # Errors
    ///
    /// As [`Lighting::check`].
    pub fn check(&self) -> Result<()> {
        if let Self::Lit(lighting) = self { lighting.check() } else { Ok(()) }
    }
}

/// Illumination of a grid by one directional light (Phong's model), from both sides of its surfaces.
///
/// The emitted colour c becomes `c (ambient + diffuse |n.l|) + specular |n.h|^shininess`. n is the normalised central
/// difference of the trilinear field at one voxel's distance along each axis of the grid; places beyond the grid take
/// the value of its nearest place. l points to the light and h halves the angle between l and the direction to the eye.
/// Where n's length before normalisation is at most `least_gradient`, or a sample around is NaN, the colour is c.
/// Extinction is not affected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// Share of the colour that is seen whatever the direction of the light.
    pub ambient: f64,
    /// Share of the colour that is seen where n points to the light.
    pub diffuse: f64,
    /// Brightness of the white highlight.
    pub specular: f64,
    /// Exponent of the highlight, 1 to 1024: larger is smaller and sharper.
    pub shininess: f64,
    /// Direction to the light, in world coordinates, of any length; `None`: to the eye, along each ray.
    pub direction: Option<DVec3>,
    /// Length of the gradient, in scalars per unit of world length, up to which nothing is lit; `None`: a ten-thousandth
    /// of the range of the samples over the least spacing, which leaves out the rounding of constant regions.
    pub least_gradient: Option<f64>,
}

impl Default for Lighting {
    /// A light at the eye: ambient 0.3, diffuse 0.7, specular 0.2, shininess 20.
    fn default() -> Self {
        Self {
            ambient: 0.3,
            diffuse: 0.7,
            specular: 0.2,
            shininess: 20.0,
            direction: None,
            least_gradient: None,
        }
    }
}

impl Lighting {
    /// Least and largest allowed [`Self::shininess`].
    pub const SHININESS: [f64; 2] = [1.0, 1024.0];

    /// Checks the numbers.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming the number and the rule: shares and the least gradient finite and not negative, the
    /// shininess 1 to 1024, the direction finite and not zero.
    pub fn check(&self) -> Result<()> {
        let refuse = |what: &str, why: String| Err(Error::invalid(format!("lighting {what}"), why));
        for (what, value) in [
            ("ambient", self.ambient),
            ("diffuse", self.diffuse),
            ("specular", self.specular),
            ("least_gradient", self.least_gradient.unwrap_or(0.0)),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(what, format!("{value}: must be a number that is not negative"));
            }
        }
        let [low, high] = Self::SHININESS;
        if !(low..=high).contains(&self.shininess) {
            return refuse("shininess", format!("{}: must be {low} to {high}", self.shininess));
        }
        match self.direction {
            Some(direction) if direction.try_normalize().is_none() => {
                refuse("direction", format!("{direction}: must have a finite length above 0"))
            }
            _ => Ok(()),
        }
    }

    /// Returns the length of the gradient up to which nothing is lit in a grid.
    pub(crate) fn least_gradient_of(&self, grid: &Grid) -> f64 {
        let [low, high] = grid.range();
        self.least_gradient.unwrap_or(1e-4 * (high - low) / grid.spacing().min_element())
    }

    /// Returns the largest colour that a colour of at most `colour` becomes.
    pub(crate) fn brightest(&self, colour: f64) -> f64 {
        colour * (self.ambient + self.diffuse).max(1.0) + self.specular
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_have_names_and_rules() {
        for name in ["emission", "lit", "maximum"] {
            assert_eq!(Mode::from_name(name).unwrap().name(), name);
        }
        assert!(Mode::from_name("mip").unwrap_err().to_string().contains("emission, lit, maximum"));
        let usual = Lighting::default();
        Mode::Lit(usual).check().unwrap();
        for (wrong, word) in [
            (Lighting { ambient: -0.1, ..usual }, "ambient"),
            (Lighting { specular: f64::NAN, ..usual }, "specular"),
            (Lighting { shininess: 0.5, ..usual }, "shininess: 0.5: must be 1 to 1024"),
            (Lighting { direction: Some(DVec3::ZERO), ..usual }, "direction"),
            (Lighting { least_gradient: Some(f64::INFINITY), ..usual }, "least_gradient"),
        ] {
            let why = Mode::Lit(wrong).check().unwrap_err().to_string();
            assert!(why.contains(word), "{why}");
        }
    }
}
