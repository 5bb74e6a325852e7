//! Exclusive prefix sums of words on the device (`glsl/primitives/scan.glsl`): reduce, then scan, in two dispatches for any number of
//! words. No workgroup waits for another.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::gpu::shader::{
    LANE_GROUP, SCAN_CHUNKS, SCAN_GROUP_TURNS, SCAN_GROUPS_REDUCE, SCAN_GROUPS_SCAN, SCAN_ITEMS,
    SCAN_LANE_WORDS, SCAN_LANES_REDUCE, SCAN_LANES_SCAN, ScanReduce, ScanScan, WIDE_GROUP,
};
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::interface::ScanPush;
use crate::primitives::dispatch::{Dispatch, buffer, pass};

/// Largest number of words of a scan.
const MOST_WORDS: u32 = 1 << 27;

/// Largest number of workgroups of a scan: enough to fill a device. Each adds up the sums of those before it.
const MOST_GROUPS: u32 = 1024;

/// The division of the input of prefix sums and sorts among invocations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WorkSplit {
    /// Each invocation handles a long run without barriers; with the number of invocations that keep the device busy.
    Lanes(u32),
    /// Each workgroup of [`WIDE_GROUP`] invocations handles a tile in shared memory.
    Groups,
}

impl WorkSplit {
    /// Returns the faster division for a device. Software rasterisers get lanes: they suspend every invocation of a workgroup
    /// at a barrier, and emulate shared memory.
    pub(crate) fn of(gpu: &Gpu) -> Self {
        let limits = gpu.limits();
        let wide = limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]);
        if !gpu.emulates_groups() && wide >= WIDE_GROUP {
            return Self::Groups;
        }
        if gpu.emulates_groups() { Self::software() } else { Self::Lanes(8192) }
    }

    /// Returns the division for a software rasteriser: two workgroups per core of this machine.
    pub(crate) fn software() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        Self::Lanes(crate::num::count(cores).clamp(1, 64) * 2 * LANE_GROUP)
    }
}

/// Prefix sums of the words of one buffer, in place.
#[derive(Debug)]
pub(crate) struct Scan {
    passes: [Dispatch; 2],
    total: Arc<Buffer>,
    push: ScanPush,
    groups: u32,
}

impl Scan {
    /// Makes prefix sums of the first `n` words of a buffer.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when the buffer has fewer words, or `n` exceeds [`MOST_WORDS`]; errors of memory and of Vulkan.
    pub(crate) fn new(gpu: &Gpu, name: &str, data: &Arc<Buffer>, n: u32, split: WorkSplit) -> Result<Self> {
        if n > MOST_WORDS || 4 * u64::from(n) > data.size() {
            return Err(Error::invalid(name, format!("prefix sums of {n} words in {} bytes", data.size())));
        }
        let (chunk, reduce, scan) = match split {
            WorkSplit::Lanes(lanes) => {
                let chunk = n.div_ceil(lanes.clamp(1, SCAN_CHUNKS)).clamp(1, SCAN_LANE_WORDS);
                (chunk, SCAN_LANES_REDUCE, SCAN_LANES_SCAN)
            }
            WorkSplit::Groups => {
                let tile = WIDE_GROUP * SCAN_ITEMS;
                let tiles = n.div_ceil(tile).div_ceil(MOST_GROUPS).clamp(1, SCAN_GROUP_TURNS);
                (tiles * tile, SCAN_GROUPS_REDUCE, SCAN_GROUPS_SCAN)
            }
        };
        // One chunk at least: the total is also written for no words.
        let chunks = n.div_ceil(chunk).max(1);
        let sums = buffer(gpu, &format!("{name}.sums"), 2 * u64::from(chunks))?;
        let total = buffer(gpu, &format!("{name}.total"), 2)?;
        let reduce = reduce.with(&ScanReduce { scan_words: data.read(), scan_sums: sums.write() });
        let scan = scan.with(&ScanScan {
            scan_words: data.write(),
            scan_sums: sums.read(),
            scan_total: total.write(),
        });
        let passes =
            [pass(gpu, &format!("{name}.reduce"), &reduce)?, pass(gpu, &format!("{name}.scan"), &scan)?];
        let groups = match split {
            WorkSplit::Lanes(_) => chunks.div_ceil(LANE_GROUP),
            WorkSplit::Groups => chunks,
        };
        let push = ScanPush { count: n, chunk, chunks };
        Ok(Self { passes, total, push, groups })
    }

