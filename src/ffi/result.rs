//! Return codes, and the last message of each thread.

use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard};

use ash::vk;

use super::argument::Caller;
use super::vulkan::VkResult;
use crate::error::{Error, Result};

/// Result of a call. Negative codes are failures: vr_last_error() has the message, nothing was changed, and handles that the
/// function returns are NULL.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_result {
    /// Success.
    VR_OK = 0,
    /// Not a failure: the plan's capacity is too small for this view. Call vr_plan_prepare() with it.
    VR_NO_ROOM = 1,
    /// An argument breaks a rule: NULL, a wrong size, a number out of range, an unknown name, a call at the wrong time.
    VR_ERROR_INVALID = -1,
    /// A file's contents break a rule of its format.
    VR_ERROR_FILE = -2,
    /// A file cannot be opened, read or written.
    VR_ERROR_IO = -3,
    /// No usable Vulkan: no loader, no driver, no device that qualifies.
    VR_ERROR_NO_DEVICE = -4,
    /// The device, or this build of the library, lacks a feature that the request needs.
    VR_ERROR_UNSUPPORTED = -5,
    /// The request needs more device memory than is available.
    VR_ERROR_MEMORY = -6,
    /// The allocator of device memory failed although the budget allowed the request.
    VR_ERROR_ALLOCATION = -7,
    /// A Vulkan call failed: vr_last_vulkan_result() has its code.
    VR_ERROR_VULKAN = -8,
    /// Work on the device did not end within the time limit.
    VR_ERROR_TIMEOUT = -9,
    /// A defect of the library was caught. Destroy the handles of the call; their other functions fail.
    VR_ERROR_PANIC = -10,
    /// The device was lost, during this call or before: vr_last_vulkan_result() is VK_ERROR_DEVICE_LOST. Destroy its handles.
    VR_ERROR_DEVICE_LOST = -11,
}

thread_local! {
    /// Message and Vulkan's code of the last failure.
    static LAST: RefCell<(CString, vk::Result)> = RefCell::default();
}

/// Returns the message of this thread's last failure: one line of UTF-8, never NULL, "" before the first failure. It is valid
/// until this thread's next failure or its end.
///
/// Threads: each has its own.
#[unsafe(no_mangle)]
pub extern "C" fn vr_last_error() -> *const c_char {
    LAST.try_with(|last| last.borrow().0.as_ptr()).unwrap_or(c"".as_ptr())
}

/// Returns the code of the failed Vulkan call if this thread's last failure was VR_ERROR_VULKAN, VK_ERROR_DEVICE_LOST if it
/// was VR_ERROR_DEVICE_LOST, else VK_SUCCESS.
///
/// Threads: each has its own.
#[unsafe(no_mangle)]
pub extern "C" fn vr_last_vulkan_result() -> VkResult {
    LAST.try_with(|last| last.borrow().1).unwrap_or(vk::Result::SUCCESS)
}

/// Returns the codes of a failure: the interface's and Vulkan's.
fn codes(error: &Error) -> (vr_result, vk::Result) {
    let code = match error {
        // The interface has no ranks.
        Error::Invalid { .. } | Error::Rank { .. } => vr_result::VR_ERROR_INVALID,
        Error::File { .. } => vr_result::VR_ERROR_FILE,
        Error::Io { .. } => vr_result::VR_ERROR_IO,
        Error::NoDevice { .. } => vr_result::VR_ERROR_NO_DEVICE,
        Error::Unsupported { .. } => vr_result::VR_ERROR_UNSUPPORTED,
        Error::Memory { .. } => vr_result::VR_ERROR_MEMORY,
        Error::Allocation { .. } => vr_result::VR_ERROR_ALLOCATION,
        Error::Vulkan { result, .. } => return (vr_result::VR_ERROR_VULKAN, *result),
        Error::Timeout { .. } => vr_result::VR_ERROR_TIMEOUT,
        Error::DeviceLost { .. } => {
            return (vr_result::VR_ERROR_DEVICE_LOST, vk::Result::ERROR_DEVICE_LOST);
        }
    };
    (code, vk::Result::SUCCESS)
}

/// Converts text for C; it ends before the first NUL.
pub(super) fn c_text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

