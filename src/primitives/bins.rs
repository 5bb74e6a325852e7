//! Bins: the primitives of each tile of an image, in order of rank (`glsl/primitives/bins.glsl`).
//!
//! Pairs of a tile and a primitive are emitted in order of rank and sorted by tile. The sort is stable, so that each tile has its
//! primitives by rank.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::gpu::shader::{
    BIN_PAIRS, BINS_COUNT, BINS_EMIT, BINS_ENDS, BinsCount, BinsEmit, BinsEnds, HIT_PAIRS,
};
use crate::gpu::{Buffer, Commands, Gpu, Recorder};
use crate::interface::BinsPush;
use crate::num;
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass, total, words};
use crate::primitives::radix_sort::{MOST_PAIRS, RadixSort};
use crate::primitives::scan::{Scan, WorkSplit};

/// Primitives by rank, the box of pixels of each, the status, and two buffers that are free once the primitives are ranked.
#[derive(Clone, Debug)]
pub(crate) struct Ranked {
    pub(crate) order: Arc<Buffer>,
    pub(crate) boxes: Arc<Buffer>,
    pub(crate) status: Arc<Buffer>,
    /// A word for each primitive.
    pub(crate) keys: Arc<Buffer>,
    pub(crate) scratch: Arc<Buffer>,
    pub(crate) count: u32,
}

/// The passes that count and emit pairs.
#[derive(Debug)]
struct Pairs {
    count: Dispatch,
    scan: Scan,
    emit: Dispatch,
}

impl Pairs {
    /// Makes the passes that emit pairs of `tiles` and `bins`, or with `fill` off count the pairs of each tile in `tiles`.
    fn new(
        gpu: &Gpu,
        name: &str,
        ranked: &Ranked,
        [tiles, bins]: [&Arc<Buffer>; 2],
        fill: bool,
        marked: Option<&Arc<Buffer>>,
    ) -> Result<Self> {
        let offsets = &ranked.keys;
        let boxes = match &ranked.scratch {
            scratch if scratch.size() >= 8 * u64::from(ranked.count.max(1)) => Arc::clone(scratch),
            _ => buffer(gpu, "boxes.ranked", 2 * u64::from(ranked.count))?,
        };
        let count = BINS_COUNT.with(&BinsCount {
            order: ranked.order.read(),
            boxes: ranked.boxes.read(),
            bin_offsets: offsets.write(),
            ranked_boxes: boxes.write(),
            // A binding must hold something.
            marked: marked.unwrap_or(&ranked.boxes).read(),
            flagged: marked.is_some(),
        });
        let scan = Scan::new(gpu, &format!("{name}.bins"), offsets, ranked.count, WorkSplit::of(gpu))?;
        let emit = BINS_EMIT.with(&BinsEmit {
            order: ranked.order.read(),
            ranked_boxes: boxes.read(),
            bin_offsets: offsets.read(),
            scan_total: scan.total().read(),
            bin_tiles: tiles.write(),
            bins: bins.write(),
            fill,
        });
        let count = pass(gpu, &format!("{name}.bins.count"), &count)?;
        Ok(Self { count, scan, emit: pass(gpu, &format!("{name}.bins.emit"), &emit)? })
    }

    fn record_count(&self, recorder: &mut Recorder<'_>, push: &BinsPush) {
        self.count.record(recorder, push, groups_of(push.count, 64));
        self.scan.record(recorder);
    }

    fn record_emit(&self, recorder: &mut Recorder<'_>, push: &BinsPush) {
        self.emit.record(recorder, push, groups_of(push.capacity.div_ceil(BIN_PAIRS), 64));
    }
}

/// The bins of a range of tiles.
#[derive(Debug)]
pub(crate) struct Bins {
    pub(crate) capacity: u32,
    /// Where the bin of each tile ends.
    pub(crate) ends: Arc<Buffer>,
    pub(crate) entries: Arc<Buffer>,
    /// Tile of each entry.
    pub(crate) of_pairs: Arc<Buffer>,
    /// The pixels of each tile whose primitives are needed, a bit each; without it all are.
    pub(crate) marked: Option<Arc<Buffer>>,
    count: u32,
    pairs: Pairs,
    sort: RadixSort,
    end: Dispatch,
}

