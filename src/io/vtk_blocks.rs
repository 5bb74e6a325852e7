//! The numbers of the arrays of VTK's XML files: words, or bytes that are bare or in base64, in one piece or
//! in compressed blocks.
//!
//! Bytes begin with a header of whole numbers: their count; or, of blocks, how many there are, the size of
//! each, the size of the last where it is smaller (else 0), and the compressed size of each. In base64 the
//! header of blocks is padded, and encoded apart from them.

use std::io::{BufRead, ErrorKind, Read};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::{Decompress, FlushDecompress, Status};
use lzma_rust2::{Action, XzStream};

use super::samples::{Endian, SampleType};
use super::source::{Budget, Encoding, Source};
use super::text::{self, Scanner, stream_error};
use super::vtk_document::{Array, Compressor, Place, Storage, Text};
use crate::error::{Error, Result};
use crate::num;

impl Compressor {
    /// The most bytes that so many packed ones can hold.
    fn most(self, packed: u64) -> u64 {
        let ratio = match self {
            Self::Zlib => return Encoding::Zlib.most(packed),
            // A byte more makes a match 255 bytes longer.
            Self::Lz4 => 255,
            // 273 bytes take 14 decisions of at least log2(2048 / 2017) bits; rounded up.
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

/// A place in the file that moves forward. Where the whole file is packed, moving back means beginning again.
struct Cursor<'a> {
    source: &'a Source,
    reader: Box<dyn BufRead + 'a>,
    position: u64,
    /// How often a packed file was begun again.
    again: u32,
}

impl<'a> Cursor<'a> {
    /// Files as they are written need about one for each array that is read.
    const MOST_AGAIN: u32 = 64;

    fn new(source: &'a Source) -> Self {
        Self { source, reader: source.reader(0, source.encoding()), position: 0, again: 0 }
    }

    fn seek(&mut self, offset: u64) -> Result<()> {
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

/// How often a file as large as the arrays in it may be read.
const MOST_OFTEN: u64 = 16;

/// The arrays of a file.
pub(super) struct Store<'a> {
    source: &'a Source,
    storage: Storage,
    cursor: Cursor<'a>,
    budget: Budget<'a>,
    /// Stored bytes that were read.
    behind: u64,
}

/// What takes numbers from a stream.
pub(super) type Taker<'t> = dyn FnMut(&mut dyn Read, SampleType, Endian) -> std::io::Result<()> + 't;

impl<'a> Store<'a> {
    pub(super) fn new(source: &'a Source, storage: Storage, budget: Budget<'a>) -> Self {
        Self { source, storage, cursor: Cursor::new(source), budget, behind: 0 }
    }

    /// The type of an array's numbers.
    fn kind(&self, array: &Array) -> Result<SampleType> {
        array.kind.clone().map_err(|why| self.source.error(array.at(), format!("cannot be read: {why}")))
    }

    /// Where an array's bytes begin, how many there are at most, and whether they are in base64.
    fn span(&self, array: &Array) -> Result<(u64, u64, bool)> {
        let source = self.source;
        Ok(match array.place {
            Place::Words(text) | Place::Base64(text) => (text.begin, text.end - text.begin, true),
            Place::Appended(offset) => {
                let Some(appended) = self.storage.appended else {
                    return Err(source.error(array.at(), "its format is appended: there is no AppendedData"));
                };
                let most = source.encoding().most(source.len());
                let begin = appended.begin.checked_add(offset).filter(|&begin| begin <= most);
                let Some(begin) = begin else {
                    let rule = format!("offset {offset}: the file has {} bytes", source.len());
                    return Err(source.error(array.at(), rule));
                };
                (begin, most - begin, appended.base64)
            }
        })
    }

    /// Checks, before memory is taken, whether an array can hold so many numbers.
    pub(super) fn check(&self, array: &Array, count: u64) -> Result<()> {
        let kind = self.kind(array)?;
        let (_, stored, base64) = self.span(array)?;
        let most = if matches!(array.place, Place::Words(_)) {
            text::most_numbers(stored)
        } else {
            let bytes = if base64 { stored / 4 * 3 } else { stored };
            self.storage.compressor.map_or(bytes, |compressor| compressor.most(bytes)) / kind.bytes()
        };
        if count <= most {
            return Ok(());
        }
        let rule =
            format!("needs {count} numbers of type {}: {stored} bytes hold at most {most}", kind.name());
        Err(self.source.error(array.at(), rule))
    }

    /// Has exactly so many numbers of an array taken from a stream.
    pub(super) fn take(&mut self, array: &Array, count: u64, taker: &mut Taker) -> Result<()> {
        if count == 0 {
            return Ok(());
        }
        self.check(array, count)?;
        let (begin, ..) = self.span(array)?;
        self.read(array, count, taker)?;
        if let Place::Base64(text) = array.place {
            self.blank(array, count, text.end)?;
        }
        // Arrays may lie in the same place, but not so often that a small file is a lot of work.
        self.behind = self.behind.saturating_add(self.cursor.position.saturating_sub(begin));
        let most = self.source.encoding().most(self.source.len()).saturating_mul(MOST_OFTEN);
        if self.behind <= most {
            return Ok(());
        }
        Err(self.source.error(array.at(), "too many arrays lie in the same place"))
    }

    /// Whether nothing but blanks is left of a text.
    fn blank(&mut self, array: &Array, count: u64, end: u64) -> Result<()> {
        while self.cursor.position < end {
            let left = usize::try_from(end - self.cursor.position).unwrap_or(usize::MAX);
            let take = match self.cursor.fill_buf() {
                Ok([]) => break,
                Ok(buffer) if !buffer[..buffer.len().min(left)].iter().all(u8::is_ascii_whitespace) => {
                    let rule = format!("more base64 than the {count} numbers need");
                    return Err(self.source.error(array.at(), rule));
                }
                Ok(buffer) => buffer.len().min(left),
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(stream_error(self.source, error)),
            };
            self.cursor.consume(take);
        }
        Ok(())
    }

    fn read(&mut self, array: &Array, count: u64, taker: &mut Taker) -> Result<()> {
        let source = self.source;
        let kind = self.kind(array)?;
        let (begin, stored, base64) = self.span(array)?;
        let failed = |error: std::io::Error| match error.kind() {
            ErrorKind::UnexpectedEof => {
                source.error(array.at(), format!("needs {count} numbers of type {}: ends early", kind.name()))
            }
            ErrorKind::InvalidData if error.get_ref().is_some_and(|inner| !inner.is::<Error>()) => {
                source.error(array.at(), error.to_string())
            }
            _ => stream_error(source, error),
        };
        self.cursor.seek(begin)?;
        if let Place::Words(Text { line, .. }) = array.place {
            let words = (&mut self.cursor).take(stored);
            let mut scanner = Scanner::of(source, words, stored).after_lines(line);
            taker(&mut scanner.numbers(kind), kind, Endian::Little).map_err(failed)?;
            return match scanner.word()?.map(text::shown) {
                None => Ok(()),
                Some(word) => {
                    let rule = format!("\"{word}\": more than the {count} numbers that are needed");
                    Err(scanner.error(rule))
                }
            };
        }
        let wanted = count.checked_mul(kind.bytes()).ok_or_else(|| {
            source.error(array.at(), format!("needs {count} numbers: more than memory can address"))
        })?;
        let bytes = Bytes {
            source,
            at: array.at(),
            cursor: &mut self.cursor,
            base64,
            stored,
            left: 0,
            decoded: Vec::new(),
            behind: 0,
            text: Vec::new(),
        };
        let Storage { endian, word, compressor, .. } = self.storage;
        let Some(compressor) = compressor else {
            return bytes
                .whole(endian, word, wanted, &mut |reader| taker(reader, kind, endian))
                .map_err(failed);
        };
        let mut blocks = Blocks::open(bytes, endian, word, compressor, wanted, &mut self.budget)?;
        taker(&mut blocks, kind, endian).map_err(failed)?;
        let taken = blocks.taken;
        drop(blocks);
        self.budget.put_back(taken);
        Ok(())
    }
}

/// The bytes of one array.
struct Bytes<'s, 'a> {
    source: &'a Source,
    /// Which array, for messages.
    at: String,
    cursor: &'s mut Cursor<'a>,
    base64: bool,
    /// Stored bytes that there may still be.
    stored: u64,
    /// Bytes that were asked for and are not yet handed out.
    left: u64,
    /// Decoded base64, and how much of it is handed out.
    decoded: Vec<u8>,
    behind: usize,
    /// Base64 before it is decoded.
    text: Vec<u8>,
}

impl Bytes<'_, '_> {
    fn error(&self, rule: impl Into<String>) -> Error {
        self.source.error(&self.at, rule)
    }

    /// The most bytes that can still come.
    fn most(&self) -> u64 {
        if self.base64 { self.stored / 4 * 3 + 2 } else { self.stored }
    }

    /// The whole numbers of a header.
    fn words(&mut self, endian: Endian, word: u64, count: u64) -> Result<Vec<u64>> {
        self.left = word * count;
        let mut words = Vec::new();
        for _ in 0..count {
            let mut bytes = [0; 8];
            let size = usize::try_from(word).unwrap_or(8).min(8);
            let own = match endian {
                Endian::Little => &mut bytes[..size],
                Endian::Big => &mut bytes[8 - size..],
            };
            self.read_exact(own).map_err(|error| match error.kind() {
                ErrorKind::UnexpectedEof => self.error("ends within its header"),
                _ => stream_error(self.source, error),
            })?;
            words.push(match endian {
                Endian::Little => u64::from_le_bytes(bytes),
                Endian::Big => u64::from_be_bytes(bytes),
            });
        }
        Ok(words)
    }

    /// Bytes in one piece.
    fn whole(
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

    /// Decodes some more base64, no more than was asked for.
    fn decode(&mut self) -> std::io::Result<()> {
        const MOST: u64 = 1 << 14;
        self.decoded.clear();
        self.behind = 0;
        self.text.clear();
        let wanted = usize::try_from(self.left.min(MOST).div_ceil(3) * 4).unwrap_or(4);
        // A padded group ends a stream; what follows is another.
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

/// What unpacks a block.
enum Unpacker {
    Zlib(Decompress),
    Lzma(Box<XzStream>),
    /// The unpacked block, and how much of it is handed out.
    Lz4(Vec<u8>, usize),
}

/// The unpacked bytes of an array in blocks.
struct Blocks<'s, 'a> {
    bytes: Bytes<'s, 'a>,
    budget: &'s mut Budget<'a>,
    /// Bytes of memory that were taken.
    taken: u64,
    compressor: Compressor,
    /// Compressed sizes.
    sizes: Vec<u64>,
    /// Unpacked sizes of a block and of the last.
    size: u64,
    last: u64,
    /// Blocks behind, and the one that is open.
    next: usize,
    open: bool,
    unpacker: Unpacker,
    /// Bytes of the open block that are left, packed and unpacked.
    packed: u64,
    unpacked: u64,
    ended: bool,
    /// KiB that decoding xz has been granted.
    granted: u32,
}

impl<'s, 'a> Blocks<'s, 'a> {
    /// Reads the header.
    fn open(
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

    /// Unpacks some bytes of the open block.
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
                    // What it has taken in, it keeps, even where it fails for want of memory.
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
                            // The dictionary is as large as the stream says: it is taken before it is made.
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

    /// Passes over packed bytes of the open block.
    fn advance(&mut self, bytes: u64) {
        self.bytes.consume(usize::try_from(bytes).unwrap_or(usize::MAX));
        self.packed = self.packed.saturating_sub(bytes);
    }

    /// Ends the open block, of which nothing may be left.
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
