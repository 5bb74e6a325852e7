//! Directories: tags and their values, with every size and offset checked.

use crate::error::Result;
use crate::io::file::decode::MAX_COMPONENTS;
use crate::io::file::sample_type::Endian;
use crate::io::file::source::Source;
use crate::num::{self, wide};

/// Whether the file begins with the magic of TIFF or BigTIFF.
pub(crate) fn is_tiff(source: &Source) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| source.head().starts_with(*magic))
}

/// Converts a count to a length; one beyond memory becomes the largest length.
pub(crate) fn index(value: u64) -> usize {
    usize::try_from(value).unwrap_or(usize::MAX)
}

/// The limit on entries of a directory.
const MAX_ENTRIES: u64 = 4096;

/// The tag of Zeiss microscopes (CZ_LSMINFO), in the first directory.
pub(crate) const LSM: u16 = 34412;

/// A TIFF file, with counts of the bytes read.
pub(crate) struct File<'a> {
    pub(crate) source: &'a Source,
    pub(crate) endian: Endian,
    pub(crate) big: bool,
    /// Bytes of directories and their values, counted each time they are read.
    pub(crate) headers: u64,
    /// Bytes read of strips and tiles.
    pub(crate) data: u64,
}

/// An entry of a directory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(crate) tag: u16,
    pub(crate) kind: u16,
    pub(crate) count: u64,
    /// The offset of its values.
    pub(crate) at: u64,
}

impl Entry {
    /// Returns the size of one value, in bytes; 0 for an unknown type.
    pub(crate) fn size(&self) -> u64 {
        match self.kind {
            1 | 2 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16 | 17 | 18 => 8,
            _ => 0,
        }
    }
}

impl<'a> File<'a> {
    /// Reads the header; also returns the offset of the first directory.
    pub(crate) fn open(source: &'a Source) -> Result<(Self, u64)> {
        let head = source.head();
        let endian = if head.starts_with(b"II") { Endian::Little } else { Endian::Big };
        let mut file = Self { source, endian, big: false, headers: 0, data: 0 };
        if !is_tiff(source) {
            return Err(source.error("byte 0", "must be II or MM and 42 or 43: not a TIFF file"));
        }
        file.big = head.get(2..4).is_some_and(|version| version.contains(&b'+'));
        let header = source.bytes(0, if file.big { 16 } else { 8 })?;
        if file.big {
            if file.whole(&header[4..6]) != 8 || file.whole(&header[6..8]) != 0 {
                return Err(source.error("byte 4", "BigTIFF: offsets must have 8 bytes"));
            }
            let first = file.whole(&header[8..16]);
            return Ok((file, first));
        }
        let first = file.whole(&header[4..8]);
        Ok((file, first))
    }

    /// Decodes an unsigned whole number of at most 8 bytes.
    pub(crate) fn whole(&self, bytes: &[u8]) -> u64 {
        self.endian.whole(bytes)
    }

    /// Reads a range of a directory or of its values. All ranges together are limited to a few times the file size,
    /// because pages may share values.
    pub(crate) fn piece(&mut self, place: &str, offset: u64, len: u64) -> Result<Vec<u8>> {
        self.headers = self.headers.saturating_add(len);
        if self.headers > self.source.len().saturating_mul(8).saturating_add(1 << 16) {
            return Err(self.source.error(place, "directories overlap"));
        }
        if offset.checked_add(len).is_none_or(|end| end > self.source.len()) {
            let rule = format!("{len} bytes at byte {offset}: the file has {}", self.source.len());
            return Err(self.source.error(place, rule));
        }
        self.source.bytes(offset, len)
    }

    /// Reads the entries of a directory; also returns the offset of the next one.
    pub(crate) fn directory(&mut self, number: usize, offset: u64) -> Result<(Vec<Entry>, u64)> {
        let place = format!("page {number}: directory");
        let (head, size, word) = if self.big { (8, 20, 8) } else { (2, 12, 4) };
        let count = self.piece(&place, offset, head)?;
        let count = self.whole(&count);
        if count == 0 || count > MAX_ENTRIES {
            return Err(self
                .source
                .error(&place, format!("{count} entries at byte {offset}: must be 1 to {MAX_ENTRIES}")));
        }
        let begin = offset.saturating_add(head);
        let bytes = self.piece(&place, begin, count * size + word)?;
        let (table, next) = bytes.split_at(index(count * size));
        let mut entries = Vec::new();
        for (i, bytes) in (0..).zip(table.chunks_exact(index(size))) {
            let tag = u16::try_from(self.whole(&bytes[..2])).unwrap_or(0);
            // Only tags that are used are kept.
            if !WANTED.contains(&tag) {
                continue;
            }
            let kind = u16::try_from(self.whole(&bytes[2..4])).unwrap_or(0);
            let split = bytes.len() - index(word);
            let count = self.whole(&bytes[4..split]);
            let mut entry = Entry { tag, kind, count, at: self.whole(&bytes[split..]) };
            let len = entry.size().checked_mul(count).filter(|_| entry.size() > 0);
            let Some(len) = len else {
                return Err(self
                    .source
                    .error(place_of(number, tag), format!("{count} values of type {kind}: no such type")));
            };
            if len <= word {
                entry.at = begin + i * size + size - word;
            }
            entries.push(entry);
        }
        Ok((entries, self.whole(next)))
    }

