//! TIFF: a stack of pages, one for each slice.
//!
//! Directories are read here, with every size and place checked; strips and tiles that are compressed are
//! handed to the `tiff` crate one at a time, each as a small file of its own, so that it takes no more
//! memory than one of them needs and interprets nothing but the compression and its predictor.
//!
//! Values are kept as they are stored: indices of palettes, and greys whose smallest one is white. What
//! ImageJ and OME-XML say of channels, frames and the size of a voxel is honoured.

mod calibration;

use std::collections::HashSet;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

use ::tiff::decoder::{Decoder, Limits};
use glam::DMat3;

use super::arrays::{self, ArrayInfo, Association, Choice, Pick};
use super::jpeg;
use super::samples::{self, Endian, Layout, MAX_COMPONENTS, SampleType};
use super::source::{Budget, Encoding, Source};
use super::{Loaded, ReadOptions, Reader};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Grid, Samples};
use calibration::{Calibration, Resolution, Volume};

pub(super) struct Tiff;

/// Most pages.
const MAX_PAGES: usize = 1 << 16;

/// Most entries of a directory.
const MAX_ENTRIES: u64 = 4096;

/// Most bytes of a description that are looked at.
const MAX_DESCRIPTION: u64 = 4 << 20;

/// Most bytes of the tables that the strips of a page share.
const MAX_TABLES: u64 = 4096;

/// What a single page is refused with.
const ONE_PAGE: &str =
    "1 slice: a volume needs at least 2; where each slice is a file of its own, name their folder";

impl Reader for Tiff {
    fn name(&self) -> &'static str {
        "TIFF"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["tif", "tiff", "btf", "lsm"]
    }

    fn recognises(&self, source: &Source) -> bool {
        is(source)
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let mut stack = Stack::open(source)?;
        let images = stack.contiguous()?.unwrap_or(stack.pages.len());
        let volumes = stack.calibration.volumes(images);
        if volumes.first().is_none_or(|volume| volume.slices < 2) {
            return Err(source.error("pages", ONE_PAGE));
        }
        let Stack { mut file, shape, pages, ratio, scratch, calibration, notes } = stack;
        let look = Look::choose(source, &shape, &volumes, options)?;
        let volume = &volumes[look.volume];
        let layout = shape.layout(&look, volume.slices);
        let (count, in_file) = samples::data_size(source, "pages", &layout, options)?;
        let most = source.len().saturating_mul(ratio);
        if in_file > most {
            return Err(source.error(
                "pages",
                format!(
                    "needs {in_file} bytes for {} slices: {} bytes hold at most {most}",
                    volume.slices,
                    source.len()
                ),
            ));
        }
        let mut budget = Budget::new(source, options);
        budget.take("pages", wide(count).saturating_mul(stored_bytes(&layout)))?;
        budget.take("pages", scratch)?;
        let mut values = Samples::none(layout.kind, layout.pick);
        values
            .reserve(count)
            .map_err(|_| source.error("pages", format!("{count} samples: memory is full")))?;
        for slice in 0..volume.slices {
            let index = volume.first + slice * volume.stride;
            match pages.get(index) {
                Some(&(number, offset)) => {
                    let page = file.page(number, offset)?;
                    shape.check(source, &page)?;
                    page.decode(&mut file, &look, &layout, &mut values)?;
                }
                // The first directory stands for images that follow each other.
                None => shape.decode_after(&mut file, index, &look, &layout, &mut values)?,
            }
        }
        finish(source, self.name(), layout.dims, values, calibration, &look, notes)
    }
}

/// Whether the file is one.
pub(super) fn is(source: &Source) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| source.head().starts_with(*magic))
}

