//! The frame times of a case: when they have settled, when their median is known, and which of them were disturbed.

use super::scenes::Suite;
use crate::cli::timing::Times;

/// Least and most timed frames per case of scenes that belong to no suite.
const FRAMES: [usize; 2] = [12, 45];

/// Minimum number of timed frames of slow cases where their number is given.
const FEWEST: usize = 5;

/// Time after which a case is not timed further, in milliseconds, once it has its fewest frames.
const ENOUGH_MS: f64 = 4000.0;

/// How far the medians of two successive windows may be apart once times have settled.
const SETTLED: f64 = 0.02;

/// Frames of such a window.
const WINDOW: usize = 3;

/// The half-width of the 95 % interval of the median, relative to it, at which the median counts as known.
const KNOWN: f64 = 0.01;

/// The part of the frames and of the time that may go into warming up, or into frames that are disturbed.
const WASTE: f64 = 0.5;

/// Milliseconds over which the frames of a view are spread, even if they are quick.
const SPREAD_MS: f64 = 3000.0;

/// How many times the most frames of a case it may have until then.
const MANY: usize = 10;

/// How many frames are timed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Frames that every case has.
    pub(super) fewest: usize,
    /// Frames at which a case ends.
    pub(super) most: usize,
    /// Milliseconds after which a case with the fewest frames ends.
    pub(super) enough_ms: f64,
    /// Whether the first frames are left out until times have settled, and a case ends once its median is known. Else each has
    /// [`Limits::most`] frames.
    pub(super) adapts: bool,
}

impl Limits {
    /// Returns the limits of the scenes of a suite, or of others; `frames` fixes the number of frames.
    pub(super) fn of(suite: Option<&Suite>, frames: Option<usize>) -> Self {
        let own = suite.map_or(FRAMES, |suite| suite.frames);
        let [fewest, most] = frames.map_or(own, |frames| [frames; 2]);
        let adapts = most > fewest;
        Self { fewest: fewest.min(if adapts { most } else { FEWEST }), most, enough_ms: ENOUGH_MS, adapts }
    }
}

/// The times of a case so far, in milliseconds.
#[derive(Clone, Debug)]
pub(super) struct Series {
    limits: Limits,
    times: Vec<f64>,
    /// Whether other work or the device's clock disturbed the frame.
    disturbed: Vec<bool>,
    /// Frames before times had settled.
    warm: usize,
    has_settled: bool,
}

impl Series {
    pub(super) fn new(limits: Limits) -> Self {
        Self { limits, times: Vec::new(), disturbed: Vec::new(), warm: 0, has_settled: false }
    }

    /// Adds a frame; returns its number.
    pub(super) fn add(&mut self, ms: f64) -> usize {
        self.times.push(ms);
        self.disturbed.push(false);
        if !self.has_settled {
            self.settle();
        }
        self.times.len() - 1
    }

    /// Marks a frame as disturbed.
    pub(super) fn disturb(&mut self, frame: usize) {
        self.disturbed[frame] = true;
    }

    /// Looks whether times have settled: the medians of the last two windows are alike. The earlier window and all before it then were
    /// warming up. Without that, half of the frames or of the time is given to it.
    fn settle(&mut self) {
        let count = self.times.len();
        let spent: f64 = self.times.iter().sum();
        if !self.limits.adapts {
            self.has_settled = true;
        } else if count >= 2 * WINDOW {
            let median = |from: usize| {
                Times::new(self.times[from..from + WINDOW].to_vec()).map_or(f64::NAN, |times| times.median())
            };
            let [before, after] = [median(count - 2 * WINDOW), median(count - WINDOW)];
            self.has_settled = (after / before - 1.0).abs() < SETTLED;
            self.warm = count - WINDOW;
        }
        if count as f64 >= WASTE * self.limits.most as f64 || spent > WASTE * self.limits.enough_ms {
            self.has_settled = true;
        }
    }

    /// Returns the numbers of the frames that count: those after warming up that were not disturbed, or all after it if too few are
    /// left.
    pub(super) fn counted(&self) -> Vec<usize> {
        let all: Vec<usize> = (self.warm..self.times.len()).collect();
        let quiet: Vec<usize> = all.iter().copied().filter(|&frame| !self.disturbed[frame]).collect();
        if quiet.len() >= self.limits.fewest.min(all.len()) { quiet } else { all }
    }

    /// Returns the number of frames after warming up, and of those among them that were disturbed.
    pub(super) fn disturbances(&self) -> [usize; 2] {
        let after = &self.disturbed[self.warm..];
        [after.len(), after.iter().filter(|disturbed| **disturbed).count()]
    }

    /// Returns whether almost all frames were disturbed: their times tell nothing.
    pub(super) fn is_noisy(&self) -> bool {
        let [after, disturbed] = self.disturbances();
        after - disturbed < self.limits.fewest.min(after).div_ceil(2)
    }

    /// Returns the number of frames before times had settled.
    pub(super) fn warm(&self) -> usize {
        self.warm
    }

