//! Statistics of frame times: quantiles, confidence intervals, ratios.

use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use volraster::technique::FrameTime;

use crate::cli::random::Random;

/// Fixed seed: the same times give the same interval.
const SEED: u64 = 1;

/// The percentile of [`Times::low`].
const LOW: u32 = 5;

/// Bootstrap resamples per interval.
const RESAMPLES: u32 = 2000;

/// Returns the sum of the frame's pass times, in milliseconds; `None` where the device has no timestamps.
pub(crate) fn gpu_ms(frame: &FrameTime) -> Option<f64> {
    (!frame.passes.is_empty()).then(|| frame.passes.iter().map(|pass| pass.ms).sum())
}

/// Returns the times of a frame's passes by name. Passes with the same name are summed.
pub(crate) fn passes(frame: &FrameTime) -> Vec<(&str, f64)> {
    let mut passes: Vec<(&str, f64)> = Vec::new();
    for pass in &frame.passes {
        match passes.iter_mut().find(|(name, _)| *name == pass.name) {
            Some((_, ms)) => *ms += pass.ms,
            None => passes.push((&pass.name, pass.ms)),
        }
    }
    passes
}

/// Returns the median time of each pass over frames, in order of first appearance. A frame without the pass counts as
/// 0.
pub(crate) fn pass_medians(frames: &[FrameTime]) -> Vec<(String, f64)> {
    let mut times: Vec<(String, Vec<f64>)> = Vec::new();
    for (i, frame) in frames.iter().enumerate() {
        for (name, ms) in passes(frame) {
            let known = times.iter().position(|(known, _)| known == name);
            let place = known.unwrap_or_else(|| {
                times.push((name.to_string(), vec![0.0; frames.len()]));
                times.len() - 1
            });
            times[place].1[i] = ms;
        }
    }
    times.into_iter().filter_map(|(name, times)| Some((name, Times::new(times)?.median()))).collect()
}

/// Times of one quantity over several frames, in ascending order.
#[derive(Clone, Debug)]
pub(crate) struct Times {
    sorted: Vec<f64>,
}

impl Times {
    /// Sorts the times; `None` if there are none.
    pub(crate) fn new(mut times: Vec<f64>) -> Option<Self> {
        times.sort_by(f64::total_cmp);
        (!times.is_empty()).then_some(Self { sorted: times })
    }

    /// Returns the sorted wall times of frames.
    pub(crate) fn wall(frames: &[FrameTime]) -> Option<Self> {
        Self::new(frames.iter().map(|frame| frame.wall_ms).collect())
    }

    /// Returns a quantile, interpolated linearly between neighbours.
    pub(crate) fn quantile(&self, per_cent: u32) -> f64 {
        self.per_mille(10 * per_cent)
    }

    fn per_mille(&self, per_mille: u32) -> f64 {
        let last = self.sorted.len() - 1;
        let position = f64::from(per_mille) / 1000.0 * last as f64;
        let below = last * usize::try_from(per_mille).unwrap_or(1000) / 1000;
        let low = self.sorted[below];
        let high = self.sorted.get(below + 1).copied().unwrap_or(low);
        low + (high - low) * (position - below as f64).clamp(0.0, 1.0)
    }

    /// Returns the median.
    pub(crate) fn median(&self) -> f64 {
        self.quantile(50)
    }

    /// Returns the 5th percentile, by which runs are compared: what disturbs frames adds to their time, and where times have two modes,
    /// as those of a software driver may, the median is in either.
    pub(crate) fn low(&self) -> f64 {
        self.quantile(LOW)
    }

    /// Returns a quantile of a resample of the same size, drawn with replacement.
    fn resampled(&self, per_cent: u32, random: &mut Random) -> f64 {
        let count = self.sorted.len();
        let drawn = (0..count).map(|_| self.sorted[random.below(count)]).collect();
        Self::new(drawn).map_or(f64::NAN, |times| times.quantile(per_cent))
    }

    /// Returns the 95 % confidence interval of the median: the two times between whose ranks it lies, by the binomial distribution, here
    /// its normal approximation. Three times or fewer give a narrower one, from the least to the greatest.
    pub(crate) fn interval(&self) -> [f64; 2] {
        let count = self.sorted.len();
        // The rank of the lower one is half the count less 1.96 standard deviations, of half its root each.
        let spread = (count * 38_416 / 10_000).isqrt();
        let below = count.saturating_sub(spread).div_ceil(2).saturating_sub(1);
        [self.sorted[below], self.sorted[count - 1 - below]]
    }
}

/// Returns the 2.5th and the 97.5th percentile.
fn middle_95(values: Vec<f64>) -> [f64; 2] {
    Times::new(values).map_or([f64::NAN; 2], |times| [25, 975].map(|at| times.per_mille(at)))
}

/// Statistics of the times of a case, as written to results.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(crate) struct Quantiles {
    /// The median.
    pub(crate) median: f64,
    /// Lower end of the 95 % confidence interval of the median, by ranks.
    pub(crate) low: f64,
    /// Upper end of it.
    pub(crate) high: f64,
    /// The time that one in ten frames falls below.
    pub(crate) p10: f64,
    /// The time that one in ten frames exceeds.
    pub(crate) p90: f64,
    /// The times in the order of the frames.
    pub(crate) times: Vec<f64>,
}

