//! Options that the techniques for grids share.

use ash::vk;

use crate::error::{Error, Result};
use crate::gpu::shader::{DITHER_BLUE, TARGET_RGBA8, TARGET_RGBA16, TARGET_RGBA16F};
use crate::gpu::{Gpu, OptionalFeature};
use crate::technique::declare::{BlendOrder, EmptySpace, Resolution, Route};
use crate::technique::declare::{Declare, Entry, Text, Value, option_set, refused, words};

words! {
    /// Reconstruction between samples.
    pub enum Filter {
        /// The sampler's: fast, with weights of the device's precision.
        Hardware = "hardware",
        /// Single fetches with float32 weights, of the samples and of a full table.
        Exact = "exact",
    }
}

words! {
    /// Reconstruction where a voxel is smaller than a pixel.
    pub enum Prefilter {
        /// As elsewhere: the rays miss samples between pixels.
        None = "none",
        /// From mip levels: a pixel sees the mean of the samples that it covers.
        Mip = "mip",
    }
}

words! {
    /// Format that raster accumulates in.
    pub enum Accumulation {
        /// 8 bits a channel.
        Rgba8 = "rgba8",
        /// 16 bits a channel, normalised.
        Rgba16 = "rgba16",
        /// 16-bit float.
        Rgba16f = "rgba16f",
        /// 32-bit float.
        Rgba32f = "rgba32f",
    }
}

words! {
    /// How raster rounds to a format of low precision.
    pub enum Dither {
        /// To nearest, by fixed function.
        None = "none",
        /// At random with the exact expected value, by white noise (alpha dithering).
        Alpha = "alpha",
        /// At random with the exact expected value, by the thresholds of a blue-noise tile.
        Blue = "blue",
    }
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
}

// The values that shaders compare options with.
const _: () = {
    assert!(Accumulation::Rgba8 as u32 == TARGET_RGBA8 && Accumulation::Rgba16 as u32 == TARGET_RGBA16);
    assert!(Accumulation::Rgba16f as u32 == TARGET_RGBA16F && Dither::Blue as u32 == DITHER_BLUE);
};

option_set! {
    /// The options of the techniques for grids. Not every technique has all of them.
    pub struct GridOptions {
        /// Sets the distance of slices, or the length of segments, in units of the smallest voxel spacing. Time falls as 1/step; the
        /// error grows as step^2 where everything is smooth.
        pub step: f64 = 1.0 => Rule::positive(),
        /// Selects the filter of samples. exact takes single fetches with float32 weights, also of a full table, for devices whose
        /// sampler (hardware) has coarse weights; it takes about twice the time.
        pub filter: Filter = Filter::Hardware,
        /// mip takes the mean of the samples that a pixel covers, against aliasing, where a voxel is smaller than a pixel. It takes
        /// 1/7 more memory for a volume, 1/3 for a stack; 8-bit samples become 16-bit. It disables empty-space skipping, and refuses
        /// data with NaN.
        pub prefilter: Prefilter = Prefilter::None,
        /// Selects the format that raster blends in. Without dithering rgba8 loses every slice of an opacity below 1/510, rgba16f has
        /// an error up to 6e-3 after 64 slices, rgba16 about 3e-3 after 1000; rgba8 and rgba16 hold no colour above 1.
        pub target: Option<Accumulation> = None => Rule::words().unset("rgba32f"),
        /// Selects the order of raster's blending, by the operator over or under. In rgba32f under (front-to-back) keeps more digits
        /// of the colour of many thin slices.
        pub order: Option<BlendOrder> = None => Rule::words().unset("back-to-front"),
        /// alpha and blue make raster round at random (white or blue noise) with the exact expected value, so that thin slices become
        /// noise instead of vanishing. The shader blends, with one draw and one barrier per slice. They are for targets below rgba32f.
        pub dither: Dither = Dither::None => Rule::words().quiet(),
        /// Sets the seed of dither. The same seed gives the same image.
        pub seed: u32 = 0 => Rule::whole(0, u32::MAX).quiet(),
        /// Selects how the device is used. compute composites in registers in float32; auto selects it unless target, order or dither
        /// is given.
        pub route: Route = Route::Auto,
        /// skip makes compute skip bricks of 8 x 8 x 8 cells in which nothing is visible. The image is the same to the
        /// bit.
        pub empty_space as "empty-space": EmptySpace = EmptySpace::Skip,
        /// Sets the transmittance at which compute ends a ray, which bounds the error of every channel. It is divided by the largest
        /// colour where colours exceed 1.
        // Two units in the last place of a float32 near 1.
        pub stop: f64 = 2.4e-7 => Rule::below_one(),
        /// Selects the pixels that are drawn: half and quarter draw one for each square of 2 x 2 or 4 x 4 and upsample the image. They blur
        /// edges; where the image is smooth their error is of third order. They refuse surfaces and depth images.
        pub resolution: Resolution = Resolution::Full => Rule::words().quiet(),
        /// Sets the second difference of colour or opacity between pixels in a row beyond which compute draws all pixels around them, where
        /// resolution is not full: edges are sharp, and what is smooth costs little. off upsamples everything.
        pub refine: Option<f64> = None => Rule::positive().or("off", None).unset("off").quiet(),
    }
}

