//! Options that the techniques for meshes share.

use crate::error::Result;
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::technique::declare::{BlendOrder, EmptySpace, Resolution, Segments};
use crate::technique::declare::{option_set, refused, words};

words! {
    /// Treatment of pixels whose faces or cells came out of order.
    pub enum Repair {
        /// Draws them again from sorted lists.
        Exact = "exact",
        /// Counts them only.
        None = "none",
    }
}

option_set! {
    /// Options that the techniques for meshes share.
    pub struct MeshOptions {
        /// Selects how a cell is integrated. exact cuts it at the knots, without a table. integral reads 1-D tables: opacity is exact,
        /// colour of second order in the cell's optical depth. full reads a 2-D table for 12 thicknesses. smoke takes the mean scalar
        /// times the option smoke as extinction.
        pub segments: SegmentOptions = SegmentOptions::of(Integrator::Exact)
            => Segments(&[Integrator::Exact, Integrator::Integral, Integrator::Full, Integrator::Smoke]),
        /// Sets the extinction per unit of the scalar, with integrator=smoke.
        pub smoke: f64 = 1.0 => Rule::positive().quiet(),
        /// Selects the direction of ranks and compositing. The image is the same but for rounding.
        pub order: BlendOrder = BlendOrder::FrontToBack,
        /// Sets the largest colour that a ray may miss when it ends early: an absolute error. Fragments behind its end are not checked
        /// for order.
        pub stop: f64 = 0.0 => Rule::below_one(),
        /// skip leaves out cells whose range of scalars has no extinction; march draws all cells. The image is the same.
        pub empty_space as "empty-space": EmptySpace = EmptySpace::Skip,
        /// Selects the pixels that are drawn: half and quarter draw one for each square of 2 x 2 or 4 x 4 and upsample the image. They blur
        /// edges; where the image is smooth their error is of third order. They refuse surfaces and depth images.
        pub resolution: Resolution = Resolution::Full => Rule::words().quiet(),
    }
}

impl MeshOptions {
    /// Whether cells in which nothing is visible are skipped; smoke is visible everywhere.
    pub(crate) fn skips(&self) -> bool {
        self.empty_space == EmptySpace::Skip && self.segments.integrator != Integrator::Smoke
    }

    /// Whether fragments are composited back to front.
    pub(crate) fn back_to_front(&self) -> bool {
        self.order == BlendOrder::BackToFront
    }

    /// Checks the rules between options.
    pub(crate) fn check(&self, technique: &str) -> Result<()> {
        if self.stop > 0.0 && self.back_to_front() {
            return Err(refused(technique, "stop", "works with order=front-to-back only"));
        }
        self.segments.check(technique)
    }
}
