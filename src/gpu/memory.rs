//! Device memory of buffers and images: limits, allocation, release.

use std::slice;
use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::budget::Reservation;
use super::device::Gpu;
use super::feature::OptionalFeature;
use super::host::{MemoryAccess, MemoryPart, MemoryRequest, MemorySource};
use crate::error::{Error, Result};

impl Gpu {
    /// Returns how many bytes of a buffer a descriptor shows shaders.
    pub(crate) fn most_bound_bytes(&self) -> u64 {
        let inner = &self.inner;
        u64::from(self.limits().max_storage_buffer_range).min(inner.max_allocation).min(inner.max_buffer)
    }

    /// Returns the bytes of one allocation that the driver promises, within the limit of the options.
    pub(crate) fn promised_bytes(&self) -> u64 {
        self.inner.max_allocation
    }

    /// Returns how many bytes of a buffer shaders can access, by a descriptor or by an address.
    pub(crate) fn most_buffer_bytes(&self) -> u64 {
        match self.has(OptionalFeature::BufferAddresses) {
            true => self.inner.max_buffer,
            false => self.most_bound_bytes(),
        }
    }

    /// Checks the size of an allocation against the limit of the options.
    pub(crate) fn check_allocation(&self, name: &str, bytes: u64) -> Result<()> {
        let most = self.inner.allocation_size;
        if bytes > most {
            return Err(Error::unsupported(
                name,
                format!("{bytes} bytes exceed the limit of {most} for one allocation of device memory"),
            ));
        }
        Ok(())
    }
}

/// The memory of a buffer or an image, which owns it and is destroyed before it.
#[derive(Debug)]
pub(super) struct Memory {
    gpu: Gpu,
    part: Part,
    size: usize,
    _reservation: Reservation,
}

/// Who gave it.
#[derive(Debug)]
enum Part {
    Allocator(Allocation),
    Caller(MemoryPart, Arc<dyn MemorySource>),
}

// SAFETY: the pointer of the caller's part is to memory that is this object's alone.
unsafe impl Send for Part {}
// SAFETY: it is read and written through references to this object.
unsafe impl Sync for Part {}

impl Memory {
    /// Reserves and allocates memory for a resource. `addressed` says that it is a buffer that shaders find by its address.
    pub(super) fn new(gpu: &Gpu, request: &MemoryRequest<'_>) -> Result<Self> {
        let MemoryRequest { name, requirements, .. } = *request;
        gpu.check_allocation(name, requirements.size)?;
        let reservation = gpu.inner.budget.reserve(name, requirements.size)?;
        let part = match &gpu.inner.memory {
            Some(source) => Part::Caller(of_caller(gpu, &**source, request)?, Arc::clone(source)),
            None => Part::Allocator(of_allocator(gpu, request)?),
        };
        // No host sees more than it can address.
        let size = usize::try_from(requirements.size).unwrap_or(0);
        let mut made = Self { gpu: gpu.clone(), part, size, _reservation: reservation };
        if let (true, Some(bytes)) = (gpu.inner.poison, made.bytes_mut()) {
            bytes.fill(0xFF);
        }
        Ok(made)
    }

    /// Returns the handle and the offset to bind the resource to.
    pub(super) fn place(&self) -> (vk::DeviceMemory, u64) {
        match &self.part {
            // SAFETY: the resource that is bound to it is destroyed before this object.
            Part::Allocator(allocation) => (unsafe { allocation.memory() }, allocation.offset()),
            Part::Caller(part, _) => (part.memory, part.offset),
        }
    }

    /// Returns the mapped memory; `None` where the host sees none.
    pub(super) fn bytes(&self) -> Option<&[u8]> {
        match &self.part {
            Part::Allocator(allocation) => allocation.mapped_slice(),
            Part::Caller(part, _) => {
                let start = part.mapped?;
                // SAFETY: the source promises that the part is mapped, this large, and this object's alone.
                Some(unsafe { slice::from_raw_parts(start.as_ptr(), self.size) })
            }
        }
    }

    /// Returns the mapped memory for writing.
    pub(super) fn bytes_mut(&mut self) -> Option<&mut [u8]> {
        match &mut self.part {
            Part::Allocator(allocation) => allocation.mapped_slice_mut(),
            Part::Caller(part, _) => {
                let start = part.mapped?;
                // SAFETY: as above.
                Some(unsafe { slice::from_raw_parts_mut(start.as_ptr(), self.size) })
            }
        }
    }
}

/// Asks the crate's allocator.
fn of_allocator(gpu: &Gpu, request: &MemoryRequest<'_>) -> Result<Allocation> {
    let MemoryRequest { name, requirements, access, is_buffer, .. } = *request;
    let location = match access {
        MemoryAccess::Device => MemoryLocation::GpuOnly,
        MemoryAccess::Upload => MemoryLocation::CpuToGpu,
        MemoryAccess::Download => MemoryLocation::GpuToCpu,
    };
    let allocation_scheme = AllocationScheme::GpuAllocatorManaged;
    let desc = AllocationCreateDesc { name, requirements, location, linear: is_buffer, allocation_scheme };
    let allocated = match gpu.allocator().as_mut() {
        Some(allocator) => allocator.allocate(&desc),
        None => Err(gpu_allocator::AllocationError::Internal("the device is being destroyed".into())),
    };
    let promised = gpu.inner.max_allocation;
    allocated.map_err(|source| match source {
        gpu_allocator::AllocationError::OutOfMemory if requirements.size > promised => {
            let why =
                format!("promises {promised} bytes in one allocation and refuses {}", requirements.size);
            Error::unsupported(name, format!("the driver {why}"))
        }
        source => Error::Allocation { object: name.to_string(), source },
    })
}

/// Asks the caller's source, and checks what can be checked.
fn of_caller(gpu: &Gpu, source: &dyn MemorySource, request: &MemoryRequest<'_>) -> Result<MemoryPart> {
    let MemoryRequest { name, requirements, access, .. } = *request;
    let part =
        source.allocate(request).map_err(|result| gpu.failed("allocate of the caller's memory", result))?;
    let wrong = match part {
        MemoryPart { memory, .. } if memory == vk::DeviceMemory::null() => "is null",
        MemoryPart { offset, .. } if !offset.is_multiple_of(requirements.alignment.max(1)) => {
            "begins at an offset that is not aligned"
        }
        MemoryPart { mapped: None, .. } if access != MemoryAccess::Device => "is not mapped",
        _ => return Ok(part),
    };
    source.free(part);
    Err(Error::invalid(name, format!("the caller's memory for it {wrong}")))
}

impl Drop for Memory {
    fn drop(&mut self) {
        match &mut self.part {
            Part::Caller(part, source) => source.free(*part),
            Part::Allocator(allocation) => {
                if let Some(allocator) = self.gpu.allocator().as_mut() {
                    // The only error is a broken invariant of the allocator, which a destructor cannot report.
                    let _ = allocator.free(std::mem::take(allocation));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::gpu::testing::TestGpu;
    use crate::gpu::{Buffer, BufferUse};

    /// The tests' devices poison memory, and the host of a software device sees all of it.
    #[test]
    fn new_memory_holds_no_zeros() {
        let gpu = TestGpu::new();
        let buffer = Arc::new(Buffer::new(&gpu, "test", 256, BufferUse::ShaderWrite).unwrap());
        assert!(!gpu.is_software() || gpu.download(&buffer) == [u32::MAX; 64]);
    }
}
