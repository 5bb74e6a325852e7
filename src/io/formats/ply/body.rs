//! The elements after the header, as text or binary.

use std::io::{ErrorKind, Read};

use crate::error::{Error, Result};
use crate::io::file::sample_type::{Endian, SampleType, by_type};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::{self, shown};
use crate::io::formats::ply::header::{Element, Header, Property};
use crate::num;

impl Header {
    /// Checks that the elements can follow, before memory is allocated for them.
    pub(crate) fn holds(&self, scanner: &Scanner, element: &Element) -> Result<()> {
        let available = scanner.available();
        let least = match self.binary {
            Some(_) => element.count.checked_mul(element.bytes()),
            // A number takes a digit and a blank; the last needs no blank.
            None => u64::try_from(element.properties.len()).ok().and_then(|words| {
                element.count.checked_mul(words)?.checked_mul(2)?.checked_sub(1).or(Some(0))
            }),
        };
        if least.is_some_and(|least| least <= available) {
            return Ok(());
        }
        let (count, name) = (element.count, shown(&element.name));
        let rule = format!("{count}: the {available} bytes that follow cannot hold them");
        Err(scanner.source().error(format!("element {name}"), rule))
    }

    /// Reads elements and passes the numbers of the wanted properties to `sink`, in the wanted order.
    pub(crate) fn each(
        &self,
        scanner: &mut Scanner,
        element: &Element,
        wanted: &[usize],
        sink: &mut dyn FnMut(&[f64]),
    ) -> Result<()> {
        // The position of each property in the output.
        let mut slots = vec![None; element.properties.len()];
        for (slot, &property) in wanted.iter().enumerate() {
            slots[property] = Some(slot);
        }
        let mut numbers = vec![0.0; wanted.len()];
        match self.binary {
            None => {
                for i in 0..element.count {
                    let Some(line) = scanner.full_line()? else {
                        let rule = format!("ends after {i} of {} {}", element.count, shown(&element.name));
                        return Err(scanner.error(rule));
                    };
                    row(scanner, element, &line, &slots, &mut numbers)?;
                    sink(&numbers);
                }
            }
            Some(endian) if element.has_lists() => {
                for i in 0..element.count {
                    for (property, slot) in element.properties.iter().zip(&slots) {
                        if let Some(length) = property.list {
                            pass_list(scanner, property, length, endian)
                                .map_err(|e| ended(scanner.source(), element, i, e))?;
                            continue;
                        }
                        let number = number(scanner, property.kind, endian)
                            .map_err(|e| ended(scanner.source(), element, i, e))?;
                        if let Some(slot) = *slot {
                            numbers[slot] = number;
                        }
                    }
                    sink(&numbers);
                }
            }
            Some(endian) => {
                // The byte range of each wanted number in a row.
                let (mut places, mut stride) = (Vec::new(), 0);
                for (property, slot) in element.properties.iter().zip(&slots) {
                    let bytes = usize::try_from(property.kind.bytes()).unwrap_or(8);
                    places.extend(slot.map(|slot| (slot, stride..stride + bytes, property.kind)));
                    stride += bytes;
                }
                let rows = (BLOCK / stride.max(1)).max(1);
                let mut block = vec![0; rows * stride];
                let mut done = 0;
                while done < element.count {
                    let left = usize::try_from(element.count - done).unwrap_or(usize::MAX);
                    let block = &mut block[..rows.min(left) * stride];
                    scanner.read_exact(block).map_err(|e| ended(scanner.source(), element, done, e))?;
                    for row in block.chunks_exact(stride.max(1)) {
                        for (slot, place, kind) in &places {
                            numbers[*slot] = decode(&row[place.clone()], *kind, endian);
                        }
                        sink(&numbers);
                    }
                    done += u64::try_from(rows.min(left)).unwrap_or(u64::MAX);
                }
            }
        }
        Ok(())
    }

    /// Skips elements, which must exist.
    pub(crate) fn pass(&self, scanner: &mut Scanner, element: &Element) -> Result<()> {
        self.holds(scanner, element)?;
        if element.properties.is_empty() {
            return Ok(());
        }
        match self.binary {
            Some(_) if !element.has_lists() => scanner.skip(element.count.saturating_mul(element.bytes())),
            Some(_) => self.each(scanner, element, &[], &mut |_| {}),
            // Lines of long lists may exceed the line limit, so they are read word by word.
            None => {
                for _ in 0..element.count {
                    for property in &element.properties {
                        let words: u64 = match property.list {
                            Some(_) => scanner.number("the length of a list")?,
                            None => 1,
                        };
                        for _ in 0..words {
                            if scanner.word()?.is_none() {
                                let rule = format!("ends before the last {}", shown(&element.name));
                                return Err(scanner.error(rule));
                            }
                        }
                    }
                    scanner.end_line()?;
                }
                Ok(())
            }
        }
    }