impl GridOptions {
    /// Checks the rules between options.
    pub(crate) fn check(&self, technique: &str) -> Result<()> {
        if self.dither != Dither::None && self.accumulation() == Accumulation::Rgba32f {
            let why = format!("{}: target must be one of rgba8, rgba16, rgba16f", self.dither.word());
            return Err(refused(technique, "dither", why));
        }
        if self.refine.is_some() && self.resolution == Resolution::Full {
            return Err(refused(technique, "refine", "resolution must be half or quarter"));
        }
        if self.refine.is_some() && !self.marches() {
            return Err(refused(
                technique,
                "refine",
                "compute draws single pixels: leave out route, target, order and dither",
            ));
        }
        if self.route == Route::Compute
            && (self.target.is_some_and(|t| t != Accumulation::Rgba32f)
                || self.order.is_some()
                || self.dither != Dither::None)
        {
            let why = "compute composites front to back in float32: leave out target, order and dither, or select route=raster";
            return Err(refused(technique, "route", why));
        }
        Ok(())
    }

    /// Returns whether these options take the route compute.
    fn marches(&self) -> bool {
        let for_raster = self.target.is_some() || self.order.is_some() || self.dither != Dither::None;
        self.route == Route::Compute || (self.route == Route::Auto && !for_raster)
    }

    pub(crate) fn accumulation(&self) -> Accumulation {
        self.target.unwrap_or(Accumulation::Rgba32f)
    }

    pub(crate) fn order(&self) -> BlendOrder {
        self.order.unwrap_or(BlendOrder::BackToFront)
    }

    /// Returns the route that these options take on a device.
    pub(crate) fn route_on(&self, gpu: &Gpu, technique: &str) -> Result<Route> {
        if self.marches() {
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

/// Lets `step` take the word `slices` too, which clears the field; a number sets it. Holds the effect of `step`.
pub(crate) struct OrSlices(pub(crate) &'static str);

impl Declare<bool> for OrSlices {
    fn declare<'a>(self, _: Text, field: &'a mut bool, entries: &mut Vec<Entry<'a>>) {
        let Some(step) = entries.iter_mut().find(|entry| entry.key == "step") else { return };
        step.effect = self.0;
        step.words.push("slices");
        if !*field {
            step.text = Some("slices".to_string());
        }
        let mut set = std::mem::replace(&mut step.set, Box::new(|_| false));
        step.set = Box::new(move |text| {
            *field = text != "slices";
            !*field || set(text)
        });
    }
}
