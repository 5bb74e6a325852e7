//! The algorithm of `shear-warp` and its options.
//!
//! A view is the product of a permutation of the axes, a shear of the slices (with a scaling in perspective) and a warp
//! that does not depend on depth. Each texel of the base plane is one ray, along which slices are composited as in `slices-2d` or, with an
//! integrator of segments, as in `slabs`. The number of rays does not depend on the number of pixels, which saves time.
//!
//! 1. `factorisation` factors the view. `base_planes` chooses base planes, up to six where the eye is near or in the domain,
//!    and lays a lattice of texels on each.
//! 2. `glsl/shear-warp/shear-warp.glsl` composites slabs: by a march along the ray of each texel (route `compute`), or by one quad per slab,
//!    blended by fixed function (route `raster`).
//! 3. `glsl/shear-warp/warp.glsl` resamples the intermediate image. Each pixel reads the base plane whose slices its ray crosses most
//!    steeply. `warp=mip` averages texels that are smaller than pixels.
//!
//! Error: along a ray that of `slices-2d` or `slabs`. Resampling adds an error of second order in the texels' distance (third
//! with `warp=bicubic`) where the image is smooth, and blurs edges by a texel. A homogeneous domain is
//! exact for rays through both faces. Cost: per slab and covered texel one bilinear fetch (two with `step`) and one
//! classification or integration; four to sixteen texels per pixel. Each axis in use needs one more copy of the grid. Needs: core
//! Vulkan 1.3.

use crate::error::{Error, Result};
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::technique::grid::options::{EMPTY_SPACE, GridOptions, ORDER, ROUTE, STOP};
use crate::technique::grid::slices_2d::Stacks;
use crate::technique::options::{self, Choice, OptionInfo, TABLE};
use crate::technique::shear_warp::base_plane::Resolution;

pub(crate) const NAME: &str = "shear-warp";

/// Largest value of `every`.
const MOST_EVERY: u32 = 64;

/// The filter of the warp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Warp {
    /// Bilinear, between four texels.
    Bilinear,
    /// Bilinear, in smaller levels of the intermediate image where its texels are smaller than pixels.
    Mip,
    /// Bicubic, between sixteen texels (Keys 1981).
    Bicubic,
}

impl Choice for Warp {
    const WORDS: &'static [(&'static str, Self)] =
        &[("bilinear", Self::Bilinear), ("mip", Self::Mip), ("bicubic", Self::Bicubic)];
}

/// The resolution of the intermediate image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Intermediate {
    /// One texel per voxel of the nearest slice, but from one to three pixels wide.
    Auto,
    /// One texel per voxel of the nearest slice.
    Voxel,
    /// This many texels per pixel, along each side.
    Pixel(f64),
}

/// Descriptions of the options.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        key: "step",
        values: "slices, or a positive number",
        default: "slices",
        effect: "slices: composites the slices of the grid, whose distance along a ray grows to sqrt(3) voxels; a number: distance of slices along a ray, in units of the smallest voxel spacing, in every view, each a blend of two slices, with twice the fetches",
    },
    OptionInfo {
        key: "every",
        values: "a whole number from 1 to 64",
        default: "1",
        effect: "with step=slices: samples every n-th slice, in about 1/n of the time; the distance of these slices sets the error",
    },
    OptionInfo {
        key: "integrator",
        values: "midpoint|integral|full|exact",
        default: "midpoint",
        effect: "midpoint classifies each slice; the other values integrate the transfer function between slices, as slabs does",
    },
    TABLE,
    OptionInfo {
        key: "intermediate",
        values: "auto|voxel|pixel, or a positive number of texels per pixel",
        default: "auto",
        effect: "resolution of the intermediate image: one texel per voxel of the nearest slice (voxel), one per pixel (pixel), this many along each side of a pixel, or one per voxel but from one to three pixels wide (auto); time grows with the number of texels, and details smaller than a texel are blurred",
    },
    OptionInfo {
        key: "warp",
        values: "bilinear|mip|bicubic",
        default: "bilinear",
        effect: "bicubic resamples the intermediate image sharper than bilinear, from four times the texels; mip averages texels that are smaller than pixels, where other techniques would need many rays per pixel",
    },
    OptionInfo {
        key: "filter",
        values: "hardware|exact, or bilinear|mip|bicubic",
        default: "hardware",
        effect: "filter of samples: exact has float32 weights, hardware those of the sampler; the last three values set warp",
    },
    OptionInfo {
        key: "hysteresis",
        values: "a number from 0 to below 1",
        default: "0.01",
        effect: "keeps the base plane in use until the cosine of another leads by this value; the image jumps later and less often",
    },
    OptionInfo {
        key: "stacks",
        values: "used|all",
        default: "used",
        effect: "all keeps three copies of the grid on the device, so that no change of the view needs an upload",
    },
    ROUTE,
    ORDER,
    EMPTY_SPACE,
    STOP,
];

