//! TIFF: a stack of pages, one for each slice.
//!
//! Directories are read here, with every size and place checked; strips and tiles that are compressed are
//! handed to the `tiff` crate one at a time, each as a small file of its own, so that it takes no more
//! memory than one of them needs and interprets nothing but the compression and its predictor.
//!
//! Values are kept as they are stored: indices of palettes, and greys whose smallest one is white. What
//! ImageJ and OME-XML say of channels, frames and the size of a voxel is honoured.

mod calibration;
mod directory;
mod page;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use glam::DMat3;

use super::arrays::{self, ArrayInfo, Association, Choice, Pick};
use super::samples::{self, Layout};
use super::source::{Budget, Source};
use super::volume::rescale_of;
use super::{Loaded, ReadOptions, Reader};
use crate::error::{Error, Result};
use crate::num::wide;
use crate::scene::{Grid, Samples};
use calibration::{Calibration, Volume};
use directory::File;
use page::{Compression, Page};

pub(super) struct Tiff;

/// Most pages.
const MAX_PAGES: usize = 1 << 16;

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
            let announced = stack.calibration.announced();
            let more = announced.map(|counts| format!("; {counts}, there is 1 page")).unwrap_or_default();
            return Err(source.error("pages", format!("{ONE_PAGE}{more}")));
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
    if let Some(rescale) = calibration.rescale {
        let array = look.shown.trim_start_matches("point:").trim_end_matches(":magnitude");
        let rescale = rescale_of(look.pick, array, source, "ImageDescription", rescale)?;
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
        if volumes.len() > MAX_PAGES {
            let rule = format!("{} volumes of channels and frames: at most {MAX_PAGES}", volumes.len());
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

/// A count of bytes as a length.
fn index(value: u64) -> usize {
    usize::try_from(value).unwrap_or(usize::MAX)
}
