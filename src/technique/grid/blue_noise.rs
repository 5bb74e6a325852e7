//! A tile of thresholds whose dithering error has no low frequencies (blue noise).

use std::sync::OnceLock;

use crate::gpu::shader::THRESHOLD_SIDE;
use crate::num::{f32_of, f64_of, index, u64_of};

/// Texels along each side of the tile; a power of two.
pub(crate) const SIDE: u32 = THRESHOLD_SIDE;

/// The same, as a length.
const N: usize = index(SIDE);

/// Width of the Gaussian that measures crowding, in texels.
const SIGMA: f64 = 1.5;

/// Crowding that a point adds at its own texel. It is large enough for the Gaussian's tail, and small enough that exponential
/// functions that differ in the last place give the same integers.
const UNIT: f64 = 4_294_967_296.0;

/// Reach of the Gaussian in texels; beyond it rounds to 0.
const REACH: usize = 10;

/// Returns the toroidal threshold tile of the void-and-cluster method (Ulichney 1993): (rank + 0.5) / SIDE^2, row by row.
///
/// The numbers are the same on every machine: positions come from integers, and crowding is in fixed point, so that removing
/// a point exactly undoes adding it. Made once per process.
pub(crate) fn tile() -> &'static [f32] {
    static TILE: OnceLock<Vec<f32>> = OnceLock::new();
    TILE.get_or_init(made)
}

/// Makes the tile.
fn made() -> Vec<f32> {
    let mut points = Points::new();
    // Phase 0: a tenth of the texels at random; the point of the tightest cluster then moves into the largest void for as long
    // as that lowers the crowding.
    let mut state = 1_u32;
    while points.number < N * N / 10 {
        // Numerical Recipes' generator; its high bits are the random ones.
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let place = index(state >> 20) % (N * N);
        if !points.on[place] {
            points.put(place);
        }
    }
    loop {
        let cluster = points.tightest_cluster();
        points.take(cluster);
        let void = points.largest_void();
        if points.crowding[void] >= points.crowding[cluster] {
            points.put(cluster);
            break;
        }
        points.put(void);
    }

    let mut ranks = vec![0; N * N];
    let mut fewer = points.clone();
    while fewer.number > 0 {
        let cluster = fewer.tightest_cluster();
        fewer.take(cluster);
        ranks[cluster] = fewer.number;
    }
    // Ulichney's third phase looks for clusters of empty texels. On a torus those are the voids of this measure, so the second
    // phase continues to the end.
    while points.number < N * N {
        let void = points.largest_void();
        ranks[void] = points.number;
        points.put(void);
    }
    ranks.into_iter().map(|rank| f32_of((f64_of(rank) + 0.5) / f64_of(N * N))).collect()
}

/// A pattern of points on the torus, with the crowding of every texel.
#[derive(Clone)]
struct Points {
    on: Vec<bool>,
    number: usize,
    /// Sum over the points of the Gaussian of their distance, fixed point.
    crowding: Vec<u64>,
    /// The Gaussian by distance, `2 * REACH + 1` square.
    kernel: Vec<u64>,
}

impl Points {
    /// Texels along each side of the kernel.
    const WIDTH: usize = 2 * REACH + 1;

    fn new() -> Self {
        let along: Vec<f64> =
            (0..Self::WIDTH).map(|i| (-0.5 * ((f64_of(i) - f64_of(REACH)) / SIGMA).powi(2)).exp()).collect();
        let kernel =
            along.iter().flat_map(|a| along.iter().map(move |b| u64_of(a * b * UNIT + 0.5))).collect();
        Self { on: vec![false; N * N], number: 0, crowding: vec![0; N * N], kernel }
    }

    fn put(&mut self, place: usize) {
        self.on[place] = true;
        self.number += 1;
        self.spread(place, u64::wrapping_add);
    }

    fn take(&mut self, place: usize) {
        self.on[place] = false;
        self.number -= 1;
        self.spread(place, u64::wrapping_sub);
    }

    /// Adds or removes the crowding of one point.
    fn spread(&mut self, place: usize, change: impl Fn(u64, u64) -> u64) {
        let (x, y) = (place % N + N - REACH, place / N + N - REACH);
        let mut at = 0;
        while at < self.kernel.len() {
            let texel = (y + at / Self::WIDTH) % N * N + (x + at % Self::WIDTH) % N;
            self.crowding[texel] = change(self.crowding[texel], self.kernel[at]);
            at += 1;
        }
    }

    /// The point with the most crowding; the first of equals.
    fn tightest_cluster(&self) -> usize {
        self.first(true, |crowding, so_far| crowding > so_far)
    }

