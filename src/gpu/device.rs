//! The logical device and everything that exists once per device.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use ash::{ext, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use super::budget::Budget;
use super::cache::PipelineCacheFile;
use super::feature::{Enabled, OptionalFeature};
use super::inject::Injection;
use super::instance::{Instance, c_name, version_text};
use super::pipeline::{Pipeline, PipelineKey};
use super::queue::Queue;
use super::select::{self, Candidate, DeviceReport};
use super::validation::{Validation, ValidationLog};
use crate::error::{Error, Result};

/// How a [`Gpu`] is made. [`Gpu::from_raw`] takes no `device` and no `validation`: the caller chose.
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
    pub inject: Option<Injection>,
}

/// A Vulkan device, opened here or [by the caller](Gpu::from_raw). Cheap to clone; every object made from it keeps it
/// alive.
///
/// `Send` and `Sync`: threads may prepare, record and draw on one at the same time, and take turns at the queue.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(crate) inner: Arc<Inner>,
}

/// The Vulkan objects behind a [`Gpu`], for callers that record around it. Those that the crate opened live as long as
/// a clone of the [`Gpu`] does; what is made from them must be destroyed before the last one goes.
#[derive(Clone)]
pub struct Handles {
    /// The instance.
    pub instance: ash::Instance,
    /// The physical device.
    pub physical_device: vk::PhysicalDevice,
    /// The device.
    pub device: ash::Device,
    /// The queue family of the queue of [`Gpu::with_queue`].
    pub queue_family: u32,
}

impl std::fmt::Debug for Handles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Handles").field("physical_device", &self.physical_device).finish_non_exhaustive()
    }
}

/// Staging memory for uploads, unless something else is asked for: larger data goes in several turns.
const STAGING_BYTES: u64 = 32 << 20;

/// Smallest block of memory that is asked of the driver.
const BLOCK_BYTES: u64 = 4 << 20;

/// What a [`Gpu`] owns. Fields are dropped in order; the device goes in [`Inner::drop`].
pub(crate) struct Inner {
    pub(crate) device: ash::Device,
    pub(crate) physical: vk::PhysicalDevice,
    /// Whether each pass has a command buffer.
    pub(crate) part_by_pass: bool,
    pub(crate) properties: vk::PhysicalDeviceProperties,
    pub(crate) queue_family: u32,
    pub(crate) timestamp_bits: u32,
    pub(crate) budget: Arc<Budget>,
    /// Most bytes of one allocation.
    pub(super) max_allocation: u64,
    pub(crate) cache_file: Option<PipelineCacheFile>,
    pub(crate) cache: vk::PipelineCache,
    /// The call that told of the device's loss.
    pub(super) lost: OnceLock<&'static str>,
    pub(crate) staging_bytes: u64,
    pub(crate) loop_limit: OnceLock<u32>,
    pub(crate) filters_in_8_bit: OnceLock<bool>,
    /// Microseconds spent in building pipelines.
    pub(crate) pipeline_us: AtomicU64,
    allocator: Mutex<Option<Allocator>>,
    queue: Queue,
    pipelines: Mutex<HashMap<PipelineKey, Arc<Pipeline>>>,
    samplers: Mutex<HashMap<(vk::Filter, bool), vk::Sampler>>,
    debug: Option<ext::debug_utils::Device>,
    memory_budget: bool,
    fragment_stores: bool,
    fragment_interlock: bool,
    orders_stores: bool,
    reports: Vec<DeviceReport>,
    report: DeviceReport,
    /// Whether the device goes with this.
    owned: bool,
    // Last: destroys the instance after the device.
    pub(crate) instance: Instance,
}

/// A device that is open, whoever opened it.
pub(super) struct Opened {
    pub(super) instance: Instance,
    pub(super) device: ash::Device,
    pub(super) candidate: Candidate,
    pub(super) enabled: Enabled,
    pub(super) queue: Queue,
    pub(super) reports: Vec<DeviceReport>,
    /// Whether device and instance are destroyed with the [`Gpu`].
    pub(super) owned: bool,
}

impl std::fmt::Debug for Inner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu").field("report", &self.report).finish_non_exhaustive()
    }
}

/// Looks at every device of the system without opening one.
///
/// # Errors
///
/// [`Error::NoDevice`] without a Vulkan loader, [`Error::Vulkan`] when enumeration fails.
pub fn devices(wanted: Option<&str>) -> Result<Vec<DeviceReport>> {
    let instance = Instance::new(&GpuOptions::default())?;
    let wanted = wanted_name(wanted);
    let (_, candidates) = select::survey(&instance, wanted.as_deref())?;
    Ok(candidates.into_iter().map(|candidate| candidate.report).collect())
}

