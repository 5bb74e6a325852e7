//! The crate's one error type.

use std::path::{Path, PathBuf};

/// Everything that can go wrong. The variants differ in who can correct the cause.
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
        /// The action that failed, such as `cannot open`.
        action: &'static str,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// No usable Vulkan: no loader, no driver, no device that qualifies.
    #[error("no usable Vulkan device: {why}")]
    NoDevice {
        /// The missing part; for devices, the reason why each one was rejected.
        why: String,
    },
    /// The device, or this build, lacks something that the request needs.
    #[error("{what}: not supported by this device: {missing}")]
    Unsupported {
        /// The requested thing.
        what: String,
        /// The feature, format or limit that is missing, with its numbers.
        missing: String,
    },
    /// The request needs more device memory than is available.
    #[error(
        "{object}: needs {needed} bytes of device memory, {available} are left of the budget of {budget}"
    )]
    Memory {
        /// The object that needs the memory.
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
        /// The object that needs the memory.
        object: String,
        /// The allocator's error.
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
    /// The device is lost: a fault of the driver, the hardware or a shader ended it. It can no longer be
    /// used; drop its objects and open a device again.
    #[error("the device is lost (reported by {call}): open it again")]
    DeviceLost {
        /// The first call that reported the loss.
        call: &'static str,
    },
    /// Another process of several that draw one image has failed.
    #[error("rank {rank}: {}", line(why))]
    Rank {
        /// The number of the process.
        rank: u32,
        /// The exit code of its error.
        code: u8,
        /// The text of its error.
        why: String,
    },
    /// Work on the device did not end in time.
    #[error("{what} did not finish within {seconds} s (last pass begun: {last_pass})")]
    Timeout {
        /// The operation that did not end.
        what: String,
        /// The time limit, in seconds.
        seconds: u64,
        /// The last pass that was recorded into the submission.
        last_pass: String,
    },
}

/// Returns a path in one line: file names may contain control characters.
fn shown(path: &Path) -> String {
    line(&path.display().to_string())
}

/// Returns text in one line with control characters escaped, since messages quote the contents of files.
fn line(text: &str) -> String {
    /// Longer texts are quoted input: their ends tell enough.
    const MOST: usize = 2000;
    let mut line = String::with_capacity(text.len().min(MOST));
    let count = text.chars().count();
    let skipped = if count > MOST { MOST / 2..count - MOST / 4 } else { 0..0 };
    for (i, c) in text.chars().enumerate() {
        match c {
            _ if i == skipped.start && i < skipped.end => line.push_str(" [...] "),
            _ if skipped.contains(&i) => {}
            c if c.is_control() => line.extend(c.escape_default()),
            c => line.push(c),
        }
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

    /// Makes the error of a Vulkan call that failed.
    ///
    /// Where a device exists, its own function is to be used instead, because it records a loss.
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

    /// Turns an error about a value into one about the file that the value came from.
    #[must_use]
    pub fn in_file(self, path: &Path) -> Self {
        match self {
            Self::Invalid { what, why } => Self::file(path, what, why),
            other => other,
        }
    }

    /// Returns the program's exit code for this error: 2 for wrong input or usage, 3 if the
    /// device cannot do it, 1 for anything else.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            // Nothing is wrong with the input where there is no space left.
            Self::Io { source, .. } if is_full(source.kind()) => 1,
            Self::Invalid { .. } | Self::File { .. } | Self::Io { .. } => 2,
            Self::NoDevice { .. }
            | Self::Unsupported { .. }
            | Self::Memory { .. }
            | Self::DeviceLost { .. } => 3,
            Self::Rank { code, .. } => *code,
            Self::Allocation { .. } | Self::Vulkan { .. } | Self::Timeout { .. } => 1,
        }
    }
}

fn is_full(kind: std::io::ErrorKind) -> bool {
    use std::io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    matches!(kind, StorageFull | QuotaExceeded | FileTooLarge)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_no_wrong_input() {
        let code =
            |kind: std::io::ErrorKind| Error::io(Path::new("a.exr"), "cannot write", kind.into()).exit_code();
        assert_eq!(code(std::io::ErrorKind::StorageFull), 1);
        assert_eq!(code(std::io::ErrorKind::PermissionDenied), 2);
    }

    #[test]
    fn what_is_quoted_stays_in_one_line() {
        let error = Error::file(Path::new("a\nb\u{7}é.raw"), "key\r\n", "\t0");
        assert_eq!(error.to_string(), "a\\nb\\u{7}é.raw: key\\r\\n: \\t0");
        let long = Error::invalid("technique", format!("\"{}\": must be one of a, b", "é".repeat(1 << 20)))
            .to_string();
        assert!(
            long.len() < 4000 && long.starts_with("invalid technique: \"éé") && long.ends_with("b"),
            "{long}"
        );
    }
}
