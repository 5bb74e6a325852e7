//! Resources that a caller may provide: the memory of buffers and images, the host memory of Vulkan's objects, and the threads that
//! compile pipelines.

use std::fmt;
use std::ptr::NonNull;
use std::sync::Arc;

use ash::vk;

/// The access of the host to memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryAccess {
    /// None: the device alone uses it.
    Device,
    /// The host writes it in sequence, and the device reads it: mapped and coherent.
    Upload,
    /// The device writes it, and the host reads it: mapped and coherent, cached where there is a choice.
    Download,
}

/// A request for memory of one buffer or image.
#[derive(Clone, Copy, Debug)]
pub struct MemoryRequest<'a> {
    /// The name of the resource, such as `volume` or `bins`.
    pub name: &'a str,
    /// Size, alignment and allowed types.
    pub requirements: vk::MemoryRequirements,
    /// The access of the host.
    pub access: MemoryAccess,
    /// Whether the resource is a buffer; else it is an image with optimal tiling, which `bufferImageGranularity` keeps apart.
    pub is_buffer: bool,
    /// Whether shaders find the buffer by its address: the memory needs `DEVICE_ADDRESS`.
    pub addressed: bool,
}

/// A part of device memory, for one resource.
#[derive(Clone, Copy, Debug)]
pub struct MemoryPart {
    /// The memory object.
    pub memory: vk::DeviceMemory,
    /// Where the part begins, in bytes.
    pub offset: u64,
    /// Where the host sees the beginning of the part; required unless the access is [`MemoryAccess::Device`].
    pub mapped: Option<NonNull<u8>>,
    /// A number of the source's own.
    pub tag: u64,
}

/// Gives the memory of all buffers and images of a device: those of scenes, which live as long as these, and those of plans.
///
/// Calls come from any thread that prepares, uploads or drops.
///
/// # Safety
///
/// A part that [`MemorySource::allocate`] returns has the requested size, alignment and type, is no other resource's, and stays valid and
/// mapped until it is freed.
pub unsafe trait MemorySource: fmt::Debug + Send + Sync {
    /// Returns a part for a request.
    ///
    /// # Errors
    ///
    /// The result that the caller of the library gets, such as `ERROR_OUT_OF_DEVICE_MEMORY`.
    fn allocate(&self, request: &MemoryRequest<'_>) -> Result<MemoryPart, vk::Result>;
    /// Takes back a part. Its resource is destroyed, and the device does not use it.
    fn free(&self, part: MemoryPart);
}

/// Vulkan's callbacks for host memory, which every creation and destruction of an object on the device gets.
#[derive(Clone, Copy, Debug)]
pub struct AllocationCallbacks(vk::AllocationCallbacks<'static>);

impl AllocationCallbacks {
    /// Wraps the callbacks.
    ///
    /// # Safety
    ///
    /// They are valid (`VkAllocationCallbacks`), may be called by any thread, and live as long as the device, with their user data.
    #[must_use]
    pub unsafe fn new(callbacks: vk::AllocationCallbacks<'static>) -> Self {
        Self(callbacks)
    }

    pub(super) fn get(&self) -> &vk::AllocationCallbacks<'static> {
        &self.0
    }
}

// SAFETY: any thread may call them, as was promised.
unsafe impl Send for AllocationCallbacks {}
// SAFETY: the same.
unsafe impl Sync for AllocationCallbacks {}

/// Runs the compilation of pipelines. [`Gpu::build`](super::Gpu) calls it with the number of pipelines and a task that builds one of them.
type Run = dyn Fn(usize, &(dyn Fn(usize) + Sync)) + Send + Sync;

/// The threads on which pipelines are compiled.
#[derive(Clone)]
pub struct Compilation(Arc<Run>);

impl Compilation {
    /// Wraps a function that is called with a number of pipelines and a task. It calls the task once with each number below, on any
    /// threads, and returns when all calls have returned; what it leaves out is built by the thread that waits. It may count the calls, for a progress
    /// bar, and may start them late, so that frames go first. While a thread waits in it, that thread must not prepare another plan.
    pub fn new(run: impl Fn(usize, &(dyn Fn(usize) + Sync)) + Send + Sync + 'static) -> Self {
        Self(Arc::new(run))
    }

    pub(super) fn run(&self, count: usize, task: &(dyn Fn(usize) + Sync)) {
        (self.0)(count, task);
    }
}

impl fmt::Debug for Compilation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Compilation")
    }
}
