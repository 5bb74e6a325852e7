//! An offscreen colour image, as an engine would own one, that plans draw into.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::plan::{Plan, Recorded, Status};
use crate::gpu::sync::Use;
use crate::gpu::{Buffer, BufferUse, Commands, Gpu, Image, ImageDesc, Recorder, TargetImage};

/// A colour image with a command buffer, for plans made for [`TargetDesc::caller`](crate::frame::target::TargetDesc::caller). It submits
/// without waiting, so several of them keep several frames in flight.
#[derive(Debug)]
pub struct Offscreen {
    gpu: Gpu,
    image: Arc<Image>,
    host: Arc<Buffer>,
    recorded: Option<Recorded>,
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
        Ok(Self { gpu: gpu.clone(), image, host, recorded: None, commands: Commands::new(gpu)? })
    }

    /// Fills the image with the colour `behind`, records the plan over it, and submits. The plan takes no depth image, and the last
    /// frame is finished.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] while a frame is in flight; the errors of [`Plan::record`]; [`Error::Vulkan`] when a call fails. After an
    /// error of recording or submission nothing is in flight.
    pub fn draw(&mut self, plan: &mut Plan, behind: [f32; 4]) -> Result<()> {
        if self.recorded.is_some() {
            return Err(Error::invalid("offscreen", "its last frame has not been finished"));
        }
        let target = TargetImage::own(&self.gpu, &self.image);
        let commands = self.commands.begin()?;
        let mut recorder = Recorder::new(&self.gpu, commands, None);
        recorder.clear_image("background", &self.image, behind);
        recorder.leave(&self.image, Use::ColorAttachment);
        let (_, mut keep) = recorder.finish()?;
        let recorded = plan.record(commands, Some(&target), None)?;
        let mut recorder = Recorder::new(&self.gpu, commands, None);
        recorder.assume_after(&self.image, Use::ColorAttachment);
        recorder.copy_image_to_buffer("read back", &self.image, &self.host);
        keep.extend(recorded.keep());
        let sent = recorder.finish().and_then(|(_, last)| {
            keep.extend(last);
            self.commands.send_frame(keep, Some(&self.image))
        });
        match sent {
            Ok(()) => self.recorded = Some(recorded),
            Err(error) => {
                recorded.discarded();
                return Err(error);
            }
        }
        Ok(())
    }

    /// Waits for the frame. Returns its status and the texels in the image's format, row by row.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when no frame is in flight; [`Error::Vulkan`], [`Error::Timeout`] and [`Error::DeviceLost`] when the wait
    /// fails, which abandons the frame.
    pub fn finish(&mut self) -> Result<(Status, Vec<u8>)> {
        let Some(recorded) = self.recorded.take() else {
            return Err(Error::invalid("offscreen", "no frame is in flight"));
        };
        if let Err(error) = self.commands.settle() {
            // `commands` keeps the resources of the submission for as long as it may run.
            recorded.discarded();
            return Err(error);
        }
        Ok((recorded.completed()?, self.host.host_copy()?))
    }
}

impl Drop for Offscreen {
    fn drop(&mut self) {
        if let Some(recorded) = self.recorded.take() {
            recorded.discarded();
        }
    }
}
