//! The array of a file, read as a grid or as points.

use std::io::Read;

use glam::DVec3;

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association};
use crate::io::build::origin::Origin;
use crate::io::build::points;
use crate::io::build::volume::Chosen;
use crate::io::file::budget::Budget;
use crate::io::file::decode::{self, Layout};
use crate::io::file::half::from_half;
use crate::io::file::sample_type::{Endian, Pick, SampleType};
use crate::io::file::source::{Encoding, Source};
use crate::io::file::{samples, text};
use crate::io::formats::npy::header::{Literal, MAGIC, MAX_HEADER, number_type};
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::num;
use crate::scene::{Grid, Samples};

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
        let head = source.head();
        if !head.starts_with(MAGIC) {
            return Err(source.error("byte 0", "must begin with \\x93NUMPY"));
        }
        let &[major, minor] = head.get(6..8).unwrap_or_default() else {
            return Err(source.error("byte 6", "ends before the version"));
        };
        let (length, begin) = match (major, minor, head.get(8..)) {
            (1, 0, Some(&[a, b, ..])) => (u64::from(u16::from_le_bytes([a, b])), 10),
            (2 | 3, 0, Some(&[a, b, c, d, ..])) => (u64::from(u32::from_le_bytes([a, b, c, d])), 12),
            (1..=3, 0, _) => return Err(source.error("byte 8", "ends before the header's length")),
            _ => {
                let rule = format!("version {major}.{minor}: must be 1.0, 2.0 or 3.0");
                return Err(source.error("byte 6", rule));
            }
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
        let reader = self.source.reader(offset, Encoding::Raw);
        if self.half {
            Box::new(Halves { reader, endian: self.endian, bytes: [0; 4], left: 0 })
        } else {
            Box::new(reader)
        }
    }

    /// Returns the byte order of [`Self::numbers`].
    fn order(&self) -> Endian {
        if self.half { Endian::Little } else { self.endian }
    }

    pub(crate) fn grid(&self, extents: [u64; 3], components: u64, options: &ReadOptions) -> Result<Loaded> {
        let source = self.source;
        let mut dims = [0; 3];
        for (dim, extent) in dims.iter_mut().zip(extents) {
            *dim = u32::try_from(extent)
                .map_err(|_| source.error("shape", format!("{extent}: must be below 2^32")))?;
        }
        let layout = Layout::scalar(dims, self.kind, self.order());
        let components = usize::try_from(components).unwrap_or(usize::MAX);
        let chosen = Chosen::new(source, "shape", layout, components, options)?;
        let (count, _) = samples::data_size(source, "shape", &chosen.layout, options)?;
        let samples = if self.fortran {
            self.turned(count, &chosen.layout, options)?
        } else {
            let mut samples = Samples::none(self.kind, chosen.layout.pick);
            decode::append(&mut self.numbers(0), count, &chosen.layout, &mut samples)
                .map_err(|error| text::stream_error(source, error))?;
            samples
        };
        let grid = Grid::new(dims, samples).map_err(|error| error.in_file(source.path()))?;
        let mut loaded = chosen.loaded("NPY", grid);
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

    /// Reads samples in Fortran order, a block at a time.
    fn turned(&self, count: usize, layout: &Layout, options: &ReadOptions) -> Result<Samples> {
        let source = self.source;
        let volume = num::wide(count);
        let plane = Layout { components: 1, pick: Pick::Component(0), ..*layout };
        let mut budget = Budget::new(source, options);
        let full = |_| source.error("shape", format!("{count} samples: memory is full"));
        let failed = |error| text::stream_error(source, error);
        match layout.pick {
            Pick::Component(component) => {
                let bytes = volume.saturating_mul(layout.kind.stored_bytes());
                budget.take("shape", bytes)?;
                let skip = volume.saturating_mul(num::wide(component));
                let mut numbers = self.numbers(skip);
                let mut samples = Samples::none(layout.kind, layout.pick);
                samples.reserve(count).map_err(full)?;
                macro_rules! scatter {
                    ($list:expr, $variant:path) => {{
                        $list.resize(count, Default::default());
                        scatter(
                            layout.dims,
                            |block| {
                                let mut part = Samples::none(layout.kind, layout.pick);
                                decode::append(&mut numbers, block, &plane, &mut part)?;
                                match part {
                                    $variant(part) => Ok(part),
                                    _ => Ok(Vec::new()),
                                }
                            },
                            |at, value| $list[at] = value,
                        )
                        .map_err(failed)?
                    }};
                }
                match &mut samples {
                    Samples::U8(list) => scatter!(list, Samples::U8),
                    Samples::U16(list) => scatter!(list, Samples::U16),
                    Samples::I16(list) => scatter!(list, Samples::I16),
                    Samples::F32(list) => scatter!(list, Samples::F32),
                }
                Ok(samples)
            }
            Pick::Magnitude => {
                // Components are stored one after another: their squares are accumulated.
                budget.take("shape", volume.saturating_mul(12))?;
                let mut sums: Vec<f64> = Vec::new();
                sums.try_reserve_exact(count).map_err(full)?;
                sums.resize(count, 0.0);
                let mut numbers = self.numbers(0);
                for _ in 0..layout.components {
                    let read = |block| {
                        let mut part = Vec::new();
                        decode::append_f64(&mut numbers, block, layout.kind, layout.endian, &mut part)?;
                        Ok(part)
                    };
                    scatter(layout.dims, read, |at, value: f64| sums[at] += value * value).map_err(failed)?;
                }
                let mut lengths = Vec::new();
                lengths.try_reserve_exact(count).map_err(full)?;
                lengths.extend(sums.into_iter().map(|sum| num::f32_of(sum.sqrt())));
                Ok(Samples::F32(lengths))
            }
        }
    }

    pub(crate) fn points(&self, n: u64, k: u64, options: &ReadOptions) -> Result<Loaded> {
        let source = self.source;
        let mut budget = Budget::new(source, options);
        budget.take("shape", n.saturating_mul(24))?;
        let count = text::index(source, "shape", n)?;
        let columns = usize::try_from(k).unwrap_or(usize::MAX);
        let failed = |error| text::stream_error(source, error);
        let mut centres: Vec<DVec3> = Vec::new();
        let full = |_| source.error("shape", format!("{n} points: memory is full"));
        centres.try_reserve_exact(count).map_err(full)?;
        if self.fortran {
            centres.resize(count, DVec3::ZERO);
            for axis in 0..3_usize {
                let mut numbers = self.numbers(n.saturating_mul(u64::try_from(axis).unwrap_or(0)));
                for block in centres.chunks_mut(BLOCK) {
                    let mut values = Vec::new();
                    decode::append_f64(&mut numbers, block.len(), self.kind, self.order(), &mut values)
                        .map_err(failed)?;
                    for (centre, value) in block.iter_mut().zip(values) {
                        centre[axis] = value;
                    }
                }
            }
        } else {
            let mut numbers = self.numbers(0);
            let mut left = count;
            while left > 0 {
                let block = left.min(BLOCK);
                let mut values = Vec::new();
                decode::append_f64(&mut numbers, block * columns, self.kind, self.order(), &mut values)
                    .map_err(failed)?;
                centres.extend(values.chunks_exact(columns).map(|row| DVec3::new(row[0], row[1], row[2])));
                left -= block;
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
        let mut read = |index: usize, _: Pick| {
            let column = index + 3;
            let mut samples = Samples::none(self.kind, Pick::Component(0));
            let (skip, components, pick) = if self.fortran {
                (n.saturating_mul(num::wide(column)), 1, Pick::Component(0))
            } else {
                (0, columns, Pick::Component(column))
            };
            let layout = Layout { components, pick, ..Layout::scalar([0; 3], self.kind, self.order()) };
            decode::append(&mut self.numbers(skip), count, &layout, &mut samples).map_err(failed)?;
            Ok(samples)
        };
        let (budget, read) = (&mut budget, &mut read);
        points::points(centres, Origin { source, format: "NPY", arrays, options, budget, read })
    }
}

/// The number of values read at a time.
const BLOCK: usize = 1 << 13;

/// Reads samples with z fastest and x slowest, and stores each at its index with x fastest.
fn scatter<T>(
    dims: [u32; 3],
    mut read: impl FnMut(usize) -> std::io::Result<Vec<T>>,
    mut put: impl FnMut(usize, T),
) -> std::io::Result<()> {
    let [nx, ny, nz] = dims.map(num::index);
    let mut left = nx * ny * nz;
    let [mut x, mut y, mut z] = [0; 3];
    while left > 0 {
        let block = left.min(BLOCK);
        for value in read(block)? {
            put(x + nx * (y + ny * z), value);
            z += 1;
            if z == nz {
                z = 0;
                y += 1;
                if y == ny {
                    y = 0;
                    x += 1;
                }
            }
        }
        left -= block;
    }
    Ok(())
}

/// Reads half-precision numbers as little-endian bytes of single precision.
struct Halves<R> {
    reader: R,
    endian: Endian,
    bytes: [u8; 4],
    /// Bytes of the last number that have not been returned yet.
    left: usize,
}

impl<R: Read> Read for Halves<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            if self.left == 0 {
                let mut half = [0; 2];
                self.reader.read_exact(&mut half)?;
                let bits = u16::from_le_bytes(self.endian.to_little(half));
                self.bytes = from_half(bits).to_le_bytes();
                self.left = 4;
            }
            let take = self.left.min(buffer.len() - filled);
            let from = 4 - self.left;
            buffer[filled..filled + take].copy_from_slice(&self.bytes[from..from + take]);
            self.left -= take;
            filled += take;
        }
        Ok(filled)
    }
}
