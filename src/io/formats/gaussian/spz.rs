//! SPZ (`.spz`), versions 1 to 4: quantised splats in blocks of one property each.
//!
//! Versions 1 to 3 are a gzip stream of a header of 16 bytes, the blocks, and records of extensions. Version 4 has a plain header of
//! 32 bytes, records of extensions, a table of sizes, and a zstd stream for each block that is not empty. Of extensions the
//! axes are read (`0xADBE0003`); the others are left out. Files that do not tell their axes are right, up, back.

mod blocks;
mod extensions;

use std::io::Read as _;

use ruzstd::decoding::StreamingDecoder;

use crate::error::Result;
use crate::io::build::gaussians::{About, Columns};
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::Endian;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::{Encoding, Source};
use crate::io::formats::gaussian::rows::rows;
use crate::io::formats::gaussian::spz::blocks::{Block, Coding};
use crate::io::formats::gaussian::spz::extensions::Extensions;
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;
use crate::num;
use crate::scene::{Axes, TrainedMode, harmonics};

pub(crate) struct Spz;

/// The magic of the header.
const MAGIC: &[u8] = b"NGSP";
/// The version whose blocks are separate streams.
const STREAMS: u32 = 4;
/// The greatest number of bits behind the point of a coordinate of 24 bits.
const MOST_BITS: u8 = 24;
/// Size of the header of version 4, in bytes.
const HEADER: u64 = 32;
/// The window that a stream may have, in bytes, if memory allows, even if its contents are smaller.
const WINDOW: u64 = 8 << 20;

impl Reader for Spz {
    fn name(&self) -> &'static str {
        "SPZ"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["spz"]
    }

    fn recognises(&self, source: &Source) -> bool {
        source.head().starts_with(MAGIC)
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let header = Header::read(source)?;
        let mut budget = Budget::new(source, request);
        let (columns, extensions) = if header.version < STREAMS {
            header.packed(source, &mut budget)?
        } else {
            header.streams(source, &mut budget)?
        };
        let unmarked = (Axes::Rub.into(), "the convention of SPZ files: the file does not tell");
        let (axes, axes_from) = extensions.axes.map_or(unmarked, |axes| (axes, "the file"));
        let about = About {
            format: ["SPZ 1", "SPZ 2", "SPZ 3", "SPZ 4"][num::index(header.version - 1)],
            axes,
            axes_from,
            mode: if header.flags & 1 == 1 { TrainedMode::Antialiased } else { TrainedMode::Unknown },
            texts: Vec::new(),
            notes: extensions.notes,
        };
        columns.finish(source, &mut budget, about, request)
    }
}

/// The first bytes of the file.
struct Header {
    version: u32,
    count: u64,
    degree: u32,
    bits: u8,
    flags: u8,
    /// The number of streams of version 4.
    streams: u8,
    /// The offset of the table of streams.
    table: u64,
}

impl Header {
    fn read(source: &Source) -> Result<Self> {
        let head = source.head();
        let wrong = |rule: String| source.error("header", rule);
        let whole = |at: usize, bytes: usize| {
            let bytes = head.get(at..at + bytes);
            bytes.map(|bytes| Endian::Little.whole(bytes)).ok_or_else(|| wrong("ends early".to_owned()))
        };
        if !head.starts_with(MAGIC) {
            return Err(wrong("does not begin with NGSP".to_owned()));
        }
        let version = u32::try_from(whole(4, 4)?).unwrap_or(u32::MAX);
        if !(1..=STREAMS).contains(&version) {
            return Err(wrong(format!("version {version}: must be 1 to {STREAMS}")));
        }
        match (version < STREAMS, source.is_gzip()) {
            (true, false) => {
                return Err(wrong(format!(
                    "version {version}: must be a gzip stream, this one is not packed"
                )));
            }
            (false, true) => return Err(wrong(format!("version {version}: must not be a gzip stream"))),
            _ => {}
        }
        let count = whole(8, 4)?;
        let [degree, bits, flags, streams] = [12, 13, 14, 15].map(|at| head.get(at).copied().unwrap_or(0));
        whole(12, 4)?;
        if u32::from(degree) > harmonics::MAX_DEGREE {
            return Err(wrong(format!("degree {degree}: must be 0 to {}", harmonics::MAX_DEGREE)));
        }
        if version > 1 && bits > MOST_BITS {
            return Err(wrong(format!("{bits} fractional bits: must be 0 to {MOST_BITS}")));
        }
        // As the format's own library: a splat takes at least 9 bytes, which shrink to a 1024th at most.
        if count > source.len().saturating_mul(1024) / 9 {
            return Err(wrong(format!("{count} splats: more than {} bytes can hold", source.len())));
        }
        let table = if version < STREAMS { 0 } else { whole(16, 4)? };
        Ok(Self { version, count, degree: degree.into(), bits, flags, streams, table })
    }

