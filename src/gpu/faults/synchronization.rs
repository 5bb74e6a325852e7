//! Faults of ordering: barriers that are missing, of the wrong stage, or between the wrong things.

use ash::vk;
use vk::PipelineStageFlags2 as Stage;

use super::fault::{Failure, Fault, Outcome};
use super::ground::{BYTES, FORMAT, Ground, Picture, SIDE, all_of, rows};
use crate::gpu::pipeline::Pipeline;
use crate::gpu::shader::{
    COMPOSITE_VERTEX, FAULTS_COLOUR, FAULTS_COPY, FAULTS_KBUFFER, FAULTS_SAMPLE, FAULTS_STORE,
};

const READ_AFTER_WRITE: &[&str] = &["SYNC-HAZARD-READ-AFTER-WRITE", "SYNC-HAZARD-READ_AFTER_WRITE"];
const WRITE_AFTER_WRITE: &[&str] = &["SYNC-HAZARD-WRITE-AFTER-WRITE", "SYNC-HAZARD-WRITE_AFTER_WRITE"];
const WRITE_AFTER_READ: &[&str] = &["SYNC-HAZARD-WRITE-AFTER-READ", "SYNC-HAZARD-WRITE_AFTER_READ"];

pub(super) const FAULTS: [Fault; 10] = [
    Fault::new(
        "image-written-then-sampled",
        "a pass samples a storage image that the pass before wrote, without a barrier",
        READ_AFTER_WRITE,
        |ground| {
            let (_, commands) = ground.commands()?;
            let picture = stored(ground, commands)?;
            let store = Use::of_image(ground, &picture)?;
            store.dispatch(ground, commands);
            sample(ground, commands, &picture, vk::ImageLayout::GENERAL)?;
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "buffer-cleared-twice",
        "two clears of one list follow each other without a barrier",
        WRITE_AFTER_WRITE,
        |ground| {
            let (_, commands) = ground.commands()?;
            let buffer = ground.buffer(BYTES)?;
            ground.fill(commands, buffer);
            ground.fill(commands, buffer);
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "upload-then-read",
        "a shader reads a buffer that a transfer has just filled, without a barrier",
        READ_AFTER_WRITE,
        |ground| {
            let (_, commands) = ground.commands()?;
            let copy = Use::of_buffers(ground)?;
            ground.fill(commands, copy.read);
            copy.dispatch(ground, commands);
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "read-then-overwritten",
        "a transfer overwrites a list that the pass before still reads",
        WRITE_AFTER_READ,
        |ground| {
            let (_, commands) = ground.commands()?;
            let copy = Use::of_buffers(ground)?;
            copy.dispatch(ground, commands);
            ground.fill(commands, copy.read);
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "barrier-of-another-stage",
        "a barrier waits for compute shaders, but a transfer wrote",
        READ_AFTER_WRITE,
        |ground| {
            let (_, commands) = ground.commands()?;
            let copy = Use::of_buffers(ground)?;
            ground.fill(commands, copy.read);
            let barriers = [vk::MemoryBarrier2::default()
                .src_stage_mask(Stage::COMPUTE_SHADER)
                .src_access_mask(vk::AccessFlags2::SHADER_WRITE)
                .dst_stage_mask(Stage::COMPUTE_SHADER)
                .dst_access_mask(vk::AccessFlags2::SHADER_READ)];
            let info = vk::DependencyInfo::default().memory_barriers(&barriers);
            // SAFETY: recording; the barrier is valid.
            unsafe { ground.device.cmd_pipeline_barrier2(commands, &info) };
            copy.dispatch(ground, commands);
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "transition-beside-writes",
        "an image changes its layout while the pass before may still write it",
        WRITE_AFTER_WRITE,
        |ground| {
            let (_, commands) = ground.commands()?;
            let picture = stored(ground, commands)?;
            Use::of_image(ground, &picture)?.dispatch(ground, commands);
            let layouts = [vk::ImageLayout::GENERAL, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL];
            ground.barrier(commands, picture.image, layouts, [Stage::NONE, Stage::COMPUTE_SHADER]);
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "rendering-then-copied",
        "an image is copied to the host right after it was rendered, without a barrier",
        READ_AFTER_WRITE,
        |ground| {
            let (_, commands) = ground.commands()?;
            let picture = ground.picture(FORMAT, attachment())?;
            ground.transition(
                commands,
                picture.image,
                [vk::ImageLayout::UNDEFINED, vk::ImageLayout::GENERAL],
            );
            ground.begin_rendering(commands, Some(picture.view), SIDE);
            let buffer = ground.buffer(u64::from(SIDE * SIDE) * 16)?;
            // SAFETY: rendering has begun.
            unsafe { ground.device.cmd_end_rendering(commands) };
            let region = rows(SIDE);
            let layout = vk::ImageLayout::GENERAL;
            // SAFETY: recording; the buffer has the size of the image.
            unsafe {
                ground.device.cmd_copy_image_to_buffer(commands, picture.image, layout, buffer, &[region])
            };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "frames-without-order",
        "two submissions write one buffer, with nothing that orders them",
        WRITE_AFTER_WRITE,
        |ground| {
            let buffer = ground.buffer(BYTES)?;
            for _ in 0..2 {
                let (_, commands) = ground.commands()?;
                ground.fill(commands, buffer);
                ground.run(commands)?;
            }
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "semaphore-wait-too-late",
        "a submission waits for the one before at a later stage than the one that uses its result",
        WRITE_AFTER_WRITE,
        |ground| {
            let buffer = ground.buffer(BYTES)?;
            // SAFETY: the device is alive.
            let semaphore =
                unsafe { ground.device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }?;
            let at = |stage| [vk::SemaphoreSubmitInfo::default().semaphore(semaphore).stage_mask(stage)];
            let (signals, waits) = (at(Stage::ALL_COMMANDS), at(Stage::COMPUTE_SHADER));
            for first in [true, false] {
                let (_, commands) = ground.commands()?;
                ground.fill(commands, buffer);
                ground.end(commands)?;
                let infos = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
                let submit = vk::SubmitInfo2::default().command_buffer_infos(&infos);
                let submit = if first {
                    submit.signal_semaphore_infos(&signals)
                } else {
                    submit.wait_semaphore_infos(&waits)
                };
                ground.submit(submit, vk::Fence::null())?;
            }
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "k-buffer-without-interlock",
        "fragments of a pixel update a storage image at the same time",
        &[],
        |ground| {
            let (_, commands) = ground.commands()?;
            let picture = stored(ground, commands)?;
            let pipeline = ground.graphics(&COMPOSITE_VERTEX, &FAULTS_KBUFFER, Some(FORMAT))?;
            let set = ground.set(&pipeline)?;
            let layout = vk::ImageLayout::GENERAL;
            ground.write_image(&pipeline, set, picture.view, layout)?;
            let target = ground.picture(FORMAT, attachment())?;
            ground.transition(commands, target.image, [vk::ImageLayout::UNDEFINED, layout]);
            ground.begin_rendering(commands, Some(target.view), SIDE);
            ground.bind(commands, &pipeline, Some(set));
            ground.viewport(commands);
            // SAFETY: rendering has begun; everything that the draw needs is bound. The two triangles update the same pixels.
            unsafe { ground.device.cmd_draw(commands, 3, 2, 0, 0) };
            // SAFETY: rendering has begun.
            unsafe { ground.device.cmd_end_rendering(commands) };
            ground.run(commands)?;
            Ok(ground.wait()?)
        },
    )
    .breaking("Memory Model, \"Data Race\"; fragment shader interlock orders such updates"),
];

/// Returns the usage of images that are rendered and copied.
pub(super) fn attachment() -> vk::ImageUsageFlags {
    vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC
}

/// Makes an image for stores and samples, in the layout `GENERAL` for the commands that follow.
pub(super) fn stored(ground: &Ground<'_>, commands: vk::CommandBuffer) -> Result<Picture, vk::Result> {
    let usage = vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::SAMPLED;
    let picture = ground.picture(FORMAT, usage)?;
    ground.transition(commands, picture.image, [vk::ImageLayout::UNDEFINED, vk::ImageLayout::GENERAL]);
    Ok(picture)
}

/// Records a dispatch that samples an image.
pub(super) fn sample(
    ground: &Ground<'_>,
    commands: vk::CommandBuffer,
    picture: &Picture,
    layout: vk::ImageLayout,
) -> Outcome {
    let pipeline = ground.compute(&FAULTS_SAMPLE)?;
    let set = ground.set(&pipeline)?;
    ground.write_image(&pipeline, set, picture.view, layout)?;
    ground.write_buffer(&pipeline, set, 0, all_of(ground.buffer(BYTES)?));
    ground.dispatch(commands, &pipeline, set);
    Ok(())
}

/// A pipeline with its set and the resource that it uses.
pub(super) struct Use {
    pub(super) pipeline: std::sync::Arc<Pipeline>,
    pub(super) set: vk::DescriptorSet,
    /// The buffer that it reads, or null.
    pub(super) read: vk::Buffer,
}

impl Use {
    /// Stores into an image.
    pub(super) fn of_image(ground: &Ground<'_>, picture: &Picture) -> Result<Self, Failure> {
        let pipeline = ground.compute(&FAULTS_STORE)?;
        let set = ground.set(&pipeline)?;
        let layout = vk::ImageLayout::GENERAL;
        ground.write_image(&pipeline, set, picture.view, layout)?;
        Ok(Self { pipeline, set, read: vk::Buffer::null() })
    }

    /// Copies from one buffer to another.
    pub(super) fn of_buffers(ground: &Ground<'_>) -> Result<Self, Failure> {
        let pipeline = ground.compute(&FAULTS_COPY)?;
        let set = ground.set(&pipeline)?;
        let read = ground.buffer(BYTES)?;
        ground.write_buffer(&pipeline, set, 1, all_of(read));
        ground.write_buffer(&pipeline, set, 0, all_of(ground.buffer(BYTES)?));
        Ok(Self { pipeline, set, read })
    }

    /// Records its dispatch.
    pub(super) fn dispatch(&self, ground: &Ground<'_>, commands: vk::CommandBuffer) {
        ground.dispatch(commands, &self.pipeline, self.set);
    }
}

/// Draws into an attachment; `between` records what comes before the draw.
pub(super) fn draw(ground: &Ground<'_>, between: impl FnOnce(vk::CommandBuffer)) -> Outcome {
    let (_, commands) = ground.commands()?;
    let target = ground.picture(FORMAT, attachment())?;
    ground.transition(commands, target.image, [vk::ImageLayout::UNDEFINED, vk::ImageLayout::GENERAL]);
    let pipeline = ground.graphics(&COMPOSITE_VERTEX, &FAULTS_COLOUR, Some(FORMAT))?;
    ground.begin_rendering(commands, Some(target.view), SIDE);
    ground.bind(commands, &pipeline, None);
    between(commands);
    // SAFETY: rendering has begun; what the draw lacks is the fault.
    unsafe { ground.device.cmd_draw(commands, 3, 1, 0, 0) };
    // SAFETY: rendering has begun.
    unsafe { ground.device.cmd_end_rendering(commands) };
    Ok(ground.end(commands)?)
}
