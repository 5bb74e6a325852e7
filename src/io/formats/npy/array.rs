//! The array of a file, read as a grid or as points.

use std::io::Read;
use std::ops::Range;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::build::arrays::{ArrayInfo, Association};
use crate::io::build::data_file::Lattice;
use crate::io::build::origin::Origin;
use crate::io::build::points;
use crate::io::build::volume::Chosen;
use crate::io::file::budget::Budget;
use crate::io::file::decode::{self, Layout, NumberBytes, Tuples, Values};
use crate::io::file::half::from_half;
use crate::io::file::sample_type::{Endian, Pick, SampleType};
use crate::io::file::source::{Encoding, Source};
use crate::io::file::{samples, text};
use crate::io::formats::npy::header::{Literal, MAGIC, MAX_HEADER, number_type};
use crate::io::options::{ReadOptions, Request};
use crate::io::report::Found;
use crate::num;
use crate::scene::Samples;

/// The array of a file, whose size has been checked.
pub(crate) struct Array<'a> {
    source: &'a Source,
    kind: SampleType,
    /// Whether numbers are stored as half precision.
    half: bool,
    endian: Endian,
    fortran: bool,
    pub(crate) shape: Vec<u64>,
    /// The offset of the numbers.
    start: u64,
}

impl<'a> Array<'a> {
    pub(crate) fn open(source: &'a Source) -> Result<Self> {
        let Some(rest) = source.head().strip_prefix(MAGIC) else {
            return Err(source.error("byte 0", "must begin with \\x93NUMPY"));
        };
        let (length, begin) = match *rest {
            [1, 0, a, b, ..] => (u64::from(u16::from_le_bytes([a, b])), 10),
            [2 | 3, 0, a, b, c, d, ..] => (u64::from(u32::from_le_bytes([a, b, c, d])), 12),
            [1..=3, 0, ..] => return Err(source.error("byte 8", "ends before the header's length")),
            [major, minor, ..] => {
                let rule = format!("version {major}.{minor}: must be 1.0, 2.0 or 3.0");
                return Err(source.error("byte 6", rule));
            }
            _ => return Err(source.error("byte 6", "ends before the version")),
        };
        if length > MAX_HEADER {
            let rule = format!("a header of {length} bytes: the limit is {MAX_HEADER}");
            return Err(source.error("byte 8", rule));
        }
        let bytes = source.bytes(begin, length)?;
        let Ok(header) = std::str::from_utf8(&bytes) else {
            return Err(source.error("header", "is not text"));
        };
        let (descr, fortran, shape) = Literal { source, header, at: 0 }.header()?;
        let (kind, half, endian) = number_type(source, &descr)?;
        let array = Self { source, kind, half, endian, fortran, shape, start: begin + length };
        let there = source.len().saturating_sub(array.start);
        let needed = array.shape.iter().try_fold(array.item(), |n, &extent| n.checked_mul(extent));
        if needed != Some(there) {
            let needed = needed.map_or("more than 2^64".to_owned(), |needed| needed.to_string());
            let rule =
                format!("{} of type {descr} needs {needed} bytes: {there} are there", array.shape_text());
            return Err(source.error("shape", rule));
        }
        Ok(array)
    }

    /// Returns the size of a number in the file, in bytes.
    fn item(&self) -> u64 {
        if self.half { 2 } else { self.kind.bytes() }
    }

    pub(crate) fn shape_text(&self) -> String {
        let extents: Vec<String> = self.shape.iter().map(u64::to_string).collect();
        match extents.as_slice() {
            [one] => format!("({one},)"),
            _ => format!("({})", extents.join(", ")),
        }
    }

