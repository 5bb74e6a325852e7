//! TIFF: a stack of pages, one for each slice.
//!
//! This module parses directories itself and checks every size and offset. The `tiff` crate decodes compressed strips and
//! tiles one at a time, each as a small file of its own: it needs memory for one of them only, and interprets nothing but
//! the compression and its predictor.
//!
//! Values are kept as stored: palette indices, and grey values whose smallest is white. Channels, frames and voxel sizes in
//! the descriptions of ImageJ and OME-XML are applied.

mod calibrate;
mod calibration;
pub(crate) mod file;
mod look;
mod page;
mod read_page;
mod stack;
mod strips;

use std::path::{Path, PathBuf};

use glam::DMat3;

use crate::error::{Error, Result};
use crate::io::build::volume::rescale_of;
use crate::io::file::budget::Budget;
use crate::io::file::decode::Layout;
use crate::io::file::samples;
use crate::io::file::source::Source;
use crate::io::formats::tiff::calibration::{Calibration, Volume};
use crate::io::formats::tiff::file::is_tiff;
use crate::io::formats::tiff::look::Look;
use crate::io::formats::tiff::stack::Stack;
use crate::io::options::ReadOptions;
use crate::io::reader::Reader;
use crate::io::report::Loaded;
use crate::num::wide;
use crate::scene::{Grid, Samples};

pub(crate) struct Tiff;

/// The rule for a file with a single page.
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
        is_tiff(source)
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let mut stack = Stack::open(source)?;
        let images = stack.contiguous()?.unwrap_or(stack.pages.len());
        let volumes = stack.calibration.volumes(images);
        if volumes.first().is_none_or(|volume| volume.slices < 2) {
            let several = ['C', 'T'].iter().any(|axis| stack.calibration.extent(*axis) > 1);
            let announced = || format!("; {}, there is 1 page", stack.calibration.announced());
            let more = if several { announced() } else { String::new() };
            return Err(source.error("pages", format!("{ONE_PAGE}{more}")));
        }
        let Stack { file, shape, pages, ratio, scratch, calibration, notes } = stack;
        let look = Look::choose(source, &shape, &volumes, options)?;
        let Volume { first, stride, slices, .. } = volumes[look.volume];
        let layout = shape.layout(&look, slices);
        let most = (source.len().saturating_mul(ratio), format!("{} bytes", source.len()));
        let mut values = reserve(source, "pages", &layout, &most, scratch, options)?;
        for index in (0..slices).map(|slice| first + slice * stride) {
            if let Some(&(number, offset)) = pages.get(index) {
                let page = file.directory(number, offset)?.page()?;
                shape.check(source, &page)?;
                page.append(&file, &page.chunks(&file)?, &look, &mut values)?;
            } else {
                // One directory describes several contiguous images.
                let (image, strip) = shape.following(&file, index)?;
                image.append(&file, &[strip], &look, &mut values)?;
            }
        }
        finish(source, self.name(), layout.dims, values, calibration, look, notes)
    }
}

/// Reads one slice from each file, in this order. `folder` is for messages.
pub(crate) fn read_series(folder: &Path, files: &[PathBuf], options: &ReadOptions) -> Result<Loaded> {
    let Some(path) = files.first() else {
        return Err(Error::file(folder, "files", "there is none"));
    };
    let source = &Source::open(path, options)?;
    let first = Stack::single(source)?;
    let volumes = [Volume { name: String::new(), first: 0, stride: 1, slices: files.len() }];
    let look = Look::choose(source, &first.shape, &volumes, options)?;
    let layout = first.shape.layout(&look, files.len());
    samples::data_size(source, "slices", &layout, options)?;
    let (mut most, mut scratch) = (0_u64, 0);
    for path in files {
        let source = Source::open(path, options)?;
        let stack = Stack::single(&source)?;
        first.shape.check(&source, &stack.shape)?;
        most = most.saturating_add(source.len().saturating_mul(stack.ratio));
        scratch = stack.scratch.max(scratch);
    }
    let most = (most, "the files".to_owned());
    let mut values = reserve(source, "slices", &layout, &most, scratch, options)?;
    for path in files {
        let source = Source::open(path, options)?;
        // The file may have been replaced in the meantime.
        let stack = Stack::single(&source)?;
        first.shape.check(&source, &stack.shape)?;
        stack.shape.append(&stack.file, &stack.shape.chunks(&stack.file)?, &look, &mut values)?;
    }
    let Stack { calibration, notes, .. } = first;
    finish(source, "TIFF slices", layout.dims, values, calibration, look, notes)
}

/// Takes the memory for these samples, which the files must be able to hold: at most `most` bytes. `scratch` is what
/// decoding a page takes in addition.
fn reserve(
    source: &Source,
    place: &str,
    layout: &Layout,
    (most, holder): &(u64, String),
    scratch: u64,
    options: &ReadOptions,
) -> Result<Samples> {
    let (count, in_file) = samples::data_size(source, place, layout, options)?;
    if in_file > *most {
        let rule =
            format!("needs {in_file} bytes for {} slices: {holder} hold at most {most}", layout.dims[2]);
        return Err(source.error(place, rule));
    }
    let mut values = Samples::none(layout.kind, layout.pick);
    let mut budget = Budget::new(source, options);
    budget.take(place, wide(count).saturating_mul(wide(values.sample_bytes())))?;
    budget.take(place, scratch)?;
    values.reserve(count).map_err(|_| source.error(place, format!("{count} samples: memory is full")))?;
    Ok(values)
}

fn finish(
    source: &Source,
    format: &'static str,
    dims: [u32; 3],
    values: Samples,
    calibration: Calibration,
    look: Look,
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
    loaded.report.warnings.extend(look.others);
    if look.arrays.len() > 1 || look.arrays.iter().any(|array| array.components > 1) {
        loaded.report.arrays = look.arrays;
        loaded.report.shown = Some(look.shown);
    }
    Ok(loaded)
}
