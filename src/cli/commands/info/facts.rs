//! Facts about a file, collected as JSON and as lines of text.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Map, Value, json};
use volraster::io::{ArrayInfo, Report};

use crate::cli::output;

/// Maximum number of arrays in the text; the JSON lists all.
const LISTED_ARRAYS: usize = 32;

/// Facts about a file, as JSON and as lines of a word and a text.
pub(super) struct Facts {
    pub(super) json: Map<String, Value>,
    pub(super) lines: Vec<(&'static str, String)>,
    /// Text after the lines.
    pub(super) tail: String,
}

impl Facts {
    /// Starts with the facts about every file; `data` is the file of the data itself.
    pub(super) fn new(file: &Path, kind: &str, data: &Path, report: &Report) -> Self {
        let mut facts = Self { json: Map::new(), lines: Vec::new(), tail: String::new() };
        // Folders have no size, and the file may be gone by now.
        let size = std::fs::metadata(data).ok().filter(std::fs::Metadata::is_file);
        let size = size.map(|metadata| metadata.len());
        let file = file.display().to_string();
        facts.put(json!({"file": file, "kind": kind, "format": report.format, "file_bytes": size}));
        let size = size.map_or_else(String::new, |size| format!(", {size} bytes"));
        facts.line("format", format!("{} ({kind}){size}", report.format));
        facts
    }

    /// Adds the members of an object to the JSON.
    pub(super) fn put(&mut self, object: Value) {
        if let Value::Object(members) = object {
            self.json.extend(members);
        }
    }

    /// Adds a line of text.
    pub(super) fn line(&mut self, word: &'static str, text: String) {
        self.lines.push((word, text));
    }

    /// Adds lines of text under one word: at most `most`, and the number of the others.
    pub(super) fn list(&mut self, word: &'static str, most: usize, texts: &[String]) {
        let rest = texts.len().saturating_sub(most);
        let more = (rest > 0).then(|| format!("and {rest} more"));
        for (i, text) in texts.iter().take(most).cloned().chain(more).enumerate() {
            self.line(if i == 0 { word } else { "" }, text);
        }
    }

    /// Adds the arrays of the file, and which one is shown.
    pub(super) fn arrays(&mut self, report: &Report) {
        let shown = shown(report);
        let json_of = |(i, array): (usize, &ArrayInfo)| {
            json!({
                "name": array.name, "association": array.association.name(), "type": array.kind.name(),
                "components": array.components, "shown": shown == Some(i),
            })
        };
        let text_of = |(i, array): (usize, &ArrayInfo)| match &report.shown {
            Some(name) if shown == Some(i) => format!("{array}, shown as {name}"),
            _ => array.to_string(),
        };
        let arrays = || report.arrays.iter().enumerate();
        self.put(json!({"arrays": arrays().map(json_of).collect::<Value>(), "shown": report.shown}));
        self.list("arrays", LISTED_ARRAYS, &arrays().map(text_of).collect::<Vec<_>>());
    }

    /// Adds the notes and warnings of the reader.
    pub(super) fn remarks(&mut self, report: &Report) {
        self.put(json!({"notes": report.notes, "warnings": report.warnings}));
        for note in &report.notes {
            self.line("note", note.clone());
        }
        for warning in &report.warnings {
            self.line("warning", warning.clone());
        }
    }

    /// Returns all lines below the name of the file.
    pub(super) fn text(&self, file: &Path) -> String {
        let width = self.lines.iter().map(|(word, _)| word.len()).max().unwrap_or(0);
        let mut text = output::plain(&file.display().to_string());
        for (word, line) in &self.lines {
            // Writing into a string cannot fail.
            let _ = write!(text, "\n  {word:<width$}  {}", output::plain(line));
        }
        text.push_str(&self.tail);
        text
    }
}

/// Returns the index of the shown array: the one with the longest matching name.
fn shown(report: &Report) -> Option<usize> {
    let shown = report.shown.as_deref()?;
    let fits = |array: &ArrayInfo| {
        let rest = shown.strip_prefix(array.association.name())?.strip_prefix(':')?;
        let rest = rest.strip_prefix(array.name.as_str())?;
        (rest.is_empty() || rest.starts_with(':')).then_some(array.name.len())
    };
    let lengths = report.arrays.iter().enumerate().filter_map(|(i, array)| Some((fits(array)?, i)));
    // Among equal names readers find the first.
    lengths.max_by_key(|&(length, i)| (length, std::cmp::Reverse(i))).map(|(_, i)| i)
}
