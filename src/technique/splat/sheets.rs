//! Sheet buffers: splats are added up in sheets, and the sheets are composited (Westover 1990; Mueller and Crawfis 1998).
//!
//! 1. `splat-project.glsl` finds the pixels that each kernel may cover, and its nearest depth or its layer as sort key.
//! 2. A stable sort orders kernels by key; tiles take their splats in that order (`bins.glsl`).
//! 3. `splat-sheets.glsl` adds up the splats of each tile in registers, sheet by sheet, and composites the sheets front to
//!    back.
//!
//! `sheets=image`: sheets are slabs parallel to the image, and each slab receives the part of a kernel inside it.
//! `sheets=axis`: sheets are voxel layers that receive whole kernels; under parallel rays the option `template` reads
//! footprints from a table.
//!
//! Error: image sheets are of second order in the thickness of slabs where the transfer function is smooth, and of first
//! at its jumps. Axis sheets bleed over the reach of a kernel, and jump where the axis changes. Cost: for each pair of
//! splat and tile 64 kernel evaluations, and five error functions for every four slabs; kernels that are products take two
//! points for each slab. Needs: core Vulkan 1.3.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::resident::GpuScene;
use crate::scene::{Kernel, Kernels, Scene, View};
use crate::technique::declare::draw::{Draw, Facts, Of, TechniqueOptions};
use crate::technique::declare::{option_set, refused, words};
use crate::technique::splat::desc::{Accumulation, Filter, SplatDesc};
use crate::technique::splat::frame::SplatFrame;
use crate::technique::splat::options::SplatOptions;

words! {
    /// How sheets are oriented.
    pub enum Sheets {
        /// Slabs parallel to the image.
        Image = "image",
        /// Layers along the axis of the data that is nearest to the view direction.
        Axis = "axis",
    }
}

option_set! {
    /// Options of `splat-sheets`.
    pub struct Options {
        /// Selects how sheets are oriented. image: slabs parallel to the image, kernels are cut at their planes, no jumps when the camera
        /// turns. axis: voxel layers with whole kernels, half the time, blurred along the ray, a jump where the axis changes.
        pub sheets: Sheets = Sheets::Image,
        /// Sets the entries along each side of a table of footprints, which replaces their integrals where kernels have no closed form;
        /// 0: no table. It works with sheets=axis on a grid with parallel rays.
        pub template: u32 = 0 => Rule::whole(8, 1024).or("0", 0).quiet(),
        /// Options that techniques for splats share.
        pub splat: SplatOptions = SplatOptions::default() => GROUP,
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "splat-sheets",
        summary: "kernels summed in sheet buffers, which are composited",
        source: "Westover 1990; Mueller and Crawfis 1998",
        data: &["points", "grid"],
        kernels: &[Kernel::Gaussian, Kernel::BSpline, Kernel::Tent, Kernel::Sinc],
        routes: &["compute"],
        splits_rays: false,
        modes: &[],
        samples: &[
            ("points", "sheets=image,step=0.25", [4e-5, 4e-4]),
            ("points", "sheets=image,step=0.5,spread=pixels,pairs=1500", [2e-4, 2e-3]),
            ("gaussians", "sheets=image,step=0.25", [2e-4, 7e-4]),
            ("gaussians", "sheets=axis", [4e-2, 0.2]),
            ("f32", "sheets=image,step=0.25,kernel=tent", [4e-4, 5e-3]),
        ],
        families: &[
            (Of::Others, "sheets=image,step=", &["8", "4", "2", "1", "0.5", "0.25", "0.125"]),
            (Of::Others, "sheets=axis,step=", &["1"]),
        ],
    };
}

impl Options {
    /// Returns the kernels that a scene is drawn with; the default on a grid is trilinear interpolation.
    fn kernels_of(&self, scene: &Scene) -> Result<Kernels> {
        self.splat.kernels.of(scene, Kernels { kernel: Kernel::Tent, ..Kernels::of_samples() })
    }
}

impl Draw for Options {
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        if self.template > 0 && self.sheets != Sheets::Axis {
            let why = "image sheets receive parts of footprints: works with sheets=axis only";
            return Err(refused(Self::NAME, "template", why));
        }
        let desc = SplatDesc {
            name: Self::NAME,
            kernels: self.kernels_of(scene.scene())?,
            accumulation: match self.sheets {
                Sheets::Image => Accumulation::Slabs,
                Sheets::Axis => Accumulation::Sheets,
            },
            ewa: false,
            template: (self.template > 0).then_some(self.template),
            filter: Filter::None,
            variance: 0.3,
            turns: scene.gpu().turns()?,
            options: self.splat,
        };
        Ok(Box::new(SplatFrame::new(scene, view, target, desc)?))
    }
}
