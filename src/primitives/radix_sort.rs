//! Stable radix sort of pairs of words on the device (`glsl/primitives/radix-sort.glsl`), least significant digit first. Each digit takes
//! a count, prefix sums and a scatter (Satish, Harris and Garland, IPDPS 2009). No workgroup waits for another, and the
//! result is deterministic.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::gpu::inputs::Entry;
use crate::gpu::shader::{
    LANE_GROUP, RADIX_SORT_FLOAT_KEYS, RADIX_SORT_GROUPS_COUNT, RADIX_SORT_GROUPS_SCATTER,
    RADIX_SORT_LANES_COUNT, RADIX_SORT_LANES_COUNT_MIXED, RADIX_SORT_LANES_SCATTER,
    RADIX_SORT_LANES_SCATTER_FIRST, RADIX_SORT_LANES_SCATTER_LAST, RADIX_SORT_LANES_SCATTER_MIXED,
    RadixSortCount, RadixSortFloatKeys, RadixSortLanesScatterFirst, RadixSortLanesScatterLast,
    RadixSortLanesScatterMixed, RadixSortScatter, SORT_LANE_DIGITS, SORT_LANE_FOURS, SORT_TILE, WIDE_GROUP,
};
use crate::gpu::{Bound, Buffer, BufferUse, Gpu, Recorder};
use crate::interface::SortPush;
use crate::num;
use crate::primitives::dispatch::{Dispatch, pass};
use crate::primitives::scan::{Scan, WorkSplit};

/// Largest number of pairs of a sort: every device allows one workgroup for each tile of them.
pub(crate) const MOST_PAIRS: u32 = 1 << 26;

/// The passes that sort by one digit.
#[derive(Debug)]
struct Digit {
    count: Dispatch,
    scatter: Dispatch,
    push: SortPush,
}

/// A sort of pairs of a key and a value, in place, by ascending key. Pairs with equal keys keep their order.
#[derive(Debug)]
pub(crate) struct RadixSort {
    passes: Vec<Digit>,
    scan: Scan,
    groups: u32,
    /// The first buffer between two digits.
    pub(crate) scratch: Arc<Buffer>,
}

impl RadixSort {
    /// Makes a sort of the first `n` words of a buffer of keys and one of values, which shaders write.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when a buffer has fewer words; errors of memory, of which a sort takes up to 16 bytes per pair, and
    /// of Vulkan.
    pub(crate) fn new(gpu: &Gpu, name: &str, pairs: [&Arc<Buffer>; 2], n: u32) -> Result<Self> {
        let count = Buffer::with_data(gpu, &format!("{name}.count"), bytemuck::bytes_of(&n))?;
        Self::by_digits(gpu, name, pairs, &count, Digits::of(gpu, n, 32, WorkSplit::of(gpu)))
    }

    /// Makes a sort by the lowest `bits` of the keys, of as many pairs as the first word of `count` says on the device, at most `capacity`.
    ///
    /// # Errors
    ///
    /// Those of [`RadixSort::new`]; [`Error::Unsupported`] for more than 2^26 pairs.
    pub(crate) fn counted(
        gpu: &Gpu,
        name: &str,
        pairs: [&Arc<Buffer>; 2],
        count: &Arc<Buffer>,
        capacity: u32,
        bits: u32,
    ) -> Result<Self> {
        if capacity > MOST_PAIRS {
            return Err(Error::unsupported(name, format!("{capacity} pairs; {MOST_PAIRS} can be sorted")));
        }
        Self::by_digits(gpu, name, pairs, count, Digits::of(gpu, capacity, bits, WorkSplit::of(gpu)))
    }

