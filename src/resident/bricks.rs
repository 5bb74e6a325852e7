//! The smallest and largest scalar of each brick of a grid, and which bricks are visible, on the device (`bricks.glsl`).

use std::ops::Range;
use std::sync::Arc;

use crate::error::Result;
use crate::gpu::shader::{self, BRICK, BRICK_ROW, BRICKS_AROUND, BRICKS_COMPUTE, PAGE_BRICKS, PAGE_TEXELS};
use crate::gpu::{Buffer, Commands, Gpu, Recorder};
use crate::interface::BricksPush;
use crate::num;
use crate::primitives::dispatch::{Dispatch, buffer, groups_of, pass};
use crate::resident::clock::Clock;
use crate::resident::visible_scalars::{above, below, nonzero_ranges};
use crate::scene::{Grid, SampleKind, Samples, TransferFunction};

/// Samples beyond a brick's own that its range covers on every side.
///
/// So the range still holds for a position that rounding puts into the neighbouring cell.
const APRON: usize = 1;

/// Returns the number of bricks along each axis of a grid.
pub(crate) fn bricks_of(dims: [u32; 3]) -> [u32; 3] {
    dims.map(|n| n.saturating_sub(1).div_ceil(BRICK).max(1))
}

/// Returns the bytes of the bricks of a grid on the device: a range each, and two bits that say whether it is visible, alone and with those
/// around it.
pub(crate) fn brick_bytes(dims: [u32; 3]) -> u64 {
    let [across, rows, planes] = bricks_of(dims).map(u64::from);
    let row_bytes = 8 * across + across.next_multiple_of(u64::from(BRICK_ROW)) / 4;
    row_bytes.saturating_mul(rows).saturating_mul(planes)
}

/// Returns the smallest and largest scalar of each brick of a grid, x fastest, in the units of its data;
/// `[inf, -inf]` where every sample is NaN.
///
/// Brick b covers the samples 8b to 8b + 8 and the apron. A NaN counts for no range: a cell that touches it is
/// vacuum. An infinity counts as the largest `f32` of its sign, which
/// [`nonzero_ranges`] takes into account. Ranges are widened by the
/// rounding of a device's decoding and filtering.
fn brick_ranges(grid: &Grid) -> Vec<[f32; 2]> {
    ranges_of(grid, grid.samples(), Windows { dims: grid.dims(), bricks: bricks_of(grid.dims()), first: 0 })
}

/// Returns the ranges of the bricks of a page, x fastest, from its samples with their apron.
pub(crate) fn page_ranges(grid: &Grid, samples: &Samples) -> Vec<[f32; 2]> {
    ranges_of(grid, samples, Windows { dims: [PAGE_TEXELS; 3], bricks: [PAGE_BRICKS; 3], first: 1 })
}

/// The samples that bricks cover.
#[derive(Clone, Copy, Debug)]
struct Windows {
    /// Samples along each axis.
    dims: [u32; 3],
    /// Bricks along each axis.
    bricks: [u32; 3],
    /// Index of the first sample of the first brick along each axis.
    first: usize,
}

impl Windows {
    /// Returns the samples that a brick covers along an axis.
    fn of(&self, brick: usize, axis: usize) -> Range<usize> {
        let side = num::index(BRICK);
        let begin = self.first + brick * side;
        begin.saturating_sub(APRON)..(begin + side + 1 + APRON).min(num::index(self.dims[axis]))
    }
}

/// Returns the ranges of bricks of some samples of a grid.
fn ranges_of(grid: &Grid, samples: &Samples, windows: Windows) -> Vec<[f32; 2]> {
    match samples {
        Samples::U8(v) => in_units(grid, extremes(v, windows, [u8::MAX, u8::MIN])),
        Samples::U16(v) => in_units(grid, extremes(v, windows, [u16::MAX, u16::MIN])),
        Samples::I16(v) => in_units(grid, extremes(v, windows, [i16::MAX, i16::MIN])),
        Samples::F32(v) => {
            let mut ranges = in_units(grid, extremes(v, windows, [f32::INFINITY, f32::NEG_INFINITY]));
            if grid.nan_count() > 0 {
                open_at_nan(v, windows, &mut ranges);
            }
            ranges
        }
        Samples::OnDemand(_) => {
            let count = windows.bricks.iter().map(|&n| num::index(n)).product();
            vec![[-f32::MAX, f32::MAX]; count]
        }
    }
}

