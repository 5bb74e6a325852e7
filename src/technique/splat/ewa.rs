//! Gaussian splats in perspective: elliptical weighted averages (Zwicker 2001), or integrals along each pixel's ray.
//!
//! 1. `splat-project.glsl` finds the pixels that each kernel may cover, its sort key and its ellipse.
//! 2. A stable sort orders kernels by key; tiles take their splats in that order (`bins.glsl`).
//! 3. `splat-ewa.glsl` blends the splats of each tile in registers, front to back. With `order=slabs`
//!    `splat-sheets.glsl` adds them up in slabs instead, where overlapping kernels need no order.
//!
//! Faint splats are not skipped and opacity is not capped: ten thousand layers of opacity 1/3000 are opaque.
//!
//! Error: `footprint=ewa` has at most about `1.2 rho tan(theta) + 1.1 rho²` of a kernel's peak, where rho is its standard
//! deviation over its distance and theta the angle off the axis; `footprint=exact` has that of float32. The opacity of
//! `order=center` has no other error; its colour errs by at most the product of the opacities of two overlapping kernels
//! times the difference of their colours. `order=slabs` is of second order in the thickness of slabs. Cost: for each pair
//! of splat and tile 64 exponentials, twice; slabs take five error functions more. Needs: core Vulkan 1.3.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::resident::GpuScene;
use crate::scene::{Kernel, Kernels, Model, Scene, View};
use crate::technique::options::{self, Choice, OptionInfo};
use crate::technique::splat::desc::{Accumulation, SplatDesc};
use crate::technique::splat::frame::SplatFrame;
use crate::technique::splat::options::{
    CUT, KernelOptions, LEAST, MODEL, PAIRS, SIGMA, SPREAD, STEP, STOP, TileSplit,
};

pub use crate::technique::splat::desc::Filter;

const NAME: &str = "splat-ewa";

/// The order in which splats are blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EwaOrder {
    /// By the distance of centres.
    Center,
    /// By the distance of centres, corrected by a small window in each pixel.
    Window,
    /// No order among splats: their parts in each slab are added up, and slabs are blended.
    Slabs,
}

impl Choice for EwaOrder {
    const WORDS: &'static [(&'static str, Self)] =
        &[("center", Self::Center), ("window", Self::Window), ("slabs", Self::Slabs)];
}

/// How the contribution of a kernel to a pixel is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Footprint {
    /// From an ellipse in the image, by affine projection.
    Ewa,
    /// From the integral along the pixel's ray.
    Exact,
}

impl Choice for Footprint {
    const WORDS: &'static [(&'static str, Self)] = &[("ewa", Self::Ewa), ("exact", Self::Exact)];
}

/// The options, each with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        key: "order",
        values: "center|window|slabs",
        default: "center for model=density, slabs for interpolate",
        effect: "center: whole splats by the distance of their centres, fastest, may jump when the camera turns; window: also sorted in each pixel by a window of 8 places, 3 to 5 times the time; slabs: parts of splats are added up in slabs, no jumps, converges with step",
    },
    OptionInfo {
        key: "footprint",
        values: "ewa|exact",
        default: "exact",
        effect: "ewa: an ellipse, filtered as the option filter says; exact: the integral along the pixel's ray, unfiltered, as the reference samples",
    },
    OptionInfo {
        key: "filter",
        values: "auto|full|none",
        default: "auto",
        effect: "with footprint=ewa: auto widens ellipses that are narrower than the pixel's filter to it; full convolves all ellipses with it; a pixel averages opacity, not optical depth",
    },
    OptionInfo {
        key: "variance",
        values: "a positive number",
        default: "0.3",
        effect: "with footprint=ewa: variance of the pixel's filter, in pixels; below 0.25 brightness depends on where in a pixel a splat lies",
    },
    STEP,
    SIGMA,
    CUT,
    MODEL,
    LEAST,
    STOP,
    PAIRS,
    SPREAD,
];

