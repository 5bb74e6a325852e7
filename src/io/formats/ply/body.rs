//! The elements after the header, as text or binary.

use std::io::{ErrorKind, Read};

use crate::error::Result;
use crate::io::file::sample_type::{Endian, SampleType, by_type};
use crate::io::file::scanner::Scanner;
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
                        match *slot {
                            Some(slot) => numbers[slot] = number(scanner, element, i, property.kind, endian)?,
                            None => self.skip(scanner, element, i, property)?,
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
                    read_exact(scanner, element, done, block)?;
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
        if self.binary.is_some() && !element.has_lists() {
            return scanner.skip(element.count.saturating_mul(element.bytes()));
        }
        for i in 0..element.count {
            for property in &element.properties {
                self.skip(scanner, element, i, property)?;
            }
            if self.binary.is_none() {
                scanner.end_line()?;
            }
        }
        Ok(())
    }

    /// Skips a property of element `i`. Lines of long lists may exceed the line limit, so text is read word by word.
    pub(crate) fn skip(
        &self,
        scanner: &mut Scanner,
        element: &Element,
        i: u64,
        property: &Property,
    ) -> Result<()> {
        let count = match property.list {
            Some(length) => self.list_length(scanner, element, i, property, length)?,
            None => 1,
        };
        match self.binary {
            Some(endian) if property.list.is_none() => {
                number(scanner, element, i, property.kind, endian)?;
            }
            Some(_) => scanner.skip(count * property.kind.bytes())?,
            None => {
                for _ in 0..count {
                    if scanner.word()?.is_none() {
                        let rule = format!("ends before the last {}", shown(&element.name));
                        return Err(scanner.error(rule));
                    }
                }
            }
        }
        Ok(())
    }

    /// Reads the length of a list of element `i`, and checks in binary that its numbers can follow.
    pub(crate) fn list_length(
        &self,
        scanner: &mut Scanner,
        element: &Element,
        i: u64,
        property: &Property,
        length: SampleType,
    ) -> Result<u64> {
        let Some(endian) = self.binary else { return scanner.number("the length of a list") };
        let count = number(scanner, element, i, length, endian)?;
        let wrong = |rule: &str| {
            let rule = format!("property {}: a list of {count}{rule}", shown(&property.name));
            Err(scanner.source().error(format!("byte {}", scanner.position()), rule))
        };
        if count < 0.0 {
            return wrong("");
        }
        let length = num::u64_of(count);
        if length.saturating_mul(property.kind.bytes()) > scanner.available() {
            return wrong(" is longer than what follows");
        }
        Ok(length)
    }

    /// Checks that nothing follows.
    pub(crate) fn end(&self, scanner: &mut Scanner) -> Result<()> {
        let rule = "more than the header announces";
        if self.binary.is_none() {
            return match scanner.word()?.map(shown) {
                Some(word) => Err(scanner.error(format!("\"{word}\": {rule}"))),
                None => Ok(()),
            };
        }
        if scanner.peek(1)?.is_empty() {
            return Ok(());
        }
        Err(scanner.source().error(format!("byte {}", scanner.position()), rule))
    }
}

/// The number of bytes read at once.
const BLOCK: usize = 1 << 16;

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

/// Reads a number of element `i`.
pub(crate) fn number(
    scanner: &mut Scanner,
    element: &Element,
    i: u64,
    kind: SampleType,
    endian: Endian,
) -> Result<f64> {
    let mut bytes = [0; 8];
    let bytes = &mut bytes[..usize::try_from(kind.bytes()).unwrap_or(8)];
    read_exact(scanner, element, i, bytes)?;
    Ok(decode(bytes, kind, endian))
}

/// Reads bytes; `done` elements have been read before.
fn read_exact(scanner: &mut Scanner, element: &Element, done: u64, bytes: &mut [u8]) -> Result<()> {
    scanner.read_exact(bytes).map_err(|error| {
        if error.kind() != ErrorKind::UnexpectedEof {
            return text::stream_error(scanner.source(), error);
        }
        let place = format!("element {}", shown(&element.name));
        scanner.source().error(place, format!("ends between {done} and all {}", element.count))
    })
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
        let wrong = |word: &str, rule: String| scanner.line_error(format!("\"{}\": {rule}", shown(word)));
        let early = || scanner.line_error(format!("ends before property {}", name()));
        let word = words.next().ok_or_else(early)?;
        if property.list.is_some() {
            let length = word
                .parse::<u64>()
                .map_err(|_| wrong(word, format!("must be the length of list {}", name())))?;
            for _ in 0..length {
                words.next().ok_or_else(early)?;
            }
        } else if let Some(slot) = *slot {
            let rule = || format!("property {} must be a number of type {}", name(), property.kind.name());
            numbers[slot] = parse(word, property.kind).ok_or_else(|| wrong(word, rule()))?;
        }
    }
    match words.next().map(shown) {
        Some(word) => Err(scanner.line_error(format!("\"{word}\": must not follow here"))),
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