    /// Makes a sort with given digits of as many pairs as the first word of `count` says on the device. Words after these
    /// pairs are unchanged.
    fn by_digits(
        gpu: &Gpu,
        name: &str,
        [keys, values]: [&Arc<Buffer>; 2],
        count: &Arc<Buffer>,
        digits: Digits,
    ) -> Result<Self> {
        let Digits { split, capacity, bits, digit, passes, runs, groups, mixes } = digits;
        let least = keys.size().min(values.size());
        if capacity > MOST_PAIRS || 4 * u64::from(capacity) > least || !(1..=32).contains(&bits) {
            let what = format!("a sort of {capacity} pairs by {bits} bits in buffers of {least} bytes");
            return Err(Error::invalid(name, what));
        }
        let buffer = |part: &str, words: u64| {
            let bytes = 4 * words.max(4);
            Buffer::new(gpu, &format!("{name}.{part}"), bytes, BufferUse::ShaderWrite).map(Arc::new)
        };
        let counters = buffer("digits", u64::from(runs) << digit)?;
        // The pairs begin and end in the given buffers. One buffer between is enough where the digits alternate between it and
        // the given ones; else two alternate.
        let stops = if passes == 2 || (passes.is_multiple_of(2) && !mixes) { 1 } else { 2 };
        let stop = |_| {
            Ok(if mixes {
                Place::Mixed(buffer("pairs", mixed_words(capacity))?)
            } else {
                Place::Apart([buffer("keys", capacity.into())?, buffer("values", capacity.into())?])
            })
        };
        let stops = (0..stops).map(stop).collect::<Result<Vec<Place>>>()?;
        let (Place::Mixed(scratch) | Place::Apart([scratch, _])) = &stops[0];
        let scratch = Arc::clone(scratch);
        let home = Place::Apart([Arc::clone(keys), Arc::clone(values)]);
        let place_after = |pass: u32| match pass {
            _ if pass == 0 || pass == passes => &home,
            _ if stops.len() == 1 && pass.is_multiple_of(2) => &home,
            _ => &stops[num::index(pass + 1) % stops.len()],
        };
        let digit_pass = |number: u32| {
            let [counting, scattering] =
                shaders(split, place_after(number), place_after(number + 1), count, &counters);
            // The last digit has the remaining bits; where a single bit is sorted by, none.
            let shift = (digit * number).min(bits);
            let width = digit.min(bits - shift);
            Ok(Digit {
                count: pass(gpu, &format!("{name}.count"), &counting)?,
                scatter: pass(gpu, &format!("{name}.scatter"), &scattering)?,
                push: SortPush { capacity, runs, shift: shift.min(31), mask: (1_u32 << width) - 1 },
            })
        };
        let passes = (0..passes).map(digit_pass).collect::<Result<_>>()?;
        let scan = Scan::new(gpu, &format!("{name}.digits"), &counters, runs << digit, split)?;
        Ok(Self { passes, scan, groups, scratch })
    }

    /// Records the passes of all digits.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>) {
        for Digit { count, scatter, push } in &self.passes {
            let groups = [self.groups, 1, 1];
            count.record(recorder, push, groups);
            self.scan.record(recorder);
            scatter.record(recorder, push, groups);
        }
    }
}

/// The buffers of pairs between two digits.
#[derive(Debug)]
enum Place {
    /// One buffer of keys and one of values.
    Apart([Arc<Buffer>; 2]),
    /// One buffer of alternating keys and values, which takes one store per pair.
    Mixed(Arc<Buffer>),
}

/// Returns the shaders that count and that scatter `sort_count` pairs between two places.
fn shaders(
    split: WorkSplit,
    from: &Place,
    to: &Place,
    sort_count: &Arc<Buffer>,
    digits: &Arc<Buffer>,
) -> [Bound; 2] {
    let (Place::Apart([from_keys, _]) | Place::Mixed(from_keys)) = from;
    let counting = match (split, from) {
        (WorkSplit::Groups, _) => RADIX_SORT_GROUPS_COUNT,
        (_, Place::Apart(_)) => RADIX_SORT_LANES_COUNT,
        (_, Place::Mixed(_)) => RADIX_SORT_LANES_COUNT_MIXED,
    };
    let counting = counting.with(&RadixSortCount {
        sort_count: sort_count.read(),
        sort_keys: from_keys.read(),
        sort_digits: digits.write(),
    });
    let (sort_count, sort_digits) = (sort_count.read(), digits.write());
    let scattering = match (from, to) {
        (Place::Apart([keys, values]), Place::Apart([sorted_keys, sorted_values])) => {
            let apart = match split {
                WorkSplit::Groups => RADIX_SORT_GROUPS_SCATTER,
                WorkSplit::Lanes(_) => RADIX_SORT_LANES_SCATTER,
            };
            apart.with(&RadixSortScatter {
                sort_count,
                sort_keys: keys.read(),
                sort_values: values.read(),
                sort_digits,
                sorted_keys: sorted_keys.write(),
                sorted_values: sorted_values.write(),
            })
        }
        (Place::Apart([keys, values]), Place::Mixed(sorted)) => {
            RADIX_SORT_LANES_SCATTER_FIRST.with(&RadixSortLanesScatterFirst {
                sort_count,
                sort_keys: keys.read(),
                sort_values: values.read(),
                sort_digits,
                sorted_keys: sorted.write(),
            })
        }
        (Place::Mixed(pairs), Place::Mixed(sorted)) => {
            RADIX_SORT_LANES_SCATTER_MIXED.with(&RadixSortLanesScatterMixed {
                sort_count,
                sort_keys: pairs.read(),
                sort_digits,
                sorted_keys: sorted.write(),
            })
        }
        (Place::Mixed(pairs), Place::Apart([sorted_keys, sorted_values])) => RADIX_SORT_LANES_SCATTER_LAST
            .with(&RadixSortLanesScatterLast {
                sort_count,
                sort_keys: pairs.read(),
                sort_digits,
                sorted_keys: sorted_keys.write(),
                sorted_values: sorted_values.write(),
            }),
    };
    [counting, scattering]
}

