//! Directories: tags and their values, with every size and place checked.

use super::calibration::{self, Calibration, Resolution};
use super::page::{Compression, Page};
use super::{index, is};
use crate::error::Result;
use crate::io::samples::{Endian, MAX_COMPONENTS, SampleType};
use crate::io::source::Source;
use crate::num::{self, wide};

/// Most entries of a directory.
const MAX_ENTRIES: u64 = 4096;

/// Most bytes of a description that are looked at.
const MAX_DESCRIPTION: u64 = 4 << 20;

/// The tag of Zeiss microscopes, in the first directory.
const LSM: u16 = 34412;

/// A file as numbers, and how much of it was gone through.
pub(super) struct File<'a> {
    pub(super) source: &'a Source,
    pub(super) endian: Endian,
    pub(super) big: bool,
    /// Bytes of directories and their values, as often as they were read.
    pub(super) headers: u64,
    /// Bytes of strips and tiles.
    pub(super) data: u64,
}

/// An entry of a directory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) tag: u16,
    pub(super) kind: u16,
    pub(super) count: u64,
    /// Where its values are.
    pub(super) at: u64,
}

impl Entry {
    /// Bytes of one value; 0 for a type that is not known.
    pub(super) fn size(&self) -> u64 {
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
    /// The header, and where the first directory is.
    pub(super) fn open(source: &'a Source) -> Result<(Self, u64)> {
        let head = source.head();
        let endian = if head.starts_with(b"II") { Endian::Little } else { Endian::Big };
        let mut file = Self { source, endian, big: false, headers: 0, data: 0 };
        if !is(source) {
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

    /// Bytes of a whole number, at most 8.
    pub(super) fn whole(&self, bytes: &[u8]) -> u64 {
        self.endian.whole(bytes)
    }

    /// A piece of a header. All pieces are no more than the file, give or take what pages share.
    pub(super) fn piece(&mut self, place: &str, offset: u64, len: u64) -> Result<Vec<u8>> {
        self.headers = self.headers.saturating_add(len);
        if self.headers > self.source.len().saturating_mul(8).saturating_add(1 << 16) {
            return Err(self.source.error(place, "directories lie over each other"));
        }
        if offset.checked_add(len).is_none_or(|end| end > self.source.len()) {
            let rule = format!("{len} bytes at byte {offset}: the file has {}", self.source.len());
            return Err(self.source.error(place, rule));
        }
        self.source.bytes(offset, len)
    }

    /// The entries of a directory, and where the next one is.
    pub(super) fn directory(&mut self, number: usize, offset: u64) -> Result<(Vec<Entry>, u64)> {
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
            // What is not asked for is not kept.
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

    /// Whole numbers of an entry. `most` bounds how many.
    pub(super) fn numbers(&mut self, number: usize, entry: &Entry, most: u64) -> Result<Vec<u64>> {
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

    /// The first whole number of a tag.
    pub(super) fn number(&mut self, number: usize, entries: &[Entry], tag: u16, default: u64) -> Result<u64> {
        match find(entries, tag) {
            None => Ok(default),
            Some(entry) => {
                let one = Entry { count: entry.count.min(1), ..entry };
                let first = self.numbers(number, &one, 1)?.first().copied();
                first.ok_or_else(|| self.source.error(place_of(number, tag), "has no value"))
            }
        }
    }

    /// A number that is the same for all samples of a pixel.
    pub(super) fn uniform(
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

    /// A fraction, where there is one.
    pub(super) fn fraction(&mut self, number: usize, entries: &[Entry], tag: u16) -> Result<Option<f64>> {
        let Some(entry) = find(entries, tag).filter(|entry| entry.kind == 5 && entry.count == 1) else {
            return Ok(None);
        };
        let bytes = self.piece(&place_of(number, tag), entry.at, 8)?;
        let (above, below) = (self.whole(&bytes[..4]), self.whole(&bytes[4..]));
        let value = num::f64_of_u64(above) / num::f64_of_u64(below);
        Ok(Some(value).filter(|value| *value > 0.0 && value.is_finite()))
    }

    pub(super) fn page(&mut self, number: usize, offset: u64) -> Result<Page> {
        let (entries, _) = self.directory(number, offset)?;
        self.page_of(number, &entries)
    }

    pub(super) fn page_of(&mut self, number: usize, entries: &[Entry]) -> Result<Page> {
        let source = self.source;
        let error = |tag, rule: String| source.error(place_of(number, tag), rule);
        let extent = |value: u64, tag| {
            let extent = u32::try_from(value).ok().filter(|&extent| extent > 0);
            extent.ok_or_else(|| error(tag, format!("{value}: must be 1 to {}", u32::MAX)))
        };
        let width = extent(self.number(number, entries, 256, 0)?, 256)?;
        let height = extent(self.number(number, entries, 257, 0)?, 257)?;
        for tag in [32997, 32998] {
            let depth = self.number(number, entries, tag, 1)?;
            if depth > 1 {
                let rule =
                    format!("{depth}: volumes within a page are not supported, one page for each slice is");
                return Err(error(tag, rule));
            }
        }
        let samples = self.number(number, entries, 277, 1)?;
        let samples = usize::try_from(samples)
            .ok()
            .filter(|samples| (1..=MAX_COMPONENTS).contains(samples))
            .ok_or_else(|| error(277, format!("{samples}: must be 1 to {MAX_COMPONENTS}")))?;
        let extra = match find(entries, 338) {
            Some(entry) => self.numbers(number, &entry, wide(samples))?,
            None => Vec::new(),
        };

        let bits = self.uniform(number, entries, 258, 1)?;
        let format = self.uniform(number, entries, 339, 1)?;
        let kind = match (format, bits) {
            (1 | 4, 1 | 2 | 4 | 8) => SampleType::U8,
            (1 | 4, 16) => SampleType::U16,
            (1 | 4, 32) => SampleType::U32,
            (1 | 4, 64) => SampleType::U64,
            (2, 8) => SampleType::I8,
            (2, 16) => SampleType::I16,
            (2, 32) => SampleType::I32,
            (2, 64) => SampleType::I64,
            (3, 16 | 32) => SampleType::F32,
            (3, 64) => SampleType::F64,
            _ => {
                return Err(error(
                    258,
                    format!(
                        "{bits} bits of sample format {format}: whole numbers of 1, 2, 4, 8, 16, 32 and 64 bits and \
                         floats of 16, 32 and 64 bits are supported"
                    ),
                ));
            }
        };
        let photometric = self.number(number, entries, 262, 1)?;
        let name = match photometric {
            0..=4 => "",
            5 => " (CMYK)",
            6 => " (YCbCr)",
            8..=10 => " (Lab)",
            32803 => " (colour filter array)",
            _ => " (of no known meaning)",
        };
        if photometric > 4 {
            return Err(error(
                262,
                format!("{photometric}{name}: grey, RGB and palette images are supported"),
            ));
        }
        if photometric == 2 && samples < 3 {
            return Err(error(277, format!("{samples}: RGB has at least 3")));
        }
        let planar = match self.number(number, entries, 284, 1)? {
            1 => false,
            2 => samples > 1,
            other => return Err(error(284, format!("{other}: must be 1 or 2"))),
        };
        let order = self.number(number, entries, 266, 1)?;
        if order != 1 {
            return Err(error(266, format!("{order}: only 1, the highest bit first, is supported")));
        }
        let code = self.number(number, entries, 259, 1)?;
        let Some(&(_, compression)) = Compression::ALL.iter().find(|(known, _)| *known == code) else {
            let rule = "uncompressed, LZW, Deflate, PackBits, JPEG and CCITT Group 4 are supported";
            return Err(error(259, format!("{code}{}: {rule}", Compression::other(code))));
        };
        match compression {
            Compression::Fax4 if bits != 1 || samples != 1 => {
                return Err(error(258, format!("{bits} x {samples}: CCITT Group 4 has one bit for a pixel")));
            }
            Compression::Jpeg if bits != 8 || !(planar || matches!(samples, 1 | 3 | 4)) => {
                return Err(error(
                    258,
                    format!("{bits} x {samples}: JPEG of 1, 3 or 4 samples of 8 bits is supported"),
                ));
            }
            _ => {}
        }
        let predictor = self.number(number, entries, 317, 1)?;
        let fits = match predictor {
            1 => true,
            2 | 3 if !matches!(compression, Compression::Lzw | Compression::Deflate) => false,
            2 => bits >= 8,
            3 => format == 3,
            _ => false,
        };
        if !fits {
            let packed = format!("{} samples of {bits} bits and format {format}", compression.name());
            return Err(error(317, format!("{predictor}: not known with {packed}")));
        }

        let tiles = find(entries, 324).is_some();
        let chunk = if tiles {
            [self.number(number, entries, 322, 0)?, self.number(number, entries, 323, 0)?]
        } else {
            [u64::from(width), self.number(number, entries, 278, u64::from(height))?.min(u64::from(height))]
        };
        let (across, down) = if tiles { (322, 323) } else { (256, 278) };
        let chunk = [extent(chunk[0], across)?, extent(chunk[1], down)?];
        let (offsets, counts) = if tiles { (324, 325) } else { (273, 279) };
        let page = Page {
            number,
            width,
            height,
            bits: u16::try_from(bits).unwrap_or(0),
            kind,
            half: format == 3 && bits == 16,
            samples,
            extra,
            photometric,
            planar,
            compression,
            predictor,
            chunk,
            tiles,
            offsets: find(entries, offsets).ok_or_else(|| error(offsets, "missing".to_owned()))?,
            counts: find(entries, counts),
            tables: find(entries, 347).filter(|_| compression == Compression::Jpeg),
        };
        if page.counts.is_none() && compression != Compression::None {
            return Err(error(counts, "missing".to_owned()));
        }
        Ok(page)
    }

    /// What the first page says of all.
    pub(super) fn calibration(&mut self, page: &Page, entries: &[Entry]) -> Result<Calibration> {
        let description = match find(entries, 270).filter(|entry| entry.size() == 1) {
            Some(entry) => {
                let len = entry.count.min(MAX_DESCRIPTION);
                self.piece(&place_of(page.number, 270), entry.at, len)?
            }
            None => Vec::new(),
        };
        let end = description.iter().position(|&byte| byte == 0).unwrap_or(description.len());
        let description = String::from_utf8_lossy(&description[..end]);
        let pixels = [self.fraction(page.number, entries, 282)?, self.fraction(page.number, entries, 283)?];
        let unit = self.number(page.number, entries, 296, 2)?;
        let bits = matches!(page.kind, SampleType::U8 | SampleType::U16).then_some(page.bits);
        let integer_bits = bits.filter(|_| page.samples == 1);
        let resolution = Resolution { pixels, unit };
        let mut calibration = calibration::calibration(&description, resolution, integer_bits);

        if let Some(entry) = find(entries, LSM) {
            self.microscope(page, &entry, &mut calibration)?;
        }
        let orientation = self.number(page.number, entries, 274, 1)?;
        if orientation != 1 {
            calibration.warnings.push(format!(
                "Orientation {orientation} is not applied: rows and columns lie as they are stored"
            ));
        }
        Ok(calibration)
    }

    /// The beginning of a microscope's own tag.
    fn microscope(&mut self, page: &Page, entry: &Entry, calibration: &mut Calibration) -> Result<()> {
        /// Bytes that are looked at.
        const LEN: u64 = 64;
        let bytes = if entry.size() == 1 && entry.count >= LEN {
            self.piece(&place_of(page.number, LSM), entry.at, LEN)?
        } else {
            vec![0; index(LEN)]
        };
        let [magic, width, height, slices, frames] =
            [0, 8, 12, 16, 24].map(|at| self.whole(&bytes[at..at + 4]));
        // Counts are signed.
        let counts = [slices, frames].iter().all(|count| (1..=0x7fff_ffff).contains(count));
        let same = (width, height) == (u64::from(page.width), u64::from(page.height));
        let why = match magic {
            0x0030_494c | 0x0040_494c if counts && same => {
                let sizes = [40, 48, 56].map(|at| f64::from_bits(self.whole(&bytes[at..at + 8])));
                calibration.microscope(sizes, slices, frames);
                return Ok(());
            }
            0x0030_494c | 0x0040_494c if counts => {
                format!("{width} x {height} pixels, the page has {} x {}", page.width, page.height)
            }
            0x0030_494c | 0x0040_494c => format!("{slices} slices, {frames} points in time"),
            _ => "is none that is known".to_owned(),
        };
        calibration.warnings.push(format!(
            "CZ_LSMINFO: {why}: the size of a voxel was not read, and time steps may be stacked as slices"
        ));
        Ok(())
    }

    /// Counts bytes of strips or tiles, and checks that they are there. Together they are no more than the
    /// file has, so that none is gone through again and again.
    pub(super) fn spend(&mut self, place: &str, offset: u64, len: u64) -> Result<()> {
        let all = self.source.len();
        self.data = self.data.saturating_add(len);
        if self.data > all {
            return Err(self.source.error(place, "strips or tiles lie over each other"));
        }
        if offset.checked_add(len).is_none_or(|end| end > all) {
            let rule = format!("{len} bytes at byte {offset}: the file has {all}");
            return Err(self.source.error(place, rule));
        }
        Ok(())
    }
}

/// Tags that are looked at.
const WANTED: [u16; 29] = [
    254, 255, 256, 257, 258, 259, 262, 266, 270, 273, 274, 277, 278, 279, 282, 283, 284, 296, 317, 322, 323,
    324, 325, 338, 339, 347, 32997, 32998, LSM,
];

pub(super) fn place_of(number: usize, tag: u16) -> String {
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

pub(super) fn find(entries: &[Entry], tag: u16) -> Option<Entry> {
    entries.iter().find(|entry| entry.tag == tag).copied()
}
