//! Decoding of a page: strips and tiles, compressed or not.

use std::io::{Cursor, Read};

use tiff::decoder::{Decoder, Limits};
use tiff::tags::CompressionMethod;

use crate::error::Result;
use crate::io::file::decode::{self, Layout, Values};
use crate::io::file::half::from_half;
use crate::io::file::sample_type::Endian;
use crate::io::file::source::{Encoding, Source};
use crate::io::formats::jpeg;
use crate::io::formats::tiff::file::{File, index, place_of};
use crate::io::formats::tiff::look::Look;
use crate::io::formats::tiff::page::{Page, most_packed, name};
use crate::num::{self, wide};

/// The limit on the JPEG tables shared by the strips of a page, in bytes.
const MAX_TABLES: u64 = 4096;

impl Page {
    /// Returns an image by its index among the contiguous images of this page, as a page with a single strip, and
    /// that strip.
    pub(crate) fn following(&self, file: &File, image: usize) -> Result<(Self, (u64, u64))> {
        let first = self.chunks(file)?.first().map_or(0, |chunk| chunk.0);
        let offset = first.saturating_add(self.bytes().saturating_mul(wide(image)));
        Ok((Self { chunk: [self.width, self.height], ..self.clone() }, (offset, self.bytes())))
    }

    /// Appends the samples of the page, whose strips or tiles are `chunks`.
    pub(crate) fn append(
        &self,
        file: &File,
        chunks: &[(u64, u64)],
        look: &Look,
        values: &mut Values,
    ) -> Result<()> {
        let source = file.source;
        let pixels = index(u64::from(self.width).saturating_mul(u64::from(self.height)));
        let before = values.len();
        let mut append = |reader: &mut dyn Read, count: usize, endian: Endian| {
            let layout = Layout { endian, ..self.layout(look, 1) };
            decode::append(reader, count, &layout, values).map_err(|error| source.io_error(error))
        };
        if self.is_bare(look) {
            for (offset, len) in self.runs(file, chunks)? {
                self.spend(file, (offset, len))?;
                let mut bytes = source.reader(offset, Encoding::Raw).take(len);
                append(&mut bytes, index(len / self.row(1).max(1)), file.endian)?;
            }
        } else {
            let bytes = self.assemble(file, chunks, look)?;
            let endian =
                if self.compression == CompressionMethod::None { file.endian } else { Endian::NATIVE };
            if self.is_half() {
                append(&mut &*widened(&bytes, endian), pixels, Endian::NATIVE)?;
            } else {
                append(&mut &*bytes, pixels, endian)?;
            }
        }
        let count = values.len() - before;
        if count != pixels {
            let rule = format!("{count} pixels: {pixels} are needed");
            return Err(source.error(format!("page {}", self.number), rule));
        }
        Ok(())
    }

    /// Whether the samples lie in strips as they are read.
    fn is_bare(&self, look: &Look) -> bool {
        self.is_plain() && look.count == self.samples
    }

    /// Returns the offsets and sizes of runs of contiguous strips, which are not compressed.
    fn runs(&self, file: &File, chunks: &[(u64, u64)]) -> Result<Vec<(u64, u64)>> {
        let mut runs: Vec<(u64, u64)> = Vec::new();
        for (i, &(offset, count)) in (0..).zip(chunks) {
            let needed = self.needed(file.source, i, count)?;
            match runs.last_mut() {
                Some((start, len)) if start.checked_add(*len) == Some(offset) => {
                    *len = len.saturating_add(needed);
                }
                _ => runs.push((offset, needed)),
            }
        }
        Ok(runs)
    }

    /// Checks a run of strips.
    fn spend(&self, file: &File, (offset, len): (u64, u64)) -> Result<()> {
        file.spend(&format!("page {}: strip at byte {offset}", self.number), offset, len)
    }

    /// Returns the first byte of the samples, where they lie as they are read and one after another.
    pub(crate) fn begin(&self, file: &File, chunks: &[(u64, u64)], look: &Look) -> Result<Option<u64>> {
        if !self.is_bare(look) {
            return Ok(None);
        }
        let [run] = self.runs(file, chunks)?[..] else { return Ok(None) };
        self.spend(file, run)?;
        Ok(Some(run.0))
    }

    /// Returns the size of an uncompressed strip or tile, which must be at most its `count`.
    fn needed(&self, source: &Source, chunk: u64, count: u64) -> Result<u64> {
        let needed = self.chunk_bytes(chunk);
        if count < needed {
            let place = format!("page {}: strip or tile {chunk}", self.number);
            return Err(source.error(place, format!("{count} bytes: {needed} are needed")));
        }
        Ok(needed)
    }

