//! A stream that counts bytes and lines, and limits the length of one piece of markup.

use std::io::{BufRead, Read};

use crate::num;

/// A stream that counts bytes and lines.
pub(crate) struct Counted<'a> {
    pub(crate) reader: Box<dyn BufRead + 'a>,
    /// Bytes read.
    pub(crate) position: u64,
    /// Line breaks read.
    pub(crate) line: u64,
    /// The number of bytes that may still be read, if limited.
    pub(crate) fuel: Option<usize>,
}

impl Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let got = self.fill_buf()?.read(buffer)?;
        self.consume(got);
        Ok(got)
    }
}

impl BufRead for Counted<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        let most = self.fuel.unwrap_or(usize::MAX);
        if most == 0 {
            return Err(std::io::Error::other("markup too long"));
        }
        let bytes = self.reader.fill_buf()?;
        Ok(&bytes[..bytes.len().min(most)])
    }

    fn consume(&mut self, bytes: usize) {
        // The bytes are in the buffer already, so this reads nothing.
        if let Ok(filled) = self.reader.fill_buf() {
            let lines = filled.iter().take(bytes).filter(|&&byte| byte == b'\n').count();
            self.line += u64::try_from(lines).unwrap_or(0);
        }
        self.reader.consume(bytes);
        self.position = self.position.saturating_add(num::wide(bytes));
        if let Some(fuel) = &mut self.fuel {
            *fuel = fuel.saturating_sub(bytes);
        }
    }
}
