//! Reproducible random numbers: SplitMix64 (Steele, Lea and Flood 2014).

/// A generator; the field is seed and state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns an index in `0..count`.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        let wide = u128::from(self.next()) * count as u128;
        usize::try_from(wide >> 64).unwrap_or(0)
    }

    /// Returns a number in `low..high`, uniformly distributed.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 * (-53.0_f64).exp2())
    }

    /// Returns a positive number in `low..high`, uniformly distributed in its logarithm.
    pub(crate) fn scale(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// Returns an integer in `low..=high`.
    pub(crate) fn whole(&mut self, low: u32, high: u32) -> u32 {
        low + u32::try_from(self.next() % u64::from(high - low + 1)).unwrap_or(0)
    }

    /// Returns an element of a non-empty list.
    pub(crate) fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_in_range_and_spread() {
        let mut random = Random(7);
        let mut sums = [0.0; 3];
        for _ in 0..4000 {
            let (share, size, whole) =
                (random.between(2.0, 4.0), random.scale(0.01, 100.0), random.whole(3, 5));
            assert!(
                (2.0..4.0).contains(&share) && (0.01..=100.0).contains(&size) && (3..=5).contains(&whole)
            );
            sums = [sums[0] + share, sums[1] + size.ln(), sums[2] + f64::from(whole)];
            assert!(random.below(3) < 3 && [1, 2].contains(&random.of(&[1, 2])));
        }
        let [share, size, whole] = sums.map(|sum| sum / 4000.0);
        assert!((share - 3.0).abs() < 0.05 && size.abs() < 0.3 && (whole - 4.0).abs() < 0.06, "{sums:?}");
    }
}
