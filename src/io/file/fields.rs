//! Headers that give one named value per line.

use std::collections::HashMap;

use crate::error::{Error, Result};
use crate::io::file::source::Source;
use crate::io::file::text::shown;

/// The values of a header by name, each with its line number.
pub(crate) struct Fields<'a> {
    source: &'a Source,
    format: &'static str,
    values: HashMap<String, (usize, String)>,
}

impl<'a> Fields<'a> {
    pub(crate) fn new(source: &'a Source, format: &'static str) -> Self {
        Self { source, format, values: HashMap::new() }
    }

    /// Adds a value.
    ///
    /// # Errors
    ///
    /// If it was given before.
    pub(crate) fn add(&mut self, line: usize, name: &str, value: &str) -> Result<()> {
        match self.values.insert(name.to_owned(), (line, value.to_owned())) {
            Some((first, _)) => Err(self
                .source
                .error(format!("line {line}"), format!("{name}: given before, on line {first}"))),
            None => Ok(()),
        }
    }

    pub(crate) fn get(&self, name: &str) -> Option<&str> {
        self.values.get(name).map(|(_, value)| value.as_str())
    }

    pub(crate) fn required(&self, name: &str) -> Result<&str> {
        let missing = || self.source.error(name, format!("missing: {} needs this field", self.format));
        self.get(name).ok_or_else(missing)
    }

    /// Returns an error about a field, with its line.
    pub(crate) fn error(&self, name: &str, rule: impl Into<String>) -> Error {
        match self.values.get(name) {
            Some((line, _)) => self.source.error(format!("line {line}, {name}"), rule),
            None => self.source.error(name, rule),
        }
    }

    /// Parses a whole number of at least `least`; a missing field is 0.
    pub(crate) fn whole_number(&self, name: &str, least: i64) -> Result<i64> {
        let Some(text) = self.get(name) else { return Ok(0) };
        text.parse().ok().filter(|&number| number >= least).ok_or_else(|| {
            self.error(name, format!("\"{text}\": must be a whole number of at least {least}"))
        })
    }

    /// Parses `count` numbers, if the field exists.
    pub(crate) fn numbers(&self, name: &str, count: usize) -> Result<Option<Vec<f64>>> {
        let Some(text) = self.get(name) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        match numbers.filter(|numbers| numbers.len() == count) {
            None => Err(self.error(name, format!("\"{}\": must be {count} numbers", shown(text)))),
            numbers => Ok(numbers),
        }
    }

    /// Parses extents, one for each axis; the field `of` gave their number.
    pub(crate) fn extents(&self, name: &str, of: &str, rank: usize) -> Result<Vec<u32>> {
        let words: Vec<&str> = self.required(name)?.split_whitespace().collect();
        if words.len() != rank {
            return Err(self.error(name, format!("{} numbers: {of} {rank} needs {rank}", words.len())));
        }
        let extent = |word: &&str| {
            word.parse::<u32>().ok().filter(|&extent| extent > 0).ok_or_else(|| {
                let rule = format!("\"{}\": must be a whole number from 1 to {}", shown(word), u32::MAX);
                self.error(name, rule)
            })
        };
        words.iter().map(extent).collect()
    }

    /// Adds the header field to an error about a value.
    pub(crate) fn located(&self, name: &str, error: Error) -> Error {
        match error {
            Error::Invalid { why, .. } => self.error(name, why),
            other => other,
        }
    }
}
