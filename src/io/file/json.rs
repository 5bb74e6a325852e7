//! Reading of JSON files; errors give line, column and key.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;

/// The limit on the size of a JSON file, in bytes.
const MAX_JSON: u64 = 256 << 20;

/// Reads and parses a JSON file; errors give line, column and key.
pub(crate) fn parse_file<T: for<'de> Deserialize<'de>>(path: &Path, options: &ReadOptions) -> Result<T> {
    let metadata = std::fs::metadata(path).map_err(|e| Error::io(path, "cannot open", e))?;
    let most = MAX_JSON.min(options.max_bytes);
    if !metadata.is_file() || metadata.len() > most {
        return Err(Error::file(path, "file", format!("must be a regular file of at most {most} bytes")));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "cannot read", e))?;
    parse(path, &bytes)
}

/// Parses JSON of a file; errors give line, column and key.
pub(crate) fn parse<T: for<'de> Deserialize<'de>>(path: &Path, bytes: &[u8]) -> Result<T> {
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let parsed = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let key = error.path().to_string();
        json_error(path, error.inner(), if key == "." { "" } else { &key })
    })?;
    deserializer.end().map_err(|error| json_error(path, &error, ""))?;
    Ok(parsed)
}

fn json_error(path: &Path, error: &serde_json::Error, key: &str) -> Error {
    let position = format!("line {}, column {}", error.line(), error.column());
    let place = if key.is_empty() { position.clone() } else { format!("{position}, {key}") };
    // The parser repeats the position at the end of its message.
    let text = error.to_string();
    let suffix = format!(" at line {} column {}", error.line(), error.column());
    Error::file(path, place, text.strip_suffix(&suffix).unwrap_or(&text))
}
