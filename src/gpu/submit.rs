//! Command buffers of the crate: recording, submission, and waits with a time limit.

use std::sync::atomic::Ordering;

use ash::vk;
use serde::Serialize;

use super::device::Gpu;
use super::external::CommandBuffer;
use super::feature::OptionalFeature;
use super::image::Image;
use super::recorder::{Keep, Recorder};
use crate::error::{Error, Result};

/// Time limit of a wait for one submission, in seconds. A software rasteriser may need minutes for a large frame. Dropping
/// [`Commands`] waits without a limit.
const TIMEOUT_SECONDS: u64 = 600;

/// The time that one pass took on the device.
#[derive(Clone, Debug, Serialize)]
pub struct PassTime {
    /// Name of the pass.
    pub name: String,
    /// Milliseconds from its beginning to that of the next pass, or to the end of the frame.
    pub ms: f64,
}

/// A command buffer with its pool and fence, reused for every submission.
#[derive(Debug)]
pub(crate) struct Commands {
    gpu: Gpu,
    pool: vk::CommandPool,
    buffer: CommandBuffer,
    fence: vk::Fence,
    /// Resources of the pending submission.
    held: Keep,
    pending: bool,
}

impl Commands {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self> {
        gpu.alive()?;
        let pool = gpu.create_command_pool(vk::CommandPoolCreateFlags::TRANSIENT)?;
        let mut commands = Self {
            gpu: gpu.clone(),
            pool,
            buffer: CommandBuffer::own(gpu, vk::CommandBuffer::null()),
            fence: vk::Fence::null(),
            held: Keep::new(),
            pending: false,
        };
        let _held = gpu.lock_layer();
        gpu.name(pool, "command pool");
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool was just made from this device.
        let buffers = unsafe { gpu.device().allocate_command_buffers(&info) }
            .map_err(|result| gpu.failed("vkAllocateCommandBuffers", result))?;
        let first = buffers.first().copied().unwrap_or_default();
        commands.buffer = if gpu.inner.part_by_pass {
            CommandBuffer::in_parts(gpu, first, pool)
        } else {
            CommandBuffer::own(gpu, first)
        };
        // SAFETY: the device is alive.
        commands.fence =
            unsafe { gpu.device().create_fence(&vk::FenceCreateInfo::default(), gpu.host_callbacks()) }
                .map_err(|result| gpu.failed("vkCreateFence", result))?;
        gpu.name(commands.fence, "fence");
        Ok(commands)
    }

    /// Waits for the pending submission, if there is one.
    pub(crate) fn settle(&mut self) -> Result<()> {
        if self.pending { self.wait("an earlier submission") } else { Ok(()) }
    }

