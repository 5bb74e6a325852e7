//! The calls that may fail, and the functions that stand in for them.

use std::ffi::{c_char, c_void};
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;
use ash::vk::Handle as _;

use super::injection::{Info, Injection, LOST};

const HOST: vk::Result = vk::Result::ERROR_OUT_OF_HOST_MEMORY;
const DEVICE: vk::Result = vk::Result::ERROR_OUT_OF_DEVICE_MEMORY;
const INIT: vk::Result = vk::Result::ERROR_INITIALIZATION_FAILED;
const LAYER: vk::Result = vk::Result::ERROR_LAYER_NOT_PRESENT;
const EXTENSION: vk::Result = vk::Result::ERROR_EXTENSION_NOT_PRESENT;
const FEATURE: vk::Result = vk::Result::ERROR_FEATURE_NOT_PRESENT;
const DRIVER: vk::Result = vk::Result::ERROR_INCOMPATIBLE_DRIVER;
const MANY: vk::Result = vk::Result::ERROR_TOO_MANY_OBJECTS;
const FORMAT: vk::Result = vk::Result::ERROR_FORMAT_NOT_SUPPORTED;
const MAP: vk::Result = vk::Result::ERROR_MEMORY_MAP_FAILED;
const FRAGMENTED: vk::Result = vk::Result::ERROR_FRAGMENTED_POOL;
const POOL: vk::Result = vk::Result::ERROR_OUT_OF_POOL_MEMORY;
const FRAGMENTATION: vk::Result = vk::Result::ERROR_FRAGMENTATION;

/// Number of instances that can be hooked at the same time.
pub(super) const SLOTS: usize = 8;

/// The slot of a hooked instance.
pub(super) struct Slot {
    injection: Mutex<Option<Injection>>,
    /// The loader's own `vkGetInstanceProcAddr` and `vkGetDeviceProcAddr`.
    pub(super) instance_proc: AtomicPtr<c_void>,
    pub(super) device_proc: AtomicPtr<c_void>,
    /// The device whose entry points were requested last.
    pub(super) device: AtomicU64,
    /// Held while a queue is used; waiting for the device uses all queues.
    queue: Mutex<()>,
    /// The real entry points.
    pub(super) real: [AtomicPtr<c_void>; CALLS.len()],
}

