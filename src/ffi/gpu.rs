//! Devices: those that the library opens, those of the caller, and queries of any.

use std::any::Any;
use std::ffi::{CString, c_char, c_void};
use std::sync::Arc;

use ash::vk;

use super::argument::{Caller, Structure, User, check_handle, choice, flag, given};
use super::host::{CallerMemory, compilation, vr_allocate_callback, vr_compile_callback, vr_free_callback};
use super::result::{c_text, call, destroy, make, vr_result};
use super::vulkan::{
    PFN_vkGetInstanceProcAddr, VkAllocationCallbacks, VkBool32, VkDevice, VkDeviceCreateInfo, VkInstance,
    VkPhysicalDevice, VkPipelineCache, VkQueue,
};
use crate::error::Error;
use crate::gpu::{
    AllocationCallbacks, Enabled, Gpu, GpuOptions, GpuParts, MemorySource, PipelineCache, QueueLock,
    Validation,
};
use crate::num;

/// A Vulkan device with the library's objects. It lives until this handle and all handles made from it are destroyed.
#[derive(Debug)]
pub struct vr_gpu {
    pub(super) gpu: Gpu,
    name: CString,
}

impl vr_gpu {
    fn new(gpu: Gpu) -> Self {
        let name = c_text(&gpu.report().name);
        Self { gpu, name }
    }
}

/// Checks of the validation layer on a device that the library opens.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_validation {
    /// The layer is not loaded.
    VR_VALIDATION_OFF = 0,
    /// Core validation and synchronization validation. Messages go to stderr.
    VR_VALIDATION_ON = 1,
    /// As VR_VALIDATION_ON, with GPU-assisted validation.
    VR_VALIDATION_GPU_ASSISTED = 2,
}

/// Options of a device that the library opens. Zeros are the defaults.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_gpu_info {
    /// sizeof(vr_gpu_info).
    pub struct_size: usize,
    /// Part of the device's name; case is ignored. NULL: the environment variable VOLRASTER_DEVICE, else the best device: a
    /// real GPU before a software one.
    pub device: *const c_char,
    /// A vr_validation. A missing layer is an error.
    pub validation: u32,
    /// VK_TRUE keeps no pipelines on disk.
    pub no_pipeline_cache: VkBool32,
    /// Folder of the pipeline cache. NULL: volraster in the user's cache folder.
    pub pipeline_cache_folder: *const c_char,
    /// Limit of device memory, in bytes. 0: the free memory that the driver reports, or nine tenths of the largest
    /// device-local heap.
    pub memory_budget: u64,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_gpu_info {}

/// Receives a queue, which no other thread uses during the call, and the user pointer.
pub type vr_queue_callback = Option<unsafe extern "C" fn(queue: VkQueue, user: *mut c_void)>;

/// The Vulkan objects behind a device.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_gpu_objects {
    /// sizeof(vr_gpu_objects).
    pub struct_size: usize,
    /// The instance.
    pub instance: VkInstance,
    /// The physical device.
    pub physical_device: VkPhysicalDevice,
    /// The device.
    pub device: VkDevice,
    /// The queue. See vr_gpu_with_queue().
    pub queue: VkQueue,
    /// Family of the queue.
    pub queue_family: u32,
}

// SAFETY: repr(C), numbers and handles, the first its size.
unsafe impl Structure for vr_gpu_objects {}

/// Converts the options that opened and adopted devices share.
fn options(pipeline_cache: PipelineCache, budget: u64) -> GpuOptions {
    GpuOptions { pipeline_cache, memory_budget: (budget > 0).then_some(budget), ..GpuOptions::default() }
}

/// Opens a device, without a window. `info` may be NULL, for default options.
///
/// Fails with VR_ERROR_NO_DEVICE, whose message has the reason for each device, VR_ERROR_UNSUPPORTED if the layer of a
/// requested validation is missing, VR_ERROR_VULKAN.
///
/// Threads: any.
///
/// # Safety
///
/// `info` is NULL or valid, and so are its strings; `gpu` is NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_gpu_create(info: *const vr_gpu_info, gpu: *mut *mut vr_gpu) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (gpu, "gpu"), |caller| {
        let info = caller.structure_or_zeros(info, "vr_gpu_info")?;
        let validations = [Validation::Off, Validation::On, Validation::GpuAssisted];
        let folder = caller.path(info.pipeline_cache_folder, "pipeline_cache_folder")?;
        let pipeline_cache = match folder {
            _ if flag(info.no_pipeline_cache, "no_pipeline_cache")? => PipelineCache::Off,
            Some(folder) => PipelineCache::Folder(folder.into()),
            None => PipelineCache::Auto,
        };
        let options = GpuOptions {
            device: caller.text(info.device, "device")?.map(str::to_string),
            validation: choice(info.validation, 0, &validations, "validation")?,
            ..options(pipeline_cache, info.memory_budget)
        };
        Ok(vr_gpu::new(Gpu::new(&options)?))
    })
}

