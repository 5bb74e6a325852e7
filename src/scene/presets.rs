//! Ready-made transfer functions.

use glam::DVec3;

use crate::error::Result;
use crate::scene::{Knot, TransferFunction};

/// A ready-made transfer function on the scalar range [0, 1].
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// The name in scene files.
    pub name: &'static str,
    /// The purpose, as a phrase.
    pub purpose: &'static str,
    pub(crate) rows: &'static [[f64; 5]],
}

impl Preset {
    /// Stretches the transfer function over `range`, and multiplies its extinction, which suits a box of side 2, by
    /// `tau_scale`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`](crate::Error::Invalid) if a number is not finite or `tau_scale` is negative.
    pub fn transfer(&self, range: [f64; 2], tau_scale: f64) -> Result<TransferFunction> {
        stretch(self.rows, range, tau_scale)
    }
}

pub(crate) fn stretch(rows: &[[f64; 5]], [lo, hi]: [f64; 2], tau_scale: f64) -> Result<TransferFunction> {
    let knot = |&[s, r, g, b, tau]: &[f64; 5]| Knot {
        s: lo + (hi - lo) * s,
        colour: DVec3::new(r, g, b),
        tau: tau * tau_scale,
    };
    TransferFunction::new(rows.iter().map(knot).collect())
}

/// The presets that scene files may name. Their extinction suits a box of side 2; for other boxes `tau_scale` should
/// be about 2 divided by the side.
pub const PRESETS: [Preset; 5] = [
    Preset {
        name: "grey",
        purpose: "brightness and extinction grow with the value",
        rows: &[[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0, 4.0]],
    },
    Preset {
        name: "fog",
        purpose: "translucent, from blue over cream to red",
        rows: &[
            [0.0, 0.1, 0.2, 0.7, 0.0],
            [0.06, 0.1, 0.2, 0.7, 0.0],
            [0.3, 0.2, 0.6, 0.9, 1.0],
            [0.6, 0.9, 0.85, 0.3, 3.0],
            [1.0, 1.0, 0.25, 0.1, 8.0],
        ],
    },
    Preset {
        name: "shells",
        purpose: "a bright shell about 0.5 and a faint violet body above 0.8",
        rows: &[
            [0.0, 0.1, 0.2, 0.6, 0.0],
            [0.42, 0.9, 0.4, 0.1, 0.0],
            [0.5, 1.0, 0.8, 0.3, 30.0],
            [0.58, 0.2, 0.6, 0.9, 0.0],
            [0.8, 0.2, 0.6, 0.9, 0.0],
            [0.9, 0.3, 0.4, 1.0, 2.0],
            [1.0, 0.6, 0.2, 0.8, 2.0],
        ],
    },
    Preset {
        name: "bone",
        purpose: "computed tomography from air to dense bone: faint soft tissue, solid bone",
        rows: &[
            [0.0, 0.35, 0.12, 0.06, 0.0],
            [0.22, 0.35, 0.12, 0.06, 0.0],
            [0.30, 0.55, 0.20, 0.10, 0.4],
            [0.38, 0.75, 0.42, 0.25, 0.6],
            [0.50, 0.95, 0.85, 0.65, 12.0],
            [1.0, 1.0, 0.98, 0.92, 40.0],
        ],
    },
    Preset {
        name: "surface",
        purpose: "an opaque body from the middle of the range up, as from a mask",
        rows: &[
            [0.0, 0.6, 0.3, 0.15, 0.0],
            [0.45, 0.6, 0.3, 0.15, 0.0],
            [0.55, 0.85, 0.6, 0.4, 60.0],
            [1.0, 1.0, 0.95, 0.85, 60.0],
        ],
    },
];
