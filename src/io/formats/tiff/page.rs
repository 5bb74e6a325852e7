//! One image of a file: its properties, and the sizes that follow from them.

use tiff::tags::CompressionMethod;

use crate::error::Result;
use crate::io::file::sample_type::SampleType;
use crate::io::file::source::{Encoding, Source};
use crate::io::formats::tiff::file::{Entry, File, place_of};
use crate::num::wide;

/// One image of a file, as its directory describes it.
#[derive(Clone, Debug)]
pub(crate) struct Page {
    pub(crate) number: usize,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) bits: u16,
    pub(crate) kind: SampleType,
    /// The code of the sample format: 1 unsigned, 2 signed, 3 floats.
    pub(crate) format: u64,
    pub(crate) samples: usize,
    pub(crate) extra: Vec<u64>,
    pub(crate) photometric: u64,
    pub(crate) planar: bool,
    pub(crate) compression: CompressionMethod,
    pub(crate) predictor: u64,
    /// Width and height of a strip or tile, in pixels.
    pub(crate) chunk: [u32; 2],
    pub(crate) tiles: bool,
    pub(crate) offsets: Entry,
    pub(crate) counts: Option<Entry>,
    pub(crate) tables: Option<Entry>,
}

/// Returns the name of a compression; None if it is not supported.
pub(crate) fn name(compression: CompressionMethod) -> Option<&'static str> {
    Some(match compression {
        CompressionMethod::None => "uncompressed",
        CompressionMethod::Fax4 => "CCITT Group 4",
        CompressionMethod::LZW => "LZW",
        CompressionMethod::ModernJPEG => "JPEG",
        CompressionMethod::Deflate | CompressionMethod::OldDeflate => "Deflate",
        CompressionMethod::PackBits => "PackBits",
        _ => return None,
    })
}

impl Page {
    /// Returns the parts of a pixel: name, first sample, number of samples.
    pub(crate) fn parts(&self) -> Vec<(&'static str, usize, usize)> {
        // 1 and 2 are codes of opacity.
        let opacity = |extra: &[u64]| extra.len() == 1 && matches!(extra[0], 1 | 2);
        match (self.photometric, self.samples) {
            (3, 1) => vec![("palette", 0, 1)],
            (2, 3) => vec![("colour", 0, 3)],
            (2, 4) if opacity(&self.extra) => vec![("colour", 0, 3), ("opacity", 3, 1)],
            (2, n) => vec![("colour", 0, 3), ("extra", 3, n - 3)],
            (_, 1) => vec![("grey", 0, 1)],
            (_, 2) if opacity(&self.extra) => vec![("grey", 0, 1), ("opacity", 1, 1)],
            (_, n) => vec![("samples", 0, n)],
        }
    }

    /// Adds notes on the meaning of the values.
    pub(crate) fn describe(&self, notes: &mut Vec<String>) {
        match self.photometric {
            0 => notes.push("the smallest value is white; values are kept as they are stored".to_owned()),
            3 => notes.push("palette: the values are its indices, no colours".to_owned()),
            _ => {}
        }
        if self.bits < 8 {
            notes.push(format!("samples of {} bits are kept as 8", self.bits));
        }
        if self.is_half() {
            notes.push("16-bit floats are kept as 32-bit ones".to_owned());
        }
        if self.compression == CompressionMethod::ModernJPEG {
            notes.push("JPEG: values are those of a lossy compression".to_owned());
        }
    }

    fn text(&self) -> String {
        let Self { width, height, samples, bits, .. } = self;
        format!("{width} x {height} pixels of {samples} x {} ({bits} bits)", self.kind.name())
    }

    /// Checks that another page has the same size and type as this one.
    pub(crate) fn check(&self, source: &Source, other: &Self) -> Result<()> {
        let of =
            |page: &Self| (page.width, page.height, page.samples, page.kind, page.bits, page.photometric);
        if of(self) == of(other) && self.extra == other.extra {
            return Ok(());
        }
        let photometric = if self.photometric == other.photometric {
            String::new()
        } else {
            format!(", PhotometricInterpretation {} instead of {}", other.photometric, self.photometric)
        };
        let rule = format!("{}{photometric}: all slices must be as the first, {}", other.text(), self.text());
        Err(source.error(format!("page {}", other.number), rule))
    }

    /// Whether samples are 16-bit floats, which become 32-bit ones.
    pub(crate) fn is_half(&self) -> bool {
        self.kind == SampleType::F32 && self.bits == 16
    }

    /// Returns the size of a row of `pixels` in a strip or tile, in bytes.
    pub(crate) fn row(&self, pixels: u32) -> u64 {
        let samples = if self.planar { 1 } else { self.samples };
        u64::from(pixels).saturating_mul(wide(samples)).saturating_mul(u64::from(self.bits)).div_ceil(8)
    }