impl Bins {
    /// Makes bins for up to `tiles` tiles at a time, with a capacity of `capacity` entries. With `flagged` they hold only primitives whose
    /// box contains a marked pixel.
    ///
    /// # Errors
    ///
    /// Those of memory and of Vulkan. The bins, their sort included, take 16 bytes an entry, and 24 where the sort
    /// takes more than two digits.
    pub(crate) fn new(
        gpu: &Gpu,
        name: &str,
        ranked: &Ranked,
        tiles: u32,
        capacity: u32,
        flagged: bool,
    ) -> Result<Self> {
        let of_pairs = buffer(gpu, "bins.tiles", capacity.into())?;
        let entries = buffer(gpu, "bins", capacity.into())?;
        let ends = buffer(gpu, "bins.ends", tiles.into())?;
        let marked = flagged.then(|| buffer(gpu, "bins.marked", 2 * u64::from(tiles))).transpose()?;
        let pairs = Pairs::new(gpu, name, ranked, [&of_pairs, &entries], true, marked.as_ref())?;
        let bits = (u32::BITS - tiles.saturating_sub(1).leading_zeros()).max(1);
        let sort = RadixSort::counted(
            gpu,
            &format!("{name}.bins.sort"),
            [&of_pairs, &entries],
            pairs.scan.total(),
            capacity,
            bits,
        )?;
        let end = BINS_ENDS.with(&BinsEnds {
            scan_total: pairs.scan.total().read(),
            bin_tiles: of_pairs.read(),
            bin_ends: ends.write(),
            status: ranked.status.write(),
        });
        let end = pass(gpu, &format!("{name}.bins.ends"), &end)?;
        Ok(Self { capacity, ends, entries, of_pairs, marked, count: ranked.count, pairs, sort, end })
    }

    /// Records the passes that bin the primitives to tiles `[first, first + tiles)` of an image with `across` tiles in a row.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, across: u32, [first, tiles]: [u32; 2]) {
        let push = BinsPush { across, first, tiles, count: self.count, capacity: self.capacity };
        self.pairs.record_count(recorder, &push);
        self.pairs.record_emit(recorder, &push);
        self.sort.record(recorder);
        self.end.record(recorder, &push, groups_of(tiles, 64));
    }

    /// Returns a buffer that a frame may use after the bins are made.
    pub(crate) fn scratch(&self) -> &Arc<Buffer> {
        &self.sort.scratch
    }

    /// Returns the buffer with the number of all entries, in 64 bits.
    pub(crate) fn total(&self) -> &Arc<Buffer> {
        self.pairs.scan.total()
    }
}

/// The number of primitives in each tile.
#[derive(Debug)]
pub(crate) struct Fill {
    pub(crate) tiles: Vec<u32>,
}

impl Fill {
    /// Returns the number of entries in the fullest bin.
    pub(crate) fn longest(&self) -> u32 {
        self.tiles.iter().copied().max().unwrap_or(0)
    }

