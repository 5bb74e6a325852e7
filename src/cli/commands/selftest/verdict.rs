//! Results.

use serde_json::{Value, json};

use crate::cli::output;

/// What came of a case.
pub(super) struct Done {
    pub(super) name: String,
    pub(super) status: Status,
    pub(super) ms: f64,
    pub(super) detail: String,
    /// Messages that are a fault, and how many are none.
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
    pub(super) fn line(&self) -> String {
        format!(
            "{:4} {:60} {:8.1} ms  {}",
            self.status.name(),
            self.name,
            self.ms,
            output::plain(&self.detail)
        )
    }

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
