//! The records of splats that go to the device.

use crate::num::f32_of;
use crate::scene::TransferFunction;

/// Lists for the device, four floats an entry.
#[derive(Debug, Default)]
pub(crate) struct Records {
    pub(crate) points: Vec<[f32; 4]>,
    pub(crate) shapes: Vec<[f32; 4]>,
}

/// Returns the colour of a scalar, not premultiplied, and its extinction times `weight`.
pub(crate) fn classified(transfer: &TransferFunction, s: f64, weight: f64) -> [f32; 4] {
    let (colour, tau) = transfer.at(s);
    // A kernel is opaque long before its extinction overflows.
    let extinction = (tau * weight).clamp(0.0, 1e30);
    [colour.x, colour.y, colour.z, extinction].map(f32_of)
}

/// Returns a scalar, with infinities replaced by the ends of the transfer function.
pub(crate) fn finite(s: f64, [low, high]: [f64; 2]) -> f64 {
    if s == f64::INFINITY {
        high
    } else if s == f64::NEG_INFINITY {
        low
    } else {
        s
    }
}