/// Reads one slice from each file, in this order. `folder` is theirs, for messages.
pub(super) fn read_series(folder: &Path, files: &[PathBuf], options: &ReadOptions) -> Result<Loaded> {
    let Some(path) = files.first() else {
        return Err(Error::file(folder, "files", "there is none"));
    };
    let source = &Source::open(path, options)?;
    let first = Stack::open(source)?;
    first.single()?;
    let volumes = [Volume { name: String::new(), first: 0, stride: 1, slices: files.len() }];
    let look = Look::choose(source, &first.shape, &volumes, options)?;
    let layout = first.shape.layout(&look, files.len());
    let (count, in_file) = samples::data_size(source, "slices", &layout, options)?;
    let (mut most, mut scratch) = (0_u64, 0);
    for path in files {
        let source = Source::open(path, options)?;
        let stack = Stack::open(&source)?;
        stack.single()?;
        first.shape.check(&source, &stack.shape)?;
        most = most.saturating_add(source.len().saturating_mul(stack.ratio));
        scratch = stack.scratch.max(scratch);
    }
    if in_file > most {
        return Err(source.error(
            "slices",
            format!("needs {in_file} bytes for {} slices: the files hold at most {most}", files.len()),
        ));
    }
    let mut budget = Budget::new(source, options);
    budget.take("slices", wide(count).saturating_mul(stored_bytes(&layout)))?;
    budget.take("slices", scratch)?;
    let mut values = Samples::none(layout.kind, layout.pick);
    values.reserve(count).map_err(|_| source.error("slices", format!("{count} samples: memory is full")))?;
    for path in files {
        let source = Source::open(path, options)?;
        let mut stack = Stack::open(&source)?;
        // The file may be another one by now.
        stack.single()?;
        first.shape.check(&source, &stack.shape)?;
        stack.shape.decode(&mut stack.file, &look, &layout, &mut values)?;
    }
    let Stack { calibration, notes, .. } = first;
    finish(source, "TIFF slices", layout.dims, values, calibration, &look, notes)
}

fn stored_bytes(layout: &Layout) -> u64 {
    if layout.pick == Pick::Magnitude { 4 } else { layout.kind.stored_bytes() }
}

fn finish(
    source: &Source,
    format: &'static str,
    dims: [u32; 3],
    values: Samples,
    calibration: Calibration,
    look: &Look,
    mut notes: Vec<String>,
) -> Result<Loaded> {
    let located = |error: Error| error.in_file(source.path());
    let mut grid = Grid::new(dims, values)
        .and_then(|grid| grid.with_placement(calibration.spacing, calibration.origin, DMat3::IDENTITY))
        .map_err(located)?;
    if let Some(rescale) = calibration.rescale
        && look.pick != Pick::Magnitude
    {
        grid = grid.with_rescale(rescale).map_err(located)?;
    }
    let mut loaded = Loaded::new(format, grid);
    notes.extend(calibration.notes);
    loaded.report.notes = notes;
    loaded.report.warnings = calibration.warnings;
    if look.volumes > 1 && !look.asked {
        let warning =
            format!("{} volumes, {} is shown: name another array to see it", look.volumes, look.shown);
        loaded.report.warnings.push(warning);
    }
    if look.arrays.len() > 1 || look.arrays.iter().any(|array| array.components > 1) {
        loaded.report.arrays.clone_from(&look.arrays);
        loaded.report.shown = Some(look.shown.clone());
    }
    Ok(loaded)
}

/// What of the pages is read.
#[derive(Debug)]
struct Look {
    arrays: Vec<ArrayInfo>,
    shown: String,
    asked: bool,
    volumes: usize,
    volume: usize,
    /// The first sample of a pixel, and how many.
    first: usize,
    count: usize,
    pick: Pick,
}

impl Look {
    fn choose(source: &Source, shape: &Page, volumes: &[Volume], options: &ReadOptions) -> Result<Self> {
        if volumes.len() > MAX_COMPONENTS {
            let rule = format!("{} volumes of channels and frames: at most {MAX_COMPONENTS}", volumes.len());
            return Err(source.error("ImageDescription", rule));
        }
        let parts = shape.parts();
        let mut arrays = Vec::new();
        for volume in volumes {
            for &(name, _, components) in &parts {
                let name = match (volume.name.as_str(), parts.len()) {
                    ("", _) => name.to_owned(),
                    (volume, 1) => volume.to_owned(),
                    (volume, _) => format!("{volume} {name}"),
                };
                let (kind, association) = (shape.kind, Association::Point);
                // The first one is what a viewer would show: colours before their opacity.
                arrays.push(ArrayInfo { name, association, kind, components, active: arrays.is_empty() });
            }
        }
        let Some(Choice { index, pick }) = arrays::choose(source, &arrays, options.array.as_deref())? else {
            return Err(source.error("pages", "none"));
        };
        let (_, first, count) = parts[index % parts.len()];
        let shown = super::dataset::describe(&arrays[index], pick);
        let (volume, asked) = (index / parts.len(), options.array.is_some());
        Ok(Self { arrays, shown, asked, volumes: volumes.len(), volume, first, count, pick })
    }
}

/// A file as numbers, and how much of it was gone through.
struct File<'a> {
    source: &'a Source,
    endian: Endian,
    big: bool,
    /// Bytes of directories and their values, as often as they were read.
    headers: u64,
    /// Bytes of strips and tiles.
    data: u64,
}

