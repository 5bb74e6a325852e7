//! Devices of the caller.

use std::ffi::{c_char, c_void};
use std::sync::Arc;

use ash::vk::Handle as _;

use super::argument::{self, Structure};
use super::gpu::{give, options, vr_gpu};
use super::result::{c_text, call, vr_result};
use super::vulkan::{
    PFN_vkGetInstanceProcAddr, VkBool32, VkDevice, VkDeviceCreateInfo, VkInstance, VkPhysicalDevice, VkQueue,
};
use crate::error::Error;
use crate::gpu::{Enabled, Gpu, GpuParts, QueueLock};

/// Is handed the user pointer that was given with it.
pub type vr_callback = Option<unsafe extern "C" fn(user: *mut c_void)>;

/// A device of the caller, and how the library may use it.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_device_info {
    /// sizeof(vr_device_info).
    pub struct_size: usize,
    /// Of the loader that the instance was made with. NULL: that of the system.
    pub get_instance_proc_addr: PFN_vkGetInstanceProcAddr,
    /// The instance.
    pub instance: VkInstance,
    /// VkApplicationInfo::apiVersion of the instance: at least VK_API_VERSION_1_3.
    pub api_version: u32,
    /// Number of instance_extensions.
    pub instance_extension_count: u32,
    /// What the instance was made with. Used is VK_EXT_debug_utils, for names and labels.
    pub instance_extensions: *const *const c_char,
    /// The physical device, of that instance, for Vulkan 1.3 or later.
    pub physical_device: VkPhysicalDevice,
    /// The device.
    pub device: VkDevice,
    /// What the device was made with, or a structure that names as much of it as the library shall know of. Read are
    /// extensions and features, these in any structure of the chain that may have them. Required are synchronization2 and
    /// dynamicRendering; of use are fragmentStoresAndAtomics, VK_EXT_memory_budget, and VK_EXT_fragment_shader_interlock
    /// with fragmentShaderPixelInterlock.
    pub device_create_info: *const VkDeviceCreateInfo,
    /// The queue, for graphics and compute.
    pub queue: VkQueue,
    /// Its family.
    pub queue_family: u32,
    /// Do not keep pipelines on disk.
    pub no_pipeline_cache: VkBool32,
    /// Folder of the pipeline cache. NULL: volraster in the user's cache folder.
    pub pipeline_cache: *const c_char,
    /// Most device memory to use, in bytes. 0: what the driver says is free, or nine tenths of the largest device-local
    /// heap.
    pub memory_budget: u64,
    /// Called before each submission of the library to the queue, and unlock_queue after it, on the same thread, with
    /// `user`: both or neither. Without them the caller uses the queue within vr_gpu_with_queue() alone, or while no other
    /// thread is in a function of the library. Recording submits nothing. The lock must not be held by a thread that calls
    /// into the library, unless to record.
    pub lock_queue: vr_callback,
    /// See lock_queue.
    pub unlock_queue: vr_callback,
    /// Called once, with `user`, when nothing of the library's is left on the device, by the thread that destroyed the last
    /// thing; also where vr_gpu_adopt() fails. Device and instance may be destroyed from then on, also by this function. May
    /// be NULL.
    pub released: vr_callback,
    /// For lock_queue, unlock_queue and released.
    pub user: *mut c_void,
}

// SAFETY: repr(C), numbers, handles and pointers, which may be null, the first its size.
unsafe impl Structure for vr_device_info {
    const FIRST: usize = size_of::<Self>();
}

/// A pointer of the caller's, for the caller's functions.
struct User(*mut c_void);

// SAFETY: it is handed back and never followed; the caller's functions may be called by any thread, see vr_device_info.
unsafe impl Send for User {}
// SAFETY: the same.
unsafe impl Sync for User {}

/// The caller's lock.
struct Lock {
    lock: unsafe extern "C" fn(*mut c_void),
    unlock: unsafe extern "C" fn(*mut c_void),
    user: User,
}