    fn coding(&self) -> Coding {
        Coding { version: self.version, bits: self.bits, degree: self.degree }
    }

    /// Reads the blocks of versions 1 to 3, one behind the other.
    fn packed(&self, source: &Source, budget: &mut Budget) -> Result<(Columns, Extensions)> {
        let mut scanner = Scanner::new(source);
        scanner.skip(16)?;
        let coding = self.coding();
        let width: usize = Block::ALL.iter().map(|block| coding.width(*block)).sum();
        if self.count.saturating_mul(num::wide(width)) > scanner.available() {
            let rule = format!("{} splats: more than {} bytes can hold", self.count, source.len());
            return Err(source.error("header", rule));
        }
        let mut columns = Columns::new(source, budget, self.count, self.degree)?;
        let count = columns.parts.centres.len();
        for block in Block::ALL {
            rows(&mut scanner, count, coding.width(block), &mut |i, row| {
                coding.decode(block, row, &mut columns, i);
            })?;
        }
        let mut extensions = Extensions::default();
        if self.flags & 2 != 0 {
            while !scanner.peek(1)?.is_empty() {
                extensions.read(&mut scanner, u64::MAX)?;
            }
        }
        if !scanner.peek(1)?.is_empty() {
            return Err(
                source.error(format!("byte {}", scanner.position()), "more than the header announces")
            );
        }
        Ok((columns, extensions))
    }

    /// Reads the streams of version 4.
    fn streams(&self, source: &Source, budget: &mut Budget) -> Result<(Columns, Extensions)> {
        let coding = self.coding();
        let size = |block: Block| self.count.saturating_mul(num::wide(coding.width(block)));
        let blocks: Vec<Block> = Block::ALL.into_iter().filter(|block| size(*block) > 0).collect();
        let wrong = |rule: String| source.error("table of streams", rule);
        if usize::from(self.streams) != blocks.len() {
            return Err(wrong(format!("{} streams: {} are needed", self.streams, blocks.len())));
        }
        let entries = self.table.saturating_add(16 * u64::from(self.streams));
        if self.table < HEADER || entries > source.len() {
            let rule = format!("at byte {}: must lie between the header and the end of the file", self.table);
            return Err(wrong(rule));
        }
        let table = source.bytes(self.table, entries - self.table)?;
        let sizes: Vec<[u64; 2]> = table
            .chunks_exact(16)
            .map(|entry| [&entry[..8], &entry[8..]].map(|n| Endian::Little.whole(n)))
            .collect();
        let mut total = Some(entries);
        for (block, [packed, plain]) in blocks.iter().zip(&sizes) {
            if *plain != size(*block) {
                let name = block.name();
                return Err(wrong(format!(
                    "{plain} bytes of {name}: {} splats have {}",
                    self.count,
                    size(*block)
                )));
            }
            total = total.and_then(|total| total.checked_add(*packed));
        }
        if total != Some(source.len()) {
            return Err(wrong(format!("the streams do not end with the file, at byte {}", source.len())));
        }
        let mut extensions = Extensions::default();
        if self.flags & 2 != 0 {
            let mut scanner = Scanner::resume(source, HEADER, 0)?;
            while scanner.position() < self.table {
                extensions.read(&mut scanner, self.table)?;
            }
        }
        let mut columns = Columns::new(source, budget, self.count, self.degree)?;
        let count = columns.parts.centres.len();
        let mut offset = entries;
        for (block, [packed, plain]) in blocks.into_iter().zip(sizes) {
            let damaged = |error: String| source.error(format!("stream of {}", block.name()), error);
            let mut stored = source.reader(offset, Encoding::Raw).take(packed);
            let window = plain.next_power_of_two().max(WINDOW.min(budget.left()));
            let stream = StreamingDecoder::new_with_max_window_size(&mut stored, window)
                .map_err(|error| damaged(format!("no zstd stream: {error}")))?;
            let mut scanner = Scanner::of(source, std::io::BufReader::new(stream), plain);
            let done = rows(&mut scanner, count, coding.width(block), &mut |i, row| {
                coding.decode(block, row, &mut columns, i);
            });
            done.and_then(|()| match scanner.peek(1)? {
                [] => Ok(()),
                _ => Err(damaged("is longer than the table says".to_owned())),
            })?;
            drop(scanner);
            if stored.limit() > 0 {
                return Err(damaged(format!("{} bytes follow its end", stored.limit())));
            }
            offset = offset.saturating_add(packed);
        }
        Ok((columns, extensions))
    }
}
