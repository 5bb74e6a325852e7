//! The records of splats that go to the device.

use crate::num::f32_of;
use crate::scene::TransferFunction;

/// What goes to the device, four floats each.
#[derive(Debug, Default)]
pub(crate) struct Lists {
    pub(crate) points: Vec<[f32; 4]>,
    pub(crate) shapes: Vec<[f32; 4]>,
}

/// Premultiplied by nothing: colour, and extinction times weight.
pub(crate) fn classified(transfer: &TransferFunction, s: f64, weight: f64) -> [f32; 4] {
    let (colour, tau) = transfer.at(s);
    // What overflows is opaque long before.
    let extinction = (tau * weight).clamp(0.0, 1e30);
    [colour.x, colour.y, colour.z, extinction].map(f32_of)
}

/// A scalar with infinities as the transfer function's ends.
pub(crate) fn finite(s: f64, [low, high]: [f64; 2]) -> f64 {
    if s == f64::INFINITY {
        high
    } else if s == f64::NEG_INFINITY {
        low
    } else {
        s
    }
}
