//! The first pass over a file: its state, and reading of words and numbers.

use crate::error::{Error, Result};
use crate::io::build::arrays::Association;
use crate::io::file::scanner::Scanner;
use crate::io::file::text;
use crate::io::formats::vtk_legacy::contents::Contents;

/// The state of the first pass.
pub(crate) struct Walk<'a> {
    pub(crate) scanner: Scanner<'a>,
    pub(crate) version: (u32, u32),
    pub(crate) binary: bool,
    pub(crate) contents: Contents,
    /// The current section of attributes: points or cells, and their number.
    pub(crate) section: Option<(Association, u64)>,
    /// The number of components of the last array.
    pub(crate) components: u64,
    /// Names of arrays left out: of the data set as a whole, without numbers, without or with too many components.
    pub(crate) apart: [Vec<String>; 3],
    pub(crate) long: bool,
}

impl<'a> Walk<'a> {
    /// Returns an error about the current place.
    pub(crate) fn error(&self, rule: impl Into<String>) -> Error {
        if self.binary {
            // Line numbers mean nothing in binary files.
            self.scanner.source().error(format!("before byte {}", self.scanner.position()), rule)
        } else {
            self.scanner.error(rule)
        }
    }

    pub(crate) fn word(&mut self, what: &str) -> Result<String> {
        let word = self.scanner.word()?.map(str::to_owned);
        word.ok_or_else(|| self.error(format!("ends before {what}")))
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T> {
        let word = self.word(what)?;
        word.parse().map_err(|_| self.error(format!("\"{}\": must be {what}", text::shown(&word))))
    }

    pub(crate) fn count(&mut self, what: &str) -> Result<u64> {
        self.number(&format!("the number of {what}"))
    }

    pub(crate) fn numbers<T: std::str::FromStr + Copy + Default, const N: usize>(
        &mut self,
        what: &str,
    ) -> Result<[T; N]> {
        let mut numbers = [T::default(); N];
        for number in &mut numbers {
            *number = self.number(what)?;
        }
        Ok(numbers)
    }

    /// Whether this word follows, after blanks.
    pub(crate) fn comes(&mut self, word: &str) -> Result<bool> {
        let ahead = self.scanner.peek(64 + word.len())?.trim_ascii_start();
        let (own, rest) = ahead.split_at(word.len().min(ahead.len()));
        Ok(own.eq_ignore_ascii_case(word.as_bytes()) && rest.first().is_none_or(u8::is_ascii_whitespace))
    }

    /// Whether anything follows on the same line.
    pub(crate) fn more_on_line(&mut self) -> Result<bool> {
        let ahead = self.scanner.peek(64)?;
        Ok(ahead.iter().find(|byte| !matches!(byte, b' ' | b'\t' | b'\r')).is_some_and(|&byte| byte != b'\n'))
    }
}
