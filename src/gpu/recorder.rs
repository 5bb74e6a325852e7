//! The recorder collects the steps of a recording, and issues them with the barriers that follow from their uses of resources. Each
//! pass gets a label and a timestamp.

use std::any::Any;
use std::collections::HashMap;
use std::sync::Arc;

use ash::vk;
use ash::vk::Handle as _;

use super::buffer::Buffer;
use super::descriptors::Descriptors;
use super::device::Gpu;
use super::external::CommandBuffer;
#[cfg(feature = "cli")]
use super::external::TargetImage;
use super::image::{Image, whole};
use super::instance::c_name;
use super::pipeline::Pipeline;
use super::steps::{Attachment, Groups, Step, Used, Work};
use super::sync::{Barrier, Key, Tracker, Use};
use super::timers::Timers;
use crate::error::Result;

/// The resources of a recording, kept alive until its submission has ended.
pub(crate) type Keep = Vec<Arc<dyn Any + Send + Sync>>;

/// The passes with the same number of several lists of steps.
struct Round<'a> {
    /// Steps before them that are no passes.
    before: Vec<&'a Step>,
    /// Passes with the number of their list, in groups of which none waits for another of its group.
    passes: Vec<Vec<(usize, &'a Step)>>,
}

impl Round<'_> {
    /// Returns the name of the pass of a list, else of the first.
    fn name(&self, list: usize) -> Option<String> {
        let mut passes = self.passes.iter().flatten();
        let first = passes.clone().next();
        passes.find(|(of, _)| *of == list).or(first).map(|(_, step)| step.name.clone())
    }
}

/// A list of steps, those that are left, and where each resource is used and written last.
struct Rest<'a> {
    steps: &'a [Step],
    next: usize,
    last: HashMap<Key, [Option<usize>; 2]>,
}

impl<'a> Rest<'a> {
    fn new(steps: &'a [Step], asked: bool) -> Self {
        let mut last: HashMap<Key, [Option<usize>; 2]> = HashMap::new();
        for (i, step) in steps.iter().enumerate().filter(|_| asked) {
            for (used, usage) in &step.uses {
                let places = last.entry(used.key()).or_default();
                places[0] = Some(i);
                places[1] = if usage.writes() { Some(i) } else { places[1] };
            }
        }
        Self { steps, next: 0, last }
    }

    /// Returns the steps up to and including the next pass.
    fn coming(&self) -> &'a [Step] {
        let left = &self.steps[self.next..];
        &left[..left.iter().position(Step::is_pass).map_or(left.len(), |pass| pass + 1)]
    }

    /// Returns whether a step must wait for one of those that are left: it writes what that uses, or uses what that writes.
    fn delays(&self, step: &Step) -> bool {
        step.uses.iter().any(|(used, usage)| {
            let places = self.last.get(&used.key());
            places.and_then(|[any, write]| if usage.writes() { *any } else { *write }) >= Some(self.next)
        })
    }
}

/// Puts the passes of several lists of steps beside each other. What a list shares with one before it is used in that order; steps that are
/// no passes are of what no other list uses.
fn rounds_of(lists: &[Vec<Step>]) -> Vec<Round<'_>> {
    // Nobody asks the last one.
    let asked = |(i, steps)| Rest::new(steps, i + 1 < lists.len());
    let mut rests: Vec<Rest<'_>> = lists.iter().map(Vec::as_slice).enumerate().map(asked).collect();
    let mut rounds = Vec::new();
    while rests.iter().any(|rest| rest.next < rest.steps.len()) {
        let mut round = Round { before: Vec::new(), passes: Vec::new() };
        for i in 0..rests.len() {
            let (earlier, rest) = rests.split_at_mut(i);
            let Some(rest) = rest.first_mut() else { continue };
            let coming = rest.coming();
            if coming.iter().any(|step| earlier.iter().any(|earlier| earlier.delays(step))) {
                continue;
            }
            rest.next += coming.len();
            let (before, pass) = coming.split_at(coming.partition_point(|step| !step.is_pass()));
            round.before.extend(before);
            let Some(pass) = pass.first() else { continue };
            match round.passes.last_mut() {
                Some(group) if !group.iter().any(|(_, other)| pass.meets(other)) => group.push((i, pass)),
                _ => round.passes.push(vec![(i, pass)]),
            }
        }
        rounds.push(round);
    }
    rounds
}