/// Runs what a function of the interface does, and keeps the message of a failure.
pub(super) fn caught(work: impl FnOnce() -> Result<vr_result>) -> vr_result {
    // A panic poisons the lock of the state that it leaves half changed.
    let ((code, vulkan), message) = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(code)) => return code,
        Ok(Err(error)) => (codes(&error), error.to_string()),
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().copied();
            let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
            let text = format!("defect in volraster: {}", text.unwrap_or("no message"));
            // Dropping the payload might panic again.
            std::mem::forget(panic);
            ((vr_result::VR_ERROR_PANIC, vk::Result::SUCCESS), text)
        }
    };
    // Fails only while the thread ends.
    let _ = LAST.try_with(|last| last.replace((c_text(&message), vulkan)));
    code
}

/// Locks what a handle changes; fails if a panic left it half changed.
pub(super) fn lock<'a, T>(state: &'a Mutex<T>, name: &str) -> Result<MutexGuard<'a, T>> {
    let why = "an earlier call with it failed by a defect: destroy it";
    state.lock().map_err(|_| Error::invalid(name, why))
}

/// Runs the body of a function that succeeds or fails.
pub(super) fn call(caller: Caller, work: impl FnOnce(&Caller) -> Result<()>) -> vr_result {
    caught(|| work(&caller).map(|()| vr_result::VR_OK))
}

/// Runs the body of a function that makes a handle. The handle is null if it fails.
pub(super) fn make<T>(
    caller: Caller,
    (handle, name): (*mut *mut T, &str),
    work: impl FnOnce(&Caller) -> Result<T>,
) -> vr_result {
    call(caller, |caller| {
        caller.write(handle, std::ptr::null_mut(), name)?;
        caller.write(handle, Box::into_raw(Box::new(work(caller)?)), name)
    })
}

/// Destroys a handle; null is ignored.
///
/// # Safety
///
/// The handle is null, or was made by [`make`] and not destroyed before.
pub(super) unsafe fn destroy<T>(handle: *mut T) {
    if !handle.is_null() {
        caught(|| {
            // SAFETY: the caller's promise.
            drop(unsafe { Box::from_raw(handle) });
            Ok(vr_result::VR_OK)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    fn last() -> String {
        // SAFETY: ends with NUL, of this thread, which does not fail meanwhile.
        unsafe { CStr::from_ptr(vr_last_error()) }.to_str().unwrap().to_string()
    }

    #[test]
    fn a_panic_is_a_code_and_stays_inside() {
        assert_eq!(caught(|| panic!("number {}", 7)), vr_result::VR_ERROR_PANIC);
        assert!(last().ends_with("number 7"), "{}", last());
        assert_eq!(caught(|| panic!("plain")), vr_result::VR_ERROR_PANIC);
        assert!(last().ends_with("plain"), "{}", last());
        struct Bomb(u8);
        impl Drop for Bomb {
            fn drop(&mut self) {
                std::panic::panic_any(self.0);
            }
        }
        // SAFETY: a box.
        unsafe { destroy(Box::into_raw(Box::new(Bomb(7)))) };
        assert!(last().ends_with("no message"), "{}", last());
    }

    #[test]
    fn each_thread_has_its_last_failure() {
        let vulkan = || {
            let result = vk::Result::ERROR_DEVICE_LOST;
            caught(|| Err(Error::Vulkan { call: "vkQueueSubmit2", result }))
        };
        assert_eq!(vulkan(), vr_result::VR_ERROR_VULKAN);
        assert_eq!(vr_last_vulkan_result(), vk::Result::ERROR_DEVICE_LOST);
        std::thread::spawn(|| {
            assert_eq!((last().as_str(), vr_last_vulkan_result()), ("", vk::Result::SUCCESS));
            assert_eq!(caught(|| Err(Error::invalid("a", "b\0c"))), vr_result::VR_ERROR_INVALID);
            assert!(last().starts_with("invalid a: b"));
        })
        .join()
        .unwrap();
        assert!(last().contains("vkQueueSubmit2"), "{}", last());
        // A success does not change it.
        assert_eq!(caught(|| Ok(vr_result::VR_OK)), vr_result::VR_OK);
        assert!(last().contains("vkQueueSubmit2"));
        assert_eq!(caught(|| Err(Error::invalid("a", "b"))), vr_result::VR_ERROR_INVALID);
        assert_eq!(vr_last_vulkan_result(), vk::Result::SUCCESS);
    }
}