/// Gives bricks with both NaN and other samples every scalar.
///
/// A segment from one side of vacuum to the other spans scalars that neither side has, so empty-space skipping must
/// not skip such bricks by their own range.
fn open_at_nan(values: &[f32], windows: Windows, ranges: &mut [[f32; 2]]) {
    let [n, bricks] = [windows.dims, windows.bricks].map(|counts| counts.map(num::index));
    let side = num::index(BRICK);
    // Bricks along an axis whose window holds a sample's index.
    let around = |place: usize, bricks: usize| {
        let last = (place + APRON).checked_sub(windows.first).map(|place| place / side);
        let first = place.saturating_sub(windows.first + side + APRON).div_ceil(side);
        first..last.map_or(0, |last| (last + 1).min(bricks))
    };
    for (i, _) in values.iter().enumerate().filter(|(_, value)| value.is_nan()) {
        let [x, y, z] = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
        for bz in around(z, bricks[2]) {
            for by in around(y, bricks[1]) {
                for bx in around(x, bricks[0]) {
                    let range = &mut ranges[(bz * bricks[1] + by) * bricks[0] + bx];
                    if range[0] <= range[1] {
                        *range = [-f32::MAX, f32::MAX];
                    }
                }
            }
        }
    }
}

/// Finds the smallest and largest stored number of every brick, or `none` where every number is NaN.
///
/// Reduces one axis after the other. y comes first, because then the inner loop runs along whole rows, which the
/// compiler vectorises, and the other axes have an eighth of the numbers left.
fn extremes<T: Copy + PartialOrd>(values: &[T], windows: Windows, none: [T; 2]) -> Vec<[T; 2]> {
    let [n, bricks] = [windows.dims, windows.bricks].map(|counts| counts.map(num::index));
    // Comparisons are written so that a NaN leaves `so_far` as it is.
    let low = |so_far: T, value: T| if value < so_far { value } else { so_far };
    let high = |so_far: T, value: T| if value > so_far { value } else { so_far };
    let join = |a: [T; 2], b: &[T; 2]| [low(a[0], b[0]), high(a[1], b[1])];

    // Reduced along x and y: [z][brick y][brick x].
    let mut planes = Vec::with_capacity(n[2] * bricks[1] * bricks[0]);
    let (mut lows, mut highs) = (vec![none[0]; n[0]], vec![none[1]; n[0]]);
    for plane in values.chunks_exact(n[0] * n[1]) {
        for y in 0..bricks[1] {
            lows.fill(none[0]);
            highs.fill(none[1]);
            let rows = windows.of(y, 1);
            for row in plane[rows.start * n[0]..rows.end * n[0]].chunks_exact(n[0]) {
                for ((lo, hi), &value) in lows.iter_mut().zip(&mut highs).zip(row) {
                    *lo = low(*lo, value);
                    *hi = high(*hi, value);
                }
            }
            planes.extend((0..bricks[0]).map(|x| {
                let columns = windows.of(x, 0);
                let lo = lows[columns.clone()].iter().fold(none[0], |a, &b| low(a, b));
                let hi = highs[columns].iter().fold(none[1], |a, &b| high(a, b));
                [lo, hi]
            }));
        }
    }

    let area = bricks[0] * bricks[1];
    let mut ranges = vec![none; bricks[2] * area];
    for (z, layer) in ranges.chunks_exact_mut(area).enumerate() {
        let depths = windows.of(z, 2);
        for plane in planes[depths.start * area..depths.end * area].chunks_exact(area) {
            for (range, other) in layer.iter_mut().zip(plane) {
                *range = join(*range, other);
            }
        }
    }
    ranges
}

/// Converts ranges of stored numbers to widened ranges of values.
fn in_units<T: Copy + Into<f64>>(grid: &Grid, stored: Vec<[T; 2]>) -> Vec<[f32; 2]> {
    let rescale = grid.rescale();
    // The largest decoded number's rounding decides by how much a range is widened.
    let [zero, full] = normalised(grid.samples());
    let finite = |value: f64| value.clamp(-f64::from(f32::MAX), f64::from(f32::MAX));
    let value = |stored: f64| finite(rescale.slope * stored + rescale.intercept);
    let terms = (rescale.slope * full).abs().max(value(zero).abs());
    stored
        .into_iter()
        .map(|range| {
            let [lo, hi] = range.map(Into::into);
            if lo > hi {
                return [f32::INFINITY, f32::NEG_INFINITY];
            }
            let (a, b) = (value(lo), value(hi));
            let (min, max) = (a.min(b), a.max(b));
            // Zero texels stay zero under every filter. Without this case the empty background of most data would
            // become visible under a transfer function that starts there.
            let pad = if lo == zero && hi == zero { 0.0 } else { slack(min, max, terms) };
            [below(finite(min - pad)), above(finite(max + pad))]
        })
        .collect()
}