/// Options of `splat-ewa`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// The order of blending; `None`: the default of the model.
    pub order: Option<EwaOrder>,
    /// How the contribution of a kernel to a pixel is computed.
    pub footprint: Footprint,
    /// Treatment of footprints that are smaller than a pixel.
    pub filter: Filter,
    /// Variance of the pixel's filter, in pixels.
    pub variance: f64,
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

impl Choice for Filter {
    const WORDS: &'static [(&'static str, Self)] =
        &[("auto", Self::Auto), ("full", Self::Full), ("none", Self::None)];
}

impl Default for Options {
    fn default() -> Self {
        Self {
            order: None,
            footprint: Footprint::Exact,
            filter: Filter::Auto,
            variance: 0.3,
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
                "order" => options.order = Some(options::choice(NAME, key, text)?),
                "footprint" => options.footprint = options::choice(NAME, key, text)?,
                "filter" => options.filter = options::choice(NAME, key, text)?,
                "variance" => options.variance = options::positive(NAME, key, text)?,
                "step" => options.step = options::positive(NAME, key, text)?,
                "stop" => options.stop = options::below_one(NAME, key, text)?,
                "spread" => options.spread = options::choice(NAME, key, text)?,
                "pairs" => options.pairs = Some(options::whole(NAME, key, text, 64..=u32::MAX)?),
                "kernel" => return Err(options::unknown(NAME, key, OPTIONS)),
                _ if options.kernels.read(NAME, key, text)? => {}
                _ => return Err(options::unknown(NAME, key, OPTIONS)),
            }
        }
        Ok(options)
    }

    /// Returns the options as text that [`Options::parse`] reads back; options that are unset are left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = Vec::new();
        if let Some(order) = self.order {
            pairs.push(("order", order.word().to_string()));
        }
        pairs.push(("footprint", self.footprint.word().to_string()));
        if self.footprint == Footprint::Ewa {
            pairs.push(("filter", self.filter.word().to_string()));
            pairs.push(("variance", self.variance.to_string()));
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

    /// Returns the kernels that a scene is drawn with.
    pub(crate) fn kernels_of(&self, scene: &Scene) -> Result<Kernels> {
        let kernels = self.kernels.of(scene, Kernels::of_samples())?;
        if kernels.kernel != Kernel::Gaussian {
            let why = format!("{}: {NAME} draws gaussian; splat-sheets draws all", kernels.kernel.name());
            return Err(Error::invalid("kernel", why));
        }
        Ok(kernels)
    }

    /// Prepares frames of one view size.
    pub(crate) fn prepare(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
    ) -> Result<Box<dyn Prepared>> {
        let refuse = |key: &str, why: &str| Err(Error::invalid(format!("{NAME} option {key}"), why));
        let kernels = self.kernels_of(scene.scene())?;
        let interpolates = kernels.model == Model::Interpolate;
        let order = self.order.unwrap_or(if interpolates { EwaOrder::Slabs } else { EwaOrder::Center });
        if interpolates && order != EwaOrder::Slabs {
            return refuse("order", "whole splats have one colour each: works with model=density only");
        }
        let ewa = self.footprint == Footprint::Ewa;
        if ewa && order == EwaOrder::Slabs {
            return refuse(
                "footprint",
                "ellipses have no depth: order=slabs works with footprint=exact only",
            );
        }
        let desc = SplatDesc {
            name: NAME,
            kernels,
            accumulation: match order {
                EwaOrder::Center => Accumulation::Centres,
                EwaOrder::Window => Accumulation::Window,
                EwaOrder::Slabs => Accumulation::Slabs,
            },
            ewa,
            template: None,
            filter: self.filter,
            variance: self.variance,
            step: self.step,
            stop: self.stop,
            pairs: self.pairs,
            split: self.spread,
        };
        Ok(Box::new(SplatFrame::new(scene, view, target, desc)?))
    }
}
