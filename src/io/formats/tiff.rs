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
use crate::io::build::data_file::{Array, DataFile, Lattice, Shape, stand_in};
use crate::io::build::volume::rescale_of;
use crate::io::file::budget::Budget;
use crate::io::file::decode::{Layout, Values};
use crate::io::file::on_demand::{PlaneFile, PlaneFiles, Planes};
use crate::io::file::sample_type::Pick;
use crate::io::file::samples;
use crate::io::file::source::Source;
use crate::io::formats::tiff::calibration::{Calibration, Volume};
use crate::io::formats::tiff::file::is_tiff;
use crate::io::formats::tiff::look::Look;
use crate::io::formats::tiff::page::Page;
use crate::io::formats::tiff::stack::Stack;
use crate::io::options::{ReadOptions, Request};
use crate::io::reader::Reader;
use crate::io::report::{Found, Loaded};
use crate::num::wide;
use crate::scene::Grid;

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

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
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
        let looks = Look::choose(source, &shape, &volumes, request)?;
        let most = (source.len().saturating_mul(ratio), format!("{} bytes", source.len()));
        let mut budget = Budget::new(source, request);
        let image = |index: usize| match pages.get(index) {
            Some(&(number, offset)) => {
                let page = file.directory(number, offset)?.page()?;
                shape.check(source, &page)?;
                let chunks = page.chunks(&file)?;
                Ok((page, chunks))
            }
            // One directory describes several contiguous images.
            None => shape.following(&file, index).map(|(image, strip)| (image, vec![strip])),
        };
        let mut read = |look: &Look| {
            let Volume { first, stride, slices, .. } = volumes[look.volume];
            let layout = shape.layout(look, slices);
            let images = || (0..slices).map(|slice| image(first + slice * stride));
            if samples::stays_in_file(source, "pages", &layout, request)?.2 {
                budget.borrow("pages", scratch)?;
                let begin = |image: Result<(Page, Vec<_>)>| {
                    image.and_then(|(page, chunks)| page.begin(&file, &chunks, look))
                };
                if let Some(begins) = images().map(begin).collect::<Result<Option<Vec<u64>>>>()? {
                    let layout = Layout { endian: file.endian, ..layout };
                    let planes = Planes::Apart(source.clone(), begins);
                    return Ok((layout.dims, samples::in_files(planes, &layout)?));
                }
                file.begin_again();
            }
            let mut values = reserve(source, "pages", &layout, &most, scratch, &mut budget, request)?;
            for image in images() {
                let (page, chunks) = image?;
                page.append(&file, &chunks, look, &mut values)?;
            }
            Ok((layout.dims, values))
        };
        finish(source, self.name(), looks, &mut read, calibration, notes)
    }
}

/// Reads one slice from each file, in this order. `folder` is for messages.
pub(crate) fn read_series(folder: &Path, files: &[PathBuf], request: &Request) -> Result<Found> {
    let Some(path) = files.first() else {
        return Err(Error::file(folder, "files", "there is none"));
    };
    let source = &Source::open(path, request)?;
    let first = Stack::single(source)?;
    let volumes = [Volume { name: String::new(), first: 0, stride: 1, slices: files.len() }];
    let looks = Look::choose(source, &first.shape, &volumes, request)?;
    let mut on_demand = true;
    for look in &looks {
        let layout = first.shape.layout(look, files.len());
        if !samples::stays_in_file(source, "slices", &layout, request)?.2 {
            samples::data_size(source, "slices", &layout, request)?;
            on_demand = false;
        }
    }
    let mut budget = Budget::new(source, request);
    let (mut most, mut scratch) = (0_u64, 0);
    // The slices, where they stay in their files.
    let mut planes = Vec::new();
    for path in files {
        let source = Source::open(path, request)?;
        let stack = Stack::single(&source)?;
        first.shape.check(&source, &stack.shape)?;
        most = most.saturating_add(source.len().saturating_mul(stack.ratio));
        scratch = stack.scratch.max(scratch);
        budget.borrow("slices", stack.scratch)?;
        if let ([look], true) = (&looks[..], on_demand) {
            let Stack { file, shape, .. } = &stack;
            let begin = shape.begin(file, &shape.chunks(file)?, look)?;
            planes.extend(
                begin
                    .filter(|_| file.endian == first.file.endian)
                    .map(|begin| PlaneFile::new(&source, begin)),
            );
        }
    }
    let most = (most, "the files".to_owned());
    let mut read = |look: &Look| {
        let layout = first.shape.layout(look, files.len());
        if planes.len() == files.len() {
            let layout = Layout { endian: first.file.endian, ..layout };
            let planes = Planes::Files(PlaneFiles::new(planes.clone(), files.len()));
            return Ok((layout.dims, samples::in_files(planes, &layout)?));
        }
        let mut values = reserve(source, "slices", &layout, &most, scratch, &mut budget, request)?;
        for path in files {
            let source = Source::open(path, request)?;
            // The file may have been replaced in the meantime.
            let stack = Stack::single(&source)?;
            first.shape.check(&source, &stack.shape)?;
            stack.shape.append(&stack.file, &stack.shape.chunks(&stack.file)?, look, &mut values)?;
        }
        Ok((layout.dims, values))
    };
    let (calibration, notes) = (first.calibration.clone(), first.notes.clone());
    finish(source, "TIFF slices", looks, &mut read, calibration, notes)
}

