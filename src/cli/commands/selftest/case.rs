//! A case of the self-test, and its result.

use serde::Serialize;
use volraster::technique::Method;

use super::workbench::{Verdict, Workbench};
use crate::cli::output;

/// A check with a name.
pub(super) struct Case {
    pub(super) name: String,
    /// The technique under test; `None` for checks of all or none.
    pub(super) method: Option<Method>,
    pub(super) run: Box<dyn Fn(&Workbench) -> Verdict>,
}

/// The result of a case, as an entry of the report.
#[derive(Serialize)]
pub(super) struct Done {
    pub(super) name: String,
    pub(super) status: Status,
    pub(super) ms: f64,
    pub(super) detail: String,
    /// Messages that are not allowed.
    pub(super) messages: Vec<String>,
    /// Number of messages that are allowed.
    pub(super) allowed_messages: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Status {
    Ok,
    Fail,
    Skip,
}

impl Done {
    /// Returns a result without messages.
    pub(super) fn new(name: String, status: Status, ms: f64, detail: String) -> Self {
        Self { name, status, ms, detail, messages: Vec::new(), allowed_messages: 0 }
    }

    /// Returns the line on stdout.
    pub(super) fn line(&self) -> String {
        let status = match self.status {
            Status::Ok => "ok",
            Status::Fail => "FAIL",
            Status::Skip => "skip",
        };
        let (name, ms, detail) = (&self.name, self.ms, output::plain(&self.detail));
        format!("{status:4} {name:60} {ms:8.1} ms  {detail}")
    }
}
