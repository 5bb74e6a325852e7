//! Goals of a choice.

use crate::error::{Error, Result};

/// Selects what a choice limits and what it minimises.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Largest root mean square error of premultiplied colour. The fastest setting within it is chosen.
    MaxError(f64),
    /// Longest time of a frame, in milliseconds. The most accurate setting within it is chosen.
    Budget(f64),
}

impl Goal {
    /// Returns the threshold of early ray termination: the largest remaining colour, a small part of the allowed error. Frames of a grid in
    /// pages may end within the same ([`Frames::stop_within`](crate::Frames::stop_within)).
    #[must_use]
    pub fn stop(self) -> f64 {
        match self {
            Self::MaxError(error) => (error / 8.0).min(0.01),
            Self::Budget(_) => 1e-4,
        }
    }

    /// Returns the largest value of the cost that is limited.
    pub(super) fn limit(self) -> f64 {
        match self {
            Self::MaxError(limit) | Self::Budget(limit) => limit,
        }
    }

    /// Returns the cost that is limited, then the one that is minimised, of an error and a time.
    pub(super) fn axes(self, [error, ms]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::MaxError(_) => [error, ms],
            Self::Budget(_) => [ms, error],
        }
    }

    /// Checks the number.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] unless the number is finite and positive.
    pub(super) fn check(self) -> Result<()> {
        let (what, value) = match self {
            Self::MaxError(error) => ("largest error", error),
            Self::Budget(ms) => ("budget", ms),
        };
        if value.is_finite() && value > 0.0 {
            return Ok(());
        }
        Err(Error::invalid(what, format!("{value}: must be a positive number")))
    }
}
