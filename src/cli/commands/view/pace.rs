//! The resolution of a picture that moves: as fine as the time of a frame allows.

use std::f64::consts::SQRT_2;

/// Number of levels: the sides of the coarsest picture are an eighth of the full ones.
pub(super) const LEVELS: usize = 13;

/// The level before any is measured: a quarter of the sides.
const FIRST: usize = 8;

/// Levels from one refinement to the next: the sides double.
pub(super) const REFINEMENT: usize = 4;

/// Share of the time that pictures may take, because times vary.
const SAFE: f64 = 0.85;

/// Share of it that is predicted for a finer picture, so that levels do not alternate.
const FINER: f64 = 0.8;

/// Follows the time of pictures that move: from level to level it changes as the number of pixels, or less.
#[derive(Debug)]
pub(super) struct Pace {
    /// Milliseconds of a frame while the picture moves.
    budget: f64,
    /// Milliseconds of a frame besides the picture: the panel, and showing both.
    rest: f64,
    level: usize,
    /// Milliseconds of the last picture, if it was of this level.
    last: Option<f64>,
}

impl Pace {
    pub(super) fn new(budget: f64) -> Self {
        Self { budget, rest: 0.0, level: FIRST, last: None }
    }

    /// Begins anew, with another technique or size.
    pub(super) fn forget(&mut self) {
        (self.level, self.last) = (FIRST, None);
    }

    /// Returns the level of the next picture while it moves.
    pub(super) fn level(&self) -> usize {
        self.level
    }

    /// Records the time of a frame besides the picture.
    pub(super) fn learn_rest(&mut self, ms: f64) {
        self.rest = if self.rest == 0.0 { ms } else { 0.5 * (self.rest + ms) };
    }

    /// Records the time of a picture of this level.
    pub(super) fn learn(&mut self, ms: f64) {
        // However slow the panel is, the picture gets something.
        let room = SAFE * (self.budget - self.rest).max(0.1 * self.budget);
        // A single slow frame may have been disturbed, unless it is very slow.
        let is_slow = ms > room && (ms > 2.0 * self.budget || self.last.is_some_and(|last| last > room));
        let before = self.level;
        if is_slow {
            let mut predicted = ms;
            while predicted > room && self.level + 1 < LEVELS {
                self.level += 1;
                predicted /= SQRT_2;
            }
        } else {
            let mut predicted = self.last.unwrap_or(0.0).max(ms) * SQRT_2;
            while predicted <= FINER * room && self.level > 0 {
                self.level -= 1;
                predicted *= SQRT_2;
            }
        }
        self.last = (self.level == before).then_some(ms);
    }
}

/// Returns the sides of the picture at a level, relative to the full ones.
pub(super) fn side(level: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let level = level as f64;
    (-0.25 * level).exp2()
}

/// Returns the image size at a level.
pub(super) fn reduced(extent: [u32; 2], level: usize) -> [u32; 2] {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 1 and the side")]
    extent.map(|full| (f64::from(full) * side(level)).round().max(1.0) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of a picture that takes `fixed` milliseconds and `each` more for all pixels: the levels, and the times.
    fn run(pace: &mut Pace, fixed: f64, each: f64, frames: usize) -> Vec<(usize, f64)> {
        let frame = |_| {
            let level = pace.level();
            let ms = fixed + each * side(level).powi(2);
            pace.learn_rest(15.0);
            pace.learn(ms);
            (level, ms)
        };
        (0..frames).map(frame).collect()
    }

    #[test]
    fn frames_keep_the_budget_and_are_as_fine_as_it_allows() {
        // Of 100 ms the pictures get 0.85 * 85; a finer one is tried where it takes less than 0.8 of that if its time grows as its pixels.
        for (fixed, each, coarsest) in [(0.1, 20.0, 0), (2.0, 150.0, 4), (5.0, 900.0, 9), (40.0, 100.0, 8)] {
            let mut pace = Pace::new(100.0);
            let frames = run(&mut pace, fixed, each, 20);
            assert_eq!(frames[0].0, FIRST);
            let settled = &frames[8..];
            assert!(settled.iter().all(|(_, ms)| ms + 15.0 <= 100.0), "{frames:?}");
            assert!(settled.iter().all(|(level, _)| level == &settled[0].0), "{frames:?}");
            assert!(settled[0].0 <= coarsest, "{frames:?}");
        }
    }

    #[test]
    fn slower_views_are_followed_and_single_frames_are_not() {
        let mut pace = Pace::new(100.0);
        let before = run(&mut pace, 0.0, 60.0, 12)[11].0;
        pace.learn(120.0);
        assert_eq!(pace.level(), before);
        let slower = run(&mut pace, 0.0, 1200.0, 12);
        assert!(slower[4..].iter().all(|(_, ms)| *ms <= 72.25), "{slower:?}");
        assert_eq!(run(&mut pace, 5000.0, 5000.0, 12)[11].0, LEVELS - 1);
        assert_eq!(run(&mut pace, 0.0, 1.0, 12)[11].0, 0);
        pace.forget();
        assert_eq!(pace.level(), FIRST);
    }

    #[test]
    fn sizes_never_vanish() {
        assert_eq!(reduced([512, 384], 0), [512, 384]);
        assert_eq!(reduced([512, 384], 4), [256, 192]);
        assert_eq!(reduced([3, 1], LEVELS - 1), [1, 1]);
    }
}
