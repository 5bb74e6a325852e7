//! The Vulkan commands of each kind of work.

use ash::vk;

use super::descriptors::Descriptors;
use super::device::Gpu;
use super::image::{Image, whole};
use super::pipeline::Pipeline;
use super::steps::{Attachment, Groups, Work};
use crate::num;

impl Gpu {
    /// Records the commands of a step into a command buffer that is recording, outside of rendering, after the step's barriers.
    /// `between` records these again, between draws of which each sees the writes of the one before.
    pub(super) fn issue(&self, raw: vk::CommandBuffer, work: &Work, mut between: impl FnMut()) {
        let device = self.device();
        match work {
            Work::Dispatch { pipeline, descriptors, push, groups } => {
                self.bind(raw, pipeline, descriptors, push);
                match groups {
                    // SAFETY: a compute pipeline with its descriptors and push constants is bound; barriers order the accesses.
                    Groups::Fixed([x, y, z]) => unsafe { device.cmd_dispatch(raw, *x, *y, *z) },
                    // SAFETY: the same; the buffer holds three words, has the usage `INDIRECT_BUFFER`, and is kept.
                    Groups::Counted(words) => unsafe { device.cmd_dispatch_indirect(raw, words.raw, 0) },
                }
            }
            Work::Draw { pipeline, descriptors, pushes, target, extent, vertices, instances } => {
                for (i, push) in pushes.iter().enumerate() {
                    if i > 0 {
                        between();
                    }
                    self.begin_rendering(raw, *extent, target.as_ref());
                    self.bind(raw, pipeline, descriptors, push);
                    // SAFETY: a graphics pipeline for these attachments is bound with its descriptors and push constants.
                    unsafe { device.cmd_draw(raw, *vertices, *instances, 0, 0) };
                    // SAFETY: rendering was begun above.
                    unsafe { device.cmd_end_rendering(raw) };
                }
            }
            Work::ClearBuffer(buffer, bytes) => {
                // SAFETY: recording, outside of rendering; `bytes` is a multiple of 4 within the buffer, or `WHOLE_SIZE`, which rounds the
                // size down to one.
                unsafe { device.cmd_fill_buffer(raw, buffer.raw, 0, *bytes, 0) };
            }
            Work::ClearImage(image, colour) => {
                let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
                let colour = vk::ClearColorValue { float32: *colour };
                let all = [whole(vk::ImageAspectFlags::COLOR)];
                // SAFETY: recording, outside of rendering; a colour image in this layout by the step's barrier.
                unsafe { device.cmd_clear_color_image(raw, image.raw, layout, &colour, &all) };
            }
            Work::CopyBuffer { from, to, parts } => {
                let region = |&[src_offset, dst_offset, size]: &[u64; 3]| vk::BufferCopy {
                    src_offset,
                    dst_offset,
                    size,
                };
                let regions: Vec<_> = parts.iter().map(region).collect();
                // SAFETY: both buffers hold these parts, of which there is one; barriers order the accesses.
                unsafe { device.cmd_copy_buffer(raw, from.raw, to.raw, &regions) };
            }
            Work::CopyImageToBuffer { image, buffer } => {
                let region = image_region(image, 0, [0, image.desc().planes(0)]);
                let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
                // SAFETY: the buffer was made with the size of the image; barriers order layouts and accesses.
                unsafe { device.cmd_copy_image_to_buffer(raw, image.raw, layout, buffer.raw, &[region]) };
            }
            Work::CopyBufferToImage { buffer, image, level, planes } => {
                let region = image_region(image, *level, *planes);
                let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
                // SAFETY: the buffer holds these planes of the level; barriers order layouts and accesses.
                unsafe { device.cmd_copy_buffer_to_image(raw, buffer.raw, image.raw, layout, &[region]) };
            }
            Work::CopyBufferToCubes { buffer, image, side, cubes } => {
                let region = |&(offset, corner): &(u64, [u32; 3])| {
                    let [x, y] = [corner[0], corner[1]].map(|place| i32::try_from(place).unwrap_or(i32::MAX));
                    let part = image_region(image, 0, [corner[2], *side]);
                    vk::BufferImageCopy {
                        buffer_offset: offset,
                        image_offset: vk::Offset3D { x, y, ..part.image_offset },
                        image_extent: vk::Extent3D { width: *side, height: *side, ..part.image_extent },
                        ..part
                    }
                };
                let regions: Vec<_> = cubes.iter().map(region).collect();
                let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
                // SAFETY: the buffer holds a cube from each offset on, a multiple of 4, and the image has them; there is one; barriers order
                // layouts and accesses.
                unsafe { device.cmd_copy_buffer_to_image(raw, buffer.raw, image.raw, layout, &regions) };
            }
            Work::Leave | Work::Inherit(..) => {}
        }
    }

