//! Bins: the primitives of each tile of an image, in order of rank (`glsl/primitives/bins.glsl`).
//!
//! Three passes: count, prefix sums, write. They need no sort by tile: each invocation bins a run of consecutive ranks, and the
//! table of counts has the runs of a tile side by side.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::shader::{self, BINS_COMPUTE, TILE};
use crate::gpu::{Buffer, Commands, Gpu, Recorder};
use crate::interface::BinsPush;
use crate::num;
use crate::primitives::dispatch::{Dispatch, buffer, download, pass, words};
use crate::primitives::scan::{Scan, WorkSplit};

/// The bins of a range of tiles.
#[derive(Debug)]
pub(crate) struct Bins {
    pub(crate) runs: u32,
    pub(crate) capacity: u32,
    pub(crate) tiles: u32,
    pub(crate) table: Arc<Buffer>,
    pub(crate) entries: Arc<Buffer>,
    count: Dispatch,
    scan: Scan,
    fill: Dispatch,
}

impl Bins {
    /// Makes bins for up to `tiles` tiles at a time, with a capacity of `capacity` entries. `primitives` are the order by
    /// rank, the pixel box of each primitive, and the status. With `flagged` the passes end at once in frames that have flagged
    /// no pixel.
    pub(crate) fn new(
        gpu: &Gpu,
        name: &str,
        primitives: [&Arc<Buffer>; 3],
        tiles: u32,
        runs: u32,
        capacity: u32,
        flagged: bool,
    ) -> Result<Self> {
        let [order, boxes, status] = primitives;
        let table = buffer(gpu, "bins.table", u64::from(tiles) * u64::from(runs))?;
        let entries = buffer(gpu, "bins", capacity.into())?;
        let pass = |part: &str, fill: bool| {
            let inputs = shader::Bins {
                order: order.read(),
                boxes: boxes.read(),
                bin_table: table.write(),
                bins: entries.write(),
                status: status.write(),
                fill,
                flagged,
            };
            pass(gpu, &format!("{name}.bins.{part}"), &BINS_COMPUTE.with(&inputs))
        };
        Ok(Self {
            runs,
            capacity,
            tiles,
            count: pass("count", false)?,
            scan: Scan::new(gpu, &format!("{name}.bins"), &table, tiles * runs, WorkSplit::of(gpu))?,
            fill: pass("fill", true)?,
            table,
            entries,
        })
    }

    /// Records the passes that bin `count` primitives to tiles `[first, first + tiles)` of an image with `across` tiles in a
    /// row.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        across: u32,
        [first, tiles]: [u32; 2],
        count: u32,
    ) {
        recorder.clear_buffer("bins.clear", &self.table);
        let number = count.div_ceil(self.runs);
        let (runs, capacity) = (self.runs, self.capacity);
        let push = BinsPush { across, first, tiles, count, number, runs, capacity };
        let groups = [self.runs.div_ceil(8), 1, 1];
        self.count.record(recorder, &push, groups);
        self.scan.record(recorder);
        self.fill.record(recorder, &push, groups);
    }

    /// Returns the buffer with the number of all entries, in 64 bits.
    pub(crate) fn total(&self) -> &Arc<Buffer> {
        self.scan.total()
    }
}

/// The measured needs of binning.
#[derive(Debug)]
pub(crate) struct Fill {
    /// Number of runs of ranks: enough to keep the device busy, each short enough for the limit of loop iterations.
    pub(crate) runs: u32,
    /// Number of primitives in each tile.
    pub(crate) tiles: Vec<u32>,
}

impl Fill {
    /// Returns the number of entries in all bins.
    pub(crate) fn entries(&self) -> u64 {
        self.tiles.iter().map(|&n| u64::from(n)).sum()
    }

    /// Returns the number of entries in the fullest bin.
    pub(crate) fn longest(&self) -> u32 {
        self.tiles.iter().copied().max().unwrap_or(0)
    }

