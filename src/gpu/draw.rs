//! Raster passes.

use std::sync::Arc;

use ash::vk;

use super::descriptors::Descriptors;
use super::external::TargetImage;
use super::image::Image;
use super::pipeline::Pipeline;
use super::recorder::Recorder;
use super::sync::Use;

/// The target of a raster pass.
#[derive(Clone, Debug)]
pub(crate) enum Attachment {
    /// An image of this crate.
    Own(Arc<Image>),
    /// An image of the caller.
    Caller(TargetImage),
}

impl Attachment {
    fn view(&self) -> vk::ImageView {
        match self {
            Self::Own(image) => image.view(),
            Self::Caller(target) => target.view,
        }
    }

    fn extent(&self) -> [u32; 2] {
        match self {
            Self::Own(image) => [image.desc().extent[0], image.desc().extent[1]],
            Self::Caller(target) => target.extent,
        }
    }
}

impl Recorder<'_> {
    /// Records one draw as a pass, into the whole of one colour attachment. `clear` clears it to transparent black first.
    #[expect(
        clippy::too_many_arguments,
        reason = "the parameters of a draw; a structure would only repeat their names"
    )]
    pub(crate) fn draw(
        &mut self,
        name: &str,
        pipeline: &Arc<Pipeline>,
        descriptors: &Arc<Descriptors>,
        push: &[u8],
        target: &Attachment,
        clear: bool,
        vertices: u32,
        instances: u32,
    ) {
        let Some(raw) = self.next_pass(name, 1) else { return };
        let _held = self.gpu.lock_layer();
        self.use_descriptors(descriptors, false);
        match target {
            Attachment::Own(image) => self.use_image(image, Use::ColorAttachment),
            // The caller has made the image ready; a second pass must wait for the first.
            Attachment::Caller(target) => {
                self.use_external(target);
            }
        }
        self.begin(raw, name);
        let area = self.whole_area(raw, target.extent());
        let attachments = [vk::RenderingAttachmentInfo::default()
            .image_view(target.view())
            .image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            .load_op(if clear { vk::AttachmentLoadOp::CLEAR } else { vk::AttachmentLoadOp::LOAD })
            .store_op(vk::AttachmentStoreOp::STORE)];
        let info =
            vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&attachments);
        let device = self.gpu.device().clone();
        // SAFETY: recording, outside of rendering; the attachment is in its layout by the barrier above
        // or by the caller's contract.
        unsafe { device.cmd_begin_rendering(raw, &info) };
        self.bind(raw, pipeline, descriptors, push);
        // SAFETY: a graphics pipeline for this attachment's format is bound with its descriptors and push constants.
        unsafe { device.cmd_draw(raw, vertices, instances, 0, 0) };
        // SAFETY: rendering was begun above.
        unsafe { device.cmd_end_rendering(raw) };
        self.end(raw);
    }

    /// Records several draws without attachments as one pass: shaders write bound resources, and each draw sees the writes of
    /// the one before. `pushes` yields the push constants of each draw.
    pub(crate) fn draw_each<P: AsRef<[u8]>>(
        &mut self,
        name: &str,
        pipeline: &Arc<Pipeline>,
        descriptors: &Arc<Descriptors>,
        pushes: impl ExactSizeIterator<Item = P>,
        extent: [u32; 2],
        vertices: u32,
    ) {
        let Some(raw) = self.next_pass(name, crate::num::count(pushes.len())) else { return };
        let _held = self.gpu.lock_layer();
        self.use_descriptors(descriptors, false);
        self.begin(raw, name);
        let area = self.whole_area(raw, extent);
        let info = vk::RenderingInfo::default().render_area(area).layer_count(1);
        let device = self.gpu.device().clone();
        let held = self.keep.len();
        for (i, push) in pushes.enumerate() {
            if i > 0 {
                self.use_descriptors(descriptors, false);
                // One reference per command buffer is enough.
                self.keep.truncate(held);
            }
            // SAFETY: recording, outside of rendering; there is no attachment.
            unsafe { device.cmd_begin_rendering(raw, &info) };
            self.bind(raw, pipeline, descriptors, push.as_ref());
            // SAFETY: a graphics pipeline without attachments is bound with its descriptors and push constants.
            unsafe { device.cmd_draw(raw, vertices, 1, 0, 0) };
            // SAFETY: rendering was begun above.
            unsafe { device.cmd_end_rendering(raw) };
        }
        self.end(raw);
    }

    /// Sets viewport and scissor to a whole extent, and returns the area.
    fn whole_area(&self, raw: vk::CommandBuffer, [width, height]: [u32; 2]) -> vk::Rect2D {
        let area = vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width, height } };
        let viewport = vk::Viewport {
            x: 0.0,
            y: 0.0,
            width: pixels(width),
            height: pixels(height),
            min_depth: 0.0,
            max_depth: 1.0,
        };
        let device = self.gpu.device();
        // SAFETY: recording; every pipeline's viewport is dynamic.
        unsafe { device.cmd_set_viewport(raw, 0, &[viewport]) };
        // SAFETY: recording; every pipeline's scissor is dynamic.
        unsafe { device.cmd_set_scissor(raw, 0, &[area]) };
        area
    }
}

/// Converts an image side for the viewport; exact, since sides are below 2^24.
#[expect(clippy::cast_precision_loss, reason = "image sides are at most 32768")]
fn pixels(side: u32) -> f32 {
    side as f32
}
