//! Options of a device.

use std::path::PathBuf;
use std::sync::Arc;

use ash::vk;

use super::feature::OptionalFeature;
use super::host::{AllocationCallbacks, Compilation, MemorySource};
#[cfg(feature = "testing")]
use super::inject::Injection;
use super::validation::{Validation, ValidationLog};

/// Options of a [`Gpu`](super::Gpu). [`Gpu::from_raw`](super::Gpu::from_raw) refuses `device` and `validation`, which are the
/// caller's to choose.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// Part of the device's name; case is ignored. The default is the environment variable `VOLRASTER_DEVICE`, else
    /// the best device: a real GPU before a software one. The name `none` refuses every device.
    pub device: Option<String>,
    /// Number of the device among those of the best kind with that name, which are counted round: processes that share a machine each take one
    /// of their own where there are several.
    pub nth: u32,
    /// Checks of the validation layer. A missing layer is an error.
    pub validation: Validation,
    /// Log that collects the layer's messages; the default is a log of the device's own. A log given here also gets the
    /// messages about a device that cannot be opened.
    pub validation_log: Option<Arc<ValidationLog>>,
    /// Limit of device memory, in bytes. The default is the free memory that the driver reports, or nine tenths of the
    /// largest device-local heap.
    pub memory_budget: Option<u64>,
    /// Bytes of a pool in which a grid is kept in pages, at least one page; fewer where the driver refuses so large an image, or less memory is
    /// left. Without it a grid that fits the device is one image, and for another the pool takes at most five eighths of the memory that is left. Techniques
    /// of stacks have a pool of their own.
    pub page_pool: Option<u64>,
    /// Loop iterations that one shader invocation may make, instead of the number that the start-up probe finds.
    pub loop_limit: Option<u32>,
    /// Bytes of a buffer that a descriptor shows shaders; lowers the driver's limit.
    pub storage_range: Option<u32>,
    /// Optional features that the device does without, so that their fallbacks draw. For tests.
    pub without: Vec<OptionalFeature>,
    /// Invocations of a subgroup that passes count on; lowers the device's. For tests.
    pub subgroup_size: Option<u32>,
    /// Bytes of one allocation of device memory. Without it the driver is asked for every size, also above the one that it
    /// promises.
    pub allocation_size: Option<u64>,
    /// Whether a software device gets the passes of a GPU: workgroups that share memory, an invocation for each pixel. Tests
    /// of these passes need no GPU then.
    pub as_hardware: bool,
    /// Whether new memory of buffers and images is filled with bytes 0xFF, which are NaN as numbers, where the host sees device
    /// memory, as with software drivers, and storage images whose contents a layout transition discards are overwritten. Work that relies on
    /// memory of zeros, or on what a driver happens to keep, then shows. For tests.
    pub poison: bool,
    /// Whether shaders round the weights of linear filters to 8 fractional bits, as the samplers of most GPUs do. For tests.
    pub emulate_filter_weights: bool,
    /// Whether workgroups take their work in reverse order. Images must not depend on the order. For tests.
    pub permute: bool,
    /// Whether pipelines keep statistics of their shaders ([`Gpu::pipeline_reports`](super::Gpu::pipeline_reports)). An error
    /// where the driver lacks `VK_KHR_pipeline_executable_properties`.
    pub shader_statistics: bool,
    /// Whether each pass of the crate's own submissions gets a command buffer of its own. Synchronization validation of
    /// submissions then reports hazards between passes that it overlooks within one command buffer.
    pub command_buffer_by_pass: bool,
    /// Bytes of a volume that one submission uploads, rounded to whole planes; 32 MiB by default. Frames of other threads
    /// wait for at most two such submissions.
    pub staging_bytes: Option<u64>,
    /// Gives, for [`Gpu::from_raw`](super::Gpu::from_raw) alone, the memory of all buffers and images, in place of the crate's allocator, which then allocates nothing.
    pub memory: Option<Arc<dyn MemorySource>>,
    /// The callbacks for host memory of every object that the crate makes on a device of the caller. The crate's allocator of device memory has
    /// none: with them goes `memory`.
    pub allocation_callbacks: Option<AllocationCallbacks>,
    /// The threads that compile pipelines; as many of the crate's own as the processor runs where it is `None`.
    pub compilation: Option<Compilation>,
    /// Where compiled pipelines are kept.
    pub pipeline_cache: PipelineCache,
    /// Whether the device presents images in windows ([`Screen`](crate::window::Screen)). An error where it cannot.
    #[cfg(feature = "window")]
    pub window: bool,
    /// Whether the device presents images that no window shows ([`Screen::headless`](crate::window::Screen::headless)). An
    /// error where it cannot.
    #[cfg(feature = "cli")]
    pub headless_surface: bool,
    /// Counts the device's Vulkan calls and makes some of them fail; for tests.
    #[cfg(feature = "testing")]
    pub inject: Option<Injection>,
}

/// Where the pipelines of a device are kept, so that later ones need less compilation.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum PipelineCache {
    /// The crate's own file in [`user_cache_folder`](super::user_cache_folder), for a device that the crate opens; no file for one that
    /// the caller made.
    #[default]
    Auto,
    /// The crate's own file in this folder.
    Folder(PathBuf),
    /// The caller's cache, for [`Gpu::from_raw`](super::Gpu::from_raw) alone: every pipeline is created with it. The caller keeps its
    /// contents, and destroys it after the last clone of the [`Gpu`](super::Gpu) and everything made from it is gone. It was not made
    /// with `EXTERNALLY_SYNCHRONIZED`: threads create pipelines at the same time.
    Caller(vk::PipelineCache),
    /// Nothing is kept on disk.
    Off,
}

impl GpuOptions {
    /// Returns whether the device presents images, with the name of what it then needs.
    pub(super) fn presents(&self) -> Option<&'static str> {
        #[cfg(feature = "cli")]
        if self.headless_surface {
            return Some("a headless surface");
        }
        #[cfg(feature = "window")]
        if self.window {
            return Some("a window");
        }
        None
    }
}
