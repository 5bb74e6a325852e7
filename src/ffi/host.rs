//! Device memory and threads for compilation that callers provide on a device of theirs.

use std::ffi::{c_char, c_void};
use std::fmt;
use std::ptr::NonNull;

use ash::vk;

use super::argument::{Structure, User};
use super::result::c_text;
use super::vulkan::{VkBool32, VkDeviceMemory, VkResult};
use crate::gpu::{Compilation, MemoryAccess, MemoryPart, MemoryRequest, MemorySource};
use crate::num;

/// Access of the host to memory.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_memory_access {
    /// None: the device alone uses it.
    VR_MEMORY_DEVICE = 1,
    /// The host writes it in sequence, and the device reads it: mapped and coherent.
    VR_MEMORY_UPLOAD = 2,
    /// The device writes it, and the host reads it: mapped and coherent, cached where there is a choice.
    VR_MEMORY_DOWNLOAD = 3,
}

/// A request for memory of one buffer or image.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_memory_request {
    /// sizeof(vr_memory_request) of the library: later versions may have more fields.
    pub struct_size: usize,
    /// Name of the resource, valid during the call.
    pub name: *const c_char,
    /// Bytes.
    pub size: u64,
    /// Alignment of the offset.
    pub alignment: u64,
    /// VkMemoryRequirements::memoryTypeBits.
    pub memory_type_bits: u32,
    /// A vr_memory_access.
    pub access: u32,
    /// Whether the resource is a buffer; else it is an image with optimal tiling, which bufferImageGranularity keeps apart.
    pub is_buffer: VkBool32,
    /// Whether shaders find the buffer by its address: the memory needs VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
    pub addressed: VkBool32,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_memory_request {}

/// A part of device memory, for one resource.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_memory_part {
    /// The memory object.
    pub memory: VkDeviceMemory,
    /// Where the part begins, in bytes.
    pub offset: u64,
    /// Where the host sees the beginning of the part; required unless the access is VR_MEMORY_DEVICE.
    pub mapped: *mut c_void,
    /// A number of the caller's own.
    pub tag: u64,
}

/// Writes to `part`, which is zeros, memory of the requested size, alignment and type, which is no other resource's and stays valid and
/// mapped until it is freed. Returns VK_SUCCESS, or the result that the library's caller gets in an error.
pub type vr_allocate_callback = Option<
    unsafe extern "C" fn(
        request: *const vr_memory_request,
        part: *mut vr_memory_part,
        user: *mut c_void,
    ) -> VkResult,
>;

/// Takes back a part. Its resource is destroyed, and the device does not use it.
pub type vr_free_callback = Option<unsafe extern "C" fn(part: *const vr_memory_part, user: *mut c_void)>;

/// Builds the pipeline of a number.
pub type vr_compile_task = Option<unsafe extern "C" fn(number: u32, task: *mut c_void)>;

/// Calls `build` with `task` and each number below `count` once, on any threads, and returns when all calls have returned. What it leaves
/// out the waiting thread builds. While that waits it must not prepare another plan.
pub type vr_compile_callback =
    Option<unsafe extern "C" fn(count: u32, build: vr_compile_task, task: *mut c_void, user: *mut c_void)>;

type Allocate = unsafe extern "C" fn(*const vr_memory_request, *mut vr_memory_part, *mut c_void) -> VkResult;
type Free = unsafe extern "C" fn(*const vr_memory_part, *mut c_void);
type Compile = unsafe extern "C" fn(u32, vr_compile_task, *mut c_void, *mut c_void);

/// The caller's functions for device memory.
pub(super) struct CallerMemory {
    pub(super) allocate: Allocate,
    pub(super) free: Free,
    pub(super) user: User,
}

impl fmt::Debug for CallerMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("CallerMemory")
    }
}

// SAFETY: the caller promises what the documentation of the functions says.
unsafe impl MemorySource for CallerMemory {
    fn allocate(&self, request: &MemoryRequest<'_>) -> Result<MemoryPart, vk::Result> {
        let name = c_text(request.name);
        let access = match request.access {
            MemoryAccess::Device => vr_memory_access::VR_MEMORY_DEVICE,
            MemoryAccess::Upload => vr_memory_access::VR_MEMORY_UPLOAD,
            MemoryAccess::Download => vr_memory_access::VR_MEMORY_DOWNLOAD,
        };
        let wanted = vr_memory_request {
            struct_size: size_of::<vr_memory_request>(),
            name: name.as_ptr(),
            size: request.requirements.size,
            alignment: request.requirements.alignment,
            memory_type_bits: request.requirements.memory_type_bits,
            access: access as u32,
            is_buffer: request.is_buffer.into(),
            addressed: request.addressed.into(),
        };
        let mut part = of(MemoryPart { memory: vk::DeviceMemory::null(), offset: 0, mapped: None, tag: 0 });
        // SAFETY: the caller's function with its own pointer; both structures live during the call.
        unsafe { (self.allocate)(&raw const wanted, &raw mut part, self.user.pointer()) }.result()?;
        let vr_memory_part { memory, offset, mapped, tag } = part;
        Ok(MemoryPart { memory, offset, mapped: NonNull::new(mapped.cast()), tag })
    }

    fn free(&self, part: MemoryPart) {
        let part = of(part);
        // SAFETY: the caller's function with its own pointer, and what it gave.
        unsafe { (self.free)(&raw const part, self.user.pointer()) };
    }
}

fn of(MemoryPart { memory, offset, mapped, tag }: MemoryPart) -> vr_memory_part {
    let mapped = mapped.map_or(std::ptr::null_mut(), |start| start.as_ptr().cast());
    vr_memory_part { memory, offset, mapped, tag }
}

/// Wraps the caller's function that compiles.
pub(super) fn compilation(compile: Compile, user: User) -> Compilation {
    /// The task behind the pointer that C passes back.
    struct Task<'a>(&'a (dyn Fn(usize) + Sync));

    unsafe extern "C" fn build(number: u32, task: *mut c_void) {
        // SAFETY: the pointer that was given with this function, whose task waits.
        let Task(task) = unsafe { &*task.cast::<Task<'_>>() };
        // A panic must not reach C; the pipeline is then built by the waiting thread, where it panics again.
        let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| task(num::index(number))));
    }

    Compilation::new(move |count, task| {
        let task = Task(task);
        let pointer = (&raw const task).cast_mut().cast();
        // SAFETY: the caller's function with its own pointer; the task outlives the call.
        unsafe { compile(num::count(count), Some(build), pointer, user.pointer()) };
    })
}
