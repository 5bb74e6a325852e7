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
mod description;
pub(crate) mod file;
mod imagej;
mod look;
mod ome;
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
use crate::io::file::sample_type::Pick;
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
                // One directory describes several contiguous images.
                None => shape.decode_after(&mut file, index, &look, &layout, &mut values)?,
            }
        }
        finish(source, self.name(), layout.dims, values, calibration, &look, notes)
    }
}

/// Reads one slice from each file, in this order. `folder` is for messages.
pub(crate) fn read_series(folder: &Path, files: &[PathBuf], options: &ReadOptions) -> Result<Loaded> {
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
        // The file may have been replaced in the meantime.
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