fn wanted_name(option: Option<&str>) -> Option<String> {
    let from_environment = || std::env::var("VOLRASTER_DEVICE").ok().filter(|name| !name.is_empty());
    option.map(str::to_string).or_else(from_environment)
}

impl Gpu {
    /// Opens the best device without a window. See [`GpuOptions::device`] for how it is chosen.
    ///
    /// # Errors
    ///
    /// As [`Gpu::new`].
    pub fn headless() -> Result<Self> {
        Self::new(&GpuOptions::default())
    }

    /// Opens a device.
    ///
    /// # Errors
    ///
    /// [`Error::NoDevice`] without a loader or a device that qualifies (with the reason for each),
    /// [`Error::Unsupported`] when validation is asked for and its layer is missing,
    /// [`Error::Vulkan`] when a call fails.
    pub fn new(options: &GpuOptions) -> Result<Self> {
        let instance = Instance::new(options)?;
        let wanted = wanted_name(options.device.as_deref());
        let (best, mut candidates) = select::survey(&instance, wanted.as_deref())?;
        let reports: Vec<DeviceReport> = candidates.iter().map(|c| c.report.clone()).collect();
        let Some(best) = best else {
            let reasons: Vec<String> = reports.iter().map(|r| format!("{}: {}", r.name, r.reason)).collect();
            let why = if reasons.is_empty() {
                "no driver is installed (Debian and Ubuntu: mesa-vulkan-drivers)".to_string()
            } else {
                reasons.join("; ")
            };
            return Err(Error::NoDevice { why });
        };
        Self::open(options, instance, candidates.swap_remove(best), reports)
    }

