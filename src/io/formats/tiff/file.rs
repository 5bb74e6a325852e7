//! Directories: tags and their values, with every size and offset checked.

use std::cell::Cell;

use tiff::tags::Tag;

use crate::error::{Error, Result};
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

pub(crate) const IMAGE_DEPTH: Tag = Tag::Unknown(32997);
pub(crate) const TILE_DEPTH: Tag = Tag::Unknown(32998);
/// The tag of Zeiss microscopes (CZ_LSMINFO), in the first directory.
pub(crate) const LSM: Tag = Tag::Unknown(34412);

/// Numbers of the tags that are read.
const WANTED: [u16; 29] = [
    254, 255, 256, 257, 258, 259, 262, 266, 270, 273, 274, 277, 278, 279, 282, 283, 284, 296, 317, 322, 323,
    324, 325, 338, 339, 347, 32997, 32998, 34412,
];

/// Names a tag of a page in messages.
pub(crate) fn place_of(number: usize, tag: Tag) -> String {
    match tag {
        IMAGE_DEPTH => format!("page {number}: ImageDepth"),
        TILE_DEPTH => format!("page {number}: TileDepth"),
        LSM => format!("page {number}: CZ_LSMINFO"),
        tag => format!("page {number}: {tag:?}"),
    }
}

/// A TIFF file, with counts of the bytes read.
pub(crate) struct File<'a> {
    pub(crate) source: &'a Source,
    pub(crate) endian: Endian,
    big: bool,
    /// Bytes of directories and their values, counted each time they are read.
    headers: Cell<u64>,
    /// Bytes read of strips and tiles.
    data: Cell<u64>,
}

/// An entry of a directory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(crate) tag: Tag,
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
        if !is_tiff(source) {
            return Err(source.error("byte 0", "must be II or MM and 42 or 43: not a TIFF file"));
        }
        let endian = if source.head().starts_with(b"II") { Endian::Little } else { Endian::Big };
        let big = source.head()[2..4].contains(&b'+');
        let header = source.bytes(0, if big { 16 } else { 8 })?;
        if big && (endian.whole(&header[4..6]) != 8 || endian.whole(&header[6..8]) != 0) {
            return Err(source.error("byte 4", "BigTIFF: offsets must have 8 bytes"));
        }
        let first = endian.whole(&header[if big { 8 } else { 4 }..]);
        Ok((Self { source, endian, big, headers: Cell::new(0), data: Cell::new(0) }, first))
    }

    /// Reads a range of a directory or of its values. All ranges together are limited to a few times the file size,
    /// because pages may share values.
    pub(crate) fn piece(&self, place: &str, offset: u64, len: u64) -> Result<Vec<u8>> {
        let most = self.source.len().saturating_mul(8).saturating_add(1 << 16);
        self.take(place, (offset, len), "directories", &self.headers, most)?;
        self.source.bytes(offset, len)
    }

    /// Counts bytes of strips or tiles, and checks that they are in the file. Together they may not exceed the file
    /// size, so that none is decoded many times.
    pub(crate) fn spend(&self, place: &str, offset: u64, len: u64) -> Result<()> {
        self.take(place, (offset, len), "strips or tiles", &self.data, self.source.len())
    }

    /// Counts the bytes of strips and tiles anew.
    pub(crate) fn begin_again(&self) {
        self.data.set(0);
    }

    /// Checks that a range lies in the file, and that all ranges of this kind have at most `most` bytes.
    fn take(
        &self,
        place: &str,
        (at, len): (u64, u64),
        kind: &str,
        counted: &Cell<u64>,
        most: u64,
    ) -> Result<()> {
        counted.set(counted.get().saturating_add(len));
        let all = self.source.len();
        if counted.get() > most {
            return Err(self.source.error(place, format!("{kind} overlap")));
        }
        if at.checked_add(len).is_none_or(|end| end > all) {
            return Err(self.source.error(place, format!("{len} bytes at byte {at}: the file has {all}")));
        }
        Ok(())
    }

    /// Reads the directory of a page; `number` is for messages.
    pub(crate) fn directory(&'a self, number: usize, offset: u64) -> Result<Directory<'a>> {
        let place = format!("page {number}: directory");
        let (head, size, word) = if self.big { (8, 20, 8) } else { (2, 12, 4) };
        let count = self.endian.whole(&self.piece(&place, offset, head)?);
        if !(1..=MAX_ENTRIES).contains(&count) {
            let rule = format!("{count} entries at byte {offset}: must be 1 to {MAX_ENTRIES}");
            return Err(self.source.error(place, rule));
        }
        let begin = offset.saturating_add(head);
        let bytes = self.piece(&place, begin, count * size + word)?;
        let (table, next) = bytes.split_at(index(count * size));
        let next = self.endian.whole(next);
        let mut directory = Directory { file: self, number, entries: Vec::new(), next };
        for (i, bytes) in (0..).zip(table.chunks_exact(index(size))) {
            let short = |at: usize| u16::try_from(self.endian.whole(&bytes[at..at + 2])).unwrap_or(0);
            if !WANTED.contains(&short(0)) {
                continue;
            }
            let (count, value) = bytes[4..].split_at(index(word));
            let (count, at) = (self.endian.whole(count), self.endian.whole(value));
            let mut entry = Entry { tag: Tag::from_u16_exhaustive(short(0)), kind: short(2), count, at };
            let Some(len) = entry.size().checked_mul(count).filter(|_| entry.size() > 0) else {
                let rule = format!("{count} values of type {}: no such type", entry.kind);
                return Err(directory.error(entry.tag, rule));
            };
            if len <= word {
                entry.at = begin + i * size + size - word;
            }
            directory.entries.push(entry);
        }
        Ok(directory)
    }

    /// Reads the whole numbers of an entry of a page, at most `most`.
    pub(crate) fn numbers(&self, number: usize, entry: &Entry, most: u64) -> Result<Vec<u64>> {
        let place = place_of(number, entry.tag);
        if !matches!(entry.kind, 1 | 3 | 4 | 13 | 16 | 18) {
            return Err(self.source.error(place, format!("type {}: must be whole numbers", entry.kind)));
        }
        if entry.count > most {
            return Err(self.source.error(place, format!("{} values: at most {most}", entry.count)));
        }
        let bytes = self.piece(&place, entry.at, entry.count * entry.size())?;
        Ok(bytes.chunks_exact(index(entry.size())).map(|bytes| self.endian.whole(bytes)).collect())
    }
}

