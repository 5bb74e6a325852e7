//! Options that the techniques for grids share, and the names of their values.

use ash::vk;

use crate::error::{Error, Result};
use crate::gpu::shader::{TARGET_RGBA8, TARGET_RGBA16, TARGET_RGBA16F};
use crate::gpu::{Gpu, OptionalFeature};
use crate::technique::options::{self, BlendOrder, Choice, EmptySpace, OptionInfo, Route};

/// Reconstruction between samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// The sampler's: fast, with weights of the device's precision.
    Hardware,
    /// Single fetches with float32 weights, of the samples and of a full table.
    Exact,
}

/// Reconstruction where a voxel is smaller than a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prefilter {
    /// As elsewhere: the rays miss samples between pixels.
    None,
    /// From mip levels: a pixel sees the mean of the samples that it covers.
    Mip,
}

/// Format that raster accumulates in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accumulation {
    /// 8 bits a channel.
    Rgba8,
    /// 16 bits a channel, normalised.
    Rgba16,
    /// 16-bit float.
    Rgba16f,
    /// 32-bit float.
    Rgba32f,
}

/// How raster rounds to a format of low precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dither {
    /// To nearest, by fixed function.
    None,
    /// At random with the exact expected value, by white noise (alpha dithering).
    Alpha,
    /// At random with the exact expected value, by the thresholds of a blue-noise tile.
    Blue,
}

impl Choice for Filter {
    const WORDS: &'static [(&'static str, Self)] = &[("hardware", Self::Hardware), ("exact", Self::Exact)];
}
impl Choice for Prefilter {
    const WORDS: &'static [(&'static str, Self)] = &[("none", Self::None), ("mip", Self::Mip)];
}
impl Choice for Accumulation {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("rgba8", Self::Rgba8),
        ("rgba16", Self::Rgba16),
        ("rgba16f", Self::Rgba16f),
        ("rgba32f", Self::Rgba32f),
    ];
}
impl Choice for Dither {
    const WORDS: &'static [(&'static str, Self)] =
        &[("none", Self::None), ("alpha", Self::Alpha), ("blue", Self::Blue)];
}
impl Accumulation {
    pub(crate) fn format(self) -> vk::Format {
        match self {
            Self::Rgba8 => vk::Format::R8G8B8A8_UNORM,
            Self::Rgba16 => vk::Format::R16G16B16A16_UNORM,
            Self::Rgba16f => vk::Format::R16G16B16A16_SFLOAT,
            Self::Rgba32f => vk::Format::R32G32B32A32_SFLOAT,
        }
    }

    /// The shader's code of the format; `None` where the shader does not blend into it.
    pub(crate) fn code(self) -> Option<u32> {
        match self {
            Self::Rgba8 => Some(TARGET_RGBA8),
            Self::Rgba16 => Some(TARGET_RGBA16),
            Self::Rgba16f => Some(TARGET_RGBA16F),
            Self::Rgba32f => None,
        }
    }
}

pub(crate) const STEP: OptionInfo = OptionInfo {
    key: "step",
    values: "a positive number",
    default: "1",
    effect: "distance of slices in units of the smallest voxel spacing; time falls as 1/step, error grows as step^2 where everything is smooth",
};
pub(crate) const FILTER: OptionInfo = OptionInfo {
    key: "filter",
    values: "hardware|exact",
    default: "hardware",
    effect: "exact: single fetches with float32 weights, also of a full table, for devices whose sampler has coarse weights; about twice the time",
};
pub(crate) const PREFILTER: OptionInfo = OptionInfo {
    key: "prefilter",
    values: "none|mip",
    default: "none",
    effect: "mip: where a voxel is smaller than a pixel, takes the mean of the samples that the pixel covers, against aliasing; 1/7 more memory for a volume, 1/3 for a stack, 8-bit samples become 16-bit; disables empty-space skipping; not for data with NaN",
};
pub(crate) const TARGET: OptionInfo = OptionInfo {
    key: "target",
    values: "rgba8|rgba16|rgba16f|rgba32f",
    default: "rgba32f",
    effect: "format that raster blends in; without dithering rgba8 loses every slice of an opacity below 1/510, rgba16f has an error up to 6e-3 after 64 slices, rgba16 about 3e-3 after 1000; rgba8 and rgba16 hold no colour above 1",
};
pub(crate) const ORDER: OptionInfo = OptionInfo {
    key: "order",
    values: "back-to-front|front-to-back",
    default: "back-to-front",
    effect: "order of raster's blending, by the operator over or under; in rgba32f under keeps more digits of the colour of many thin slices",
};
pub(crate) const DITHER: OptionInfo = OptionInfo {
    key: "dither",
    values: "none|alpha|blue",
    default: "none",
    effect: "alpha, blue: raster rounds at random (white or blue noise) with the exact expected value, so that thin slices become noise instead of vanishing; the shader blends, with one draw and one barrier per slice; for targets below rgba32f",
};
pub(crate) const SEED: OptionInfo = OptionInfo {
    key: "seed",
    values: "a whole number below 2^32",
    default: "0",
    effect: "seed of dither; the same seed gives the same image",
};
pub(crate) const ROUTE: OptionInfo = OptionInfo {
    key: "route",
    values: "auto|raster|compute",
    default: "auto",
    effect: "compute composites in registers in float32; auto selects it unless target, order or dither is given",
};
pub(crate) const EMPTY_SPACE: OptionInfo = OptionInfo {
    key: "empty-space",
    values: "skip|march",
    default: "skip",
    effect: "skip: compute skips bricks of 8 x 8 x 8 cells in which nothing is visible; the image is the same, on lavapipe to the bit",
};
pub(crate) const STOP: OptionInfo = OptionInfo {
    key: "stop",
    values: "a number from 0 to below 1",
    default: "2.4e-7",
    effect: "compute ends a ray at this transmittance, which bounds the error of every channel; divided by the largest colour where colours exceed 1",
};
/// The options of the techniques for grids. Not every technique reads all of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridOptions {
    /// Spacing of samples, in units of the smallest voxel spacing.
    pub step: f64,
    /// Reconstruction between samples.
    pub filter: Filter,
    /// Reconstruction where a voxel is smaller than a pixel.
    pub prefilter: Prefilter,
    /// The format that raster accumulates in; `None` is [`Accumulation::Rgba32f`].
    pub target: Option<Accumulation>,
    /// The order of raster's blending; `None` is [`BlendOrder::BackToFront`].
    pub order: Option<BlendOrder>,
    /// How raster rounds.
    pub dither: Dither,
    /// Seed of dithering.
    pub seed: u32,
    /// Route.
    pub route: Route,
    /// Treatment of bricks in which nothing is visible.
    pub empty_space: EmptySpace,
    /// Transmittance at which a ray ends in the compute route.
    pub stop: f64,
}

