//! The recorder: named passes declare their uses of resources, from which it derives barriers. Each pass gets a label and
//! a timestamp.

use std::any::Any;
use std::sync::Arc;

use ash::vk;
use ash::vk::Handle as _;

use super::buffer::Buffer;
use super::descriptors::Descriptors;
use super::device::Gpu;
use super::external::{CommandBuffer, TargetImage};
use super::image::{Image, whole};
use super::inputs::Resource;
use super::instance::c_name;
use super::pipeline::Pipeline;
use super::sync::{Barrier, Tracker, Use};
use super::timers::Timers;

/// The resources of a recording, kept alive until its submission has ended.
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
    pub(super) gpu: Gpu,
    /// `None` where passes are only counted.
    commands: Option<&'a CommandBuffer>,
    tracker: Tracker,
    timers: Option<Arc<Timers>>,
    passes: Vec<String>,
    draws: u32,
    pub(super) keep: Keep,
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(gpu: &Gpu, commands: &'a CommandBuffer, timers: Option<Arc<Timers>>) -> Self {
        let mut keep = Keep::new();
        if let Some(timers) = &timers {
            let _held = gpu.lock_layer();
            // SAFETY: the command buffer is recording, outside of rendering; the last submission that used the
            // pool has ended.
            unsafe {
                gpu.device().cmd_reset_query_pool(commands.raw(), timers.pool, 0, timers.passes + 1);
            }
            keep.push(Arc::clone(timers) as _);
        }
        Self { timers, keep, commands: Some(commands), ..Self::counting(gpu) }
    }

    /// Counts the passes that are recorded, without a command buffer. It reads no handle of the resources of a pass.
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

    /// Returns the work recorded so far.
    pub(crate) fn counted(&self) -> Counted {
        Counted { passes: crate::num::count(self.passes.len()), draws: self.draws }
    }

    /// Counts a pass of so many dispatches and draws. Returns the command buffer to record it into; `None` where it is only
    /// counted.
    pub(super) fn next_pass(&mut self, name: &str, draws: u32) -> Option<vk::CommandBuffer> {
        self.passes.push(name.to_string());
        self.draws += draws;
        self.commands.map(CommandBuffer::raw)
    }

    /// Keeps `resource` alive until the submission has ended.
    fn keep(&mut self, resource: Arc<dyn Any + Send + Sync>) {
        self.keep.push(resource);
    }

    /// Declares that an earlier submission has made an image ready for sampling.
    pub(crate) fn assume_ready(&mut self, image: &Arc<Image>) {
        self.tracker.begin(image.raw().as_raw(), vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
    }

    /// Declares the last use of an image by an earlier submission, which has ended.
    pub(crate) fn assume_after(&mut self, image: &Arc<Image>, last: Use) {
        self.tracker.begin_after(image.raw().as_raw(), last, true);
    }

    /// Declares the last use of a buffer by an earlier submission, which has ended.
    pub(crate) fn assume_buffer_after(&mut self, buffer: &Arc<Buffer>, last: Use) {
        self.tracker.begin_after(buffer.raw().as_raw(), last, false);
    }

    /// Records one dispatch as a pass.
    pub(crate) fn dispatch(
        &mut self,
        name: &str,
        pipeline: &Arc<Pipeline>,
        descriptors: &Arc<Descriptors>,
        push: &[u8],
        groups: [u32; 3],
    ) {
        let Some(raw) = self.next_pass(name, 1) else { return };
        let _held = self.gpu.lock_layer();
        self.use_descriptors(descriptors, true);
        self.begin(raw, name);
        self.bind(raw, pipeline, descriptors, push);
        let [x, y, z] = groups;
        // SAFETY: a compute pipeline with its descriptors and push constants is bound; the barriers
        // before this order the accesses.
        unsafe { self.gpu.device().cmd_dispatch(raw, x, y, z) };
        self.end(raw);
    }

    /// Makes an image ready for a use, also by later recordings.
    pub(crate) fn leave(&mut self, image: &Arc<Image>, next: Use) {
        let _held = self.gpu.lock_layer();
        self.use_image(image, next);
    }

    /// Makes writes to an image visible to every later shader, also of later recordings.
    pub(crate) fn release_image(&mut self, image: &Arc<Image>) {
        self.leave(image, Use::AnyShaderRead);
    }

    /// Makes writes to a buffer visible to every later shader, also of later recordings.
    pub(crate) fn release_buffer(&mut self, buffer: &Arc<Buffer>) {
        let _held = self.gpu.lock_layer();
        self.use_buffer(buffer, Use::AnyShaderRead);
    }

    /// Makes writes to a download buffer visible to the host.
    pub(crate) fn release_to_host(&mut self, buffer: &Arc<Buffer>) {
        let _held = self.gpu.lock_layer();
        self.use_buffer(buffer, Use::HostRead);
    }

    /// Writes the timestamp after the last pass. Returns the names of the passes, and the resources to keep until the submission has
    /// ended.
    pub(crate) fn finish(self) -> (Vec<String>, Keep) {
        if let Some(commands) = self.commands {
            let _held = self.gpu.lock_layer();
            self.stamp(commands.raw(), self.passes.len());
        }
        (self.passes, self.keep)
    }

    pub(super) fn bind(
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

    pub(super) fn use_descriptors(&mut self, descriptors: &Arc<Descriptors>, compute: bool) {
        for (resource, usage) in descriptors.uses(compute) {
            match resource {
                Resource::Read(buffer) | Resource::Write(buffer) => self.use_buffer(buffer, usage),
                Resource::Sampled(image, _) => {
                    // An image that this recording has not written was made ready before; its contents are kept.
                    if !self.tracker.knows(image.raw().as_raw()) {
                        self.assume_ready(image);
                    }
                    self.use_image(image, usage);
                }
                Resource::Stored(image) => self.use_image(image, usage),
                Resource::External => {}
            }
        }
        self.keep(Arc::clone(descriptors) as _);
    }

    pub(super) fn use_buffer(&mut self, buffer: &Arc<Buffer>, usage: Use) {
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

    pub(super) fn use_image(&mut self, image: &Arc<Image>, usage: Use) {
        if let Some(barrier) = self.tracker.next(image.raw().as_raw(), usage, true) {
            self.image_barrier(image.raw(), &barrier);
        }
        self.keep(Arc::clone(image) as _);
    }

    pub(super) fn use_external(&mut self, target: &TargetImage) {
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

    /// Begins a pass: label and timestamp. The stamp waits for earlier work, whose time does not count for this pass.
    pub(super) fn begin(&self, raw: vk::CommandBuffer, name: &str) {
        if let Some(debug) = self.gpu.debug() {
            let name = c_name(name);
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: recording; the extension is enabled.
            unsafe { debug.cmd_begin_debug_utils_label(raw, &label) };
        }
        self.stamp(raw, self.passes.len() - 1);
    }

    pub(super) fn end(&self, raw: vk::CommandBuffer) {
        if let Some(debug) = self.gpu.debug() {
            // SAFETY: a label was begun in this command buffer by `begin`.
            unsafe { debug.cmd_end_debug_utils_label(raw) };
        }
        if let Some(commands) = self.commands {
            commands.next_part();
        }
    }

    /// Writes a timestamp: that of a pass, or the one after the last.
    fn stamp(&self, raw: vk::CommandBuffer, number: usize) {
        let Some(timers) = &self.timers else { return };
        let number = crate::num::count(number);
        debug_assert!(number <= timers.passes, "{:?} has no timer", self.passes.last());
        if number > timers.passes {
            return;
        }
        // SAFETY: recording; the query was reset in this command buffer and is written once.
        unsafe {
            self.gpu.device().cmd_write_timestamp2(
                raw,
                super::sync::END_OF_ALL,
                timers.pool,
                number,
            );
        }
    }
}
