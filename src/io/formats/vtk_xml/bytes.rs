//! The stored bytes of one array, decoded from base64 if needed.

use std::io::{BufRead, Cursor, ErrorKind, Read};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::error::{Error, Result};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::stream_error;
use crate::io::formats::vtk_xml::document::Storage;
use crate::num;

/// Reads the bytes of one array.
pub(crate) struct Bytes<'s, 'a> {
    pub(crate) source: &'a Source,
    /// The array, for messages.
    pub(crate) at: String,
    pub(crate) scanner: &'s mut Scanner<'a>,
    /// An upper bound of the stored bytes still to come.
    pub(crate) stored: u64,
    /// Bytes requested but not yet returned.
    pub(crate) left: u64,
    /// Decoded bytes, if the stored ones are base64.
    pub(crate) decoded: Option<Cursor<Vec<u8>>>,
}

impl Bytes<'_, '_> {
    pub(crate) fn error(&self, rule: impl Into<String>) -> Error {
        self.source.error(&self.at, rule)
    }

    /// Returns an upper bound of the bytes still to come.
    pub(crate) fn most(&self) -> u64 {
        if self.decoded.is_some() { self.stored / 4 * 3 + 2 } else { self.stored }
    }

    /// Reads a whole number of a header, of 4 or 8 bytes.
    pub(crate) fn word(&mut self, storage: Storage) -> Result<u64> {
        self.left = storage.word;
        let mut bytes = [0; 8];
        let own = if storage.word == 4 { &mut bytes[..4] } else { &mut bytes[..] };
        self.read_exact(own).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => self.error("ends within its header"),
            _ => stream_error(self.source, error),
        })?;
        Ok(storage.endian.whole(own))
    }

    /// Begins uncompressed data: a header with its size, then exactly `wanted` bytes.
    pub(crate) fn begin(&mut self, storage: Storage, wanted: u64) -> Result<()> {
        let announced = self.word(storage)?;
        if announced != wanted {
            let rule = format!("its header announces {announced} bytes: {wanted} are needed");
            return Err(self.error(rule));
        }
        if wanted > self.most() {
            return Err(self.error(format!("needs {wanted} bytes: at most {} are there", self.most())));
        }
        self.left = wanted;
        Ok(())
    }

    /// Decodes more base64, at most the requested bytes.
    fn decode(&mut self) -> std::io::Result<Vec<u8>> {
        const MOST: u64 = 1 << 14;
        let wanted = usize::try_from(self.left.min(MOST).div_ceil(3) * 4).unwrap_or(4);
        let mut text = Vec::with_capacity(wanted);
        // A padded group ends a base64 stream; another may follow.
        let mut padded = false;
        loop {
            let most = usize::try_from(self.stored).unwrap_or(usize::MAX);
            let buffer = match self.scanner.fill_buf() {
                Ok(buffer) => &buffer[..buffer.len().min(most)],
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            let (mut used, mut done) = (0, buffer.is_empty());
            for &byte in buffer {
                used += 1;
                if !byte.is_ascii_whitespace() {
                    text.push(byte);
                    padded |= byte == b'=';
                    done = text.len() == wanted || padded && text.len().is_multiple_of(4);
                }
                if done {
                    break;
                }
            }
            self.scanner.consume(used);
            self.stored -= num::wide(used);
            if done {
                let no_base64 = |error| std::io::Error::other(self.error(format!("no base64: {error}")));
                return STANDARD.decode(&text).map_err(no_base64);
            }
        }
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
        let empty = |decoded: &mut Cursor<_>| decoded.fill_buf().is_ok_and(<[u8]>::is_empty);
        if self.left > 0 && self.decoded.as_mut().is_some_and(empty) {
            self.decoded = Some(Cursor::new(self.decode()?));
        }
        let (bytes, most) = match &mut self.decoded {
            Some(decoded) => (decoded.fill_buf()?, self.left),
            None if self.left.min(self.stored) == 0 => return Ok(&[]),
            None => (self.scanner.fill_buf()?, self.left.min(self.stored)),
        };
        Ok(&bytes[..bytes.len().min(usize::try_from(most).unwrap_or(usize::MAX))])
    }

    fn consume(&mut self, bytes: usize) {
        self.left = self.left.saturating_sub(num::wide(bytes));
        match &mut self.decoded {
            Some(decoded) => decoded.consume(bytes),
            None => {
                self.scanner.consume(bytes);
                self.stored = self.stored.saturating_sub(num::wide(bytes));
            }
        }
    }
}
