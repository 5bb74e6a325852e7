//! 1-D cumulative tables: the mean density between any two scalars in constant time.

use glam::DVec4;

use super::density::Density;
use crate::interface::{CumulativeBin, TableHead};
use crate::num::{f32_of, f64_of, index};
use crate::scene::TransferFunction;

/// Significant bits of a bin's width. So few bits let the device compute every bin's first scalar exactly,
/// relative to the domain's first one. Over 0 to 2^k - 1, bin edges coincide with the integers, where integer
/// data has its jumps. Rounding costs up to a sixteenth of the bins.
const WIDTH_BITS: u32 = 5;

/// The transfer function's density in bins of equal width, with cumulative sums.
#[derive(Clone, Debug)]
pub(crate) struct Cumulative {
    pub(crate) head: TableHead,
    pub(crate) bins: Vec<CumulativeBin>,
}

impl Cumulative {
    /// Divides the domain into `bins` bins, 1 to 65536.
    ///
    /// The width of the bins is rounded up, so the last few bins may lie beyond the domain.
    pub(crate) fn new(transfer: &TransferFunction, bins: u32) -> Self {
        let density = Density::new(transfer);
        let [first, last] = density.domain();
        if first == last {
            let sum = |i| density.last() * f64::from(i);
            let bins = (0..bins).map(|i| bin(sum(i), density.last(), DVec4::ZERO)).collect();
            return Self { head: density.head(0.0, 1.0), bins };
        }
        let width = round_up((last - first) / f64::from(bins), WIDTH_BITS);
        let mut walk = density.walk();
        let mut sum = DVec4::ZERO;
        let bins = (1..=index(bins)).map(|i| {
            let (mean, rise) = walk.to(first + f64_of(i) * width);
            let bin = bin(sum, mean, rise);
            sum += mean;
            bin
        });
        let bins = bins.collect();
        Self { head: density.head(1.0 / width, width), bins }
    }
}

fn bin(sum: DVec4, mean: DVec4, rise: DVec4) -> CumulativeBin {
    let high = sum.to_array().map(|v| f32_of(v).min(f32::MAX));
    let low = std::array::from_fn(|c| {
        let lost = f32_of(sum[c] - f64::from(high[c]));
        if high[c] < f32::MAX { lost } else { 0.0 }
    });
    let mean = mean.to_array().map(f32_of);
    // Limit the rise so that the density stays at or above zero in the whole bin.
    let rise = std::array::from_fn(|c| f32_of(rise[c]).clamp(-2.0 * mean[c], 2.0 * mean[c]));
    CumulativeBin { high, low, mean, rise }
}

/// Returns the least number that is not below the positive `value` and has at most `bits` significant bits.
fn round_up(value: f64, bits: u32) -> f64 {
    let dropped = f64::MANTISSA_DIGITS - bits.clamp(1, f64::MANTISSA_DIGITS);
    let mask = (1_u64 << dropped) - 1;
    f64::from_bits((value.to_bits() + mask) & !mask)
}

#[cfg(test)]
mod tests;
