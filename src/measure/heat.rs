//! Error heat maps.

use crate::error::Result;
use crate::image::Image;
use crate::num;
use crate::reference::ReferenceImage;

use super::errors::{signed_errors, widened};

/// The legend: absolute error, and its sRGB colour (0 to 1) in a PNG.
///
/// | error | colour |
/// |---|---|
/// | 1e-6 and below | black |
/// | 1e-5 | indigo |
/// | 1e-4 | purple |
/// | 1e-3 | crimson |
/// | 1e-2 | orange |
/// | 1e-1 | yellow |
/// | 1 and above | nearly white |
///
/// Between two rows the colour is linear in the logarithm of the error. Lightness rises by about the same
/// amount with every decade, so the order is readable without the legend and in grey.
pub const HEAT_KNOTS: [(f64, [f64; 3]); 7] = [
    (1e-6, [0.0, 0.0, 0.0]),
    (1e-5, [0.17, 0.10, 0.40]),
    (1e-4, [0.45, 0.15, 0.55]),
    (1e-3, [0.80, 0.22, 0.38]),
    (1e-2, [0.97, 0.49, 0.18]),
    (1e-1, [0.99, 0.79, 0.22]),
    (1.0, [1.0, 1.0, 0.88]),
];

/// sRGB colour of a pixel where the image or the truth is NaN or infinite: a cyan that the map does not
/// contain.
pub const HEAT_NON_FINITE: [f64; 3] = [0.0, 1.0, 1.0];

/// Maps the errors of an image: the largest absolute error over the four channels of each pixel, on the
/// logarithmic scale of [`HEAT_KNOTS`].
///
/// [`HEAT_NON_FINITE`] marks NaN and infinities. The pixels are opaque and linear, so the sRGB encoding of a
/// PNG gives the legend's colours.
///
/// # Errors
///
/// [`crate::error::Error::Invalid`] if the sizes differ.
pub fn heat_map(image: &Image, truth: &Image) -> Result<Image> {
    heat_map_f64(image, &widened(truth)?)
}

/// Maps the errors against a float64 truth, which is not rounded.
///
/// # Errors
///
/// As [`heat_map`].
pub fn heat_map_f64(image: &Image, truth: &ReferenceImage) -> Result<Image> {
    let pixels = signed_errors(image, truth)?.map(|errors| {
        // No error is NaN here: `signed_errors` makes them infinite.
        let error = errors.iter().fold(0.0, |max: f64, e| max.max(e.abs()));
        let [r, g, b] = colour(error).map(|c| num::f32_of(linear(c)));
        [r, g, b, 1.0]
    });
    Image::new(image.width(), image.height(), pixels.collect())
}

/// Returns the sRGB colour of an absolute error.
fn colour(error: f64) -> [f64; 3] {
    if error.is_infinite() {
        return HEAT_NON_FINITE;
    }
    let above = HEAT_KNOTS.partition_point(|knot| knot.0 <= error);
    let Some(start) = above.checked_sub(1) else { return HEAT_KNOTS[0].1 };
    let (from, low) = HEAT_KNOTS[start];
    let Some(&(to, high)) = HEAT_KNOTS.get(above) else { return low };
    let w = (error / from).ln() / (to / from).ln();
    std::array::from_fn(|c| low[c] + (high[c] - low[c]) * w)
}

/// Decodes sRGB (IEC 61966-2-1).
fn linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns CIE L* of an sRGB colour.
    fn lightness(srgb: [f64; 3]) -> f64 {
        let [r, g, b] = srgb.map(linear);
        let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        if y > 216.0 / 24389.0 { 116.0 * y.cbrt() - 16.0 } else { y * 24389.0 / 27.0 }
    }

    #[test]
    fn lightness_rises_with_the_error_by_similar_amounts() {
        let knots: Vec<f64> = HEAT_KNOTS.iter().map(|knot| lightness(knot.1)).collect();
        for pair in knots.windows(2) {
            let step = pair[1] - pair[0];
            assert!((11.0..22.0).contains(&step), "{knots:?}");
        }
        let mut previous = -1.0;
        for i in 0..=600 {
            let l = lightness(colour(10.0_f64.powf(f64::from(i) / 100.0 - 6.0)));
            assert!(l > previous, "step {i}: {l} after {previous}");
            previous = l;
        }
    }

    #[test]
    fn the_legend_holds_and_the_ends_clamp() {
        for (error, want) in HEAT_KNOTS {
            for (got, want) in colour(error).into_iter().zip(want) {
                assert!((got - want).abs() < 1e-12, "{error:e}");
            }
        }
        assert_eq!(colour(0.0), HEAT_KNOTS[0].1);
        assert_eq!(colour(1e-9), HEAT_KNOTS[0].1);
        assert_eq!(colour(1e30), HEAT_KNOTS[6].1);
        let middle = colour(1e-4 * 10.0_f64.sqrt());
        assert!((middle[0] - 0.625).abs() < 1e-12, "{middle:?}");
    }

    #[test]
    fn pixels_show_their_own_error_and_nan_stands_out() {
        let truth = Image::new(5, 1, vec![[0.5; 4]; 5]).unwrap();
        let mut pixels = vec![[0.5_f32; 4]; 5];
        pixels[1][0] = 1.5;
        pixels[2][3] = 0.0;
        pixels[3][1] = f32::NAN;
        pixels[4][2] = f32::NEG_INFINITY;
        let image = Image::new(5, 1, pixels).unwrap();
        let heat = heat_map(&image, &truth).unwrap();
        let of = |srgb: [f64; 3]| {
            let [r, g, b] = srgb.map(|c| num::f32_of(linear(c)));
            [r, g, b, 1.0]
        };
        let want = [HEAT_KNOTS[0].1, HEAT_KNOTS[6].1, colour(0.5), HEAT_NON_FINITE, HEAT_NON_FINITE].map(of);
        assert_eq!(heat.pixels(), want);
        let exact = ReferenceImage::new(5, 1, vec![[0.5; 4]; 5]).unwrap();
        assert_eq!(heat_map_f64(&image, &exact).unwrap().pixels(), want);
        let other = Image::new(1, 5, vec![[0.5; 4]; 5]).unwrap();
        assert!(heat_map(&image, &other).is_err());
    }

    /// The mark for NaN differs in hue from every colour of the map.
    #[test]
    fn the_mark_is_not_in_the_map() {
        for i in 0..=600 {
            let c = colour(10.0_f64.powf(f64::from(i) / 100.0 - 6.0));
            let distance: f64 = c.iter().zip(HEAT_NON_FINITE).map(|(a, b)| (a - b).abs()).sum();
            assert!(distance > 0.9, "{c:?}");
        }
    }
}
