//! Messages of validation layers that are no fault, each with its reason: `allowed.json`.

use std::cell::Cell;

use serde::Deserialize;
use serde_json::{Value, json};
use volraster::{Error, Result};

/// A message that may come.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// Its id, whole.
    id: String,
    /// How the names of cases begin in which it may come.
    #[serde(rename = "where")]
    place: String,
    /// What stands in it; for messages of which some are a fault.
    #[serde(default)]
    text: String,
    /// Why it is no fault.
    reason: String,
    #[serde(skip)]
    matched: Cell<u64>,
}

/// The list.
#[derive(Debug)]
pub(crate) struct Allowed(Vec<Entry>);

impl Allowed {
    /// The crate's own list.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if it does not hold; the test below sees that it does.
    pub(crate) fn of_crate() -> Result<Self> {
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

    /// Whether a message may come in a case; counts it then.
    pub(crate) fn allows(&self, case: &str, message: &str) -> bool {
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

    /// Ids of entries that no message has had.
    pub(crate) fn unused(&self) -> Vec<&str> {
        self.0.iter().filter(|entry| entry.matched.get() == 0).map(|entry| entry.id.as_str()).collect()
    }

    /// The list with how often each entry was needed.
    pub(crate) fn json(&self) -> Value {
        let entry = |entry: &Entry| json!({"id": entry.id, "where": entry.place, "text": entry.text, "reason": entry.reason, "matched": entry.matched.get()});
        self.0.iter().map(entry).collect()
    }
}

/// The id of a message: `error ID: text`.
pub(crate) fn id_of(message: &str) -> &str {
    message.split_whitespace().nth(1).map_or("", |id| id.trim_end_matches(':'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_the_crate_holds() {
        assert!(Allowed::of_crate().is_ok());
    }

    #[test]
    fn an_entry_allows_its_message_in_its_place_alone() {
        let list = r#"[{"id": "VUID-a", "where": "draw/", "reason": "r"}, {"id": "VUID-b", "where": "", "reason": "r"}]"#;
        let allowed = Allowed::parse(list).unwrap();
        assert!(allowed.allows("draw/x", "warning VUID-a: text of VUID-b"));
        assert!(!allowed.allows("flight/x", "error VUID-a: text"));
        assert!(!allowed.allows("draw/x", "error VUID-aa: VUID-a"));
        assert_eq!(allowed.unused(), ["VUID-b"]);
        let some = Allowed::parse(r#"[{"id": "a", "where": "", "text": "this", "reason": "r"}]"#).unwrap();
        assert!(some.allows("x", "warning a: of this") && !some.allows("x", "warning a: of that"));
        assert_eq!(allowed.json()[0]["matched"], 1);
        assert!(Allowed::parse(r#"[{"id": "VUID-a", "where": "", "reason": ""}]"#).is_err());
    }
}
