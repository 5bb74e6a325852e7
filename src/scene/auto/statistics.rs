//! Histograms, quantiles and subsets of values, and knots at quantiles.

use std::ops::RangeInclusive;

use glam::DVec3;

use crate::error::Result;
use crate::num;
use crate::scene::{Knot, TransferFunction};

/// Largest number of samples or cells in the histogram.
pub(super) const SAMPLES: usize = 1 << 20;
/// Number of rays along each axis on which optical depth is measured.
pub(super) const RAYS: usize = 4096;
pub(super) const BINS: usize = 256;

/// A histogram of values.
pub(super) struct Histogram {
    pub(super) low: f64,
    width: f64,
    pub(super) counts: [usize; BINS],
}

impl Histogram {
    /// Counts ascending values, all of which lie in `range`.
    pub(super) fn new(values: &[f64], range: [f64; 2]) -> Self {
        // Leave out outliers, which would squeeze everything else into a few bins. Very few samples may leave
        // nothing else: use the whole range then.
        let inner = [quantile(values, 0.001), quantile(values, 0.999)];
        let [low, high] = if inner[0] < inner[1] { inner } else { range };
        let mut histogram = Self { low, width: (high - low) / num::f64_of(BINS), counts: [0; BINS] };
        for &s in values {
            histogram.counts[histogram.bin(s)] += 1;
        }
        histogram
    }

    /// Returns the bin of a value; values beyond the ends belong to the bins at the ends.
    pub(super) fn bin(&self, s: f64) -> usize {
        num::usize_of((s - self.low) / self.width).min(BINS - 1)
    }

    /// Returns the fullest bin.
    pub(super) fn peak(&self) -> usize {
        (0..BINS).max_by_key(|&bin| (self.counts[bin], BINS - bin)).unwrap_or(0)
    }

    /// Returns the foot of a peak on one side.
    ///
    /// The foot is where the histogram lies farthest below the straight line from the top of the peak to the
    /// end of the tail (Zack, Rogers and Latt 1977).
    pub(super) fn foot(&self, peak: usize, upwards: bool) -> f64 {
        let tail = if upwards { BINS - 1 - peak } else { peak };
        let at = |i: usize| if upwards { peak + i } else { peak - i };
        let top = num::f64_of(self.counts[peak]);
        let drop = top / num::f64_of(tail);
        // A second peak close by is background too: air beside padding, noise beside zero.
        let near = |i: usize| (i..=tail.min(i + BINS / 16)).map(|i| self.counts[at(i)]).max().unwrap_or(0);
        let below = |i: usize| top - drop * num::f64_of(i) - num::f64_of(near(i));
        let foot = (1..=tail).max_by(|&a, &b| below(a).total_cmp(&below(b)).then(b.cmp(&a)));
        // The foot is the edge of its bin that is nearer to the peak.
        let edge = match foot {
            None => peak + usize::from(upwards),
            Some(foot) => at(foot) + usize::from(!upwards),
        };
        self.low + self.width * num::f64_of(edge)
    }
}

/// Returns the step that selects about `wanted` of `count` items.
///
/// Large steps are odd and no multiple of small primes, so that the subset does not follow one column of a
/// grid with round extents.
pub(super) fn stride(count: usize, wanted: usize) -> usize {
    let step = count.div_ceil(wanted.max(1)).max(1);
    let shares = |step: usize| [2, 3, 5, 7].iter().any(|factor| step.is_multiple_of(*factor));
    if step < 4 {
        step
    } else {
        (step..).find(|&step| step < 11 && step % 2 == 1 || !shares(step)).unwrap_or(step)
    }
}

/// Returns the finite numbers of a list in ascending order.
pub(super) fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    values
}

/// Returns the numbers of the rays, of `side` at distance `step`, that may pass between two places.
pub(super) fn span([from, to]: [f64; 2], step: f64, side: usize) -> RangeInclusive<usize> {
    num::usize_of((from / step - 1.0).max(0.0))..=num::usize_of(to / step).min(side - 1)
}

/// Returns the optical depths of rays in ascending order, without those of nearly empty ones.
pub(super) fn substantial(mut depths: Vec<f64>) -> Vec<f64> {
    let most = depths.iter().copied().fold(0.0, f64::max);
    depths.retain(|&depth| depth > 0.01 * most);
    sorted(depths)
}

/// Returns the value below which a share of a sorted list lies; NaN for an empty list.
pub(super) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    sorted[num::usize_of((share * num::f64_of(last)).round()).min(last)]
}

