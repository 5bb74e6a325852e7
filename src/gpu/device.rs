//! The logical device and everything that exists once per device: queue, allocator, budget, tables of pipelines and samplers.

use std::collections::HashMap;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::Allocator;

use super::budget::Budget;
use super::cache::PipelineCacheFile;
use super::feature::{Enabled, OptionalFeature};
use super::host::{AllocationCallbacks, Compilation, MemorySource};
use super::instance::{Instance, c_name};
use super::pipeline::{Pipeline, PipelineKey};
use super::queue::Queue;
use super::select::{Candidate, DeviceReport};
use crate::error::{Error, Result};

/// A Vulkan device, opened by the crate or [by the caller](Gpu::from_raw).
///
/// Clones are cheap and share the device; every object made from it keeps it alive. Threads may prepare, record and draw
/// on one device at the same time; a lock serialises their use of the queue.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(crate) inner: Arc<Inner>,
}

/// The Vulkan objects behind a [`Gpu`], for callers that record commands of their own.
///
/// Objects that the crate opened live as long as a clone of the [`Gpu`]; callers destroy what they make from them before
/// they drop the last clone.
#[derive(Clone)]
pub struct Handles {
    /// The instance.
    pub instance: ash::Instance,
    /// The physical device.
    pub physical_device: vk::PhysicalDevice,
    /// The device.
    pub device: ash::Device,
    /// The family of the queue that [`Gpu::with_queue`] passes.
    pub queue_family: u32,
}

impl std::fmt::Debug for Handles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Handles").field("physical_device", &self.physical_device).finish_non_exhaustive()
    }
}

/// The shared state of all clones of a [`Gpu`]. [`Inner::drop`] destroys the device before the fields are dropped in order.
pub(crate) struct Inner {
    pub(super) device: ash::Device,
    /// The physical device. Options may have lowered its limits.
    pub(super) candidate: Candidate,
    pub(super) enabled: Enabled,
    /// Whether each pass gets a command buffer of its own.
    pub(super) part_by_pass: bool,
    pub(super) budget: Arc<Budget>,
    /// Bytes of one allocation that the driver promises. It may grant more.
    pub(super) max_allocation: u64,
    /// Bytes of one allocation that the options allow.
    pub(super) allocation_size: u64,
    pub(super) max_buffer: u64,
    /// Optional features that the device does without, although it offers them.
    pub(super) without: Vec<OptionalFeature>,
    /// Invocations of a subgroup that passes count on, if lower than the device's.
    pub(super) subgroup_size: Option<u32>,
    pub(super) as_hardware: bool,
    /// Whether new memory is filled with bytes 0xFF.
    pub(super) poison: bool,
    /// Whether shaders round filter weights as samplers of GPUs do.
    pub(super) emulates_weights: bool,
    /// The functions that read statistics of shaders, where these are kept.
    pub(super) statistics: Option<khr::pipeline_executable_properties::Device>,
    /// Whether workgroups take their work in reverse order.
    pub(super) permutes: bool,
    /// Whether it presents images.
    pub(super) presents: bool,
    /// Number of frames whose ends were marked.
    pub(super) frames: AtomicU64,
    pub(super) cache_file: Option<PipelineCacheFile>,
    pub(super) cache: vk::PipelineCache,
    /// Whether dropping this destroys the cache.
    pub(super) own_cache: bool,
    pub(super) lost: LossNote,
    pub(super) staging_bytes: u64,
    pub(super) page_pool: Option<u64>,
    pub(super) loop_limit: OnceLock<u32>,
    /// Largest errors of the filters of 8-bit and 16-bit volumes.
    pub(super) filter_errors: OnceLock<[f64; 2]>,
    /// Microseconds spent on building pipelines.
    pub(super) pipeline_us: AtomicU64,
    pub(super) allocator: Mutex<Option<Allocator>>,
    /// The caller's memory, in place of the allocator.
    pub(super) memory: Option<Arc<dyn MemorySource>>,
    pub(super) callbacks: Option<AllocationCallbacks>,
    pub(super) compilation: Option<Compilation>,
    pub(super) queue: Queue,
    pub(super) pipelines: Mutex<HashMap<PipelineKey, Arc<Pipeline>>>,
    pub(super) samplers: Mutex<HashMap<(vk::Filter, bool), vk::Sampler>>,
    pub(super) debug: Option<ext::debug_utils::Device>,
    pub(super) reports: Vec<DeviceReport>,
    /// Whether dropping this destroys the device.
    pub(super) owned: bool,
    // Last: destroys the instance after the device.
    pub(super) instance: Instance,
}

impl std::fmt::Debug for Inner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu").field("report", &self.candidate.report).finish_non_exhaustive()
    }
}

impl Gpu {
    /// Runs `work` with the queue while no other thread submits to it through this crate, under the caller's
    /// [`QueueLock`](super::QueueLock) where there is one. `work` must not draw or upload through this crate: it would
    /// deadlock.
    pub fn with_queue<R>(&self, work: impl FnOnce(vk::Queue) -> R) -> R {
        self.inner.queue.with(work)
    }

    pub(crate) fn device(&self) -> &ash::Device {
        &self.inner.device
    }

