//! Failures of commands and their exit codes.

use volraster::Error;
use volraster::gpu::ValidationLog;

use crate::cli::interrupt;
use crate::cli::numbers::counted;

/// A failure; the run ends with an exit code other than 0.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// The command could not do its work.
    #[error(transparent)]
    Error(#[from] Error),
    /// The command did its work and found something wrong.
    #[error("{0}")]
    Finding(String),
    /// A comparison found an image that has changed.
    #[error("{0}")]
    Changed(String),
    /// A comparison found a case that is slower.
    #[error("{0}")]
    Slower(String),
    /// The user interrupted the command.
    #[error("{0}")]
    Interrupted(String),
}

impl Failure {
    /// Returns the exit code: 2 wrong input or usage, 3 no device or feature, 4 slower, 5 an image has changed, 130 interrupted, 1
    /// anything else.
    pub(super) fn exit_code(&self) -> u8 {
        match self {
            Self::Error(error) => error.exit_code(),
            Self::Finding(_) => 1,
            Self::Slower(_) => 4,
            Self::Changed(_) => 5,
            Self::Interrupted(_) => interrupt::EXIT_CODE,
        }
    }
}

/// The result of a command.
pub(crate) type Outcome = Result<(), Failure>;

/// Fails if the validation layers gave messages. Call it after the device has been destroyed, which may cause
/// messages too.
pub(crate) fn check_validation(log: &ValidationLog) -> Outcome {
    messages_found(log.messages().len())
}

/// Fails if the validation layers gave so many messages.
pub(crate) fn messages_found(count: usize) -> Outcome {
    match count {
        0 => Ok(()),
        n => Err(Failure::Finding(format!("the validation layers gave {}", counted(n, "message")))),
    }
}

/// Returns the id in a message of the form `error ID: text`, without the prefix that newer layers have dropped.
pub(crate) fn id_of(message: &str) -> &str {
    let id = message.split_whitespace().nth(1).map_or("", |id| id.trim_end_matches(':'));
    id.strip_prefix("UNASSIGNED-").unwrap_or(id)
}
