//! Pixels with known colours, and the estimate of an image's error from them.

use crate::error::Result;
use crate::image::Image;
use crate::num;
use crate::reference;
use crate::scene::field::random;
use crate::scene::{Scene, View};

/// 95 % quantile of the normal distribution.
const ONE_SIDED_95: f64 = 1.645;

/// One random pixel in each of equal rectangles of the image, with its true colour.
#[derive(Clone, Debug)]
pub(super) struct Probes {
    pixels: Vec<[u32; 2]>,
    truth: Vec<[f64; 4]>,
    /// Number of pixels that each represents.
    weights: Vec<f64>,
}

/// An estimate of an image's error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Root mean square error over the probes and the four channels of premultiplied colour.
    pub rmse: f64,
    /// Upper bound of the error of all pixels with 95 % confidence; equals `rmse` if all pixels were
    /// compared.
    pub bound: f64,
    /// Number of compared pixels.
    pub pixels: u32,
}

impl Probes {
    /// Largest number of pixels for a trial. Their float64 rays cost less than a frame of a fine setting.
    pub(super) const MOST: u32 = 4096;

    /// Selects at most `most` pixels and computes their colours.
    ///
    /// # Errors
    ///
    /// As [`reference::pixels`].
    pub(super) fn new(scene: &Scene, view: &View, most: u32) -> Result<Self> {
        let (pixels, weights): (Vec<_>, _) = spread(view.extent(), most).into_iter().unzip();
        Ok(Self { truth: reference::pixels(scene, view, &pixels)?, pixels, weights })
    }

    /// Estimates the error of an image of the view.
    pub(super) fn error(&self, image: &Image) -> Estimate {
        let squares = self.pixels.iter().zip(&self.truth).map(|(&[x, y], truth)| {
            let found = image.pixel(x, y);
            found.iter().zip(truth).map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>() * 0.25
        });
        estimate(&squares.collect::<Vec<_>>(), &self.weights)
    }
}

/// Estimates the root mean square and its bound from squared errors at random pixels.
///
/// The weight of a pixel is the number of pixels that it represents.
fn estimate(squares: &[f64], weights: &[f64]) -> Estimate {
    let pixels = num::count(squares.len());
    if squares.iter().any(|square| !square.is_finite()) {
        // A NaN counts as an infinite error.
        return Estimate { rmse: f64::INFINITY, bound: f64::INFINITY, pixels };
    }
    let all = weights.iter().sum::<f64>().max(1.0);
    let mean = squares.iter().zip(weights).map(|(square, weight)| square * weight).sum::<f64>() / all;
    let spread = squares.iter().map(|square| (square - mean).powi(2)).sum::<f64>();
    let spread = spread / (f64::from(pixels) - 1.0).max(1.0);
    // Factor of the mean's own variance, as if each rectangle varied as much as the whole image; zero for
    // pixels that represent only themselves.
    let shares = weights.iter().map(|weight| (weight / all).powi(2) * (1.0 - 1.0 / weight)).sum::<f64>();
    let bound = (mean + ONE_SIDED_95 * (spread * shares).sqrt()).sqrt();
    Estimate { rmse: mean.sqrt(), bound, pixels }
}

/// Selects a random pixel in each of at most `most` equal rectangles, with the number of pixels in the
/// rectangle, or all pixels if there are no more than that.
fn spread([width, height]: [u32; 2], most: u32) -> Vec<([u32; 2], f64)> {
    let all = f64::from(width) * f64::from(height);
    let share = (f64::from(most) / all).sqrt();
    let [mut across, mut down] = [width, height].map(|side| {
        if all <= f64::from(most) {
            side
        } else {
            num::u32_of((f64::from(side) * share).floor()).clamp(1, side)
        }
    });
    // In a long image, one side gets the share that the other cannot use.
    across = across.min(most);
    down = down.min(most / across).max(1);
    let mut state = 1;
    let mut pixels = Vec::with_capacity(num::index(across) * num::index(down));
    for j in 0..down {
        for i in 0..across {
            let (x, columns) = place(i, across, width, random(&mut state));
            let (y, rows) = place(j, down, height, random(&mut state));
            pixels.push(([x, y], columns * rows));
        }
    }
    pixels
}

/// Returns a position in the i-th of `count` parts of a side, and the length of the part.
fn place(i: u32, count: u32, side: u32, at: f64) -> (u32, f64) {
    let cut = |i: u32| u64::from(i) * u64::from(side) / u64::from(count);
    let (begin, length) = (cut(i), num::f64_of_u64(cut(i + 1) - cut(i)));
    let at = begin + num::u64_of((length * at).floor().min(length - 1.0));
    (u32::try_from(at).unwrap_or(side - 1), length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_spread_and_small_images_are_known_whole() {
        for extent in [[1, 1], [64, 64], [17, 5], [4096, 1]] {
            let mut pixels = spread(extent, 4096);
            assert!(pixels.iter().all(|(_, weight)| *weight == 1.0));
            pixels.sort_unstable_by_key(|(pixel, _)| *pixel);
            pixels.dedup();
            assert_eq!(pixels.len(), num::index(extent[0] * extent[1]), "{extent:?}");
        }
        for extent in [[512, 512], [16384, 1], [1, 16384], [3000, 7], [65, 64]] {
            let pixels = spread(extent, 4096);
            assert!((2000..=4096).contains(&pixels.len()), "{extent:?}: {}", pixels.len());
            assert!(pixels.iter().all(|([x, y], _)| *x < extent[0] && *y < extent[1]));
            let weight = |pixels: &[([u32; 2], f64)]| pixels.iter().map(|(_, weight)| weight).sum::<f64>();
            assert_eq!(weight(&pixels), f64::from(extent[0] * extent[1]));
            // Half of the image has half of the weight.
            let is_left = |([x, _], _): &([u32; 2], f64)| 2 * x < extent[0];
            let left: Vec<_> = pixels.iter().copied().filter(is_left).collect();
            let share = weight(&left) / weight(&pixels);
            assert!(extent[0] == 1 || (share - 0.5).abs() < 0.03, "{extent:?}: {share}");
        }
    }

    /// For random numbers with a heavy tail the bound fails about once in twenty samples, or slightly more
    /// often.
    #[test]
    fn the_bound_holds_as_often_as_it_says() {
        let mut state = 5;
        let all: Vec<f64> = (0..40_000).map(|_| random(&mut state).powi(8)).collect();
        let truth = (all.iter().sum::<f64>() / all.len() as f64).sqrt();
        let trials = 1000;
        let mut broken = 0;
        for _ in 0..trials {
            let some: Vec<f64> =
                (0..1000).map(|_| all[num::usize_of(random(&mut state) * all.len() as f64)]).collect();
            let found = estimate(&some, &[all.len() as f64 / 1000.0; 1000]);
            assert!(found.bound > found.rmse && found.bound < 1.2 * found.rmse);
            broken += u32::from(found.bound < truth);
        }
        assert!((20..90).contains(&broken), "{broken} of {trials}");
        let whole = estimate(&all, &vec![1.0; all.len()]);
        assert_eq!(whole.bound, whole.rmse);
        assert_eq!(estimate(&[0.0, f64::NAN], &[4.0, 5.0]).bound, f64::INFINITY);
        // Larger weights count more.
        assert_eq!(estimate(&[4.0, 0.0], &[1.0, 3.0]).rmse, 1.0);
    }
}
