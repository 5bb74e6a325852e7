//! Options of `shear-warp`.

use crate::error::{Error, Result};
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::technique::grid::options::{EMPTY_SPACE, GridOptions, ORDER, ROUTE, STOP};
use crate::technique::grid::slices_2d::Stacks;
use crate::technique::options::{self, Choice, OptionInfo, TABLE};
use crate::technique::shear_warp::base_plane::Resolution;

pub(crate) const NAME: &str = "shear-warp";

/// Most slices that one stands for.
const MOST_EVERY: u32 = 64;

/// How the intermediate image is resampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Warp {
    /// Between four texels.
    Bilinear,
    /// The same, in smaller versions of the intermediate image where its texels are smaller than pixels.
    Mip,
    /// Between sixteen texels (Keys 1981).
    Bicubic,
}

impl Choice for Warp {
    const WORDS: &'static [(&'static str, Self)] =
        &[("bilinear", Self::Bilinear), ("mip", Self::Mip), ("bicubic", Self::Bicubic)];
}

/// What sets the number of texels of the intermediate image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Intermediate {
    /// A texel a voxel, but from one to three pixels wide.
    Auto,
    /// A texel for each voxel of the nearest slice.
    Voxel,
    /// So many texels for each pixel, along each side.
    Pixel(f64),
}

/// What can be chosen, with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        key: "step",
        values: "slices, or a positive number",
        default: "slices",
        effect: "slices: those of the grid, whose distance along the line grows to sqrt(3) voxels; a number: slices so far apart along the line, in units of the smallest voxel spacing, whatever the view, each a blend of two, twice the look-ups",
    },
    OptionInfo {
        key: "every",
        values: "a whole number from 1 to 64",
        default: "1",
        effect: "with step=slices only every so manieth slice is looked up, and stands for so many: as much less time, and the distance of slices sets the error",
    },
    OptionInfo {
        key: "integrator",
        values: "midpoint|integral|full|exact",
        default: "midpoint",
        effect: "midpoint classifies each slice; the others integrate the transfer function between slices, as slabs does",
    },
    TABLE,
    OptionInfo {
        key: "intermediate",
        values: "auto|voxel|pixel, or texels a pixel, a positive number",
        default: "auto",
        effect: "lines of sight that are composited: one a voxel of the nearest slice (voxel), one a pixel (pixel), so many along a pixel's side, or one a voxel that is from one to three pixels wide (auto); time grows with their number, and what is smaller than their distance is blurred",
    },
    OptionInfo {
        key: "warp",
        values: "bilinear|mip|bicubic",
        default: "bilinear",
        effect: "bicubic resamples the intermediate image sharper than bilinear, four times the texels; mip averages texels that are smaller than pixels, which other techniques would need many rays a pixel for",
    },
    OptionInfo {
        key: "filter",
        values: "hardware|exact, or bilinear|mip|bicubic",
        default: "hardware",
        effect: "of samples: exact has float32 weights, hardware those of the sampler; the last three words are those of warp",
    },
    OptionInfo {
        key: "hysteresis",
        values: "a number from 0 to below 1",
        default: "0.01",
        effect: "the base plane in use is kept until the cosine of another leads by this; the picture jumps later and less often",
    },
    OptionInfo {
        key: "stacks",
        values: "used|all",
        default: "used",
        effect: "all: three copies of the grid on the device, so that no turn of the view needs an upload",
    },
    ROUTE,
    ORDER,
    EMPTY_SPACE,
    STOP,
];

/// Options of this technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Those that techniques for grids share; `step` counts only with `between`. `prefilter`, `target` and `dither` are not
    /// for this technique.
    pub grid: GridOptions,
    /// Slices between those of the grid, `step` apart along the line, each a blend of two.
    pub between: bool,
    /// Without `between`: every so manieth slice of the grid is looked up.
    pub every: u32,
    /// How slabs are integrated; [`Integrator::Midpoint`] classifies slices.
    pub segments: SegmentOptions,
    /// Texels of the intermediate image.
    pub intermediate: Intermediate,
    /// How it is resampled.
    pub warp: Warp,
    /// By how much the cosine of another axis must lead that of the one in use, for a plan to change base planes.
    pub hysteresis: f64,
    /// Stacks on the device.
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

    /// The options as text that reads back to them; what is unset is left out.
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

    pub(crate) fn check(&self) -> Result<()> {
        let refuse = |key: &str, why: String| Err(Error::invalid(format!("{NAME} option {key}"), why));
        if !(0.0..1.0).contains(&self.hysteresis) {
            return refuse("hysteresis", format!("{}: must be at least 0 and below 1", self.hysteresis));
        }
        if !(1..=MOST_EVERY).contains(&self.every) {
            return refuse("every", format!("{}: must be from 1 to {MOST_EVERY}", self.every));
        }
        if self.every > 1 && self.between {
            return refuse("every", "of slices of the grid: step must be slices".to_string());
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
            return refuse("prefilter", "is not for this technique, which has warp=mip".to_string());
        }
        if self.grid.dither != default.dither {
            return refuse(
                "dither",
                "is not for this technique: the intermediate image is rgba32f".to_string(),
            );
        }
        self.segments.check(NAME, true)?;
        self.grid.check(NAME)
    }

    pub(crate) fn resolution(&self) -> Resolution {
        match self.intermediate {
            Intermediate::Auto => Resolution::Auto,
            Intermediate::Voxel => Resolution::Voxel,
            Intermediate::Pixel(texels) => Resolution::Pixel(texels),
        }
    }
}