    /// Binds a pipeline with its descriptors and push constants.
    fn bind(&self, raw: vk::CommandBuffer, pipeline: &Pipeline, descriptors: &Descriptors, push: &[u8]) {
        debug_assert_eq!(num::count(push.len()), pipeline.push_bytes, "push constants of {}", pipeline.name);
        let (device, point) = (self.device(), pipeline.bind_point);
        // SAFETY: the pipeline was built before the recording and lives as long as the device.
        unsafe { device.cmd_bind_pipeline(raw, point, pipeline.raw()) };
        // SAFETY: the set was made for this pipeline's layout and is kept until the submission has ended.
        unsafe { device.cmd_bind_descriptor_sets(raw, point, pipeline.layout, 0, &[descriptors.set], &[]) };
        if !push.is_empty() {
            // SAFETY: the layout's one range starts at 0 and has this size.
            unsafe { device.cmd_push_constants(raw, pipeline.layout, pipeline.stages, 0, push) };
        }
    }

    /// Begins rendering of a whole extent, into an attachment if there is one, which is cleared if the flag says so.
    fn begin_rendering(
        &self,
        raw: vk::CommandBuffer,
        [width, height]: [u32; 2],
        target: Option<&(Attachment, bool)>,
    ) {
        let device = self.device();
        let [x, y] = target.map_or([0; 2], |(target, _)| target.corner());
        let offset = vk::Offset2D { x: x.cast_signed(), y: y.cast_signed() };
        let area = vk::Rect2D { offset, extent: vk::Extent2D { width, height } };
        let viewport = vk::Viewport {
            x: pixels(x),
            y: pixels(y),
            width: pixels(width),
            height: pixels(height),
            max_depth: 1.0,
            ..vk::Viewport::default()
        };
        // SAFETY: recording; every pipeline's viewport is dynamic.
        unsafe { device.cmd_set_viewport(raw, 0, &[viewport]) };
        // SAFETY: recording; every pipeline's scissor is dynamic.
        unsafe { device.cmd_set_scissor(raw, 0, &[area]) };
        let attachment = |(target, clear): &(Attachment, bool)| {
            vk::RenderingAttachmentInfo::default()
                .image_view(target.view())
                .image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
                .load_op(if *clear { vk::AttachmentLoadOp::CLEAR } else { vk::AttachmentLoadOp::LOAD })
                .store_op(vk::AttachmentStoreOp::STORE)
        };
        let attachments: Vec<_> = target.map(attachment).into_iter().collect();
        let info =
            vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&attachments);
        // SAFETY: recording, outside of rendering; the attachment is in its layout by the step's barrier or by the caller's contract.
        unsafe { device.cmd_begin_rendering(raw, &info) };
    }
}

/// Converts an image side for the viewport; exact, since sides are below 2^24.
#[expect(clippy::cast_precision_loss, reason = "image sides are at most 32768")]
fn pixels(side: u32) -> f32 {
    side as f32
}

/// Returns the region of planes or layers `[first, count]` of a mip level.
fn image_region(image: &Image, mip_level: u32, [first, count]: [u32; 2]) -> vk::BufferImageCopy {
    let [width, height, _] = image.desc().level_extent(mip_level);
    let mut region = vk::BufferImageCopy {
        image_subresource: vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level,
            base_array_layer: first,
            layer_count: count,
        },
        image_extent: vk::Extent3D { width, height, depth: 1 },
        ..Default::default()
    };
    if image.desc().volume {
        (region.image_subresource.base_array_layer, region.image_subresource.layer_count) = (0, 1);
        region.image_offset.z = i32::try_from(first).unwrap_or(i32::MAX);
        region.image_extent.depth = count;
    }
    region
}
