//! How a command ends.

use volraster::Error;
use volraster::gpu::ValidationLog;

use crate::cli::interrupt;

/// Why a run does not end with exit code 0.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Something could not be done.
    Error(Error),
    /// Everything was done, and what came out is wrong.
    Finding(String),
    /// The user has stopped it.
    Interrupted(String),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

impl Failure {
    /// The line for stderr.
    pub(super) fn line(&self) -> String {
        match self {
            Self::Error(error) => error.to_string(),
            Self::Finding(text) | Self::Interrupted(text) => text.clone(),
        }
    }

    /// 0 done, 2 wrong input or usage, 3 the device cannot do it, 130 stopped, 1 anything else.
    pub(super) fn exit_code(&self) -> u8 {
        match self {
            Self::Error(error) => error.exit_code(),
            Self::Finding(_) => 1,
            Self::Interrupted(_) => interrupt::EXIT_CODE,
        }
    }
}

/// How a command ends.
pub(crate) type Outcome = Result<(), Failure>;

/// A finding, when the validation layers said anything. To be asked when the device is gone: the
/// messages of its destruction count.
///
/// # Errors
///
/// [`Failure::Finding`] with the number of messages.
pub(crate) fn check_validation(log: &ValidationLog) -> Outcome {
    match log.messages().len() {
        0 => Ok(()),
        1 => Err(Failure::Finding("the validation layers gave 1 message".to_string())),
        n => Err(Failure::Finding(format!("the validation layers gave {n} messages"))),
    }
}