/// An entry of a directory.
#[derive(Clone, Copy, Debug)]
struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    /// Where its values are.
    at: u64,
}

impl Entry {
    /// Bytes of one value; 0 for a type that is not known.
    fn size(&self) -> u64 {
        match self.kind {
            1 | 2 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16 | 17 | 18 => 8,
            _ => 0,
        }
    }
}

/// One image of a file: its first directory's, or that of a page.
#[derive(Clone, Debug)]
struct Page {
    number: usize,
    width: u32,
    height: u32,
    bits: u16,
    kind: SampleType,
    /// 16-bit floats, which become 32-bit ones.
    half: bool,
    samples: usize,
    extra: Vec<u64>,
    photometric: u64,
    planar: bool,
    compression: Compression,
    predictor: u64,
    /// Extent of a strip or tile.
    chunk: [u32; 2],
    tiles: bool,
    offsets: Entry,
    counts: Option<Entry>,
    tables: Option<Entry>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compression {
    None,
    Fax4,
    Lzw,
    Jpeg,
    Deflate,
    PackBits,
}

impl Compression {
    const ALL: [(u64, Self); 7] = [
        (1, Self::None),
        (4, Self::Fax4),
        (5, Self::Lzw),
        (7, Self::Jpeg),
        (8, Self::Deflate),
        (32946, Self::Deflate),
        (32773, Self::PackBits),
    ];

    fn name(self) -> &'static str {
        match self {
            Self::None => "uncompressed",
            Self::Fax4 => "CCITT Group 4",
            Self::Lzw => "LZW",
            Self::Jpeg => "JPEG",
            Self::Deflate => "Deflate",
            Self::PackBits => "PackBits",
        }
    }

    fn code(self) -> u64 {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or(1, |(code, _)| *code)
    }

    /// Names of those that are not read.
    fn other(code: u64) -> &'static str {
        match code {
            2 => " (CCITT modified Huffman)",
            3 => " (CCITT Group 3)",
            6 => " (old JPEG)",
            34712 | 33003 | 33005 => " (JPEG 2000)",
            34887 => " (LERC)",
            34925 => " (LZMA)",
            50000 => " (Zstandard)",
            50001 => " (WebP)",
            50002 | 52546 => " (JPEG XL)",
            _ => "",
        }
    }
}

/// A file's directories.
struct Stack<'a> {
    file: File<'a>,
    /// The number and the place of each page, from the first; those that are reduced are left out.
    pages: Vec<(usize, u64)>,
    shape: Page,
    /// The most bytes of samples that one of the file can stand for.
    ratio: u64,
    /// Bytes of memory that decoding a page takes, beside the result.
    scratch: u64,
    calibration: Calibration,
    notes: Vec<String>,
}

impl<'a> Stack<'a> {
    fn open(source: &'a Source) -> Result<Self> {
        if source.is_gzip() {
            return Err(source.error("file", "is a gzip stream: unpack the TIFF file first"));
        }
        let (mut file, mut next) = File::open(source)?;
        let mut seen = HashSet::new();
        let mut pages = Vec::new();
        let mut reduced = 0;
        let mut first: Option<Page> = None;
        let (mut ratio, mut scratch) = (0, 0);
        let mut notes = Vec::new();
        let mut calibration = None;
        for number in 1.. {
            if next == 0 {
                break;
            }
            if !seen.insert(next) {
                let rule = format!("{next}: the chain of pages comes back to where it was");
                return Err(source.error(format!("page {}: next directory", number - 1), rule));
            }
            if number > MAX_PAGES {
                return Err(source.error("pages", format!("more than {MAX_PAGES}")));
            }
            let at = next;
            let (entries, after) = file.directory(number, at)?;
            next = after;
            let flags = file.number(number, &entries, 254, 0)?;
            let old = file.number(number, &entries, 255, 1)?;
            // 1: reduced resolution, 4: a mask for another page.
            if flags & 5 != 0 || (flags == 0 && old == 2) {
                reduced += 1;
                continue;
            }
            let page = file.page_of(number, &entries)?;
            pages.push((number, at));
            ratio = page.most(1).max(ratio);
            scratch = page.scratch().max(scratch);
            if let Some(first) = &first {
                first.check(source, &page)?;
                continue;
            }
            calibration = Some(file.calibration(&page, &entries)?);
            page.describe(&mut notes);
            first = Some(page);
        }
        let (Some(shape), Some(calibration)) = (first, calibration) else {
            return Err(source.error("pages", "there is none"));
        };
        if reduced > 0 {
            notes.push(format!("{reduced} reduced pages or masks are left out"));
        }
        Ok(Self { file, pages, shape, ratio, scratch, calibration, notes })
    }