    /// Runs the passes that `stage` records, reads their results back, and counts. The results are the order of `count`
    /// primitives and the pixel box of each.
    pub(crate) fn measure(
        gpu: &Gpu,
        name: &str,
        [order, boxes]: [&Arc<Buffer>; 2],
        count: u32,
        [tiles, across]: [u32; 2],
        stage: impl FnOnce(&mut Recorder<'_>),
    ) -> Result<Self> {
        let mut commands = Commands::new(gpu)?;
        let host_boxes = download(gpu, "boxes", 8 * u64::from(count))?;
        let host_order = download(gpu, "order", 4 * u64::from(count))?;
        let keep = {
            let mut recorder = Recorder::new(gpu, commands.begin()?, None);
            stage(&mut recorder);
            recorder.copy_buffer("boxes", boxes, &host_boxes, host_boxes.size().min(boxes.size()));
            recorder.copy_buffer("order", order, &host_order, host_order.size());
            recorder.release_to_host(&host_boxes);
            recorder.release_to_host(&host_order);
            recorder.finish()?.1
        };
        commands.submit(keep, name)?;
        let boxes = words(&host_boxes.host_copy()?);
        let mut order = words(&host_order.host_copy()?);
        order.truncate(num::index(count));
        let runs = if gpu.emulates_groups() { 64 } else { 2048 };
        Ok(Self::of(&order, &boxes, [tiles, across], runs, gpu.turns()?))
    }

    /// Counts entries of tiles and iterations of runs, from the primitives by rank and the pixel box of each: about `runs` runs, more where
    /// one would take more than half of `turns` iterations.
    fn of(order: &[u32], boxes: &[u32], [tiles, across]: [u32; 2], runs: u32, turns: u32) -> Self {
        // Iterations of the binning loop up to each rank, and entries of each tile.
        let tile_box = |id: u32| {
            let at = num::index(id) * 2;
            let (x, y) = (boxes[at], boxes[at + 1]);
            [(x & 0xffff) / TILE, (x >> 16).div_ceil(TILE), (y & 0xffff) / TILE, (y >> 16).div_ceil(TILE)]
        };
        let mut iterations = vec![0_u64; order.len() + 1];
        let mut fill = vec![0_u32; num::index(tiles)];
        for (rank, &id) in order.iter().enumerate() {
            let [x0, x1, y0, y1] = tile_box(id);
            let covered = x1.saturating_sub(x0) * y1.saturating_sub(y0);
            iterations[rank + 1] = iterations[rank] + 1 + u64::from(covered);
            for y in y0..y1 {
                for x in x0..x1 {
                    fill[num::index(y * across + x)] += 1;
                }
            }
        }
        let longest = |runs: u32| {
            let length = num::index(num::count(order.len()).div_ceil(runs)).max(1);
            (0..order.len())
                .step_by(length)
                .map(|begin| iterations[(begin + length).min(order.len())] - iterations[begin])
                .max()
                .unwrap_or(0)
        };
        // The table has one word for each run of each tile.
        let most_runs = ((1_u32 << 26) / tiles.max(1)).max(1);
        let few = num::count(order.len()).div_ceil(8).next_power_of_two();
        let mut runs = runs.min(few).min(most_runs);
        while longest(runs) > u64::from(turns / 2) && runs < most_runs {
            runs *= 2;
        }
        Self { runs, tiles: fill }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tables of large images fit a scan, and few primitives need only a small table.
    #[test]
    fn tables_stay_small() {
        let boxes = |count: u32| -> Vec<u32> { (0..count).flat_map(|_| [8 << 16, 8 << 16]).collect() };
        for (tiles, across, count) in [(129_600, 480, 12), (129_600, 480, 1_000_000), (16_777_216, 4096, 12)]
        {
            let order: Vec<u32> = (0..count).collect();
            for runs in [64, 2048] {
                let fill = Fill::of(&order, &boxes(count), [tiles, across], runs, 60_000);
                let words = u64::from(fill.runs) * u64::from(tiles);
                assert!(fill.runs >= 1 && words <= 1 << 26, "{tiles} tiles, {count}: {}", fill.runs);
                assert!(count > 12 || fill.runs <= 2, "{}", fill.runs);
                assert_eq!((fill.entries(), fill.longest()), (u64::from(count), count));
            }
        }
    }
}
