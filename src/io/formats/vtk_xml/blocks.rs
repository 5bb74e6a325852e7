//! The decompressed bytes of an array in blocks: zlib, LZ4 or xz.

use std::io::{BufRead, Cursor, ErrorKind, Read};

use flate2::{Decompress, FlushDecompress, Status};
use lzma_rust2::{Action, XzStream};

use crate::error::Result;
use crate::io::file::budget::Budget;
use crate::io::file::source::Encoding;
use crate::io::formats::vtk_xml::bytes::Bytes;
use crate::io::formats::vtk_xml::document::{Compressor, Storage};
use crate::num;

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
    /// The whole decompressed block.
    Whole(Cursor<Vec<u8>>),
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
    /// The decompressed sizes of a block and of the last block, which are not 0.
    size: u64,
    last: u64,
    /// The current block.
    next: usize,
    unpacker: Unpacker,
    /// Bytes left of the current block, compressed and decompressed; none between blocks.
    packed: u64,
    unpacked: u64,
    /// Whether the compressed stream of the current block has ended.
    ended: bool,
    /// Memory granted to the xz decoder, in KiB.
    granted: u32,
}

impl<'s, 'a> Blocks<'s, 'a> {
    /// Reads the header of blocks that hold `wanted` bytes, not 0, and checks it.
    pub(crate) fn open(
        mut bytes: Bytes<'s, 'a>,
        storage: Storage,
        compressor: Compressor,
        wanted: u64,
        budget: &'s mut Budget<'a>,
    ) -> Result<Self> {
        let mut word = || bytes.word(storage);
        let (count, size, partial) = (word()?, word()?, word()?);
        let last = if partial == 0 { size } else { partial };
        let full = count.checked_sub(1).and_then(|full| full.checked_mul(size));
        if full.and_then(|full| full.checked_add(last)) != Some(wanted) || last > size {
            let rule =
                format!("{count} blocks of {size} bytes, the last of {last}: {wanted} bytes are needed");
            return Err(bytes.error(format!("its header announces {rule}")));
        }
        if count.saturating_mul(storage.word) > bytes.most() {
            let rule = format!("its header announces {count} blocks: at most {} bytes follow", bytes.most());
            return Err(bytes.error(rule));
        }
        let mut taken = count.saturating_mul(8);
        budget.take(&bytes.at, taken)?;
        let sizes = (0..count).map(|_| bytes.word(storage)).collect::<Result<Vec<u64>>>()?;
        let packed = sizes.iter().try_fold(0_u64, |sum, &size| sum.checked_add(size));
        let Some(packed) = packed.filter(|&packed| packed <= bytes.most()) else {
            let rule = format!("its header announces more compressed bytes than the {} there", bytes.most());
            return Err(bytes.error(rule));
        };
        let most = compressor.most(packed);
        if most < wanted {
            let name = compressor.name();
            let rule = format!("needs {wanted} bytes: {packed} bytes of {name} hold at most {most}");
            return Err(bytes.error(rule));
        }
        if compressor == Compressor::Lz4 {
            // A block is held twice, compressed and not.
            let buffers = sizes.iter().copied().max().unwrap_or_default().saturating_add(size);
            budget.take(&bytes.at, buffers)?;
            taken = taken.saturating_add(buffers);
        }
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
            unpacker: Unpacker::Whole(Cursor::default()),
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
        self.ended = self.compressor == Compressor::Lz4;
        match (self.compressor, &mut self.unpacker) {
            (Compressor::Zlib, Unpacker::Zlib(zlib)) => zlib.reset(true),
            (Compressor::Zlib, unpacker) => *unpacker = Unpacker::Zlib(Decompress::new(true)),
            (Compressor::Lzma, unpacker) => {
                *unpacker = Unpacker::Lzma(Box::new(XzStream::new_mem_limit(false, self.granted)));
            }
            (Compressor::Lz4, unpacker) => {
                // The block before is freed first.
                *unpacker = Unpacker::Whole(Cursor::default());
                let (mut packed, _) = reserved(self.packed)?;
                (&mut self.bytes).take(self.packed).read_to_end(&mut packed)?;
                self.packed = 0;
                let (mut unpacked, size) = reserved(self.unpacked)?;
                unpacked.resize(size, 0);
                match lz4_flex::block::decompress_into(&packed, &mut unpacked) {
                    Ok(got) if got == size => self.unpacker = Unpacker::Whole(Cursor::new(unpacked)),
                    Ok(got) => return Err(self.error(format!("LZ4 of {got} bytes: {size} are needed"))),
                    Err(error) => return Err(self.error(format!("LZ4 is damaged: {error}"))),
                }
            }
        }
        Ok(())
    }

