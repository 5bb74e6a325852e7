//! Kernels in parts, for devices without room for all: one recording draws some rows of tiles, with the kernels that reach them.
//!
//! 1. The host finds the rows of tiles that each kernel may reach in a view, from a sphere around it.
//! 2. Rows are joined to parts of at most as many kernels as the device has room for.
//! 3. A recording uploads the kernels of a part in their own order, and draws its rows as a frame of all kernels does. A kernel that
//!    reaches several parts is drawn in each. So every pixel blends the same kernels in the same order, and the image is the same to the bit.

use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::frame::lists::Band;
use crate::gpu::shader::TILE;
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::interface::SplatViewPush;
use crate::num;
use crate::primitives::bins::{Fill, with_margin};
use crate::primitives::radix_sort::MOST_PAIRS;
use crate::resident::part_buffers::PartBuffers;
use crate::resident::splats::{Shape, SplatSet};
use crate::scene::Kernel;

/// Pixels by which rows are widened, beside the filter of kernels that are smaller than a pixel.
const MARGIN: f64 = 2.0;

/// The error of places in float32, in units of the data.
const ROUNDING: f64 = 1e-6;

/// The depth, in radii of a kernel, up to which its affine footprint may reach any row.
const NEAR: f64 = 8.0;

/// By how much an affine footprint may be larger than a kernel that is farther away: 1 / (1 - 1 / NEAR), and some.
const WIDER: f64 = 1.25;

/// The kernels of a set, of which the device holds those of one part of a view.
#[derive(Debug)]
pub(super) struct SplatParts {
    set: Arc<SplatSet>,
    held: PartBuffers,
    /// Kernels that the buffers have room for.
    pub(super) room: u32,
    /// The most bands of a part, and of all, that a view may have.
    most_bands: [usize; 2],
    /// Parts that were asked for.
    wanted: u32,
    /// Tiles in a row, and rows.
    tiles: [u32; 2],
    /// The first row of tiles that each kernel reaches, and the one after the last.
    rows: Vec<[u16; 2]>,
    pub(super) parts: Vec<Part>,
}

/// Rows of tiles that are drawn together.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// The first row, and the one after the last.
    rows: [u32; 2],
    kernels: u32,
    /// The bands of tiles whose bins fit a buffer.
    pub(super) bands: Vec<Band>,
}

/// How many kernels begin before each row of tiles, and how many end.
struct Reached {
    begun: Vec<u32>,
    ended: Vec<u32>,
}

impl Reached {
    fn new(rows: &[[u16; 2]], count: u32) -> Self {
        let mut sums = [0, 1].map(|_| vec![0; num::index(count) + 2]);
        for &[first, end] in rows.iter().filter(|[first, end]| first < end) {
            sums[0][usize::from(first) + 1] += 1;
            sums[1][usize::from(end)] += 1;
        }
        for sums in &mut sums {
            let mut sum = 0;
            sums.iter_mut().for_each(|n| {
                sum += *n;
                *n = sum;
            });
        }
        let [begun, ended] = sums;
        Self { begun, ended }
    }

    /// Returns the number of kernels that reach some rows.
    fn within(&self, [first, end]: [u32; 2]) -> u32 {
        self.begun[num::index(end)] - self.ended[num::index(first)]
    }

    /// Joins rows to parts of at most `room` kernels; `None` where a row has more.
    fn joined(&self, count: u32, room: u32) -> Option<Vec<[u32; 2]>> {
        let mut parts: Vec<[u32; 2]> = Vec::new();
        for row in 0..count {
            let own = [row, row + 1];
            if self.within(own) > room {
                return None;
            }
            match parts.last_mut() {
                Some(last) if self.within([last[0], row + 1]) <= room => last[1] = row + 1,
                _ => parts.push(own),
            }
        }
        Some(parts)
    }

    /// Returns the least room with which at most so many parts suffice; that of the fullest row where none does.
    fn least_room(&self, count: u32, parts: u32) -> u32 {
        let (mut low, mut high) = (0, self.within([0, count]));
        while low < high {
            let room = low + (high - low) / 2;
            match self.joined(count, room) {
                Some(joined) if num::count(joined.len()) <= parts => high = room,
                _ => low = room + 1,
            }
        }
        (0..count).map(|row| self.within([row, row + 1])).fold(low, u32::max)
    }
}

