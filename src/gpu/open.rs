//! Opening a device: choosing a physical device, creating the logical device and the objects that exist once per device.

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, OnceLock};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use super::budget::Budget;
use super::cache::{PipelineCacheFile, user_cache_folder};
use super::device::{Gpu, Inner, LossNote};
use super::feature::{Enabled, OptionalFeature};
use super::instance::Instance;
use super::options::{GpuOptions, PipelineCache};
use super::queue::Queue;
use super::select::{self, Candidate, DeviceReport};
use super::statistics;
use crate::error::{Error, Result};

/// Default size of the staging memory of an upload; larger data takes several submissions.
const STAGING_BYTES: u64 = 32 << 20;

/// Smallest block of memory that the allocator requests from the driver.
const BLOCK_BYTES: u64 = 4 << 20;

/// An open device, made by the crate or by the caller.
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

/// Reports every device of the system without opening one. `wanted` is as [`GpuOptions::device`].
///
/// # Errors
///
/// [`Error::NoDevice`] without a Vulkan loader, [`Error::Vulkan`] when enumeration fails.
pub fn devices(wanted: Option<&str>) -> Result<Vec<DeviceReport>> {
    let instance = Instance::new(&GpuOptions::default())?;
    let wanted = wanted_name(wanted);
    let (_, candidates) = select::survey(&instance, wanted.as_deref(), 0)?;
    Ok(candidates.into_iter().map(|candidate| candidate.report).collect())
}

fn wanted_name(option: Option<&str>) -> Option<String> {
    let from_environment = || std::env::var("VOLRASTER_DEVICE").ok().filter(|name| !name.is_empty());
    option.map(str::to_string).or_else(from_environment)
}

