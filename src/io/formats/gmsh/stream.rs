//! Numbers as text or binary, and the sections that hold them.

use std::io::{ErrorKind, Read};
use std::str::FromStr;

use crate::error::{Error, Result};
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::scanner::Scanner;
use crate::io::file::text::{self, shown};

/// The encoding of numbers in a file.
#[derive(Clone, Copy)]
pub(crate) struct Format {
    /// 2 or 4.
    pub(crate) version: u8,
    /// The byte order of a binary file; None for text.
    pub(crate) binary: Option<Endian>,
    /// The type of counts and tags in version 4.
    pub(crate) wide: SampleType,
    pub(crate) real: SampleType,
}

/// A number in C's notation.
struct Real(f64);

impl FromStr for Real {
    type Err = ();

    fn from_str(word: &str) -> std::result::Result<Self, ()> {
        text::float(word).map(Self).ok_or(())
    }
}

/// A stream of numbers, text or binary.
pub(crate) struct Stream<'a> {
    pub(crate) scanner: Scanner<'a>,
    pub(crate) format: Format,
    /// The current line of text and the offset in it; None to read words across lines.
    pub(crate) row: Option<(String, usize)>,
}

impl Stream<'_> {
    pub(crate) fn error(&self, rule: impl Into<String>) -> Error {
        if self.format.binary.is_some() {
            self.scanner.source().error(format!("byte {}", self.scanner.position()), rule)
        } else if self.row.is_some() {
            self.scanner.line_error(rule)
        } else {
            self.scanner.error(rule)
        }
    }

    /// Begins a line, in a text file.
    pub(crate) fn row(&mut self, what: &str) -> Result<()> {
        if self.format.binary.is_none() {
            let Some(line) = self.scanner.full_line()? else {
                return Err(self.error(format!("ends before {what}")));
            };
            self.row = Some((line, 0));
        }
        Ok(())
    }

    /// Ends the line, which must have been read completely.
    pub(crate) fn end_row(&mut self) -> Result<()> {
        if let Some((line, at)) = &self.row {
            let rest = line[*at..].trim();
            if !rest.is_empty() {
                return Err(self.error(format!("\"{}\": must not follow here", shown(rest))));
            }
        }
        self.row = None;
        Ok(())
    }

    pub(crate) fn word<T: FromStr>(&mut self, what: &str) -> Result<T> {
        let Some((line, at)) = &mut self.row else { return self.scanner.number(what) };
        let rest = line[*at..].trim_start();
        let word = rest.split_ascii_whitespace().next().unwrap_or("");
        *at = line.len() - rest.len() + word.len();
        let rule = match word.parse() {
            Ok(number) => return Ok(number),
            Err(_) if word.is_empty() => format!("ends before {what}"),
            Err(_) => format!("\"{}\": must be {what}", shown(word)),
        };
        Err(self.error(rule))
    }

    /// Reads the bytes of a number, in little-endian order.
    pub(crate) fn bytes<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        match self.scanner.read_exact(&mut bytes) {
            Ok(()) => Ok(self.format.binary.map_or(bytes, |endian| endian.to_little(bytes))),
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                Err(self.error(format!("ends before {what}")))
            }
            Err(error) => Err(text::stream_error(self.scanner.source(), error)),
        }
    }

    /// Reads an `int`.
    pub(crate) fn int(&mut self, what: &str) -> Result<i64> {
        if self.format.binary.is_none() {
            return self.word(what);
        }
        Ok(i32::from_le_bytes(self.bytes(what)?).into())
    }

    /// Reads an `int` that must not be negative.
    pub(crate) fn natural(&mut self, what: &str) -> Result<u64> {
        if self.format.binary.is_none() {
            return self.word(what);
        }
        let number = self.int(what)?;
        u64::try_from(number).map_err(|_| self.error(format!("{number}: must be {what}, not negative")))
    }

    /// Reads a `size_t`.
    pub(crate) fn wide(&mut self, what: &str) -> Result<u64> {
        if self.format.binary.is_none() {
            return self.word(what);
        }
        if self.format.wide == SampleType::U32 {
            return Ok(u32::from_le_bytes(self.bytes(what)?).into());
        }
        Ok(u64::from_le_bytes(self.bytes(what)?))
    }

    /// Reads the number of a node or an element: an `int` in version 2, later a `size_t`.
    pub(crate) fn tag(&mut self, what: &str) -> Result<u64> {
        if self.format.version == 2 { self.natural(what) } else { self.wide(what) }
    }

    pub(crate) fn real(&mut self, what: &str) -> Result<f64> {
        if self.format.binary.is_none() {
            return self.word::<Real>(what).map(|Real(number)| number);
        }
        if self.format.real == SampleType::F32 {
            return Ok(f32::from_le_bytes(self.bytes(what)?).into());
        }
        Ok(f64::from_le_bytes(self.bytes(what)?))
    }

    /// Checks that `count` things of at least `least` bytes can follow, before memory is allocated for them.
    pub(crate) fn holds(&self, count: u64, least: u64, what: &str) -> Result<()> {
        let available = self.scanner.available();
        if count.checked_mul(least).is_some_and(|bytes| bytes <= available) {
            return Ok(());
        }
        Err(self.error(format!("{count} {what}: the {available} bytes that follow cannot hold them")))
    }
}