    /// Returns the decompressed size of the page, in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.row(self.width).saturating_mul(u64::from(self.height))
    }

    /// Returns the largest ratio of decompressed to compressed bytes of a strip or tile.
    pub(crate) fn ratio(&self) -> u64 {
        match self.compression {
            // One bit may encode a row.
            CompressionMethod::Fax4 => u64::from(self.width.max(self.chunk[0])),
            // A code of at least 9 bits encodes at most one byte more than the number of codes.
            CompressionMethod::LZW => 4096,
            // One bit may encode a block of 64 samples.
            CompressionMethod::ModernJPEG => 1024,
            CompressionMethod::Deflate | CompressionMethod::OldDeflate => Encoding::Zlib.most(1),
            // Two bytes encode up to 128.
            CompressionMethod::PackBits => 64,
            _ => 1,
        }
    }

    /// Returns an upper bound of the samples in memory, in bytes, that one byte of the file encodes.
    pub(crate) fn most(&self) -> u64 {
        let wider = if self.is_half() { 2 } else { 8 / u64::from(self.bits.clamp(1, 8)) };
        self.ratio().saturating_mul(wider)
    }

    /// Whether samples need no decompression, rearrangement or conversion.
    pub(crate) fn is_plain(&self) -> bool {
        !self.tiles
            && !self.planar
            && self.compression == CompressionMethod::None
            && self.bits >= 8
            && !self.is_half()
    }

    /// Returns the memory that decoding takes in addition to the result, in bytes.
    pub(crate) fn scratch(&self) -> u64 {
        let samples =
            u64::from(self.width).saturating_mul(u64::from(self.height)).saturating_mul(wide(self.samples));
        let own = if self.is_half() { 6 } else { u64::from(self.bits).div_ceil(8) };
        let page = samples.saturating_mul(own);
        let chunk = self.row(self.chunk[0]).saturating_mul(u64::from(self.chunk[1]));
        let unpacked =
            chunk.saturating_mul(if self.compression == CompressionMethod::ModernJPEG { 8 } else { 1 });
        let decoding = match self.compression {
            CompressionMethod::None if self.is_plain() && self.parts().len() == 1 => 0,
            CompressionMethod::None => page.saturating_add(chunk),
            _ => page.saturating_add(unpacked).saturating_add(most_packed(chunk).saturating_mul(2)),
        };
        // The lists of strips or tiles count too, except short ones.
        let lists = self.chunk_count().saturating_mul(48).saturating_sub(1 << 16);
        decoding.saturating_add(lists)
    }

    /// Returns the numbers of strips or tiles along x and y.
    pub(crate) fn grid(&self) -> [u64; 2] {
        [self.width.div_ceil(self.chunk[0]), self.height.div_ceil(self.chunk[1])].map(u64::from)
    }

    /// Returns the number of strips or tiles of all planes.
    fn chunk_count(&self) -> u64 {
        let [across, down] = self.grid();
        let planes = if self.planar { wide(self.samples) } else { 1 };
        across.saturating_mul(down).saturating_mul(planes)
    }

    /// Reads the offsets and sizes of strips or tiles.
    pub(crate) fn chunks(&self, file: &File) -> Result<Vec<(u64, u64)>> {
        let count = self.chunk_count();
        let list = |entry: Entry| {
            let list = file.numbers(self.number, &entry, count)?;
            if wide(list.len()) != count {
                let rule = format!("{}: {count} strips or tiles are needed", list.len());
                return Err(file.source.error(place_of(self.number, entry.tag), rule));
            }
            Ok(list)
        };
        let offsets = list(self.offsets)?;
        let counts = match self.counts {
            Some(entry) => list(entry)?,
            // Old writers omit the sizes, which follow from the rows.
            None => (0..count).map(|chunk| self.chunk_bytes(chunk)).collect(),
        };
        Ok(offsets.into_iter().zip(counts).collect())
    }

    /// Returns the decompressed size of a strip or tile, in bytes.
    pub(crate) fn chunk_bytes(&self, chunk: u64) -> u64 {
        self.row(self.chunk[0]).saturating_mul(self.rows(chunk))
    }

    /// Returns the rows of a strip or tile: tiles are complete, the last strip has those that are left.
    pub(crate) fn rows(&self, chunk: u64) -> u64 {
        if self.tiles { u64::from(self.chunk[1]) } else { self.visible_rows(chunk) }
    }

    /// Returns the rows of a strip or tile that lie in the image.
    pub(crate) fn visible_rows(&self, chunk: u64) -> u64 {
        let [across, down] = self.grid();
        let above = (chunk / across % down).saturating_mul(u64::from(self.chunk[1]));
        u64::from(self.height).saturating_sub(above).min(u64::from(self.chunk[1]))
    }
}

/// Returns the limit on the compressed size of a strip or tile: no compression doubles the size.
pub(crate) fn most_packed(unpacked: u64) -> u64 {
    unpacked.saturating_mul(2).saturating_add(1 << 16)
}
