//! Sheet buffers: what kernels give to a sheet is added up, sheets are composited (Westover 1990; Mueller and Crawfis 1998).
//!
//! 1. `glsl/splat-project.glsl` finds the pixels that each kernel may cover and its nearest depth, or its layer.
//! 2. A stable sort by that; tiles take their splats in order (`glsl/bins.glsl`).
//! 3. `glsl/splat-sheets.glsl` adds up each tile's splats, sheet by sheet, in registers, and composites the sheets front to back.
//!
//! `sheets=image`: slabs parallel to the image, each kernel gives to each slab what lies in it. `sheets=axis`: voxel layers, each
//! gets whole kernels, by default from one table for all where lines are parallel.
//!
//! Error: image sheets second order in the slabs' thickness where the transfer function is smooth, first at its jumps.
//! Axis sheets bleed over a kernel's reach and jump where the axis changes. Cost: per pair of splat and tile 64 times a kernel and
//! five error functions for every four slabs; of products two points for each slab. Needs: core Vulkan 1.3.

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

/// Which sheets there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sheets {
    /// Slabs parallel to the image.
    Image,
    /// Layers along the axis of the data that is nearest to the line of sight.
    Axis,
}

impl Choice for Sheets {
    const WORDS: &'static [(&'static str, Self)] = &[("image", Self::Image), ("axis", Self::Axis)];
}

/// What can be chosen, with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        key: "sheets",
        values: "image|axis",
        default: "image",
        effect: "image: slabs parallel to the image, kernels cut at their planes, no jumps when the camera turns; axis: voxel layers with whole kernels, half the time, blurred along the line, a jump where the axis changes",
    },
    OptionInfo {
        key: "template",
        values: "0, or entries a side from 8 to 1024",
        default: "0",
        effect: "sheets=axis on a grid, parallel lines: footprints from one table instead of their integrals, for kernels without a closed form",
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

/// Options of this technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Which sheets there are.
    pub sheets: Sheets,
    /// Entries of the footprint's table a side; 0: no table.
    pub template: u32,
    /// Thickness of slabs.
    pub step: f64,
    /// Kernels, as far as they are not the scene's.
    pub kernels: KernelOptions,
    /// Colour that may be left out where a line ends.
    pub stop: f64,
    /// Most entries of bins at a time.
    pub pairs: Option<u32>,
    /// How a tile's pixels are spread over invocations.
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

    /// The options as text that reads back to them; what is unset is left out.
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

    /// The kernels that a scene is drawn with: on a grid trilinear interpolation unless told otherwise.
    pub(crate) fn kernels_of(&self, scene: &Scene) -> Result<Kernels> {
        self.kernels.of(scene, Kernels { kernel: Kernel::Tent, ..Kernels::of_samples() })
    }

    pub(crate) fn prepare(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
    ) -> Result<Box<dyn Prepared>> {
        if self.template > 0 && self.sheets != Sheets::Axis {
            let why = "image sheets get parts of footprints: works with sheets=axis only";
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
