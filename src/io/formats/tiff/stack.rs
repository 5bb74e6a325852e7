//! All pages of a file that share one shape.

use std::collections::HashSet;

use tiff::tags::{CompressionMethod, Tag};

use crate::error::Result;
use crate::io::file::source::Source;
use crate::io::formats::tiff::calibration::Calibration;
use crate::io::formats::tiff::file::File;
use crate::io::formats::tiff::page::Page;
use crate::num::wide;

/// The limit on pages.
pub(crate) const MAX_PAGES: usize = 1 << 16;

/// The pages of a file, whose directories have been read.
pub(crate) struct Stack<'a> {
    pub(crate) file: File<'a>,
    /// The number and offset of each page; reduced pages are left out.
    pub(crate) pages: Vec<(usize, u64)>,
    pub(crate) shape: Page,
    /// The upper bound of samples, in bytes, per byte of the file.
    pub(crate) ratio: u64,
    /// The memory that decoding a page takes in addition to the result, in bytes.
    pub(crate) scratch: u64,
    pub(crate) calibration: Calibration,
    pub(crate) notes: Vec<String>,
}

impl<'a> Stack<'a> {
    pub(crate) fn open(source: &'a Source) -> Result<Self> {
        if source.is_gzip() {
            return Err(source.error("file", "is a gzip stream: unpack the TIFF file first"));
        }
        let (file, mut next) = File::open(source)?;
        let mut seen = HashSet::new();
        let mut pages = Vec::new();
        let mut reduced = 0;
        let mut first: Option<(Page, Calibration)> = None;
        let (mut ratio, mut scratch) = (0, 0);
        let mut notes = Vec::new();
        for number in 1.. {
            if next == 0 {
                break;
            }
            if !seen.insert(next) {
                let rule = format!("{next}: the chain of pages has a loop");
                return Err(source.error(format!("page {}: next directory", number - 1), rule));
            }
            if number > MAX_PAGES {
                return Err(source.error("pages", format!("more than {MAX_PAGES}")));
            }
            let at = next;
            let directory = file.directory(number, at)?;
            next = directory.next;
            let flags = directory.number(Tag::NewSubfileType, 0)?;
            let old = directory.number(Tag::SubfileType, 1)?;
            // Bit 1 marks reduced resolution, bit 4 a mask for another page.
            if flags & 5 != 0 || (flags == 0 && old == 2) {
                reduced += 1;
                continue;
            }
            let page = directory.page()?;
            pages.push((number, at));
            ratio = page.most().max(ratio);
            scratch = page.scratch().max(scratch);
            if let Some((first, _)) = &first {
                first.check(source, &page)?;
                continue;
            }
            let calibration = directory.calibration(&page)?;
            page.describe(&mut notes);
            first = Some((page, calibration));
        }
        let Some((shape, calibration)) = first else {
            return Err(source.error("pages", "there is none"));
        };
        if reduced > 0 {
            notes.push(format!("{reduced} reduced pages or masks are left out"));
        }
        Ok(Self { file, pages, shape, ratio, scratch, calibration, notes })
    }

    /// Returns the number of images, if one directory describes several contiguous ones.
    pub(crate) fn contiguous(&mut self) -> Result<Option<usize>> {
        let images = self.calibration.images.unwrap_or(1);
        if self.pages.len() != 1 || images < 2 {
            return Ok(None);
        }
        let source = self.file.source;
        let error = |rule: String| source.error("ImageDescription: images", rule);
        if self.shape.compression != CompressionMethod::None || self.shape.tiles || self.shape.planar {
            return Err(error(format!(
                "{images}: there is 1 page, and its data are not plain strips that others could follow"
            )));
        }
        let chunks = self.shape.chunks(&self.file)?;
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
        self.notes.push(format!("1 page describes {images} contiguous images"));
        Ok(Some(count))
    }

    /// Opens a file that must hold one slice.
    pub(crate) fn single(source: &'a Source) -> Result<Self> {
        let stack = Self::open(source)?;
        let images = stack.calibration.images.unwrap_or(1).max(wide(stack.pages.len()));
        if images > 1 {
            return Err(source.error("pages", format!("{images}: a file of a series of slices has 1")));
        }
        Ok(stack)
    }
}