    fn open(
        options: &GpuOptions,
        instance: Instance,
        candidate: Candidate,
        reports: Vec<DeviceReport>,
    ) -> Result<Self> {
        let physical = candidate.raw;
        // SAFETY: `physical` was enumerated from this instance and supports Vulkan 1.3: it was chosen.
        let enabled = unsafe { Enabled::useful(&instance.raw, physical) }?;
        let names: Vec<_> = enabled.extensions.iter().map(|name| name.as_ptr()).collect();
        let mut features = vk::PhysicalDeviceFeatures::default()
            .fragment_stores_and_atomics(enabled.fragment_stores_and_atomics);
        // GPU-assisted validation writes from every stage.
        if options.validation.gpu_assisted() {
            // SAFETY: `physical` was enumerated from this instance.
            let available = unsafe { instance.raw.get_physical_device_features(physical) };
            features.vertex_pipeline_stores_and_atomics = available.vertex_pipeline_stores_and_atomics;
        }
        let mut interlock = vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT::default()
            .fragment_shader_pixel_interlock(true);
        let mut features13 = vk::PhysicalDeviceVulkan13Features::default()
            .synchronization2(enabled.synchronization2)
            .dynamic_rendering(enabled.dynamic_rendering);
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(candidate.queue_family)
            .queue_priorities(&priorities)];
        let mut info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names)
            .enabled_features(&features)
            .push_next(&mut features13);
        if enabled.fragment_shader_pixel_interlock {
            info = info.push_next(&mut interlock);
        }
        // SAFETY: the pointers in `info` refer to locals; extensions and features were found present.
        let device = unsafe { instance.raw.create_device(physical, &info, None) }
            .map_err(|result| Error::vulkan("vkCreateDevice", result))?;
        // SAFETY: one queue of this family was asked for.
        let queue = unsafe { device.get_device_queue(candidate.queue_family, 0) };
        let queue = Queue::new(queue, None);
        Self::assemble(options, Opened { instance, device, candidate, enabled, queue, reports, owned: true })
    }

    /// Everything that exists once per device, around one that is open.
    pub(super) fn assemble(options: &GpuOptions, opened: Opened) -> Result<Self> {
        let Opened { instance, device, candidate, enabled, queue, reports, owned } = opened;
        let physical = candidate.raw;
        let debug = instance.debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &device));
        let memory_budget = enabled.has(ext::memory_budget::NAME);
        let total = options.memory_budget.unwrap_or_else(|| free_memory(&instance, physical, memory_budget));

        let max_allocation =
            options.allocation_size.unwrap_or(u64::MAX).min(largest_allocation(&instance, physical));

        let cache_file = (!options.no_pipeline_cache)
            .then(|| PipelineCacheFile::locate(options.pipeline_cache.as_deref(), &candidate.properties))
            .flatten();
        let mut inner = Inner {
            device,
            physical,
            properties: candidate.properties,
            queue_family: candidate.queue_family,
            timestamp_bits: candidate.timestamp_bits,
            budget: Budget::new(total),
            max_allocation,
            cache_file,
            cache: vk::PipelineCache::null(),
            lost: OnceLock::new(),
            staging_bytes: options.staging_bytes.unwrap_or(STAGING_BYTES).max(1),
            loop_limit: OnceLock::new(),
            filters_in_8_bit: OnceLock::new(),
            pipeline_us: AtomicU64::new(0),
            allocator: Mutex::new(None),
            queue,
            pipelines: Mutex::default(),
            samplers: Mutex::default(),
            debug,
            memory_budget,
            part_by_pass: options.command_buffer_by_pass,
            fragment_stores: enabled.fragment_stores_and_atomics,
            fragment_interlock: enabled.fragment_shader_pixel_interlock,
            orders_stores: candidate.orders_stores,
            reports,
            report: candidate.report,
            owned,
            instance,
        };
        let range = &mut inner.properties.limits.max_storage_buffer_range;
        *range = options.storage_range.unwrap_or(u32::MAX).min(*range);
        // From here on `inner` destroys what was made when a `?` leaves.
        let data = inner.cache_file.as_ref().and_then(PipelineCacheFile::load).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
        // SAFETY: the data is empty or was written by this program for this device and driver and has
        // the hash that was stored with it.
        inner.cache = unsafe { inner.device.create_pipeline_cache(&info, None) }
            .map_err(|result| Error::vulkan("vkCreatePipelineCache", result))?;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: inner.instance.raw.clone(),
            device: inner.device.clone(),
            physical_device: physical,
            debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
            buffer_device_address: false,
            // Blocks grow with use: a small scene takes little more than it needs.
            allocation_sizes: gpu_allocator::AllocationSizes::new(BLOCK_BYTES, BLOCK_BYTES)
                .with_max_device_memblock_size(max_allocation.min(16 * BLOCK_BYTES))
                .with_max_host_memblock_size(max_allocation.min(16 * BLOCK_BYTES)),
        })
        .map_err(|source| Error::Allocation { object: "allocator".to_string(), source })?;
        inner.allocator = Mutex::new(Some(allocator));
        if let Some(limit) = options.loop_limit {
            let _ = inner.loop_limit.set(limit.max(1));
        }
        let gpu = Self { inner: Arc::new(inner) };
        gpu.name(gpu.inner.cache, "pipeline cache");
        Ok(gpu)
    }

    /// Every device of the system, with the reason why it was taken or passed over. Of the caller's device only
    /// that.
    #[must_use]
    pub fn device_reports(&self) -> &[DeviceReport] {
        &self.inner.reports
    }

    /// The device that is open.
    #[must_use]
    pub fn report(&self) -> &DeviceReport {
        &self.inner.report
    }

    /// Version of the validation layer, when it is on. `None` for a caller's instance, layer or not.
    #[must_use]
    pub fn validation_layer(&self) -> Option<&str> {
        self.inner.instance.layer_version.as_deref()
    }

    /// The validation log. Hold it, drop every clone of the [`Gpu`], and read it: the messages of the
    /// device's destruction (leaks) are in it too. Always empty for a caller's instance, whose messages go to the
    /// caller's messenger.
    #[must_use]
    pub fn validation_log(&self) -> Arc<ValidationLog> {
        Arc::clone(&self.inner.instance.log)
    }

    /// The Vulkan objects behind this device.
    #[must_use]
    pub fn handles(&self) -> Handles {
        Handles {
            instance: self.inner.instance.raw.clone(),
            physical_device: self.inner.physical,
            device: self.inner.device.clone(),
            queue_family: self.inner.queue_family,
        }
    }

    /// Runs `work` with the queue, while no other thread submits to it through this crate, and under the caller's
    /// [`QueueLock`](super::QueueLock) where there is one. `work` must not draw or upload through this crate itself: it
    /// would wait for the queue for ever.
    pub fn with_queue<R>(&self, work: impl FnOnce(vk::Queue) -> R) -> R {
        self.inner.queue.with(work)
    }

    /// Whether the device offers an optional feature.
    #[must_use]
    pub fn has(&self, feature: OptionalFeature) -> bool {
        use vk::FormatFeatureFlags as F;
        let format = |format, flags| self.image_features(format).contains(flags);
        match feature {
            OptionalFeature::LinearFilterR32f => {
                format(vk::Format::R32_SFLOAT, F::SAMPLED_IMAGE_FILTER_LINEAR)
            }
            OptionalFeature::LinearFilterR16 => format(vk::Format::R16_UNORM, F::SAMPLED_IMAGE_FILTER_LINEAR),
            OptionalFeature::BlendRgba32f => {
                format(vk::Format::R32G32B32A32_SFLOAT, F::COLOR_ATTACHMENT_BLEND)
            }
            OptionalFeature::FragmentStores => self.inner.fragment_stores,
            OptionalFeature::FragmentInterlock => self.inner.fragment_interlock,
            OptionalFeature::OrderedStores => self.inner.fragment_stores && self.inner.orders_stores,
            OptionalFeature::MemoryBudget => self.inner.memory_budget,
            OptionalFeature::Timestamps => self.inner.timestamp_bits > 0,
            OptionalFeature::DebugNames => self.inner.debug.is_some(),
        }
    }

    /// Device memory that this crate may use in all, in bytes.
    #[must_use]
    pub fn memory_budget(&self) -> u64 {
        self.inner.budget.total()
    }

    /// Device memory that is taken now: object and bytes.
    #[must_use]
    pub fn memory_report(&self) -> Vec<(String, u64)> {
        self.inner.budget.entries()
    }

    /// Names of the pipelines that have been built, sorted.
    #[must_use]
    pub fn pipelines(&self) -> Vec<String> {
        let mut names: Vec<String> = self.pipeline_table().values().map(|p| p.name().to_string()).collect();
        names.sort();
        names
    }

    /// Milliseconds spent so far in building pipelines. Drivers may put off a part of it to the first use.
    #[must_use]
    pub fn pipeline_ms(&self) -> f64 {
        crate::num::f64_of_u64(self.inner.pipeline_us.load(Ordering::Relaxed)) * 1e-3
    }

    /// Largest extent of a 3D image, in samples.
    #[must_use]
    pub fn max_image_3d(&self) -> u32 {
        self.inner.properties.limits.max_image_dimension3_d
    }

    /// Largest side of a 2D image.
    pub(crate) fn max_image_2d(&self) -> u32 {
        self.inner.properties.limits.max_image_dimension2_d
    }

    /// Whether the device is a software rasteriser.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.inner.properties.device_type == vk::PhysicalDeviceType::CPU
    }

    /// Whether the invocations of a workgroup of eight are in one subgroup, and can tell each other words and votes.
    pub(crate) fn eight_share_words(&self) -> bool {
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup);
        // SAFETY: the physical device belongs to this instance; subgroup properties are core since 1.1.
        unsafe {
            self.inner.instance.raw.get_physical_device_properties2(self.inner.physical, &mut properties);
        }
        let needed = vk::SubgroupFeatureFlags::BASIC
            | vk::SubgroupFeatureFlags::BALLOT
            | vk::SubgroupFeatureFlags::VOTE;
        subgroup.subgroup_size >= 8
            && subgroup.supported_operations.contains(needed)
            && subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
    }

    /// Features of optimally tiled images of a format.
    pub(crate) fn image_features(&self, format: vk::Format) -> vk::FormatFeatureFlags {
        let instance = &self.inner.instance.raw;
        // SAFETY: the physical device belongs to this instance.
        let properties =
            unsafe { instance.get_physical_device_format_properties(self.inner.physical, format) };
        properties.optimal_tiling_features
    }

    pub(crate) fn device(&self) -> &ash::Device {
        &self.inner.device
    }

    /// The allocator; `None` only while the device is being destroyed.
    pub(crate) fn allocator(&self) -> MutexGuard<'_, Option<Allocator>> {
        self.inner.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn pipeline_table(&self) -> MutexGuard<'_, HashMap<PipelineKey, Arc<Pipeline>>> {
        self.inner.pipelines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The sampler of a filter, clamped to the edge, that blends mip levels or knows only the first; made on
    /// first use.
    pub(crate) fn sampler(&self, filter: vk::Filter, mips: bool) -> Result<vk::Sampler> {
        let mut samplers = self.inner.samplers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(&sampler) = samplers.get(&(filter, mips)) {
            return Ok(sampler);
        }
        let clamp = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(filter)
            .min_filter(filter)
            .address_mode_u(clamp)
            .address_mode_v(clamp)
            .address_mode_w(clamp)
            .mipmap_mode(if mips { vk::SamplerMipmapMode::LINEAR } else { vk::SamplerMipmapMode::NEAREST })
            .max_lod(if mips { vk::LOD_CLAMP_NONE } else { 0.0 });
        // SAFETY: the device is alive; `info` points at nothing.
        let sampler = unsafe { self.device().create_sampler(&info, None) }
            .map_err(|result| self.failed("vkCreateSampler", result))?;
        samplers.insert((filter, mips), sampler);
        let name = match (filter, mips) {
            (vk::Filter::LINEAR, true) => "mip sampler",
            (vk::Filter::LINEAR, false) => "linear sampler",
            _ => "nearest sampler",
        };
        self.name(sampler, name);
        Ok(sampler)
    }

    /// Gives an object its debug name, where the device takes names.
    pub(crate) fn name<H: vk::Handle>(&self, handle: H, name: &str) {
        let Some(debug) = &self.inner.debug else { return };
        let name = c_name(name);
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
        // SAFETY: the handle was made from this device and is not used by another thread yet. A failure
        // (out of host memory) loses a name, nothing else.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }

    pub(crate) fn debug(&self) -> Option<&ext::debug_utils::Device> {
        self.inner.debug.as_ref()
    }

    /// Vulkan version of the device.
    #[must_use]
    pub fn api_version(&self) -> String {
        version_text(self.inner.properties.api_version)
    }

    /// Writes the pipeline cache to disk, where there is one. Also done when the last clone goes.
    pub fn save_pipeline_cache(&self) {
        self.inner.save_cache();
    }
}