    /// Records the passes, which replace each word by the sum of those before it, modulo 2^32.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>) {
        for pass in &self.passes {
            pass.record(recorder, &self.push, [self.groups, 1, 1]);
        }
    }

    /// Returns the buffer with the 64-bit sum of all words, low half first. The high half is 0 unless prefix sums have
    /// wrapped.
    pub(crate) fn total(&self) -> &Arc<Buffer> {
        &self.total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::TestGpu;

    /// Both divisions, with few and with many lanes.
    const SPLITS: [WorkSplit; 3] = [WorkSplit::Lanes(16), WorkSplit::Lanes(1000), WorkSplit::Groups];

    fn random(n: usize, mut state: u64) -> Vec<u32> {
        let step = |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as u32
        };
        (0..n).map(step).collect()
    }

    fn check(gpu: &TestGpu, words: &[u32], split: WorkSplit) {
        let data = gpu.upload(words);
        let scan = Scan::new(gpu, "test.scan", &data, crate::num::count(words.len()), split).unwrap();
        gpu.record(|recorder| scan.record(recorder));
        let found = gpu.download(&data);
        let mut sum = 0_u64;
        for (i, &word) in words.iter().enumerate() {
            assert_eq!(u64::from(found[i]), sum & 0xffff_ffff, "word {i} of {}, {split:?}", words.len());
            sum += u64::from(word);
        }
        let total = gpu.download(scan.total());
        assert_eq!(u64::from(total[0]) | u64::from(total[1]) << 32, sum, "{} words, {split:?}", words.len());
    }

    #[test]
    fn prefix_sums_of_every_size_around_the_borders_of_chunks() {
        let gpu = TestGpu::new();
        for split in SPLITS {
            for n in [0, 1, 2, 7, 8, 9, 255, 256, 257, 2047, 2048, 2049, 4095, 4096, 4097, 65_537] {
                let words: Vec<u32> = random(n, n as u64).iter().map(|w| w % 1000).collect();
                check(&gpu, &words, split);
            }
            check(&gpu, &vec![0; 5000], split);
            check(&gpu, &vec![1; 5000], split);
        }
    }

    #[test]
    fn many_words_take_several_tiles_a_chunk() {
        let gpu = TestGpu::new();
        for split in SPLITS {
            // More than `MOST_GROUPS` tiles.
            check(&gpu, &random(2_200_003, 7).iter().map(|w| w % 1000).collect::<Vec<_>>(), split);
        }
    }

    #[test]
    #[ignore = "takes half a gigabyte"]
    fn as_many_words_as_every_device_shows() {
        let gpu = TestGpu::new();
        for split in SPLITS {
            check(&gpu, &random(1 << 25, 1), split);
        }
    }

    #[test]
    fn the_total_tells_that_the_sums_have_wrapped() {
        let gpu = TestGpu::new();
        for split in SPLITS {
            check(&gpu, &[u32::MAX], split);
            check(&gpu, &[u32::MAX, 1], split);
            check(&gpu, &vec![u32::MAX; 100_003], split);
            check(&gpu, &[&[0; 4096][..], &[1 << 31; 2], &[0; 4096]].concat(), split);
        }
    }

    #[test]
    fn words_behind_the_last_stay() {
        let gpu = TestGpu::new();
        for split in SPLITS {
            let data = gpu.upload(&[3; 5000]);
            let scan = Scan::new(&gpu, "test.scan", &data, 4999, split).unwrap();
            gpu.record(|recorder| scan.record(recorder));
            assert_eq!(gpu.download(&data)[4998..], [3 * 4998, 3], "{split:?}");
        }
    }

    #[test]
    fn more_words_than_the_buffer_has_are_refused() {
        let gpu = TestGpu::new();
        let data = gpu.upload(&[1, 2]);
        assert!(Scan::new(&gpu, "test.scan", &data, 3, WorkSplit::of(&gpu)).is_err());
        assert!(Scan::new(&gpu, "test.scan", &data, MOST_WORDS + 1, WorkSplit::of(&gpu)).is_err());
    }
}
