//! Return codes, and the last message of each thread.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use ash::vk;

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

/// The last failure of a thread.
struct LastError {
    message: CString,
    vulkan: vk::Result,
}

thread_local! {
    static LAST: RefCell<LastError> =
        RefCell::new(LastError { message: CString::default(), vulkan: vk::Result::SUCCESS });
}

/// Returns the message of this thread's last failure: one line of UTF-8, never NULL, "" before the first failure. It is valid
/// until this thread's next failure or its end.
///
/// Threads: each has its own.
#[unsafe(no_mangle)]
pub extern "C" fn vr_last_error() -> *const c_char {
    LAST.try_with(|last| last.borrow().message.as_ptr()).unwrap_or(c"".as_ptr())
}

/// Returns the code of the failed Vulkan call if this thread's last failure was VR_ERROR_VULKAN, VK_ERROR_DEVICE_LOST if it
/// was VR_ERROR_DEVICE_LOST, else VK_SUCCESS.
///
/// Threads: each has its own.
#[unsafe(no_mangle)]
pub extern "C" fn vr_last_vulkan_result() -> VkResult {
    LAST.try_with(|last| last.borrow().vulkan).unwrap_or(vk::Result::SUCCESS)
}

fn code(error: &Error) -> vr_result {
    match error {
        Error::Invalid { .. } => vr_result::VR_ERROR_INVALID,
        Error::File { .. } => vr_result::VR_ERROR_FILE,
        Error::Io { .. } => vr_result::VR_ERROR_IO,
        Error::NoDevice { .. } => vr_result::VR_ERROR_NO_DEVICE,
        Error::Unsupported { .. } => vr_result::VR_ERROR_UNSUPPORTED,
        Error::Memory { .. } => vr_result::VR_ERROR_MEMORY,
        Error::Allocation { .. } => vr_result::VR_ERROR_ALLOCATION,
        Error::Vulkan { .. } => vr_result::VR_ERROR_VULKAN,
        Error::Timeout { .. } => vr_result::VR_ERROR_TIMEOUT,
        Error::DeviceLost { .. } => vr_result::VR_ERROR_DEVICE_LOST,
    }
}

/// Converts text for C; it ends before the first NUL.
pub(super) fn c_text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

fn fail(code: vr_result, message: &str, vulkan: vk::Result) -> vr_result {
    let last = LastError { message: c_text(message), vulkan };
    // Fails only while the thread ends.
    let _ = LAST.try_with(|place| place.replace(last));
    code
}

/// Runs the body of a function of the interface.
pub(super) fn call(work: impl FnOnce() -> Result<vr_result>) -> vr_result {
    // A panic poisons the lock of the state that it leaves half changed.
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(code)) => code,
        Ok(Err(error)) => {
            let vulkan = match error {
                Error::Vulkan { result, .. } => result,
                Error::DeviceLost { .. } => vk::Result::ERROR_DEVICE_LOST,
                _ => vk::Result::SUCCESS,
            };
            fail(code(&error), &error.to_string(), vulkan)
        }
        Err(panic) => panicked(panic),
    }
}

/// Runs the body of a function that returns nothing.
pub(super) fn quietly(work: impl FnOnce()) {
    if let Err(panic) = catch_unwind(AssertUnwindSafe(work)) {
        panicked(panic);
    }
}

fn panicked(panic: Box<dyn Any + Send>) -> vr_result {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    // Dropping the payload might panic again.
    std::mem::forget(panic);
    let text = text.unwrap_or_else(|| "no message".to_string());
    fail(vr_result::VR_ERROR_PANIC, &format!("defect in volraster: {text}"), vk::Result::SUCCESS)
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
        assert_eq!(call(|| panic!("number {}", 7)), vr_result::VR_ERROR_PANIC);
        assert!(last().ends_with("number 7"), "{}", last());
        assert_eq!(call(|| panic!("plain")), vr_result::VR_ERROR_PANIC);
        assert!(last().ends_with("plain"), "{}", last());
        quietly(|| std::panic::panic_any(7));
        assert!(last().ends_with("no message"), "{}", last());
    }

    #[test]
    fn each_thread_has_its_last_failure() {
        let vulkan = || {
            let result = vk::Result::ERROR_DEVICE_LOST;
            call(|| Err(Error::Vulkan { call: "vkQueueSubmit2", result }))
        };
        assert_eq!(vulkan(), vr_result::VR_ERROR_VULKAN);
        assert_eq!(vr_last_vulkan_result(), vk::Result::ERROR_DEVICE_LOST);
        std::thread::spawn(|| {
            assert_eq!((last().as_str(), vr_last_vulkan_result()), ("", vk::Result::SUCCESS));
            assert_eq!(call(|| Err(Error::invalid("a", "b\0c"))), vr_result::VR_ERROR_INVALID);
            assert!(last().starts_with("invalid a: b"));
        })
        .join()
        .unwrap();
        assert!(last().contains("vkQueueSubmit2"), "{}", last());
        // A success does not change it.
        assert_eq!(call(|| Ok(vr_result::VR_OK)), vr_result::VR_OK);
        assert!(last().contains("vkQueueSubmit2"));
        assert_eq!(call(|| Err(Error::invalid("a", "b"))), vr_result::VR_ERROR_INVALID);
        assert_eq!(vr_last_vulkan_result(), vk::Result::SUCCESS);
    }
}
