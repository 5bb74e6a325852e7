//! Buffers that own their memory.

use ash::vk;

use super::device::Gpu;
use super::host::{MemoryAccess, MemoryRequest};
use super::memory::Memory;
use crate::error::{Error, Result};

/// The purpose of a buffer, which decides its memory type and usage flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BufferUse {
    /// Shaders read it as a uniform or storage block; in device memory.
    ShaderRead,
    /// Shaders write and read it, it can be copied, and dispatches read their workgroups from it; in device memory.
    ShaderWrite,
    /// Shaders read the addresses of other buffers in it, which the host writes.
    Addresses,
    /// The host writes it, as staging memory for uploads.
    Upload,
    /// The host reads it, as staging memory for downloads.
    Download,
}

/// A buffer with its memory.
#[derive(Debug)]
pub(crate) struct Buffer {
    gpu: Gpu,
    pub(super) raw: vk::Buffer,
    /// `None` until the memory is allocated. Dropped after the buffer is destroyed.
    memory: Option<Memory>,
    size: u64,
    pub(super) name: String,
}

impl Buffer {
    pub(crate) fn new(gpu: &Gpu, name: &str, size: u64, purpose: BufferUse) -> Result<Self> {
        use vk::BufferUsageFlags as U;
        gpu.alive()?;
        if size == 0 {
            return Err(Error::invalid(name, "a buffer of 0 bytes"));
        }
        let most = gpu.most_buffer_bytes();
        if size > most && matches!(purpose, BufferUse::ShaderRead | BufferUse::ShaderWrite) {
            return Err(Error::unsupported(
                name,
                format!("{size} bytes exceed the limit of {most} that a shader can see of a buffer"),
            ));
        }
        let most = gpu.inner.max_buffer;
        if size > most {
            let why = format!("{size} bytes exceed the limit of {most} for one buffer");
            return Err(Error::unsupported(name, why));
        }
        gpu.check_allocation(name, size)?;
        gpu.inner.budget.check(name, size)?;
        let (mut usage, access) = match purpose {
            BufferUse::ShaderRead => {
                (U::UNIFORM_BUFFER | U::STORAGE_BUFFER | U::TRANSFER_DST, MemoryAccess::Device)
            }
            BufferUse::ShaderWrite => (
                U::STORAGE_BUFFER | U::INDIRECT_BUFFER | U::TRANSFER_SRC | U::TRANSFER_DST,
                MemoryAccess::Device,
            ),
            BufferUse::Addresses => (U::UNIFORM_BUFFER, MemoryAccess::Upload),
            BufferUse::Upload => (U::TRANSFER_SRC, MemoryAccess::Upload),
            BufferUse::Download => (U::TRANSFER_DST, MemoryAccess::Download),
        };
        if usage.contains(U::STORAGE_BUFFER) && gpu.is_addressed(size) {
            usage |= U::SHADER_DEVICE_ADDRESS;
        }
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device is alive; `info` points at nothing; the size is not 0
        // (VUID-VkBufferCreateInfo-size-00912).
        let raw = unsafe { gpu.device().create_buffer(&info, gpu.host_callbacks()) }
            .map_err(|result| gpu.failed("vkCreateBuffer", result))?;
        // `buffer` owns `raw` from here on, so every `?` below destroys it.
        let mut buffer = Self { gpu: gpu.clone(), raw, memory: None, size, name: name.to_string() };
        gpu.name(raw, name);
        // SAFETY: `raw` was just made from this device.
        let requirements = unsafe { gpu.device().get_buffer_memory_requirements(raw) };
        let addressed = usage.contains(U::SHADER_DEVICE_ADDRESS);
        let request = MemoryRequest { name, requirements, access, is_buffer: true, addressed };
        let memory = buffer.memory.insert(Memory::new(gpu, &request)?);
        let (memory, offset) = memory.place();
        // SAFETY: the buffer is unbound; memory type, size and alignment come from its requirements.
        unsafe { gpu.device().bind_buffer_memory(raw, memory, offset) }
            .map_err(|result| gpu.failed("vkBindBufferMemory", result))?;
        Ok(buffer)
    }

    /// Returns the address of a buffer that [`Gpu::is_addressed`].
    pub(super) fn address(&self) -> u64 {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.raw);
        // SAFETY: the feature is enabled, the buffer was made with SHADER_DEVICE_ADDRESS and has its memory
        // (VUID-VkBufferDeviceAddressInfo-buffer-02601).
        unsafe { self.gpu.device().get_buffer_device_address(&info) }
    }

    pub(crate) fn size(&self) -> u64 {
        self.size
    }

    /// Returns the mapped memory; `None` for buffers in device memory. The device does not access staging memory at the
    /// same time: uploads are submitted after the host has written, downloads are read after the fence.
    pub(crate) fn bytes(&self) -> Option<&[u8]> {
        self.memory.as_ref()?.bytes()
    }

    /// Returns the mapped memory for writing.
    pub(crate) fn bytes_mut(&mut self) -> Option<&mut [u8]> {
        self.memory.as_mut()?.bytes_mut()
    }
}

impl Gpu {
    /// Returns whether shaders find a storage block of this size by its address: it exceeds what a descriptor shows.
    pub(super) fn is_addressed(&self, size: u64) -> bool {
        size > u64::from(self.limits().max_storage_buffer_range)
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: a submission holds every resource it names until its fence has signalled, so no
        // pending command refers to `raw` (VUID-vkDestroyBuffer-buffer-00922).
        unsafe { self.gpu.device().destroy_buffer(self.raw, self.gpu.host_callbacks()) };
    }
}
