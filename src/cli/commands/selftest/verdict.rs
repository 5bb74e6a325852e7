//! The result of a case.

use serde_json::{Value, json};

use crate::cli::output;

/// The result of a case.
pub(super) struct Done {
    pub(super) name: String,
    pub(super) status: Status,
    pub(super) ms: f64,
    pub(super) detail: String,
    /// Messages that are not allowed; `allowed` counts the allowed ones.
    pub(super) messages: Vec<String>,
    pub(super) allowed: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Status {
    Ok,
    Fail,
    Skip,
}

impl Status {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Fail => "FAIL",
            Self::Skip => "skip",
        }
    }
}

impl Done {
    /// Returns the line on stdout.
    pub(super) fn line(&self) -> String {
        format!(
            "{:4} {:60} {:8.1} ms  {}",
            self.status.name(),
            self.name,
            self.ms,
            output::plain(&self.detail)
        )
    }

    /// Returns the entry of the report.
    pub(super) fn json(&self) -> Value {
        json!({
            "name": self.name,
            "status": self.status.name().to_lowercase(),
            "ms": self.ms,
            "detail": self.detail,
            "messages": self.messages,
            "allowed_messages": self.allowed,
        })
    }
}
