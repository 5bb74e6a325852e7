//! The crate's one error type.

use std::path::{Path, PathBuf};

/// Everything that can go wrong, by who can do something about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The caller passed a value that breaks a rule. Nothing reached the device.
    #[error("invalid {}: {}", line(what), line(why))]
    Invalid {
        /// The value's name, as the caller knows it.
        what: String,
        /// The value and the rule that it breaks.
        why: String,
    },
    /// A file's contents break a rule of its format.
    #[error("{}: {}: {}", shown(path), line(place), line(rule))]
    File {
        /// The file.
        path: PathBuf,
        /// The place in it: a field, a key, a line, a byte offset.
        place: String,
        /// What was found there and the rule that it breaks.
        rule: String,
    },
    /// A file cannot be opened, read or written.
    #[error("{}: {action}: {source}", shown(path))]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried, such as `cannot open`.
        action: &'static str,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// No usable Vulkan: no loader, no driver, no device that qualifies.
    #[error("no usable Vulkan device: {why}")]
    NoDevice {
        /// What is missing; for devices, why each one was passed over.
        why: String,
    },
    /// The device, or this build, lacks something that the request needs.
    #[error("{what}: not supported by this device: {missing}")]
    Unsupported {
        /// What was asked for.
        what: String,
        /// The feature, format or limit that is missing, with its numbers.
        missing: String,
    },
    /// The request needs more device memory than there is to give.
    #[error(
        "{object}: needs {needed} bytes of device memory, {available} are left of the budget of {budget}"
    )]
    Memory {
        /// What the memory is for.
        object: String,
        /// Bytes that it needs.
        needed: u64,
        /// Bytes that are left.
        available: u64,
        /// The whole budget, in bytes.
        budget: u64,
    },
    /// The device memory allocator failed although the budget allowed the request.
    #[error("{object}: device memory allocation failed: {source}")]
    Allocation {
        /// What the memory is for.
        object: String,
        /// What the allocator said.
        source: gpu_allocator::AllocationError,
    },
    /// A Vulkan call failed.
    #[error("{call} failed: {result}")]
    Vulkan {
        /// The call.
        call: &'static str,
        /// Its return code.
        result: ash::vk::Result,
    },
    /// The device is lost: a fault of the driver, the hardware or a shader ended it. Nothing more can be done on it; its
    /// objects can be dropped, and another device be opened.
    #[error("the device is lost (told by {call}): open it again")]
    DeviceLost {
        /// The call that told first.
        call: &'static str,
    },
    /// Work on the device did not end in time.
    #[error("{what} did not finish within {seconds} s (last pass begun: {last_pass})")]
    Timeout {
        /// What was waited for.
        what: String,
        /// How long, in seconds.
        seconds: u64,
        /// The last pass that was recorded into the submission.
        last_pass: String,
    },
}

/// A path in one line: a name may hold anything.
fn shown(path: &Path) -> String {
    line(&path.display().to_string())
}

/// Text in one line: messages quote what stands in files.
fn line(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() { line.extend(c.escape_default()) } else { line.push(c) }
    }
    line
}

/// The crate's result type.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    pub(crate) fn invalid(what: impl Into<String>, why: impl Into<String>) -> Self {
        Self::Invalid { what: what.into(), why: why.into() }
    }

    pub(crate) fn file(path: &Path, place: impl Into<String>, rule: impl Into<String>) -> Self {
        Self::File { path: path.to_path_buf(), place: place.into(), rule: rule.into() }
    }

    pub(crate) fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), action, source }
    }

    /// A call that failed. To be made by what knows the device, where there is one, which remembers a loss.
    pub(crate) fn vulkan(call: &'static str, result: ash::vk::Result) -> Self {
        if result == ash::vk::Result::ERROR_DEVICE_LOST {
            Self::DeviceLost { call }
        } else {
            Self::Vulkan { call, result }
        }
    }

    pub(crate) fn unsupported(what: impl Into<String>, missing: impl Into<String>) -> Self {
        Self::Unsupported { what: what.into(), missing: missing.into() }
    }

    /// Gives an error about a value the file that the value came from.
    #[must_use]
    pub fn in_file(self, path: &Path) -> Self {
        match self {
            Self::Invalid { what, why } => Self::file(path, what, why),
            other => other,
        }
    }

    /// The program's exit code for this error: 2 wrong input or usage, 3 the device cannot do it,
    /// 1 anything else.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Invalid { .. } | Self::File { .. } | Self::Io { .. } => 2,
            Self::NoDevice { .. }
            | Self::Unsupported { .. }
            | Self::Memory { .. }
            | Self::DeviceLost { .. } => 3,
            Self::Allocation { .. } | Self::Vulkan { .. } | Self::Timeout { .. } => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_quoted_stays_in_one_line() {
        let error = Error::file(Path::new("a\nb\u{7}é.raw"), "key\r\n", "\t0");
        assert_eq!(error.to_string(), "a\\nb\\u{7}é.raw: key\\r\\n: \\t0");
    }
}
