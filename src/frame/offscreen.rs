//! An offscreen colour image, as an engine would own one, that plans draw into.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::plan::{Plan, RecordInfo, Recorded, Status};
use crate::gpu::sync::Use;
use crate::gpu::{Buffer, BufferUse, CommandBuffer, Commands, Gpu, Image, ImageDesc, Recorder, TargetImage};

/// A colour image with a command buffer, for plans made for [`TargetDesc::caller`](crate::frame::target::TargetDesc::caller). It submits
/// without waiting, so several of them keep several frames in flight.
#[derive(Debug)]
pub struct Offscreen {
    gpu: Gpu,
    image: Arc<Image>,
    host: Arc<Buffer>,
    recorded: Vec<Recorded>,
    // Last, because dropping it waits for the submission that reads the fields above.
    commands: Commands,
}

impl Offscreen {
    /// Makes the image. `format` is 8-bit RGBA or BGRA (linear or sRGB), 10-bit RGB, 16-bit RGBA or 32-bit float RGBA.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] for a format or an extent that the device lacks, [`Error::Memory`] when memory runs out,
    /// [`Error::Vulkan`] when a call fails.
    pub fn new(gpu: &Gpu, format: vk::Format, extent: [u32; 2]) -> Result<Self> {
        use vk::ImageUsageFlags as U;
        let usage = U::COLOR_ATTACHMENT | U::TRANSFER_SRC | U::TRANSFER_DST;
        let image = Arc::new(Image::new(gpu, "offscreen", &ImageDesc::flat(format, extent, usage))?);
        let bytes = image.desc().texel_bytes();
        let host = Arc::new(Buffer::new(gpu, "offscreen (read back)", bytes, BufferUse::Download)?);
        Ok(Self { gpu: gpu.clone(), image, host, recorded: Vec::new(), commands: Commands::new(gpu)? })
    }

    /// Fills the image with the colour `behind`, records the plan over it, and submits. The plan takes no depth image, and the last
    /// frame is finished.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] while a frame is in flight; the errors of [`Plan::record`]; [`Error::Vulkan`] when a call fails. After an
    /// error of recording or submission nothing is in flight.
    pub fn draw(&mut self, plan: &mut Plan, behind: [f32; 4]) -> Result<()> {
        let target = TargetImage::own(&self.gpu, &self.image);
        self.record(behind, |commands| Ok(vec![plan.record(commands, Some(&target), None)?]))
    }

    /// Draws plans side by side from the left, recorded together ([`Plan::record_together`]): for instance a stereo pair. They are for
    /// [`TargetDesc::in_part`](crate::frame::target::TargetDesc::in_part).
    ///
    /// # Errors
    ///
    /// Those of [`Offscreen::draw`]; [`Error::Invalid`] if there are none, or the image has no room for them.
    pub fn draw_beside(&mut self, plans: &mut [&mut Plan], behind: [f32; 4]) -> Result<()> {
        if plans.is_empty() {
            return Err(Error::invalid("offscreen", "no plan is given"));
        }
        let whole = TargetImage::own(&self.gpu, &self.image);
        let mut left = 0_u32;
        let mut targets = Vec::new();
        for plan in &*plans {
            targets.push(TargetImage { extent: plan.extent, corner: [left, 0], ..whole });
            left = left.saturating_add(plan.extent[0]);
            if left > whole.extent[0] || plan.extent[1] > whole.extent[1] {
                let why = format!("{:?} pixels: must have room for all plans side by side", whole.extent);
                return Err(Error::invalid("offscreen", why));
            }
        }
        let info = |target| RecordInfo { target: Some(target), ..RecordInfo::default() };
        let mut plans: Vec<_> =
            plans.iter_mut().map(|plan| &mut **plan).zip(targets.iter().map(info)).collect();
        self.record(behind, |commands| Plan::record_together(commands, &mut plans))
    }

    fn record(
        &mut self,
        behind: [f32; 4],
        record: impl FnOnce(&mut CommandBuffer) -> Result<Vec<Recorded>>,
    ) -> Result<()> {
        if !self.recorded.is_empty() {
            return Err(Error::invalid("offscreen", "its last frame has not been finished"));
        }
        let commands = self.commands.begin()?;
        let mut recorder = Recorder::new(&self.gpu, commands, None);
        recorder.clear_image("background", &self.image, behind);
        recorder.leave(&self.image, Use::ColorAttachment);
        let (_, mut keep) = recorder.finish()?;
        let recorded = record(commands)?;
        let mut recorder = Recorder::new(&self.gpu, commands, None);
        recorder.assume_after(&self.image, Use::ColorAttachment);
        recorder.copy_image_to_buffer("read back", &self.image, &self.host);
        keep.extend(recorded.iter().flat_map(Recorded::keep));
        let sent = recorder.finish().and_then(|(_, last)| {
            keep.extend(last);
            self.commands.send_frame(keep, Some(&self.image))
        });
        match sent {
            Ok(()) => self.recorded = recorded,
            Err(error) => {
                recorded.into_iter().for_each(Recorded::discarded);
                return Err(error);
            }
        }
        Ok(())
    }

    /// Waits for the frame. Returns its status and the texels in the image's format, row by row. The status of several plans is one: complete
    /// if all are, with the passes and counters of all.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when no frame is in flight; [`Error::Vulkan`], [`Error::Timeout`] and [`Error::DeviceLost`] when the wait
    /// fails, which abandons the frame.
    pub fn finish(&mut self) -> Result<(Status, Vec<u8>)> {
        let recorded = std::mem::take(&mut self.recorded);
        if recorded.is_empty() {
            return Err(Error::invalid("offscreen", "no frame is in flight"));
        }
        if let Err(error) = self.commands.settle() {
            // `commands` keeps the resources of the submission for as long as it may run.
            recorded.into_iter().for_each(Recorded::discarded);
            return Err(error);
        }
        let mut all = Status { complete: true, passes: Vec::new(), counters: Vec::new(), bound: None };
        for status in recorded.into_iter().map(Recorded::completed).collect::<Vec<_>>() {
            let Status { complete, passes, counters, bound } = status?;
            if !complete {
                let both = || all.bound.zip(bound).map(|(a, b)| a.larger(b));
                all.bound = if all.complete { bound } else { both() };
            }
            all.complete &= complete;
            all.passes.extend(passes);
            all.counters.extend(counters);
        }
        Ok((all, self.host.host_copy()?))
    }
}

impl Drop for Offscreen {
    fn drop(&mut self) {
        self.recorded.drain(..).for_each(Recorded::discarded);
    }
}
