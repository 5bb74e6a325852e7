//! Deliberate faults, one for each kind of validation, for tests that the messages arrive.

use std::sync::Arc;

use ash::vk;

use super::buffer::{Buffer, BufferUse};
use super::descriptors::Descriptors;
use super::device::Gpu;
use super::shader::{PROBE_OVERRUN, ProbeLoop};
use super::submit::Commands;
use super::validation::Validation;
use crate::error::Result;
use crate::interface::ProbePush;

/// A fault that one kind of validation reports and the others do not. Drivers survive it, but the device should be dropped
/// afterwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Provocation {
    /// A buffer of 0 bytes.
    Core,
    /// A buffer that is not destroyed, reported when the device is destroyed.
    Leak,
    /// Two fills of one buffer without a barrier between them.
    Synchronization,
    /// A shader that writes beyond its buffer, into memory that nothing uses.
    GpuAssisted,
    /// A command pool whose buffers are reset one by one, and a dispatch of no workgroups.
    BestPractices,
}

impl Provocation {
    /// All faults.
    pub const ALL: [Self; 5] =
        [Self::Core, Self::Leak, Self::Synchronization, Self::GpuAssisted, Self::BestPractices];

    /// Returns the name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.facts().0
    }

    /// Returns the least validation that reports it.
    #[must_use]
    pub fn needs(self) -> Validation {
        self.facts().1
    }

    /// Returns texts of which the message must contain one; they differ between versions of the layer.
    #[must_use]
    pub fn message(self) -> &'static [&'static str] {
        self.facts().2
    }

    fn facts(self) -> (&'static str, Validation, &'static [&'static str]) {
        match self {
            Self::Core => ("core", Validation::On, &["VUID-VkBufferCreateInfo-size-00912"]),
            Self::Leak => (
                "leaks",
                Validation::On,
                &["VUID-vkDestroyDevice-device-00378", "VUID-vkDestroyDevice-device-05137"],
            ),
            Self::Synchronization => ("synchronization", Validation::On, &["SYNC-HAZARD-WRITE"]),
            Self::GpuAssisted => (
                "gpu-assisted",
                Validation::GpuAssisted,
                &[
                    "VUID-vkCmdDispatch-None-02706",
                    "VUID-vkCmdDispatch-storageBuffers-06936",
                    "out of bounds",
                ],
            ),
            Self::BestPractices => (
                "best-practices",
                Validation::BestPractices,
                &[
                    "BestPractices-vkCreateCommandPool-command-buffer-reset",
                    "BestPractices-vkCmdDispatch-group-count-zero",
                ],
            ),
        }
    }
}

impl Gpu {
    /// Commits a fault on this device. Callers use a device of its own for that.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`](crate::Error::Vulkan) when another call fails.
    pub fn provoke(&self, what: Provocation) -> Result<()> {
        let device = self.device();
        match what {
            Provocation::Core | Provocation::Leak => {
                let size = if what == Provocation::Core { 0 } else { 64 };
                let info =
                    vk::BufferCreateInfo::default().size(size).usage(vk::BufferUsageFlags::TRANSFER_SRC);
                // SAFETY: 0 bytes are not allowed, which is the fault; drivers survive it.
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
                    // SAFETY: recording, outside of rendering; the fault is the missing barrier between the fills, which
                    // are never submitted.
                    unsafe { device.cmd_fill_buffer(raw, buffer.raw, 0, 256, value) };
                }
                drop(commands);
                Ok(())
            }
            Provocation::GpuAssisted => {
                // The block of memory is larger, and no other resource lies in it.
                self.dispatch_provoked(1)
            }
            Provocation::BestPractices => {
                let pool = self.create_command_pool(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER)?;
                // SAFETY: just made, unused.
                unsafe { self.destroy_command_pool(pool) };
                // Newer layers do not mind such pools.
                self.dispatch_provoked(0)
            }
        }
    }

    /// Dispatches workgroups that write beyond their buffer.
    fn dispatch_provoked(&self, groups: u32) -> Result<()> {
        let buffer = Arc::new(Buffer::new(self, "provoked", 64, BufferUse::ShaderWrite)?);
        let bound = PROBE_OVERRUN.with(&ProbeLoop { result: buffer.write() });
        let pipeline = self.compute_pipeline("provoked", &bound)?;
        let descriptors = Arc::new(Descriptors::new(self, &pipeline, &bound)?);
        let push = ProbePush { count: 64 };
        Commands::new(self)?.run("provoked", |recorder| {
            recorder.dispatch("provoked", &pipeline, &descriptors, bytemuck::bytes_of(&push), [groups, 1, 1]);
        })
    }
}
