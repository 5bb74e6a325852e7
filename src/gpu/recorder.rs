//! Recording: named passes that declare what they use. Barriers follow from the uses, timestamps and
//! labels from the names.

use std::any::Any;
use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::Gpu;
use super::external::{CommandBuffer, TargetImage};
use super::image::{Image, whole};
use super::instance::c_name;
use super::pipeline::{Descriptors, Pipeline, Resource};
use super::sync::{Barrier, Tracker, Use};
use crate::error::Result;

use ash::vk::Handle as _;

/// Timestamps of the passes of one recording: two a pass.
#[derive(Debug)]
pub(crate) struct Timers {
    gpu: Gpu,
    pool: vk::QueryPool,
    passes: u32,
}

impl Timers {
    /// Makes timers for `passes` passes; `None` where the device has no timestamps.
    pub(crate) fn new(gpu: &Gpu, passes: u32) -> Result<Option<Arc<Self>>> {
        if gpu.inner.timestamp_bits == 0 {
            return Ok(None);
        }
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(2 * passes.max(1));
        // SAFETY: the device is alive and its queue has timestamps.
        let pool = unsafe { gpu.device().create_query_pool(&info, None) }
            .map_err(|result| gpu.failed("vkCreateQueryPool", result))?;
        gpu.name(pool, "pass timers");
        Ok(Some(Arc::new(Self { gpu: gpu.clone(), pool, passes: passes.max(1) })))
    }

    /// Milliseconds of the first `passes` passes, after their submission has ended.
    pub(crate) fn read(&self, passes: usize) -> Result<Vec<f64>> {
        debug_assert!(passes <= crate::num::index(self.passes), "{passes} passes, {} timers", self.passes);
        let passes = passes.min(crate::num::index(self.passes));
        let mut stamps = vec![0_u64; 2 * passes];
        if stamps.is_empty() {
            return Ok(Vec::new());
        }
        // SAFETY: every query read here was written by a submission that has ended.
        unsafe {
            self.gpu.device().get_query_pool_results(self.pool, 0, &mut stamps, vk::QueryResultFlags::TYPE_64)
        }
        .map_err(|result| self.gpu.failed("vkGetQueryPoolResults", result))?;
        let bits = self.gpu.inner.timestamp_bits;
        let mask = if bits >= 64 { u64::MAX } else { (1 << bits) - 1 };
        let nanoseconds = f64::from(self.gpu.inner.properties.limits.timestamp_period);
        let span =
            |pair: &[u64]| crate::num::f64_of_u64(pair[1].wrapping_sub(pair[0]) & mask) * nanoseconds * 1e-6;
        Ok(stamps.chunks_exact(2).map(span).collect())
    }
}

impl Drop for Timers {
    fn drop(&mut self) {
        // SAFETY: a submission holds its timers until its fence has signalled.
        unsafe { self.gpu.device().destroy_query_pool(self.pool, None) };
    }
}

/// Where a raster pass draws.
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

/// Everything that a recording names; to be kept until its submission has ended.
pub(crate) type Keep = Vec<Arc<dyn Any + Send + Sync>>;

/// The work of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counted {
    /// Passes, each of which needs a timer.
    pub(crate) passes: u32,
    /// Dispatches and draws; several draws may be one pass, and copies are none.
    pub(crate) draws: u32,
}