impl Inner {
    fn save_cache(&self) {
        let Some(file) = &self.cache_file else { return };
        // SAFETY: the cache was made from this device and is not null: `open` returns otherwise.
        if let Ok(data) = unsafe { self.device.get_pipeline_cache_data(self.cache) } {
            file.store(&data);
        }
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        // Nothing of this crate is pending: a submission holds the `Gpu` until it has ended. The caller's queues are not
        // this crate's to wait for.
        if self.owned {
            // SAFETY: the device is alive. Its loss leaves nothing to wait for.
            let _ = unsafe { self.device.device_wait_idle() };
        }
        if self.cache != vk::PipelineCache::null() {
            self.save_cache();
        }
        for pipeline in self.pipelines.get_mut().unwrap_or_else(PoisonError::into_inner).values() {
            pipeline.destroy(&self.device);
        }
        for &sampler in self.samplers.get_mut().unwrap_or_else(PoisonError::into_inner).values() {
            // SAFETY: made from this device; the queue is idle and every descriptor set is gone, since
            // each holds the `Gpu`.
            unsafe { self.device.destroy_sampler(sampler, None) };
        }
        // SAFETY: made from this device, or null; no pipeline is being built.
        unsafe { self.device.destroy_pipeline_cache(self.cache, None) };
        // The allocator frees its blocks of memory before the device goes.
        drop(self.allocator.get_mut().unwrap_or_else(PoisonError::into_inner).take());
        if self.owned {
            // SAFETY: every object made from the device holds a `Gpu` and is gone, or was destroyed above.
            unsafe { self.device.destroy_device(None) };
        }
    }
}

