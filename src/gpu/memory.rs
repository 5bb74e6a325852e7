//! Device memory of buffers and images: limits, allocation, release.

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::budget::Reservation;
use super::device::Gpu;
use super::feature::OptionalFeature;
use crate::error::{Error, Result};

impl Gpu {
    /// Returns how many bytes of a buffer a descriptor shows shaders.
    pub(crate) fn most_bound_bytes(&self) -> u64 {
        let inner = &self.inner;
        u64::from(self.limits().max_storage_buffer_range).min(inner.max_allocation).min(inner.max_buffer)
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
    pub(super) allocation: Allocation,
    _reservation: Reservation,
}

impl Memory {
    /// Reserves and allocates memory for a resource. `linear` says that it is a buffer.
    pub(super) fn new(
        gpu: &Gpu,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Self> {
        gpu.check_allocation(name, requirements.size)?;
        let reservation = gpu.inner.budget.reserve(name, requirements.size)?;
        let desc = AllocationCreateDesc {
            name,
            requirements,
            location,
            linear,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let allocated = match gpu.allocator().as_mut() {
            Some(allocator) => allocator.allocate(&desc),
            None => Err(gpu_allocator::AllocationError::Internal("the device is being destroyed".into())),
        };
        let promised = gpu.inner.max_allocation;
        let mut allocation = allocated.map_err(|source| match source {
            gpu_allocator::AllocationError::OutOfMemory if requirements.size > promised => {
                let why =
                    format!("promises {promised} bytes in one allocation and refuses {}", requirements.size);
                Error::unsupported(name, format!("the driver {why}"))
            }
            source => Error::Allocation { object: name.to_string(), source },
        })?;
        if let (true, Some(bytes)) = (gpu.inner.poison, allocation.mapped_slice_mut()) {
            bytes.fill(0xFF);
        }
        Ok(Self { gpu: gpu.clone(), allocation, _reservation: reservation })
    }

    /// Returns the handle and the offset to bind the resource to.
    pub(super) fn place(&self) -> (vk::DeviceMemory, u64) {
        // SAFETY: the resource that is bound to it is destroyed before this object.
        (unsafe { self.allocation.memory() }, self.allocation.offset())
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        if let Some(allocator) = self.gpu.allocator().as_mut() {
            // The only error is a broken invariant of the allocator, which a destructor cannot report.
            let _ = allocator.free(std::mem::take(&mut self.allocation));
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