impl SplatParts {
    /// Makes buffers for a part of the kernels of a view, which is cut into at most `parts`, or into its rows of tiles.
    pub(super) fn new(
        gpu: &Gpu,
        set: &Arc<SplatSet>,
        push: &SplatViewPush,
        [width, height]: [u32; 2],
        parts: u32,
    ) -> Result<Self> {
        let tiles = [width, height].map(|side| side.div_ceil(TILE));
        let rows = rows_of(set, push, tiles[1]);
        let reached = Reached::new(&rows, tiles[1]);
        let least = reached.least_room(tiles[1], parts);
        // The widest list holds records or shapes.
        let widest = 16 * num::wide(set.entries().into_iter().fold(2, usize::max));
        let most = (gpu.most_buffer_bytes() / widest).min(MOST_PAIRS.into());
        if u64::from(least) > most {
            let object = format!("a buffer of {least} kernels, of which {most} fit,");
            let [needed, available] = [least.into(), most].map(|n: u64| widest * n);
            return Err(Error::Memory { object, needed, available, budget: gpu.memory_budget() });
        }
        // Nearby views need a little more.
        let room = with_margin(least).min(set.count.max(1)).min(u32::try_from(most).unwrap_or(MOST_PAIRS));
        let bytes = set.entries().map(|each| 16 * num::wide(each) * u64::from(room));
        let held = PartBuffers::new(gpu, &[("splats.points", bytes[0]), ("splats.shapes", bytes[1])])?;
        let (set, most_bands) = (Arc::clone(set), [usize::MAX; 2]);
        let mut own = Self { set, held, room, most_bands, wanted: parts, tiles, rows, parts: Vec::new() };
        own.parts = own.parts_of(&reached).unwrap_or_default();
        Ok(own)
    }

    fn parts_of(&self, reached: &Reached) -> Option<Vec<Part>> {
        let [across, count] = self.tiles;
        let part = |rows: [u32; 2]| {
            let band = Band { first: rows[0] * across, tiles: (rows[1] - rows[0]) * across };
            Part { rows, kernels: reached.within(rows), bands: vec![band] }
        };
        let room = reached.least_room(count, self.wanted).min(self.room);
        Some(reached.joined(count, room)?.into_iter().map(part).collect())
    }

    /// Changes to another view. Returns `false`, and has the parts of the last one, where a row of tiles has more kernels than there is room for,
    /// the view takes more bands than there may be, or a recording reads the part that frames begin with. `bands` are those of the first view:
    /// bins have room for none that is wider.
    pub(super) fn set_view(&mut self, push: &SplatViewPush, bands: &[Band]) -> bool {
        let rows = rows_of(&self.set, push, self.tiles[1]);
        let Some(mut parts) = self.parts_of(&Reached::new(&rows, self.tiles[1])) else { return false };
        let widest = bands.iter().map(|band| band.tiles).max().unwrap_or(1);
        for part in &mut parts {
            part.bands = Band::cut(part.rows.map(|row| row * self.tiles[0]), widest).collect();
        }
        let [of_part, of_all] = self.most_bands;
        let of = |part: &Part| part.bands.len();
        if parts.iter().any(|part| of(part) > of_part) || parts.iter().map(of).sum::<usize>() > of_all {
            return false;
        }
        let before = std::mem::replace(&mut self.parts, parts);
        let rows = std::mem::replace(&mut self.rows, rows);
        self.held.forget();
        if self.stage(0, true) {
            return true;
        }
        (self.parts, self.rows) = (before, rows);
        false
    }

    /// Returns the lists of points and shapes of a part.
    pub(super) fn buffers(&self) -> [Arc<Buffer>; 2] {
        [0, 1].map(|i| Arc::clone(&self.held.buffers[i]))
    }

    /// Returns the most bands of a part, and of all, that a view may have.
    pub(super) fn most_bands(&self) -> [usize; 2] {
        self.most_bands
    }