pub(crate) fn read_format(stream: &mut Stream) -> Result<Format> {
    let version: String = stream.scanner.number("a version")?;
    let major = match version.as_str() {
        "2" | "2.0" | "2.1" | "2.2" => 2,
        "4.1" => 4,
        other => {
            let rule = format!("version \"{}\": 2.0 to 2.2 and 4.1 are supported", shown(other));
            return Err(stream.scanner.error(rule));
        }
    };
    let binary: u8 = stream.scanner.number("0 for text or 1 for binary")?;
    let size: u8 = stream.scanner.number("a size in bytes")?;
    let sizes = match size {
        4 => (SampleType::U32, SampleType::F32),
        8 => (SampleType::U64, SampleType::F64),
        _ => return Err(stream.scanner.error(format!("data of {size} bytes: must be 4 or 8"))),
    };
    stream.scanner.end_line()?;
    let binary = match binary {
        0 => None,
        1 => {
            let one: [u8; 4] = stream.bytes("the mark of byte order")?;
            if one == 1_i32.to_le_bytes() {
                Some(Endian::Little)
            } else if one == 1_i32.to_be_bytes() {
                Some(Endian::Big)
            } else {
                let rule = format!("mark of byte order {one:?}: must be 1 in one of both");
                return Err(stream.scanner.line_error(rule));
            }
        }
        other => {
            let rule = format!("file type {other}: must be 0 for text or 1 for binary");
            return Err(stream.scanner.line_error(rule));
        }
    };
    // The size is that of counts in version 4, and that of reals in version 2.
    stream.format = if major == 4 {
        Format { version: 4, binary, wide: sizes.0, real: SampleType::F64 }
    } else {
        Format { version: 2, binary, wide: SampleType::U64, real: sizes.1 }
    };
    Ok(stream.format)
}

/// Reads a line that holds only a count.
pub(crate) fn count_line(stream: &mut Stream, what: &str) -> Result<u64> {
    let count = stream.scanner.number(what)?;
    stream.scanner.end_line()?;
    Ok(count)
}

/// Skips the rest of a section and its end line.
pub(crate) fn pass_section(stream: &mut Stream, name: &str) -> Result<()> {
    let begin = stream.scanner.lines().max(1);
    if !stream.scanner.pass(format!("$End{name}").as_bytes())? {
        let name = shown(name);
        let rule = format!("${name}: there is no $End{name}");
        return Err(stream.scanner.source().error(format!("line {begin}"), rule));
    }
    stream.scanner.end_line()
}
