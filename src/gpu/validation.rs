//! The validation log, which collects the messages of the validation layer for each [`Gpu`](super::Gpu).

use std::ffi::{CStr, c_void};
use std::io::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use ash::vk;

/// Checks of the Khronos validation layer.
///
/// Version 1.3.239 of the layer crashes when threads record commands or destroy command pools at the same time. The crate
/// serialises its own such calls; programs whose threads record on the device themselves set the environment variable
/// `VK_LAYER_FINE_GRAINED_LOCKING=0`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validation {
    /// The layer is not loaded.
    #[default]
    Off,
    /// Core validation (parameters, lifetimes of objects, threads) and synchronization validation.
    On,
    /// As `On`, with GPU-assisted validation, which instruments shaders.
    GpuAssisted,
    /// As `On`, with best practices: advice on performance, much of it for other kinds of programs.
    BestPractices,
    /// All of these.
    Full,
}

impl Validation {
    /// Returns whether shaders are instrumented.
    pub(crate) fn gpu_assisted(self) -> bool {
        matches!(self, Self::GpuAssisted | Self::Full)
    }

    /// Returns whether best practices are checked.
    pub(crate) fn best_practices(self) -> bool {
        matches!(self, Self::BestPractices | Self::Full)
    }
}

/// Beginnings of the ids of messages that are not about the calls of a program: the layer tells how it adjusts its own settings, and that
/// a driver asks a device for commands of the instance, as 580 of NVIDIA does. Neither this crate nor `ash` does.
const NOT_OF_CALLS: [&str; 3] =
    ["VALIDATION-SETTINGS", "WARNING-Setting", "WARNING-vkGetDeviceProcAddr-device"];

/// Errors and warnings of the validation layer; with best practices also its advice on performance. Each message is
/// `error ID: text` or `warning ID: text`, on one line or several. Messages that are not about calls of a program are left out: how the
/// layer adjusts its settings, and what drivers ask for.
///
/// The log outlives the device if the caller holds it, and then also has the messages of the device's destruction.
#[derive(Debug, Default)]
pub struct ValidationLog {
    messages: Mutex<Vec<String>>,
    /// Whether advice on performance is kept, too.
    advice: AtomicBool,
    /// Whether messages are not printed as they arrive.
    silent: AtomicBool,
}

impl ValidationLog {
    /// Returns all messages so far.
    #[must_use]
    pub fn messages(&self) -> Vec<String> {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Removes and returns all messages.
    #[must_use]
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.messages.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Stops printing messages as they arrive.
    pub fn keep_silent(&self) {
        self.silent.store(true, Ordering::Relaxed);
    }

    /// Starts to keep advice on performance.
    pub(crate) fn keep_advice(&self) {
        self.advice.store(true, Ordering::Relaxed);
    }
}

/// Describes the messenger that fills `log`. The log must outlive the messenger.
pub(crate) fn messenger_info(log: &ValidationLog) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(
            vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
        )
        .message_type(
            vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                | vk::DebugUtilsMessageTypeFlagsEXT::GENERAL
                | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
        )
        .pfn_user_callback(Some(on_message))
        .user_data(std::ptr::from_ref(log).cast_mut().cast())
}

/// Keeps errors and warnings of the validation kind, and advice where it is requested. General messages of loaders and
/// drivers, such as that no hardware was found, are ignored.
unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    use vk::DebugUtilsMessageTypeFlagsEXT as Kind;
    let error = severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR);
    if !kind.intersects(Kind::VALIDATION | Kind::PERFORMANCE) {
        return vk::FALSE;
    }
    // SAFETY: the loader passes a valid callback structure for the length of this call.
    let Some(data) = (unsafe { data.as_ref() }) else { return vk::FALSE };
    // SAFETY: `user` is the log given to `messenger_info`, which outlives the messenger.
    let Some(log) = (unsafe { user.cast::<ValidationLog>().as_ref() }) else { return vk::FALSE };
    if !kind.contains(Kind::VALIDATION) && !log.advice.load(Ordering::Relaxed) {
        return vk::FALSE;
    }
    let text = |pointer: *const std::ffi::c_char| {
        if pointer.is_null() {
            return String::new();
        }
        // SAFETY: the strings of a callback structure are null or zero-terminated.
        unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
    };
    let id = text(data.p_message_id_name);
    if NOT_OF_CALLS.iter().any(|other| id.starts_with(other)) {
        return vk::FALSE;
    }
    let label = if error { "error" } else { "warning" };
    let message = format!("{label} {id}: {}", text(data.p_message));
    // Printed at once: a program that breaks the rules may crash the driver before anyone reads the log. `writeln!` to a
    // closed stderr must not panic inside a callback. Advice is not urgent.
    if !message.contains("BestPractices") && !log.silent.load(Ordering::Relaxed) {
        let _ = writeln!(std::io::stderr(), "validation: {message}");
    }
    log.messages.lock().unwrap_or_else(PoisonError::into_inner).push(message);
    vk::FALSE
}