/// The digits of the keys, and the runs of pairs.
#[derive(Clone, Copy, Debug)]
struct Digits {
    split: WorkSplit,
    /// Largest number of pairs.
    capacity: u32,
    /// Bits of a key that are compared.
    bits: u32,
    /// Bits per digit.
    digit: u32,
    /// Number of digits: at least two, since a scatter needs different buffers.
    passes: u32,
    runs: u32,
    /// Workgroups of the count and of the scatter.
    groups: u32,
    /// Whether keys and values alternate in one buffer between the first digit and the last.
    mixes: bool,
}

impl Digits {
    fn of(gpu: &Gpu, capacity: u32, bits: u32, split: WorkSplit) -> Self {
        let most = match split {
            WorkSplit::Lanes(_) => SORT_LANE_DIGITS,
            WorkSplit::Groups => WIDE_GROUP,
        };
        let passes = bits.div_ceil(most.ilog2()).max(2);
        let digit = bits.div_ceil(passes);
        match split {
            WorkSplit::Lanes(lanes) => {
                // There are at most as many counters as pairs, and runs fit the limit of a loop.
                let runs = lanes.min(capacity >> digit).max(capacity.div_ceil(4 * SORT_LANE_FOURS));
                let groups = runs.div_ceil(LANE_GROUP).max(1);
                let runs = groups * LANE_GROUP;
                let room = u64::from(gpu.limits().max_storage_buffer_range);
                let mixes = 4 * mixed_words(capacity) <= room;
                Self { split, capacity, bits, digit, passes, runs, groups, mixes }
            }
            WorkSplit::Groups => {
                let runs = capacity.div_ceil(SORT_TILE).max(1);
                Self { split, capacity, bits, digit, passes, runs, groups: runs, mixes: false }
            }
        }
    }
}

/// Returns the words of a buffer of mixed pairs, rounded up to four pairs, which are loaded at once.
fn mixed_words(pairs: u32) -> u64 {
    2 * u64::from(pairs).next_multiple_of(4)
}