    /// Returns the limits of the device, as options may have lowered them.
    pub(crate) fn limits(&self) -> &vk::PhysicalDeviceLimits {
        &self.inner.candidate.properties.limits
    }

    /// Returns the caller's callbacks for host memory.
    pub(super) fn host_callbacks(&self) -> Option<&vk::AllocationCallbacks<'static>> {
        self.inner.host_callbacks()
    }

    /// Locks the allocator, which is `None` only while the device is being destroyed.
    pub(crate) fn allocator(&self) -> MutexGuard<'_, Option<Allocator>> {
        self.inner.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn pipeline_table(&self) -> MutexGuard<'_, HashMap<PipelineKey, Arc<Pipeline>>> {
        self.inner.pipelines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the debug name of an object where the device supports names.
    pub(crate) fn name<H: vk::Handle>(&self, handle: H, name: &str) {
        let Some(debug) = &self.inner.debug else { return };
        let name = c_name(name);
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
        // SAFETY: the handle was made from this device and is not used by another thread yet. A failure
        // (out of host memory) only loses the name.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }

    /// Writes the pipeline cache to its file, if it has one ([`GpuOptions::pipeline_cache`](super::GpuOptions::pipeline_cache)). Dropping
    /// the last clone does so, too.
    pub fn save_pipeline_cache(&self) {
        self.inner.save_cache();
    }

    /// Returns whether the device is lost. Functions that use a lost device return [`Error::DeviceLost`] before they
    /// call Vulkan. Its objects can be dropped as usual, and [`Gpu::new`] may open the device again.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.inner.lost.first.get().is_some()
    }

    /// Returns the note by which a caller tells that the device is lost.
    #[must_use]
    pub fn loss_note(&self) -> LossNote {
        self.inner.lost.clone()
    }

    /// Checks that the device is not known to be lost; called before work starts.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`] with the call that reported the loss first.
    pub(crate) fn alive(&self) -> Result<()> {
        self.inner.lost.first.get().map_or(Ok(()), |&call| Err(Error::DeviceLost { call }))
    }

    /// Returns the error of a failed call, and remembers a loss.
    pub(crate) fn failed(&self, call: &'static str, result: vk::Result) -> Error {
        if result == vk::Result::ERROR_DEVICE_LOST {
            let call = *self.inner.lost.first.get_or_init(|| call);
            return Error::DeviceLost { call };
        }
        Error::vulkan(call, result)
    }
}

/// Tells a [`Gpu`] that its device is lost.
///
/// It holds neither the [`Gpu`] nor the device: a callback of the engine for a lost device may own one, where a clone of the [`Gpu`]
/// would keep the device alive that owns the callback.
#[derive(Clone, Debug, Default)]
pub struct LossNote {
    /// The first call that reported the loss.
    first: Arc<OnceLock<&'static str>>,
}

impl LossNote {
    /// Marks the device as lost, after a call of the caller's own, such as a submission, has returned `ERROR_DEVICE_LOST`, or the engine
    /// has told of the loss. Does nothing after the last clone of the [`Gpu`] is gone.
    pub fn note(&self) {
        let _ = self.first.set("a call of the caller");
    }
}

impl Inner {
    pub(super) fn host_callbacks(&self) -> Option<&vk::AllocationCallbacks<'static>> {
        self.callbacks.as_ref().map(AllocationCallbacks::get)
    }

    fn save_cache(&self) {
        let Some(file) = self.cache_file.as_ref().filter(|_| self.cache != vk::PipelineCache::null()) else {
            return;
        };
        // SAFETY: the cache was made from this device.
        if let Ok(data) = unsafe { self.device.get_pipeline_cache_data(self.cache) } {
            file.store(&data);
        }
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        // No submission of this crate is pending: each holds the `Gpu` until it has ended. The caller waits for its own
        // queues.
        if self.owned {
            // SAFETY: the device is alive. If it is lost there is nothing to wait for.
            let _ = unsafe { self.device.device_wait_idle() };
        }
        self.save_cache();
        let callbacks = self.callbacks;
        let callbacks = callbacks.as_ref().map(AllocationCallbacks::get);
        for pipeline in self.pipelines.get_mut().unwrap_or_else(PoisonError::into_inner).values() {
            pipeline.destroy(&self.device, callbacks);
        }
        for &sampler in self.samplers.get_mut().unwrap_or_else(PoisonError::into_inner).values() {
            // SAFETY: made from this device; the queue is idle and every descriptor set is gone, since
            // each holds the `Gpu`.
            unsafe { self.device.destroy_sampler(sampler, callbacks) };
        }
        if self.own_cache {
            // SAFETY: made from this device, or null; no pipeline is being built.
            unsafe { self.device.destroy_pipeline_cache(self.cache, callbacks) };
        }
        // The allocator frees its blocks of memory before the device is destroyed.
        drop(self.allocator.get_mut().unwrap_or_else(PoisonError::into_inner).take());
        if self.owned {
            // SAFETY: every object made from the device holds a `Gpu` and was dropped, or was destroyed above.
            unsafe { self.device.destroy_device(None) };
        }
    }
}
