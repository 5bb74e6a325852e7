//! Values that samples contribute to the sums of kernels.

use super::medium::Sums;
use crate::scene::{Model, TransferFunction};

/// Scalars and weights are clamped to this magnitude, so that sums of their products do not overflow.
const LARGEST: f64 = 1e100;

/// Extinctions are clamped to this, for the same reason.
const MAX_TAU: f64 = 1e150;

/// Computes the contribution of a kernel to the sums at its peak.
pub(super) struct Values<'a> {
    pub(super) transfer: &'a TransferFunction,
    pub(super) model: Model,
}

impl Values<'_> {
    /// Returns the scalar of a sample, with infinities replaced by the ends of the transfer function.
    pub(super) fn scalar(&self, s: f64) -> f64 {
        let [low, high] = self.transfer.domain();
        let s = if s == f64::INFINITY {
            high
        } else if s == f64::NEG_INFINITY {
            low
        } else {
            s
        };
        s.clamp(-LARGEST, LARGEST)
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
