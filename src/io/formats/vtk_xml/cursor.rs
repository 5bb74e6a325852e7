//! A position in the file that moves forward.

use std::io::{BufRead, ErrorKind, Read};

use crate::error::Result;
use crate::io::file::source::{Encoding, Source};
use crate::io::file::text::stream_error;
use crate::num;

/// A position in the decompressed file. In a compressed file, moving backwards restarts decompression.
pub(crate) struct Cursor<'a> {
    source: &'a Source,
    reader: Box<dyn BufRead + 'a>,
    pub(crate) position: u64,
    /// The number of restarts of a compressed file.
    again: u32,
}

impl<'a> Cursor<'a> {
    /// The limit on restarts; common files need about one per array.
    const MOST_AGAIN: u32 = 64;

    pub(crate) fn new(source: &'a Source) -> Self {
        Self { source, reader: source.reader(0, source.encoding()), position: 0, again: 0 }
    }

    pub(crate) fn seek(&mut self, offset: u64) -> Result<()> {
        let source = self.source;
        if !source.is_gzip() {
            self.reader = source.reader(offset, Encoding::Raw);
            self.position = offset;
            return Ok(());
        }
        if offset < self.position {
            self.again += 1;
            if self.again > Self::MOST_AGAIN {
                let rule = "arrays in an order that needs unpacking the file too often: unpack it first";
                return Err(source.error("data", rule));
            }
            self.reader = source.reader(0, Encoding::Gzip);
            self.position = 0;
        }
        while self.position < offset {
            let left = usize::try_from(offset - self.position).unwrap_or(usize::MAX);
            let take = match self.fill_buf() {
                Ok([]) => {
                    return Err(source.error(format!("byte {offset}"), "the file ends before this place"));
                }
                Ok(buffer) => buffer.len().min(left),
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(stream_error(source, error)),
            };
            self.consume(take);
        }
        Ok(())
    }
}

impl Read for Cursor<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let got = self.reader.read(buffer)?;
        self.position = self.position.saturating_add(num::wide(got));
        Ok(got)
    }
}

impl BufRead for Cursor<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.reader.fill_buf()
    }

    fn consume(&mut self, bytes: usize) {
        self.reader.consume(bytes);
        self.position = self.position.saturating_add(num::wide(bytes));
    }
}
