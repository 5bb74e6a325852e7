//! A lost device: known from the first call that tells of it on, for good.

use ash::vk;

use super::device::Gpu;
use crate::error::{Error, Result};

impl Gpu {
    /// Whether the device is lost. Everything that would use it returns [`Error::DeviceLost`] then, before it begins; its
    /// objects can be dropped as always, and [`Gpu::new`] opens the device again if the driver lets it.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.inner.lost.get().is_some()
    }

    /// Tells that the device is lost, where a call of the caller's own, such as its submission, returned
    /// `ERROR_DEVICE_LOST`.
    pub fn note_loss(&self) {
        let _ = self.inner.lost.set("a call of the caller");
    }

    /// Nothing, while the device is not known to be lost. To be asked before work starts.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`] with the call that told first.
    pub(crate) fn alive(&self) -> Result<()> {
        self.inner.lost.get().map_or(Ok(()), |&call| Err(Error::DeviceLost { call }))
    }

    /// The error of a call that failed; a loss is remembered.
    pub(crate) fn failed(&self, call: &'static str, result: vk::Result) -> Error {
        if result == vk::Result::ERROR_DEVICE_LOST {
            let call = *self.inner.lost.get_or_init(|| call);
            return Error::DeviceLost { call };
        }
        Error::vulkan(call, result)
    }
}