impl Quantiles {
    /// Computes the statistics; `None` if there are no times.
    pub(crate) fn new(times: Vec<f64>) -> Option<Self> {
        let sorted = Times::new(times.clone())?;
        let [low, high] = sorted.interval();
        let [median, p10, p90] = [50, 10, 90].map(|at| sorted.quantile(at));
        Some(Self { median, low, high, p10, p90, times })
    }

    /// Computes the statistics of the wall times of frames.
    pub(crate) fn wall(frames: &[FrameTime]) -> Option<Self> {
        Self::new(frames.iter().map(|frame| frame.wall_ms).collect())
    }

    /// Computes the statistics of device times; `None` unless every frame has one.
    pub(crate) fn gpu(frames: &[FrameTime]) -> Option<Self> {
        Self::new(frames.iter().map(gpu_ms).collect::<Option<Vec<_>>>()?)
    }
}

/// A ratio with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Ratio {
    #[serde(rename = "ratio")]
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Whether the interval excludes 1.
    pub(crate) outside_noise: bool,
}

/// Returns the geometric mean over pairs of the ratio of 5th percentiles, second over first. The bootstrap resamples both
/// sides of every pair. `None` without a pair.
pub(crate) fn ratio(pairs: &[[&Times; 2]]) -> Option<Ratio> {
    if pairs.is_empty() {
        return None;
    }
    let count = pairs.len() as f64;
    let mean = |logs: f64| (logs / count).exp();
    let value = mean(pairs.iter().map(|[a, b]| (b.low() / a.low()).ln()).sum());
    let mut random = Random(SEED);
    let mut once = || {
        let log = |[a, b]: &[&Times; 2]| (b.resampled(LOW, &mut random) / a.resampled(LOW, &mut random)).ln();
        mean(pairs.iter().map(log).sum())
    };
    let [low, high] = middle_95((0..RESAMPLES).map(|_| once()).collect());
    Some(Ratio { value, low, high, outside_noise: low > 1.0 || high < 1.0 })
}

/// Returns the milliseconds since an instant.
pub(crate) fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use volraster::gpu::PassTime;

    fn times(values: &[f64]) -> Times {
        Times::new(values.to_vec()).unwrap()
    }

    #[test]
    fn quantiles_are_linear_between_times() {
        let five = times(&[3.0, 1.0, 2.0, 5.0, 4.0]);
        assert_eq!([five.median(), five.quantile(0), five.quantile(100)], [3.0, 1.0, 5.0]);
        assert!((five.quantile(10) - 1.4).abs() < 1e-12);
        assert_eq!(times(&[1.0, 2.0]).median(), 1.5);
        assert_eq!(times(&[7.0]).quantile(90), 7.0);
        assert!(Times::new(Vec::new()).is_none());
    }

    #[test]
    fn intervals_contain_the_median_with_their_confidence() {
        // 400 samples of 15 times, whose true median is 10.
        let mut random = Random(SEED);
        let mut uniform = || random.between(0.0, 1.0);
        let held = (0..400).filter(|_| {
            let some = times(&(0..15).map(|_| 8.0 + 4.0 * uniform()).collect::<Vec<_>>());
            let [low, high] = some.interval();
            assert!(low <= some.median() && some.median() <= high);
            low <= 10.0 && 10.0 <= high
        });
        // 95 % of 400 are 380, with a standard deviation of 4.4. Percentile intervals of few times are a little too
        // narrow.
        let held = held.count();
        assert!((350..=399).contains(&held), "{held}");
        assert_eq!(times(&[3.0, 3.0, 3.0]).interval(), [3.0, 3.0]);
        assert_eq!(times(&[1.0, 2.0, 9.0]).interval(), times(&[9.0, 1.0, 2.0]).interval());
    }

    #[test]
    fn ratios_have_intervals_and_a_geometric_mean() {
        let slow = times(&[10.0, 10.2, 9.9, 10.1, 10.0]);
        let fast = times(&[5.0, 5.1, 4.9, 5.05, 5.0]);
        let one = ratio(&[[&slow, &fast]]).unwrap();
        assert!((one.value - 4.92 / 9.92).abs() < 1e-12 && one.low < 0.5 && one.high > 0.5, "{one:?}");
        assert!(one.outside_noise);
        let same = ratio(&[[&slow, &times(&[10.1, 9.8, 10.3, 10.0, 9.95])]]).unwrap();
        assert!(!same.outside_noise, "{same:?}");
        // One pair halves the time, the other doubles it: the mean ratio is 1.
        let both = ratio(&[[&slow, &fast], [&fast, &slow]]).unwrap();
        assert!((both.value - 1.0).abs() < 1e-12 && !both.outside_noise);
        assert!(ratio(&[]).is_none());
    }

    #[test]
    fn passes_with_one_name_are_summed() {
        let pass = |name: &str, ms| PassTime { name: name.to_string(), ms };
        let frame = |passes| FrameTime { wall_ms: 9.0, passes, counters: Vec::new(), bound: None };
        let frames = [
            frame(vec![pass("a", 1.0), pass("b", 2.0), pass("a", 3.0)]),
            frame(vec![pass("a", 6.0)]),
            frame(vec![pass("a", 3.5), pass("b", 4.0)]),
        ];
        assert_eq!(pass_medians(&frames), [("a".to_string(), 4.0), ("b".to_string(), 2.0)]);
        assert_eq!(gpu_ms(&frames[0]), Some(6.0));
    }
}
