//! Options of a device.

use std::path::PathBuf;
use std::sync::Arc;

#[cfg(feature = "testing")]
use super::inject::Injection;
use super::validation::{Validation, ValidationLog};

/// How a [`Gpu`](super::Gpu) is made. [`Gpu::from_raw`](super::Gpu::from_raw) takes no `device` and no `validation`: the caller chose.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// Part of the device's name, case ignored. Without it the environment variable
    /// `VOLRASTER_DEVICE` counts, and without that the best device is taken, a real GPU before a
    /// software one. The name `none` refuses every device.
    pub device: Option<String>,
    /// What the validation layer checks. A missing layer is an error.
    pub validation: Validation,
    /// Where its messages go; without it into a log of the device's own. One that is given hears of a device that cannot be
    /// opened, too.
    pub validation_log: Option<Arc<ValidationLog>>,
    /// Most device memory to use, in bytes. Without it: what the driver says is free, or nine tenths
    /// of the largest device-local heap.
    pub memory_budget: Option<u64>,
    /// Most loop iterations of one shader invocation, instead of what the start-up probe finds.
    pub loop_limit: Option<u32>,
    /// Most bytes that a shader sees of a buffer, instead of what the driver says where that is more.
    pub storage_range: Option<u32>,
    /// Most bytes of one allocation of device memory, instead of what the driver says where that is more.
    pub allocation_size: Option<u64>,
    /// Record each pass of own submissions into a command buffer of its own. Synchronization validation, where it is told to
    /// look at submissions, then sees hazards between passes that it overlooks within a command buffer.
    pub command_buffer_by_pass: bool,
    /// Most bytes of a volume that one submission uploads, in whole planes, instead of 32 MiB: what a queue is busy with before
    /// it comes to a frame that another thread has submitted.
    pub staging_bytes: Option<u64>,
    /// Folder of the pipeline cache. Without it: `volraster` in the user's cache folder.
    pub pipeline_cache: Option<PathBuf>,
    /// Do not keep pipelines on disk.
    pub no_pipeline_cache: bool,
    /// Counts the device's Vulkan calls and makes some fail: for tests and the self-test.
    #[cfg(feature = "testing")]
    pub inject: Option<Injection>,
}
