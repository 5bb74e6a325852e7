//! Devices that the library opens, and queries of any device.

use std::ffi::{CString, c_char, c_void};

use ash::vk;

use super::argument::{self, Structure, choice};
use super::result::{c_text, call, quietly, vr_result};
use super::vulkan::{VkBool32, VkDevice, VkInstance, VkPhysicalDevice, VkQueue};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, GpuOptions, Validation};

/// A Vulkan device with the library's objects. It lives until this handle and all handles made from it are destroyed.
#[derive(Debug)]
pub struct vr_gpu {
    pub(super) gpu: Gpu,
    name: CString,
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
    pub pipeline_cache: *const c_char,
    /// Limit of device memory, in bytes. 0: the free memory that the driver reports, or nine tenths of the largest
    /// device-local heap.
    pub memory_budget: u64,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_gpu_info {
    const FIRST: usize = size_of::<Self>();
}

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
unsafe impl Structure for vr_gpu_objects {
    const FIRST: usize = size_of::<Self>();
}

/// Returns a device through `out`.
pub(super) fn give(gpu: Gpu, out: &mut *mut vr_gpu) -> vr_result {
    let name = c_text(&gpu.report().name);
    *out = Box::into_raw(Box::new(vr_gpu { gpu, name }));
    vr_result::VR_OK
}

/// Converts the options that opened and adopted devices share.
///
/// # Safety
///
/// `cache` is null or ends with NUL.
pub(super) unsafe fn options(no_cache: VkBool32, cache: *const c_char, budget: u64) -> Result<GpuOptions> {
    Ok(GpuOptions {
        no_pipeline_cache: no_cache != vk::FALSE,
        // SAFETY: the caller's promise.
        pipeline_cache: unsafe { argument::path(cache, "pipeline_cache") }?.map(Into::into),
        memory_budget: (budget > 0).then_some(budget),
        ..GpuOptions::default()
    })
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
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(gpu, "gpu") }?;
        if info.is_null() {
            return Ok(give(Gpu::headless()?, out));
        }
        // SAFETY: the caller's promise.
        let info = unsafe { argument::structure(info, "vr_gpu_info") }?;
        // SAFETY: the caller's promise.
        let common = unsafe { options(info.no_pipeline_cache, info.pipeline_cache, info.memory_budget) }?;
        let validations = [
            (Validation::Off, vr_validation::VR_VALIDATION_OFF as u32),
            (Validation::On, vr_validation::VR_VALIDATION_ON as u32),
            (Validation::GpuAssisted, vr_validation::VR_VALIDATION_GPU_ASSISTED as u32),
        ];
        let options = GpuOptions {
            // SAFETY: the caller's promise.
            device: unsafe { argument::text(info.device, "device") }?.map(str::to_string),
            validation: choice(info.validation, &validations, "validation")?,
            ..common
        };
        Ok(give(Gpu::new(&options)?, out))
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
    if !gpu.is_null() {
        // SAFETY: made by `give`, and not destroyed before.
        quietly(|| drop(unsafe { Box::from_raw(gpu) }));
    }
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
    call(|| {
        // SAFETY: the caller's promise.
        let gpu = &unsafe { argument::reference(gpu, "gpu") }?.gpu;
        // SAFETY: the caller's promise.
        if let Some(used) = unsafe { used.as_mut() } {
            *used = gpu.memory_report().iter().map(|(_, bytes)| bytes).sum();
        }
        // SAFETY: the caller's promise.
        if let Some(budget) = unsafe { budget.as_mut() } {
            *budget = gpu.memory_budget();
        }
        Ok(vr_result::VR_OK)
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
    call(|| {
        // SAFETY: the caller's promise.
        let gpu = &unsafe { argument::reference(gpu, "gpu") }?.gpu;
        let handles = gpu.handles();
        let value = vr_gpu_objects {
            struct_size: 0,
            instance: handles.instance.handle(),
            physical_device: handles.physical_device,
            device: handles.device.handle(),
            queue: gpu.with_queue(|queue| queue),
            queue_family: handles.queue_family,
        };
        // SAFETY: the caller's promise.
        unsafe { argument::fill(objects, value, "vr_gpu_objects") }?;
        Ok(vr_result::VR_OK)
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
    call(|| {
        // SAFETY: the caller's promise.
        let gpu = &unsafe { argument::reference(gpu, "gpu") }?.gpu;
        let work = work.ok_or_else(|| Error::invalid("work", "is NULL"))?;
        // SAFETY: the caller's promise.
        gpu.with_queue(|queue| unsafe { work(queue, user) });
        Ok(vr_result::VR_OK)
    })
}
