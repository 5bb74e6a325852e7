//! How a technique draws splats, and the shader and dispatches that this takes.

use crate::gpu::shader::{
    LOWPASS_AUTO, LOWPASS_FULL, LOWPASS_NONE, ORDER_CENTRES, ORDER_NEAREST, ORDER_SHEETS, SHEETS,
};
use crate::scene::Kernels;
use crate::technique::declare::words;
use crate::technique::splat::options::SplatOptions;

/// How a pixel combines its splats. This also decides the key that they are sorted by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Accumulation {
    /// Blends each splat as a whole, by the distance of its centre.
    Centres,
    /// Blends each splat as a whole, in an order of each pixel's own.
    ByPixel,
    /// Adds up the parts of splats in slabs parallel to the image, and composites the slabs.
    Slabs,
    /// Adds up whole splats in layers along an axis of the data, and composites the layers.
    Sheets,
}

impl Accumulation {
    /// Returns the shader's code of the sort key.
    pub(crate) fn key_code(self) -> u32 {
        match self {
            Self::Centres | Self::ByPixel => ORDER_CENTRES,
            Self::Slabs => ORDER_NEAREST,
            Self::Sheets => ORDER_SHEETS,
        }
    }
}

words! {
    /// Treatment of footprints that are smaller than a pixel.
    pub enum Filter {
        /// Widens ellipses that are narrower than the pixel's filter to it.
        Auto = "auto",
        /// Convolves every ellipse with the pixel's filter.
        Full = "full",
        /// Leaves ellipses as they are.
        None = "none",
    }
}

impl Filter {
    /// Returns the shader's code.
    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Auto => LOWPASS_AUTO,
            Self::Full => LOWPASS_FULL,
            Self::None => LOWPASS_NONE,
        }
    }
}

/// How splats are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplatDesc {
    pub(crate) name: &'static str,
    pub(crate) kernels: Kernels,
    pub(crate) accumulation: Accumulation,
    /// Whether footprints are ellipses; else they are integrals along each pixel's ray.
    pub(crate) ewa: bool,
    /// Entries along each side of the table of footprints, for parallel rays; `None`: no table.
    pub(crate) template: Option<u32>,
    pub(crate) filter: Filter,
    /// Variance of the pixel's filter, in pixels.
    pub(crate) variance: f64,
    /// Loop iterations of one invocation, at least 2.
    pub(crate) turns: u32,
    pub(crate) options: SplatOptions,
}

impl SplatDesc {
    /// Estimates the dispatches that a bin of `longest` entries takes.
    pub(crate) fn rounds(&self, longest: u32) -> u32 {
        let rounds = match self.accumulation {
            Accumulation::Centres | Accumulation::ByPixel => longest.div_ceil(self.turns),
            // Half of the iterations are reserved for the sheet in which a dispatch ends.
            Accumulation::Sheets => longest.div_ceil(self.turns / 2),
            Accumulation::Slabs => longest.saturating_mul(2 + SHEETS).div_ceil(self.turns / 2),
        };
        rounds.max(1)
    }
}
