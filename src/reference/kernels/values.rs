//! Sums of kernels along a ray: the values that samples contribute, and the models that integrate them.

use super::super::march::finite;
use crate::scene::{Model, TransferFunction};

/// Scalars and weights are clamped to this magnitude, so that sums of their products do not overflow.
const LARGEST: f64 = 1e100;

/// Extinctions are clamped to this, for the same reason.
const MAX_TAU: f64 = 1e150;

/// Sums over the kernels at a place. Density model: extinction and emission. Interpolation model: weight and
/// weighted scalar.
pub(super) type Sums = [f64; 4];

/// Integrates light along a ray, front to back.
pub(super) trait Medium {
    /// Adds a segment of the ray on which the sums are smooth, at or behind the end of the previous one.
    ///
    /// Over a length of `scale`, the sums vary at most as a Gaussian does over one standard deviation.
    fn add(&mut self, from: f64, to: f64, scale: f64, sums: &impl Fn(f64) -> Sums);

    /// Returns whether overlapping kernels with these values are invisible at every place.
    fn is_vacuum(&self, values: impl Iterator<Item = Sums>) -> bool;

    /// Returns whether the rest of the ray is invisible.
    fn is_opaque(&self) -> bool;

    /// Returns premultiplied colour and opacity.
    fn pixel(&self) -> [f64; 4];
}

/// Divides a range into a number of equal parts, at least one.
pub(super) fn parts([from, to]: [f64; 2], count: f64) -> impl Iterator<Item = [f64; 2]> {
    let mut next = (from, 1.0);
    std::iter::from_fn(move || {
        let (here, part) = next;
        let end = if part < count { from + (to - from) * (part / count) } else { to };
        next = (end, part + 1.0);
        (part <= count).then_some([here, end])
    })
}

/// Computes the contribution of a kernel to the sums at its peak.
pub(super) struct Values<'a> {
    pub(super) transfer: &'a TransferFunction,
    pub(super) model: Model,
}

impl Values<'_> {
    /// Returns the scalar of a sample, with infinities replaced by the ends of the transfer function.
    pub(super) fn scalar(&self, s: f64) -> f64 {
        finite(s, self.transfer.domain()).clamp(-LARGEST, LARGEST)
    }

    /// Returns the contribution of a kernel, or `None` if it is invisible.
    pub(super) fn of(&self, s: f64, weight: f64) -> Option<Sums> {
        if s.is_nan() || weight.is_nan() || weight == 0.0 {
            return None;
        }
        let (s, w) = (self.scalar(s), weight.clamp(-LARGEST, LARGEST));
        if self.model == Model::Interpolate {
            return Some([w, w * s, 0.0, 0.0]);
        }
        let (colour, tau) = self.transfer.at(s);
        let tau = (tau.min(MAX_TAU) * w).min(MAX_TAU);
        (tau > 0.0).then_some([tau, tau * colour.x, tau * colour.y, tau * colour.z])
    }
}