    /// The number of images, where one directory stands for several that follow each other.
    fn contiguous(&mut self) -> Result<Option<usize>> {
        let images = self.calibration.images.unwrap_or(1);
        if self.pages.len() != 1 || images < 2 {
            return Ok(None);
        }
        let source = self.file.source;
        let error = |rule: String| source.error("ImageDescription: images", rule);
        if self.shape.compression != Compression::None || self.shape.tiles || self.shape.planar {
            return Err(error(format!(
                "{images}: there is 1 page, and its data are not plain strips that others could follow"
            )));
        }
        let chunks = self.shape.chunks(&mut self.file)?;
        let joined = chunks.windows(2).all(|pair| pair[0].0.checked_add(pair[0].1) == Some(pair[1].0));
        let first = chunks.first().map_or(0, |chunk| chunk.0);
        let needed = self.shape.bytes().saturating_mul(images);
        let there = source.len().saturating_sub(first);
        if !joined || needed > there {
            return Err(error(format!(
                "{images}: there is 1 page, and {needed} bytes are needed from byte {first} on, {there} are there"
            )));
        }
        let count = usize::try_from(images).ok().filter(|&count| count <= MAX_PAGES);
        let count = count.ok_or_else(|| error(format!("{images}: more than {MAX_PAGES}")))?;
        self.notes.push(format!("{images} images follow each other behind 1 page"));
        Ok(Some(count))
    }

    /// Whether it is one slice of a series.
    fn single(&self) -> Result<()> {
        let images = self.calibration.images.unwrap_or(1);
        if self.pages.len() != 1 || images > 1 {
            let count = wide(self.pages.len()).max(images);
            return Err(self
                .file
                .source
                .error("pages", format!("{count}: a file of a series of slices has 1")));
        }
        Ok(())
    }
}

