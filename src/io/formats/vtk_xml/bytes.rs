//! The stored bytes of one array, decoded from base64 if needed.

use std::io::{BufRead, ErrorKind, Read};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::error::{Error, Result};
use crate::io::file::sample_type::Endian;
use crate::io::file::source::Source;
use crate::io::file::text::stream_error;
use crate::io::formats::vtk_xml::cursor::Cursor;
use crate::num;

/// Reads the bytes of one array.
pub(crate) struct Bytes<'s, 'a> {
    pub(crate) source: &'a Source,
    /// The array, for messages.
    pub(crate) at: String,
    pub(crate) cursor: &'s mut Cursor<'a>,
    pub(crate) base64: bool,
    /// An upper bound of the stored bytes still to come.
    pub(crate) stored: u64,
    /// Bytes requested but not yet returned.
    pub(crate) left: u64,
    /// Decoded base64; `behind` bytes of it have been returned.
    pub(crate) decoded: Vec<u8>,
    pub(crate) behind: usize,
    /// Base64 to decode.
    pub(crate) text: Vec<u8>,
}

impl Bytes<'_, '_> {
    pub(crate) fn error(&self, rule: impl Into<String>) -> Error {
        self.source.error(&self.at, rule)
    }

    /// Returns an upper bound of the bytes still to come.
    pub(crate) fn most(&self) -> u64 {
        if self.base64 { self.stored / 4 * 3 + 2 } else { self.stored }
    }

    /// Reads whole numbers of a header.
    pub(crate) fn words(&mut self, endian: Endian, word: u64, count: u64) -> Result<Vec<u64>> {
        self.left = word * count;
        let mut words = Vec::new();
        for _ in 0..count {
            let mut bytes = [0; 8];
            let size = usize::try_from(word).unwrap_or(8).min(8);
            let own = &mut bytes[..size];
            self.read_exact(own).map_err(|error| match error.kind() {
                ErrorKind::UnexpectedEof => self.error("ends within its header"),
                _ => stream_error(self.source, error),
            })?;
            words.push(endian.whole(own));
        }
        Ok(words)
    }

    /// Reads uncompressed data: a header with its size, then exactly `wanted` bytes.
    pub(crate) fn whole(
        mut self,
        endian: Endian,
        word: u64,
        wanted: u64,
        taker: &mut dyn FnMut(&mut dyn Read) -> std::io::Result<()>,
    ) -> std::io::Result<()> {
        let announced = self.words(endian, word, 1).map_err(std::io::Error::other)?;
        if announced != [wanted] {
            let announced = announced.first().copied().unwrap_or_default();
            let rule = format!("its header announces {announced} bytes: {wanted} are needed");
            return Err(std::io::Error::other(self.error(rule)));
        }
        if wanted > self.most() {
            let rule = format!("needs {wanted} bytes: at most {} are there", self.most());
            return Err(std::io::Error::other(self.error(rule)));
        }
        self.left = wanted;
        taker(&mut self)
    }

    /// Decodes more base64, at most the requested bytes.
    fn decode(&mut self) -> std::io::Result<()> {
        const MOST: u64 = 1 << 14;
        self.decoded.clear();
        self.behind = 0;
        self.text.clear();
        let wanted = usize::try_from(self.left.min(MOST).div_ceil(3) * 4).unwrap_or(4);
        // A padded group ends a base64 stream; another may follow.
        let mut padded = false;
        while self.text.len() < wanted && !(padded && self.text.len().is_multiple_of(4)) {
            let most = usize::try_from(self.stored).unwrap_or(usize::MAX);
            let buffer = match self.cursor.fill_buf() {
                Ok(buffer) => &buffer[..buffer.len().min(most)],
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            if buffer.is_empty() {
                break;
            }
            let mut used = 0;
            for &byte in buffer {
                if self.text.len() == wanted || (padded && self.text.len().is_multiple_of(4)) {
                    break;
                }
                used += 1;
                if !byte.is_ascii_whitespace() {
                    self.text.push(byte);
                    padded |= byte == b'=';
                }
            }
            self.cursor.consume(used);
            self.stored -= u64::try_from(used).unwrap_or(self.stored);
        }
        if let Err(error) = STANDARD.decode_vec(&self.text, &mut self.decoded) {
            return Err(std::io::Error::other(self.error(format!("no base64: {error}"))));
        }
        Ok(())
    }
}

impl Read for Bytes<'_, '_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let got = self.fill_buf()?.read(buffer)?;
        self.consume(got);
        Ok(got)
    }
}

impl BufRead for Bytes<'_, '_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        if self.base64 {
            if self.left > 0 && self.behind == self.decoded.len() {
                self.decode()?;
            }
            let most = usize::try_from(self.left).unwrap_or(usize::MAX);
            let bytes = &self.decoded[self.behind..];
            Ok(&bytes[..bytes.len().min(most)])
        } else {
            let most = usize::try_from(self.left.min(self.stored)).unwrap_or(usize::MAX);
            if most == 0 {
                return Ok(&[]);
            }
            let bytes = self.cursor.fill_buf()?;
            Ok(&bytes[..bytes.len().min(most)])
        }
    }

    fn consume(&mut self, bytes: usize) {
        let count = num::wide(bytes);
        self.left = self.left.saturating_sub(count);
        if self.base64 {
            self.behind = self.behind.saturating_add(bytes).min(self.decoded.len());
        } else {
            self.cursor.consume(bytes);
            self.stored = self.stored.saturating_sub(count);
        }
    }
}