impl Slot {
    const fn new() -> Self {
        Self {
            injection: Mutex::new(None),
            instance_proc: AtomicPtr::new(std::ptr::null_mut()),
            device_proc: AtomicPtr::new(std::ptr::null_mut()),
            device: AtomicU64::new(0),
            queue: Mutex::new(()),
            real: [const { AtomicPtr::new(std::ptr::null_mut()) }; CALLS.len()],
        }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Option<Injection>> {
        self.injection.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Locks the queues for a call that uses one.
    fn alone(&self, call: Call) -> Option<MutexGuard<'_, ()>> {
        let name = CALLS[call as usize].name;
        let uses = name.starts_with("vkQueue") || name == "vkDeviceWaitIdle";
        uses.then(|| self.queue.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Counts a call, and returns the error with which it fails. `alone` says that this thread holds the lock of the queues.
    fn enter(&self, call: Call, alone: bool) -> Option<vk::Result> {
        let injection = self.lock().clone()?;
        let (error, loses) = injection.enter(&CALLS[call as usize])?;
        if loses {
            let _alone = if alone { None } else { self.alone(Call::device_wait_idle) };
            self.drain();
        }
        Some(error)
    }

    /// Waits for pending work, since nothing runs on a lost device. This thread holds the lock of the queues.
    fn drain(&self) {
        let wait = self.real[Call::device_wait_idle as usize].load(Ordering::Acquire);
        let device = vk::Device::from_raw(self.device.load(Ordering::Acquire));
        if wait.is_null() || device == vk::Device::null() {
            return;
        }
        // SAFETY: the pointer was returned for this name, so it is a function of this type.
        let wait = unsafe { std::mem::transmute::<*mut c_void, vk::PFN_vkDeviceWaitIdle>(wait) };
        // SAFETY: the device is alive, as one of its functions has been called; its queues are this thread's.
        let _ = unsafe { wait(device) };
    }
}

pub(super) static TABLE: [Slot; SLOTS] = [const { Slot::new() }; SLOTS];

/// Declares the calls: index, name and errors of each, and the function that stands in for it. The block after `fails` runs
/// when the call fails.
macro_rules! calls {
    ($($call:ident $name:literal $pfn:ident($($arg:ident: $ty:ty),*) [$($error:ident)*] $(fails $fails:block)?;)*) => {
        #[derive(Clone, Copy)]
        #[expect(non_camel_case_types, reason = "one name for a call and its function")]
        enum Call { $($call),* }

        pub(super) const CALLS: [Info; [$($name),*].len()] = [$(Info { name: $name, errors: &[$($error),*] }),*];

        mod stand_in {
            use super::{Call, Ordering, TABLE, c_char, c_void, vk};

            $(pub(super) unsafe extern "system" fn $call<const SLOT: usize>($($arg: $ty),*) -> vk::Result {
                let slot = &TABLE[SLOT];
                let alone = slot.alone(Call::$call);
                if let Some(error) = slot.enter(Call::$call, alone.is_some()) {
                    $($fails)?
                    return error;
                }
                let real = slot.real[Call::$call as usize].load(Ordering::Acquire);
                // SAFETY: stored before this function was handed out, and returned for this name, so it is a function of
                // this type.
                let real = unsafe { std::mem::transmute::<*mut c_void, vk::$pfn>(real) };
                // SAFETY: the caller meets the contract of the call, which is the same.
                unsafe { real($($arg),*) }
            })*
        }

        /// Returns the functions of a slot, in the order of [`CALLS`].
        pub(super) fn functions<const SLOT: usize>() -> [*const c_void; CALLS.len()] {
            [$({
                let function: vk::$pfn = stand_in::$call::<SLOT>;
                function as *const c_void
            }),*]
        }
    };
}

/// Writes null handles, which Vulkan requires of some calls that fail.
macro_rules! nulls {
    ($array:ident, $count:expr) => {
        for i in 0..crate::num::index($count) {
            // SAFETY: the caller's array has that many handles.
            let handle = unsafe { $array.add(i) };
            // SAFETY: as above.
            unsafe { handle.write(Default::default()) };
        }
    };
}

calls! {
    create_instance "vkCreateInstance" PFN_vkCreateInstance(p_create_info: *const vk::InstanceCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_instance: *mut vk::Instance) [HOST DEVICE INIT LAYER EXTENSION DRIVER];
    enumerate_instance_extension_properties "vkEnumerateInstanceExtensionProperties" PFN_vkEnumerateInstanceExtensionProperties(p_layer_name: *const c_char, p_property_count: *mut u32, p_properties: *mut vk::ExtensionProperties) [HOST DEVICE LAYER];
    enumerate_instance_layer_properties "vkEnumerateInstanceLayerProperties" PFN_vkEnumerateInstanceLayerProperties(p_property_count: *mut u32, p_properties: *mut vk::LayerProperties) [HOST DEVICE];
    enumerate_instance_version "vkEnumerateInstanceVersion" PFN_vkEnumerateInstanceVersion(p_api_version: *mut u32) [HOST];
    create_debug_utils_messenger "vkCreateDebugUtilsMessengerEXT" PFN_vkCreateDebugUtilsMessengerEXT(instance: vk::Instance, p_create_info: *const vk::DebugUtilsMessengerCreateInfoEXT<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_messenger: *mut vk::DebugUtilsMessengerEXT) [HOST];
    enumerate_physical_devices "vkEnumeratePhysicalDevices" PFN_vkEnumeratePhysicalDevices(instance: vk::Instance, p_physical_device_count: *mut u32, p_physical_devices: *mut vk::PhysicalDevice) [HOST DEVICE INIT];
    enumerate_physical_device_groups "vkEnumeratePhysicalDeviceGroups" PFN_vkEnumeratePhysicalDeviceGroups(instance: vk::Instance, p_group_count: *mut u32, p_groups: *mut vk::PhysicalDeviceGroupProperties<'_>) [HOST DEVICE INIT];
    get_image_format_properties "vkGetPhysicalDeviceImageFormatProperties" PFN_vkGetPhysicalDeviceImageFormatProperties(physical_device: vk::PhysicalDevice, format: vk::Format, ty: vk::ImageType, tiling: vk::ImageTiling, usage: vk::ImageUsageFlags, flags: vk::ImageCreateFlags, p_properties: *mut vk::ImageFormatProperties) [HOST DEVICE FORMAT];
    get_image_format_properties2 "vkGetPhysicalDeviceImageFormatProperties2" PFN_vkGetPhysicalDeviceImageFormatProperties2(physical_device: vk::PhysicalDevice, p_info: *const vk::PhysicalDeviceImageFormatInfo2<'_>, p_properties: *mut vk::ImageFormatProperties2<'_>) [HOST DEVICE FORMAT];
    get_tool_properties "vkGetPhysicalDeviceToolProperties" PFN_vkGetPhysicalDeviceToolProperties(physical_device: vk::PhysicalDevice, p_tool_count: *mut u32, p_tools: *mut vk::PhysicalDeviceToolProperties<'_>) [HOST];
    enumerate_device_extension_properties "vkEnumerateDeviceExtensionProperties" PFN_vkEnumerateDeviceExtensionProperties(physical_device: vk::PhysicalDevice, p_layer_name: *const c_char, p_property_count: *mut u32, p_properties: *mut vk::ExtensionProperties) [HOST DEVICE LAYER];
    enumerate_device_layer_properties "vkEnumerateDeviceLayerProperties" PFN_vkEnumerateDeviceLayerProperties(physical_device: vk::PhysicalDevice, p_property_count: *mut u32, p_properties: *mut vk::LayerProperties) [HOST DEVICE];
    create_device "vkCreateDevice" PFN_vkCreateDevice(physical_device: vk::PhysicalDevice, p_create_info: *const vk::DeviceCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_device: *mut vk::Device) [HOST DEVICE INIT EXTENSION FEATURE MANY LOST];
    queue_submit "vkQueueSubmit" PFN_vkQueueSubmit(queue: vk::Queue, submit_count: u32, p_submits: *const vk::SubmitInfo<'_>, fence: vk::Fence) [HOST DEVICE LOST];
    queue_submit2 "vkQueueSubmit2" PFN_vkQueueSubmit2(queue: vk::Queue, submit_count: u32, p_submits: *const vk::SubmitInfo2<'_>, fence: vk::Fence) [HOST DEVICE LOST];
    queue_bind_sparse "vkQueueBindSparse" PFN_vkQueueBindSparse(queue: vk::Queue, bind_info_count: u32, p_bind_info: *const vk::BindSparseInfo<'_>, fence: vk::Fence) [HOST DEVICE LOST];
    queue_wait_idle "vkQueueWaitIdle" PFN_vkQueueWaitIdle(queue: vk::Queue) [HOST DEVICE LOST];
    device_wait_idle "vkDeviceWaitIdle" PFN_vkDeviceWaitIdle(device: vk::Device) [HOST DEVICE LOST];
    allocate_memory "vkAllocateMemory" PFN_vkAllocateMemory(device: vk::Device, p_allocate_info: *const vk::MemoryAllocateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_memory: *mut vk::DeviceMemory) [DEVICE HOST MANY];
    map_memory "vkMapMemory" PFN_vkMapMemory(device: vk::Device, memory: vk::DeviceMemory, offset: vk::DeviceSize, size: vk::DeviceSize, flags: vk::MemoryMapFlags, pp_data: *mut *mut c_void) [HOST DEVICE MAP];
    flush_memory "vkFlushMappedMemoryRanges" PFN_vkFlushMappedMemoryRanges(device: vk::Device, range_count: u32, p_ranges: *const vk::MappedMemoryRange<'_>) [HOST DEVICE];
    invalidate_memory "vkInvalidateMappedMemoryRanges" PFN_vkInvalidateMappedMemoryRanges(device: vk::Device, range_count: u32, p_ranges: *const vk::MappedMemoryRange<'_>) [HOST DEVICE];
    bind_buffer_memory "vkBindBufferMemory" PFN_vkBindBufferMemory(device: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: vk::DeviceSize) [HOST DEVICE];
    bind_buffer_memory2 "vkBindBufferMemory2" PFN_vkBindBufferMemory2(device: vk::Device, count: u32, p_infos: *const vk::BindBufferMemoryInfo<'_>) [HOST DEVICE];
    bind_image_memory "vkBindImageMemory" PFN_vkBindImageMemory(device: vk::Device, image: vk::Image, memory: vk::DeviceMemory, offset: vk::DeviceSize) [HOST DEVICE];
    bind_image_memory2 "vkBindImageMemory2" PFN_vkBindImageMemory2(device: vk::Device, count: u32, p_infos: *const vk::BindImageMemoryInfo<'_>) [HOST DEVICE];
    create_fence "vkCreateFence" PFN_vkCreateFence(device: vk::Device, p_create_info: *const vk::FenceCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_fence: *mut vk::Fence) [HOST DEVICE];
    reset_fences "vkResetFences" PFN_vkResetFences(device: vk::Device, fence_count: u32, p_fences: *const vk::Fence) [DEVICE];
    get_fence_status "vkGetFenceStatus" PFN_vkGetFenceStatus(device: vk::Device, fence: vk::Fence) [HOST DEVICE LOST];
    wait_for_fences "vkWaitForFences" PFN_vkWaitForFences(device: vk::Device, fence_count: u32, p_fences: *const vk::Fence, wait_all: vk::Bool32, timeout: u64) [HOST DEVICE LOST];
    create_semaphore "vkCreateSemaphore" PFN_vkCreateSemaphore(device: vk::Device, p_create_info: *const vk::SemaphoreCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_semaphore: *mut vk::Semaphore) [HOST DEVICE];
    get_semaphore_counter_value "vkGetSemaphoreCounterValue" PFN_vkGetSemaphoreCounterValue(device: vk::Device, semaphore: vk::Semaphore, p_value: *mut u64) [HOST DEVICE LOST];
    wait_semaphores "vkWaitSemaphores" PFN_vkWaitSemaphores(device: vk::Device, p_wait_info: *const vk::SemaphoreWaitInfo<'_>, timeout: u64) [HOST DEVICE LOST];
    signal_semaphore "vkSignalSemaphore" PFN_vkSignalSemaphore(device: vk::Device, p_signal_info: *const vk::SemaphoreSignalInfo<'_>) [HOST DEVICE];
    create_event "vkCreateEvent" PFN_vkCreateEvent(device: vk::Device, p_create_info: *const vk::EventCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_event: *mut vk::Event) [HOST DEVICE];
    get_event_status "vkGetEventStatus" PFN_vkGetEventStatus(device: vk::Device, event: vk::Event) [HOST DEVICE LOST];
    set_event "vkSetEvent" PFN_vkSetEvent(device: vk::Device, event: vk::Event) [HOST DEVICE];
    reset_event "vkResetEvent" PFN_vkResetEvent(device: vk::Device, event: vk::Event) [DEVICE];
    create_query_pool "vkCreateQueryPool" PFN_vkCreateQueryPool(device: vk::Device, p_create_info: *const vk::QueryPoolCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_query_pool: *mut vk::QueryPool) [HOST DEVICE];
    get_query_pool_results "vkGetQueryPoolResults" PFN_vkGetQueryPoolResults(device: vk::Device, query_pool: vk::QueryPool, first_query: u32, query_count: u32, data_size: usize, p_data: *mut c_void, stride: vk::DeviceSize, flags: vk::QueryResultFlags) [HOST DEVICE LOST];
    create_buffer "vkCreateBuffer" PFN_vkCreateBuffer(device: vk::Device, p_create_info: *const vk::BufferCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_buffer: *mut vk::Buffer) [HOST DEVICE];
    create_buffer_view "vkCreateBufferView" PFN_vkCreateBufferView(device: vk::Device, p_create_info: *const vk::BufferViewCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_view: *mut vk::BufferView) [HOST DEVICE];
    create_image "vkCreateImage" PFN_vkCreateImage(device: vk::Device, p_create_info: *const vk::ImageCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_image: *mut vk::Image) [HOST DEVICE];
    create_image_view "vkCreateImageView" PFN_vkCreateImageView(device: vk::Device, p_create_info: *const vk::ImageViewCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_view: *mut vk::ImageView) [HOST DEVICE];
    create_shader_module "vkCreateShaderModule" PFN_vkCreateShaderModule(device: vk::Device, p_create_info: *const vk::ShaderModuleCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_module: *mut vk::ShaderModule) [HOST DEVICE];
    create_pipeline_cache "vkCreatePipelineCache" PFN_vkCreatePipelineCache(device: vk::Device, p_create_info: *const vk::PipelineCacheCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_cache: *mut vk::PipelineCache) [HOST DEVICE];
    get_pipeline_cache_data "vkGetPipelineCacheData" PFN_vkGetPipelineCacheData(device: vk::Device, cache: vk::PipelineCache, p_data_size: *mut usize, p_data: *mut c_void) [HOST DEVICE];
    merge_pipeline_caches "vkMergePipelineCaches" PFN_vkMergePipelineCaches(device: vk::Device, cache: vk::PipelineCache, count: u32, p_caches: *const vk::PipelineCache) [HOST DEVICE];
    create_graphics_pipelines "vkCreateGraphicsPipelines" PFN_vkCreateGraphicsPipelines(device: vk::Device, cache: vk::PipelineCache, count: u32, p_create_infos: *const vk::GraphicsPipelineCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_pipelines: *mut vk::Pipeline) [HOST DEVICE] fails { nulls!(p_pipelines, count); };
    create_compute_pipelines "vkCreateComputePipelines" PFN_vkCreateComputePipelines(device: vk::Device, cache: vk::PipelineCache, count: u32, p_create_infos: *const vk::ComputePipelineCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_pipelines: *mut vk::Pipeline) [HOST DEVICE] fails { nulls!(p_pipelines, count); };
    get_executable_properties "vkGetPipelineExecutablePropertiesKHR" PFN_vkGetPipelineExecutablePropertiesKHR(device: vk::Device, p_info: *const vk::PipelineInfoKHR<'_>, p_count: *mut u32, p_properties: *mut vk::PipelineExecutablePropertiesKHR<'_>) [HOST DEVICE];
    get_executable_statistics "vkGetPipelineExecutableStatisticsKHR" PFN_vkGetPipelineExecutableStatisticsKHR(device: vk::Device, p_info: *const vk::PipelineExecutableInfoKHR<'_>, p_count: *mut u32, p_statistics: *mut vk::PipelineExecutableStatisticKHR<'_>) [HOST DEVICE];
    create_pipeline_layout "vkCreatePipelineLayout" PFN_vkCreatePipelineLayout(device: vk::Device, p_create_info: *const vk::PipelineLayoutCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_layout: *mut vk::PipelineLayout) [HOST DEVICE];
    create_sampler "vkCreateSampler" PFN_vkCreateSampler(device: vk::Device, p_create_info: *const vk::SamplerCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_sampler: *mut vk::Sampler) [HOST DEVICE MANY];
    create_ycbcr_conversion "vkCreateSamplerYcbcrConversion" PFN_vkCreateSamplerYcbcrConversion(device: vk::Device, p_create_info: *const vk::SamplerYcbcrConversionCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_conversion: *mut vk::SamplerYcbcrConversion) [HOST DEVICE];
    create_descriptor_set_layout "vkCreateDescriptorSetLayout" PFN_vkCreateDescriptorSetLayout(device: vk::Device, p_create_info: *const vk::DescriptorSetLayoutCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_layout: *mut vk::DescriptorSetLayout) [HOST DEVICE];
    create_descriptor_pool "vkCreateDescriptorPool" PFN_vkCreateDescriptorPool(device: vk::Device, p_create_info: *const vk::DescriptorPoolCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_pool: *mut vk::DescriptorPool) [HOST DEVICE FRAGMENTATION];
    allocate_descriptor_sets "vkAllocateDescriptorSets" PFN_vkAllocateDescriptorSets(device: vk::Device, p_info: *const vk::DescriptorSetAllocateInfo<'_>, p_sets: *mut vk::DescriptorSet) [HOST DEVICE FRAGMENTED POOL] fails {
        // SAFETY: the caller gave a valid structure.
        let count = unsafe { (*p_info).descriptor_set_count };
        nulls!(p_sets, count);
    };
    create_descriptor_update_template "vkCreateDescriptorUpdateTemplate" PFN_vkCreateDescriptorUpdateTemplate(device: vk::Device, p_create_info: *const vk::DescriptorUpdateTemplateCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_template: *mut vk::DescriptorUpdateTemplate) [HOST DEVICE];
    create_framebuffer "vkCreateFramebuffer" PFN_vkCreateFramebuffer(device: vk::Device, p_create_info: *const vk::FramebufferCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_framebuffer: *mut vk::Framebuffer) [HOST DEVICE];
    create_render_pass "vkCreateRenderPass" PFN_vkCreateRenderPass(device: vk::Device, p_create_info: *const vk::RenderPassCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_pass: *mut vk::RenderPass) [HOST DEVICE];
    create_render_pass2 "vkCreateRenderPass2" PFN_vkCreateRenderPass2(device: vk::Device, p_create_info: *const vk::RenderPassCreateInfo2<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_pass: *mut vk::RenderPass) [HOST DEVICE];
    create_command_pool "vkCreateCommandPool" PFN_vkCreateCommandPool(device: vk::Device, p_create_info: *const vk::CommandPoolCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_pool: *mut vk::CommandPool) [HOST DEVICE];
    reset_command_pool "vkResetCommandPool" PFN_vkResetCommandPool(device: vk::Device, pool: vk::CommandPool, flags: vk::CommandPoolResetFlags) [DEVICE];
    allocate_command_buffers "vkAllocateCommandBuffers" PFN_vkAllocateCommandBuffers(device: vk::Device, p_info: *const vk::CommandBufferAllocateInfo<'_>, p_buffers: *mut vk::CommandBuffer) [HOST DEVICE] fails {
        // SAFETY: the caller gave a valid structure.
        let count = unsafe { (*p_info).command_buffer_count };
        nulls!(p_buffers, count);
    };
    begin_command_buffer "vkBeginCommandBuffer" PFN_vkBeginCommandBuffer(buffer: vk::CommandBuffer, p_info: *const vk::CommandBufferBeginInfo<'_>) [HOST DEVICE];
    end_command_buffer "vkEndCommandBuffer" PFN_vkEndCommandBuffer(buffer: vk::CommandBuffer) [HOST DEVICE];
    reset_command_buffer "vkResetCommandBuffer" PFN_vkResetCommandBuffer(buffer: vk::CommandBuffer, flags: vk::CommandBufferResetFlags) [DEVICE];
    create_private_data_slot "vkCreatePrivateDataSlot" PFN_vkCreatePrivateDataSlot(device: vk::Device, p_create_info: *const vk::PrivateDataSlotCreateInfo<'_>, p_allocator: *const vk::AllocationCallbacks<'_>, p_slot: *mut vk::PrivateDataSlot) [HOST];
    set_private_data "vkSetPrivateData" PFN_vkSetPrivateData(device: vk::Device, ty: vk::ObjectType, object: u64, slot: vk::PrivateDataSlot, data: u64) [HOST];
    set_object_name "vkSetDebugUtilsObjectNameEXT" PFN_vkSetDebugUtilsObjectNameEXT(device: vk::Device, p_info: *const vk::DebugUtilsObjectNameInfoEXT<'_>) [HOST DEVICE];
}

impl Injection {
    /// Returns whether Vulkan allows a call to report a lost device; `false` for unknown names.
    #[must_use]
    pub fn tells_of_loss(call: &str) -> bool {
        CALLS.iter().any(|info| info.name == call && info.errors.contains(&LOST))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(name: &str) -> &'static Info {
        CALLS.iter().find(|info| info.name == name).unwrap_or_else(|| panic!("{name}"))
    }

    fn result(injection: &Injection, name: &str) -> Option<vk::Result> {
        injection.enter(info(name)).map(|(error, _)| error)
    }

    /// Reported calls are named by string literals of `src/gpu`. Tests of failures have no display, and so no surface.
    #[test]
    fn every_call_whose_failure_is_reported_can_be_made_to_fail() {
        let room = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/gpu");
        for file in std::fs::read_dir(room).unwrap().map(|entry| entry.unwrap().path()) {
            if file.ends_with("surface.rs") {
                continue;
            }
            let text = std::fs::read_to_string(&file).unwrap_or_default();
            for (at, _) in text.match_indices("\"vk").filter(|(at, _)| !text[..*at].ends_with('c')) {
                info(text[at + 1..].split('"').next().unwrap());
            }
        }
    }

    #[test]
    fn one_call_fails_with_an_error_that_it_may_return() {
        let injection = Injection::new();
        injection.fail_at(2, POOL);
        assert_eq!(result(&injection, "vkAllocateDescriptorSets"), None);
        assert_eq!(result(&injection, "vkAllocateDescriptorSets"), Some(POOL));
        assert_eq!(result(&injection, "vkAllocateDescriptorSets"), None);
        assert_eq!((injection.calls(), injection.failures()), (3, 1));
        injection.rewind();
        injection.fail_at(1, POOL);
        assert_eq!(result(&injection, "vkResetFences"), Some(DEVICE));
        assert_eq!(injection.last_failed(), Some("vkResetFences"));
        assert_eq!(injection.last_result(), Some(DEVICE));
    }

    #[test]
    fn a_loss_stays_and_only_what_can_tell_of_it_does() {
        let injection = Injection::new();
        injection.keep_names(true);
        injection.fail_at(2, LOST);
        assert_eq!(result(&injection, "vkQueueSubmit2"), None);
        assert_eq!(result(&injection, "vkCreateBuffer"), None);
        for call in ["vkQueueSubmit2", "vkWaitForFences", "vkDeviceWaitIdle", "vkGetQueryPoolResults"] {
            assert!(Injection::tells_of_loss(call));
            assert_eq!(result(&injection, call), Some(LOST), "{call}");
        }
        assert_eq!(result(&injection, "vkCreateBuffer"), None);
        assert_eq!(injection.names()[..2], ["vkQueueSubmit2", "vkCreateBuffer"]);
        injection.rewind();
        assert_eq!(result(&injection, "vkQueueSubmit2"), None);
        assert!(!Injection::tells_of_loss("vkCreateBuffer"));
    }
}