/// Takes the memory for these samples, which the files must be able to hold: at most `most` bytes. `scratch` is what
/// decoding a page takes in addition.
fn reserve(
    source: &Source,
    place: &str,
    layout: &Layout,
    (most, holder): &(u64, String),
    scratch: u64,
    budget: &mut Budget,
    options: &ReadOptions,
) -> Result<Values> {
    let (count, in_file) = samples::data_size(source, place, layout, options)?;
    if in_file > *most {
        let rule =
            format!("needs {in_file} bytes for {} slices: {holder} hold at most {most}", layout.dims[2]);
        return Err(source.error(place, rule));
    }
    let mut values = Values::none(layout.kind, layout.components, layout.pick);
    budget.take(place, wide(count).saturating_mul(layout.pick.bytes(layout.kind, layout.components)))?;
    budget.borrow(place, scratch)?;
    values.reserve(count).map_err(|_| source.error(place, format!("{count} samples: memory is full")))?;
    Ok(values)
}

/// Reads an array, and returns its extents too.
type ReadLook<'r> = dyn FnMut(&Look) -> Result<([u32; 3], Values)> + 'r;

fn finish(
    source: &Source,
    format: &'static str,
    mut looks: Vec<Look>,
    read: &mut ReadLook,
    calibration: Calibration,
    mut notes: Vec<String>,
) -> Result<Found> {
    let located = |error: Error| error.in_file(source.path());
    let Calibration { spacing, origin, .. } = calibration;
    let place = |grid: Grid, look: &Look, pick: Pick| {
        let grid = grid.with_placement(spacing, origin, DMat3::IDENTITY).map_err(located)?;
        let Some(rescale) = calibration.rescale else { return Ok(grid) };
        let array = look.shown.trim_start_matches("point:").trim_end_matches(":magnitude");
        let rescale = rescale_of(pick, array, source, "ImageDescription", rescale)?;
        grid.with_rescale(rescale).map_err(located)
    };
    let mut kept = Vec::new();
    let mut shape = None;
    for look in &looks {
        let Some((index, pick)) = look.kept else { continue };
        let (dims, Values::Whole(tuples)) = read(look)? else { continue };
        shape = Some(Shape::Even(Lattice::of(&place(stand_in()?, look, pick)?, dims)));
        kept.push(Array { info: look.arrays[index].clone(), tuples }.picked(pick));
    }
    let look = looks.swap_remove(0);
    let mut found = match shape {
        Some(shape) => Found::of_arrays(format, DataFile { shape, arrays: kept }),
        None => {
            let (dims, values) = read(&look)?;
            let grid = Grid::new(dims, values.into_samples()).map_err(located)?;
            Loaded::new(format, place(grid, &look, look.pick)?).into()
        }
    };
    notes.extend(calibration.notes);
    found.report.notes = notes;
    found.report.warnings = calibration.warnings;
    found.report.warnings.extend(look.others);
    if look.arrays.len() > 1 || look.arrays.iter().any(|array| array.components > 1) {
        found.report.arrays = look.arrays;
        found.report.shown = Some(look.shown);
    }
    Ok(found)
}
