//! Device memory of buffers and images: limits, allocation, release.

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::device::Gpu;
use crate::error::{Error, Result};

impl Gpu {
    /// Bytes of a buffer that shaders see, at most.
    pub(crate) fn most_buffer_bytes(&self) -> u64 {
        u64::from(self.inner.properties.limits.max_storage_buffer_range).min(self.inner.max_allocation)
    }

    /// Whether the driver gives so much memory at once. What a driver does beyond its limit is its own affair.
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

/// Memory for a resource.
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

/// Gives memory back. Its resource is destroyed already.
pub(super) fn free(gpu: &Gpu, allocation: Option<Allocation>) {
    if let (Some(allocation), Some(allocator)) = (allocation, gpu.allocator().as_mut()) {
        // The only error is a broken allocator invariant; a destructor has nowhere to send it.
        let _ = allocator.free(allocation);
    }
}