/// Destroys a device's handle; NULL is ignored. The device lives as long as anything that was made from it.
///
/// Threads: any, while no other function uses this handle.
///
/// # Safety
///
/// `gpu` is NULL, or a handle that was not destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_gpu_destroy(gpu: *mut vr_gpu) {
    // SAFETY: the caller's promise.
    unsafe { destroy(gpu) };
}

/// Returns the device's name, valid as long as the handle; NULL for NULL.
///
/// Threads: any.
///
/// # Safety
///
/// `gpu` is NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_gpu_name(gpu: *const vr_gpu) -> *const c_char {
    // SAFETY: the caller's promise.
    unsafe { gpu.as_ref() }.map_or(std::ptr::null(), |gpu| gpu.name.as_ptr())
}

/// Writes the bytes of device memory that the library uses, and its limit. Either pointer may be NULL.
///
/// Threads: any.
///
/// # Safety
///
/// `gpu` is NULL or valid; the others are NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_gpu_memory(gpu: *const vr_gpu, used: *mut u64, budget: *mut u64) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let gpu = &caller.reference(gpu, "gpu")?.gpu;
        if !used.is_null() {
            caller.write(used, gpu.memory_report().iter().map(|(_, bytes)| bytes).sum(), "used")?;
        }
        if !budget.is_null() {
            caller.write(budget, gpu.memory_budget(), "budget")?;
        }
        Ok(())
    })
}

/// Writes the Vulkan objects behind a device, for callers that record on a device that the library has opened. The objects live as
/// long as the handle and everything made from it; callers destroy what they make from the objects before.
///
/// Threads: any.
///
/// # Safety
///
/// `gpu` is NULL or valid; `objects` is NULL or valid, with its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_gpu_handles(gpu: *const vr_gpu, objects: *mut vr_gpu_objects) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let gpu = &caller.reference(gpu, "gpu")?.gpu;
        let handles = gpu.handles();
        let value = vr_gpu_objects {
            struct_size: 0,
            instance: handles.instance.handle(),
            physical_device: handles.physical_device,
            device: handles.device.handle(),
            queue: gpu.with_queue(|queue| queue),
            queue_family: handles.queue_family,
        };
        caller.fill(objects, value, "vr_gpu_objects")
    })
}

/// Calls `work` once with the queue that the library submits to, while no other thread submits through the library, and then
/// returns. `work` must not call functions of the library that draw, upload or prepare: they would deadlock.
///
/// Threads: any.
///
/// # Safety
///
/// `gpu` is NULL or valid; `work` may be called with `user`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_gpu_with_queue(
    gpu: *const vr_gpu,
    work: vr_queue_callback,
    user: *mut c_void,
) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let gpu = &caller.reference(gpu, "gpu")?.gpu;
        let work = given(work, "work")?;
        // SAFETY: the caller's function with its own pointer.
        gpu.with_queue(|queue| unsafe { work(queue, user) });
        Ok(())
    })
}

/// Receives the user pointer that was given with it.
pub type vr_callback = Option<unsafe extern "C" fn(user: *mut c_void)>;