    /// Runs the passes that `stage` records, which rank primitives, and counts the entries of each tile on the device.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] for 2^32 entries or more; errors of memory and of Vulkan.
    pub(crate) fn measure(
        gpu: &Gpu,
        name: &str,
        ranked: &Ranked,
        [tiles, across]: [u32; 2],
        stage: impl FnOnce(&mut Recorder<'_>),
    ) -> Result<Self> {
        let mut commands = Commands::new(gpu)?;
        let counts = buffer(gpu, "bins.counts", tiles.into())?;
        let pairs = Pairs::new(gpu, name, ranked, [&counts, &counts], false, None)?;
        let push = BinsPush { across, first: 0, tiles, count: ranked.count, capacity: 0 };
        let entries = download(gpu, "bins.total", 8)?;
        commands.run(name, |recorder| {
            stage(recorder);
            pairs.record_count(recorder, &push);
            recorder.copy_buffer("bins.total", pairs.scan.total(), &entries, 8);
            recorder.release_to_host(&entries);
        })?;
        let entries = total(&entries)?;
        let Ok(capacity) = u32::try_from(entries) else {
            return Err(Error::unsupported(
                format!("{name} of this view"),
                format!("{entries} pairs of a tile and a primitive"),
            ));
        };
        let host = download(gpu, "bins.counts", 4 * u64::from(tiles))?;
        commands.run(name, |recorder| {
            recorder.clear_buffer("bins.clear", &counts);
            pairs.record_emit(recorder, &BinsPush { capacity, ..push });
            recorder.copy_buffer("bins.counts", &counts, &host, host.size());
            recorder.release_to_host(&host);
        })?;
        let mut tiles = words(&host.host_copy()?);
        tiles.truncate(num::index(push.tiles));
        Ok(Self { tiles })
    }
}

/// Largest number of entries of bins, with room for the margin of nearby views: more cannot be sorted.
pub(crate) const MOST_ENTRIES: u32 = MOST_PAIRS / 5 * 4 - 64;

/// Adds a quarter and at least 64 entries, so that nearby views need no larger buffers. The sum is a multiple of HIT_PAIRS where it fits.
pub(crate) fn with_margin(need: u32) -> u32 {
    let more = need.saturating_add(need / 4).saturating_add(64);
    more.checked_next_multiple_of(HIT_PAIRS).unwrap_or(more)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::shader::{STATUS_LONGEST_BIN, STATUS_WORDS, TILE};
    use crate::gpu::testing::TestGpu;

    /// Boxes of every kind: none, a pixel, whole rows, the whole image.
    fn boxes(count: u32, [width, height]: [u32; 2]) -> Vec<[u32; 4]> {
        let mut state = 7_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        let one = |i: u32| match i % 7 {
            0 => [0; 4],
            1 => [0, width, 0, height],
            2 => [0, width, random(height), height],
            _ => {
                let (x, y) = (random(width), random(height));
                [x, (x + 1 + random(20)).min(width), y, (y + 1 + random(20)).min(height)]
            }
        };
        (0..count).map(one).collect()
    }

    /// The bins that the device should make, tile by tile.
    fn expected(
        order: &[u32],
        boxes: &[[u32; 4]],
        across: u32,
        tiles: std::ops::Range<u32>,
    ) -> Vec<Vec<u32>> {
        let touches = |id: u32, tile: u32| {
            let [x0, x1, y0, y1] = boxes[num::index(id)];
            let [x, y] = [tile % across, tile / across];
            x >= x0 / TILE && x < x1.div_ceil(TILE) && y >= y0 / TILE && y < y1.div_ceil(TILE)
        };
        tiles.map(|tile| order.iter().copied().filter(|&id| touches(id, tile)).collect()).collect()
    }

    fn ranked(gpu: &TestGpu, order: &[u32], boxes: &[[u32; 4]]) -> Ranked {
        let packed: Vec<u32> = boxes.iter().flat_map(|b| [b[0] | b[1] << 16, b[2] | b[3] << 16]).collect();
        Ranked {
            order: gpu.upload(order),
            boxes: gpu.upload(&packed),
            status: gpu.upload(&vec![0; num::index(STATUS_WORDS)]),
            keys: gpu.upload(&vec![0; order.len()]),
            scratch: gpu.upload(&[0]),
            count: num::count(order.len()),
        }
    }

    #[test]
    fn bins_are_those_of_the_host() {
        let gpu = TestGpu::new();
        let (extent, across) = ([100, 52], 13);
        for count in [1, 2, 63, 700] {
            let boxes = boxes(count, extent);
            let order: Vec<u32> = (0..count).rev().collect();
            let ranked = ranked(&gpu, &order, &boxes);
            let all = expected(&order, &boxes, across, 0..91);
            let fill = Fill::measure(&gpu, "test", &ranked, [91, across], |_| ()).unwrap();
            assert_eq!(fill.tiles, all.iter().map(|bin| num::count(bin.len())).collect::<Vec<_>>());
            let capacity = num::count(all.iter().map(Vec::len).sum::<usize>()).max(1);
            let bins = Bins::new(&gpu, "test", &ranked, 91, capacity, false).unwrap();
            // Bands begin and end anywhere in a row.
            for [first, tiles] in [[0, 91], [0, 1], [5, 3], [5, 30], [20, 45], [90, 1]] {
                gpu.record(|recorder| bins.record(recorder, across, [first, tiles]));
                let wanted = &all[num::index(first)..num::index(first + tiles)];
                let (ends, entries) = (gpu.download(&bins.ends), gpu.download(&bins.entries));
                let mut begin = 0;
                for (tile, bin) in wanted.iter().enumerate() {
                    let end = num::index(ends[tile]);
                    assert_eq!(&entries[begin..end], bin, "{count} primitives, tile {tile} from {first}");
                    begin = end;
                }
                assert_eq!(gpu.download(bins.total())[0], num::count(begin));
            }
            let status = gpu.download(&ranked.status);
            assert_eq!(status[num::index(STATUS_LONGEST_BIN)], fill.longest());
        }
    }

    /// A primitive whose box contains a marked pixel of the band is in all its tiles; others are in none.
    #[test]
    fn bins_with_marks_hold_what_contains_a_marked_pixel() {
        let gpu = TestGpu::new();
        let (extent, across) = ([100, 52], 13);
        let boxes = boxes(700, extent);
        let order: Vec<u32> = (0..700).collect();
        let ranked = ranked(&gpu, &order, &boxes);
        let all = expected(&order, &boxes, across, 0..91);
        let capacity = num::count(all.iter().map(Vec::len).sum::<usize>());
        let bins = Bins::new(&gpu, "test", &ranked, 91, capacity, true).unwrap();
        let bands = [([0, 91], vec![[37, 12], [64, 39], [65, 40]]), ([5, 30], vec![[40, 0], [66, 23]])];
        for ([first, tiles], marks) in bands.into_iter().chain([([20, 45], vec![])]) {
            let mut words = vec![0; num::index(2 * tiles)];
            for [x, y] in &marks {
                let (tile, bit) = (y / TILE * across + x / TILE - first, y % TILE * TILE + x % TILE);
                words[num::index(2 * tile + bit / 32)] |= 1 << (bit % 32);
            }
            let marked = gpu.upload(&words);
            gpu.record(|recorder| {
                let place = bins.marked.as_ref().unwrap();
                recorder.copy_buffer("marked", &marked, place, 8 * u64::from(tiles));
                bins.record(recorder, across, [first, tiles]);
            });
            let band = &all[num::index(first)..num::index(first + tiles)];
            let needed = |id: &u32| {
                let [x0, x1, y0, y1] = boxes[num::index(*id)];
                marks.iter().any(|[x, y]| (x0..x1).contains(x) && (y0..y1).contains(y))
            };
            let (ends, entries) = (gpu.download(&bins.ends), gpu.download(&bins.entries));
            let mut begin = 0;
            for (tile, bin) in band.iter().enumerate() {
                let end = num::index(ends[tile]);
                let wanted: Vec<u32> = bin.iter().copied().filter(needed).collect();
                assert_eq!(entries[begin..end], wanted, "tile {tile} from {first}");
                begin = end;
            }
            assert!(begin < num::index(capacity) && (begin > 0) != marks.is_empty(), "{begin}");
        }
    }

    /// What has no room is counted, and what has keeps its place.
    #[test]
    fn bins_that_are_too_small_hold_the_first_ranks() {
        let gpu = TestGpu::new();
        let boxes = vec![[0, 16, 0, 8]; 10];
        let order: Vec<u32> = (0..10).collect();
        let bins = Bins::new(&gpu, "test", &ranked(&gpu, &order, &boxes), 2, 6, false).unwrap();
        gpu.record(|recorder| bins.record(recorder, 2, [0, 2]));
        assert_eq!(gpu.download(&bins.ends)[..2], [3, 6]);
        assert_eq!(gpu.download(&bins.entries)[..6], [0, 1, 2, 0, 1, 2]);
        assert_eq!(gpu.download(bins.total())[0], 20);
    }
}