/// Most bytes that the driver allocates at once.
fn largest_allocation(instance: &Instance, physical: vk::PhysicalDevice) -> u64 {
    let mut maintenance = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut maintenance);
    // SAFETY: `physical` belongs to this instance; the chained structure is core since 1.1.
    unsafe { instance.raw.get_physical_device_properties2(physical, &mut properties) };
    maintenance.max_memory_allocation_size
}

/// Memory to work with: what the driver says is free in the largest device-local heap, else nine
/// tenths of that heap.
fn free_memory(instance: &Instance, physical: vk::PhysicalDevice, extension: bool) -> u64 {
    let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
    let mut properties = vk::PhysicalDeviceMemoryProperties2::default();
    if extension {
        properties = properties.push_next(&mut budget);
    }
    // SAFETY: `physical` belongs to this instance; the chained structure's extension is present.
    unsafe { instance.raw.get_physical_device_memory_properties2(physical, &mut properties) };
    let heaps = properties.memory_properties.memory_heaps_as_slice().to_vec();
    let local = |flags: vk::MemoryHeapFlags| flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL);
    let best = (0..heaps.len()).filter(|&i| local(heaps[i].flags)).max_by_key(|&i| heaps[i].size);
    let Some(i) = best else { return 0 };
    let share = heaps[i].size / 10 * 9;
    if extension && budget.heap_budget[i] > 0 {
        share.min(budget.heap_budget[i].saturating_sub(budget.heap_usage[i]))
    } else {
        share
    }
}