/// Records passes into a command buffer, or only counts them.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    gpu: Gpu,
    /// `None` where passes are only counted.
    commands: Option<&'a CommandBuffer>,
    tracker: Tracker,
    timers: Option<Arc<Timers>>,
    passes: Vec<String>,
    draws: u32,
    keep: Keep,
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(gpu: &Gpu, commands: &'a CommandBuffer, timers: Option<Arc<Timers>>) -> Self {
        let mut keep = Keep::new();
        if let Some(timers) = &timers {
            // SAFETY: the command buffer is recording, outside of rendering; the pool is not in use: its
            // last submission has ended.
            unsafe {
                gpu.device().cmd_reset_query_pool(commands.raw(), timers.pool, 0, 2 * timers.passes);
            }
            keep.push(Arc::clone(timers) as _);
        }
        Self { timers, keep, commands: Some(commands), ..Self::counting(gpu) }
    }

    /// Counts what is recorded, without a command buffer: no handle of what a pass names is read.
    pub(crate) fn counting(gpu: &Gpu) -> Self {
        Self {
            gpu: gpu.clone(),
            commands: None,
            tracker: Tracker::default(),
            timers: None,
            passes: Vec::new(),
            draws: 0,
            keep: Keep::new(),
        }
    }

    /// The work recorded so far.
    pub(crate) fn counted(&self) -> Counted {
        Counted { passes: crate::num::count(self.passes.len()), draws: self.draws }
    }

    /// Counts a pass of so many dispatches and draws. Returns the command buffer to record it into; `None` where it is only counted.
    fn next_pass(&mut self, name: &str, draws: u32) -> Option<vk::CommandBuffer> {
        self.passes.push(name.to_string());
        self.draws += draws;
        self.commands.map(CommandBuffer::raw)
    }

    /// Keeps `resource` alive until the submission has ended.
    fn keep(&mut self, resource: Arc<dyn Any + Send + Sync>) {
        self.keep.push(resource);
    }

    /// Declares that an image holds data that shaders may sample since before this recording.
    pub(crate) fn assume_ready(&mut self, image: &Arc<Image>) {
        self.tracker.begin(image.raw().as_raw(), vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
    }

    /// Declares how the last recording that used an image, and that has ended, used it.
    pub(crate) fn assume_after(&mut self, image: &Arc<Image>, last: Use) {
        self.tracker.begin_after(image.raw().as_raw(), last, true);
    }

    /// The same of a buffer.
    pub(crate) fn assume_buffer_after(&mut self, buffer: &Arc<Buffer>, last: Use) {
        self.tracker.begin_after(buffer.raw().as_raw(), last, false);
    }

    /// One dispatch as a pass.
    pub(crate) fn dispatch(
        &mut self,
        name: &str,
        pipeline: &Arc<Pipeline>,
        descriptors: &Arc<Descriptors>,
        push: &[u8],
        groups: [u32; 3],
    ) {
        let Some(raw) = self.next_pass(name, 1) else { return };
        self.use_descriptors(descriptors, true);
        self.begin(raw, name);
        self.bind(raw, pipeline, descriptors, push);
        let [x, y, z] = groups;
        // SAFETY: a compute pipeline with its descriptors and push constants is bound; the barriers
        // before this order the accesses.
        unsafe { self.gpu.device().cmd_dispatch(raw, x, y, z) };
        self.end(raw);
    }

    /// One draw as a pass, into one colour attachment of which all is drawn to. `clear` begins with
    /// transparent black instead of what the attachment holds.
    #[expect(
        clippy::too_many_arguments,
        reason = "a draw is made of these; a structure would name each once more"
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
        self.use_descriptors(descriptors, false);
        match target {
            Attachment::Own(image) => self.use_image(image, Use::ColorAttachment),
            // The caller has the image in the attachment's layout, visible to its stage; a second pass
            // must wait for the first.
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
        // SAFETY: a graphics pipeline for this attachment's format is bound with all that it needs.
        unsafe { device.cmd_draw(raw, vertices, instances, 0, 0) };
        // SAFETY: rendering was begun above.
        unsafe { device.cmd_end_rendering(raw) };
        self.end(raw);
    }

    /// Copies a whole image to the start of a buffer, as a pass.
    pub(crate) fn copy_image_to_buffer(&mut self, name: &str, image: &Arc<Image>, buffer: &Arc<Buffer>) {
        let Some(raw) = self.next_pass(name, 0) else { return };
        self.use_image(image, Use::TransferRead);
        self.use_buffer(buffer, Use::TransferWrite);
        self.begin(raw, name);
        let region = image_region(image);
        // SAFETY: the buffer is large enough for the image: whoever made it computed its size from the
        // image; layouts and accesses are ordered by the barriers above.
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

    /// Draws several times as one pass, without attachments: shaders write what is bound, and what one draw
    /// wrote the next one sees. `pushes` has the push constants of each draw.
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
        self.use_descriptors(descriptors, false);
        self.begin(raw, name);
        let area = self.whole_area(raw, extent);
        let info = vk::RenderingInfo::default().render_area(area).layer_count(1);
        let device = self.gpu.device().clone();
        let held = self.keep.len();
        for (i, push) in pushes.enumerate() {
            if i > 0 {
                self.use_descriptors(descriptors, false);
                // Held once is held.
                self.keep.truncate(held);
            }
            // SAFETY: recording, outside of rendering; there is no attachment.
            unsafe { device.cmd_begin_rendering(raw, &info) };
            self.bind(raw, pipeline, descriptors, push.as_ref());
            // SAFETY: a graphics pipeline without attachments is bound with all that it needs.
            unsafe { device.cmd_draw(raw, vertices, 1, 0, 0) };
            // SAFETY: rendering was begun above.
            unsafe { device.cmd_end_rendering(raw) };
        }
        self.end(raw);
    }

    /// Fills a buffer with zeros.
    pub(crate) fn clear_buffer(&mut self, name: &str, buffer: &Arc<Buffer>) {
        let Some(raw) = self.next_pass(name, 0) else { return };
        self.use_buffer(buffer, Use::TransferWrite);
        self.begin(raw, name);
        // SAFETY: recording, outside of rendering; the buffer's size is a multiple of 4 or the rest is left.
        unsafe {
            self.gpu.device().cmd_fill_buffer(raw, buffer.raw(), 0, vk::WHOLE_SIZE, 0);
        }
        self.end(raw);
    }

    /// Fills an image with one colour, as a pass.
    pub(crate) fn clear_image(&mut self, name: &str, image: &Arc<Image>, colour: [f32; 4]) {
        let Some(raw) = self.next_pass(name, 0) else { return };
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

    /// Copies the start of a buffer to a part of a mip level of an image: `count` planes of a volume, or layers
    /// of an array, from `first` on.
    pub(crate) fn copy_buffer_to_image(
        &mut self,
        name: &str,
        buffer: &Arc<Buffer>,
        image: &Arc<Image>,
        level: u32,
        [first, count]: [u32; 2],
    ) {
        let Some(raw) = self.next_pass(name, 0) else { return };
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

    /// Copies the first `bytes` of one buffer to the start of another.
    pub(crate) fn copy_buffer(&mut self, name: &str, from: &Arc<Buffer>, to: &Arc<Buffer>, bytes: u64) {
        let Some(raw) = self.next_pass(name, 0) else { return };
        self.use_buffer(from, Use::TransferRead);
        self.use_buffer(to, Use::TransferWrite);
        self.begin(raw, name);
        let region = vk::BufferCopy { src_offset: 0, dst_offset: 0, size: bytes };
        // SAFETY: both buffers hold at least `bytes`; accesses are ordered above.
        unsafe { self.gpu.device().cmd_copy_buffer(raw, from.raw(), to.raw(), &[region]) };
        self.end(raw);
    }

    /// Leaves an image ready for a use, also of later recordings.
    pub(crate) fn leave(&mut self, image: &Arc<Image>, next: Use) {
        self.use_image(image, next);
    }

    /// Makes what was written to an image visible to every later shader, also of later recordings.
    pub(crate) fn release_image(&mut self, image: &Arc<Image>) {
        self.leave(image, Use::AnyShaderRead);
    }

    /// The same for a buffer.
    pub(crate) fn release_buffer(&mut self, buffer: &Arc<Buffer>) {
        self.use_buffer(buffer, Use::AnyShaderRead);
    }

    /// Makes what was written to a download buffer visible to the host.
    pub(crate) fn release_to_host(&mut self, buffer: &Arc<Buffer>) {
        self.use_buffer(buffer, Use::HostRead);
    }

    /// The names of the passes, and what must be kept until the submission has ended.
    pub(crate) fn finish(self) -> (Vec<String>, Keep) {
        (self.passes, self.keep)
    }

    /// Draws from here on go to the whole of an extent.
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

    fn bind(
        &mut self,
        raw: vk::CommandBuffer,
        pipeline: &Arc<Pipeline>,
        descriptors: &Arc<Descriptors>,
        push: &[u8],
    ) {
        debug_assert_eq!(
            crate::num::count(push.len()),
            pipeline.push_bytes(),
            "push constants of {}",
            pipeline.name()
        );
        let device = self.gpu.device();
        // SAFETY: the pipeline lives as long as the device.
        unsafe { device.cmd_bind_pipeline(raw, pipeline.bind_point(), pipeline.raw()) };
        // SAFETY: the set was made for this pipeline's layout and is kept until the submission has ended.
        unsafe {
            device.cmd_bind_descriptor_sets(
                raw,
                pipeline.bind_point(),
                pipeline.layout(),
                0,
                &[descriptors.set()],
                &[],
            );
        }
        if !push.is_empty() {
            // SAFETY: the layout's one range starts at 0 and has this size.
            unsafe { device.cmd_push_constants(raw, pipeline.layout(), pipeline.stages(), 0, push) };
        }
    }

    fn use_descriptors(&mut self, descriptors: &Arc<Descriptors>, compute: bool) {
        for (resource, usage) in descriptors.uses(compute) {
            match resource {
                Resource::Buffer(buffer) | Resource::ReadOnly(buffer) => self.use_buffer(buffer, usage),
                Resource::Sampled(image, _) => {
                    // What is sampled and was not written here was made ready before: its contents must be kept.
                    if !self.tracker.knows(image.raw().as_raw()) {
                        self.assume_ready(image);
                    }
                    self.use_image(image, usage);
                }
                Resource::Storage(image) => self.use_image(image, usage),
                Resource::External => {}
            }
        }
        self.keep(Arc::clone(descriptors) as _);
    }

    fn use_buffer(&mut self, buffer: &Arc<Buffer>, usage: Use) {
        if let Some(barrier) = self.tracker.next(buffer.raw().as_raw(), usage, false) {
            let barriers = [vk::BufferMemoryBarrier2::default()
                .src_stage_mask(barrier.src_stage)
                .src_access_mask(barrier.src_access)
                .dst_stage_mask(barrier.dst_stage)
                .dst_access_mask(barrier.dst_access)
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .buffer(buffer.raw())
                .size(vk::WHOLE_SIZE)];
            self.barrier(&vk::DependencyInfo::default().buffer_memory_barriers(&barriers));
        }
        self.keep(Arc::clone(buffer) as _);
    }

    fn use_image(&mut self, image: &Arc<Image>, usage: Use) {
        if let Some(barrier) = self.tracker.next(image.raw().as_raw(), usage, true) {
            self.image_barrier(image.raw(), &barrier);
        }
        self.keep(Arc::clone(image) as _);
    }

    fn use_external(&mut self, target: &TargetImage) {
        let key = target.image.as_raw();
        if !self.tracker.knows(key) {
            self.tracker.begin(key, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
        }
        if let Some(barrier) = self.tracker.next(key, Use::ColorAttachment, true) {
            self.image_barrier(target.image, &barrier);
        }
    }

    fn image_barrier(&self, image: vk::Image, barrier: &Barrier) {
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(barrier.src_stage)
            .src_access_mask(barrier.src_access)
            .dst_stage_mask(barrier.dst_stage)
            .dst_access_mask(barrier.dst_access)
            .old_layout(barrier.old_layout)
            .new_layout(barrier.new_layout)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image)
            .subresource_range(whole(vk::ImageAspectFlags::COLOR))];
        self.barrier(&vk::DependencyInfo::default().image_memory_barriers(&barriers));
    }

    fn barrier(&self, info: &vk::DependencyInfo<'_>) {
        let Some(commands) = self.commands else { return };
        // SAFETY: recording, outside of rendering; handles in `info` are alive; synchronization2 is on.
        unsafe { self.gpu.device().cmd_pipeline_barrier2(commands.raw(), info) };
    }

    /// Label and first timestamp of a pass. Earlier work ends before the stamp, so that it is not billed
    /// to this pass.
    fn begin(&self, raw: vk::CommandBuffer, name: &str) {
        if let Some(debug) = self.gpu.debug() {
            let name = c_name(name);
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: recording; the extension is enabled.
            unsafe { debug.cmd_begin_debug_utils_label(raw, &label) };
        }
        self.stamp(raw, 0);
    }

    fn end(&self, raw: vk::CommandBuffer) {
        self.stamp(raw, 1);
        if let Some(debug) = self.gpu.debug() {
            // SAFETY: a label was begun in this command buffer by `begin`.
            unsafe { debug.cmd_end_debug_utils_label(raw) };
        }
        if let Some(commands) = self.commands {
            commands.next_part();
        }
    }

    /// Writes stamp 0 (before) or 1 (after) of the last pass.
    fn stamp(&self, raw: vk::CommandBuffer, which: u32) {
        let Some(timers) = &self.timers else { return };
        let pass = crate::num::count(self.passes.len()) - 1;
        debug_assert!(pass < timers.passes, "pass {pass}, {:?}, has no timer", self.passes.last());
        if pass >= timers.passes {
            return;
        }
        // SAFETY: recording; the query was reset in this command buffer and is written once.
        unsafe {
            self.gpu.device().cmd_write_timestamp2(
                raw,
                super::sync::END_OF_ALL,
                timers.pool,
                2 * pass + which,
            );
        }
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

/// An image side as the viewport takes it; exact, sides are below 2^24.
#[expect(clippy::cast_precision_loss, reason = "image sides are at most 32768")]
fn pixels(side: u32) -> f32 {
    side as f32
}