/// Collects steps, and records them into a command buffer.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    gpu: Gpu,
    /// `None` where steps are only collected.
    commands: Option<&'a CommandBuffer>,
    tracker: Tracker,
    timers: Option<Arc<Timers>>,
    steps: Vec<Step>,
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(gpu: &Gpu, commands: &'a CommandBuffer, timers: Option<Arc<Timers>>) -> Self {
        Self { timers, commands: Some(commands), ..Self::collecting(gpu) }
    }

    /// Collects steps without a command buffer. It reads no handle of their resources.
    pub(crate) fn collecting(gpu: &Gpu) -> Self {
        Self {
            gpu: gpu.clone(),
            commands: None,
            tracker: Tracker::default(),
            timers: None,
            steps: Vec::new(),
        }
    }

    /// Returns the steps, and records nothing.
    pub(crate) fn into_steps(self) -> Vec<Step> {
        self.steps
    }

    /// Declares the last use of an image by an earlier submission to the same queue.
    pub(crate) fn assume_after(&mut self, image: &Arc<Image>, last: Use) {
        self.inherit(Used::Image(Arc::clone(image)), last);
    }

    /// Declares the last use of a buffer by an earlier submission to the same queue.
    pub(crate) fn assume_buffer_after(&mut self, buffer: &Arc<Buffer>, last: Use) {
        self.inherit(Used::Buffer(Arc::clone(buffer)), last);
    }

    fn inherit(&mut self, used: Used, last: Use) {
        let name = used.name().to_string();
        self.step(&name, Work::Inherit(used, last));
    }

    /// Returns whether the steps are recorded for a submission, not only collected.
    pub(crate) fn records(&self) -> bool {
        self.commands.is_some()
    }

    fn step(&mut self, name: &str, work: Work) {
        self.steps.push(Step::new(name, work));
    }

    /// Adds one dispatch.
    pub(crate) fn dispatch(
        &mut self,
        name: &str,
        pipeline: &Arc<Pipeline>,
        descriptors: &Arc<Descriptors>,
        push: &[u8],
        groups: impl Into<Groups>,
    ) {
        let (pipeline, descriptors) = (Arc::clone(pipeline), Arc::clone(descriptors));
        let groups = groups.into();
        self.step(name, Work::Dispatch { pipeline, descriptors, push: push.to_vec(), groups });
    }

    /// Adds one draw into the whole of one colour attachment. `clear` clears it to transparent black first.
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
        let (pipeline, descriptors) = (Arc::clone(pipeline), Arc::clone(descriptors));
        let (pushes, extent) = (vec![push.to_vec()], target.extent());
        let target = Some((target.clone(), clear));
        self.step(name, Work::Draw { pipeline, descriptors, pushes, target, extent, vertices, instances });
    }

    /// Adds several draws without attachments as one pass: shaders write bound resources, and each draw sees the writes of the one
    /// before. `pushes` are the push constants of each draw.
    pub(crate) fn draw_each(
        &mut self,
        name: &str,
        pipeline: &Arc<Pipeline>,
        descriptors: &Arc<Descriptors>,
        pushes: Vec<Vec<u8>>,
        extent: [u32; 2],
        vertices: u32,
    ) {
        let (pipeline, descriptors) = (Arc::clone(pipeline), Arc::clone(descriptors));
        let (target, instances) = (None, 1);
        self.step(name, Work::Draw { pipeline, descriptors, pushes, target, extent, vertices, instances });
    }

    /// Adds a copy of a whole image to the start of a buffer that the host reads.
    pub(crate) fn copy_image_to_buffer(&mut self, name: &str, image: &Arc<Image>, buffer: &Arc<Buffer>) {
        let work = Work::CopyImageToBuffer { image: Arc::clone(image), buffer: Arc::clone(buffer) };
        self.step(name, work);
        self.release_to_host(buffer);
    }

    /// Adds a fill of a buffer with zeros.
    pub(crate) fn clear_buffer(&mut self, name: &str, buffer: &Arc<Buffer>) {
        self.clear_start(name, buffer, vk::WHOLE_SIZE);
    }

    /// Adds a fill of the first bytes of a buffer, a multiple of four, with zeros.
    pub(crate) fn clear_start(&mut self, name: &str, buffer: &Arc<Buffer>, bytes: u64) {
        self.step(name, Work::ClearBuffer(Arc::clone(buffer), bytes));
    }

    /// Adds a fill of an image with one colour.
    pub(crate) fn clear_image(&mut self, name: &str, image: &Arc<Image>, colour: [f32; 4]) {
        self.step(name, Work::ClearImage(Arc::clone(image), colour));
    }

    /// Adds a copy of the start of a buffer to a part of a mip level of an image: to `count` planes of a volume, or layers of an array,
    /// from `first` on.
    pub(crate) fn copy_buffer_to_image(
        &mut self,
        name: &str,
        buffer: &Arc<Buffer>,
        image: &Arc<Image>,
        level: u32,
        [first, count]: [u32; 2],
    ) {
        let (buffer, image) = (Arc::clone(buffer), Arc::clone(image));
        self.step(name, Work::CopyBufferToImage { buffer, image, level, planes: [first, count] });
    }

    /// Adds a copy of the first `bytes` of one buffer to the start of another.
    pub(crate) fn copy_buffer(&mut self, name: &str, from: &Arc<Buffer>, to: &Arc<Buffer>, bytes: u64) {
        self.copy_parts(name, from, to, vec![[0, 0, bytes]]);
    }

    /// Adds a copy of parts of a buffer to another: each from an offset to an offset, so many bytes.
    pub(crate) fn copy_parts(
        &mut self,
        name: &str,
        from: &Arc<Buffer>,
        to: &Arc<Buffer>,
        parts: Vec<[u64; 3]>,
    ) {
        self.step(name, Work::CopyBuffer { from: Arc::clone(from), to: Arc::clone(to), parts });
    }

    /// Adds a copy of parts of a buffer, from offsets on, to cubes of an image: of a volume, or of as many layers of an array.
    pub(crate) fn copy_buffer_to_cubes(
        &mut self,
        name: &str,
        buffer: &Arc<Buffer>,
        image: &Arc<Image>,
        side: u32,
        cubes: Vec<(u64, [u32; 3])>,
    ) {
        let (buffer, image) = (Arc::clone(buffer), Arc::clone(image));
        self.step(name, Work::CopyBufferToCubes { buffer, image, side, cubes });
    }

    /// Makes a resource ready for a use, also by later recordings.
    fn leave_used(&mut self, used: Used, next: Use) {
        let mut step = Step::new("leave", Work::Leave);
        step.uses.push((used, next));
        self.steps.push(step);
    }

    /// Makes an image ready for a use, also by later recordings.
    pub(crate) fn leave(&mut self, image: &Arc<Image>, next: Use) {
        self.leave_used(Used::Image(Arc::clone(image)), next);
    }

    /// Declares that a swapchain has handed an image over.
    #[cfg(feature = "cli")]
    pub(crate) fn assume_acquired(&mut self, target: &TargetImage) {
        self.inherit(Used::Target(*target), Use::Acquired);
    }

    /// Makes an image of a swapchain ready to be shown.
    #[cfg(feature = "cli")]
    pub(crate) fn leave_presented(&mut self, target: &TargetImage) {
        self.leave_used(Used::Target(*target), Use::Presented);
    }

    /// Makes writes to an image visible to every later shader, also of later recordings.
    pub(crate) fn release_image(&mut self, image: &Arc<Image>) {
        self.leave(image, Use::AnyShaderRead);
    }

    /// Makes writes to a buffer visible to every later shader, also of later recordings.
    pub(crate) fn release_buffer(&mut self, buffer: &Arc<Buffer>) {
        self.leave_used(Used::Buffer(Arc::clone(buffer)), Use::AnyShaderRead);
    }

    /// Makes writes to a download buffer visible to the host.
    pub(crate) fn release_to_host(&mut self, buffer: &Arc<Buffer>) {
        self.leave_used(Used::Buffer(Arc::clone(buffer)), Use::HostRead);
    }

    /// Builds the pipelines of the steps, and records the steps into the command buffer. Returns the names of the passes, and the
    /// resources to keep until the submission has ended. After an error nothing was recorded.
    pub(crate) fn finish(mut self) -> Result<(Vec<String>, Keep)> {
        let steps = std::mem::take(&mut self.steps);
        self.finish_together(vec![steps], 0)
    }

    /// Records as [`Recorder::finish`] the steps of several recordings, pass beside pass: of those with the same number none waits for
    /// another, and they have one timestamp. It has the name of the pass of list `named`, where that has one.
    pub(crate) fn finish_together(
        mut self,
        lists: Vec<Vec<Step>>,
        named: usize,
    ) -> Result<(Vec<String>, Keep)> {
        let rounds = rounds_of(&lists);
        let mut passes: Vec<String> = rounds.iter().filter_map(|round| round.name(named)).collect();
        let Some(commands) = self.commands else { return Ok((passes, Keep::new())) };
        let gpu = self.gpu.clone();
        gpu.build(lists.iter().flatten().filter_map(|step| step.work.pipeline()))?;
        let _held = gpu.lock_layer();
        if let Some(timers) = &self.timers {
            // SAFETY: the command buffer is recording, outside of rendering; the last submission that used the
            // pool has ended.
            unsafe {
                gpu.device().cmd_reset_query_pool(commands.raw(), timers.pool, 0, timers.passes + 1);
            }
        }
        // Recordings that wait for each other may have more rounds than timers: the last one then takes the rest.
        let most = self.timers.as_ref().map_or(u32::MAX, |timers| timers.passes);
        passes.truncate(crate::num::index(most));
        let mut number = 0;
        for round in &rounds {
            for step in &round.before {
                self.barriers(commands, &[step]);
            }
            for (i, group) in round.passes.iter().enumerate() {
                let group: Vec<&Step> = group.iter().map(|(_, step)| *step).collect();
                self.barriers(commands, &group);
                if i == 0 && number < most {
                    self.stamp(commands.raw(), number);
                    number += 1;
                }
                for step in group {
                    self.issue_pass(commands, step);
                }
            }
        }
        self.stamp(commands.raw(), number);
        drop(rounds);
        let mut keep: Keep = vec![Arc::new(lists)];
        keep.extend(self.timers.map(|timers| timers as _));
        Ok((passes, keep))
    }

    /// Records one pass between labels.
    fn issue_pass(&mut self, commands: &CommandBuffer, step: &Step) {
        let raw = commands.raw();
        if let Some(debug) = &self.gpu.inner.debug {
            let name = c_name(&step.name);
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: recording; the extension is enabled.
            unsafe { debug.cmd_begin_debug_utils_label(raw, &label) };
        }
        let gpu = self.gpu.clone();
        gpu.issue(raw, &step.work, || self.barriers(commands, &[step]));
        if let Some(debug) = &self.gpu.inner.debug {
            // SAFETY: a label was begun in this command buffer above.
            unsafe { debug.cmd_end_debug_utils_label(raw) };
        }
        commands.next_part();
    }

    /// Records the barriers before the uses of steps, in one command.
    fn barriers(&mut self, commands: &CommandBuffer, steps: &[&Step]) {
        for step in steps {
            if let Work::Inherit(used, last) = &step.work {
                self.tracker.begin_after(used.key(), *last);
            }
        }
        let (mut of_memory, mut of_images, mut poisoned) = (Vec::new(), Vec::new(), Vec::new());
        for (used, usage) in steps.iter().flat_map(|step| &step.uses) {
            let key = used.key();
            match used {
                // An image that this recording has not written was made ready before; its contents are kept.
                Used::Image(_) if usage.samples() => {
                    self.tracker.begin(key, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
                }
                // The caller has made the image ready; a second pass must wait for the first.
                Used::Target(_) => self.tracker.begin(key, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL),
                _ => {}
            }
            let Some(barrier) = self.tracker.next(key, *usage) else { continue };
            let discarded = barrier.around_clear().filter(|_| self.gpu.inner.poison);
            match used {
                Used::Image(image) if discarded.is_some() && image.is_storage() => {
                    poisoned.extend(discarded.map(|around| (Arc::clone(image), around)));
                }
                // Drivers order all memory alike, so equal barriers are one.
                Used::Buffer(_) if of_memory.contains(&barrier) => {}
                Used::Buffer(_) => of_memory.push(barrier),
                Used::Image(_) | Used::Target(_) => {
                    of_images.push(image_barrier(vk::Image::from_raw(key.1), &barrier));
                }
            }
        }
        for (image, around) in poisoned {
            self.poison(commands, &image, &around);
        }
        if of_memory.is_empty() && of_images.is_empty() {
            return;
        }
        let of_memory: Vec<_> = of_memory.iter().map(memory_barrier).collect();
        let info =
            vk::DependencyInfo::default().memory_barriers(&of_memory).image_memory_barriers(&of_images);
        // SAFETY: recording, outside of rendering; handles in `info` are alive; synchronization2 is on.
        unsafe { self.gpu.device().cmd_pipeline_barrier2(commands.raw(), &info) };
    }

    /// Overwrites an image whose contents a barrier discards: drivers may keep them, and hide that a shader relies on them.
    fn poison(&self, commands: &CommandBuffer, image: &Image, [before, after]: &[Barrier; 2]) {
        let value = match image.desc().format {
            vk::Format::R32G32B32A32_UINT => vk::ClearColorValue { uint32: [0xdead_beef; 4] },
            _ => vk::ClearColorValue { float32: [0.77; 4] },
        };
        let device = self.gpu.device();
        let [before, after] = [before, after].map(|barrier| [image_barrier(image.raw, barrier)]);
        let [before, after] =
            [&before, &after].map(|of| vk::DependencyInfo::default().image_memory_barriers(of));
        let (raw, layout) = (commands.raw(), vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        // SAFETY: recording, outside of rendering; handles are alive; synchronization2 is on.
        unsafe { device.cmd_pipeline_barrier2(raw, &before) };
        // SAFETY: recording, outside of rendering; the barrier has brought the image, which has TRANSFER_DST, into this layout.
        unsafe {
            device.cmd_clear_color_image(
                raw,
                image.raw,
                layout,
                &value,
                &[whole(vk::ImageAspectFlags::COLOR)],
            );
        };
        // SAFETY: as for the first barrier.
        unsafe { device.cmd_pipeline_barrier2(raw, &after) };
    }

    /// Writes the timestamp before a pass, or the one after the last. It waits for earlier work, whose time does not count for the pass.
    fn stamp(&self, raw: vk::CommandBuffer, number: u32) {
        let Some(timers) = &self.timers else { return };
        // SAFETY: recording; the query was reset in this command buffer and is written once.
        unsafe {
            self.gpu.device().cmd_write_timestamp2(raw, super::sync::END_OF_ALL, timers.pool, number);
        }
    }
}

fn memory_barrier(barrier: &Barrier) -> vk::MemoryBarrier2<'static> {
    vk::MemoryBarrier2::default()
        .src_stage_mask(barrier.src_stage)
        .src_access_mask(barrier.src_access)
        .dst_stage_mask(barrier.dst_stage)
        .dst_access_mask(barrier.dst_access)
}