impl<'a> File<'a> {
    /// The header, and where the first directory is.
    fn open(source: &'a Source) -> Result<(Self, u64)> {
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
    fn whole(&self, bytes: &[u8]) -> u64 {
        let add = |sum: u64, byte: &u8| (sum << 8) | u64::from(*byte);
        match self.endian {
            Endian::Little => bytes.iter().rev().fold(0, add),
            Endian::Big => bytes.iter().fold(0, add),
        }
    }

    /// A piece of a header. All pieces are no more than the file, give or take what pages share.
    fn piece(&mut self, place: &str, offset: u64, len: u64) -> Result<Vec<u8>> {
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
    fn directory(&mut self, number: usize, offset: u64) -> Result<(Vec<Entry>, u64)> {
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
    fn numbers(&mut self, number: usize, entry: &Entry, most: u64) -> Result<Vec<u64>> {
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
    fn number(&mut self, number: usize, entries: &[Entry], tag: u16, default: u64) -> Result<u64> {
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
    fn uniform(&mut self, number: usize, entries: &[Entry], tag: u16, default: u64) -> Result<u64> {
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
    fn fraction(&mut self, number: usize, entries: &[Entry], tag: u16) -> Result<Option<f64>> {
        let Some(entry) = find(entries, tag).filter(|entry| entry.kind == 5 && entry.count == 1) else {
            return Ok(None);
        };
        let bytes = self.piece(&place_of(number, tag), entry.at, 8)?;
        let (above, below) = (self.whole(&bytes[..4]), self.whole(&bytes[4..]));
        let value = num::f64_of_u64(above) / num::f64_of_u64(below);
        Ok(Some(value).filter(|value| *value > 0.0 && value.is_finite()))
    }

    fn page(&mut self, number: usize, offset: u64) -> Result<Page> {
        let (entries, _) = self.directory(number, offset)?;
        self.page_of(number, &entries)
    }

    fn page_of(&mut self, number: usize, entries: &[Entry]) -> Result<Page> {
        let source = self.source;
        let error = |tag, rule: String| source.error(place_of(number, tag), rule);
        let extent = |value: u64, tag| {
            let extent = u32::try_from(value).ok().filter(|&extent| extent > 0);
            extent.ok_or_else(|| error(tag, format!("{value}: must be 1 to {}", u32::MAX)))
        };
        let width = extent(self.number(number, entries, 256, 0)?, 256)?;
        let height = extent(self.number(number, entries, 257, 0)?, 257)?;
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
    fn calibration(&mut self, page: &Page, entries: &[Entry]) -> Result<Calibration> {
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

        let orientation = self.number(page.number, entries, 274, 1)?;
        if orientation != 1 {
            calibration.warnings.push(format!(
                "Orientation {orientation} is not applied: rows and columns lie as they are stored"
            ));
        }
        Ok(calibration)
    }

    /// Counts bytes of strips or tiles, and checks that they are there. Together they are no more than the
    /// file has, so that none is gone through again and again.
    fn spend(&mut self, place: &str, offset: u64, len: u64) -> Result<()> {
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
const WANTED: [u16; 26] = [
    254, 255, 256, 257, 258, 259, 262, 266, 270, 273, 274, 277, 278, 279, 282, 283, 284, 296, 317, 322, 323,
    324, 325, 338, 339, 347,
];

fn place_of(number: usize, tag: u16) -> String {
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
        _ => "tag",
    };
    format!("page {number}: {name}")
}

fn find(entries: &[Entry], tag: u16) -> Option<Entry> {
    entries.iter().find(|entry| entry.tag == tag).copied()
}

/// A length as a count of bytes.
fn wide(value: usize) -> u64 {
    u64::try_from(value).unwrap_or(u64::MAX)
}

/// A count of bytes as a length.
fn index(value: u64) -> usize {
    usize::try_from(value).unwrap_or(usize::MAX)
}

const NATIVE: Endian = if cfg!(target_endian = "little") { Endian::Little } else { Endian::Big };

impl Page {
    /// Parts of a pixel: name, first sample, and how many.
    fn parts(&self) -> Vec<(&'static str, usize, usize)> {
        // 1 and 2 are opacity.
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

    /// What is worth saying of how values are kept.
    fn describe(&self, notes: &mut Vec<String>) {
        match self.photometric {
            0 => notes.push("the smallest value is white; values are kept as they are stored".to_owned()),
            3 => notes.push("palette: the values are its indices, no colours".to_owned()),
            _ => {}
        }
        if self.bits < 8 {
            notes.push(format!("samples of {} bits are kept as 8", self.bits));
        }
        if self.half {
            notes.push("16-bit floats are kept as 32-bit ones".to_owned());
        }
        if self.compression == Compression::Jpeg {
            notes.push("JPEG: values are those of a lossy compression".to_owned());
        }
    }

    fn text(&self) -> String {
        let Self { width, height, samples, bits, .. } = self;
        format!("{width} x {height} pixels of {samples} x {} ({bits} bits)", self.kind.name())
    }

    /// Whether another page fits to this one.
    fn check(&self, source: &Source, other: &Self) -> Result<()> {
        let of = |page: &Self| {
            (page.width, page.height, page.samples, page.kind, page.bits, page.half, page.photometric)
        };
        if of(self) != of(other) || self.extra != other.extra {
            let photometric = if self.photometric == other.photometric {
                String::new()
            } else {
                format!(", PhotometricInterpretation {} instead of {}", other.photometric, self.photometric)
            };
            return Err(source.error(
                format!("page {}", other.number),
                format!("{}{photometric}: all slices must be as the first, {}", other.text(), self.text()),
            ));
        }
        Ok(())
    }

    fn layout(&self, look: &Look, slices: usize) -> Layout {
        Layout {
            dims: [self.width, self.height, num::count(slices)],
            kind: self.kind,
            endian: NATIVE,
            components: look.count,
            pick: look.pick,
        }
    }

    /// Bytes of a row of so many pixels of a strip or tile.
    fn row(&self, pixels: u32) -> u64 {
        let samples = if self.planar { 1 } else { self.samples };
        u64::from(pixels).saturating_mul(wide(samples)).saturating_mul(u64::from(self.bits)).div_ceil(8)
    }

    /// Bytes of the page, unpacked.
    fn bytes(&self) -> u64 {
        self.row(self.width).saturating_mul(u64::from(self.height))
    }

    /// The most bytes that one of a strip or tile can stand for.
    fn ratio(&self) -> u64 {
        match self.compression {
            Compression::None => 1,
            // A bit can stand for a row.
            Compression::Fax4 => u64::from(self.width.max(self.chunk[0])),
            // A code of 9 bits or more stands for one more byte than there are codes, at most.
            Compression::Lzw => 4096,
            // One bit for the 64 samples of a block.
            Compression::Jpeg => 1024,
            Compression::Deflate => Encoding::Zlib.most(1),
            // Two bytes for 128.
            Compression::PackBits => 64,
        }
    }

    /// The most bytes of samples, as they are kept, that so many of a file can stand for.
    fn most(&self, len: u64) -> u64 {
        let wider = if self.half { 2 } else { 8 / u64::from(self.bits.clamp(1, 8)) };
        len.saturating_mul(self.ratio()).saturating_mul(wider)
    }

    /// Whether samples go from the file to their list as they are.
    fn is_plain(&self) -> bool {
        !self.tiles && !self.planar && self.compression == Compression::None && self.bits >= 8 && !self.half
    }

    /// Bytes of memory that decoding it takes, beside the result.
    fn scratch(&self) -> u64 {
        let samples =
            u64::from(self.width).saturating_mul(u64::from(self.height)).saturating_mul(wide(self.samples));
        let own = if self.half { 6 } else { u64::from(self.bits).div_ceil(8) };
        let page = samples.saturating_mul(own);
        let chunk = self.row(self.chunk[0]).saturating_mul(u64::from(self.chunk[1]));
        let unpacked = chunk.saturating_mul(if self.compression == Compression::Jpeg { 8 } else { 1 });
        match self.compression {
            Compression::None if self.is_plain() && self.parts().len() == 1 => 0,
            Compression::None => page.saturating_add(chunk),
            _ => page.saturating_add(unpacked).saturating_add(most_packed(chunk).saturating_mul(2)),
        }
    }

    /// Strips or tiles along x and y.
    fn grid(&self) -> [u64; 2] {
        [self.width.div_ceil(self.chunk[0]), self.height.div_ceil(self.chunk[1])].map(u64::from)
    }

    /// Places and sizes of strips or tiles.
    fn chunks(&self, file: &mut File) -> Result<Vec<(u64, u64)>> {
        let [across, down] = self.grid();
        let planes = if self.planar { wide(self.samples) } else { 1 };
        let count = across.saturating_mul(down).saturating_mul(planes);
        let mut lists = Vec::new();
        for entry in [Some(self.offsets), self.counts].into_iter().flatten() {
            let list = file.numbers(self.number, &entry, count)?;
            if wide(list.len()) != count {
                let rule = format!("{}: {count} strips or tiles are needed", list.len());
                return Err(file.source.error(place_of(self.number, entry.tag), rule));
            }
            lists.push(list);
        }
        if lists.len() == 1 {
            // Old writers leave the sizes out: they follow from the rows.
            lists.push((0..count).map(|i| self.row(self.chunk[0]).saturating_mul(self.rows(i))).collect());
        }
        let counts = lists.pop().unwrap_or_default();
        Ok(lists.pop().unwrap_or_default().into_iter().zip(counts).collect())
    }

    /// Rows of the strip or tile with an index: tiles have all, the last strip those that are left.
    fn rows(&self, chunk: u64) -> u64 {
        if self.tiles { u64::from(self.chunk[1]) } else { self.visible_rows(chunk) }
    }

    /// Rows of it that lie in the image.
    fn visible_rows(&self, chunk: u64) -> u64 {
        let [across, down] = self.grid();
        let above = (chunk / across % down).saturating_mul(u64::from(self.chunk[1]));
        u64::from(self.height).saturating_sub(above).min(u64::from(self.chunk[1]))
    }

    /// Appends the page's samples.
    fn decode(&self, file: &mut File, look: &Look, layout: &Layout, values: &mut Samples) -> Result<()> {
        let chunks = self.chunks(file)?;
        self.append(file, &chunks, look, layout, values)
    }

    /// Appends the samples of the image with an index of those that follow this page's.
    fn decode_after(
        &self,
        file: &mut File,
        image: usize,
        look: &Look,
        layout: &Layout,
        values: &mut Samples,
    ) -> Result<()> {
        let first = self.chunks(file)?.first().map_or(0, |chunk| chunk.0);
        let whole = Self { chunk: [self.width, self.height], ..self.clone() };
        let offset = first.saturating_add(self.bytes().saturating_mul(wide(image)));
        whole.append(file, &[(offset, self.bytes())], look, layout, values)
    }

    fn append(
        &self,
        file: &mut File,
        chunks: &[(u64, u64)],
        look: &Look,
        layout: &Layout,
        values: &mut Samples,
    ) -> Result<()> {
        let source = file.source;
        let pixels = index(u64::from(self.width).saturating_mul(u64::from(self.height)));
        let before = values.len();
        if self.is_plain() && look.count == self.samples {
            // Strips that follow each other are read as one.
            let mut run: Option<(u64, u64)> = None;
            let layout = Layout { endian: file.endian, ..*layout };
            let mut flush = |file: &mut File, run: (u64, u64)| {
                let place = format!("page {}: strip at byte {}", self.number, run.0);
                file.spend(&place, run.0, run.1)?;
                let count = index(run.1 / self.row(1).max(1));
                let mut bytes = source.reader(run.0, Encoding::Raw).take(run.1);
                samples::append(&mut bytes, count, &layout, values).map_err(|error| source.io_error(error))
            };
            for (i, &(offset, count)) in (0..).zip(chunks) {
                let needed = self.needed(source, i, count)?;
                match &mut run {
                    Some((start, len)) if start.checked_add(*len) == Some(offset) => {
                        *len = len.saturating_add(needed)
                    }
                    _ => {
                        if let Some(run) = run.replace((offset, needed)) {
                            flush(file, run)?;
                        }
                    }
                }
            }
            if let Some(run) = run {
                flush(file, run)?;
            }
        } else {
            let bytes = self.assemble(file, chunks, look)?;
            let endian = if self.compression == Compression::None { file.endian } else { NATIVE };
            let bytes = if self.half { widened(&bytes, endian) } else { bytes };
            let endian = if self.half { NATIVE } else { endian };
            let layout = Layout { endian, ..*layout };
            samples::append(&mut &*bytes, pixels, &layout, values).map_err(|error| source.io_error(error))?;
        }
        if values.len() - before != pixels {
            return Err(source.error(
                format!("page {}", self.number),
                format!("{} pixels: {pixels} are needed", values.len() - before),
            ));
        }
        Ok(())
    }

    /// Bytes that an uncompressed strip or tile must have, of the `count` that it has.
    fn needed(&self, source: &Source, chunk: u64, count: u64) -> Result<u64> {
        let needed = self.row(self.chunk[0]).saturating_mul(self.rows(chunk));
        if count < needed {
            let place = format!("page {}: strip or tile {chunk}", self.number);
            return Err(source.error(place, format!("{count} bytes: {needed} are needed")));
        }
        Ok(needed)
    }

    /// The samples that are read, pixel by pixel: bits as bytes, others as they are stored.
    fn assemble(&self, file: &mut File, chunks: &[(u64, u64)], look: &Look) -> Result<Vec<u8>> {
        let tables = match &self.tables {
            Some(entry) if entry.count.saturating_mul(entry.size()) > MAX_TABLES => {
                let rule = format!("{} bytes: at most {MAX_TABLES}", entry.count);
                return Err(file.source.error(place_of(self.number, 347), rule));
            }
            Some(entry) => file.piece(&place_of(self.number, 347), entry.at, entry.count * entry.size())?,
            None => Vec::new(),
        };
        let own = usize::from(self.bits).div_ceil(8);
        let pixel = own * look.count;
        let [width, height] = [self.width, self.height].map(num::index);
        // The budget has answered for it.
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
            let (left, top) = (
                index(i % across) * num::index(self.chunk[0]),
                index(i / across % down) * num::index(self.chunk[1]),
            );
            let columns = num::index(self.chunk[0]).min(width - left);
            let rows = bytes.chunks_exact(index(self.row(self.chunk[0]))).take(index(self.visible_rows(i)));
            for (y, row) in rows.enumerate() {
                let row = if self.bits < 8 {
                    unpack(row, self.bits, columns * in_chunk, &mut unpacked);
                    &unpacked
                } else {
                    row
                };
                let target = &mut page[((top + y) * width + left) * pixel..][..columns * pixel];
                if self.planar {
                    let at = (plane - look.first) * own;
                    for (target, sample) in target.chunks_exact_mut(pixel).zip(row.chunks_exact(own)) {
                        target[at..at + own].copy_from_slice(sample);
                    }
                } else {
                    let at = look.first * own;
                    for (target, all) in target.chunks_exact_mut(pixel).zip(row.chunks_exact(own * in_chunk))
                    {
                        target.copy_from_slice(&all[at..at + pixel]);
                    }
                }
            }
        }
        Ok(page)
    }

    /// One strip or tile, unpacked.
    fn expand(&self, file: &mut File, chunk: u64, stored: (u64, u64), tables: &[u8]) -> Result<Vec<u8>> {
        let source = file.source;
        let (offset, count) = stored;
        let place = format!("page {}: strip or tile {chunk} at byte {offset}", self.number);
        if self.compression == Compression::None {
            let needed = self.needed(source, chunk, count)?;
            file.spend(&place, offset, needed)?;
            return source.bytes(offset, needed);
        }
        let rows = self.rows(chunk);
        let needed = self.row(self.chunk[0]).saturating_mul(rows);
        let most = count.saturating_mul(self.ratio());
        if needed > most {
            let name = self.compression.name();
            return Err(
                source.error(place, format!("needs {needed} bytes: {count} of {name} hold at most {most}"))
            );
        }
        if count > most_packed(needed) {
            return Err(source.error(place, format!("{count} bytes for {needed} unpacked ones")));
        }
        file.spend(&place, offset, count)?;
        let packed = source.bytes(offset, count)?;
        if self.compression == Compression::Jpeg {
            let frame = jpeg::frame(&packed).map_err(|why| source.error(&place, format!("JPEG: {why}")))?;
            let fits = u32::from(frame.width) == self.chunk[0]
                && (rows..=u64::from(self.chunk[1])).contains(&u64::from(frame.height))
                && usize::from(frame.components) == (if self.planar { 1 } else { self.samples })
                && frame.bits == 8;
            if !fits {
                let jpeg::Frame { width, height, components, bits, .. } = frame;
                return Err(source.error(
                    place,
                    format!(
                        "JPEG of {width} x {height} pixels, {components} x {bits} bits: does not fit the page"
                    ),
                ));
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
                // Decoders break their lines.
                let why = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
                source.error(place, format!("{} is damaged: {why}", self.compression.name()))
            })?;
        Ok(bytes)
    }

    /// A file of one strip, for the decoder.
    fn small(&self, endian: Endian, rows: u64, packed: &[u8], tables: &[u8]) -> Vec<u8> {
        let samples = if self.planar { 1 } else { self.samples };
        let format = match self.kind {
            SampleType::U8 | SampleType::U16 | SampleType::U32 | SampleType::U64 => 1,
            SampleType::I8 | SampleType::I16 | SampleType::I32 | SampleType::I64 => 2,
            SampleType::F32 | SampleType::F64 => 3,
        };
        let mut entries = vec![
            (256_u16, 1_u64, u64::from(self.chunk[0])),
            (257, 1, rows),
            (258, 1, u64::from(self.bits)),
            (259, 1, self.compression.code()),
            (262, 1, 1),
            (273, 1, 0),
            (277, 1, wide(samples)),
            (278, 1, rows),
            (279, 1, wide(packed.len())),
            (317, 1, self.predictor),
            (339, 1, format),
        ];
        if !tables.is_empty() {
            entries.push((347, wide(tables.len()), 0));
        }
        let behind = 8 + 2 + 12 * entries.len() + 4;
        let mut bytes = Vec::with_capacity(behind + tables.len() + packed.len());
        let put = |bytes: &mut Vec<u8>, value: u64, size: usize| match endian {
            Endian::Little => bytes.extend_from_slice(&value.to_le_bytes()[..size]),
            Endian::Big => bytes.extend_from_slice(&value.to_be_bytes()[8 - size..]),
        };
        bytes.extend_from_slice(if endian == Endian::Little { b"II" } else { b"MM" });
        put(&mut bytes, 42, 2);
        put(&mut bytes, 8, 4);
        put(&mut bytes, wide(entries.len()), 2);
        for (tag, count, value) in entries {
            let (kind, value) = match tag {
                273 => (4, wide(behind + tables.len())),
                347 => (7, wide(behind)),
                _ => (4, value),
            };
            put(&mut bytes, u64::from(tag), 2);
            put(&mut bytes, kind, 2);
            put(&mut bytes, count, 4);
            put(&mut bytes, value, 4);
        }
        put(&mut bytes, 0, 4);
        bytes.extend_from_slice(tables);
        bytes.extend_from_slice(packed);
        bytes
    }
}

/// The most bytes that a strip or tile may be packed in: no compression makes data twice as large.
fn most_packed(unpacked: u64) -> u64 {
    unpacked.saturating_mul(2).saturating_add(1 << 16)
}

/// Samples of less than 8 bits, the highest bits first, as bytes.
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

/// 16-bit floats as 32-bit ones.
fn widened(bytes: &[u8], endian: Endian) -> Vec<u8> {
    let one = |pair: &[u8; 2]| {
        let half =
            if endian == Endian::Little { u16::from_le_bytes(*pair) } else { u16::from_be_bytes(*pair) };
        let (sign, exponent, fraction) = (half >> 15, i32::from((half >> 10) & 31), f32::from(half & 1023));
        let magnitude = match exponent {
            0 => fraction * 2_f32.powi(-24),
            31 if fraction == 0.0 => f32::INFINITY,
            31 => f32::NAN,
            _ => (1.0 + fraction / 1024.0) * 2_f32.powi(exponent - 15),
        };
        (if sign == 1 { -magnitude } else { magnitude }).to_ne_bytes()
    };
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
