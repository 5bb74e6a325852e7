//! The composite draws a technique's image into the caller's colour image, of any format (`glsl/frame/composite.glsl`).

use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::frame::target::TargetMode;
use crate::gpu::shader::{COMPOSITE_FRAGMENT, COMPOSITE_VERTEX, CompositeFragment, CompositeVertex};
use crate::gpu::{
    Attachment, Blend, Descriptors, Gpu, GraphicsState, Image, Pipeline, Recorder, TargetImage,
};

/// Composites the image of a technique into the target, by one full-screen draw.
#[derive(Debug)]
pub(crate) struct Composite {
    pipeline: Arc<Pipeline>,
    descriptors: Arc<Descriptors>,
    clear: bool,
}

impl Composite {
    /// Builds the pipeline that draws `source` into a target of `format`.
    pub(crate) fn new(gpu: &Gpu, source: &Arc<Image>, format: vk::Format, mode: TargetMode) -> Result<Self> {
        let clear = mode == TargetMode::Clear;
        let fragment = CompositeFragment { source: source.sampled(vk::Filter::NEAREST) };
        let bound = COMPOSITE_VERTEX.with(&CompositeVertex {}).and(COMPOSITE_FRAGMENT.with(&fragment));
        let state = GraphicsState {
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            blend: if clear { Blend::Copy } else { Blend::Over },
            format: Some(format),
        };
        let pipeline = gpu.graphics_pipeline("composite.draw", &bound, state)?;
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &bound)?);
        Ok(Self { pipeline, descriptors, clear })
    }

    /// Records the draw into `target`.
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
