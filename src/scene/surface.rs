//! Triangle meshes that stand in the volume: opaque ones hide what is behind them, translucent ones tint it.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::num;

/// How the colour of a surface depends on where it is seen from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Shading {
    /// Not at all.
    #[default]
    Flat,
    /// Times the cosine between the triangle's normal and the line of sight, as if lit from the eye.
    Headlight,
}

/// A triangle mesh of one colour. Triangles are seen from both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    colour: [f64; 4],
    shading: Shading,
}

impl Surface {
    /// A mesh of triangles, each three indices into `points` (world units). `colour` is straight linear RGB and opacity:
    /// 1 is opaque.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a point is not finite, an index has no point, a colour is negative or not finite, or the opacity
    /// does not lie in [0, 1].
    pub fn new(points: Vec<DVec3>, triangles: Vec<[u32; 3]>, colour: [f64; 4]) -> Result<Self> {
        if let Some(i) = points.iter().position(|point| !point.is_finite()) {
            return Err(Error::invalid("surface", format!("point {i}: {}: must be finite", points[i])));
        }
        let missing = |triangle: &[u32; 3]| triangle.iter().any(|&i| num::index(i) >= points.len());
        if let Some(i) = triangles.iter().position(missing) {
            let why = format!("triangle {i}: {:?}: there are {} points", triangles[i], points.len());
            return Err(Error::invalid("surface", why));
        }
        let [r, g, b, opacity] = colour;
        if [r, g, b].iter().any(|c| !(c.is_finite() && *c >= 0.0)) || !(0.0..=1.0).contains(&opacity) {
            let why = format!("{colour:?}: must be red, green, blue from 0 on and an opacity in [0, 1]");
            return Err(Error::invalid("surface colour", why));
        }
        Ok(Self { points, triangles, colour, shading: Shading::Flat })
    }

    /// The same, shaded otherwise.
    #[must_use]
    pub fn with_shading(self, shading: Shading) -> Self {
        Self { shading, ..self }
    }

    /// Corners, world units.
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Indices of each triangle's corners.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Straight linear RGB and opacity.
    #[must_use]
    pub fn colour(&self) -> [f64; 4] {
        self.colour
    }

    /// How it is shaded.
    #[must_use]
    pub fn shading(&self) -> Shading {
        self.shading
    }

    /// Whether nothing is seen through it.
    #[must_use]
    pub fn is_opaque(&self) -> bool {
        self.colour[3] >= 1.0
    }
}
