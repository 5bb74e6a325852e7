//! The decompressed bytes of an array in blocks: zlib, LZ4 or xz.

use std::io::{BufRead, ErrorKind, Read};

use flate2::{Decompress, FlushDecompress, Status};
use lzma_rust2::{Action, XzStream};

use crate::error::Result;
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::Endian;
use crate::io::file::source::Encoding;
use crate::io::formats::vtk_xml::bytes::Bytes;
use crate::io::formats::vtk_xml::document::Compressor;

impl Compressor {
    /// Returns an upper bound of the size of `packed` bytes after decompression.
    pub(crate) fn most(self, packed: u64) -> u64 {
        let ratio = match self {
            Self::Zlib => return Encoding::Zlib.most(packed),
            // One more byte extends a match by up to 255 bytes.
            Self::Lz4 => 255,
            // A match of 273 bytes takes 14 binary decisions of at least log2(2048 / 2017) bits each; rounded up.
            Self::Lzma => 8192,
        };
        packed.saturating_mul(ratio)
    }

    fn name(self) -> &'static str {
        match self {
            Self::Zlib => "zlib",
            Self::Lz4 => "LZ4",
            Self::Lzma => "xz",
        }
    }
}

/// The decompressor of a block.
enum Unpacker {
    Zlib(Decompress),
    Lzma(Box<XzStream>),
    /// The decompressed block, and the number of bytes returned.
    Lz4(Vec<u8>, usize),
}

/// Reads the decompressed bytes of an array in blocks.
pub(crate) struct Blocks<'s, 'a> {
    bytes: Bytes<'s, 'a>,
    budget: &'s mut Budget<'a>,
    /// Bytes taken from the budget.
    pub(crate) taken: u64,
    compressor: Compressor,
    /// The compressed sizes of the blocks.
    sizes: Vec<u64>,
    /// The decompressed sizes of a block and of the last block.
    size: u64,
    last: u64,
    /// The current block, and whether it has been started.
    next: usize,
    open: bool,
    unpacker: Unpacker,
    /// Bytes left of the current block, compressed and decompressed.
    packed: u64,
    unpacked: u64,
    ended: bool,
    /// Memory granted to the xz decoder, in KiB.
    granted: u32,
}

impl<'s, 'a> Blocks<'s, 'a> {
    /// Reads the header of blocks and checks it.
    pub(crate) fn open(
        mut bytes: Bytes<'s, 'a>,
        endian: Endian,
        word: u64,
        compressor: Compressor,
        wanted: u64,
        budget: &'s mut Budget<'a>,
    ) -> Result<Self> {
        let (count, size, partial) = match bytes.words(endian, word, 3)?.as_slice() {
            &[count, size, partial] => (count, size, partial),
            _ => return Err(bytes.error("ends within its header")),
        };
        let last = if partial == 0 { size } else { partial };
        let total = match count.checked_sub(1) {
            None => Some(0),
            Some(full) => full.checked_mul(size).and_then(|full| full.checked_add(last)),
        };
        if total != Some(wanted) || last > size {
            let rule = format!(
                "its header announces {count} blocks of {size} bytes, the last of {last}: {wanted} bytes are \
                 needed"
            );
            return Err(bytes.error(rule));
        }
        let header = count.saturating_mul(word);
        if header > bytes.most() {
            let rule = format!("its header announces {count} blocks: at most {} bytes follow", bytes.most());
            return Err(bytes.error(rule));
        }
        let mut taken = count.saturating_mul(8);
        budget.take(&bytes.at, taken)?;
        let sizes = bytes.words(endian, word, count)?;
        let packed = sizes.iter().try_fold(0_u64, |sum, &size| sum.checked_add(size));
        let Some(packed) = packed.filter(|&packed| packed <= bytes.most()) else {
            let rule = format!("its header announces more compressed bytes than the {} there", bytes.most());
            return Err(bytes.error(rule));
        };
        if compressor.most(packed) < wanted {
            let rule = format!(
                "needs {wanted} bytes: {packed} bytes of {} hold at most {}",
                compressor.name(),
                compressor.most(packed)
            );
            return Err(bytes.error(rule));
        }
        let unpacker = match compressor {
            Compressor::Zlib => Unpacker::Zlib(Decompress::new(true)),
            Compressor::Lzma => Unpacker::Lzma(Box::new(XzStream::new_mem_limit(false, 0))),
            Compressor::Lz4 => {
                let largest = sizes.iter().copied().max().unwrap_or_default();
                let buffers = largest.saturating_add(size.max(last));
                budget.take(&bytes.at, buffers)?;
                taken = taken.saturating_add(buffers);
                Unpacker::Lz4(Vec::new(), 0)
            }
        };
        bytes.left = packed;
        Ok(Self {
            bytes,
            budget,
            taken,
            compressor,
            sizes,
            size,
            last,
            next: 0,
            open: false,
            unpacker,
            packed: 0,
            unpacked: 0,
            ended: false,
            granted: 0,
        })
    }

    fn error(&self, rule: impl std::fmt::Display) -> std::io::Error {
        std::io::Error::other(self.bytes.error(format!("block {}: {rule}", self.next)))
    }