/// A device of the caller, and options of its use by the library.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_device_info {
    /// sizeof(vr_device_info).
    pub struct_size: usize,
    /// Entry point of the loader that made the instance. NULL: the system's loader.
    pub get_instance_proc_addr: PFN_vkGetInstanceProcAddr,
    /// The instance.
    pub instance: VkInstance,
    /// VkApplicationInfo::apiVersion of the instance: at least VK_API_VERSION_1_3.
    pub api_version: u32,
    /// Number of instance_extensions.
    pub instance_extension_count: u32,
    /// Enabled extensions of the instance. The library uses VK_EXT_debug_utils, for names and labels.
    pub instance_extensions: *const *const c_char,
    /// A physical device of that instance, for Vulkan 1.3 or later.
    pub physical_device: VkPhysicalDevice,
    /// The device.
    pub device: VkDevice,
    /// The structure that the device was made with, or one that names the extensions and features that the library may use.
    /// The library reads extensions, and features in any structure of the chain that may have them. Required are
    /// synchronization2 and dynamicRendering; optional are fragmentStoresAndAtomics, bufferDeviceAddress for buffers beyond
    /// maxStorageBufferRange, VK_EXT_memory_budget, and VK_EXT_fragment_shader_interlock with
    /// fragmentShaderPixelInterlock.
    pub device_create_info: *const VkDeviceCreateInfo,
    /// A queue for graphics and compute.
    pub queue: VkQueue,
    /// Family of the queue.
    pub queue_family: u32,
    /// The caller's cache, with which every pipeline is created, or VK_NULL_HANDLE. The caller keeps its contents, and destroys it
    /// when `released` is called or later. It was not made with VK_PIPELINE_CACHE_CREATE_EXTERNALLY_SYNCHRONIZED_BIT.
    pub pipeline_cache: VkPipelineCache,
    /// Folder in which the library keeps a file of pipelines, or NULL. Without this and `pipeline_cache` nothing is kept.
    pub pipeline_cache_folder: *const c_char,
    /// Limit of device memory, in bytes. 0: the free memory that the driver reports, or nine tenths of the largest
    /// device-local heap.
    pub memory_budget: u64,
    /// Called with `user` before each submission of the library to the queue; unlock_queue is called after it on the same
    /// thread. Set both or neither. Without them the caller uses the queue only within vr_gpu_with_queue(), or while no
    /// other thread is in a function of the library. Recording submits nothing. A thread that holds the lock must not call
    /// into the library, except to record.
    pub lock_queue: vr_callback,
    /// See lock_queue.
    pub unlock_queue: vr_callback,
    /// Called once with `user` when the library has destroyed its last object on the device, by the thread that destroyed
    /// the last handle; also if vr_gpu_adopt() fails. From then on device and instance may be destroyed, also by this
    /// function. May be NULL; then the caller must destroy all handles before the device.
    pub released: vr_callback,
    /// Passed to lock_queue, unlock_queue, released, allocate_memory, free_memory and compile.
    pub user: *mut c_void,
    /// Gives the memory of all buffers and images, in place of the library's allocator, which then allocates nothing. Any thread that
    /// prepares, uploads or destroys calls it. Set free_memory too, or neither.
    pub allocate_memory: vr_allocate_callback,
    /// See allocate_memory.
    pub free_memory: vr_free_callback,
    /// Callbacks for host memory that every object which the library makes on the device is created and destroyed with, or NULL. They are
    /// copied; any thread may call them, until `released` is called. The library's allocator of device memory has none: with them go
    /// allocate_memory and free_memory.
    pub allocation_callbacks: *const VkAllocationCallbacks,
    /// Runs the compilation of pipelines on threads of the caller's. NULL: as many of the library's own as the processor runs.
    pub compile: vr_compile_callback,
}

// SAFETY: repr(C), numbers, handles and pointers, which may be null, the first its size.
unsafe impl Structure for vr_device_info {}

/// Calls a function of the caller on drop.
struct OnDrop(unsafe extern "C" fn(*mut c_void), User);

impl Drop for OnDrop {
    fn drop(&mut self) {
        // SAFETY: the caller's function with its own pointer, called once.
        unsafe { (self.0)(self.1.pointer()) };
    }
}