    /// The texel without a point that has the least crowding; the first of equals.
    fn largest_void(&self) -> usize {
        self.first(false, |crowding, so_far| crowding < so_far)
    }

    /// The first texel, among those with or without a point, that no other one beats.
    fn first(&self, on: bool, better: impl Fn(u64, u64) -> bool) -> usize {
        let mut found: Option<(usize, u64)> = None;
        // Not an iterator: without optimisation this loop is most of the time.
        let mut place = 0;
        while place < N * N {
            if self.on[place] == on {
                let crowding = self.crowding[place];
                match found {
                    Some((_, so_far)) if !better(crowding, so_far) => {}
                    _ => found = Some((place, crowding)),
                }
            }
            place += 1;
        }
        found.map_or(0, |(place, _)| place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::count;

    /// Texels' ranks.
    fn ranks() -> Vec<usize> {
        tile().iter().map(|&t| crate::num::usize_of(f64::from(t) * f64_of(N * N))).collect()
    }

    /// Smallest distance on the torus between the texels that `among` picks.
    fn closest(ranks: &[usize], among: impl Fn(usize) -> bool) -> f64 {
        let places: Vec<usize> = (0..N * N).filter(|&place| among(ranks[place])).collect();
        let mut least = usize::MAX;
        for (i, a) in places.iter().enumerate() {
            for b in &places[..i] {
                let wrap = |d: usize| d.min(N - d);
                let (dx, dy) = (wrap((a % N).abs_diff(b % N)), wrap((a / N).abs_diff(b / N)));
                least = least.min(dx * dx + dy * dy);
            }
        }
        f64_of(least).sqrt()
    }

    #[test]
    fn every_rank_occurs_once() {
        let tile = tile();
        assert_eq!(count(tile.len()), SIDE * SIDE);
        let mut sorted = ranks();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, &rank)| i == rank));
        assert!(tile.iter().all(|&t| t > 0.0 && t < 1.0));
        let mean = tile.iter().map(|&t| f64::from(t)).sum::<f64>() / f64_of(tile.len());
        assert!((mean - 0.5).abs() < 1e-9);
    }

    #[test]
    fn low_frequencies_are_absent() {
        let tile = tile();
        // Power of one frequency, relative to white noise of the same variance, 1 / 12.
        let power = |u: i32, v: i32| {
            let (mut re, mut im) = (0.0, 0.0);
            for (place, &t) in tile.iter().enumerate() {
                let phase = f64::from(u) * f64_of(place % N) + f64::from(v) * f64_of(place / N);
                let (sin, cos) = (phase * std::f64::consts::TAU / f64_of(N)).sin_cos();
                re += f64::from(t) * cos;
                im += f64::from(t) * sin;
            }
            (re * re + im * im) / f64_of(N * N) * 12.0
        };
        let mut rings = [(0.0, 0.0); 7];
        for v in -6..=6_i32 {
            for u in 0..=6_i32 {
                let ring = crate::num::usize_of(f64::from(u * u + v * v).sqrt().ceil());
                if (1..=6).contains(&ring) {
                    rings[ring].0 += power(u, v);
                    rings[ring].1 += 1.0;
                }
            }
        }
        for (ring, (sum, number)) in rings.iter().enumerate().skip(1) {
            let mean = sum / number;
            assert!(mean < 0.05, "|k| = {ring}: {mean} of white noise's power");
        }
    }

    #[test]
    fn the_lowest_and_the_highest_thresholds_are_spread() {
        let ranks = ranks();
        // No pattern of n points has them further apart than a hexagonal lattice. Placing each point into
        // the largest void makes distances between that and half of it; a random pattern of even the
        // fewest of these has neighbours that touch.
        for n in [64, 128, 256, 409] {
            let hexagonal = (f64_of(N * N) / f64_of(n) * 2.0 / 3_f64.sqrt()).sqrt();
            for (name, least) in [
                ("lowest", closest(&ranks, |rank| rank < n)),
                ("highest", closest(&ranks, |rank| rank >= N * N - n)),
            ] {
                assert!(
                    least >= 2.0 && least >= 0.55 * hexagonal && least <= hexagonal,
                    "{name} {n}: {least:.3}, hexagonal {hexagonal:.3}"
                );
            }
        }
    }

    #[test]
    fn it_is_the_same_everywhere() {
        // Of the ranks, row by row: a change of the tile is a change of every picture that uses it.
        let hash = ranks().iter().fold(0_u32, |hash, &rank| (hash ^ count(rank)).wrapping_mul(16_777_619));
        assert_eq!(hash, 1_973_420_780);
    }
}
