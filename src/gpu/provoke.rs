//! Errors on purpose, one for each kind of validation: a check that is not heard is none.

use std::sync::Arc;

use ash::vk;

use super::buffer::{Buffer, BufferUse};
use super::descriptors::{Descriptors, Resource};
use super::device::Gpu;
use super::pipeline::ComputeDesc;
use super::recorder::Recorder;
use super::shader::{self, BINDING_RESULT};
use super::submit::Commands;
use super::validation::Validation;
use crate::error::Result;
use crate::interface::ProbePush;

/// A fault that one kind of validation hears and the others do not. For a device of its own that is dropped afterwards;
/// drivers survive it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Provocation {
    /// A buffer of 0 bytes.
    Core,
    /// A buffer that is not destroyed; heard when the device is.
    Leak,
    /// Two fills of one buffer without a barrier between them.
    Synchronization,
    /// A shader that writes beyond its buffer, into memory that nothing uses.
    GpuAssisted,
    /// A command pool whose buffers are reset one by one.
    BestPractices,
}

impl Provocation {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::Core, Self::Leak, Self::Synchronization, Self::GpuAssisted, Self::BestPractices];

    /// Its name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Core => "core",
            Self::Leak => "leaks",
            Self::Synchronization => "synchronization",
            Self::GpuAssisted => "gpu-assisted",
            Self::BestPractices => "best-practices",
        }
    }

    /// The least validation that hears it.
    #[must_use]
    pub fn needs(self) -> Validation {
        match self {
            Self::Core | Self::Leak | Self::Synchronization => Validation::On,
            Self::GpuAssisted => Validation::GpuAssisted,
            Self::BestPractices => Validation::BestPractices,
        }
    }

    /// What stands in the message that must be heard, by one layer's version or another's.
    #[must_use]
    pub fn message(self) -> &'static [&'static str] {
        match self {
            Self::Core => &["VUID-VkBufferCreateInfo-size-00912"],
            Self::Leak => &["VUID-vkDestroyDevice-device-00378", "VUID-vkDestroyDevice-device-05137"],
            Self::Synchronization => &["SYNC-HAZARD-WRITE"],
            Self::GpuAssisted => {
                &["VUID-vkCmdDispatch-None-02706", "VUID-vkCmdDispatch-storageBuffers-06936", "out of bounds"]
            }
            Self::BestPractices => &["BestPractices-vkCreateCommandPool-command-buffer-reset"],
        }
    }
}

impl Gpu {
    /// Makes a fault on purpose, for whoever checks that it is heard. Nothing but a device of its own should be done so.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`](crate::Error::Vulkan) when something else fails.
    pub fn provoke(&self, what: Provocation) -> Result<()> {
        let device = self.device();
        match what {
            Provocation::Core | Provocation::Leak => {
                let size = if what == Provocation::Core { 0 } else { 64 };
                let info =
                    vk::BufferCreateInfo::default().size(size).usage(vk::BufferUsageFlags::TRANSFER_SRC);
                // SAFETY: none for 0 bytes, which is the fault; drivers survive it.
                let made = unsafe { device.create_buffer(&info, None) };
                if let (Ok(buffer), Provocation::Core) = (made, what) {
                    // SAFETY: just made, unused.
                    unsafe { device.destroy_buffer(buffer, None) };
                }
                Ok(())
            }
            Provocation::Synchronization => {
                let buffer = Buffer::new(self, "provoked", 256, BufferUse::ShaderWrite)?;
                let mut commands = Commands::new(self)?;
                let raw = commands.begin()?.raw();
                for value in [1, 2] {
                    // SAFETY: recording, outside of rendering; the fault is that nothing lies between the fills, which are
                    // never submitted.
                    unsafe { device.cmd_fill_buffer(raw, buffer.raw(), 0, 256, value) };
                }
                drop(commands);
                Ok(())
            }
            Provocation::GpuAssisted => {
                let desc = ComputeDesc { shader: &shader::PROBE_OVERRUN, constants: &[] };
                let pipeline = self.compute_pipeline("provoked", &desc)?;
                // The allocator's block is larger, and holds nothing else.
                let buffer = Arc::new(Buffer::new(self, "provoked", 64, BufferUse::ShaderWrite)?);
                let resources = [(BINDING_RESULT, Resource::Buffer(buffer))];
                let descriptors = Arc::new(Descriptors::new(self, &pipeline, &resources)?);
                let mut commands = Commands::new(self)?;
                let mut recorder = Recorder::new(self, commands.begin()?, None);
                let push = ProbePush { count: 64 };
                recorder.dispatch("provoked", &pipeline, &descriptors, bytemuck::bytes_of(&push), [1, 1, 1]);
                let (_, keep) = recorder.finish();
                commands.submit(keep, "provoked")
            }
            Provocation::BestPractices => {
                let pool = self.create_command_pool(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER)?;
                // SAFETY: just made, unused.
                unsafe { self.destroy_command_pool(pool) };
                Ok(())
            }
        }
    }
}