impl Default for GridOptions {
    fn default() -> Self {
        Self {
            step: 1.0,
            filter: Filter::Hardware,
            prefilter: Prefilter::None,
            target: None,
            order: None,
            dither: Dither::None,
            seed: 0,
            route: Route::Auto,
            empty_space: EmptySpace::Skip,
            // Two units in the last place of a float32 near 1.
            stop: 2.4e-7,
        }
    }
}

impl GridOptions {
    /// Reads one option. Returns `false` when the key is none of these.
    pub(crate) fn read(&mut self, technique: &str, key: &str, text: &str) -> Result<bool> {
        match key {
            "step" => self.step = options::positive(technique, key, text)?,
            "filter" => self.filter = options::choice(technique, key, text)?,
            "prefilter" => self.prefilter = options::choice(technique, key, text)?,
            "target" => self.target = Some(options::choice(technique, key, text)?),
            "order" => self.order = Some(options::choice(technique, key, text)?),
            "dither" => self.dither = options::choice(technique, key, text)?,
            "seed" => self.seed = options::whole(technique, key, text, 0..=u32::MAX)?,
            "route" => self.route = options::choice(technique, key, text)?,
            "empty-space" => self.empty_space = options::choice(technique, key, text)?,
            "stop" => self.stop = options::below_one(technique, key, text)?,
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Every option that is in force, as text that reads back.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = vec![
            ("step", self.step.to_string()),
            ("filter", self.filter.word().to_string()),
            ("prefilter", self.prefilter.word().to_string()),
        ];
        pairs.extend(self.target.map(|target| ("target", target.word().to_string())));
        pairs.extend(self.order.map(|order| ("order", order.word().to_string())));
        if self.dither != Dither::None {
            pairs.push(("dither", self.dither.word().to_string()));
            pairs.push(("seed", self.seed.to_string()));
        }
        pairs.push(("route", self.route.word().to_string()));
        pairs.push(("empty-space", self.empty_space.word().to_string()));
        // The shortest text that reads back to the number.
        pairs.push(("stop", format!("{:e}", self.stop)));
        pairs
    }

    /// Checks the options, alone and together.
    pub(crate) fn check(&self, technique: &str) -> Result<()> {
        let refuse = |key: &str, why: String| Err(Error::invalid(format!("{technique} option {key}"), why));
        if !(self.step.is_finite() && self.step > 0.0) {
            return refuse("step", format!("{}: must be positive and finite", self.step));
        }
        if !(0.0..1.0).contains(&self.stop) {
            return refuse("stop", format!("{}: must be at least 0 and below 1", self.stop));
        }
        if self.dither != Dither::None && self.accumulation().code().is_none() {
            return refuse(
                "dither",
                format!("{}: target must be one of rgba8, rgba16, rgba16f", self.dither.word()),
            );
        }
        if self.route == Route::Compute
            && (self.target.is_some_and(|t| t != Accumulation::Rgba32f)
                || self.order.is_some()
                || self.dither != Dither::None)
        {
            return refuse(
                "route",
                "compute composites front to back in float32: leave out target, order and dither, or select route=raster"
                    .to_string(),
            );
        }
        Ok(())
    }

    pub(crate) fn accumulation(&self) -> Accumulation {
        self.target.unwrap_or(Accumulation::Rgba32f)
    }

    pub(crate) fn order(&self) -> BlendOrder {
        self.order.unwrap_or(BlendOrder::BackToFront)
    }

    /// Returns the route that these options take on a device.
    pub(crate) fn route_on(&self, gpu: &Gpu, technique: &str) -> Result<Route> {
        let for_raster = self.target.is_some() || self.order.is_some() || self.dither != Dither::None;
        if self.route == Route::Compute || (self.route == Route::Auto && !for_raster) {
            return Ok(Route::Compute);
        }
        let what = |option: &str| format!("{technique} {option}");
        if self.dither != Dither::None {
            return if gpu.has(OptionalFeature::FragmentStores) {
                Ok(Route::Raster)
            } else {
                Err(Error::unsupported(what("dither"), "stores in fragment shaders; dither=none works"))
            };
        }
        let format = self.accumulation().format();
        if gpu.image_features(format).contains(vk::FormatFeatureFlags::COLOR_ATTACHMENT_BLEND) {
            return Ok(Route::Raster);
        }
        Err(Error::unsupported(
            what("route=raster"),
            format!("blending into {format:?}; route=compute works"),
        ))
    }
}