    /// Returns whether more frames are to be timed, `elapsed_ms` after the first of the view.
    pub(super) fn wants_more(&self, elapsed_ms: f64) -> bool {
        if self.times.is_empty() || !self.has_settled {
            return true;
        }
        let [after, disturbed] = self.disturbances();
        let quiet = after - disturbed;
        let spent: f64 = self.times[self.warm..].iter().sum();
        if after < self.limits.fewest {
            return true;
        }
        // What makes frames slower may last: frames of one moment tell of that alone.
        if self.limits.adapts && elapsed_ms < SPREAD_MS {
            return spent < self.limits.enough_ms && after < MANY * self.limits.most;
        }
        // Disturbed frames are repeated, but not for ever.
        if quiet >= self.limits.most || after >= 2 * self.limits.most {
            return false;
        }
        if quiet < self.limits.fewest {
            return spent < self.limits.enough_ms / WASTE;
        }
        spent < self.limits.enough_ms && !(self.limits.adapts && self.is_known())
    }

    /// Returns whether the median of the frames that count is known.
    fn is_known(&self) -> bool {
        let times = self.counted().into_iter().map(|frame| self.times[frame]).collect();
        Times::new(times).is_some_and(|times| {
            let [low, high] = times.interval();
            high - low <= 2.0 * KNOWN * times.median()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::random::Random;

    /// Cases that are drawn in turn.
    const OTHERS: f64 = 1000.0;

    const LIMITS: Limits = Limits { fewest: 5, most: 100, enough_ms: 1e5, adapts: true };

    /// Adds frames until no more are wanted; `next` returns a time and whether the frame is disturbed.
    fn run(limits: &Limits, mut next: impl FnMut(usize) -> (f64, bool)) -> Series {
        let mut series = Series::new(*limits);
        let mut elapsed_ms = 0.0;
        while series.wants_more(elapsed_ms) {
            let (ms, disturbed) = next(series.times.len());
            elapsed_ms += OTHERS * ms;
            let frame = series.add(ms);
            if disturbed {
                series.disturb(frame);
            }
        }
        series
    }

    /// Returns times around 10 ms with a relative spread.
    fn noise(seed: u64, spread: f64) -> impl FnMut() -> f64 {
        let mut random = Random(seed);
        move || 10.0 * (1.0 + spread * (0..4).map(|_| random.between(-0.5, 0.5)).sum::<f64>())
    }

    #[test]
    fn a_case_ends_when_its_median_is_known() {
        let [mut quiet, mut noisy] = [noise(1, 0.005), noise(2, 0.1)];
        let few = run(&LIMITS, |_| (quiet(), false));
        assert!(few.times.len() <= 12, "{}", few.times.len());
        let many = run(&LIMITS, |_| (noisy(), false));
        assert!(many.times.len() > 40, "{}", many.times.len());
        let median = |series: &Series| {
            let counted = series.counted();
            Times::new(counted.iter().map(|&frame| series.times[frame]).collect()).unwrap().median()
        };
        assert!((median(&few) / 10.0 - 1.0).abs() < 0.01 && (median(&many) / 10.0 - 1.0).abs() < 0.04);
        // Each case ends at its limits, whatever its times.
        assert_eq!(run(&Limits { most: 7, ..LIMITS }, |i| ((i + 1) as f64, false)).disturbances()[0], 7);
        let slow = run(&Limits { enough_ms: 4000.0, ..LIMITS }, |i| (2000.0 + 500.0 * (i % 3) as f64, false));
        assert!(slow.times.len() <= 7, "{}", slow.times.len());
    }

    #[test]
    fn frames_are_spread_over_time() {
        // Quick frames that for a second are all slower by a fifth.
        let mut series = Series::new(LIMITS);
        let mut elapsed_ms = 0.0;
        while series.wants_more(elapsed_ms) {
            let ms = if elapsed_ms < 1000.0 { 12.0 } else { 10.0 };
            series.add(ms);
            elapsed_ms += 2.0 * ms;
        }
        let counted = series.counted().into_iter().map(|frame| series.times[frame]).collect();
        assert_eq!((Times::new(counted).unwrap().low(), elapsed_ms >= SPREAD_MS), (10.0, true));
        // There is an end to it.
        let mut quick = Series::new(LIMITS);
        while quick.wants_more(0.0) {
            quick.add(0.01);
        }
        assert_eq!(quick.disturbances()[0], MANY * LIMITS.most);
    }

    #[test]
    fn frames_before_times_settle_are_left_out() {
        let mut noise = noise(3, 0.005);
        // A clock that falls by a third over ten frames.
        let series = run(&LIMITS, |i| (noise() * if i < 10 { 0.66 + 0.034 * i as f64 } else { 1.0 }, false));
        assert!((8..=14).contains(&series.warm()), "{}", series.warm());
        assert!(series.counted().iter().all(|&frame| series.times[frame] > 9.5));
        // Fixed numbers of frames have no such time.
        let fixed = Limits { fewest: 4, most: 4, enough_ms: 1e5, adapts: false };
        let series = run(&fixed, |i| (10.0 + i as f64, false));
        assert_eq!((series.times.len(), series.warm()), (4, 0));
    }

    #[test]
    fn disturbed_frames_are_repeated_and_do_not_count() {
        let mut noise = noise(4, 0.01);
        let series =
            run(&LIMITS, |i| if (12..30).contains(&i) { (17.0, true) } else { (noise(), i % 5 == 4) });
        let counted = series.counted();
        assert!(counted.len() >= LIMITS.fewest && !series.is_noisy());
        // Where everything is disturbed, the case ends all the same, and all frames count.
        let series = run(&LIMITS, |_| (noise(), true));
        let [after, disturbed] = series.disturbances();
        assert!(after == disturbed && after <= 2 * LIMITS.most && series.is_noisy());
    }
}
