//! Faults of recordings, submissions, rendering and queries.

use ash::vk;

use super::fault::{Failure, Fault};
use super::ground::{BYTES, FORMAT, Ground, SIDE};
use super::synchronization::{Use, attachment, draw};
use crate::gpu::shader::{COMPOSITE_VERTEX, FAULTS_COLOUR};

pub(super) const FAULTS: [Fault; 15] = [
    Fault::new(
        "recording-reused-too-early",
        "a frame's command buffer is recorded again while the device still runs it",
        &["VUID-vkBeginCommandBuffer-commandBuffer-00049"],
        |ground| {
            let (_, commands) = pending(ground)?;
            // SAFETY: the fault is that it is pending.
            unsafe { ground.device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default()) }?;
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "pool-reset-too-early",
        "a frame's command pool is reset while the device still runs its commands",
        &["VUID-vkResetCommandPool-commandPool-00040"],
        |ground| {
            let (pool, _) = pending(ground)?;
            // SAFETY: the fault is that its commands are pending.
            unsafe { ground.device.reset_command_pool(pool, vk::CommandPoolResetFlags::empty()) }?;
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "buffer-destroyed-too-early",
        "a buffer is destroyed while the device still uses it",
        &["VUID-vkDestroyBuffer-buffer-00922"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let buffer = ground.buffer(BYTES)?;
            ground.fill(commands, buffer);
            ground.run(commands)?;
            // SAFETY: the fault is that it is in use; its memory stays.
            unsafe { ground.device.destroy_buffer(buffer, None) };
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "recording-submitted-twice",
        "a command buffer is submitted again before its first submission has ended",
        &[
            "VUID-vkQueueSubmit2-commandBuffer-06192",
            "VUID-vkQueueSubmit2-commandBuffer-03875",
            "VUID-vkQueueSubmit-pCommandBuffers-00071",
            "CoreValidation-DrawState-CommandBufferSingleSubmitViolation",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            ground.fill(commands, ground.buffer(BYTES)?);
            ground.end(commands)?;
            let info = vk::CommandBufferSubmitInfo::default().command_buffer(commands);
            ground
                .submit(vk::SubmitInfo2::default().command_buffer_infos(&[info, info]), vk::Fence::null())?;
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "recording-not-ended",
        "a command buffer is submitted that still records",
        &[
            "VUID-vkQueueSubmit2-commandBuffer-03874",
            "CoreValidation-DrawState-NoEndCommandBuffer",
            "VUID-vkQueueSubmit-pCommandBuffers-00070",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let infos = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
            ground.submit(vk::SubmitInfo2::default().command_buffer_infos(&infos), vk::Fence::null())?;
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "fence-not-reset",
        "a frame is submitted with a fence that is still signalled from the frame before",
        &[
            "VUID-vkQueueSubmit2-fence-04894",
            "VUID-vkQueueSubmit2-fence-04895",
            "VUID-vkQueueSubmit-fence-00063",
        ],
        |ground| {
            let info = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
            // SAFETY: the device is alive.
            let fence = unsafe { ground.device.create_fence(&info, None) }?;
            ground.submit(vk::SubmitInfo2::default(), fence)?;
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "semaphore-never-signalled",
        "a submission waits for a semaphore that nothing signals",
        &["VUID-vkQueueSubmit2-semaphore-03873", "CoreValidation-DrawState-QueueForwardProgress"],
        |ground| {
            // SAFETY: the device is alive.
            let semaphore =
                unsafe { ground.device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }?;
            let waits = [vk::SemaphoreSubmitInfo::default()
                .semaphore(semaphore)
                .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
            ground.submit(vk::SubmitInfo2::default().wait_semaphore_infos(&waits), vk::Fence::null())?;
            Ok(())
        },
    ),
    Fault::new(
        "timeline-without-the-feature",
        "frames are counted by a timeline semaphore on a device opened without timelineSemaphore",
        &["VUID-VkSemaphoreTypeCreateInfo-timelineSemaphore-03252"],
        |ground| {
            let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
            let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
            // SAFETY: the fault is the feature; the semaphore is not used.
            unsafe { ground.device.create_semaphore(&info, None) }?;
            Ok(())
        },
    ),
    Fault::new(
        "dispatch-beyond-limits",
        "a dispatch of one workgroup per cell has more than the device takes",
        &["VUID-vkCmdDispatch-groupCountX-00386"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let copy = Use::of_buffers(ground)?;
            ground.bind(commands, &copy.pipeline, Some(copy.set));
            let most = ground.gpu.limits().max_compute_work_group_count[0];
            // SAFETY: the fault is the count; the recording is not submitted.
            unsafe { ground.device.cmd_dispatch(commands, most.saturating_add(1), 1, 1) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "draw-outside-of-rendering",
        "a draw is recorded before rendering begins",
        &["VUID-vkCmdDraw-renderpass"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let pipeline = ground.graphics(&COMPOSITE_VERTEX, &FAULTS_COLOUR, Some(FORMAT))?;
            ground.bind(commands, &pipeline, None);
            ground.viewport(commands);
            // SAFETY: the fault is the rendering that is missing; the recording is not submitted.
            unsafe { ground.device.cmd_draw(commands, 3, 1, 0, 0) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "dispatch-inside-of-rendering",
        "a compute pass is recorded while rendering goes on",
        &["VUID-vkCmdDispatch-renderpass", "VUID-vkCmdDispatch-None-10672"],
        |ground| {
            let copy = Use::of_buffers(ground)?;
            draw(ground, |commands| {
                ground.viewport(commands);
                copy.dispatch(ground, commands);
            })
        },
    ),
    Fault::new(
        "viewport-not-set",
        "a draw follows without the viewport that its pipeline takes from the recording",
        &["VUID-vkCmdDraw-None-07831", "VUID-vkCmdDraw-commandBuffer-02701", "VUID-vkCmdDraw-None-07850"],
        |ground| draw(ground, |_| ()),
    ),
    Fault::new(
        "attachment-of-another-format",
        "a pipeline draws into an attachment of another format than it was built for",
        &[
            "VUID-vkCmdDraw-colorAttachmentCount-06180",
            "VUID-vkCmdDraw-dynamicRenderingUnusedAttachments-08910",
            "VUID-vkCmdDraw-dynamicRenderingUnusedAttachments-08911",
        ],
        |ground| {
            let pipeline =
                ground.graphics(&COMPOSITE_VERTEX, &FAULTS_COLOUR, Some(vk::Format::R8G8B8A8_UNORM))?;
            draw(ground, |commands| {
                ground.viewport(commands);
                ground.bind(commands, &pipeline, None);
            })
        },
    ),
    Fault::new(
        "render-area-beyond-the-image",
        "after a resize, rendering covers the new size of an image of the old one",
        &["VUID-VkRenderingInfo-pNext-06079", "VUID-VkRenderingInfo-pNext-06080"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let target = ground.picture(FORMAT, attachment())?;
            ground.transition(commands, target.image, [vk::ImageLayout::UNDEFINED, vk::ImageLayout::GENERAL]);
            ground.begin_rendering(commands, Some(target.view), 2 * SIDE);
            // SAFETY: rendering has begun; the recording is not submitted.
            unsafe { ground.device.cmd_end_rendering(commands) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "timestamp-not-reset",
        "a pass is timed by a query that was not reset",
        &[
            "VUID-vkCmdWriteTimestamp2-None-03864",
            "VUID-vkCmdWriteTimestamp2-None-00830",
            "CoreValidation-DrawState-QueryNotReset",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(1);
            // SAFETY: the device is alive.
            let pool = unsafe { ground.device.create_query_pool(&info, None) }?;
            let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
            // SAFETY: the fault is the reset that is missing.
            unsafe { ground.device.cmd_write_timestamp2(commands, stage, pool, 0) };
            ground.run(commands)?;
            Ok(ground.wait()?)
        },
    ),
];

/// Submits a command buffer that fills a buffer; returns it with its pool.
fn pending(ground: &Ground<'_>) -> Result<(vk::CommandPool, vk::CommandBuffer), Failure> {
    let (pool, commands) = ground.commands()?;
    ground.fill(commands, ground.buffer(BYTES)?);
    ground.run(commands)?;
    Ok((pool, commands))
}