    /// Returns the numbers after the first `skip`, as bytes of `self.kind` in `self.order()`.
    fn numbers(&self, skip: u64) -> Box<dyn Read + 'a> {
        let offset = self.start.saturating_add(skip.saturating_mul(self.item()));
        let mut reader = self.source.reader(offset, Encoding::Raw);
        if !self.half {
            return Box::new(reader);
        }
        let endian = self.endian;
        // Half precision becomes little-endian single precision.
        Box::new(NumberBytes::new(move || {
            let mut half = [0; 2];
            reader.read_exact(&mut half)?;
            let [a, b, c, d] = from_half(u16::from_le_bytes(endian.to_little(half))).to_le_bytes();
            Ok(Some(([a, b, c, d, 0, 0, 0, 0], 4)))
        }))
    }

    /// Returns the byte order of [`Self::numbers`].
    fn order(&self) -> Endian {
        if self.half { Endian::Little } else { self.endian }
    }

    pub(crate) fn grid(&self, extents: [u64; 3], components: u64, request: &Request) -> Result<Found> {
        let source = self.source;
        let mut dims = [0; 3];
        for (dim, extent) in dims.iter_mut().zip(extents) {
            *dim = u32::try_from(extent)
                .map_err(|_| source.error("shape", format!("{extent}: must be below 2^32")))?;
        }
        let layout = Layout::scalar(dims, self.kind, self.order());
        let components = usize::try_from(components).unwrap_or(usize::MAX);
        let mut chosen = Chosen::new(source, "shape", layout, components, request)?;
        let (count, _) = samples::data_size(source, "shape", &chosen.layout, request)?;
        let samples = if self.fortran {
            self.turned(&chosen.layout, request)?
        } else {
            let mut samples = Values::none(self.kind, components, chosen.layout.pick);
            decode::append(&mut self.numbers(0), count, &chosen.layout, &mut samples)
                .map_err(|error| text::stream_error(source, error))?;
            samples
        };
        let located = |error: Error| error.in_file(source.path());
        let grid = chosen.grid(samples).map_err(located)?;
        let lattice = Lattice::of(&grid, dims);
        let mut loaded = chosen.found("NPY", grid, lattice);
        // Pictures with colour channels have the same shape.
        if components == 1 && dims[0] <= 4 && dims[1] >= 16 && dims[2] >= 16 {
            loaded.report.warnings.push(format!(
                "shape {}: {} samples along x; a picture's channels would look the same",
                self.shape_text(),
                dims[0]
            ));
        }
        Ok(loaded)
    }

    /// Reads samples in Fortran order.
    fn turned(&self, layout: &Layout, options: &ReadOptions) -> Result<Values> {
        let Layout { dims, pick, components, .. } = *layout;
        let start = match Values::none(self.kind, components, pick) {
            Values::Samples(start) => start,
            Values::Whole(_) => return self.turned_whole(dims, components),
        };
        let samples = match (pick, start) {
            (Pick::Magnitude, _) => {
                // Components are stored one after another: their squares are accumulated, 8 bytes and the result's 4.
                let count = dims.into_iter().map(u64::from).product::<u64>();
                Budget::new(self.source, options).take("shape", count.saturating_mul(12))?;
                let sums = self.scattered(dims, 0..components, |sum: f64, value| sum + value * value)?;
                Samples::F32(sums.into_iter().map(|sum| num::f32_of(sum.sqrt())).collect())
            }
            // Numbers of these types are exact in 64-bit floats.
            (Pick::Component(i), Samples::U8(_)) => {
                Samples::U8(self.scattered(dims, i..i + 1, |_, value| num::u8_code(value))?)
            }
            (Pick::Component(i), Samples::U16(_)) => {
                Samples::U16(self.scattered(dims, i..i + 1, |_, value| num::u16_code(value))?)
            }
            (Pick::Component(i), Samples::I16(_)) => {
                Samples::I16(self.scattered(dims, i..i + 1, |_, value| num::i16_code(value))?)
            }
            (Pick::Component(i), Samples::F32(_)) => {
                Samples::F32(self.scattered(dims, i..i + 1, |_, value| num::f32_of(value))?)
            }
            (_, samples) => samples,
        };
        Ok(samples.into())
    }

    /// Reads whole tuples in Fortran order.
    fn turned_whole(&self, dims: [u32; 3], components: usize) -> Result<Values> {
        let [nx, ny, nz] = dims.map(num::index);
        let count = nx * ny * nz;
        let layout = Layout::scalar(dims, self.kind, self.order());
        let mut all = Values::none(self.kind, components, Pick::Whole);
        let full = |_| self.source.error("shape", format!("{count} samples: memory is full"));
        all.reserve(count).map_err(full)?;
        all.resize(count);
        let Values::Whole(tuples) = &mut all else { return Ok(all) };
        let size = tuples.size / components;
        let mut numbers = self.numbers(0);
        for component in 0..components {
            for begin in (0..count).step_by(BLOCK) {
                let layout = Layout { pick: Pick::Whole, ..layout };
                let mut block = Values::none(self.kind, 1, Pick::Whole);
                decode::append(&mut numbers, BLOCK.min(count - begin), &layout, &mut block)
                    .map_err(|error| text::stream_error(self.source, error))?;
                let Values::Whole(block) = block else { break };
                for (i, number) in (begin..).zip(block.bytes.chunks_exact(size)) {
                    let [x, y, z] = [i / (nz * ny), i / nz % ny, i % nz];
                    let at = (x + nx * (y + ny * z)) * tuples.size + component * size;
                    tuples.bytes[at..at + size].copy_from_slice(number);
                }
            }
        }
        Ok(all)
    }

    /// Reads components with z fastest and x slowest, a block at a time, and stores samples with x fastest. `add` makes
    /// a sample of what has been stored, first 0, and a component.
    fn scattered<T: Copy + Default>(
        &self,
        dims: [u32; 3],
        components: Range<usize>,
        add: impl Fn(T, f64) -> T,
    ) -> Result<Vec<T>> {
        let [nx, ny, nz] = dims.map(num::index);
        let count = nx * ny * nz;
        let mut samples: Vec<T> = Vec::new();
        let full = |_| self.source.error("shape", format!("{count} samples: memory is full"));
        samples.try_reserve_exact(count).map_err(full)?;
        samples.resize(count, T::default());
        for component in components {
            let mut numbers = self.numbers(num::wide(component).saturating_mul(num::wide(count)));
            for begin in (0..count).step_by(BLOCK) {
                let block = self.block(&mut numbers, BLOCK.min(count - begin))?;
                for (i, value) in (begin..).zip(block) {
                    let [x, y, z] = [i / (nz * ny), i / nz % ny, i % nz];
                    let sample = &mut samples[x + nx * (y + ny * z)];
                    *sample = add(*sample, value);
                }
            }
        }
        Ok(samples)
    }

    /// Reads the next numbers.
    fn block(&self, numbers: &mut dyn Read, count: usize) -> Result<Vec<f64>> {
        let mut values = Vec::new();
        decode::append_f64(numbers, count, self.kind, self.order(), &mut values)
            .map_err(|error| text::stream_error(self.source, error))?;
        Ok(values)
    }

    pub(crate) fn points(&self, n: u64, k: u64, request: &Request) -> Result<Found> {
        let source = self.source;
        let mut budget = Budget::new(source, request);
        budget.take("shape", n.saturating_mul(24))?;
        let count = text::index(source, "shape", n)?;
        let columns = usize::try_from(k).unwrap_or(usize::MAX);
        let mut centres: Vec<DVec3> = Vec::new();
        let full = |_| source.error("shape", format!("{n} points: memory is full"));
        centres.try_reserve_exact(count).map_err(full)?;
        centres.resize(count, DVec3::ZERO);
        if self.fortran {
            for (axis, skip) in [0, n, n.saturating_mul(2)].into_iter().enumerate() {
                let mut numbers = self.numbers(skip);
                for block in centres.chunks_mut(BLOCK) {
                    let values = self.block(&mut numbers, block.len())?;
                    block.iter_mut().zip(values).for_each(|(centre, value)| centre[axis] = value);
                }
            }
        } else {
            let mut numbers = self.numbers(0);
            for block in centres.chunks_mut(BLOCK) {
                let values = self.block(&mut numbers, block.len() * columns)?;
                for (centre, row) in block.iter_mut().zip(values.chunks_exact(columns)) {
                    *centre = DVec3::from_slice(row);
                }
            }
        }
        let array = |column| ArrayInfo {
            name: format!("column {column}"),
            association: Association::Point,
            kind: self.kind,
            components: 1,
            active: column == 3,
        };
        let arrays = (3..k).map(array).collect();
        let mut read = |index: usize, pick: Pick| {
            let column = index + 3;
            if pick == Pick::Whole {
                return self.column(column, count, columns);
            }
            let mut samples = Values::none(self.kind, 1, Pick::Component(0));
            let (skip, components, pick) = if self.fortran {
                (n.saturating_mul(num::wide(column)), 1, Pick::Component(0))
            } else {
                (0, columns, Pick::Component(column))
            };
            let layout = Layout { components, pick, ..Layout::scalar([0; 3], self.kind, self.order()) };
            decode::append(&mut self.numbers(skip), count, &layout, &mut samples)
                .map_err(|error| text::stream_error(source, error))?;
            Ok(samples)
        };
        let (budget, read) = (&mut budget, &mut read);
        points::points(centres, Origin { source, format: "NPY", arrays, spare: 0..0, request, budget, read })
    }
}

impl Array<'_> {
    /// Reads a column of points as it is in the file.
    fn column(&self, column: usize, count: usize, columns: usize) -> Result<Values> {
        let skip = if self.fortran { num::wide(count).saturating_mul(num::wide(column)) } else { 0 };
        let mut numbers = self.numbers(skip);
        let mut all = Tuples::none(self.kind, 1);
        let size = all.size;
        all.bytes.reserve_exact(count.saturating_mul(size));
        let width = if self.fortran { 1 } else { columns };
        for begin in (0..count).step_by(BLOCK) {
            let layout = Layout {
                pick: Pick::Whole,
                components: width,
                ..Layout::scalar([0; 3], self.kind, self.order())
            };
            let mut block = Values::none(self.kind, width, Pick::Whole);
            decode::append(&mut numbers, BLOCK.min(count - begin), &layout, &mut block)
                .map_err(|error| text::stream_error(self.source, error))?;
            let Values::Whole(block) = block else { break };
            let at = if self.fortran { 0 } else { column * size };
            all.bytes.extend(block.bytes.chunks_exact(block.size).flat_map(|row| &row[at..at + size]));
        }
        Ok(Values::Whole(all))
    }
}

/// The number of values read at a time.
const BLOCK: usize = 1 << 13;
