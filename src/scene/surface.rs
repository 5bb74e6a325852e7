//! Triangle meshes inside the volume: opaque ones hide what is behind them, translucent ones tint it.

use std::collections::HashMap;

use glam::DVec3;

use super::grid::box_corners;
use crate::error::{Error, Result};
use crate::num;

/// Selects how the colour of a surface depends on the viewing direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Shading {
    /// The colour is constant.
    #[default]
    Flat,
    /// The colour is multiplied by the cosine between the triangle's normal and the ray, as for a light at
    /// the eye.
    Headlight,
}

/// A triangle mesh of one colour, visible from both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    colour: [f64; 4],
    shading: Shading,
}

impl Surface {
    /// Makes a mesh of triangles, each three indices into `points`.
    ///
    /// `points` are in world units. `colour` is straight linear RGB and opacity; opacity 1 is opaque.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a point is not finite, an index has no point, a colour is negative or not
    /// finite, or the opacity is not in [0, 1].
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
            let why = format!("{colour:?}: red, green and blue must be at least 0, the opacity in [0, 1]");
            return Err(Error::invalid("surface colour", why));
        }
        Ok(Self { points, triangles, colour, shading: Shading::Flat })
    }

    /// Makes an axis-aligned box from its least to its greatest corner: 12 triangles, counter-clockwise seen
    /// from outside.
    ///
    /// # Errors
    ///
    /// As [`Self::new`]; [`Error::Invalid`] if `low` is not below `high` on every axis.
    pub fn cuboid(low: DVec3, high: DVec3, colour: [f64; 4]) -> Result<Self> {
        if !low.cmplt(high).all() {
            let why = format!("{low} to {high}: low must be below high on every axis");
            return Err(Error::invalid("surface box", why));
        }
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Self::new(box_corners([low, high]).to_vec(), triangles, colour)
    }

    /// Largest number of subdivisions of a sphere: 5,242,880 triangles.
    pub const MAX_SUBDIVISIONS: u32 = 9;

    /// Makes a sphere from an icosahedron, each triangle split into four `subdivisions` times,
    /// counter-clockwise seen from outside.
    ///
    /// All corners lie on the sphere to rounding. The mesh lies inside it: by up to 0.2 radii without
    /// subdivisions, and by a quarter of that after each.
    ///
    /// # Errors
    ///
    /// As [`Self::new`]; [`Error::Invalid`] if the radius is not positive and finite, or there are more than
    /// [`Self::MAX_SUBDIVISIONS`].
    pub fn sphere(centre: DVec3, radius: f64, colour: [f64; 4], subdivisions: u32) -> Result<Self> {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::invalid("surface radius", format!("{radius}: must be positive and finite")));
        }
        if subdivisions > Self::MAX_SUBDIVISIONS {
            let why = format!("{subdivisions}: must be at most {}", Self::MAX_SUBDIVISIONS);
            return Err(Error::invalid("surface subdivisions", why));
        }
        let (mut corners, mut triangles) = icosahedron();
        for _ in 0..subdivisions {
            let mut halved = HashMap::with_capacity(triangles.len() * 3 / 2);
            let mut middle = |a: u32, b: u32| {
                *halved.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    corners.push((corners[num::index(a)] + corners[num::index(b)]).normalize());
                    num::count(corners.len() - 1)
                })
            };
            triangles = triangles
                .into_iter()
                .flat_map(|[a, b, c]| {
                    let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
                })
                .collect();
        }
        Self::new(corners.into_iter().map(|p| centre + p * radius).collect(), triangles, colour)
    }

    /// Returns the surface with another shading.
    #[must_use]
    pub fn with_shading(self, shading: Shading) -> Self {
        Self { shading, ..self }
    }

    /// Returns the surface with each point multiplied by `scale` and moved by `offset`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a resulting point is not finite.
    pub fn placed(mut self, scale: f64, offset: DVec3) -> Result<Self> {
        for (i, point) in self.points.iter_mut().enumerate() {
            *point = *point * scale + offset;
            if !point.is_finite() {
                return Err(Error::invalid("surface", format!("point {i}: {point}: must be finite")));
            }
        }
        Ok(self)
    }

    /// Returns the least and the greatest corner of the box around the points, or `None` without points.
    #[must_use]
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let all = |f: fn(DVec3, DVec3) -> DVec3| self.points.iter().copied().reduce(f);
        Some([all(DVec3::min)?, all(DVec3::max)?])
    }

    /// Returns the points, world units.
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Returns the indices of each triangle's corners.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns straight linear RGB and opacity.
    #[must_use]
    pub fn colour(&self) -> [f64; 4] {
        self.colour
    }

    /// Returns the shading.
    #[must_use]
    pub fn shading(&self) -> Shading {
        self.shading
    }

    /// Returns whether the surface is visible and translucent.
    #[must_use]
    pub fn is_translucent(&self) -> bool {
        !self.triangles.is_empty() && self.colour[3] > 0.0 && !self.is_opaque()
    }

    /// Returns whether the surface hides what is behind it.
    #[must_use]
    pub fn is_opaque(&self) -> bool {
        self.colour[3] >= 1.0
    }
}