/// Options of this technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Options that techniques for grids share; `step` counts only with `between`. This technique has no `prefilter`, `target` and
    /// `dither`.
    pub grid: GridOptions,
    /// Whether slices are `step` apart along a ray, each a blend of two slices of the grid.
    pub between: bool,
    /// Without `between`: samples every n-th slice of the grid.
    pub every: u32,
    /// The integrator of slabs; [`Integrator::Midpoint`] classifies slices.
    pub segments: SegmentOptions,
    /// Resolution of the intermediate image.
    pub intermediate: Intermediate,
    /// Filter of the warp.
    pub warp: Warp,
    /// Lead of another axis's cosine at which a plan changes base planes.
    pub hysteresis: f64,
    /// The stacks that the device holds.
    pub stacks: Stacks,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            grid: GridOptions::default(),
            between: false,
            every: 1,
            segments: SegmentOptions { integrator: Integrator::Midpoint, table: None },
            intermediate: Intermediate::Auto,
            warp: Warp::Bilinear,
            hysteresis: 0.01,
            stacks: Stacks::Used,
        }
    }
}

impl Options {
    /// Reads `key`, `value` pairs.
    pub(crate) fn parse(pairs: &[(String, String)]) -> Result<Self> {
        let mut options = Self::default();
        for (key, text) in pairs {
            let is_warp = Warp::WORDS.iter().any(|(word, _)| word == text);
            match key.as_str() {
                "step" if text == "slices" => options.between = false,
                "every" => options.every = options::whole(NAME, key, text, 1..=MOST_EVERY)?,
                "hysteresis" => options.hysteresis = options::below_one(NAME, key, text)?,
                "stacks" => options.stacks = options::choice(NAME, key, text)?,
                "warp" => options.warp = options::choice(NAME, key, text)?,
                "filter" if is_warp => options.warp = options::choice(NAME, key, text)?,
                "intermediate" => {
                    options.intermediate = match text.as_str() {
                        "auto" => Intermediate::Auto,
                        "voxel" => Intermediate::Voxel,
                        "pixel" => Intermediate::Pixel(1.0),
                        _ => Intermediate::Pixel(options::positive(NAME, key, text)?),
                    };
                }
                "prefilter" | "target" | "dither" | "seed" => {
                    return Err(options::unknown(NAME, key, OPTIONS));
                }
                _ if options.segments.read(NAME, key, text)? => {}
                _ if options.grid.read(NAME, key, text)? => options.between |= key == "step",
                _ => return Err(options::unknown(NAME, key, OPTIONS)),
            }
        }
        options.check()?;
        Ok(options)
    }

    /// The options as text that reads back to them; unset ones are left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = self.grid.pairs();
        pairs.retain(|(key, _)| *key != "prefilter");
        if !self.between {
            for pair in pairs.iter_mut().filter(|(key, _)| *key == "step") {
                pair.1 = "slices".to_string();
            }
        }
        if self.every > 1 {
            pairs.push(("every", self.every.to_string()));
        }
        pairs.extend(self.segments.pairs());
        let intermediate = match self.intermediate {
            Intermediate::Auto => "auto".to_string(),
            Intermediate::Voxel => "voxel".to_string(),
            Intermediate::Pixel(1.0) => "pixel".to_string(),
            Intermediate::Pixel(texels) => texels.to_string(),
        };
        pairs.push(("intermediate", intermediate));
        pairs.push(("warp", self.warp.word().to_string()));
        pairs.push(("hysteresis", self.hysteresis.to_string()));
        pairs.push(("stacks", self.stacks.word().to_string()));
        pairs
    }

    /// Checks the options, alone and together.
    pub(crate) fn check(&self) -> Result<()> {
        let refuse = |key: &str, why: String| Err(Error::invalid(format!("{NAME} option {key}"), why));
        if !(0.0..1.0).contains(&self.hysteresis) {
            return refuse("hysteresis", format!("{}: must be at least 0 and below 1", self.hysteresis));
        }
        if !(1..=MOST_EVERY).contains(&self.every) {
            return refuse("every", format!("{}: must be from 1 to {MOST_EVERY}", self.every));
        }
        if self.every > 1 && self.between {
            return refuse("every", "applies to slices of the grid: step must be slices".to_string());
        }
        match self.intermediate {
            Intermediate::Pixel(texels) if !(texels.is_finite() && texels > 0.0) => {
                return refuse("intermediate", format!("{texels}: must be positive and finite"));
            }
            _ => {}
        }
        if self.grid.target.is_some() {
            return refuse("target", "the intermediate image is rgba32f".to_string());
        }
        let default = GridOptions::default();
        if self.grid.prefilter != default.prefilter {
            return refuse("prefilter", "shear-warp has no prefilter: use warp=mip".to_string());
        }
        if self.grid.dither != default.dither {
            return refuse(
                "dither",
                "shear-warp has no dither: the intermediate image is rgba32f".to_string(),
            );
        }
        self.segments.check(NAME, true)?;
        self.grid.check(NAME)
    }

    /// The resolution as `base_planes` takes it.
    pub(crate) fn resolution(&self) -> Resolution {
        match self.intermediate {
            Intermediate::Auto => Resolution::Auto,
            Intermediate::Voxel => Resolution::Voxel,
            Intermediate::Pixel(texels) => Resolution::Pixel(texels),
        }
    }
}