    /// Collects the selected samples pixel by pixel: samples below 8 bits as bytes, others as stored.
    fn assemble(&self, file: &File, chunks: &[(u64, u64)], look: &Look) -> Result<Vec<u8>> {
        let tables = match &self.tables {
            Some(entry) => {
                let (place, len) =
                    (place_of(self.number, entry.tag), entry.count.saturating_mul(entry.size()));
                if len > MAX_TABLES {
                    let rule = format!("{} bytes: at most {MAX_TABLES}", entry.count);
                    return Err(file.source.error(place, rule));
                }
                file.piece(&place, entry.at, len)?
            }
            None => Vec::new(),
        };
        let own = usize::from(self.bits).div_ceil(8);
        let pixel = own * look.count;
        let [width, height] = [self.width, self.height].map(num::index);
        let chunk = self.chunk.map(num::index);
        // The caller has taken the memory from the budget.
        let mut page = vec![0_u8; width * height * pixel];
        let [across, down] = self.grid();
        let in_chunk = if self.planar { 1 } else { self.samples };
        let mut unpacked = Vec::new();
        for (i, &stored) in (0..).zip(chunks) {
            let plane = index(i / (across * down));
            if self.planar && !(look.first..look.first + look.count).contains(&plane) {
                continue;
            }
            let bytes = self.expand(file, i, stored, &tables)?;
            let (left, top) = (index(i % across) * chunk[0], index(i / across % down) * chunk[1]);
            let columns = chunk[0].min(width - left);
            // The selected bytes of a stored pixel, and their place in the result.
            let (from, to, len) = match self.planar {
                true => (0, (plane - look.first) * own, own),
                false => (look.first * own, 0, pixel),
            };
            let rows = bytes.chunks_exact(index(self.row(self.chunk[0]))).take(index(self.visible_rows(i)));
            for (y, row) in rows.enumerate() {
                let row = if self.bits < 8 {
                    unpack(row, self.bits, columns * in_chunk, &mut unpacked);
                    &unpacked
                } else {
                    row
                };
                let target = &mut page[((top + y) * width + left) * pixel..][..columns * pixel];
                for (target, stored) in target.chunks_exact_mut(pixel).zip(row.chunks_exact(own * in_chunk)) {
                    target[to..to + len].copy_from_slice(&stored[from..from + len]);
                }
            }
        }
        Ok(page)
    }

    /// Decompresses one strip or tile.
    fn expand(&self, file: &File, chunk: u64, (offset, count): (u64, u64), tables: &[u8]) -> Result<Vec<u8>> {
        let source = file.source;
        let place = format!("page {}: strip or tile {chunk} at byte {offset}", self.number);
        let name = name(self.compression).unwrap_or_default();
        if self.compression == CompressionMethod::None {
            let needed = self.needed(source, chunk, count)?;
            file.spend(&place, offset, needed)?;
            return source.bytes(offset, needed);
        }
        let needed = self.chunk_bytes(chunk);
        let most = count.saturating_mul(self.ratio());
        if needed > most {
            let rule = format!("needs {needed} bytes: {count} of {name} hold at most {most}");
            return Err(source.error(place, rule));
        }
        if count > most_packed(needed) {
            return Err(source.error(place, format!("{count} bytes for {needed} unpacked ones")));
        }
        file.spend(&place, offset, count)?;
        let packed = source.bytes(offset, count)?;
        let rows = self.rows(chunk);
        if self.compression == CompressionMethod::ModernJPEG {
            let jpeg::Frame { width, height, components, bits } =
                jpeg::frame(&packed).map_err(|why| source.error(&place, format!("JPEG: {why}")))?;
            let fits = u32::from(width) == self.chunk[0]
                && (rows..=u64::from(self.chunk[1])).contains(&height.into())
                && usize::from(components) == (if self.planar { 1 } else { self.samples })
                && bits == 8;
            if !fits {
                let found = format!("JPEG of {width} x {height} pixels, {components} x {bits} bits");
                return Err(source.error(place, format!("{found}: does not fit the page")));
            }
        }
        let small = self.small(file.endian, rows, &packed, tables);
        drop(packed);
        let mut limits = Limits::default();
        limits.decoding_buffer_size = index(needed);
        limits.intermediate_buffer_size = small.len();
        let mut bytes = vec![0_u8; index(needed)];
        Decoder::new(Cursor::new(small))
            .and_then(|decoder| decoder.with_limits(limits).read_image_bytes(&mut bytes))
            .map_err(|error| {
                // Messages of decoders may have several lines.
                let why = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
                source.error(place, format!("{name} is damaged: {why}"))
            })?;
        Ok(bytes)
    }