    /// Checks that nothing follows.
    pub(crate) fn end(&self, scanner: &mut Scanner) -> Result<()> {
        if self.binary.is_none() {
            return match scanner.word()?.map(shown) {
                Some(word) => Err(scanner.error(format!("\"{word}\": more than the header announces"))),
                None => Ok(()),
            };
        }
        let position = scanner.position();
        let mut more = [0];
        match scanner.read(&mut more) {
            Ok(0) => Ok(()),
            Ok(_) => {
                let rule = "more than the header announces";
                Err(scanner.source().error(format!("byte {position}"), rule))
            }
            Err(error) => Err(text::stream_error(scanner.source(), error)),
        }
    }
}

/// The number of bytes read at once.
const BLOCK: usize = 1 << 16;

/// Converts an error of a stream; an early end reports the number of elements read.
pub(crate) fn ended(source: &Source, element: &Element, done: u64, error: std::io::Error) -> Error {
    if error.kind() == ErrorKind::UnexpectedEof {
        let place = format!("element {}", shown(&element.name));
        return source.error(place, format!("ends between {done} and all {}", element.count));
    }
    text::stream_error(source, error)
}

/// Decodes a number of `kind.bytes()` bytes.
fn decode(bytes: &[u8], kind: SampleType, endian: Endian) -> f64 {
    macro_rules! number {
        ($type:ty) => {{
            let bytes = bytes.first_chunk().copied().unwrap_or_default();
            <$type>::from_le_bytes(endian.to_little(bytes)) as f64
        }};
    }
    by_type!(kind, number)
}

pub(crate) fn number(scanner: &mut Scanner, kind: SampleType, endian: Endian) -> std::io::Result<f64> {
    let mut bytes = [0; 8];
    let bytes = &mut bytes[..usize::try_from(kind.bytes()).unwrap_or(8)];
    scanner.read_exact(bytes)?;
    Ok(decode(bytes, kind, endian))
}

/// Reads the length of a binary list, and checks that its numbers can follow.
pub(crate) fn list_length(
    scanner: &mut Scanner,
    property: &Property,
    length: SampleType,
    endian: Endian,
) -> std::io::Result<u64> {
    let count = number(scanner, length, endian)?;
    let name = shown(&property.name);
    let place = format!("byte {}", scanner.position());
    let wrong = |rule: String| std::io::Error::other(scanner.source().error(place, rule));
    if count < 0.0 {
        return Err(wrong(format!("property {name}: a list of {count}")));
    }
    let length = num::u64_of(count);
    if length.saturating_mul(property.kind.bytes()) > scanner.available() {
        return Err(wrong(format!("property {name}: a list of {count} is longer than what follows")));
    }
    Ok(length)
}

/// Skips a binary list.
pub(crate) fn pass_list(
    scanner: &mut Scanner,
    property: &Property,
    length: SampleType,
    endian: Endian,
) -> std::io::Result<()> {
    let count = list_length(scanner, property, length, endian)?;
    scanner.skip(count * property.kind.bytes()).map_err(std::io::Error::other)
}

/// Parses the wanted numbers of an element on a line of text.
fn row(
    scanner: &Scanner,
    element: &Element,
    line: &str,
    slots: &[Option<usize>],
    numbers: &mut [f64],
) -> Result<()> {
    let mut words = line.split_ascii_whitespace();
    for (property, slot) in element.properties.iter().zip(slots) {
        let name = || shown(&property.name);
        let mut next = || {
            let rule = || scanner.line_error(format!("ends before property {}", name()));
            words.next().ok_or_else(rule)
        };
        let word = next()?;
        if property.list.is_some() {
            let length: u64 = word.parse().map_err(|_| {
                scanner.line_error(format!("\"{}\": must be the length of list {}", shown(word), name()))
            })?;
            for _ in 0..length {
                next()?;
            }
        } else if let Some(slot) = *slot {
            numbers[slot] = parse(word, property.kind).ok_or_else(|| {
                let kind = property.kind.name();
                scanner.line_error(format!(
                    "\"{}\": property {} must be a number of type {kind}",
                    shown(word),
                    name()
                ))
            })?;
        }
    }
    match words.next() {
        Some(word) => {
            let rule = format!("\"{}\": must not follow here", shown(word));
            Err(scanner.line_error(rule))
        }
        None => Ok(()),
    }
}

/// Parses a number and checks the range of its type.
fn parse(word: &str, kind: SampleType) -> Option<f64> {
    macro_rules! number {
        ($type:ty) => {
            text::float::<$type>(word).map(|number| number as f64)
        };
    }
    by_type!(kind, number)
}