/// The entries of one page that are read.
pub(crate) struct Directory<'a> {
    pub(crate) file: &'a File<'a>,
    /// The number of the page, for messages.
    pub(crate) number: usize,
    entries: Vec<Entry>,
    /// The offset of the next directory.
    pub(crate) next: u64,
}

impl Directory<'_> {
    pub(crate) fn find(&self, tag: Tag) -> Option<Entry> {
        self.entries.iter().find(|entry| entry.tag == tag).copied()
    }

    /// Returns an error about the value of a tag.
    pub(crate) fn error(&self, tag: Tag, rule: impl Into<String>) -> Error {
        self.file.source.error(place_of(self.number, tag), rule)
    }

    /// Reads the first `len` bytes of an entry's values.
    pub(crate) fn bytes(&self, entry: &Entry, len: u64) -> Result<Vec<u8>> {
        self.file.piece(&place_of(self.number, entry.tag), entry.at, len)
    }

    /// Reads the first whole number of a tag, or returns `default` if it is missing.
    pub(crate) fn number(&self, tag: Tag, default: u64) -> Result<u64> {
        let Some(entry) = self.find(tag) else { return Ok(default) };
        let one = Entry { count: entry.count.min(1), ..entry };
        let first = self.file.numbers(self.number, &one, 1)?.first().copied();
        first.ok_or_else(|| self.error(tag, "has no value"))
    }

    /// Reads a number that must be the same for all samples of a pixel.
    pub(crate) fn uniform(&self, tag: Tag, default: u64) -> Result<u64> {
        let Some(entry) = self.find(tag) else { return Ok(default) };
        let all = self.file.numbers(self.number, &entry, wide(MAX_COMPONENTS))?;
        match all.first() {
            Some(&first) if all.iter().all(|&other| other == first) => Ok(first),
            _ => Err(self.error(tag, format!("{all:?}: must be the same for all samples"))),
        }
    }

    /// Reads a positive fraction, if there is one.
    pub(crate) fn fraction(&self, tag: Tag) -> Result<Option<f64>> {
        let Some(entry) = self.find(tag).filter(|entry| entry.kind == 5 && entry.count == 1) else {
            return Ok(None);
        };
        let bytes = self.bytes(&entry, 8)?;
        let [above, below] =
            [&bytes[..4], &bytes[4..]].map(|bytes| num::f64_of_u64(self.file.endian.whole(bytes)));
        Ok(Some(above / below).filter(|value| *value > 0.0 && value.is_finite()))
    }
}