    /// Begins recording anew.
    pub(crate) fn begin(&mut self) -> Result<&mut CommandBuffer> {
        self.gpu.alive()?;
        self.settle()?;
        let _held = self.gpu.lock_layer();
        self.buffer.rewind();
        // SAFETY: nothing recorded from this pool is pending.
        unsafe { self.gpu.device().reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty()) }
            .map_err(|result| self.gpu.failed("vkResetCommandPool", result))?;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer is in the initial state.
        unsafe { self.gpu.device().begin_command_buffer(self.buffer.raw(), &info) }
            .map_err(|result| self.gpu.failed("vkBeginCommandBuffer", result))?;
        Ok(&mut self.buffer)
    }

    /// Records the steps that `record` adds, submits and waits. An error of a time-out names `last_pass`.
    pub(crate) fn run(&mut self, last_pass: &str, record: impl FnOnce(&mut Recorder<'_>)) -> Result<()> {
        let gpu = self.gpu.clone();
        let mut recorder = Recorder::new(&gpu, self.begin()?, None);
        record(&mut recorder);
        let (_, keep) = recorder.finish()?;
        self.submit(keep, last_pass)
    }

    /// Ends recording, submits and waits. `keep` has the resources of the recording, which are freed when the submission
    /// has ended. An error of a time-out names `last_pass`.
    pub(crate) fn submit(&mut self, keep: Keep, last_pass: &str) -> Result<()> {
        self.send(keep)?;
        self.wait(last_pass)
    }

    /// Ends recording and submits without waiting. `keep` is held until [`Commands::settle`] has waited.
    pub(crate) fn send(&mut self, keep: Keep) -> Result<()> {
        self.send_marked(keep, None)
    }

    /// Does as [`Commands::send`] with the last submission of a frame. Where the device takes marks, it says that the frame ends here,
    /// and that `image` shows it.
    pub(crate) fn send_frame(&mut self, keep: Keep, image: Option<&Image>) -> Result<()> {
        if !self.gpu.has(OptionalFeature::FrameBoundary) {
            return self.send(keep);
        }
        let images: Vec<_> = image.iter().map(|image| image.raw).collect();
        let end = vk::FrameBoundaryEXT::default()
            .flags(vk::FrameBoundaryFlagsEXT::FRAME_END)
            .frame_id(self.gpu.inner.frames.fetch_add(1, Ordering::Relaxed))
            .images(&images);
        self.send_marked(keep, Some(end))
    }

    fn send_marked(&mut self, keep: Keep, mut mark: Option<vk::FrameBoundaryEXT<'_>>) -> Result<()> {
        let device = self.gpu.device();
        // SAFETY: recording was begun and every rendering ended.
        unsafe { device.end_command_buffer(self.buffer.raw()) }
            .map_err(|result| self.gpu.failed("vkEndCommandBuffer", result))?;
        let info = |raw| vk::CommandBufferSubmitInfo::default().command_buffer(raw);
        let buffers: Vec<_> = self.buffer.all().into_iter().map(info).collect();
        let mut submit = vk::SubmitInfo2::default().command_buffer_infos(&buffers);
        if let Some(mark) = &mut mark {
            submit = submit.push_next(mark);
        }
        let submits = [submit];
        let submitted = self.gpu.with_queue(|queue| {
            // SAFETY: the queue is locked; the fence is unsignalled and unused; `keep` holds the recorded
            // resources, and this object holds `keep` until the fence has signalled.
            unsafe { device.queue_submit2(queue, &submits, self.fence) }
        });
        if let Err(result) = submitted {
            if result == vk::Result::ERROR_DEVICE_LOST {
                // The specification counts the work as submitted until a wait has returned, with whatever result.
                // SAFETY: the queue is held.
                let _ = self.gpu.with_queue(|queue| unsafe { device.queue_wait_idle(queue) });
            }
            return Err(self.gpu.failed("vkQueueSubmit2", result));
        }
        self.held = keep;
        self.pending = true;
        Ok(())
    }

    /// Waits for the pending submission, then frees its resources. An error of a time-out names `last_pass`.
    pub(crate) fn wait(&mut self, last_pass: &str) -> Result<()> {
        let device = self.gpu.device();
        // SAFETY: the fence was submitted: `pending` is set.
        let waited = unsafe { device.wait_for_fences(&[self.fence], true, TIMEOUT_SECONDS * 1_000_000_000) };
        let ended = match waited {
            // SAFETY: the fence is signalled and not in use.
            Ok(()) => unsafe { device.reset_fences(&[self.fence]) }
                .map_err(|result| self.gpu.failed("vkResetFences", result)),
            Err(vk::Result::TIMEOUT) => {
                let (what, last_pass) = ("a submission".to_string(), last_pass.to_string());
                Err(Error::Timeout { what, seconds: TIMEOUT_SECONDS, last_pass })
            }
            Err(result) => Err(self.gpu.failed("vkWaitForFences", result)),
        };
        // Work on a lost device counts as ended once a wait has returned.
        if matches!(waited, Err(vk::Result::ERROR_DEVICE_LOST)) || ended.is_ok() {
            self.pending = false;
            self.held.clear();
        }
        ended
    }

    /// Waits for the pending submission without a limit; returns whether it has ended.
    fn outlast(&self) -> bool {
        // A wait may fail for lack of host memory, and succeed the next time.
        (0..4).any(|_| {
            // SAFETY: the fence was submitted: `pending` is set.
            let waited = unsafe { self.gpu.device().wait_for_fences(&[self.fence], true, u64::MAX) };
            matches!(waited, Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST))
        })
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        if self.pending && !self.outlast() {
            // It may still be running: its resources and the device are leaked.
            std::mem::forget((std::mem::take(&mut self.held), self.gpu.clone()));
            return;
        }
        // SAFETY: no pending submission uses the fence; null is allowed.
        unsafe { self.gpu.device().destroy_fence(self.fence, self.gpu.host_callbacks()) };
        // SAFETY: the command buffer is not pending; the pool frees it.
        unsafe { self.gpu.destroy_command_pool(self.pool) };
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::gpu::testing::TestGpu;
    use crate::gpu::{Buffer, BufferUse, Recorder};

    /// Without the lock of `layer_lock`, version 1.3.239 of the layer crashes within seconds. The layer frees nothing of what it
    /// keeps about a pool, so a longer test repeats this one in a new process.
    #[test]
    #[ignore = "a stress test of the validation layer"]
    fn threads_create_and_destroy_command_pools_under_validation() {
        let gpu = TestGpu::new();
        let record = || {
            let buffer = Arc::new(Buffer::new(&gpu, "stress", 64, BufferUse::ShaderWrite).unwrap());
            for _ in 0..20_000 {
                let mut commands = Commands::new(&gpu).unwrap();
                let mut recorder = Recorder::new(&gpu, commands.begin().unwrap(), None);
                recorder.clear_buffer("stress", &buffer);
                drop(recorder.finish().unwrap());
            }
        };
        std::thread::scope(|scope| (0..8).for_each(|_| drop(scope.spawn(record))));
    }
}