    /// Decompresses some bytes of the current block; none at its end.
    fn step(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let name = self.compressor.name();
        let damaged = |error: &dyn std::fmt::Display| format!("{name} stream is damaged: {error}");
        loop {
            let most = usize::try_from(self.packed).unwrap_or(usize::MAX);
            let mut stopped = false;
            let (consumed, produced) = match &mut self.unpacker {
                Unpacker::Whole(block) => return block.read(buffer),
                _ if self.ended => return Ok(0),
                Unpacker::Zlib(zlib) => {
                    let input = self.bytes.fill_buf()?;
                    let before = (zlib.total_in(), zlib.total_out());
                    match zlib.decompress(&input[..input.len().min(most)], buffer, FlushDecompress::None) {
                        Ok(status) => self.ended = status == Status::StreamEnd,
                        Err(error) => return Err(self.error(damaged(&error))),
                    }
                    (zlib.total_in() - before.0, zlib.total_out() - before.1)
                }
                Unpacker::Lzma(xz) => {
                    let input = self.bytes.fill_buf()?;
                    let before = (xz.total_in(), xz.total_out());
                    match xz.process(&input[..input.len().min(most)], buffer, Action::Run) {
                        Ok(result) => self.ended = result.status == lzma_rust2::Status::StreamEnd,
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
                            stopped = true;
                        }
                    }
                    // Input is consumed even if the decoder stops at its memory limit.
                    (xz.total_in() - before.0, xz.total_out() - before.1)
                }
            };
            if consumed == 0 && produced == 0 && !self.ended && !stopped {
                return Err(self.error(format!("{name} stream ends too early")));
            }
            self.bytes.consume(usize::try_from(consumed).unwrap_or(usize::MAX));
            self.packed = self.packed.saturating_sub(consumed);
            if produced > 0 {
                return Ok(usize::try_from(produced).unwrap_or(buffer.len()));
            }
        }
    }

    /// Ends the current block, of which nothing may be left.
    fn end(&mut self) -> std::io::Result<()> {
        if self.step(&mut [0])? > 0 {
            return Err(self.error("holds more bytes than its header says"));
        }
        if self.packed > 0 {
            return Err(self.error(format!("{} bytes are left after its end", self.packed)));
        }
        self.next += 1;
        Ok(())
    }
}

impl Read for Blocks<'_, '_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.unpacked == 0 {
            if self.next == self.sizes.len() {
                return Ok(0);
            }
            self.begin()?;
        }
        let most = usize::try_from(self.unpacked).unwrap_or(usize::MAX).min(buffer.len());
        if most == 0 {
            return Ok(0);
        }
        let got = self.step(&mut buffer[..most])?;
        if got == 0 {
            return Err(self.error(format!("ends {} bytes too early", self.unpacked)));
        }
        self.unpacked -= num::wide(got);
        if self.unpacked == 0 {
            self.end()?;
        }
        Ok(got)
    }
}

/// Returns an empty list with room for `count` bytes, and the count.
fn reserved(count: u64) -> std::io::Result<(Vec<u8>, usize)> {
    let mut list = Vec::new();
    let count = usize::try_from(count).map_err(|_| ErrorKind::OutOfMemory)?;
    list.try_reserve_exact(count).map_err(|_| ErrorKind::OutOfMemory)?;
    Ok((list, count))
}
