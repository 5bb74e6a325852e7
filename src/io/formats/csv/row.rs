//! Rows of a table and their cells: delimiters, quotes, numbers.

use std::ops::Range;

use crate::error::{Error, Result};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::{self, shown};

/// The limit on the length of a row, in bytes: an unclosed quote would extend it to the end of the file.
const MAX_ROW: usize = 1 << 20;

/// The separator of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Delimiter {
    Byte(u8),
    Blanks,
}

impl Delimiter {
    /// Finds the delimiter of a table from its first row.
    pub(crate) fn of(line: &str) -> Self {
        // Quotes enclose every second piece.
        let outside = line.trim().split('"').step_by(2);
        let there = |delimiter: &&u8| outside.clone().any(|piece| piece.contains(char::from(**delimiter)));
        b"\t;,".iter().find(there).map_or(Self::Blanks, |&delimiter| Self::Byte(delimiter))
    }

    fn separates(self, byte: u8) -> bool {
        match self {
            Self::Byte(delimiter) => byte == delimiter,
            Self::Blanks => byte.is_ascii_whitespace(),
        }
    }
}

/// Whether a line is blank or a comment.
pub(crate) fn is_skipped(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || line.starts_with('#')
}

/// The cells of a row.
#[derive(Default)]
pub(crate) struct Row {
    text: String,
    cells: Vec<Range<usize>>,
    /// The beginning of the current cell in `text`.
    begin: usize,
}

impl Row {
    pub(crate) fn len(&self) -> usize {
        self.cells.len()
    }

    pub(crate) fn cell(&self, i: usize) -> &str {
        &self.text[self.cells[i].clone()]
    }

    pub(crate) fn cells(&self) -> impl Iterator<Item = &str> {
        self.cells.iter().map(|range| &self.text[range.clone()])
    }

    /// Returns the cells as names of columns.
    pub(crate) fn names(&self) -> Vec<String> {
        self.cells().map(str::to_owned).collect()
    }

    /// Splits a line into cells. `open` says that the line begins within quotes; the result, that it ends within
    /// quotes.
    ///
    /// # Errors
    ///
    /// The text that follows a quoted cell without a delimiter.
    pub(crate) fn split<'l>(
        &mut self,
        line: &'l str,
        delimiter: Delimiter,
        open: bool,
    ) -> std::result::Result<bool, &'l str> {
        let blank = |c: char| c.is_whitespace() && !(delimiter == Delimiter::Byte(b'\t') && c == '\t');
        let mut rest = line;
        let mut quoted = open;
        if open {
            self.text.push('\n');
        } else {
            self.text.clear();
            self.cells.clear();
        }
        loop {
            if !quoted {
                rest = rest.trim_start_matches(blank);
                if delimiter == Delimiter::Blanks && rest.is_empty() {
                    return Ok(false);
                }
                self.begin = self.text.len();
                if let Some(inside) = rest.strip_prefix('"') {
                    (rest, quoted) = (inside, true);
                }
            }
            if quoted {
                while let Some(end) = rest.find('"') {
                    self.text.push_str(&rest[..end]);
                    rest = &rest[end + 1..];
                    match rest.strip_prefix('"') {
                        Some(more) => {
                            self.text.push('"');
                            rest = more;
                        }
                        None => {
                            quoted = false;
                            break;
                        }
                    }
                }
                if quoted {
                    self.text.push_str(rest);
                    return Ok(true);
                }
                if delimiter != Delimiter::Blanks {
                    rest = rest.trim_start_matches(blank);
                }
                if rest.bytes().next().is_some_and(|byte| !delimiter.separates(byte)) {
                    return Err(rest);
                }
            } else {
                let end = rest.bytes().position(|byte| delimiter.separates(byte)).unwrap_or(rest.len());
                self.text.push_str(rest[..end].trim());
                rest = &rest[end..];
            }
            self.cells.push(self.begin..self.text.len());
            if delimiter != Delimiter::Blanks {
                let Some(next) = rest.get(1..) else { return Ok(false) };
                rest = next;
            }
        }
    }
}

/// Parses a number; an empty cell and `na`, `n/a`, `null` are NaN.
pub(crate) fn number(cell: &str) -> Option<f64> {
    if cell.is_empty() || ["na", "n/a", "null"].iter().any(|none| cell.eq_ignore_ascii_case(none)) {
        return Some(f64::NAN);
    }
    text::float(cell)
}

/// Whether a cell is certainly a number; `Na` may be sodium.
pub(crate) fn is_number(cell: &str) -> bool {
    text::float::<f64>(cell).is_some()
}

/// Reads the rows of a table one after another.
pub(crate) struct Rows<'a> {
    scanner: Scanner<'a>,
    pub(crate) delimiter: Option<Delimiter>,
    pub(crate) row: Row,
    /// Where it begins.
    pub(crate) line: u64,
    /// The last comment before the first row.
    pub(crate) comment: Option<String>,
}

impl<'a> Rows<'a> {
    pub(crate) fn new(source: &'a Source, delimiter: Option<Delimiter>) -> Self {
        let scanner = Scanner::new(source);
        Self { scanner, delimiter, row: Row::default(), line: 0, comment: None }
    }

    /// Reads the next row. False at the end.
    pub(crate) fn next(&mut self) -> Result<bool> {
        loop {
            let Some(mut line) = self.scanner.next_line()? else { return Ok(false) };
            if self.scanner.lines() == 1 && line.starts_with('\u{feff}') {
                line.remove(0);
            }
            if is_skipped(&line) {
                if let Some(comment) = line.trim().strip_prefix('#').filter(|_| self.delimiter.is_none()) {
                    self.comment = Some(comment.to_owned());
                }
                continue;
            }
            self.line = self.scanner.lines();
            let delimiter = *self.delimiter.get_or_insert_with(|| Delimiter::of(&line));
            let mut open = false;
            loop {
                match self.row.split(&line, delimiter, open) {
                    Ok(false) => return Ok(true),
                    Ok(true) => open = true,
                    Err(rest) => {
                        return Err(self.error(format!("\"{}\": must not follow a quoted cell", shown(rest))));
                    }
                }
                if self.row.text.len() > MAX_ROW {
                    return Err(self.error(format!("a row longer than {MAX_ROW} bytes: is a quote open?")));
                }
                let Some(next) = self.scanner.next_line()? else {
                    return Err(self.error("ends within quotes"));
                };
                line = next;
            }
        }
    }

    pub(crate) fn error(&self, rule: impl Into<String>) -> Error {
        self.scanner.source().error(format!("line {}", self.line), rule)
    }
}
