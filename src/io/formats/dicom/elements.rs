//! Data elements: tags, types, lengths and values, read in one forward pass.

use crate::error::{Error, Result};
use crate::io::file::sample_type::Endian;
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::dicom::syntax::Syntax;
use crate::num;

/// Group and element number.
pub(crate) type Tag = (u16, u16);

/// The limit on the length of a value that is read, in bytes.
const MAX_VALUE: u64 = 1024;

pub(crate) const ITEM: Tag = (0xfffe, 0xe000);
pub(crate) const ITEM_END: Tag = (0xfffe, 0xe00d);
pub(crate) const SEQUENCE_END: Tag = (0xfffe, 0xe0dd);
pub(crate) const UNDEFINED: u64 = 0xffff_ffff;

/// The types whose length has 4 bytes.
const LONG: [&[u8; 2]; 13] =
    [b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"];

/// A data element's header.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    pub(crate) tag: Tag,
    pub(crate) vr: [u8; 2],
    /// The offset of its value.
    pub(crate) at: u64,
    pub(crate) len: u64,
}

pub(crate) fn named((group, number): Tag) -> String {
    format!("({group:04x},{number:04x})")
}

/// A forward pass through a file.
pub(crate) struct Walk<'a> {
    pub(crate) source: &'a Source,
    /// The buffered part of the file, and its offset.
    window: Vec<u8>,
    start: u64,
}

impl<'a> Walk<'a> {
    /// Bytes that are read at a time.
    const WINDOW: u64 = 1 << 14;

    pub(crate) fn new(source: &'a Source) -> Self {
        Self { source, window: Vec::new(), start: 0 }
    }

    pub(crate) fn error(&self, at: u64, rule: impl Into<String>) -> Error {
        self.source.error(format!("byte {at}"), rule)
    }

    /// Returns a few bytes at an offset, through the window.
    pub(crate) fn bytes(&mut self, at: u64, len: u64) -> Result<&[u8]> {
        let all = self.source.len();
        let Some(end) = at.checked_add(len).filter(|&end| end <= all) else {
            return Err(self.error(at, format!("needs {len} bytes here, the file has {all} in all")));
        };
        if at < self.start || end > self.start.saturating_add(num::wide(self.window.len())) {
            let size = len.max(Self::WINDOW).min(all - at);
            self.window = self.source.bytes(at, size)?;
            self.start = at;
        }
        let first = usize::try_from(at - self.start).unwrap_or(usize::MAX);
        let count = usize::try_from(len).unwrap_or(usize::MAX);
        Ok(&self.window[first..first + count])
    }

    fn number(&mut self, at: u64, len: u64, endian: Endian) -> Result<u64> {
        Ok(endian.whole(self.bytes(at, len)?))
    }

    pub(crate) fn element(&mut self, at: u64, syntax: Syntax) -> Result<Element> {
        let Syntax { explicit, endian } = syntax;
        let part = |number: u64| u16::try_from(number).unwrap_or(0);
        let tag = (part(self.number(at, 2, endian)?), part(self.number(at + 2, 2, endian)?));
        if !explicit || tag.0 == 0xfffe {
            let len = self.number(at + 4, 4, endian)?;
            return Ok(Element { tag, vr: [0; 2], at: at + 8, len });
        }
        let vr = self.bytes(at + 4, 2)?;
        let vr = [vr[0], vr[1]];
        if !vr.iter().all(u8::is_ascii_uppercase) {
            let (vr, tag) = (vr.escape_ascii(), named(tag));
            return Err(self.error(at, format!("\"{vr}\": element {tag} must have a type of two letters")));
        }
        if LONG.contains(&&vr) {
            Ok(Element { tag, vr, at: at + 12, len: self.number(at + 8, 4, endian)? })
        } else {
            Ok(Element { tag, vr, at: at + 8, len: self.number(at + 6, 2, endian)? })
        }
    }

    /// Reads the file meta information; returns its end and the transfer syntax.
    pub(crate) fn meta(&mut self) -> Result<(u64, String)> {
        let head = self.source.head();
        let mut at = if head.get(128..132) == Some(b"DICM") { 132 } else { 0 };
        let mut uid = String::new();
        while at + 8 <= self.source.len() && self.number(at, 2, Endian::Little)? == 2 {
            let element = self.element(at, Syntax::default())?;
            if element.tag == (0x0002, 0x0010) {
                uid = self.text(&element)?;
            }
            at = self.behind(&element)?;
        }
        Ok((at, uid))
    }

    /// Guesses whether types are explicit, without file meta information.
    pub(crate) fn guess(&mut self, at: u64) -> Result<Syntax> {
        let explicit = self.bytes(at.saturating_add(4), 2)?.iter().all(u8::is_ascii_uppercase);
        Ok(Syntax { explicit, endian: Endian::Little })
    }

    /// Returns the end of an element of known length, which must lie in the file.
    pub(crate) fn behind(&self, element: &Element) -> Result<u64> {
        let Element { tag, at, len, .. } = *element;
        at.checked_add(len).filter(|&end| end <= self.source.len()).ok_or_else(|| {
            let left = self.source.len().saturating_sub(at);
            self.error(at, format!("{} has {len} bytes: {left} are left", named(tag)))
        })
    }

    pub(crate) fn text(&mut self, element: &Element) -> Result<String> {
        let Element { tag, at, len, .. } = *element;
        if len > MAX_VALUE {
            return Err(self.error(at, format!("{} has {len} bytes: at most {MAX_VALUE}", named(tag))));
        }
        let text = String::from_utf8_lossy(self.bytes(at, len)?).into_owned();
        let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
        // Messages show it, and have one line.
        Ok(text::plain(text))
    }

    /// Parses decimal numbers separated by backslashes; None if the value is empty.
    pub(crate) fn decimals<const N: usize>(&mut self, element: &Element) -> Result<Option<[f64; N]>> {
        let text = self.text(element)?;
        if text.is_empty() {
            return Ok(None);
        }
        let number = |word: &str| word.trim().parse().ok().filter(|n: &f64| n.is_finite());
        let numbers: Option<Vec<f64>> = text.split('\\').map(number).collect();
        numbers.and_then(|numbers| numbers.try_into().ok()).map(Some).ok_or_else(|| {
            let (tag, shown) = (named(element.tag), text::shown(&text));
            self.error(element.at, format!("{tag} \"{shown}\": must be {N} numbers"))
        })
    }

    /// Reads a whole number of 2 bytes.
    pub(crate) fn short(&mut self, element: &Element, endian: Endian) -> Result<u64> {
        let Element { tag, at, len, .. } = *element;
        if len < 2 {
            return Err(self.error(at, format!("{} has {len} bytes: must be a number of 2", named(tag))));
        }
        self.number(at, 2, endian)
    }
}