impl Gpu {
    /// Opens the best device with default options, without a window. [`GpuOptions::device`] says how it is chosen.
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
    /// [`Error::Invalid`] for [`PipelineCache::Caller`] and memory or callbacks of the caller,
    /// [`Error::NoDevice`] without a loader or a qualifying device (with the reason for each),
    /// [`Error::Unsupported`] when validation is requested and its layer is missing,
    /// [`Error::Vulkan`] when a call fails.
    pub fn new(options: &GpuOptions) -> Result<Self> {
        if options.memory.is_some() || options.allocation_callbacks.is_some() {
            let why = "are for a device of the caller, Gpu::from_raw";
            return Err(Error::invalid("memory and allocation_callbacks", why));
        }
        if let PipelineCache::Caller(_) = options.pipeline_cache {
            let why = "a cache of the caller belongs to the caller's device: see Gpu::from_raw";
            return Err(Error::invalid("pipeline_cache", why));
        }
        let instance = Instance::new(options)?;
        let wanted = wanted_name(options.device.as_deref());
        let (best, mut candidates) = select::survey(&instance, wanted.as_deref(), options.nth)?;
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
        let candidate = candidates.swap_remove(best);
        let physical = candidate.raw;
        // SAFETY: `physical` was enumerated from this instance; only devices for Vulkan 1.3 are chosen.
        let enabled = unsafe {
            Enabled::for_own(&instance.raw, physical, options.presents().is_some(), &options.without)
        }?;
        let mut names: Vec<_> = enabled.extensions.iter().map(|name| name.as_ptr()).collect();
        let mut statistics = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
        if options.shader_statistics {
            // SAFETY: `physical` was enumerated from this instance.
            unsafe { statistics::check(&instance.raw, physical) }?;
            names.push(khr::pipeline_executable_properties::NAME.as_ptr());
            statistics.pipeline_executable_info = vk::TRUE;
        }
        if options.presents().is_some() {
            names.push(khr::swapchain::NAME.as_ptr());
        }
        let mut features = enabled.features();
        // GPU-assisted validation makes every stage write.
        if options.validation.gpu_assisted() {
            // SAFETY: `physical` was enumerated from this instance.
            let available = unsafe { instance.raw.get_physical_device_features(physical) };
            features.vertex_pipeline_stores_and_atomics = available.vertex_pipeline_stores_and_atomics;
        }
        let mut structures = enabled.structures();
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(candidate.queue_family)
            .queue_priorities(&priorities)];
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names)
            .enabled_features(&features);
        let mut info = structures.chain(info);
        // Vulkan requires the feature of every device with the extension, and layers that add the extension do not report it.
        let mut marks = vk::PhysicalDeviceFrameBoundaryFeaturesEXT::default().frame_boundary(true);
        if enabled.has(ext::frame_boundary::NAME) {
            info = info.push_next(&mut marks);
        }
        if options.shader_statistics {
            info = info.push_next(&mut statistics);
        }
        // SAFETY: the pointers in `info` refer to locals; extensions and features were found present.
        let device =
            unsafe { instance.raw.create_device(physical, &info, None) }.map_err(|result| match result {
                vk::Result::ERROR_EXTENSION_NOT_PRESENT if let Some(what) = options.presents() => {
                    Error::unsupported(what, "VK_KHR_swapchain")
                }
                _ => Error::vulkan("vkCreateDevice", result),
            })?;
        // SAFETY: the device was created with one queue of this family.
        let queue = unsafe { device.get_device_queue(candidate.queue_family, 0) };
        let queue = Queue::new(queue, None);
        Self::assemble(options, Opened { instance, device, candidate, enabled, queue, reports, owned: true })
    }

    /// Makes a [`Gpu`] of an open device: pipeline cache, allocator, budget and limits.
    pub(super) fn assemble(options: &GpuOptions, opened: Opened) -> Result<Self> {
        let Opened { instance, device, mut candidate, enabled, queue, reports, owned } = opened;
        let physical = candidate.raw;
        let named = instance.debug_utils && !options.without.contains(&OptionalFeature::DebugNames);
        let debug = named.then(|| ext::debug_utils::Device::new(&instance.raw, &device));
        let statistics = options
            .shader_statistics
            .then(|| khr::pipeline_executable_properties::Device::new(&instance.raw, &device));
        let total = options
            .memory_budget
            .unwrap_or_else(|| free_memory(&instance, physical, enabled.has(ext::memory_budget::NAME)));
        let [granted, buffer] = largest_sizes(&instance, physical);
        let allocation_size = options.allocation_size.unwrap_or(u64::MAX);
        let max_allocation = allocation_size.min(granted);
        let folder = match &options.pipeline_cache {
            PipelineCache::Auto if owned => user_cache_folder(),
            PipelineCache::Folder(folder) => Some(folder.clone()),
            _ => None,
        };
        let cache_file = folder.map(|folder| PipelineCacheFile::new(&folder, &candidate.properties));
        let range = &mut candidate.properties.limits.max_storage_buffer_range;
        *range = options.storage_range.unwrap_or(u32::MAX).min(*range);
        let buffer_device_address = enabled.buffer_device_address;
        let mut inner = Inner {
            device,
            candidate,
            enabled,
            part_by_pass: options.command_buffer_by_pass,
            budget: Budget::new(total),
            max_allocation,
            allocation_size,
            max_buffer: buffer,
            without: options.without.clone(),
            subgroup_size: options.subgroup_size,
            as_hardware: options.as_hardware,
            poison: options.poison,
            emulates_weights: options.emulate_filter_weights,
            permutes: options.permute,
            presents: options.presents().is_some(),
            frames: AtomicU64::new(0),
            statistics,
            cache_file,
            cache: vk::PipelineCache::null(),
            own_cache: true,
            lost: LossNote::default(),
            page_pool: options.page_pool,
            staging_bytes: options.staging_bytes.unwrap_or(STAGING_BYTES).max(1),
            loop_limit: options.loop_limit.map(|limit| limit.max(1).into()).unwrap_or_default(),
            filter_errors: OnceLock::new(),
            pipeline_us: AtomicU64::new(0),
            allocator: Mutex::new(None),
            memory: options.memory.clone(),
            callbacks: options.allocation_callbacks,
            compilation: options.compilation.clone(),
            queue,
            pipelines: Mutex::default(),
            samplers: Mutex::default(),
            debug,
            reports,
            owned,
            instance,
        };
        // From here on `inner` owns everything: an early return destroys it.
        if let PipelineCache::Caller(cache) = options.pipeline_cache {
            (inner.cache, inner.own_cache) = (cache, false);
        } else {
            let data = inner.cache_file.as_ref().and_then(PipelineCacheFile::load).unwrap_or_default();
            let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
            // SAFETY: the data is empty, or this crate wrote it for this device and driver and its hash matches.
            inner.cache = unsafe { inner.device.create_pipeline_cache(&info, inner.host_callbacks()) }
                .map_err(|result| Error::vulkan("vkCreatePipelineCache", result))?;
        }
        if inner.memory.is_none() {
            let allocator = Allocator::new(&AllocatorCreateDesc {
                instance: inner.instance.raw.clone(),
                device: inner.device.clone(),
                physical_device: physical,
                debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
                buffer_device_address,
                // Blocks grow with use, so that a small scene allocates little more than it needs.
                allocation_sizes: gpu_allocator::AllocationSizes::new(BLOCK_BYTES, BLOCK_BYTES)
                    .with_max_device_memblock_size(max_allocation.min(16 * BLOCK_BYTES))
                    .with_max_host_memblock_size(max_allocation.min(16 * BLOCK_BYTES)),
            })
            .map_err(|source| Error::Allocation { object: "allocator".to_string(), source })?;
            inner.allocator = Mutex::new(Some(allocator));
        }
        let gpu = Self { inner: Arc::new(inner) };
        if gpu.inner.own_cache {
            gpu.name(gpu.inner.cache, "pipeline cache");
        }
        Ok(gpu)
    }
}

/// Returns the bytes of one allocation that the driver promises, and the largest buffer.
fn largest_sizes(instance: &Instance, physical: vk::PhysicalDevice) -> [u64; 2] {
    let mut allocation = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut buffer = vk::PhysicalDeviceMaintenance4Properties::default();
    let mut properties =
        vk::PhysicalDeviceProperties2::default().push_next(&mut allocation).push_next(&mut buffer);
    // SAFETY: `physical` belongs to this instance; the chained structures are core in 1.3.
    unsafe { instance.raw.get_physical_device_properties2(physical, &mut properties) };
    [allocation.max_memory_allocation_size, buffer.max_buffer_size]
}

/// Returns the default budget: the free memory that the driver reports for the largest device-local heap, else nine tenths
/// of that heap.
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
