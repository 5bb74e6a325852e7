//! Enlarges the image of a frame that was drawn with fewer pixels (`glsl/frame/upsampling.glsl`).

use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::frame::target::{TargetDesc, usage_after};
use crate::gpu::shader::{UPSAMPLING_COMPUTE, Upsampling as Inputs};
use crate::gpu::{Gpu, Image, ImageDesc, Recorder};
use crate::interface::UpsamplingPush;
use crate::num::f32_of;
use crate::primitives::dispatch::{Dispatch, pass, tiles_of};
use crate::scene::View;

/// The pass that makes an image of the view's size from one with fewer pixels.
#[derive(Debug)]
pub(crate) struct Upsampling {
    pass: Dispatch,
    push: UpsamplingPush,
    /// The image of the view's size.
    pub(crate) image: Arc<Image>,
}

impl Upsampling {
    /// Builds the pass that reads `drawn`, which shows `view` with fewer pixels.
    pub(crate) fn new(gpu: &Gpu, drawn: &Arc<Image>, view: &View, target: &TargetDesc) -> Result<Self> {
        let usage = vk::ImageUsageFlags::STORAGE | usage_after(target, false);
        let desc = ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, view.extent(), usage);
        let image = Arc::new(Image::new(gpu, "upsampling", &desc)?);
        let bound = UPSAMPLING_COMPUTE
            .with(&Inputs { source: drawn.sampled(vk::Filter::NEAREST), accumulation: image.stored() });
        let half = |side: u32| f64::from(side) * 0.5;
        let [width, height, _] = drawn.desc().extent;
        let push = UpsamplingPush {
            half_extent: view.extent().map(|side| f32_of(half(side))),
            half_source: [width, height].map(|side| f32_of(half(side))),
            // Both images show the same height.
            scale: f32_of(f64::from(height) / f64::from(view.extent()[1])),
            pad0: 0,
        };
        Ok(Self { pass: pass(gpu, "upsampling", &bound)?, push, image })
    }

    pub(crate) fn record(&self, recorder: &mut Recorder<'_>) {
        let [width, height, _] = self.image.desc().extent;
        self.pass.record(recorder, &self.push, tiles_of([width, height]));
    }
}
