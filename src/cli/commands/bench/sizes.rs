//! The size of a suite's images and the time of each case, such that the suite ends within its time on a device of any speed.
//!
//! Some settings of each scene are drawn at two small sizes. Times grow linearly with the number of pixels, so that these tell what
//! the suite takes at each size of a ladder. What they do not tell is balanced on the way: each view gets its part of the time left.

use std::sync::Arc;
use std::time::Instant;

use volraster::reference::{self, ReferenceOptions};
use volraster::scene::View;
use volraster::{Gpu, GpuScene, Result};

use super::scenes::{StandardScene, Suite};
use super::series::Limits;
use super::sweeps::{Given, SIZES, Setting};
use crate::cli::in_flight::InFlight;
use crate::cli::input::{Size, is_refusal};
use crate::cli::interrupt;
use crate::cli::timing::milliseconds_since;

/// The ladder: eighths of their own size that images may have, in descending order.
const PARTS: [u32; 5] = [8, 6, 4, 3, LEAST];

/// The smallest of them.
pub(super) const LEAST: u32 = 2;

/// Eighths of their own size at which images are tried.
const TRIED: [u32; 2] = [2, 4];

/// The part of the time left that the predicted time may fill.
const FILLED: f64 = 0.9;

/// The part of the time left that is for timed frames; the rest is for checks and references.
const TIMED: f64 = 0.6;

/// First frames of a case with all that they need: one is checked, and one counts.
const FIRST_FRAMES: f64 = 2.0;

/// Sizes of images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sizes {
    /// Eighths of the scenes' own sizes along each side.
    Eighths(u32),
    /// One size for all, without further sizes of a scene.
    All(Size),
}

impl Sizes {
    /// The scenes' own sizes.
    pub(super) const OWN: Self = Self::Eighths(8);

    /// Returns the size of an image whose own size is given.
    pub(super) fn of(self, own: Size) -> Size {
        match self {
            Self::Eighths(n) => {
                Size { width: (own.width * n).div_ceil(8), height: (own.height * n).div_ceil(8) }
            }
            Self::All(size) => size,
        }
    }

    /// Returns further sizes of a scene from the sides of its square images.
    pub(super) fn further(self, sides: &[u32]) -> Vec<Size> {
        let square = |&side: &u32| self.of(Size { width: side, height: side });
        if let Self::All(_) = self { Vec::new() } else { sides.iter().map(square).collect() }
    }
}

/// A time at two numbers of pixels, between and beyond which it is linear.
#[derive(Clone, Copy, Debug)]
struct Line {
    pixels: [f64; 2],
    ms: [f64; 2],
}

impl Line {
    /// Returns the time at a number of pixels, at least that of the fewest pixels.
    fn at(&self, pixels: f64) -> f64 {
        let [few, more] = self.pixels;
        let slope = (self.ms[1] - self.ms[0]) / (more - few);
        (self.ms[0] + slope * (pixels - few)).max(self.ms[0])
    }
}

/// A setting that was tried, in milliseconds.
#[derive(Clone, Copy, Debug)]
struct Tried {
    /// Building its pipelines.
    build: f64,
    /// The first frame, with all that it needs but pipelines.
    first: Line,
    /// A further frame.
    frame: Line,
    /// Cases that it stands for.
    cases: f64,
}

impl Tried {
    /// Predicts what its cases take.
    fn ms(&self, pixels: f64, limits: &Limits) -> f64 {
        let each = FIRST_FRAMES * self.first.at(pixels) + timed(limits, self.frame.at(pixels));
        self.cases * (self.build + each)
    }
}

/// The costs of the views of a scene.
#[derive(Debug)]
struct Cost {
    reference: Line,
    tried: Vec<Tried>,
    /// For each view its cases, as a part of those that were tried, and its own size.
    views: Vec<(f64, Size)>,
}

