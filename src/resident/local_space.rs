//! Coordinates relative to the data, and the view in them (`mesh.glsl`).

use glam::DVec3;

use crate::error::{Error, Result};
use crate::interface::MeshPush;
use crate::num::f32_of;
use crate::scene::{Tets, View};

/// Centre and radius of the data, in world units: all points lie within one radius of the centre.
///
/// Points and views are derived in float64 relative to them. So float32 keeps all its digits for the data, wherever it
/// lies and however large it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalSpace {
    pub(crate) centre: DVec3,
    pub(crate) radius: f64,
}

impl LocalSpace {
    /// Takes the centre of the box around a mesh, and half its diagonal.
    pub(crate) fn of(mesh: &Tets) -> Self {
        Self::around(mesh.bounds())
    }

    /// Takes the centre of a box, and half its diagonal.
    pub(crate) fn around([low, high]: [DVec3; 2]) -> Self {
        let half = high * 0.5 - low * 0.5;
        Self { centre: low + half, radius: half.length().max(f64::MIN_POSITIVE) }
    }

    /// Returns a point relative to the centre, in radii.
    pub(crate) fn place(&self, point: DVec3) -> [f32; 3] {
        ((point - self.centre) / self.radius).to_array().map(f32_of)
    }

    /// Returns `push` with the fields of a view replaced.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] where float32 cannot hold the view.
    pub(crate) fn push(&self, view: &View, push: &MeshPush) -> Result<MeshPush> {
        let LocalView { rows: [right, up, forward], begin, pixel, w0, w1, slope } = self.view(view);
        let pack = |(v, w): (DVec3, f64)| [v.x, v.y, v.z, w].map(f32_of);
        let (aspect, skew) = view.shape();
        let push = MeshPush {
            right: pack(right),
            up: pack(up),
            forward: pack((forward.0, begin)),
            half_extent: view.half_extent(),
            pixel: f32_of(pixel),
            w0: f32_of(w0),
            w1: f32_of(w1),
            slope: f32_of(slope),
            unit: f32_of(self.radius),
            aspect: f32_of(aspect),
            skew: skew.to_array().map(f32_of),
            ..*push
        };
        let numbers = [push.right, push.up, push.forward];
        let finite = numbers.iter().flatten().chain(&push.skew).all(|number| number.is_finite());
        if !(finite && push.pixel.is_normal() && push.unit.is_normal()) {
            return Err(Error::invalid(
                "view",
                "the camera is so far from the data, or the data so large or small, that float32 cannot hold the view",
            ));
        }
        Ok(push)
    }

    /// Returns a view relative to the centre, in radii.
    pub(crate) fn view(&self, view: &View) -> LocalView {
        let eye = (view.camera().eye - self.centre) / self.radius;
        let depth = -eye.dot(view.forward());
        // In perspective w is the distance ahead of the eye, divided by that of the centre where the eye is far.
        let (w0, w1, pixel, slope, begin) = if view.is_perspective() {
            let q = depth.max(1.0);
            (depth / q, 1.0 / q, view.pixel_size() * q, 1.0 / q, -depth)
        } else {
            (1.0, 0.0, view.pixel_size() / self.radius, 0.0, -3e38)
        };
        let row = |axis: DVec3| (axis, -eye.dot(axis));
        let [right, up, forward] = view.rows();
        let rows = [row(right), row(up), (forward, 0.0)];
        LocalView { rows, begin, pixel, w0, w1, slope }
    }
}

/// A view relative to the centre of the data, in radii.
///
/// The view coordinates X, Y and depth of a point p are the dot products of p with the vectors of `rows` ([`View::rows`]), plus the
/// offset of each. The ray of a pixel P passes through (P w, depth) with w = `w0` + `w1` depth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalView {
    /// Vector and offset of X, Y and depth.
    pub(crate) rows: [(DVec3, f64); 3],
    /// Depth of the eye, where rays begin; far below all data for parallel rays.
    pub(crate) begin: f64,
    /// Size of a pixel, in units of P.
    pub(crate) pixel: f64,
    pub(crate) w0: f64,
    pub(crate) w1: f64,
    /// Tangent of the angle between a ray and the view direction, per unit of P.
    pub(crate) slope: f64,
}