/// Returns the stored number of an all-zero texel, and the largest number that a normalised texel decodes to before
/// that is added; both 0 for floats.
pub(crate) fn normalised(samples: &Samples) -> [f64; 2] {
    match samples.kind() {
        SampleKind::U8 => [0.0, 255.0],
        SampleKind::U16 => [0.0, 65535.0],
        SampleKind::I16 => [-32768.0, 65535.0],
        SampleKind::F32 => [0.0, 0.0],
    }
}

/// Bounds the rounding of a device for values between `min` and `max`.
///
/// It is one step of the filter's weights, which have at least 8 bits, and 4 units in the last place of the largest
/// intermediate number.
fn slack(min: f64, max: f64, terms: f64) -> f64 {
    let largest = min.abs().max(max.abs()).max(terms);
    let unit = (largest * f64::from(f32::EPSILON)).max(f64::from(f32::from_bits(1)));
    (max - min) / 512.0 + 4.0 * unit
}

/// The scalars of a brick of which nothing is known.
const UNKNOWN: [f32; 2] = [-f32::MAX, f32::MAX];

/// The meaning of the codes of bricks.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Telling {
    /// 1 where one of these ranges of scalars, widened by a margin, occurs; else 0.
    Visible { scalars: Vec<[f32; 2]>, margin: f32 },
    /// The upper half of a float not below the greatest scalar.
    Greatest,
}

impl Telling {
    /// Returns the bits of a code.
    const fn bits(&self) -> u32 {
        match self {
            Self::Visible { .. } => 1,
            Self::Greatest => 16,
        }
    }

    /// Returns the code of bricks with a range of scalars; of visible ones as `is_visible` of `bricks.glsl` does.
    pub(crate) fn code(&self, range: [f32; 2]) -> u32 {
        match self {
            Self::Greatest => {
                let up = if range[1].is_sign_negative() { 0 } else { 0xFFFF };
                (range[1].to_bits() + up) >> 16
            }
            Self::Visible { scalars, margin } => {
                let meets =
                    |scalars: &[f32; 2]| scalars[1] + margin >= range[0] && scalars[0] - margin <= range[1];
                u32::from(range[0] <= range[1] && scalars.iter().any(meets))
            }
        }
    }

    /// Returns whether nothing is visible in bricks with a range of scalars.
    pub(crate) fn hides(&self, range: [f32; 2]) -> bool {
        *self != Self::Greatest && self.code(range) == 0
    }
}

/// A code for each brick of a grid (`glsl/shared/brick-codes.glsl`).
#[derive(Clone, Debug)]
pub(crate) struct Codes {
    /// Bits of a code.
    bits: u32,
    counts: [u32; 3],
    pub(crate) words: Vec<u32>,
}

impl Codes {
    /// Makes the codes of a grid of which nothing is known.
    pub(crate) fn new(grid: &Grid, telling: &Telling) -> Self {
        let counts = bricks_of(grid.dims());
        let [across, rows, planes] = counts.map(num::index);
        let bits = num::index(telling.bits());
        let unknown = telling.code(UNKNOWN);
        let unknown = if bits == 1 { 0_u32.wrapping_sub(unknown) } else { unknown << 16 | unknown };
        let row_words = across.next_multiple_of(num::index(BRICK_ROW)) * bits / 32;
        let mut words = vec![unknown; row_words * rows * planes];
        // Nothing is visible beyond the last brick of a row.
        let (full, rest) = (across * bits / 32, across * bits % 32);
        for row in words.chunks_exact_mut(row_words) {
            let mut mask = (1 << rest) - 1;
            for word in &mut row[full..] {
                *word &= std::mem::take(&mut mask);
            }
        }
        Self { bits: telling.bits(), counts, words }
    }

