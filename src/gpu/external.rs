//! Command buffers and images of the caller.

use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;
use ash::vk::Handle as _;

use super::device::Gpu;

/// A command buffer that the caller began and will submit.
#[derive(Debug)]
pub struct CommandBuffer {
    raw: vk::CommandBuffer,
    device: vk::Device,
    /// Further command buffers, where each pass has one of its own.
    parts: Option<Parts>,
}

/// Command buffers that are submitted in order.
#[derive(Debug)]
struct Parts {
    gpu: Gpu,
    pool: vk::CommandPool,
    /// The command buffers after the first; the last one is being recorded.
    more: Mutex<Vec<vk::CommandBuffer>>,
}

impl CommandBuffer {
    /// Wraps a command buffer for [`Plan::record`](crate::Plan::record).
    ///
    /// # Safety
    ///
    /// - `raw` belongs to the device of `gpu`, is in the recording state outside of any rendering, and
    ///   will be submitted to the queue family of `gpu`;
    /// - no other thread records into it while this value is in use;
    /// - it is not submitted again while a submission of it is pending;
    /// - [`Recorded::completed`](crate::Recorded::completed) of its recordings is called only after the submission has
    ///   ended, [`Recorded::discarded`](crate::Recorded::discarded) only if no submission is pending or will be made.
    #[must_use]
    pub unsafe fn from_raw(gpu: &Gpu, raw: vk::CommandBuffer) -> Self {
        debug_assert!(!raw.is_null(), "the null command buffer of {}", gpu.report().name);
        Self::own(gpu, raw)
    }

    /// Returns the device that it belongs to.
    pub(crate) fn device(&self) -> vk::Device {
        self.device
    }

    /// Returns the command buffer that is being recorded.
    pub(crate) fn raw(&self) -> vk::CommandBuffer {
        let last = self.parts.as_ref().and_then(|parts| parts.lock().last().copied());
        last.unwrap_or(self.raw)
    }

    pub(super) fn own(gpu: &Gpu, raw: vk::CommandBuffer) -> Self {
        Self { raw, device: gpu.device().handle(), parts: None }
    }

    /// Wraps a command buffer of the crate's own that continues in a new one from `pool` for each pass.
    pub(super) fn in_parts(gpu: &Gpu, raw: vk::CommandBuffer, pool: vk::CommandPool) -> Self {
        let parts = Parts { gpu: gpu.clone(), pool, more: Mutex::default() };
        Self { parts: Some(parts), ..Self::own(gpu, raw) }
    }

    /// Returns all command buffers in the order of submission.
    pub(super) fn all(&self) -> Vec<vk::CommandBuffer> {
        let more = self.parts.iter().flat_map(|parts| parts.lock().clone());
        std::iter::once(self.raw).chain(more).collect()
    }

    /// Continues in a new command buffer where each pass has its own; on an error it continues in the same.
    pub(super) fn next_part(&self) {
        let Some(parts) = &self.parts else { return };
        let device = parts.gpu.device();
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(parts.pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool is this device's and used by this thread alone.
        let Ok(made) = (unsafe { device.allocate_command_buffers(&info) }) else { return };
        let Some(&next) = made.first() else { return };
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: in the initial state.
        let begun = unsafe { device.begin_command_buffer(next, &info) };
        // SAFETY: recording, outside of rendering.
        if begun.is_ok() && unsafe { device.end_command_buffer(self.raw()) }.is_ok() {
            parts.lock().push(next);
        }
    }

    /// Frees all but the first; no submission may be pending.
    pub(super) fn rewind(&self) {
        let Some(parts) = &self.parts else { return };
        let more = std::mem::take(&mut *parts.lock());
        if !more.is_empty() {
            // SAFETY: from this pool, not pending.
            unsafe { parts.gpu.device().free_command_buffers(parts.pool, &more) };
        }
    }
}

impl Parts {
    fn lock(&self) -> MutexGuard<'_, Vec<vk::CommandBuffer>> {
        // Poison is ignored: every change is one statement.
        self.more.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A colour image that the caller owns and the library draws into.
#[derive(Clone, Copy, Debug)]
pub struct TargetImage {
    pub(crate) image: vk::Image,
    pub(crate) view: vk::ImageView,
    pub(crate) format: vk::Format,
    pub(crate) extent: [u32; 2],
    /// First pixel that is drawn.
    pub(crate) corner: [u32; 2],
    pub(crate) device: vk::Device,
}

impl TargetImage {
    /// Wraps an image for [`Plan::record`](crate::Plan::record).
    ///
    /// # Safety
    ///
    /// - `image` and `view` belong to the device of `gpu`; the view is two-dimensional, with one level and
    ///   one layer, in `format` and of at least `extent`, beyond the corner of [`TargetImage::at`]; the image has one sample a texel and
    ///   the usage `COLOR_ATTACHMENT`;
    /// - both live until the caller has seen every submission that draws into them end;
    /// - when the recorded commands run, the image is in the layout `COLOR_ATTACHMENT_OPTIMAL` and all
    ///   earlier accesses are available and visible to the colour attachment output stage. The commands
    ///   leave it in that layout, last written in that stage.
    #[must_use]
    pub unsafe fn from_raw(
        gpu: &Gpu,
        image: vk::Image,
        view: vk::ImageView,
        format: vk::Format,
        extent: [u32; 2],
    ) -> Self {
        debug_assert!(!view.is_null(), "the null view of {}", gpu.report().name);
        Self { image, view, format, extent, corner: [0; 2], device: gpu.device().handle() }
    }

    /// Draws into the rectangle of the image that begins at this pixel, from the left and the top, and leaves the rest. The plan is for
    /// [`TargetDesc::in_part`](crate::TargetDesc::in_part).
    ///
    /// # Safety
    ///
    /// The view is of at least `corner` and the extent together.
    #[must_use]
    pub unsafe fn at(self, corner: [u32; 2]) -> Self {
        Self { corner, ..self }
    }

    /// Wraps an image of the crate like one of a caller. The code that records into it keeps it until the submission has ended.
    pub(crate) fn own(gpu: &Gpu, image: &super::image::Image) -> Self {
        let [width, height, _] = image.desc().extent;
        Self {
            image: image.raw,
            view: image.view,
            format: image.desc().format,
            extent: [width, height],
            corner: [0; 2],
            device: gpu.device().handle(),
        }
    }
}