    /// Reads the whole numbers of an entry, at most `most`.
    pub(crate) fn numbers(&mut self, number: usize, entry: &Entry, most: u64) -> Result<Vec<u64>> {
        let place = place_of(number, entry.tag);
        if !matches!(entry.kind, 1 | 3 | 4 | 13 | 16 | 18) {
            return Err(self.source.error(place, format!("type {}: must be whole numbers", entry.kind)));
        }
        if entry.count > most {
            return Err(self.source.error(place, format!("{} values: at most {most}", entry.count)));
        }
        let bytes = self.piece(&place, entry.at, entry.count * entry.size())?;
        Ok(bytes.chunks_exact(index(entry.size())).map(|bytes| self.whole(bytes)).collect())
    }

    /// Reads the first whole number of a tag, or returns `default` if it is missing.
    pub(crate) fn number(&mut self, number: usize, entries: &[Entry], tag: u16, default: u64) -> Result<u64> {
        match find(entries, tag) {
            None => Ok(default),
            Some(entry) => {
                let one = Entry { count: entry.count.min(1), ..entry };
                let first = self.numbers(number, &one, 1)?.first().copied();
                first.ok_or_else(|| self.source.error(place_of(number, tag), "has no value"))
            }
        }
    }

    /// Reads a number that must be the same for all samples of a pixel.
    pub(crate) fn uniform(
        &mut self,
        number: usize,
        entries: &[Entry],
        tag: u16,
        default: u64,
    ) -> Result<u64> {
        let Some(entry) = find(entries, tag) else { return Ok(default) };
        let all = self.numbers(number, &entry, wide(MAX_COMPONENTS))?;
        match all.first() {
            Some(&first) if all.iter().all(|&other| other == first) => Ok(first),
            _ => Err(self
                .source
                .error(place_of(number, tag), format!("{all:?}: must be the same for all samples"))),
        }
    }

    /// Reads a positive fraction, if there is one.
    pub(crate) fn fraction(&mut self, number: usize, entries: &[Entry], tag: u16) -> Result<Option<f64>> {
        let Some(entry) = find(entries, tag).filter(|entry| entry.kind == 5 && entry.count == 1) else {
            return Ok(None);
        };
        let bytes = self.piece(&place_of(number, tag), entry.at, 8)?;
        let (above, below) = (self.whole(&bytes[..4]), self.whole(&bytes[4..]));
        let value = num::f64_of_u64(above) / num::f64_of_u64(below);
        Ok(Some(value).filter(|value| *value > 0.0 && value.is_finite()))
    }

    /// Counts bytes of strips or tiles, and checks that they are in the file. Together they may not exceed the file
    /// size, so that none is decoded many times.
    pub(crate) fn spend(&mut self, place: &str, offset: u64, len: u64) -> Result<()> {
        let all = self.source.len();
        self.data = self.data.saturating_add(len);
        if self.data > all {
            return Err(self.source.error(place, "strips or tiles overlap"));
        }
        if offset.checked_add(len).is_none_or(|end| end > all) {
            let rule = format!("{len} bytes at byte {offset}: the file has {all}");
            return Err(self.source.error(place, rule));
        }
        Ok(())
    }
}

/// Tags that are read.
const WANTED: [u16; 29] = [
    254, 255, 256, 257, 258, 259, 262, 266, 270, 273, 274, 277, 278, 279, 282, 283, 284, 296, 317, 322, 323,
    324, 325, 338, 339, 347, 32997, 32998, LSM,
];

pub(crate) fn place_of(number: usize, tag: u16) -> String {
    let name = match tag {
        254 => "NewSubfileType",
        255 => "SubfileType",
        256 => "ImageWidth",
        257 => "ImageLength",
        258 => "BitsPerSample",
        259 => "Compression",
        262 => "PhotometricInterpretation",
        266 => "FillOrder",
        270 => "ImageDescription",
        273 => "StripOffsets",
        274 => "Orientation",
        277 => "SamplesPerPixel",
        278 => "RowsPerStrip",
        279 => "StripByteCounts",
        282 => "XResolution",
        283 => "YResolution",
        284 => "PlanarConfiguration",
        296 => "ResolutionUnit",
        317 => "Predictor",
        322 => "TileWidth",
        323 => "TileLength",
        324 => "TileOffsets",
        325 => "TileByteCounts",
        338 => "ExtraSamples",
        339 => "SampleFormat",
        347 => "JPEGTables",
        32997 => "ImageDepth",
        32998 => "TileDepth",
        LSM => "CZ_LSMINFO",
        _ => "tag",
    };
    format!("page {number}: {name}")
}

pub(crate) fn find(entries: &[Entry], tag: u16) -> Option<Entry> {
    entries.iter().find(|entry| entry.tag == tag).copied()
}
