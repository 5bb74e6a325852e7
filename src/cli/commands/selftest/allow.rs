//! Validation messages that are allowed, each with its reason: `allowed.json`.

use std::cell::Cell;

use serde::{Deserialize, Serialize};
use volraster::{Error, Result};

use crate::cli::outcome::id_of;

/// An allowed message.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// The complete message id.
    id: String,
    /// Prefix of the names of the cases in which it is allowed.
    #[serde(rename = "where")]
    place: String,
    /// Text that it must contain, where only some messages of the id are allowed.
    #[serde(default)]
    text: String,
    /// Why it is allowed.
    reason: String,
    /// Number of messages that it matched.
    #[serde(skip_deserializing)]
    matched: Cell<u64>,
}

/// The list of allowed messages.
#[derive(Debug, Serialize)]
pub(super) struct Allowed(Vec<Entry>);

impl Allowed {
    /// Returns the list of the crate.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the list is malformed, which a test below rules out.
    pub(super) fn of_crate() -> Result<Self> {
        Self::parse(include_str!("allowed.json"))
    }

    fn parse(text: &str) -> Result<Self> {
        let wrong = |why: String| Error::Invalid { what: "list of allowed messages".to_string(), why };
        let entries: Vec<Entry> = serde_json::from_str(text).map_err(|error| wrong(error.to_string()))?;
        match entries.iter().find(|entry| entry.id.is_empty() || entry.reason.is_empty()) {
            Some(entry) => Err(wrong(format!("{}: id and reason must not be empty", entry.id))),
            None => Ok(Self(entries)),
        }
    }

    /// Returns whether a message is allowed in a case, and counts it.
    pub(super) fn allows(&self, case: &str, message: &str) -> bool {
        let id = id_of(message);
        let found = self
            .0
            .iter()
            .find(|entry| entry.id == id && case.starts_with(&entry.place) && message.contains(&entry.text));
        if let Some(entry) = found {
            entry.matched.set(entry.matched.get() + 1);
        }
        found.is_some()
    }

    /// Returns the ids of entries that matched no message.
    pub(super) fn unused(&self) -> Vec<&str> {
        self.0.iter().filter(|entry| entry.matched.get() == 0).map(|entry| entry.id.as_str()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_the_crate_is_valid() {
        assert!(Allowed::of_crate().is_ok());
    }

    #[test]
    fn an_entry_allows_its_message_only_in_its_cases() {
        let list = r#"[{"id": "VUID-a", "where": "draw/", "reason": "r"}, {"id": "VUID-b", "where": "", "reason": "r"}]"#;
        let allowed = Allowed::parse(list).unwrap();
        assert!(allowed.allows("draw/x", "warning VUID-a: text of VUID-b"));
        assert!(!allowed.allows("flight/x", "error VUID-a: text"));
        assert!(!allowed.allows("draw/x", "error VUID-aa: VUID-a"));
        assert_eq!(allowed.unused(), ["VUID-b"]);
        let some = Allowed::parse(r#"[{"id": "a", "where": "", "text": "this", "reason": "r"}]"#).unwrap();
        assert!(some.allows("x", "warning a: of this") && !some.allows("x", "warning a: of that"));
        assert_eq!(serde_json::json!(allowed)[0]["matched"], 1);
        assert!(Allowed::parse(r#"[{"id": "VUID-a", "where": "", "reason": ""}]"#).is_err());
    }
}
