//! Clip planes and a crop box: the region in which the volume is drawn.

use glam::DVec3;

use crate::error::{Error, Result};

/// A plane that keeps the half-space its normal points into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipPlane {
    /// A point on the plane, world units.
    pub point: DVec3,
    /// Unit vector that points into the half-space that is kept.
    pub normal: DVec3,
}

/// A convex region outside of which the volume is not drawn: the intersection of up to six half-spaces and an
/// axis-aligned box.
///
/// Every technique clips each pixel's ray at the boundary of the region, so the clip is exact along the ray.
/// Surfaces are not clipped.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Clip {
    planes: [Option<ClipPlane>; Self::MAX_PLANES],
    crop: Option<[DVec3; 2]>,
}

impl Clip {
    /// Largest number of clip planes, not counting the box.
    pub const MAX_PLANES: usize = 6;

    /// Returns the region that clips nothing.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Adds a plane through `point`; it keeps the half-space that `normal` points into. The normal may have
    /// any length.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a number is not finite, the normal has no length, or there are already six
    /// planes.
    pub fn with_plane(mut self, point: DVec3, normal: DVec3) -> Result<Self> {
        if !point.is_finite() {
            return Err(Error::invalid("clip plane point", format!("{point}: must be finite")));
        }
        // Scale first: squares of its components may overflow or vanish.
        let scaled = normal / normal.abs().max_element();
        let normal = scaled.try_normalize().filter(|_| normal.is_finite()).ok_or_else(|| {
            Error::invalid("clip plane normal", format!("{normal}: must have a finite length"))
        })?;
        let Some(free) = self.planes.iter_mut().find(|plane| plane.is_none()) else {
            return Err(Error::invalid("clip planes", format!("at most {} are allowed", Self::MAX_PLANES)));
        };
        *free = Some(ClipPlane { point, normal });
        Ok(self)
    }

    /// Sets the crop box, which keeps the volume between two corners. An infinite side clips nothing.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a number is NaN, or `low` is not below `high` on every axis.
    pub fn with_crop(mut self, low: DVec3, high: DVec3) -> Result<Self> {
        if !low.cmplt(high).all() {
            let why = format!("{low} to {high}: low must be below high on every axis");
            return Err(Error::invalid("crop box", why));
        }
        self.crop = Some([low, high]);
        Ok(self)
    }

    /// Returns the region within a box.
    pub(crate) fn cropped(mut self, low: DVec3, high: DVec3) -> Self {
        let [from, to] = self.crop.unwrap_or([low, high]);
        self.crop = Some([from.max(low), to.min(high)]);
        self
    }

    /// Returns the clip planes.
    pub fn planes(&self) -> impl Iterator<Item = ClipPlane> + '_ {
        self.planes.iter().flatten().copied()
    }

    /// Returns the least and the greatest corner of the crop box.
    #[must_use]
    pub fn crop(&self) -> Option<[DVec3; 2]> {
        self.crop
    }

    /// Returns whether nothing is clipped.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.half_spaces().next().is_none()
    }

    /// Returns every half-space that is kept, including the finite sides of the box; at most twelve.
    pub fn half_spaces(&self) -> impl Iterator<Item = ClipPlane> + '_ {
        // The other two coordinates of a corner may be infinite.
        let side = |corner: DVec3, axis: usize, towards: f64| {
            let unit = DVec3::AXES[axis];
            corner[axis].is_finite().then(|| ClipPlane { point: unit * corner[axis], normal: unit * towards })
        };
        let sides = self.crop.into_iter().flat_map(move |[low, high]| {
            (0..3).flat_map(move |axis| [side(low, axis, 1.0), side(high, axis, -1.0)]).flatten()
        });
        self.planes().chain(sides)
    }

    /// Clips a ray: returns the part of `range`, as parameters of the ray, that lies in the region. It is
    /// empty when begin >= end.
    #[must_use]
    pub fn range(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> [f64; 2] {
        let [mut begin, mut end] = range;
        for plane in self.half_spaces() {
            let height = (origin - plane.point).dot(plane.normal);
            let rise = direction.dot(plane.normal);
            if rise > 0.0 {
                begin = begin.max(-height / rise);
            } else if rise < 0.0 {
                end = end.min(-height / rise);
            } else if height < 0.0 {
                return [0.0, 0.0];
            }
        }
        [begin, end]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_is_cut_where_it_crosses_planes_and_box() {
        let clip = Clip::none()
            .with_plane(DVec3::new(0.25, 9.0, 9.0), DVec3::new(2.0, 0.0, 0.0))
            .unwrap()
            .with_crop(DVec3::new(-1.0, -1.0, f64::NEG_INFINITY), DVec3::new(1.0, 1.0, f64::INFINITY))
            .unwrap();
        let all = [f64::NEG_INFINITY, f64::INFINITY];
        assert_eq!(clip.half_spaces().count(), 5);
        assert_eq!(clip.range(DVec3::ZERO, DVec3::X, all), [0.25, 1.0]);
        assert_eq!(clip.range(DVec3::ZERO, -DVec3::X, all), [-1.0, -0.25]);
        let [begin, end] = clip.range(DVec3::ZERO, DVec3::Z, all);
        assert!(begin >= end, "beside the plane");
        assert_eq!(clip.range(DVec3::X * 0.5, DVec3::Z, [0.0, f64::INFINITY]), [0.0, f64::INFINITY]);
        assert!(Clip::none().is_none() && !clip.is_none());
    }

    #[test]
    fn refuses_what_is_no_region() {
        let why = |result: Result<Clip>| result.unwrap_err().to_string();
        assert!(why(Clip::none().with_plane(DVec3::NAN, DVec3::X)).contains("finite"));
        assert!(why(Clip::none().with_plane(DVec3::X, DVec3::ZERO)).contains("length"));
        assert!(why(Clip::none().with_crop(DVec3::ONE, DVec3::ONE)).contains("below"));
        assert!(why(Clip::none().with_crop(DVec3::NAN, DVec3::ONE)).contains("below"));
        for length in [1e200, 1e-170] {
            let plane = Clip::none().with_plane(DVec3::ZERO, DVec3::new(3.0, 4.0, 0.0) * length).unwrap();
            let normal = plane.planes().next().unwrap().normal;
            assert!((normal - DVec3::new(0.6, 0.8, 0.0)).length() < 1e-15, "{length}: {normal}");
        }
        let six = (0..6).try_fold(Clip::none(), |clip, _| clip.with_plane(DVec3::ZERO, DVec3::X)).unwrap();
        assert_eq!(six.planes().count(), 6);
        assert!(why(six.with_plane(DVec3::ZERO, DVec3::X)).contains("at most 6"));
    }
}