impl QueueLock for Lock {
    fn hold(&self, work: &mut dyn FnMut()) {
        struct Held<'a>(&'a Lock);
        impl Drop for Held<'_> {
            fn drop(&mut self) {
                // SAFETY: the caller's function with what was given for it; locked below.
                unsafe { (self.0.unlock)(self.0.user.0) };
            }
        }
        // SAFETY: the caller's function with what was given for it.
        unsafe { (self.lock)(self.user.0) };
        let _held = Held(self);
        work();
    }
}

/// Tells the caller that nothing is left.
struct Released(unsafe extern "C" fn(*mut c_void), User);

impl Drop for Released {
    fn drop(&mut self) {
        // SAFETY: the caller's function with what was given for it, once.
        unsafe { (self.0)(self.1.0) };
    }
}

/// Takes a device that the caller made. The library destroys neither it nor its instance; what it makes on the device is gone
/// when the handle and all that was made from it are destroyed, without a wait.
///
/// Fails with VR_ERROR_UNSUPPORTED naming what is required and missing, VR_ERROR_INVALID for a null handle, a physical
/// device of another instance, or what is said to be enabled and cannot be, VR_ERROR_VULKAN.
///
/// Threads: any.
///
/// # Safety
///
/// `info` and `gpu` are valid. The objects are of one another, and were made with what `info` says; they live until
/// `released` is called. The queue is no protected one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_gpu_adopt(info: *const vr_device_info, gpu: *mut *mut vr_gpu) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(gpu, "gpu") }?;
        // SAFETY: the caller's promise.
        let info = unsafe { argument::structure(info, "vr_device_info") }?;
        // Dropped by every way out.
        let keep = info.released.map(|released| Arc::new(Released(released, User(info.user))));
        let nulls = [
            (info.instance.is_null(), "instance"),
            (info.physical_device.is_null(), "physical_device"),
            (info.device.is_null(), "device"),
            (info.queue.is_null(), "queue"),
        ];
        if let Some((_, name)) = nulls.iter().find(|(null, _)| *null) {
            return Err(Error::invalid(*name, "is VK_NULL_HANDLE"));
        }
        // SAFETY: the caller's promise: null or what vkCreateDevice takes.
        let create = unsafe { argument::reference(info.device_create_info, "device_create_info") }?;
        let queue_lock: Option<Arc<dyn QueueLock>> = match (info.lock_queue, info.unlock_queue) {
            (Some(lock), Some(unlock)) => Some(Arc::new(Lock { lock, unlock, user: User(info.user) })),
            (None, None) => None,
            _ => return Err(Error::invalid("lock_queue and unlock_queue", "one of them is NULL")),
        };
        let count = crate::num::index(info.instance_extension_count);
        // SAFETY: the caller's promise.
        let names = unsafe { argument::array(info.instance_extensions, count, "instance_extensions") }?;
        let mut instance_extensions = Vec::with_capacity(names.len());
        for &name in names {
            // SAFETY: the caller's promise.
            let name = unsafe { argument::text(name, "instance_extensions") }?;
            instance_extensions.extend(name.map(c_text));
        }
        // SAFETY: the caller's promise.
        let options = unsafe { options(info.no_pipeline_cache, info.pipeline_cache, info.memory_budget) }?;
        let entry = match info.get_instance_proc_addr {
            // SAFETY: by the caller's promise the loader's.
            Some(get) => unsafe { ash::Entry::from_static_fn(ash::StaticFn { get_instance_proc_addr: get }) },
            // SAFETY: loading the system's loader, which has made the caller's instance, runs nothing new.
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
            keep: keep.map(|keep| keep as Arc<dyn std::any::Any + Send + Sync>),
        };
        // SAFETY: the caller's promise, which is the same.
        Ok(give(unsafe { Gpu::from_raw(parts, &options) }?, out))
    })
}
