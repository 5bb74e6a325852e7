//! The validation log: every message of the validation layers, kept per [`Gpu`](super::Gpu).

use std::ffi::{CStr, c_void};
use std::io::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use ash::vk;

/// What the Khronos validation layer is asked to check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validation {
    /// The layer is not loaded.
    #[default]
    Off,
    /// Core validation (parameters, object lifetimes, threads) and synchronization validation.
    On,
    /// The same with GPU-assisted validation, which instruments shaders.
    GpuAssisted,
    /// As `On`, with best practices: advice, much of it for other kinds of programs.
    BestPractices,
    /// All of these.
    Full,
}

impl Validation {
    /// Whether shaders are instrumented.
    pub(crate) fn gpu_assisted(self) -> bool {
        matches!(self, Self::GpuAssisted | Self::Full)
    }

    /// Whether advice is given.
    pub(crate) fn best_practices(self) -> bool {
        matches!(self, Self::BestPractices | Self::Full)
    }
}

/// Messages of the validation layers: errors, and warnings of the validation kind; with best practices also of the
/// performance kind. Each is `error ID: text` or `warning ID: text`, on one line or several.
///
/// Lives as long as anyone holds it, so that messages of the device's destruction are heard too.
#[derive(Debug, Default)]
pub struct ValidationLog {
    messages: Mutex<Vec<String>>,
    /// Whether advice about performance is kept, too.
    advice: AtomicBool,
    /// Whether messages are kept only, and not printed as they come.
    silent: AtomicBool,
}

impl ValidationLog {
    /// All messages so far.
    #[must_use]
    pub fn messages(&self) -> Vec<String> {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Takes all messages out.
    #[must_use]
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.messages.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Keeps messages from now on without printing them as they come.
    pub fn keep_silent(&self) {
        self.silent.store(true, Ordering::Relaxed);
    }

    /// Keeps advice about performance from now on.
    pub(crate) fn keep_advice(&self) {
        self.advice.store(true, Ordering::Relaxed);
    }

    fn push(&self, message: String) {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner).push(message);
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

/// Keeps errors and warnings of the validation kind, and advice where it is asked for. What loaders and drivers say about their own affairs
/// (a driver that finds no hardware, say) is not about this program.
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
    let label = if error { "error" } else { "warning" };
    let message = format!("{label} {}: {}", text(data.p_message_id_name), text(data.p_message));
    // At once: a program that breaks the rules may crash the driver before anyone reads the log.
    // A closed stderr must not end the program inside a callback.
    // Advice is no danger.
    if !message.contains("BestPractices") && !log.silent.load(Ordering::Relaxed) {
        let _ = writeln!(std::io::stderr(), "validation: {message}");
    }
    log.push(message);
    vk::FALSE
}
