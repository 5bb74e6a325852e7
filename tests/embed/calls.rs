//! A device whose functions note that they were called.

use std::ffi::{CStr, c_void};
use std::sync::Mutex;
use std::sync::atomic::{AtomicPtr, Ordering};

use volraster::ash::{self, vk};

/// Hears of each call.
type Watch = Box<dyn Fn(&'static str) + Send>;

// Of the one device that a test has, one test at a time. Threads of the crate call too.
static CACHES: Mutex<Vec<vk::PipelineCache>> = Mutex::new(Vec::new());
static CALLS: Mutex<Vec<&'static str>> = Mutex::new(Vec::new());
static HOSTS: Mutex<[usize; 2]> = Mutex::new([0; 2]);
static WATCH: Mutex<Option<Watch>> = Mutex::new(None);

fn note(name: &'static str) {
    CALLS.lock().unwrap().push(name);
    if let Some(watch) = &*WATCH.lock().unwrap() {
        watch(name);
    }
}

/// The noted calls while `work` ran.
pub fn during<R>(work: impl FnOnce() -> R) -> (R, Vec<&'static str>) {
    CALLS.lock().unwrap().clear();
    let result = work();
    (result, std::mem::take(&mut CALLS.lock().unwrap()))
}

/// Runs `watch` before each noted call while `work` runs.
pub fn watched<R>(watch: impl Fn(&'static str) + Send + 'static, work: impl FnOnce() -> R) -> R {
    *WATCH.lock().unwrap() = Some(Box::new(watch));
    let result = work();
    *WATCH.lock().unwrap() = None;
    result
}

/// The caches that pipelines were created with while `work` ran, one for each call.
pub fn caches<R>(work: impl FnOnce() -> R) -> (R, Vec<vk::PipelineCache>) {
    CACHES.lock().unwrap().clear();
    let result = work();
    (result, std::mem::take(&mut CACHES.lock().unwrap()))
}

fn note_cache(cache: vk::PipelineCache) {
    CACHES.lock().unwrap().push(cache);
}

/// How many calls that create or destroy an object were given callbacks for host memory while `work` ran, and how many none.
pub fn hosts<R>(work: impl FnOnce() -> R) -> (R, [usize; 2]) {
    *HOSTS.lock().unwrap() = [0; 2];
    let result = work();
    (result, *HOSTS.lock().unwrap())
}

fn note_host(callbacks: In) {
    HOSTS.lock().unwrap()[usize::from(callbacks.is_null())] += 1;
}

/// Stands in for commands that the guide does not list. The caller's calling convention leaves arguments to the caller.
unsafe extern "system" fn unlisted() {
    note("vkCmd...: not in the guide's list");
}

/// Points at something for the driver to read or to write.
type In = *const c_void;
type Out = *mut c_void;
type Vr = vk::Result;

macro_rules! noted {
    ($($name:ident($($arg:ident: $kind:ty),*) $(-> $result:ty)? $([$more:expr])?;)*) => {
        /// What stands in for a function: a note and the function itself, or that alone.
        fn stand_in(name: &CStr, real: *const c_void) -> *const c_void {
            match name.to_str().unwrap() {
                $(stringify!($name) => {
                    static REAL: AtomicPtr<c_void> = AtomicPtr::new(std::ptr::null_mut());
                    unsafe extern "system" fn call($($arg: $kind),*) $(-> $result)? {
                        note(stringify!($name));
                        $($more;)?
                        let real = REAL.load(Ordering::Relaxed);
                        // SAFETY: the address was given for a function of this name and type.
                        let real: unsafe extern "system" fn($($kind),*) $(-> $result)? =
                            unsafe { std::mem::transmute(real) };
                        // SAFETY: what the caller promised.
                        unsafe { real($($arg),*) }
                    }
                    REAL.store(real.cast_mut(), Ordering::Relaxed);
                    call as *const c_void
                })*
                // Whatever it takes, nothing is done with it: the note fails the test.
                name if name.starts_with("vkCmd") && !real.is_null() => unlisted as *const c_void,
                _ => real,
            }
        }

        /// What is noted.
        pub const NOTED: &[&str] = &[$(stringify!($name)),*];
    };
}

// All that a device without a window may be asked to do; of the commands those that the guide lists.
noted! {
    vkAllocateMemory(d: vk::Device, a: In, b: In, c: Out) -> Vr;
    vkFreeMemory(d: vk::Device, a: vk::DeviceMemory, b: In);
    vkMapMemory(d: vk::Device, a: vk::DeviceMemory, b: u64, c: u64, e: u32, f: Out) -> Vr;
    vkUnmapMemory(d: vk::Device, a: vk::DeviceMemory);
    vkFlushMappedMemoryRanges(d: vk::Device, a: u32, b: In) -> Vr;
    vkInvalidateMappedMemoryRanges(d: vk::Device, a: u32, b: In) -> Vr;
    vkBindBufferMemory(d: vk::Device, a: vk::Buffer, b: vk::DeviceMemory, c: u64) -> Vr;
    vkBindImageMemory(d: vk::Device, a: vk::Image, b: vk::DeviceMemory, c: u64) -> Vr;
    vkBindBufferMemory2(d: vk::Device, a: u32, b: In) -> Vr;
    vkBindImageMemory2(d: vk::Device, a: u32, b: In) -> Vr;
    vkCreateBuffer(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateBufferView(d: vk::Device, a: In, b: In, c: Out) -> Vr;
    vkCreateImage(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateImageView(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateSampler(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateShaderModule(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreatePipelineCache(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreatePipelineLayout(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateDescriptorSetLayout(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateDescriptorPool(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateQueryPool(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateFence(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateSemaphore(d: vk::Device, a: In, b: In, c: Out) -> Vr;
    vkCreateEvent(d: vk::Device, a: In, b: In, c: Out) -> Vr;
    vkCreateCommandPool(d: vk::Device, a: In, b: In, c: Out) -> Vr [note_host(b)];
    vkCreateRenderPass(d: vk::Device, a: In, b: In, c: Out) -> Vr;
    vkCreateFramebuffer(d: vk::Device, a: In, b: In, c: Out) -> Vr;
    vkCreateComputePipelines(d: vk::Device, a: vk::PipelineCache, b: u32, c: In, e: In, f: Out) -> Vr [{ note_cache(a); note_host(e) }];
    vkCreateGraphicsPipelines(d: vk::Device, a: vk::PipelineCache, b: u32, c: In, e: In, f: Out) -> Vr [{ note_cache(a); note_host(e) }];
    vkGetPipelineCacheData(d: vk::Device, a: vk::PipelineCache, b: Out, c: Out) -> Vr;
    vkDestroyBuffer(d: vk::Device, a: vk::Buffer, b: In) [note_host(b)];
    vkDestroyImage(d: vk::Device, a: vk::Image, b: In) [note_host(b)];
    vkDestroyImageView(d: vk::Device, a: vk::ImageView, b: In) [note_host(b)];
    vkDestroyDescriptorPool(d: vk::Device, a: vk::DescriptorPool, b: In) [note_host(b)];
    vkDestroyQueryPool(d: vk::Device, a: vk::QueryPool, b: In) [note_host(b)];
    vkAllocateDescriptorSets(d: vk::Device, a: In, b: Out) -> Vr;
    vkFreeDescriptorSets(d: vk::Device, a: vk::DescriptorPool, b: u32, c: In) -> Vr;
    vkResetDescriptorPool(d: vk::Device, a: vk::DescriptorPool, b: u32) -> Vr;
    vkUpdateDescriptorSets(d: vk::Device, a: u32, b: In, c: u32, e: In);
    vkAllocateCommandBuffers(d: vk::Device, a: In, b: Out) -> Vr;
    vkFreeCommandBuffers(d: vk::Device, a: vk::CommandPool, b: u32, c: In);
    vkResetCommandPool(d: vk::Device, a: vk::CommandPool, b: u32) -> Vr;
    vkBeginCommandBuffer(d: vk::CommandBuffer, a: In) -> Vr;
    vkEndCommandBuffer(d: vk::CommandBuffer) -> Vr;
    vkResetCommandBuffer(d: vk::CommandBuffer, a: u32) -> Vr;
    vkQueueSubmit(d: vk::Queue, a: u32, b: In, c: vk::Fence) -> Vr;
    vkQueueSubmit2(d: vk::Queue, a: u32, b: In, c: vk::Fence) -> Vr;
    vkQueueBindSparse(d: vk::Queue, a: u32, b: In, c: vk::Fence) -> Vr;
    vkQueueWaitIdle(d: vk::Queue) -> Vr;
    vkDeviceWaitIdle(d: vk::Device) -> Vr;
    vkWaitForFences(d: vk::Device, a: u32, b: In, c: u32, e: u64) -> Vr;
    vkResetFences(d: vk::Device, a: u32, b: In) -> Vr;
    vkGetFenceStatus(d: vk::Device, a: vk::Fence) -> Vr;
    vkWaitSemaphores(d: vk::Device, a: In, b: u64) -> Vr;
    vkSignalSemaphore(d: vk::Device, a: In) -> Vr;
    vkResetQueryPool(d: vk::Device, a: vk::QueryPool, b: u32, c: u32);
    vkGetQueryPoolResults(d: vk::Device, a: vk::QueryPool, b: u32, c: u32, e: usize, f: Out, g: u64, h: u32) -> Vr;
    vkDestroyDevice(d: vk::Device, a: In);
    vkCmdPipelineBarrier2(d: vk::CommandBuffer, a: In);
    vkCmdBindPipeline(d: vk::CommandBuffer, a: u32, b: vk::Pipeline);
    vkCmdBindDescriptorSets(d: vk::CommandBuffer, a: u32, b: vk::PipelineLayout, c: u32, e: u32, f: In, g: u32, h: In);
    vkCmdPushConstants(d: vk::CommandBuffer, a: vk::PipelineLayout, b: u32, c: u32, e: u32, f: In);
    vkCmdSetViewport(d: vk::CommandBuffer, a: u32, b: u32, c: In);
    vkCmdSetScissor(d: vk::CommandBuffer, a: u32, b: u32, c: In);
    vkCmdBeginRendering(d: vk::CommandBuffer, a: In);
    vkCmdEndRendering(d: vk::CommandBuffer);
    vkCmdDraw(d: vk::CommandBuffer, a: u32, b: u32, c: u32, e: u32);
    vkCmdDispatch(d: vk::CommandBuffer, a: u32, b: u32, c: u32);
    vkCmdDispatchIndirect(d: vk::CommandBuffer, a: vk::Buffer, b: u64);
    vkCmdFillBuffer(d: vk::CommandBuffer, a: vk::Buffer, b: u64, c: u64, e: u32);
    vkCmdCopyBuffer(d: vk::CommandBuffer, a: vk::Buffer, b: vk::Buffer, c: u32, e: In);
    vkCmdClearColorImage(d: vk::CommandBuffer, a: vk::Image, b: u32, c: In, e: u32, f: In);
    vkCmdCopyBufferToImage(d: vk::CommandBuffer, a: vk::Buffer, b: vk::Image, c: u32, e: u32, f: In);
    vkCmdCopyImageToBuffer(d: vk::CommandBuffer, a: vk::Image, b: u32, c: vk::Buffer, e: u32, f: In);
    vkCmdResetQueryPool(d: vk::CommandBuffer, a: vk::QueryPool, b: u32, c: u32);
    vkCmdWriteTimestamp2(d: vk::CommandBuffer, a: u64, b: vk::QueryPool, c: u32);
    vkCmdBeginDebugUtilsLabelEXT(d: vk::CommandBuffer, a: In);
    vkCmdEndDebugUtilsLabelEXT(d: vk::CommandBuffer);
}

/// The device, with functions that note their calls.
pub fn noting(instance: &ash::Instance, device: vk::Device) -> ash::Device {
    let get = instance.fp_v1_0().get_device_proc_addr;
    let load = |name: &CStr| {
        // SAFETY: a device of this instance, and the name of a function.
        let real = unsafe { get(device, name.as_ptr()) };
        real.map_or(std::ptr::null(), |real| stand_in(name, real as *const c_void))
    };
    // SAFETY: each function is the device's own, or calls it.
    unsafe { ash::Device::load_with(load, device) }
}
