//! A lost device: the first call that reports the loss sets a flag that stays set.

use ash::vk;

use super::device::Gpu;
use crate::error::{Error, Result};

impl Gpu {
    /// Returns whether the device is lost. Functions that use a lost device return [`Error::DeviceLost`] before they
    /// call Vulkan. Its objects can be dropped as usual, and [`Gpu::new`] may open the device again.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.inner.lost.get().is_some()
    }

    /// Marks the device as lost, after a call of the caller's own, such as a submission, has returned
    /// `ERROR_DEVICE_LOST`.
    pub fn note_loss(&self) {
        let _ = self.inner.lost.set("a call of the caller");
    }

    /// Checks that the device is not known to be lost; called before work starts.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`] with the call that reported the loss first.
    pub(crate) fn alive(&self) -> Result<()> {
        self.inner.lost.get().map_or(Ok(()), |&call| Err(Error::DeviceLost { call }))
    }

    /// Returns the error of a failed call, and remembers a loss.
    pub(crate) fn failed(&self, call: &'static str, result: vk::Result) -> Error {
        if result == vk::Result::ERROR_DEVICE_LOST {
            let call = *self.inner.lost.get_or_init(|| call);
            return Error::DeviceLost { call };
        }
        Error::vulkan(call, result)
    }
}