impl Cost {
    /// Draws some settings of the first view of a scene at two sizes.
    fn measure(gpu: &Gpu, suite: &Suite, standard: &StandardScene, given: &Given) -> Result<Self> {
        let scene = GpuScene::new(gpu, standard.load()?);
        let [small, large] = TRIED.map(|part| standard.views(Sizes::Eighths(part).of(suite.size)));
        let views = [small?, large?].map(|views| views[0].1);
        let pixels = views.map(|view| view.extent().map(f64::from).iter().product());
        let time = |view| {
            let begin = Instant::now();
            reference::render(scene.scene(), view, &ReferenceOptions::default(), None)?;
            Result::Ok(milliseconds_since(begin))
        };
        let reference = Line { pixels, ms: [time(&views[0])?, time(&views[1])?] };
        let mut kinds: Vec<Vec<Setting>> = Vec::new();
        for setting in given.fitting(suite.sweeps, scene.scene())? {
            match kinds.iter_mut().find(|kind| kind[0].kind() == setting.kind()) {
                Some(kind) => kind.push(setting),
                None => kinds.push(vec![setting]),
            }
        }
        let mut tried = Vec::new();
        for kind in &kinds {
            // Two settings of each technique and route, if it has two: a quarter and three quarters of the way through them.
            let mut places = vec![kind.len() / 4, 3 * kind.len() / 4];
            places.dedup();
            let cases = kind.len() as f64 / places.len() as f64;
            for place in places {
                if interrupt::requested() {
                    return Ok(Self { reference, tried, views: Vec::new() });
                }
                let few = frames(&scene, &kind[place], &views[0])?;
                let more = frames(&scene, &kind[place], &views[1])?;
                let again = frames(&scene, &kind[place], &views[0])?;
                let line = |i: usize| Line { pixels, ms: [again[i], more[i]] };
                let build = (few[0] - again[0]).max(0.0);
                tried.push(Tried { build, first: line(0), frame: line(1), cases });
            }
        }
        let cases = kinds.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let part = given.fitting(SIZES, scene.scene())?.len() as f64 / cases;
        let further = Sizes::OWN.further(standard.sides).into_iter().map(|size| (part, size));
        let views = std::iter::repeat_n((1.0, suite.size), standard.views).chain(further).collect();
        Ok(Self { reference, tried, views })
    }

    /// Predicts the milliseconds that the scene takes at a part of its sizes.
    fn ms(&self, part: u32, limits: &Limits) -> f64 {
        let of_view = |&(cases, own): &(f64, Size)| {
            let Size { width, height } = Sizes::Eighths(part).of(own);
            let pixels = f64::from(width) * f64::from(height);
            let tried: f64 = self.tried.iter().map(|tried| tried.ms(pixels, limits)).sum();
            self.reference.at(pixels) + cases * tried
        };
        self.views.iter().map(of_view).sum()
    }

    /// Returns the number of cases of all views.
    fn cases(&self) -> f64 {
        let parts: f64 = self.views.iter().map(|(part, _)| part).sum();
        parts * self.tried.iter().map(|tried| tried.cases).sum::<f64>()
    }
}

/// Returns the times of the first frame of a setting, with all that it needs, and of a further one; 0 for what the device refuses.
fn frames(scene: &Arc<GpuScene>, setting: &Setting, view: &View) -> Result<[f64; 2]> {
    let begin = Instant::now();
    let draw = || {
        let mut frames = InFlight::new(scene, setting.technique, view, 1)?;
        frames.draw(view)?;
        Ok([milliseconds_since(begin), frames.draw(view)?.wall_ms])
    };
    match draw() {
        Err(error) if is_refusal(&error) => Ok([0.0; 2]),
        drawn => drawn,
    }
}

/// Returns the milliseconds for which a case with a time per frame is timed: twice its fewest frames, some of which warm up.
fn timed(limits: &Limits, ms: f64) -> f64 {
    let frames = if limits.adapts { limits.most.min(2 * limits.fewest) } else { limits.most };
    (frames as f64 * ms).min(limits.enough_ms.max(limits.fewest as f64 * ms))
}

/// The time of a suite.
#[derive(Debug)]
pub(super) struct Pace {
    end: Instant,
    /// Cases not yet measured.
    cases: f64,
}

impl Pace {
    /// Returns how the scenes of a suite share the time until its end, and the most eighths of their sizes at which they end in
    /// time; `None` if they end at none.
    ///
    /// # Errors
    ///
    /// Errors of the device other than refusals.
    pub(super) fn of(
        gpu: &Gpu,
        suite: &Suite,
        scenes: &[&StandardScene],
        given: &Given,
        limits: &Limits,
        end: Instant,
    ) -> Result<(Self, Option<u32>)> {
        let cost = |scene: &&StandardScene| Cost::measure(gpu, suite, scene, given);
        let costs = scenes.iter().map(cost).collect::<Result<Vec<_>>>()?;
        let cases = costs.iter().map(Cost::cases).sum();
        let pace = Self { end, cases };
        let part = choose(&costs, limits, pace.left_ms());
        Ok((pace, part))
    }