    /// Writes a TIFF file of one strip, for the decoder.
    fn small(&self, endian: Endian, rows: u64, packed: &[u8], tables: &[u8]) -> Vec<u8> {
        let samples = if self.planar { 1 } else { self.samples };
        let count = if tables.is_empty() { 11 } else { 12 };
        let behind = 8 + 2 + 12 * count + 4;
        // Tag, type, number of values, value or offset. Type 4 is a number, 7 are bytes.
        let entries = [
            (256, 4, 1, u64::from(self.chunk[0])),
            (257, 4, 1, rows),
            (258, 4, 1, u64::from(self.bits)),
            (259, 4, 1, u64::from(self.compression.to_u16())),
            (262, 4, 1, 1),
            (273, 4, 1, wide(behind + tables.len())),
            (277, 4, 1, wide(samples)),
            (278, 4, 1, rows),
            (279, 4, 1, wide(packed.len())),
            (317, 4, 1, self.predictor),
            (339, 4, 1, self.format),
            (347, 7, wide(tables.len()), wide(behind)),
        ];
        let mut bytes = Vec::with_capacity(behind + tables.len() + packed.len());
        let put = |bytes: &mut Vec<u8>, value: u64, size: usize| match endian {
            Endian::Little => bytes.extend_from_slice(&value.to_le_bytes()[..size]),
            Endian::Big => bytes.extend_from_slice(&value.to_be_bytes()[8 - size..]),
        };
        bytes.extend_from_slice(if endian == Endian::Little { b"II" } else { b"MM" });
        for (value, size) in [(42, 2), (8, 4), (wide(count), 2)] {
            put(&mut bytes, value, size);
        }
        for (tag, kind, count, value) in entries.into_iter().take(count) {
            for (number, size) in [(tag, 2), (kind, 2), (count, 4), (value, 4)] {
                put(&mut bytes, number, size);
            }
        }
        put(&mut bytes, 0, 4);
        bytes.extend_from_slice(tables);
        bytes.extend_from_slice(packed);
        bytes
    }
}

/// Expands samples of less than 8 bits to bytes; the first is in the highest bits.
fn unpack(row: &[u8], bits: u16, count: usize, unpacked: &mut Vec<u8>) {
    let bits = usize::from(bits);
    let mask = 0xff_u8 >> (8 - bits);
    unpacked.clear();
    unpacked.extend(
        row.iter()
            .flat_map(|byte| (0..8 / bits).map(move |i| (byte >> (8 - bits * (i + 1))) & mask))
            .take(count),
    );
}

/// Converts 16-bit floats to 32-bit ones in native byte order.
fn widened(bytes: &[u8], endian: Endian) -> Vec<u8> {
    let one = |pair: &[u8; 2]| from_half(u16::from_le_bytes(endian.to_little(*pair))).to_ne_bytes();
    bytes.as_chunks::<2>().0.iter().flat_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_become_bytes() {
        let mut bytes = Vec::new();
        unpack(&[0b1010_0001, 0b1000_0000], 1, 9, &mut bytes);
        assert_eq!(bytes, [1, 0, 1, 0, 0, 0, 0, 1, 1]);
        unpack(&[0b1101_0010], 2, 3, &mut bytes);
        assert_eq!(bytes, [3, 1, 0]);
        unpack(&[0x5a, 0xf0], 4, 3, &mut bytes);
        assert_eq!(bytes, [5, 10, 15]);
    }

    #[test]
    fn halves_become_floats() {
        let halves = [0x3c00_u16, 0xc000, 0x0001, 0x7bff, 0x7c00, 0xfc00, 0x8000];
        let wanted = [1.0, -2.0, 5.960_464_5e-8, 65504.0, f32::INFINITY, f32::NEG_INFINITY, -0.0];
        for (endian, order) in
            [(Endian::Little, u16::to_le_bytes as fn(u16) -> [u8; 2]), (Endian::Big, u16::to_be_bytes)]
        {
            let bytes: Vec<u8> = halves.iter().flat_map(|&half| order(half)).collect();
            let floats: Vec<f32> =
                widened(&bytes, endian).as_chunks::<4>().0.iter().map(|b| f32::from_ne_bytes(*b)).collect();
            assert_eq!(floats, wanted);
        }
        let nan = widened(&0x7e00_u16.to_le_bytes(), Endian::Little);
        assert!(f32::from_ne_bytes(nan.try_into().unwrap()).is_nan());
    }
}
