//! Names of the files that hold a volume: listed, or numbered by a pattern; and the order of names with numbers.

use std::cmp::Ordering;
use std::path::PathBuf;

use crate::num;

/// The files that hold a volume, in the order of its samples.
#[derive(Clone, Debug)]
pub(crate) enum Files {
    Named(Vec<String>),
    Numbered(Numbered),
}

impl Files {
    pub(crate) fn one(name: &str) -> Self {
        Self::Named(vec![name.to_owned()])
    }

    pub(crate) fn count(&self) -> u64 {
        match self {
            Self::Named(names) => num::wide(names.len()),
            Self::Numbered(numbered) => numbered.count,
        }
    }

    /// Returns the name of a file, or an empty name beyond the last one.
    pub(crate) fn name(&self, index: usize) -> String {
        let name = match self {
            Self::Named(names) => names.get(index).cloned().unwrap_or_default(),
            Self::Numbered(numbered) => numbered.name(index),
        };
        // Files in memory are found by exact name, without `./`.
        name.strip_prefix("./").map(str::to_owned).unwrap_or(name)
    }
}

/// Numbered file names, as a format of C with one `%d` gives them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Numbered {
    before: String,
    /// The width up to which zeros or blanks are padded.
    width: usize,
    zeros: bool,
    after: String,
    first: i64,
    step: i64,
    count: u64,
}

impl Numbered {
    /// The limit on the padded width.
    const MAX_WIDTH: usize = 20;

    /// Parses a pattern with one `%d`, `%03d`, `%u` or `%i`; `%%` is a percent sign. Returns None if the text is not
    /// such a pattern. Numbers start at 0.
    #[must_use]
    pub fn parse(pattern: &str) -> Option<Self> {
        let (mut before, mut after, mut number) = (String::new(), String::new(), None);
        let mut rest = pattern;
        while let Some((text, more)) = rest.split_once('%') {
            let part = if number.is_none() { &mut before } else { &mut after };
            part.push_str(text);
            if let Some(more) = more.strip_prefix('%') {
                part.push('%');
                rest = more;
                continue;
            }
            let digits = more.bytes().take_while(u8::is_ascii_digit).count();
            let (width, more) = more.split_at(digits);
            rest = more.strip_prefix(['d', 'u', 'i']).filter(|_| number.is_none())?;
            number = Some((width.strip_prefix('0'), width));
        }
        let (zeros, width) = number?;
        after.push_str(rest);
        let digits = zeros.unwrap_or(width);
        let width = if digits.is_empty() { 0 } else { digits.parse().ok()? };
        (width <= Self::MAX_WIDTH).then_some(Self {
            before,
            width,
            zeros: zeros.is_some(),
            after,
            first: 0,
            step: 1,
            count: 0,
        })
    }

    /// Sets the sequence of numbers; a falling sequence has a negative step.
    ///
    /// # Errors
    ///
    /// The rule that the numbers break.
    pub(crate) fn over(self, first: i64, last: i64, step: i64) -> std::result::Result<Self, &'static str> {
        let span = i128::from(last) - i128::from(first);
        let step_ = i128::from(step);
        if step == 0 {
            return Err("a step must not be 0");
        }
        if span * step_ < 0 {
            return Err("the step leads away from the last number");
        }
        let count = u64::try_from(span / step_).unwrap_or(u64::MAX).saturating_add(1);
        Ok(Self { first, step, count, ..self })
    }

    /// Returns the name of the file with this index, counted from 0.
    #[must_use]
    pub fn name(&self, index: usize) -> String {
        let index = i64::try_from(index).unwrap_or(i64::MAX);
        let number = self.first.saturating_add(self.step.saturating_mul(index));
        let Self { before, width, after, .. } = self;
        if self.zeros {
            format!("{before}{number:0width$}{after}")
        } else {
            format!("{before}{number:width$}{after}")
        }
    }
}

/// Splits a name into alternating pieces of text and digits.
pub(crate) fn pieces(name: &str) -> Vec<&str> {
    let digit = |byte: u8| byte.is_ascii_digit();
    name.as_bytes()
        .chunk_by(|&a, &b| digit(a) == digit(b))
        // Digits are ASCII, so pieces begin and end at character boundaries.
        .scan(0, |at, piece| {
            let begin = *at;
            *at += piece.len();
            name.get(begin..*at)
        })
        .collect()
}

pub(crate) fn is_number(piece: &str) -> bool {
    piece.starts_with(|c: char| c.is_ascii_digit())
}

/// Sorts files by the numbers in their names.
#[must_use]
pub fn in_order(mut files: Vec<PathBuf>) -> Vec<PathBuf> {
    files.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
    files
}

/// Compares names so that numbers in them sort by value: 2 before 10.
fn natural(a: &str, b: &str) -> Ordering {
    let (left, right) = (pieces(a), pieces(b));
    for (left, right) in left.iter().zip(&right) {
        let order = if is_number(left) && is_number(right) {
            let (left, right) = (left.trim_start_matches('0'), right.trim_start_matches('0'));
            left.len().cmp(&right.len()).then_with(|| left.cmp(right))
        } else {
            left.cmp(right)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count() {
        let mut names =
            ["b1", "a10", "a2", "a02", "a2b", "a", "10", "9", "a2a10", "\u{e9}2", "a99999999999999999999"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["9", "10", "a", "a02", "a2", "a2a10", "a2b", "a10", "a99999999999999999999", "b1", "\u{e9}2"]
        );
        assert_eq!(pieces("z\u{e9}12x003"), ["z\u{e9}", "12", "x", "003"]);
    }

    #[test]
    fn patterns_are_those_of_c() {
        let names = |pattern: &str, first, last, step| {
            let numbered = Numbered::parse(pattern).unwrap().over(first, last, step).unwrap();
            (0..usize::try_from(numbered.count).unwrap()).map(|i| numbered.name(i)).collect::<Vec<_>>()
        };
        assert_eq!(names("a%d.raw", 9, 11, 1), ["a9.raw", "a10.raw", "a11.raw"]);
        assert_eq!(names("a%03d", 1, 6, 2), ["a001", "a003", "a005"]);
        assert_eq!(names("%u%%b", 2, -2, -2), ["2%b", "0%b", "-2%b"]);
        assert_eq!(names("%%%3ib", 2, 2, 5), ["%  2b"]);
        assert_eq!(names("%03d", -1, -1, 1), ["-01"]);
        for wrong in ["a.raw", "a%", "a%x", "%d%d", "%99d", "%-3d", "%%", "%5", "%s", "%0999999999999999d"] {
            assert_eq!(Numbered::parse(wrong), None, "{wrong}");
        }
        let numbers = |first, last, step| Numbered::parse("%d").unwrap().over(first, last, step);
        assert_eq!(numbers(1, 2, 0), Err("a step must not be 0"));
        assert_eq!(numbers(1, 2, -1), Err("the step leads away from the last number"));
        assert!(numbers(2, 1, 1).is_err());
        assert_eq!(numbers(i64::MIN, i64::MAX, 1).unwrap().count, u64::MAX);
    }
}
