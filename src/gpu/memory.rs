//! Device memory of buffers and images: limits, allocation, release.

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::device::Gpu;
use crate::error::{Error, Result};

impl Gpu {
    /// Returns how many bytes of a buffer shaders can access.
    pub(crate) fn most_buffer_bytes(&self) -> u64 {
        u64::from(self.inner.properties.limits.max_storage_buffer_range).min(self.inner.max_allocation)
    }

    /// Checks the size of an allocation against the limit of the driver.
    pub(crate) fn check_allocation(&self, name: &str, bytes: u64) -> Result<()> {
        let most = self.inner.max_allocation;
        if bytes > most {
            return Err(Error::unsupported(
                name,
                format!("{bytes} bytes exceed the limit of {most} for one allocation of device memory"),
            ));
        }
        Ok(())
    }
}

/// Allocates memory for a resource. `linear` says that it is a buffer.
pub(super) fn allocate(
    gpu: &Gpu,
    name: &str,
    requirements: vk::MemoryRequirements,
    location: MemoryLocation,
    linear: bool,
) -> Result<Allocation> {
    let desc = AllocationCreateDesc {
        name,
        requirements,
        location,
        linear,
        allocation_scheme: AllocationScheme::GpuAllocatorManaged,
    };
    let failed = |source| Error::Allocation { object: name.to_string(), source };
    match gpu.allocator().as_mut() {
        Some(allocator) => allocator.allocate(&desc).map_err(failed),
        None => Err(failed(gpu_allocator::AllocationError::Internal("the device is being destroyed".into()))),
    }
}

/// Frees the memory of a resource that is destroyed already.
pub(super) fn free(gpu: &Gpu, allocation: Option<Allocation>) {
    if let (Some(allocation), Some(allocator)) = (allocation, gpu.allocator().as_mut()) {
        // The only error is a broken invariant of the allocator, which a destructor cannot report.
        let _ = allocator.free(allocation);
    }
}