    /// Begins the next block.
    fn begin(&mut self) -> std::io::Result<()> {
        self.packed = self.sizes[self.next];
        self.unpacked = if self.next + 1 == self.sizes.len() { self.last } else { self.size };
        self.open = true;
        self.ended = false;
        match &mut self.unpacker {
            Unpacker::Zlib(zlib) => zlib.reset(true),
            Unpacker::Lzma(xz) => **xz = XzStream::new_mem_limit(false, self.granted),
            Unpacker::Lz4(unpacked, behind) => {
                *behind = 0;
                let mut packed = Vec::new();
                let size = usize::try_from(self.packed).map_err(|_| ErrorKind::OutOfMemory)?;
                packed.try_reserve_exact(size).map_err(|_| ErrorKind::OutOfMemory)?;
                (&mut self.bytes).take(self.packed).read_to_end(&mut packed)?;
                self.packed = 0;
                self.ended = true;
                let size = usize::try_from(self.unpacked).map_err(|_| ErrorKind::OutOfMemory)?;
                unpacked.clear();
                unpacked.try_reserve_exact(size).map_err(|_| ErrorKind::OutOfMemory)?;
                unpacked.resize(size, 0);
                match lz4_flex::block::decompress_into(&packed, unpacked) {
                    Ok(got) if got == size => {}
                    Ok(got) => return Err(self.error(format!("LZ4 of {got} bytes: {size} are needed"))),
                    Err(error) => return Err(self.error(format!("LZ4 is damaged: {error}"))),
                }
            }
        }
        Ok(())
    }

    /// Decompresses some bytes of the current block.
    fn step(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let name = self.compressor.name();
        let damaged = |error: &dyn std::fmt::Display| format!("{name} stream is damaged: {error}");
        loop {
            if self.ended && !matches!(self.unpacker, Unpacker::Lz4(..)) {
                return Ok(0);
            }
            let most = usize::try_from(self.packed).unwrap_or(usize::MAX);
            let input = self.bytes.fill_buf()?;
            let input = &input[..input.len().min(most)];
            let (consumed, produced) = match &mut self.unpacker {
                Unpacker::Lz4(unpacked, behind) => {
                    let got = (&unpacked[*behind..]).read(buffer)?;
                    *behind += got;
                    return Ok(got);
                }
                Unpacker::Zlib(zlib) => {
                    let before = (zlib.total_in(), zlib.total_out());
                    match zlib.decompress(input, buffer, FlushDecompress::None) {
                        Ok(status) => self.ended = status == Status::StreamEnd,
                        Err(error) => return Err(self.error(damaged(&error))),
                    }
                    (zlib.total_in() - before.0, zlib.total_out() - before.1)
                }
                Unpacker::Lzma(xz) => {
                    let before = (xz.total_in(), xz.total_out());
                    let result = xz.process(input, buffer, Action::Run);
                    // Input is consumed even if the decoder stops at its memory limit.
                    let consumed = xz.total_in() - before.0;
                    match result {
                        Ok(result) => {
                            self.ended = result.status == lzma_rust2::Status::StreamEnd;
                            (consumed, xz.total_out() - before.1)
                        }
                        Err(error) => {
                            let needed = xz.memory_usage().unwrap_or_default();
                            if error.kind() != ErrorKind::OutOfMemory || needed <= self.granted {
                                return Err(self.error(damaged(&error)));
                            }
                            // The stream sets the size of the dictionary, which is taken from the budget before it is
                            // allocated.
                            xz.set_mem_limit(needed);
                            let more = u64::from(needed - self.granted).saturating_mul(1024);
                            self.budget.take(&self.bytes.at, more).map_err(std::io::Error::other)?;
                            self.taken = self.taken.saturating_add(more);
                            self.granted = needed;
                            self.advance(consumed);
                            continue;
                        }
                    }
                }
            };
            if consumed == 0 && produced == 0 && !self.ended {
                return Err(self.error(format!("{name} stream ends too early")));
            }
            self.advance(consumed);
            if produced > 0 || buffer.is_empty() {
                return Ok(usize::try_from(produced).unwrap_or(buffer.len()));
            }
        }
    }

    /// Consumes compressed bytes of the current block.
    fn advance(&mut self, bytes: u64) {
        self.bytes.consume(usize::try_from(bytes).unwrap_or(usize::MAX));
        self.packed = self.packed.saturating_sub(bytes);
    }

    /// Ends the current block, of which nothing may be left.
    fn end(&mut self) -> std::io::Result<()> {
        let mut more = [0_u8];
        while !self.ended {
            if self.step(&mut more)? > 0 {
                return Err(self.error("holds more bytes than its header says"));
            }
        }
        if self.packed > 0 {
            return Err(self.error(format!("{} bytes are left after its end", self.packed)));
        }
        self.open = false;
        self.next += 1;
        Ok(())
    }
}

impl Read for Blocks<'_, '_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        if !self.open {
            if self.next == self.sizes.len() {
                return Ok(0);
            }
            self.begin()?;
        }
        let most = usize::try_from(self.unpacked).unwrap_or(usize::MAX).min(buffer.len());
        let got = self.step(&mut buffer[..most])?;
        if got == 0 {
            return Err(self.error(format!("ends {} bytes too early", self.unpacked)));
        }
        self.unpacked -= u64::try_from(got).unwrap_or(self.unpacked);
        if self.unpacked == 0 {
            self.end()?;
        }
        Ok(got)
    }
}
