//! Passes that fill, clear and copy buffers and images.

use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::image::{Image, whole};
use super::recorder::Recorder;
use super::sync::Use;

impl Recorder<'_> {
    /// Records a pass that copies a whole image to the start of a buffer.
    pub(crate) fn copy_image_to_buffer(&mut self, name: &str, image: &Arc<Image>, buffer: &Arc<Buffer>) {
        let Some(raw) = self.next_pass(name, 0) else { return };
        let _held = self.gpu.lock_layer();
        self.use_image(image, Use::TransferRead);
        self.use_buffer(buffer, Use::TransferWrite);
        self.begin(raw, name);
        let region = image_region(image);
        // SAFETY: the buffer was made with the size of the image; layouts and accesses are ordered by the
        // barriers above.
        unsafe {
            self.gpu.device().cmd_copy_image_to_buffer(
                raw,
                image.raw(),
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                buffer.raw(),
                &[region],
            );
        }
        self.end(raw);
        self.use_buffer(buffer, Use::HostRead);
    }

    /// Records a pass that fills a buffer with zeros.
    pub(crate) fn clear_buffer(&mut self, name: &str, buffer: &Arc<Buffer>) {
        let Some(raw) = self.next_pass(name, 0) else { return };
        let _held = self.gpu.lock_layer();
        self.use_buffer(buffer, Use::TransferWrite);
        self.begin(raw, name);
        // SAFETY: recording, outside of rendering; `WHOLE_SIZE` rounds the size down to a multiple of 4.
        unsafe {
            self.gpu.device().cmd_fill_buffer(raw, buffer.raw(), 0, vk::WHOLE_SIZE, 0);
        }
        self.end(raw);
    }

    /// Records a pass that fills an image with one colour.
    pub(crate) fn clear_image(&mut self, name: &str, image: &Arc<Image>, colour: [f32; 4]) {
        let Some(raw) = self.next_pass(name, 0) else { return };
        let _held = self.gpu.lock_layer();
        self.use_image(image, Use::TransferWrite);
        self.begin(raw, name);
        let colour = vk::ClearColorValue { float32: colour };
        // SAFETY: recording, outside of rendering; a colour image in this layout by the barrier above.
        unsafe {
            self.gpu.device().cmd_clear_color_image(
                raw,
                image.raw(),
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &colour,
                &[whole(vk::ImageAspectFlags::COLOR)],
            );
        }
        self.end(raw);
    }

    /// Records a pass that copies the start of a buffer to a part of a mip level of an image: to `count` planes of a
    /// volume, or layers of an array, from `first` on.
    pub(crate) fn copy_buffer_to_image(
        &mut self,
        name: &str,
        buffer: &Arc<Buffer>,
        image: &Arc<Image>,
        level: u32,
        [first, count]: [u32; 2],
    ) {
        let Some(raw) = self.next_pass(name, 0) else { return };
        let _held = self.gpu.lock_layer();
        self.use_buffer(buffer, Use::TransferRead);
        self.use_image(image, Use::TransferWrite);
        self.begin(raw, name);
        let mut region = image_region(image);
        let [width, height, _] = image.desc().level_extent(level);
        region.image_subresource.mip_level = level;
        if image.desc().volume {
            region.image_offset.z = i32::try_from(first).unwrap_or(i32::MAX);
            region.image_extent = vk::Extent3D { width, height, depth: count };
        } else {
            region.image_subresource.base_array_layer = first;
            region.image_subresource.layer_count = count;
            region.image_extent = vk::Extent3D { width, height, depth: 1 };
        }
        // SAFETY: the buffer holds `count` planes of the level; layouts and accesses are ordered above.
        unsafe {
            self.gpu.device().cmd_copy_buffer_to_image(
                raw,
                buffer.raw(),
                image.raw(),
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &[region],
            );
        }
        self.end(raw);
    }

    /// Records a pass that copies the first `bytes` of one buffer to the start of another.
    pub(crate) fn copy_buffer(&mut self, name: &str, from: &Arc<Buffer>, to: &Arc<Buffer>, bytes: u64) {
        let Some(raw) = self.next_pass(name, 0) else { return };
        let _held = self.gpu.lock_layer();
        self.use_buffer(from, Use::TransferRead);
        self.use_buffer(to, Use::TransferWrite);
        self.begin(raw, name);
        let region = vk::BufferCopy { src_offset: 0, dst_offset: 0, size: bytes };
        // SAFETY: both buffers hold at least `bytes`; accesses are ordered above.
        unsafe { self.gpu.device().cmd_copy_buffer(raw, from.raw(), to.raw(), &[region]) };
        self.end(raw);
    }
}

fn image_region(image: &Image) -> vk::BufferImageCopy {
    let [width, height, depth] = image.desc().extent;
    vk::BufferImageCopy {
        image_subresource: vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: image.desc().layers,
        },
        image_extent: vk::Extent3D { width, height, depth },
        ..Default::default()
    }
}
