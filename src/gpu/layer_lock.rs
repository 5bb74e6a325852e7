//! One lock around calls that the validation layer does not guard.

use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;

use super::device::Gpu;
use crate::error::Result;

/// Serialises command pools, allocation from them, and recording under validation.
///
/// Version 1.3.239 of the layer keeps a record of each command buffer in a map that it does not lock. Recording the first
/// command of a buffer inserts, every later command looks up, and destroying the pool erases. Threads that do so at the same
/// time corrupt the map, mostly seen as a crash in `vkDestroyCommandPool`. The environment variable
/// `VK_LAYER_FINE_GRAINED_LOCKING=0` makes the layer hold one lock of its own around each call.
static RECORDS: Mutex<()> = Mutex::new(());

impl Gpu {
    /// Takes the lock where the crate has switched validation on; else returns `None` at once.
    pub(super) fn lock_layer(&self) -> Option<MutexGuard<'static, ()>> {
        let validated = self.inner.instance.layer_version.is_some();
        validated.then(|| RECORDS.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Creates a command pool for the queue.
    pub(super) fn create_command_pool(&self, flags: vk::CommandPoolCreateFlags) -> Result<vk::CommandPool> {
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(self.inner.candidate.queue_family)
            .flags(flags);
        let _held = self.lock_layer();
        // SAFETY: the device is alive and has this queue family.
        unsafe { self.device().create_command_pool(&info, self.host_callbacks()) }
            .map_err(|result| self.failed("vkCreateCommandPool", result))
    }

    /// Destroys a command pool with its command buffers.
    ///
    /// # Safety
    ///
    /// `pool` is null or was made from this device, and none of its command buffers is pending.
    pub(super) unsafe fn destroy_command_pool(&self, pool: vk::CommandPool) {
        let _held = self.lock_layer();
        // SAFETY: the caller's promise.
        unsafe { self.device().destroy_command_pool(pool, self.host_callbacks()) };
    }
}
