//! Puts a technique's image into the caller's colour image, whatever its format (`glsl/composite.glsl`).

use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::frame::target::TargetMode;
use crate::gpu::shader::{BINDING_SOURCE, COMPOSITE_FRAGMENT, COMPOSITE_VERTEX};
use crate::gpu::{
    Attachment, Blend, Descriptors, Gpu, GraphicsDesc, Image, Pipeline, Recorder, Resource, TargetImage,
};

/// The step after a technique that draws into an image of its own.
#[derive(Debug)]
pub(crate) struct Composite {
    pipeline: Arc<Pipeline>,
    descriptors: Arc<Descriptors>,
    clear: bool,
}

impl Composite {
    pub(crate) fn new(gpu: &Gpu, source: &Arc<Image>, format: vk::Format, mode: TargetMode) -> Result<Self> {
        let clear = mode == TargetMode::Clear;
        let pipeline = gpu.graphics_pipeline(
            "composite.draw",
            &GraphicsDesc {
                vertex: &COMPOSITE_VERTEX,
                fragment: &COMPOSITE_FRAGMENT,
                topology: vk::PrimitiveTopology::TRIANGLE_LIST,
                blend: if clear { Blend::Copy } else { Blend::Over },
                format: Some(format),
                constants: &[],
            },
        )?;
        let source = Resource::Sampled(Arc::clone(source), vk::Filter::NEAREST);
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &[(BINDING_SOURCE, source)])?);
        Ok(Self { pipeline, descriptors, clear })
    }

    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, target: &TargetImage) {
        recorder.draw(
            "composite.draw",
            &self.pipeline,
            &self.descriptors,
            &[],
            &Attachment::Caller(*target),
            self.clear,
            3,
            1,
        );
    }
}