    /// Returns bands of at most `widest` tiles that hold what a part does not draw.
    pub(super) fn rest(&self, part: usize, widest: u32) -> Vec<Band> {
        let [across, down] = self.tiles;
        let [first, end] = self.parts[part].rows.map(|row| row * across);
        let others = [[0, first], [end, across * down]];
        others.into_iter().flat_map(|tiles| Band::cut(tiles, widest)).collect()
    }

    /// Returns the number of the first band of a part among those of all.
    pub(super) fn first_band(&self, part: usize) -> usize {
        self.parts[..part].iter().map(|part| part.bands.len()).sum()
    }

    /// Finds the bands of each part: `measure` draws one into bins that hold nothing, after what uploads it. Returns all bands, the capacity that
    /// the fullest needs, and the longest bin.
    pub(super) fn measure(
        &mut self,
        push: &SplatViewPush,
        measure: impl Fn(&dyn Fn(&mut Recorder<'_>), &SplatViewPush) -> Result<Fill>,
        bands_of: impl Fn(&Fill) -> Result<(Vec<Band>, u32)>,
    ) -> Result<(Vec<Band>, u32, u32)> {
        let (mut all, mut capacity, mut longest) = (Vec::new(), 0, 0);
        for part in (0..self.parts.len()).rev() {
            // The first comes last, and stays where frames begin.
            if !self.stage(part, part == 0) {
                return Err(Error::invalid(
                    "splats in parts",
                    "a recording reads the memory of the next part",
                ));
            }
            let fill = measure(&|recorder| self.record(recorder, part == 0), &self.project(part, push))?;
            let [first, end] = self.parts[part].rows.map(|row| row * self.tiles[0]);
            let own = Fill { tiles: fill.tiles[num::index(first)..num::index(end)].to_vec() };
            let (bands, fullest) = bands_of(&own)?;
            let bands: Vec<Band> =
                bands.iter().map(|band| Band { first: first + band.first, ..*band }).collect();
            (capacity, longest) = (capacity.max(fullest), longest.max(own.longest()));
            all.extend(bands.iter().copied());
            self.parts[part].bands = bands;
        }
        // Another view may have other parts, more and higher ones.
        let most = self.parts.iter().map(|part| part.bands.len()).max().unwrap_or(1);
        self.most_bands = [most + 2, 2 * all.len() + 2];
        Ok((all, capacity, longest))
    }

    /// Returns the push constants of the pass that projects the kernels of a part.
    pub(super) fn project(&self, part: usize, push: &SplatViewPush) -> SplatViewPush {
        SplatViewPush { count: self.parts[part].kernels, room: self.room, ..*push }
    }

    /// Writes the kernels of a part where the host does ([`PartBuffers::stage`]).
    pub(super) fn stage(&mut self, part: usize, begins: bool) -> bool {
        let Self { set, held, rows, parts, .. } = self;
        let [first, end] = parts[part].rows;
        held.stage(num::count(part), begins, |bytes| {
            let reaches = |i: &u32| {
                let [own_first, own_end] = rows[num::index(*i)].map(u32::from);
                own_first < own_end && own_first < end && first < own_end
            };
            let chosen: Vec<u32> = (0..set.count).into_par_iter().filter(reaches).collect();
            for ((bytes, list), each) in bytes.into_iter().zip(set.on_host()).zip(set.entries()) {
                if each > 0 {
                    let copy = |(bytes, &i): (&mut [u8], &u32)| {
                        let entries = &list[num::index(i) * each..][..each];
                        bytes.copy_from_slice(bytemuck::cast_slice(entries));
                    };
                    bytes.par_chunks_exact_mut(16 * each).zip(&chosen).for_each(copy);
                }
            }
        })
    }

    /// Records the upload of the staged part.
    pub(super) fn record(&self, recorder: &mut Recorder<'_>, begins: bool) {
        self.held.record(recorder, begins);
    }
}

/// Returns the first row of tiles that each kernel may reach, and the one after the last; equal ones where it reaches none.
fn rows_of(set: &SplatSet, push: &SplatViewPush, count: u32) -> Vec<[u16; 2]> {
    let [points, shapes] = set.on_host();
    let [each, _] = set.entries();
    // A kernel lies within so many lengths of its own.
    let product = set.shape == Shape::Alike && set.kernels.kernel != Kernel::Gaussian;
    let lengths = f64::from(push.cut) * if product { 3.0_f64.sqrt() } else { 1.0 };
    let radius = |i: usize, inverse: f32| match set.shape {
        Shape::Alike => lengths,
        Shape::Radii => lengths / f64::from(inverse),
        Shape::Covariances => {
            let [[xx, _, _, yy], [_, zz, ..]] = [shapes[4 * i + 2], shapes[4 * i + 3]];
            lengths * (f64::from(xx) + f64::from(yy) + f64::from(zz)).sqrt()
        }
    };
    let rows = |(i, entry): (usize, &[[f32; 4]])| {
        let [x, y, z, w] = entry[0];
        let at =
            |row: [f32; 4]| [x, y, z].iter().zip(row).map(|(p, r)| f64::from(*p) * f64::from(r)).sum::<f64>();
        rows_of_sphere(push, [at(push.up) + f64::from(push.up[3]), at(push.forward)], radius(i, w), count)
    };
    points.par_chunks_exact(each).enumerate().map(rows).collect()
}

/// Returns the rows of tiles that a sphere may reach; `y` and `z` are those of its centre in the view, as in `splat-project.glsl`.
fn rows_of_sphere(push: &SplatViewPush, [y, z]: [f64; 2], radius: f64, count: u32) -> [u16; 2] {
    let all = [0, u16::try_from(count).unwrap_or(u16::MAX)];
    let dot = |a: [f32; 4], b: [f32; 4]| (0..3).map(|i| f64::from(a[i]) * f64::from(b[i])).sum::<f64>();
    let squared = radius * radius;
    let (yy, yz, zz) = (dot(push.up, push.up), dot(push.up, push.forward), dot(push.forward, push.forward));
    let [w0, w1] = [push.w0, push.w1].map(f64::from);
    let (w, reach) = (w0 + w1 * z, radius * zz.sqrt());
    if z + 1.001 * reach + 1e-4 < f64::from(push.forward[3]) {
        return [0; 2];
    }
    // Least and greatest y / w of the sphere, which lies before the eye.
    let before = w / w1.abs().max(1e-30);
    let is_far = before > NEAR * reach;
    if !is_far {
        return all;
    }
    let (a, b, c) = (w * w - w1 * w1 * zz * squared, y * w - w1 * yz * squared, y * y - yy * squared);
    let root = (b * b - a * c).max(0.0).sqrt();
    let half = WIDER * root / a;
    let pixel = f64::from(push.pixel);
    let margin = MARGIN + f64::from(push.cut) * f64::from(push.lowpass).sqrt() + ROUNDING / (w.abs() * pixel);
    let [low, high] = [b / a + half, b / a - half].map(|at| f64::from(push.half_extent[1]) - at / pixel);
    let tile = |at: f64| num::u32_of((at / f64::from(TILE)).floor().clamp(-1.0, f64::from(count)) + 1.0);
    let [first, end] = [tile(low - margin).saturating_sub(1), tile(high + margin)];
    [first, end.min(count)].map(|row| u16::try_from(row).unwrap_or(u16::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parts hold the rows once, and no part more kernels than it has room for.
    #[test]
    fn rows_are_joined_within_their_room() {
        let rows: Vec<[u16; 2]> = (0..500_u16)
            .map(|i| [i * 7 % 40, (i * 7 % 40 + 1 + i % 5).min(40)])
            .chain([[3, 3], [0, 40]])
            .collect();
        let reached = Reached::new(&rows, 40);
        let reach = |[first, end]: [u32; 2]| {
            let meets = |[a, b]: &&[u16; 2]| a < b && u32::from(*a) < end && first < u32::from(*b);
            num::count(rows.iter().filter(meets).count())
        };
        assert_eq!(reached.within([0, 40]), 501);
        for parts in [1, 2, 3, 7, 100] {
            let room = reached.least_room(40, parts);
            let joined = reached.joined(40, room).unwrap();
            assert!(num::count(joined.len()) <= parts.max(1) || parts > 40);
            assert_eq!(joined.iter().map(|[first, end]| end - first).sum::<u32>(), 40);
            for part in joined {
                assert_eq!(reached.within(part), reach(part));
                assert!(reach(part) <= room);
            }
        }
        assert!(reached.joined(40, reached.least_room(40, 100) - 1).is_none());
    }
}