    fn left_ms(&self) -> f64 {
        self.end.saturating_duration_since(Instant::now()).as_secs_f64() * 1e3
    }

    /// Takes the next cases, and returns the milliseconds after which each of them is not timed further.
    pub(super) fn take(&mut self, cases: usize) -> f64 {
        let each = TIMED * self.left_ms() / self.cases.max(cases as f64);
        self.cases -= cases as f64;
        each
    }
}

/// Returns the most eighths of the sizes at which scenes end in time.
fn choose(costs: &[Cost], limits: &Limits, left_ms: f64) -> Option<u32> {
    let ms = |part| costs.iter().map(|cost| cost.ms(part, limits)).sum::<f64>();
    PARTS.into_iter().find(|&part| ms(part) <= FILLED * left_ms)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const SIZE: Size = Size { width: 512, height: 256 };

    #[test]
    fn the_largest_size_that_ends_in_time_is_chosen() {
        let limits = Limits { fewest: 5, most: 20, enough_ms: 1e9, adapts: true };
        let pixels = [64.0 * 32.0, 128.0 * 64.0];
        // A millisecond for 2048 pixels, and one for each frame: 10 frames of 65 ms at the full size, two first frames of 130.
        let [first, frame] = [[2.0, 8.0], [2.0, 5.0]].map(|ms| Line { pixels, ms });
        let reference = Line { pixels, ms: [10.0, 40.0] };
        let tried = Tried { build: 1.0, first, frame, cases: 25.0 };
        let cost = || Cost { reference, tried: vec![tried; 3], views: vec![(1.0, SIZE), (1.0 / 3.0, SIZE)] };
        assert_eq!(cost().cases(), 100.0);
        let full = 2.0 * 640.0 + 100.0 * (1.0 + 2.0 * 128.0 + 10.0 * 65.0);
        assert!((cost().ms(8, &limits) / full - 1.0).abs() < 1e-12, "{}", cost().ms(8, &limits));
        let chosen = |of_full: f64| choose(&[cost()], &limits, of_full * full / FILLED);
        assert_eq!([chosen(1.01), chosen(0.99), chosen(0.3)], [Some(8), Some(6), Some(4)]);
        assert_eq!([chosen(0.1), chosen(0.01)], [Some(2), None]);
        // Two scenes share the time.
        assert_eq!(choose(&[cost(), cost()], &limits, 1.01 * full / FILLED), Some(4));
        // Times that fall with the number of pixels are noise.
        assert_eq!(Line { pixels, ms: [2.0, 1.0] }.at(1e6), 2.0);
    }

    #[test]
    fn cases_are_timed_no_longer_than_their_limits() {
        let adapts = Limits { fewest: 5, most: 20, enough_ms: 100.0, adapts: true };
        assert_eq!([timed(&adapts, 1.0), timed(&adapts, 15.0), timed(&adapts, 30.0)], [10.0, 100.0, 150.0]);
        assert_eq!(timed(&Limits { adapts: false, ..adapts }, 1.0), 20.0);
    }

    #[test]
    fn each_view_gets_its_part_of_the_time_left() {
        let mut pace = Pace { end: Instant::now() + Duration::from_secs(100), cases: 50.0 };
        let each = pace.take(30);
        assert!((each - TIMED * 2000.0).abs() < 20.0, "{each}");
        // All others were quick.
        let each = pace.take(20);
        assert!((each - TIMED * 5000.0).abs() < 50.0, "{each}");
        let mut late = Pace { end: Instant::now(), cases: 5.0 };
        assert_eq!([late.take(5), late.take(1)], [0.0; 2]);
    }

    #[test]
    fn parts_of_sizes_keep_their_shape() {
        assert_eq!(Sizes::Eighths(3).of(SIZE), Size { width: 192, height: 96 });
        assert_eq!(
            Sizes::Eighths(4).further(&[256, 1024]).iter().map(|size| size.width).collect::<Vec<_>>(),
            [128, 512]
        );
        let one = Size { width: 96, height: 96 };
        assert_eq!((Sizes::All(one).of(SIZE), Sizes::All(one).further(&[256])), (one, Vec::new()));
    }
}
