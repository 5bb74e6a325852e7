//! Numbers and names as text, and how messages show them.

use std::io::ErrorKind;
use std::path::Path;
use std::str::FromStr;

use crate::error::{Error, Result};
use crate::io::file::sample_type::{SampleType, by_type};
use crate::io::file::source::Source;
use crate::num;

/// Converts an error of a stream to one of its file, with a rule for damaged compression, early ends and full memory.
pub(crate) fn stream_error(source: &Source, error: std::io::Error) -> Error {
    match error.kind() {
        ErrorKind::InvalidData | ErrorKind::InvalidInput
            if error.get_ref().is_none_or(|e| !e.is::<Error>()) =>
        {
            source.error("data", format!("a packed stream is damaged: {error}"))
        }
        ErrorKind::UnexpectedEof => source.error("data", "ends too early"),
        ErrorKind::OutOfMemory => source.error("data", "memory is full"),
        _ => source.io_error(error),
    }
}

impl Error {
    /// Turns an error about a value into one about a place in a file.
    pub(crate) fn at_place(self, path: &Path, place: &str) -> Self {
        match self {
            Self::Invalid { why, .. } => Self::file(path, place, why),
            other => other,
        }
    }
}

/// Parses a number of any type as C prints it: `+1`, `1.e5`, `nan(0x1)`, `-nan(ind)`, `NaNQ`.
pub(crate) fn float<T: FromStr>(word: &str) -> Option<T> {
    if let Ok(number) = word.parse() {
        return Some(number);
    }
    let lower = word.strip_prefix(['+', '-']).unwrap_or(word).to_ascii_lowercase();
    let rest = lower.strip_prefix("nan")?;
    let is_nan = matches!(rest, "q" | "s") || rest.starts_with('(') && rest.ends_with(')');
    if is_nan { "nan".parse().ok() } else { None }
}

/// Parses a number of a type into its little-endian bytes.
pub(crate) fn to_bytes(word: &str, kind: SampleType) -> Option<[u8; 8]> {
    fn padded<const N: usize>(bytes: [u8; N]) -> [u8; 8] {
        let mut all = [0; 8];
        all[..N].copy_from_slice(&bytes);
        all
    }
    macro_rules! bytes {
        ($type:ty) => {
            padded(float::<$type>(word)?.to_le_bytes())
        };
    }
    Some(by_type!(kind, bytes))
}

/// Returns an upper bound of the numbers in `bytes` of text: each takes a digit and a blank.
pub(crate) fn most_numbers(bytes: u64) -> u64 {
    bytes / 2 + 1
}

/// Parses exactly `N` numbers from a line of a header.
pub(crate) fn floats<const N: usize>(text: &str) -> Option<[f64; N]> {
    let mut words = text.split_whitespace();
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = words.next()?.parse().ok()?;
    }
    words.next().is_none().then_some(numbers)
}

/// Replaces control characters of a name by blanks.
pub(crate) fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// Shortens a text from a file to one line of at most 60 characters, for messages.
pub(crate) fn shown(text: &str) -> String {
    const MOST: usize = 60;
    let line: String = text.chars().take(MOST).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().nth(MOST).is_some() { format!("{line}...") } else { line }
}

/// Converts a count to an index, which must be below 2^32 - 1.
pub(crate) fn index(source: &Source, place: &str, count: u64) -> Result<usize> {
    match u32::try_from(count) {
        Ok(index) if index < u32::MAX => Ok(num::index(index)),
        _ => Err(source.error(place, format!("{count}: must be below {}", u32::MAX))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_c_are_numbers() {
        for word in ["nan", "NaN", "-nan", "nan(0x1)", "-nan(ind)", "+NAN(snan)", "NaNQ", "nans"] {
            assert!(float::<f64>(word).is_some_and(f64::is_nan), "{word}");
        }
        assert_eq!(["+1", "1.e5", "-inf"].map(float::<f64>), [Some(1.0), Some(1e5), Some(f64::NEG_INFINITY)]);
        for word in ["", "Nancy", "nan(", "nan)", "--nan", "na", "nan1"] {
            assert_eq!(float::<f64>(word), None, "{word}");
        }
    }
}