/// The optical depth that automatic transfer functions have along the densest tenth of the rays through the data.
pub const DEPTH: f64 = 5.0;
/// Optical depth of the values with the least extinction along the densest tenth of the rays through them alone.
pub(super) const HAZE: f64 = 0.3;
/// For each knot: the share of the foreground's samples below it, and its relative extinction.
pub(super) const RAMP: [(f64, f64); 7] =
    [(0.0, 0.0), (0.25, 0.025), (0.50, 0.08), (0.70, 0.20), (0.85, 0.45), (0.95, 0.80), (0.995, 1.0)];

/// Linear colours of the knots, warm and neutral: from brown for thin and frequent values to white for dense
/// and rare ones.
pub(super) const WARM: [[f64; 3]; RAMP.len()] = [
    [0.24, 0.06, 0.03],
    [0.34, 0.09, 0.04],
    [0.50, 0.17, 0.07],
    [0.68, 0.31, 0.14],
    [0.84, 0.54, 0.30],
    [0.95, 0.82, 0.60],
    [1.0, 0.98, 0.92],
];

/// Linear colours of values below the background, or below zero.
pub(super) const COOL: [[f64; 3]; RAMP.len()] = [
    [0.03, 0.08, 0.24],
    [0.04, 0.12, 0.36],
    [0.06, 0.23, 0.53],
    [0.14, 0.40, 0.70],
    [0.33, 0.62, 0.84],
    [0.62, 0.86, 0.95],
    [0.92, 0.98, 1.0],
];

/// For [`signs`]: where zero is the background, and where nothing is.
pub(super) const TAILS: f64 = 0.1;
pub(super) const HALVES: f64 = 0.3;

/// Returns the magnitude up to which ascending values of both signs reach, if the smaller one is at least `share` of the larger one:
/// less is an undershoot of values that have one sign.
pub(super) fn signs(values: &[f64], share: f64) -> Option<f64> {
    let [least, greatest] = [0.001, 0.999].map(|rank| quantile(values, rank));
    let both = greatest.min(-least);
    (both > 0.0 && both >= share * greatest.max(-least)).then_some(both)
}

/// Returns knots from `foot` upwards and from its negative downwards, at quantiles of the magnitudes above it, so that values of equal
/// magnitude are equally opaque.
pub(super) fn diverging(values: &[f64], foot: f64) -> Vec<Knot> {
    let magnitudes = sorted(values.iter().map(|s| s.abs()).filter(|s| *s > foot).collect());
    let mirrored = ramp(foot, &magnitudes, &COOL).into_iter().rev().map(|knot| Knot { s: -knot.s, ..knot });
    mirrored.chain(ramp(foot, &magnitudes, &WARM)).collect()
}

pub(super) fn knot(s: f64, tau: f64, [r, g, b]: [f64; 3]) -> Knot {
    Knot { s, colour: DVec3::new(r, g, b), tau }
}

/// Returns a transfer function of knots, with extinction scaled for [`DEPTH`] along the densest rays, as `depth`
/// measures it, and at least so that a haze remains.
pub(super) fn hazy(knots: Vec<Knot>, depth: impl Fn(&TransferFunction) -> f64) -> Result<TransferFunction> {
    let scale = DEPTH / depth(&TransferFunction::new(knots.clone())?);
    let haze = HAZE / depth(&TransferFunction::new(vec![knot(0.0, 1.0, WARM[0])])?);
    let scaled = |knot: Knot| Knot { tau: (knot.tau * scale).max(haze), ..knot };
    TransferFunction::new(knots.into_iter().map(scaled).collect())
}

/// Returns knots from the foot of the background upwards, at quantiles of the ascending values above it.
///
/// Extinction is relative to its largest value.
pub(super) fn ramp(foot: f64, above: &[f64], colours: &[[f64; 3]; RAMP.len()]) -> Vec<Knot> {
    let mut knots = vec![knot(foot, RAMP[0].1, colours[0])];
    let mut group = 0;
    for (i, &(rank, tau)) in RAMP.iter().enumerate().skip(1) {
        let s = quantile(above, rank);
        if knots.len() > 1 && s <= knots[knots.len() - 1].s {
            // Quantiles that coincide share one knot, the middle one of them.
            group += 1;
            let middle = i - group / 2;
            let last = knots.len() - 1;
            knots[last] = knot(s, RAMP[middle].1, colours[middle]);
        } else {
            group = 0;
            knots.push(knot(s, tau, colours[i]));
        }
    }
    knots
}

/// Returns knots from the foot downwards, at quantiles of the ascending values below it.
pub(super) fn ramp_down(foot: f64, below: &[f64], colours: &[[f64; 3]; RAMP.len()]) -> Vec<Knot> {
    let mirrored: Vec<f64> = below.iter().rev().map(|s| -s).collect();
    let mut knots = ramp(-foot, &mirrored, colours);
    for knot in &mut knots {
        knot.s = -knot.s;
    }
    knots.reverse();
    knots
}