/// Returns corners on the unit sphere (those of three golden rectangles) and triangles, counter-clockwise
/// seen from outside.
fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let long = f64::midpoint(1.0, 5.0_f64.sqrt());
    let corners = (0..12_usize)
        .map(|i| {
            let (sign, axis) = (|bit: usize| if i & bit == 0 { 1.0 } else { -1.0 }, i / 4);
            let mut corner = DVec3::ZERO;
            (corner[axis], corner[(axis + 1) % 3]) = (sign(1) * long, sign(2));
            corner.normalize()
        })
        .collect();
    let triangles = [
        0, 8, 2, 0, 2, 9, 0, 6, 4, 0, 4, 8, 0, 9, 6, 1, 3, 10, 1, 11, 3, 1, 4, 6, 1, 10, 4, 1, 6, 11, 2, 5,
        7, 2, 8, 5, 2, 7, 9, 3, 7, 5, 3, 5, 10, 3, 11, 7, 4, 10, 8, 5, 8, 10, 6, 9, 11, 7, 11, 9,
    ];
    (corners, triangles.as_chunks::<3>().0.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: [f64; 4] = [1.0; 4];

    /// Asserts that every edge belongs to two triangles in opposite directions; returns the enclosed volume.
    fn closed(surface: &Surface) -> f64 {
        let mut edges = HashMap::new();
        let mut volume = 0.0;
        for &[a, b, c] in surface.triangles() {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((from.min(to), from.max(to))).or_insert(0) += if from < to { 1 } else { 1000 };
            }
            let [a, b, c] = [a, b, c].map(|i| surface.points()[num::index(i)]);
            volume += a.dot(b.cross(c)) / 6.0;
        }
        assert!(edges.values().all(|&passes| passes == 1001), "an edge is not shared by two");
        volume
    }

    #[test]
    fn boxes_are_closed_and_face_outward() {
        let (low, high) = (DVec3::new(-1.0, 0.5, 2.0), DVec3::new(0.0, 2.5, 5.0));
        let surface = Surface::cuboid(low, high, WHITE).unwrap();
        assert_eq!((surface.points().len(), surface.triangles().len()), (8, 12));
        assert!((closed(&surface) - 6.0).abs() < 1e-13);
        assert_eq!(surface.bounds(), Some([low, high]));
        assert_eq!(Surface::new(vec![], vec![], WHITE).unwrap().bounds(), None);
        for wrong in [DVec3::new(0.0, 2.5, 2.0), low, DVec3::NAN] {
            assert!(Surface::cuboid(low, wrong, WHITE).unwrap_err().to_string().contains("below"), "{wrong}");
        }
        assert!(
            Surface::cuboid(DVec3::NEG_INFINITY, high, WHITE).unwrap_err().to_string().contains("finite")
        );
    }

    #[test]
    fn spheres_are_closed_and_their_corners_on_the_sphere() {
        let (centre, radius) = (DVec3::new(3.0, -2.0, 1.0), 2.5);
        let ball = 4.0 / 3.0 * std::f64::consts::PI * f64::powi(radius, 3);
        let mut last = ball;
        for n in 0..5 {
            let surface = Surface::sphere(centre, radius, WHITE, n).unwrap();
            let count = 20 * 4_usize.pow(n);
            assert_eq!((surface.triangles().len(), surface.points().len()), (count, count / 2 + 2));
            for p in surface.points() {
                assert!(((*p - centre).length() - radius).abs() < 1e-14 * radius);
            }
            // The missing volume falls by four with each subdivision.
            let lacks = ball - closed(&surface);
            assert!(lacks > 0.0 && lacks < 0.4 * last, "{n}: {lacks}");
            last = lacks;
        }
        let why = |radius, n| Surface::sphere(centre, radius, WHITE, n).unwrap_err().to_string();
        assert!(why(0.0, 1).contains("radius") && why(f64::INFINITY, 1).contains("radius"));
        assert!(why(1.0, 10).contains("subdivisions: 10: must be at most 9"));
    }
}