    /// Returns the word of a brick, and the lowest bit of its code there.
    fn place(&self, [x, y, z]: [usize; 3]) -> (usize, usize) {
        let [across, rows, _] = self.counts.map(num::index);
        let number = (z * rows + y) * across.next_multiple_of(num::index(BRICK_ROW)) + x;
        let bit = number * num::index(self.bits);
        (bit / 32, bit % 32)
    }

    /// Returns the places along an axis of the bricks of a box, of those that the grid has.
    fn along(&self, axis: usize, first: u32, count: u32) -> Range<usize> {
        num::index(first)..num::index(self.counts[axis].min(first + count))
    }

    /// Sets the codes of the bricks of a box, x fastest, that begins at brick `first`. Bricks that the grid does not have are left out.
    pub(crate) fn set(&mut self, first: [u32; 3], counts: [u32; 3], code: impl Fn(usize) -> u32) {
        let [across, rows, _] = counts.map(num::index);
        let [x0, y0, z0] = first.map(num::index);
        let mask = (1 << self.bits) - 1;
        for z in self.along(2, first[2], counts[2]) {
            for y in self.along(1, first[1], counts[1]) {
                for x in self.along(0, first[0], counts[0]) {
                    let code = code(((z - z0) * rows + y - y0) * across + x - x0);
                    let (word, at) = self.place([x, y, z]);
                    self.words[word] = self.words[word] & !(mask << at) | code << at;
                }
            }
        }
    }

    /// Returns the words of a page, those from its first to its last row in each plane of bricks.
    pub(crate) fn words_of_page(&self, page: [u32; 3]) -> impl Iterator<Item = Range<usize>> {
        let [xs, ys, zs] = [0, 1, 2].map(|axis| self.along(axis, page[axis] * PAGE_BRICKS, PAGE_BRICKS));
        zs.map(move |z| self.place([xs.start, ys.start, z]).0..self.place([xs.end - 1, ys.end - 1, z]).0 + 1)
    }
}

/// The bricks of a grid on the device.
#[derive(Clone, Debug)]
pub(crate) struct Bricks {
    /// A code for each brick.
    pub(crate) codes: Arc<Buffer>,
    /// A bit for each brick: 0 where nothing is visible in it and the 26 around it. `None` where codes tell the greatest scalars.
    pub(crate) around: Option<Arc<Buffer>>,
}

/// The pass that finds the bricks that show anything or have such a brick beside them (AROUND of `bricks.glsl`).
#[derive(Debug)]
pub(crate) struct FindAround {
    pub(crate) bits: Arc<Buffer>,
    look: Dispatch,
    push: BricksPush,
}

impl FindAround {
    /// Makes the pass for the codes of a grid with so many bricks along each axis.
    pub(crate) fn new(gpu: &Gpu, codes: &Arc<Buffer>, counts: [u32; 3]) -> Result<Self> {
        let bits = buffer(gpu, "bricks.around", codes.size() / 4)?;
        let inputs = shader::BricksAround { bricks: codes.read(), around: bits.write() };
        let look = pass(gpu, "bricks.around", &BRICKS_AROUND.with(&inputs))?;
        let [across, rows, planes] = counts;
        Ok(Self { bits, look, push: BricksPush { across, rows, planes, ..Default::default() } })
    }

    /// Records the pass.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>) {
        let BricksPush { across, rows, planes, .. } = self.push;
        let words = across.div_ceil(BRICK_ROW) * rows * planes;
        self.look.record(recorder, &self.push, groups_of(words, 64));
        recorder.release_buffer(&self.bits);
    }
}

/// Uploads a float not below the greatest scalar of each brick of a grid.
pub(crate) fn greatest_scalars(gpu: &Gpu, grid: &Grid) -> Result<Bricks> {
    let ranges = brick_ranges(grid);
    let mut codes = Codes::new(grid, &Telling::Greatest);
    codes.set([0; 3], bricks_of(grid.dims()), |brick| Telling::Greatest.code(ranges[brick]));
    let codes = Buffer::with_data(gpu, "bricks.greatest", bytemuck::cast_slice(&codes.words))?;
    Ok(Bricks { codes, around: None })
}

/// The smallest and largest scalar of each brick on the device, and the number of bricks.
#[derive(Clone, Debug)]
pub(crate) struct BrickRanges {
    buffer: Arc<Buffer>,
    counts: [u32; 3],
}