/// Converts floats into keys in place, for the test that shaders and host compute the same keys.
#[cfg_attr(not(test), expect(dead_code, reason = "used by the test alone"))]
const FLOAT_KEYS: Entry<RadixSortFloatKeys> = RADIX_SORT_FLOAT_KEYS;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::TestGpu;
    use crate::gpu::{Commands, Validation};

    /// Divisions with few and many lanes and with workgroups; the flag allows mixed pairs.
    const WAYS: [(WorkSplit, bool); 4] = [
        (WorkSplit::Lanes(16), true),
        (WorkSplit::Lanes(1000), true),
        (WorkSplit::Lanes(16), false),
        (WorkSplit::Groups, false),
    ];

    /// Makes a sort by one of the [`WAYS`].
    fn by(
        gpu: &Gpu,
        buffers: [&Arc<Buffer>; 2],
        n: u32,
        count: &Arc<Buffer>,
        bits: u32,
        (split, mixes): (WorkSplit, bool),
    ) -> RadixSort {
        let mut digits = Digits::of(gpu, n, bits, split);
        digits.mixes &= mixes;
        RadixSort::by_digits(gpu, "test.sort", buffers, count, digits).unwrap()
    }

    /// Sizes around those of workgroups, tiles and runs.
    const SIZES: [usize; 17] =
        [0, 1, 2, 7, 8, 9, 255, 256, 257, 2047, 2048, 2049, 4095, 4096, 4097, 32_769, 65_537];

    fn random(n: usize, mut state: u64) -> Vec<u32> {
        let step = |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 32) as u32
        };
        (0..n).map(step).collect()
    }

    /// Returns the pairs of a stable sort of keys with their indices as values.
    fn expected(keys: &[u32], bits: u32) -> Vec<(u32, u32)> {
        let mut pairs: Vec<(u32, u32)> = keys.iter().copied().zip(0..).collect();
        pairs.sort_by_key(|&(key, _)| key & (u32::MAX >> (32 - bits)));
        pairs
    }

    fn sorted(gpu: &TestGpu, keys: &[u32], bits: u32, way: (WorkSplit, bool)) -> Vec<(u32, u32)> {
        let n = num::count(keys.len());
        let count = gpu.upload(&[n]);
        let keys = gpu.upload(keys);
        let values = gpu.upload(&(0..n).collect::<Vec<u32>>());
        let sort = by(gpu, [&keys, &values], n, &count, bits, way);
        gpu.record(|recorder| sort.record(recorder));
        let pairs = gpu.download(&keys).into_iter().zip(gpu.download(&values));
        pairs.take(n as usize).collect()
    }

    fn check(gpu: &TestGpu, keys: &[u32], bits: u32, way: (WorkSplit, bool), what: &str) {
        let (found, right) = (sorted(gpu, keys, bits, way), expected(keys, bits));
        if let Some(i) = (0..keys.len()).find(|&i| found[i] != right[i]) {
            let n = keys.len();
            panic!("{what}, {n} pairs, {bits} bits, {way:?}: pair {i} is {:?}, not {:?}", found[i], right[i]);
        }
    }

    #[test]
    fn every_size_around_the_borders_of_runs_is_sorted() {
        let gpu = TestGpu::new();
        for way in WAYS {
            for n in SIZES {
                check(&gpu, &random(n, n as u64), 32, way, "random");
            }
        }
    }

    #[test]
    fn a_million_pairs_are_sorted() {
        let gpu = TestGpu::new();
        for way in WAYS {
            check(&gpu, &random(1_000_003, 5), 32, way, "random");
        }
    }

    #[test]
    fn pairs_with_equal_keys_keep_their_order() {
        let gpu = TestGpu::new();
        let n = 10_007;
        for way in WAYS {
            check(&gpu, &vec![0; n], 32, way, "zeros");
            check(&gpu, &vec![u32::MAX; n], 32, way, "greatest keys");
            check(&gpu, &vec![0x1234_5678; n], 32, way, "equal");
            let few: Vec<u32> = random(n, 1).iter().map(|k| (k % 5) * 0x3000_1001).collect();
            check(&gpu, &few, 32, way, "five keys");
            let ends: Vec<u32> = random(n, 2).iter().map(|k| if k % 2 == 0 { 0 } else { u32::MAX }).collect();
            check(&gpu, &ends, 32, way, "least and greatest keys");
        }
    }

    #[test]
    fn ordered_and_reversed_keys_are_sorted() {
        let gpu = TestGpu::new();
        let n = 10_007_u32;
        for way in WAYS {
            check(&gpu, &(0..n).map(|k| k * 400_000).collect::<Vec<_>>(), 32, way, "ordered");
            check(&gpu, &(0..n).rev().map(|k| k * 400_000).collect::<Vec<_>>(), 32, way, "reversed");
        }
    }

    #[test]
    fn only_the_lowest_bits_count_and_the_others_are_carried() {
        let gpu = TestGpu::new();
        let keys = random(6007, 9);
        for way in WAYS {
            for bits in [1, 2, 8, 9, 11, 16, 20, 23, 31, 32] {
                check(&gpu, &keys, bits, way, "whole words");
            }
        }
    }

    #[test]
    fn the_device_says_how_many_pairs_there_are() {
        let gpu = TestGpu::new();
        let n = 9001_u32;
        let keys = random(n as usize, 3);
        for way in WAYS {
            let count = gpu.upload(&[0]);
            let key_buffer = gpu.upload(&keys);
            let value_buffer = gpu.upload(&vec![0; n as usize]);
            let buffers = [&key_buffer, &value_buffer];
            for bits in [32, 14] {
                let sort = by(&gpu, buffers, n, &count, bits, way);
                // More than there is room for is as much as there is room for.
                for (pairs, used) in [
                    (0, 0),
                    (1, 1),
                    (2048, 2048),
                    (5000, 5000),
                    (n, n),
                    (n + 1, n),
                    (u32::MAX, n),
                    (300, 300),
                ] {
                    gpu.write(&count, &[pairs]);
                    gpu.write(&key_buffer, &keys);
                    gpu.write(&value_buffer, &(0..n).collect::<Vec<u32>>());
                    gpu.record(|recorder| sort.record(recorder));
                    let found = gpu.download(&key_buffer).into_iter().zip(gpu.download(&value_buffer));
                    let mut right = expected(&keys[..used as usize], bits);
                    right.extend((used..n).map(|i| (keys[i as usize], i)));
                    assert!(found.eq(right), "{pairs} of {n} pairs, {bits} bits, {way:?}");
                }
            }
        }
    }

    #[test]
    fn the_same_pairs_give_the_same_result_each_time() {
        let gpu = TestGpu::new();
        let keys: Vec<u32> = random(20_011, 4).iter().map(|k| k & 0xff00_00ff).collect();
        for way in WAYS {
            let right = expected(&keys, 32);
            for turn in 0..20 {
                assert!(sorted(&gpu, &keys, 32, way) == right, "turn {turn}, {way:?}");
            }
        }
    }

    #[test]
    fn a_recording_may_sort_twice() {
        let gpu = TestGpu::new();
        for way in WAYS {
            let keys = random(5003, 8);
            let n = num::count(keys.len());
            let key_buffer = gpu.upload(&keys);
            let values = gpu.upload(&(0..n).collect::<Vec<u32>>());
            let count = gpu.upload(&[n]);
            let sort = |bits| by(&gpu, [&key_buffer, &values], n, &count, bits, way);
            // By the lower half, then by all: the same as by all.
            let (half, all) = (sort(16), sort(32));
            gpu.record(|recorder| {
                half.record(recorder);
                all.record(recorder);
            });
            let mut right: Vec<(u32, u32)> = keys.iter().copied().zip(0..).collect();
            right.sort_unstable();
            let found = gpu.download(&key_buffer).into_iter().zip(gpu.download(&values));
            assert!(found.eq(right), "{way:?}");
        }
    }

    #[test]
    fn what_cannot_be_sorted_is_refused() {
        let gpu = TestGpu::new();
        let words = gpu.upload(&[1, 2]);
        for (n, bits) in [(3, 32), (2, 0), (2, 33), (MOST_PAIRS + 1, 32)] {
            let digits = Digits::of(&gpu, n, bits, WorkSplit::of(&gpu));
            let sort = RadixSort::by_digits(&gpu, "test.sort", [&words, &words], &words, digits);
            assert!(sort.is_err(), "{n}, {bits}");
        }
    }

    /// Returns the key of a float like `float_key` of `glsl/shared/keys.glsl`: keys are in the order of floats, -0 equals +0, NaN is last.
    fn float_key(value: f32) -> u32 {
        if value.is_nan() {
            return u32::MAX;
        }
        // `value + 0.0` would flush subnormal numbers on some devices.
        let bits = if value == 0.0 { 0 } else { value.to_bits() };
        if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
    }

    /// Floats in ascending order; neighbours that are equal share a rank.
    fn floats() -> Vec<f32> {
        let positive = [1.0e-45, 1.17e-38, 1.0e-20, 0.5, 1.0, 1.000_000_1, 3.0e38, f32::INFINITY];
        let mut all: Vec<f32> = positive.iter().rev().map(|x| -x).collect();
        all.extend([-0.0, 0.0]);
        all.extend(positive);
        all
    }

    #[test]
    fn keys_of_floats_are_in_the_order_of_floats() {
        let floats = floats();
        for pair in floats.windows(2) {
            assert_eq!(float_key(pair[0]).cmp(&float_key(pair[1])), pair[0].partial_cmp(&pair[1]).unwrap());
        }
        for bits in [0x7fc0_0000, 0xffc0_0000, 0x7f80_0001, 0xffff_ffff] {
            assert_eq!(float_key(f32::from_bits(bits)), u32::MAX);
        }
        assert!(float_key(f32::INFINITY) < u32::MAX);
    }

    #[test]
    fn shaders_give_the_same_keys_to_floats_and_sort_them() {
        let gpu = TestGpu::new();
        let mut bits: Vec<u32> = floats().iter().map(|x| x.to_bits()).collect();
        bits.extend([0x7fc0_0000, 0xffc0_0000, 0x7f80_0001, 0xffff_ffff]);
        bits.extend(random(5000, 6));
        let n = num::count(bits.len());
        let keys = gpu.upload(&bits);
        let count = gpu.upload(&[n]);
        let inputs = RadixSortFloatKeys { sort_count: count.read(), sorted_keys: keys.write() };
        let make_keys = pass(&gpu, "test.keys", &FLOAT_KEYS.with(&inputs)).unwrap();
        let values = gpu.upload(&(0..n).collect::<Vec<u32>>());
        let sort = RadixSort::new(&gpu, "test.sort", [&keys, &values], n).unwrap();
        gpu.record(|recorder| {
            let push = SortPush { capacity: n, ..SortPush::default() };
            let groups = [n.div_ceil(LANE_GROUP), 1, 1];
            make_keys.record(recorder, &push, groups);
            sort.record(recorder);
        });
        let right: Vec<u32> = bits.iter().map(|&b| float_key(f32::from_bits(b))).collect();
        let found = gpu.download(&keys).into_iter().zip(gpu.download(&values));
        assert!(found.eq(expected(&right, 32)));
    }

    /// More pairs than one buffer of mixed ones holds on every device, and so many that runs must be shorter.
    #[test]
    #[ignore = "takes a gigabyte and seconds"]
    fn many_millions_of_pairs_are_sorted() {
        let gpu = TestGpu::new();
        let keys = random((1 << 24) + 1, 11);
        for way in [WAYS[0], WAYS[2], WAYS[3]] {
            let found = sorted(&gpu, &keys, 32, way);
            let mut seen = vec![false; keys.len()];
            for (i, &(key, value)) in found.iter().enumerate() {
                assert!(i == 0 || found[i - 1] < (key, value), "pair {i}, {way:?}");
                assert_eq!(key, keys[num::index(value)], "pair {i}, {way:?}");
                assert!(!std::mem::replace(&mut seen[num::index(value)], true), "pair {i}, {way:?}");
            }
        }
    }

    /// Milliseconds of one sort: wall time from recording to fence. Ways to sort take turns, so that what else
    /// the machine does harms all.
    #[test]
    #[ignore = "a measurement"]
    fn measure_time_of_a_sort() {
        const TURNS: usize = 20;
        let gpu = TestGpu::with(Validation::Off);
        println!("{}: median, lower decile, least", gpu.report().driver);
        for (n, bits) in [(100_000, 32), (400_000, 32), (400_000, 20), (1_000_000, 32)] {
            let keys = random(n, 1);
            let n = num::count(n);
            let count = gpu.upload(&[n]);
            let (key_buffer, values) = (gpu.upload(&keys), gpu.upload(&keys));
            let sort = |split| {
                let digits = Digits::of(&gpu, n, bits, split);
                let sort = RadixSort::by_digits(&gpu, "test.sort", [&key_buffer, &values], &count, digits);
                (digits, sort.unwrap(), Vec::new())
            };
            let mut sorts = [sort(WorkSplit::software()), sort(WorkSplit::Groups)];
            let mut commands = Commands::new(&gpu).unwrap();
            for _ in 0..TURNS {
                for (_, sort, times) in &mut sorts {
                    gpu.write(&key_buffer, &keys);
                    let start = std::time::Instant::now();
                    let mut recorder = Recorder::new(&gpu, commands.begin().unwrap(), None);
                    sort.record(&mut recorder);
                    let (_, keep) = recorder.finish().unwrap();
                    commands.submit(keep, "test").unwrap();
                    times.push(start.elapsed().as_secs_f64() * 1e3);
                }
            }
            for (digits, _, times) in &mut sorts {
                times.sort_by(f64::total_cmp);
                let [median, tenth, least] = [TURNS / 2, TURNS / 10, 0].map(|i| times[i]);
                let Digits { split, passes, digit, runs, .. } = digits;
                println!(
                    "{n:8} pairs, {bits} bits: {median:7.2} {tenth:7.2} {least:7.2}  \
                     {split:?}: {passes} x {digit} bits, {runs} runs"
                );
            }
        }
    }
}
