//! Options of techniques: their text, their defaults, and how they are read.

use serde::Serialize;

use crate::error::{Error, Result};

/// One option of a technique, as `volraster techniques` shows it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct OptionInfo {
    /// The key.
    pub key: &'static str,
    /// Allowed values.
    pub values: &'static str,
    /// The value without the option.
    pub default: &'static str,
    /// What it does to error and time.
    pub effect: &'static str,
}

/// An option whose values are words.
pub(crate) trait Choice: Copy + PartialEq + 'static {
    /// The words with their values.
    const WORDS: &'static [(&'static str, Self)];

    /// The word of a value.
    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, value)| *value == self).map_or("?", |(word, _)| word)
    }
}

/// Reads a word.
pub(crate) fn choice<C: Choice>(technique: &str, key: &str, text: &str) -> Result<C> {
    C::WORDS.iter().find(|(word, _)| *word == text).map(|(_, value)| *value).ok_or_else(|| {
        let words: Vec<&str> = C::WORDS.iter().map(|(word, _)| *word).collect();
        Error::invalid(
            format!("{technique} option {key}"),
            format!("\"{text}\": must be one of {}", words.join(", ")),
        )
    })
}

/// Reads a positive, finite number.
pub(crate) fn positive(technique: &str, key: &str, text: &str) -> Result<f64> {
    let number = text.parse::<f64>().ok().filter(|n| n.is_finite() && *n > 0.0);
    number.ok_or_else(|| {
        Error::invalid(
            format!("{technique} option {key}"),
            format!("\"{text}\": must be a number that is positive and finite"),
        )
    })
}

/// The error of an unknown key.
pub(crate) fn unknown(technique: &str, key: &str, options: &[OptionInfo]) -> Error {
    let keys: Vec<&str> = options.iter().map(|option| option.key).collect();
    Error::invalid(format!("{technique} option \"{key}\""), format!("must be one of {}", keys.join(", ")))
}

/// Reads a whole number.
pub(crate) fn whole(
    technique: &str,
    key: &str,
    text: &str,
    allowed: std::ops::RangeInclusive<u32>,
) -> Result<u32> {
    text.parse().ok().filter(|number| allowed.contains(number)).ok_or_else(|| {
        Error::invalid(
            format!("{technique} option {key}"),
            format!("\"{text}\": must be a whole number from {} to {}", allowed.start(), allowed.end()),
        )
    })
}

/// Reads a number from 0 to below 1.
pub(crate) fn below_one(technique: &str, key: &str, text: &str) -> Result<f64> {
    let number = text.parse::<f64>().ok().filter(|n| (0.0..1.0).contains(n));
    number.ok_or_else(|| {
        Error::invalid(
            format!("{technique} option {key}"),
            format!("\"{text}\": must be a number from 0 to below 1"),
        )
    })
}