impl BrickRanges {
    /// Computes and uploads the ranges of a grid.
    pub(crate) fn new(gpu: &Gpu, grid: &Grid) -> Result<Self> {
        let ranges = brick_ranges(grid);
        let buffer = Buffer::with_data(gpu, "bricks.ranges", bytemuck::cast_slice(&ranges))?;
        Ok(Self { buffer, counts: bricks_of(grid.dims()) })
    }

    /// Finds the visible bricks, with extinction smeared by `margin` scalars.
    pub(crate) fn visible(
        self,
        gpu: &Gpu,
        clock: &Clock,
        transfer: &TransferFunction,
        margin: f32,
    ) -> Result<Bricks> {
        let mut scalars = nonzero_ranges(transfer);
        let [across, rows, planes] = self.counts;
        let push = BricksPush { across, rows, planes, ranges: num::count(scalars.len()), margin };
        if scalars.is_empty() {
            scalars.push([0.0; 2]);
        }
        let scalars = Buffer::with_data(gpu, "transfer.visible", bytemuck::cast_slice(&scalars))?;
        let count = across.next_multiple_of(BRICK_ROW) * rows * planes;
        let codes = buffer(gpu, "bricks", u64::from(count / 32))?;
        let bound = BRICKS_COMPUTE.with(&shader::BricksCompute {
            ranges: self.buffer.read(),
            visible: scalars.read(),
            bricks: codes.write(),
        });
        let mark = pass(gpu, "bricks.mark", &bound)?;
        let around = FindAround::new(gpu, &codes, self.counts)?;
        // Their time is not that of a table.
        gpu.build([&mark.pipeline, &around.look.pipeline].into_iter())?;
        clock.tables(|| {
            let mut commands = Commands::new(gpu)?;
            let mut recorder = Recorder::new(gpu, commands.begin()?, None);
            mark.record(&mut recorder, &push, groups_of(count, 64));
            around.record(&mut recorder);
            recorder.release_buffer(&codes);
            let (_, keep) = recorder.finish()?;
            commands.submit(keep, "bricks.mark")
        })?;
        Ok(Bricks { codes, around: Some(around.bits) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::f32_of;
    use crate::scene::Rescale;

    const MAX: f32 = f32::MAX;

    /// Returns numbers without a pattern.
    fn scatter(i: usize) -> f32 {
        let x = num::count(i).wrapping_mul(0x9E37_79B9);
        let x = (x ^ (x >> 15)).wrapping_mul(0x85EB_CA6B);
        f32_of(f64::from((x ^ (x >> 13)) & 0xFFFF) / 65535.0)
    }

    /// Computes the range of a brick from its definition, sample by sample, without widening.
    fn slow(grid: &Grid, brick: [u32; 3]) -> [f64; 2] {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        let reach = |axis: usize| {
            let first = (8 * brick[axis]).saturating_sub(1);
            first..=(8 * brick[axis] + 9).min(grid.dims()[axis] - 1)
        };
        for z in reach(2) {
            for y in reach(1) {
                for x in reach(0) {
                    let value = grid.value(x, y, z);
                    range = [range[0].min(value), range[1].max(value)];
                }
            }
        }
        range
    }

    #[test]
    fn ranges_are_those_of_the_samples_with_apron_slightly_widened() {
        for dims in [[2, 2, 2], [9, 10, 17], [18, 3, 8], [27, 26, 11]] {
            let number = dims.iter().map(|&n| num::index(n)).product::<usize>();
            let unit: Vec<f32> = (0..number).map(scatter).collect();
            let cast = |scale: f64| unit.iter().map(move |&v| f64::from(v) * scale);
            for samples in [
                Samples::U8(cast(255.0).map(num::u8_code).collect()),
                Samples::U16(cast(65535.0).map(num::u16_code).collect()),
                Samples::I16(cast(65535.0).map(|v| num::i16_code(v - 32768.0)).collect()),
                Samples::F32(unit.clone()),
            ] {
                for slope in [1.0, -0.37] {
                    let rescale = Rescale { slope, intercept: 0.25 };
                    let grid = Grid::new(dims, samples.clone()).unwrap().with_rescale(rescale).unwrap();
                    let bricks = bricks_of(dims);
                    assert_eq!(bricks, dims.map(|n| (n - 1).div_ceil(8)));
                    let all = brick_ranges(&grid);
                    let mut ranges = all.iter();
                    for z in 0..bricks[2] {
                        for y in 0..bricks[1] {
                            for x in 0..bricks[0] {
                                let want = slow(&grid, [x, y, z]);
                                let got = ranges.next().unwrap().map(f64::from);
                                let span = want[1] - want[0];
                                for pad in [want[0] - got[0], got[1] - want[1]] {
                                    assert!(
                                        pad >= span / 512.0
                                            && pad < span / 511.0 + 4.1 * span.max(0.25) / 8e6,
                                        "{} {dims:?} slope {slope} brick [{x}, {y}, {z}]: {got:?}, not {want:?}",
                                        samples.type_name()
                                    );
                                }
                            }
                        }
                    }
                    assert!(ranges.next().is_none());
                }
            }
        }
    }

    /// Returns the code of a brick as shaders read it.
    fn code_of(codes: &Codes, brick: [usize; 3]) -> u32 {
        let (word, at) = codes.place(brick);
        codes.words[word] >> at & ((1 << codes.bits) - 1)
    }

    #[test]
    fn codes_are_told_brick_by_brick() {
        let telling = Telling::Visible { scalars: vec![[10.0, 20.0]], margin: 0.5 };
        for dims in [[2, 2, 2], [65, 70, 129], [257, 65, 65], [521, 17, 9]] {
            let number = dims.iter().map(|&n| num::index(n)).product::<usize>();
            let grid = Grid::new(dims, Samples::U8(vec![0; number])).unwrap();
            let counts = bricks_of(dims);
            let all = || {
                let [xs, ys, zs] = counts.map(num::index);
                (0..xs * ys * zs).map(move |i| [i % xs, i / xs % ys, i / xs / ys])
            };
            let mut codes = Codes::new(&grid, &telling);
            assert_eq!(codes.words.len() % num::index(counts[0].div_ceil(32)), 0);
            assert!(all().all(|brick| code_of(&codes, brick) == 1));
            let ones: u32 = codes.words.iter().map(|word| word.count_ones()).sum();
            assert_eq!(ones, counts.iter().product::<u32>(), "no bits beyond the bricks of {dims:?}");

            // Each second brick of the last page of each row of pages hides.
            let pages = counts.map(|n| n.div_ceil(PAGE_BRICKS));
            let first = [(pages[0] - 1) * PAGE_BRICKS, 0, 0];
            let range = |brick: usize| if brick % 2 == 1 { [20.6, 30.0] } else { [20.5, 30.0] };
            codes.set(first, [PAGE_BRICKS; 3], |brick| telling.code(range(brick)));
            for [x, y, z] in all() {
                let inside = x >= num::index(first[0]) && y < 8 && z < 8;
                let want = u32::from(!(inside && (x - num::index(first[0])) % 2 == 1));
                assert_eq!(code_of(&codes, [x, y, z]), want, "{dims:?} [{x}, {y}, {z}]");
                let page = [x, y, z].map(|place| num::count(place) / PAGE_BRICKS);
                let word = codes.place([x, y, z]).0;
                assert_eq!(codes.words_of_page(page).filter(|words| words.contains(&word)).count(), 1);
            }
        }
    }

    #[test]
    fn greatest_scalars_are_rounded_upwards() {
        for greatest in [0.0, 1.0, 255.0, 1.000_001, 0.1, -0.1, -3.7e9, 1e-40, -1e-40, f32::MAX, f32::MIN] {
            let code = Telling::Greatest.code([-f32::MAX, greatest]);
            let read = f32::from_bits(code << 16);
            assert!(code < 1 << 16 && read >= greatest, "{greatest}: {read}");
            assert!(
                read <= greatest + greatest.abs() / 127.0 + 1e-38 || greatest == f32::MAX,
                "{greatest}: {read}"
            );
        }
        let values = Samples::F32((0..34 * 4).map(|i| f32_of(f64::from(i))).collect());
        let grid = Grid::new([34, 2, 2], values).unwrap();
        let mut codes = Codes::new(&grid, &Telling::Greatest);
        let ranges = brick_ranges(&grid);
        codes.set([0; 3], bricks_of(grid.dims()), |brick| Telling::Greatest.code(ranges[brick]));
        assert_eq!(codes.words.len(), 16);
        for (brick, [_, greatest]) in ranges.iter().enumerate() {
            assert!(f32::from_bits(code_of(&codes, [brick, 0, 0]) << 16) >= *greatest);
        }
    }

    #[test]
    fn an_apron_of_one_sample_and_no_more() {
        // One sample stands out; these bricks along x cover it.
        let seen = |at: usize| -> Vec<bool> {
            let mut values = vec![0_u8; 26 * 4];
            values[at] = 100;
            assert_eq!(bricks_of([26, 2, 2]), [4, 1, 1]);
            let ranges = brick_ranges(&Grid::new([26, 2, 2], Samples::U8(values)).unwrap());
            ranges.iter().map(|range| range[1] > 50.0).collect()
        };
        assert_eq!(seen(0), [true, false, false, false]);
        assert_eq!(seen(6), [true, false, false, false]);
        assert_eq!(seen(7), [true, true, false, false]);
        assert_eq!(seen(9), [true, true, false, false]);
        assert_eq!(seen(10), [false, true, false, false]);
        assert_eq!(seen(17), [false, true, true, false]);
        assert_eq!(seen(25), [false, false, true, true]);
    }

    #[test]
    fn infinities_reach_to_the_largest_number() {
        let mut values = vec![2.0; 34 * 4];
        values[0] = 3.0;
        values[1] = 1.0;
        values[12] = f32::NEG_INFINITY;
        values[33] = f32::INFINITY;
        let grid = Grid::new([34, 2, 2], Samples::F32(values)).unwrap();
        let ranges = brick_ranges(&grid);
        assert!(ranges[0][0] < 1.0 && ranges[0][0] > 0.99 && ranges[0][1] > 3.0 && ranges[0][1] < 3.01);
        assert_eq!(ranges[1][0], -MAX);
        assert_eq!(ranges[4][1], MAX);
        let flipped = grid.with_rescale(Rescale { slope: -2.0, intercept: 7.0 }).unwrap();
        let ranges = brick_ranges(&flipped);
        assert_eq!(ranges[4][0], -MAX);
        assert_eq!(ranges[1][1], MAX);
        assert!(ranges[0][0] < 1.0 && ranges[0][1] > 5.0);
    }

    #[test]
    fn bricks_that_touch_nan_have_every_scalar_and_those_of_nan_alone_none() {
        let mut values: Vec<f32> = (0..50_u8).flat_map(|x| [f32::from(x); 4]).collect();
        // Samples 17 to 36 along z.
        values[17 * 4..37 * 4].fill(f32::NAN);
        let grid = Grid::new([2, 2, 50], Samples::F32(values)).unwrap();
        let ranges = brick_ranges(&grid);
        assert_eq!(ranges.len(), 7);
        let whole = |range: [f32; 2]| range[0] <= 0.0 && range[1] >= 49.0;
        // Windows reach one sample beyond: brick 1 has samples 7 to 17, brick 3 those from 23 to 33.
        assert!(!whole(ranges[0]) && whole(ranges[1]) && whole(ranges[2]), "{ranges:?}");
        assert_eq!(ranges[3], [f32::INFINITY, f32::NEG_INFINITY]);
        assert!(whole(ranges[4]) && !whole(ranges[5]) && !whole(ranges[6]), "{ranges:?}");
    }

    #[test]
    fn zero_texels_are_exact_and_other_constants_cover_the_decoding() {
        let range = |samples: Samples, intercept: f64| {
            let rescale = Rescale { slope: 1.0, intercept };
            brick_ranges(&Grid::new([2, 2, 2], samples).unwrap().with_rescale(rescale).unwrap())[0]
        };
        assert_eq!(range(Samples::U8(vec![0; 8]), 0.0), [0.0, 0.0]);
        assert_eq!(range(Samples::F32(vec![0.0; 8]), -5.0), [-5.0, -5.0]);
        assert_eq!(range(Samples::I16(vec![i16::MIN; 8]), 0.0), [-32768.0, -32768.0]);
        // 0.1 lies between two f32, and the device may have either.
        let [lo, hi] = range(Samples::U16(vec![0; 8]), 0.1);
        assert!(f64::from(lo) < 0.1 && f64::from(hi) > 0.1 && lo.next_up() == hi);
        // 65535 * texel - 32768 in float32, where the texel is a rounded 32768 / 65535.
        let [lo, hi] = range(Samples::I16(vec![0; 8]), 0.0);
        assert!(lo <= -1.0 / 128.0 && hi >= 1.0 / 128.0, "[{lo}, {hi}]");
        let [lo, hi] = range(Samples::F32(vec![7.0; 8]), 0.0);
        assert!(lo <= 7.0 - 4.0 * 4.7e-7 && (7.0 + 4.0 * 4.7e-7..7.00001).contains(&hi));
    }
}
