//! Histograms of scalars.

use serde::Serialize;
#[cfg(any(test, feature = "window"))]
use volraster::scene::Data;
use volraster::scene::{Grid, Samples};

/// Maximum number of classes.
const CLASSES: usize = 64;

/// A histogram with classes of equal width. It leaves out NaN and infinite values.
#[derive(Debug, PartialEq, Serialize)]
pub(crate) struct Histogram {
    /// Smallest value of the first class.
    pub(crate) first: f64,
    /// Width of each class.
    pub(crate) width: f64,
    /// Number of samples in each class.
    pub(crate) counts: Vec<u64>,
}

impl Histogram {
    /// Computes the histogram of a grid over its range. Classes of integer data contain equally many codes, so that
    /// the classes cause no pattern.
    pub(crate) fn of(grid: &Grid) -> Self {
        let grid = &*grid.overview();
        let (samples, rescale) = (grid.samples(), grid.rescale());
        let [lo, hi] = grid.range();
        let unit = rescale.slope.abs();
        let (first, width, count) = match samples {
            Samples::U8(_) | Samples::U16(_) | Samples::I16(_) => {
                // There are at most 2^16 codes; where float64 cannot separate the values, classes are merely coarser.
                let codes = whole((hi - lo) / unit).min(0xffff) + 1;
                let each = codes.div_ceil(CLASSES);
                (lo - unit / 2.0, each as f64 * unit, codes.div_ceil(each))
            }
            Samples::F32(_) | Samples::OnDemand(_) => Self::even(lo, hi),
        };
        let values = (0..samples.len()).map(|i| rescale.slope * samples.get(i) + rescale.intercept);
        Self::count([first, width], count, values.filter(|value| value.is_finite()))
    }

    /// Computes the histogram of values in a range; values outside are left out.
    pub(crate) fn of_values([lo, hi]: [f64; 2], values: &[f32]) -> Self {
        let (first, width, count) = Self::even(lo, hi);
        let values = values.iter().map(|&value| f64::from(value));
        Self::count([first, width], count, values.filter(|value| (lo..=hi).contains(value)))
    }

    fn even(lo: f64, hi: f64) -> (f64, f64, usize) {
        if hi > lo { (lo, (hi - lo) / CLASSES as f64, CLASSES) } else { (lo, 1.0, 1) }
    }

    fn count([first, width]: [f64; 2], classes: usize, values: impl Iterator<Item = f64>) -> Self {
        let mut counts = vec![0; classes];
        for value in values {
            let class = whole(((value - first) / width).floor());
            counts[class.min(classes - 1)] += 1;
        }
        Self { first, width, counts }
    }

    /// Computes the histogram of the scalars of data; `None` where they have none.
    #[cfg(any(test, feature = "window"))]
    pub(crate) fn of_data(data: &Data) -> Option<Self> {
        match data {
            Data::Grid(grid) => Some(Self::of(grid)),
            Data::Mesh(mesh) => Some(Self::of_values(mesh.range(), mesh.scalars().values())),
            Data::Points(points) => Some(Self::of_values(points.range(), points.scalars()?)),
            _ => None,
        }
    }

    /// Returns the logarithm of each count relative to that of the largest, from 0 to 1.
    pub(crate) fn heights(&self) -> impl Iterator<Item = f64> {
        let height = |count: u64| ((1 + count) as f64).ln();
        let most = height(self.counts.iter().copied().max().unwrap_or(0).max(1));
        self.counts.iter().map(move |&count| height(count) / most)
    }

    /// Returns one character per class, as high as the logarithm of its count.
    pub(crate) fn sketch(&self) -> String {
        const BARS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
        let bar = |height: f64| {
            // Classes that are not empty are always visible.
            if height == 0.0 { BARS[0] } else { BARS[whole(8.0 * height).clamp(1, 8)] }
        };
        self.heights().map(bar).collect()
    }
}

/// Rounds to the nearest integer; saturates, and NaN gives 0.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounds and saturates, as it says"
)]
fn whole(value: f64) -> usize {
    value.round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use volraster::scene::Rescale;

    #[test]
    fn classes_of_integers_hold_equally_many_codes() {
        let codes = (0..=255_u8).cycle().take(512).collect();
        let even = Histogram::of(&Grid::new([8, 8, 8], Samples::U8(codes)).unwrap());
        assert_eq!((even.first, even.width), (-0.5, 4.0));
        assert_eq!(even.counts, vec![8; 64]);
        let mask = Grid::new([2, 2, 2], Samples::U8(vec![3, 3, 3, 3, 3, 3, 5, 5])).unwrap();
        assert_eq!(Histogram::of(&mask).counts, [6, 0, 2]);
        let flipped = mask.with_rescale(Rescale { slope: -0.5, intercept: 9.0 }).unwrap();
        assert_eq!(Histogram::of(&flipped).counts, [2, 0, 6]);
    }

    #[test]
    fn values_that_are_not_finite_are_not_counted() {
        let values = vec![f32::NAN, f32::INFINITY, 0.0, 1.0, 1.0, 1.0, 0.5, f32::NEG_INFINITY];
        let histogram = Histogram::of(&Grid::new([2, 2, 2], Samples::F32(values)).unwrap());
        assert_eq!(histogram.counts.iter().sum::<u64>(), 5);
        assert_eq!((histogram.counts[0], histogram.counts[32], histogram.counts[63]), (1, 1, 3));
        assert_eq!(histogram.sketch().chars().next_back(), Some('█'));
        assert_eq!(histogram.sketch().chars().filter(|&c| c != ' ').count(), 3);
        let flat = Histogram::of(&Grid::new([2, 2, 2], Samples::F32(vec![2.0; 8])).unwrap());
        assert_eq!((flat.counts.as_slice(), flat.sketch().as_str()), ([8].as_slice(), "█"));
    }

    #[test]
    fn values_outside_of_the_range_are_left_out() {
        let histogram = Histogram::of_values([0.0, 64.0], &[-1.0, 0.0, 0.5, 63.0, 64.0, 65.0, f32::NAN]);
        assert_eq!((histogram.counts[0], histogram.counts[63]), (2, 2));
        assert_eq!(histogram.counts.iter().sum::<u64>(), 4);
    }
}