fn image_barrier(image: vk::Image, barrier: &Barrier) -> vk::ImageMemoryBarrier2<'static> {
    vk::ImageMemoryBarrier2::default()
        .src_stage_mask(barrier.src_stage)
        .src_access_mask(barrier.src_access)
        .dst_stage_mask(barrier.dst_stage)
        .dst_access_mask(barrier.dst_access)
        .old_layout(barrier.old_layout)
        .new_layout(barrier.new_layout)
        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .image(image)
        .subresource_range(whole(vk::ImageAspectFlags::COLOR))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::BufferUse;
    use crate::gpu::testing::TestGpu;

    /// Passes of several lists lie beside each other, in the order of the lists where they share what one of them writes.
    #[test]
    fn passes_that_share_a_resource_keep_the_order_of_their_lists() {
        let gpu = TestGpu::new();
        let buffers = ["a", "b", "c", "d", "shared"].map(|name| {
            let buffer = Buffer::new(&gpu, name, 64, BufferUse::ShaderWrite).unwrap();
            (name, Arc::new(buffer))
        });
        let list = |names: &[&str]| {
            let mut recorder = Recorder::collecting(&gpu);
            for name in names {
                let (_, buffer) = buffers.iter().find(|(known, _)| known == name).unwrap();
                recorder.clear_buffer(name, buffer);
            }
            recorder.into_steps()
        };
        let groups = |lists: &[Vec<Step>]| -> Vec<Vec<String>> {
            let rounds = rounds_of(lists);
            let groups = rounds.iter().flat_map(|round| &round.passes);
            groups.map(|group| group.iter().map(|(_, step)| step.name.clone()).collect()).collect()
        };
        let apart = [list(&["a", "b"]), list(&["c"])];
        assert_eq!(groups(&apart), [vec!["a", "c"], vec!["b"]]);
        let in_one_round = [list(&["a", "shared"]), list(&["b", "shared"]), list(&["c", "d"])];
        assert_eq!(groups(&in_one_round), [vec!["a", "b", "c"], vec!["shared"], vec!["shared", "d"]]);
        let one_waits = [list(&["a", "b", "shared"]), list(&["shared", "c"])];
        assert_eq!(groups(&one_waits), [vec!["a"], vec!["b"], vec!["shared"], vec!["shared"], vec!["c"]]);
        // Readers do not wait for each other.
        let read = |name: &str, to: usize| {
            let mut recorder = Recorder::collecting(&gpu);
            recorder.copy_buffer(name, &buffers[4].1, &buffers[to].1, 64);
            recorder.into_steps()
        };
        assert_eq!(groups(&[read("first", 0), read("second", 1)]), [["first", "second"]]);
    }
}
