//! The depth at which each ray becomes opaque enough, in an image of the caller's: techniques note it where they composite
//! (`glsl/frame/hit-depths.glsl`), and a pass writes it as a projection stores depths (`glsl/frame/hit-depths-image.glsl`).

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::gpu::shader::{COMPOSITE_VERTEX, CompositeVertex, HIT_DEPTHS_IMAGE_FRAGMENT, HitDepthsImage};
use crate::gpu::{
    Attachment, Blend, Buffer, BufferUse, DepthProjection, Descriptors, Gpu, GraphicsState, Pipeline,
    Recorder, Step, TargetImage,
};
use crate::interface::HitDepthsPush;
use crate::num::f32_of;
use crate::scene::View;

/// Makes the buffer of depths, or of a word where nobody asks for them.
pub(crate) fn hit_depths_buffer(gpu: &Gpu, view: &View, asked: bool) -> Result<Arc<Buffer>> {
    let [width, height] = view.extent().map(u64::from);
    let (name, words) = if asked { ("hit depths", width * height) } else { (Step::STAND_IN, 1) };
    Buffer::new(gpu, name, 4 * words, BufferUse::ShaderWrite).map(Arc::new)
}

/// The passes around the technique.
#[derive(Debug)]
pub(crate) struct HitDepthFrame {
    depths: Arc<Buffer>,
    pipeline: Arc<Pipeline>,
    descriptors: Arc<Descriptors>,
    measure: DepthMeasure,
    view: View,
}

impl HitDepthFrame {
    /// Builds the pass that writes an image of a format.
    pub(crate) fn new(
        gpu: &Gpu,
        depths: &Arc<Buffer>,
        format: vk::Format,
        measure: DepthMeasure,
        view: &View,
    ) -> Result<Self> {
        let bound = COMPOSITE_VERTEX
            .with(&CompositeVertex {})
            .and(HIT_DEPTHS_IMAGE_FRAGMENT.with(&HitDepthsImage { hit_depths: depths.read() }));
        let state = GraphicsState {
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            blend: Blend::Copy,
            format: Some(format),
        };
        let pipeline = gpu.graphics_pipeline("hit_depths.draw", &bound, state)?;
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &bound)?);
        Ok(Self { depths: Arc::clone(depths), pipeline, descriptors, measure, view: *view })
    }

    /// Changes to another view of the same extent.
    pub(crate) fn set_view(&mut self, view: &View) {
        self.view = *view;
    }

    /// Records what comes before the technique.
    pub(crate) fn record_begin(&self, recorder: &mut Recorder<'_>) {
        recorder.clear_buffer("hit_depths.clear", &self.depths);
    }

    /// Records the pass that writes the image.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        image: &TargetImage,
        projection: &DepthProjection,
    ) {
        let push = push_of(&self.measure, &self.view, projection, image.corner);
        let attachment = Attachment::Caller(*image);
        let push = bytemuck::bytes_of(&push);
        recorder.draw("hit_depths.draw", &self.pipeline, &self.descriptors, push, &attachment, false, 3, 1);
    }
}

/// Derives the stored value of a depth z of the measure in float64: that of the distance D = centre + unit z along the view.
fn push_of(
    measure: &DepthMeasure,
    view: &View,
    projection: &DepthProjection,
    corner: [u32; 2],
) -> HitDepthsPush {
    let (centre, unit) = (measure.rays(view).centre_depth, measure.unit);
    let [zero, one] = [projection.at_zero, projection.at_one];
    let (numerator, denominator) = if projection.perspective {
        // (1/D - 1/zero) / (1/one - 1/zero), times D.
        let [zero, range] = [1.0 / zero, 1.0 / one - 1.0 / zero];
        let sign = range.signum();
        let numerator = [sign - sign * zero * centre, -sign * zero * unit];
        (numerator, [range.abs() * centre, range.abs() * unit])
    } else {
        ([(centre - zero) / (one - zero), unit / (one - zero)], [1.0, 0.0])
    };
    HitDepthsPush {
        corner: corner.map(u32::cast_signed),
        numerator: numerator.map(f32_of),
        denominator: denominator.map(f32_of),
        width: view.extent()[0],
        far: if one > zero { 1.0 } else { 0.0 },
    }
}

/// Returns the bits of the transmittance at which a ray has an opacity.
pub(crate) fn transmittance_bits(opacity: f64) -> Result<u32> {
    let transmittance = f32_of(1.0 - opacity);
    if opacity > 0.0 && transmittance > 0.0 && transmittance < 1.0 {
        return Ok(transmittance.to_bits());
    }
    Err(Error::invalid("opacity of hit depths", format!("{opacity}: must be above 6e-8 and below 1")))
}
