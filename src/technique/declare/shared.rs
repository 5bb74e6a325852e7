//! Options that several families of techniques share.

use crate::error::Result;
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::technique::declare::{Declare, Entry, Rule, Text, Value, refused, words};

words! {
    /// The order in which slabs or primitives are blended.
    pub enum BlendOrder {
        /// The operator "over".
        BackToFront = "back-to-front",
        /// The operator "under".
        FrontToBack = "front-to-back",
    }
}

words! {
    /// How a technique uses the device.
    pub enum Route {
        /// Compute, unless an option needs raster.
        Auto = "auto",
        /// Polygons and fixed-function blending.
        Raster = "raster",
        /// One invocation per pixel composites in registers.
        Compute = "compute",
    }
}

words! {
    /// The treatment of bricks or cells in which nothing is visible.
    pub enum EmptySpace {
        /// Skipped, where pixels are composited in registers.
        Skip = "skip",
        /// Sampled like all others.
        March = "march",
    }
}

words! {
    /// The share of pixels that is drawn: the place of a value is the logarithm of the side of the squares that are drawn as one.
    pub enum Resolution {
        /// Every pixel.
        Full = "full",
        /// One for each square of 2 x 2.
        Half = "half",
        /// One for each square of 4 x 4.
        Quarter = "quarter",
    }
}

impl Value for Integrator {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("midpoint", Self::Midpoint),
        ("integral", Self::Integral),
        ("full", Self::Full),
        ("exact", Self::Exact),
        ("smoke", Self::Smoke),
    ];
}

impl Integrator {
    /// The integrators of techniques for grids that also classify samples.
    pub(crate) const OF_GRIDS: &'static [Self] = &[Self::Midpoint, Self::Integral, Self::Full, Self::Exact];
}

/// Declares `integrator`, with the values that a technique allows, and `table`.
pub(crate) struct Segments(pub(crate) &'static [Integrator]);

impl Declare<SegmentOptions> for Segments {
    fn declare<'a>(self, [_, effect]: Text, field: &'a mut SegmentOptions, entries: &mut Vec<Entry<'a>>) {
        Rule::only(self.0).declare(["integrator", effect], &mut field.integrator, entries);
        let table = "Sets the bins of the table of integral (64 bytes each), or the nodes on each axis of that of full (192 bytes for each \
                     pair, at most 1024). Features of the transfer function that are narrower than a bin are blurred.";
        let rule = Rule::whole(2, 65_536).unset("4096 (full: 256)");
        rule.declare(["table", table], &mut field.table, entries);
    }
}

impl SegmentOptions {
    /// Checks integrator and table together.
    pub(crate) fn check(&self, technique: &str) -> Result<()> {
        let why = match (self.table, self.integrator) {
            (None, _) | (_, Integrator::Integral) => return Ok(()),
            (Some(size), Integrator::Full) if size <= 1024 => return Ok(()),
            (Some(size), Integrator::Full) => format!("{size}: must be from 2 to 1024"),
            (_, other) => format!("integrator={} has no table", other.word()),
        };
        Err(refused(technique, "table", why))
    }
}