/// Adopts a device that the caller made. The library destroys neither the device nor its instance. Destroying the handle and
/// all handles made from it destroys everything that the library has made on the device, without a wait.
///
/// Fails with VR_ERROR_UNSUPPORTED, whose message names the missing requirement, VR_ERROR_INVALID for a null handle, a
/// physical device of another instance, or an enabled feature that the device does not offer, VR_ERROR_VULKAN.
///
/// Threads: any.
///
/// # Safety
///
/// `info` and `gpu` are NULL or valid. The objects belong together and were made with what `info` says; they live until
/// `released` is called. The queue is not protected.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_gpu_adopt(info: *const vr_device_info, gpu: *mut *mut vr_gpu) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (gpu, "gpu"), |caller| {
        let info = caller.structure(info, "vr_device_info")?;
        let user = User(info.user);
        // Every return path drops this, or passes it on.
        let keep: Option<Arc<dyn Any + Send + Sync>> =
            info.released.map(|released| Arc::new(OnDrop(released, user)) as _);
        check_handle(info.instance, "instance")?;
        check_handle(info.physical_device, "physical_device")?;
        check_handle(info.device, "device")?;
        check_handle(info.queue, "queue")?;
        let create = caller.reference(info.device_create_info, "device_create_info")?;
        let queue_lock: Option<Arc<dyn QueueLock>> = match (info.lock_queue, info.unlock_queue) {
            (Some(lock), Some(unlock)) => Some(Arc::new(move |work: &mut dyn FnMut()| {
                // SAFETY: the caller's function with its own pointer.
                unsafe { lock(user.pointer()) };
                let _unlock = OnDrop(unlock, user);
                work();
            })),
            (None, None) => None,
            _ => return Err(Error::invalid("lock_queue and unlock_queue", "one of them is NULL")),
        };
        let count = num::index(info.instance_extension_count);
        let mut instance_extensions = Vec::new();
        for &name in caller.array(info.instance_extensions, count, "instance_extensions")? {
            let name = caller.text(name, "instance_extensions")?.map(c_text);
            let used = ash::ext::debug_utils::NAME;
            instance_extensions.extend(name.filter(|name| name.as_c_str() == used).map(|_| used));
        }
        let folder = caller.path(info.pipeline_cache_folder, "pipeline_cache_folder")?;
        let cache = Some(info.pipeline_cache).filter(|cache| *cache != vk::PipelineCache::null());
        let pipeline_cache = match (folder, cache) {
            (None, None) => PipelineCache::Off,
            (None, Some(cache)) => PipelineCache::Caller(cache),
            (Some(folder), None) => PipelineCache::Folder(folder.into()),
            (Some(_), Some(_)) => {
                let why = "both are given: pipelines are kept in one of them";
                return Err(Error::invalid("pipeline_cache and pipeline_cache_folder", why));
            }
        };
        let memory: Option<Arc<dyn MemorySource>> = match (info.allocate_memory, info.free_memory) {
            (Some(allocate), Some(free)) => Some(Arc::new(CallerMemory { allocate, free, user })),
            (None, None) => None,
            _ => return Err(Error::invalid("allocate_memory and free_memory", "one of them is NULL")),
        };
        // SAFETY: the caller promises valid callbacks that live as long.
        let callbacks = unsafe { info.allocation_callbacks.as_ref() };
        let options = GpuOptions {
            memory,
            // SAFETY: the same.
            allocation_callbacks: callbacks.map(|&callbacks| unsafe { AllocationCallbacks::new(callbacks) }),
            compilation: info.compile.map(|compile| compilation(compile, user)),
            ..options(pipeline_cache, info.memory_budget)
        };
        let entry = match info.get_instance_proc_addr {
            // SAFETY: the caller promises that it is the loader's.
            Some(get) => unsafe { ash::Entry::from_static_fn(ash::StaticFn { get_instance_proc_addr: get }) },
            // SAFETY: the system's loader, which has made the caller's instance, is loaded already.
            None => unsafe { ash::Entry::load() }.map_err(|error| Error::NoDevice {
                why: format!("the Vulkan loader cannot be loaded ({error}): give get_instance_proc_addr"),
            })?,
        };
        // SAFETY: an instance of this loader.
        let instance = unsafe { ash::Instance::load(entry.static_fn(), info.instance) };
        // SAFETY: a device of this instance.
        let device = unsafe { ash::Device::load(instance.fp_v1_0(), info.device) };
        let parts = GpuParts {
            entry,
            instance,
            api_version: info.api_version,
            instance_extensions,
            physical_device: info.physical_device,
            device,
            // SAFETY: the caller's promise: what vkCreateDevice took.
            enabled: unsafe { Enabled::from_create_info(create) },
            queue_family: info.queue_family,
            queue: info.queue,
            queue_lock,
            keep,
        };
        // SAFETY: the caller's promise, which is the same.
        Ok(vr_gpu::new(unsafe { Gpu::from_raw(parts, &options) }?))
    })
}
