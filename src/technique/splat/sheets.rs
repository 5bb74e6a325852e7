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

use crate::error::{Error, Result};
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::resident::GpuScene;
use crate::scene::{Kernel, Kernels, Scene, View};
use crate::technique::options::{self, Choice, OptionInfo};
use crate::technique::splat::desc::{Accumulation, Filter, SplatDesc};
use crate::technique::splat::frame::SplatFrame;
use crate::technique::splat::options::{
    CUT, KERNEL, KernelOptions, LEAST, MODEL, PAIRS, SIGMA, SPREAD, STEP, STOP, TileSplit,
};

const NAME: &str = "splat-sheets";

/// How sheets are oriented.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sheets {
    /// Slabs parallel to the image.
    Image,
    /// Layers along the axis of the data that is nearest to the view direction.
    Axis,
}

impl Choice for Sheets {
    const WORDS: &'static [(&'static str, Self)] = &[("image", Self::Image), ("axis", Self::Axis)];
}

/// The options, each with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        key: "sheets",
        values: "image|axis",
        default: "image",
        effect: "image: slabs parallel to the image, kernels are cut at their planes, no jumps when the camera turns; axis: voxel layers with whole kernels, half the time, blurred along the ray, a jump where the axis changes",
    },
    OptionInfo {
        key: "template",
        values: "0, or a whole number from 8 to 1024",
        default: "0",
        effect: "with sheets=axis on a grid with parallel rays: entries along each side of a table of footprints, which replaces their integrals where kernels have no closed form; 0: no table",
    },
    KERNEL,
    STEP,
    SIGMA,
    CUT,
    MODEL,
    LEAST,
    STOP,
    PAIRS,
    SPREAD,
];

/// Options of `splat-sheets`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How sheets are oriented.
    pub sheets: Sheets,
    /// Entries along each side of the table of footprints; 0: no table.
    pub template: u32,
    /// Thickness of slabs.
    pub step: f64,
    /// Properties of kernels that replace the scene's.
    pub kernels: KernelOptions,
    /// Largest colour that a ray may miss when it ends early.
    pub stop: f64,
    /// Most entries of bins at a time; `None`: as many as a buffer holds.
    pub pairs: Option<u32>,
    /// How the pixels of a tile are divided among invocations.
    pub spread: TileSplit,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            sheets: Sheets::Image,
            template: 0,
            step: 1.0,
            kernels: KernelOptions::default(),
            stop: 2.4e-7,
            pairs: None,
            spread: TileSplit::Auto,
        }
    }
}

impl Options {
    /// Reads `key`, `value` pairs.
    pub(crate) fn parse(pairs: &[(String, String)]) -> Result<Self> {
        let mut options = Self::default();
        for (key, text) in pairs {
            match key.as_str() {
                "sheets" => options.sheets = options::choice(NAME, key, text)?,
                "template" if text == "0" => options.template = 0,
                "template" => options.template = options::whole(NAME, key, text, 8..=1024)?,
                "step" => options.step = options::positive(NAME, key, text)?,
                "stop" => options.stop = options::below_one(NAME, key, text)?,
                "spread" => options.spread = options::choice(NAME, key, text)?,
                "pairs" => options.pairs = Some(options::whole(NAME, key, text, 64..=u32::MAX)?),
                _ if options.kernels.read(NAME, key, text)? => {}
                _ => return Err(options::unknown(NAME, key, OPTIONS)),
            }
        }
        Ok(options)
    }

    /// Returns the options as text that [`Options::parse`] reads back; options that are unset are left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = vec![("sheets", self.sheets.word().to_string())];
        if self.template > 0 {
            pairs.push(("template", self.template.to_string()));
        }
        pairs.push(("step", self.step.to_string()));
        pairs.extend(self.kernels.pairs());
        pairs.push(("stop", format!("{:e}", self.stop)));
        if let Some(number) = self.pairs {
            pairs.push(("pairs", number.to_string()));
        }
        if self.spread != TileSplit::Auto {
            pairs.push(("spread", self.spread.word().to_string()));
        }
        pairs
    }

    /// Returns the kernels that a scene is drawn with; the default on a grid is trilinear interpolation.
    pub(crate) fn kernels_of(&self, scene: &Scene) -> Result<Kernels> {
        self.kernels.of(scene, Kernels { kernel: Kernel::Tent, ..Kernels::of_samples() })
    }

    /// Prepares frames of one view size.
    pub(crate) fn prepare(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
    ) -> Result<Box<dyn Prepared>> {
        if self.template > 0 && self.sheets != Sheets::Axis {
            let why = "image sheets receive parts of footprints: works with sheets=axis only";
            return Err(Error::invalid(format!("{NAME} option template"), why));
        }
        let desc = SplatDesc {
            name: NAME,
            kernels: self.kernels_of(scene.scene())?,
            accumulation: match self.sheets {
                Sheets::Image => Accumulation::Slabs,
                Sheets::Axis => Accumulation::Sheets,
            },
            ewa: false,
            template: (self.template > 0).then_some(self.template),
            filter: Filter::None,
            variance: 0.3,
            step: self.step,
            stop: self.stop,
            pairs: self.pairs,
            split: self.spread,
        };
        Ok(Box::new(SplatFrame::new(scene, view, target, desc)?))
    }
}
