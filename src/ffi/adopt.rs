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
    /// synchronization2 and dynamicRendering; optional are fragmentStoresAndAtomics, VK_EXT_memory_budget, and
    /// VK_EXT_fragment_shader_interlock with fragmentShaderPixelInterlock.
    pub device_create_info: *const VkDeviceCreateInfo,
    /// A queue for graphics and compute.
    pub queue: VkQueue,
    /// Family of the queue.
    pub queue_family: u32,
    /// VK_TRUE keeps no pipelines on disk.
    pub no_pipeline_cache: VkBool32,
    /// Folder of the pipeline cache. NULL: volraster in the user's cache folder.
    pub pipeline_cache: *const c_char,
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
    /// Passed to lock_queue, unlock_queue and released.
    pub user: *mut c_void,
}

// SAFETY: repr(C), numbers, handles and pointers, which may be null, the first its size.
unsafe impl Structure for vr_device_info {
    const FIRST: usize = size_of::<Self>();
}

/// The caller's pointer for its functions.
struct User(*mut c_void);

// SAFETY: it is passed back and never followed; any thread may call the caller's functions, see vr_device_info.
unsafe impl Send for User {}
// SAFETY: the same.
unsafe impl Sync for User {}

/// The caller's lock of the queue.
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
                // SAFETY: the caller's function with its own pointer; locked below.
                unsafe { (self.0.unlock)(self.0.user.0) };
            }
        }
        // SAFETY: the caller's function with its own pointer.
        unsafe { (self.lock)(self.user.0) };
        let _held = Held(self);
        work();
    }
}

/// Calls the caller's `released` on drop.
struct Released(unsafe extern "C" fn(*mut c_void), User);

impl Drop for Released {
    fn drop(&mut self) {
        // SAFETY: the caller's function with its own pointer, called once.
        unsafe { (self.0)(self.1.0) };
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
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(gpu, "gpu") }?;
        // SAFETY: the caller's promise.
        let info = unsafe { argument::structure(info, "vr_device_info") }?;
        // Every return path drops this, or passes it on.
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
            keep: keep.map(|keep| keep as Arc<dyn std::any::Any + Send + Sync>),
        };
        // SAFETY: the caller's promise, which is the same.
        Ok(give(unsafe { Gpu::from_raw(parts, &options) }?, out))
    })
}
