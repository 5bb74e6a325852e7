//! Image errors over the premultiplied linear channels, and their one-line summary.

use std::fmt;

use serde::{Serialize, Serializer};

use crate::error::{Error, Result};
use crate::image::Image;
use crate::num;
use crate::reference::ReferenceImage;

/// Statistics of the error `image - truth` over a set of channel samples (one channel of one pixel each).
///
/// A sample whose value or truth is NaN or infinite has an infinite error. It is never left out: a single one
/// makes `max_abs`, `rmse` and `bias` infinite, and it counts as the largest in the percentiles.
///
/// Serialised, an infinite number is the string `"inf"`, since JSON has no such number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorStatistics {
    /// Largest absolute error.
    #[serde(serialize_with = "number_or_inf")]
    pub max_abs: f64,
    /// Root of the mean squared error.
    #[serde(serialize_with = "number_or_inf")]
    pub rmse: f64,
    /// Mean signed error: positive where the image is too bright. Positive infinity when any error is
    /// infinite.
    #[serde(serialize_with = "number_or_inf")]
    pub bias: f64,
    /// 99th percentile of the absolute error by nearest rank: the smallest error such that at least
    /// 99 % of the samples have this error or less.
    #[serde(serialize_with = "number_or_inf")]
    pub p99: f64,
    /// 99.9th percentile of the absolute error, as `p99`.
    #[serde(serialize_with = "number_or_inf")]
    pub p999: f64,
}

/// The errors of an image against the truth, over the four channels of premultiplied linear RGBA.
///
/// The statistics treat each channel of each pixel as one sample; `above_1_255` counts pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ImageErrors {
    /// Image width, in pixels.
    pub width: u32,
    /// Image height, in pixels.
    pub height: u32,
    /// All pixels and all four channels.
    pub all: ErrorStatistics,
    /// All pixels, red only.
    pub red: ErrorStatistics,
    /// All pixels, green only.
    pub green: ErrorStatistics,
    /// All pixels, blue only.
    pub blue: ErrorStatistics,
    /// All pixels, alpha only.
    pub alpha: ErrorStatistics,
    /// Share of the pixels, 0 to 1, whose largest absolute error over the channels is above 1/255.
    pub above_1_255: f64,
    /// Number of channel samples where the image or the truth is NaN or infinite.
    pub non_finite: u64,
}

impl ImageErrors {
    /// Compares an image with the truth.
    ///
    /// # Accuracy
    ///
    /// Differences and sums are computed in float64, where float32 pixels are exact.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the sizes differ.
    pub fn between(image: &Image, truth: &Image) -> Result<Self> {
        Self::between_f64(image, &widened(truth)?)
    }

    /// Compares an image with a float64 truth, which is not rounded.
    ///
    /// # Accuracy
    ///
    /// As [`Self::between`].
    ///
    /// # Errors
    ///
    /// As [`Self::between`].
    pub fn between_f64(image: &Image, truth: &ReferenceImage) -> Result<Self> {
        let pixels = image.pixels().len();
        let mut channels: [Vec<f64>; 4] = std::array::from_fn(|_| Vec::with_capacity(pixels));
        let (mut above, mut non_finite) = (0_usize, 0_u64);
        for errors in signed_errors(image, truth)? {
            above += usize::from(errors.iter().any(|e| e.abs() > 1.0 / 255.0));
            for (channel, error) in channels.iter_mut().zip(errors) {
                non_finite += u64::from(error.is_infinite());
                channel.push(error);
            }
        }
        let mut all = channels.concat();
        let [red, green, blue, alpha] = channels.map(|mut errors| statistics(&mut errors));
        Ok(Self {
            width: image.width(),
            height: image.height(),
            all: statistics(&mut all),
            red,
            green,
            blue,
            alpha,
            above_1_255: num::f64_of(above) / num::f64_of(pixels),
            non_finite,
        })
    }
}

impl fmt::Display for ImageErrors {
    /// Writes one line: `rmse 1.2e-3, max 4.0e-2, bias -1.0e-5, p99 ..., p99.9 ..., 0.31 % of pixels above
    /// 1/255`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ErrorStatistics { max_abs, rmse, bias, p99, p999 } = self.all;
        write!(f, "rmse {rmse:.2e}, max {max_abs:.2e}, bias {bias:+.2e}, p99 {p99:.2e}, p99.9 {p999:.2e}, ")?;
        write!(f, "{:.2} % of pixels above 1/255", 100.0 * self.above_1_255)?;
        if self.non_finite > 0 {
            write!(f, ", {} samples NaN or infinite", self.non_finite)?;
        }
        Ok(())
    }
}

/// Converts pixels to float64.
pub(super) fn widened(image: &Image) -> Result<ReferenceImage> {
    let pixels = image.pixels().iter().map(|pixel| pixel.map(f64::from)).collect();
    ReferenceImage::new(image.width(), image.height(), pixels)
}

/// Returns `image - truth` in each channel of each pixel, positive infinity where either is not finite.
///
/// # Errors
///
/// [`Error::Invalid`] if the sizes differ.
pub(super) fn signed_errors(image: &Image, truth: &ReferenceImage) -> Result<impl Iterator<Item = [f64; 4]>> {
    let ([w, h], [truth_w, truth_h]) = ([image.width(), image.height()], [truth.width(), truth.height()]);
    if [w, h] != [truth_w, truth_h] {
        return Err(Error::invalid(
            "image size",
            format!("{w} x {h} against {truth_w} x {truth_h}: images to compare must have the same size"),
        ));
    }
    Ok(image.pixels().iter().zip(truth.pixels()).map(|(image, truth)| {
        std::array::from_fn(|c| {
            let error = f64::from(image[c]) - truth[c];
            // Infinity minus itself and NaN minus anything are NaN: one test covers all cases.
            if error.is_finite() { error } else { f64::INFINITY }
        })
    }))
}

/// Computes the statistics; sorts the errors by magnitude. There is at least one, and none is NaN.
fn statistics(errors: &mut [f64]) -> ErrorStatistics {
    let count = num::f64_of(errors.len());
    let (mut squares, mut sum) = (0.0, 0.0);
    for &error in errors.iter() {
        squares += error * error;
        sum += error;
    }
    errors.sort_unstable_by(|a, b| a.abs().total_cmp(&b.abs()));
    // Nearest rank: ceil(q count) samples at or below. Integers, because 0.999 is not a binary fraction.
    let percentile = |per_mille: usize| {
        let rank = (errors.len() * per_mille).div_ceil(1000);
        errors[rank.max(1) - 1].abs()
    };
    ErrorStatistics {
        max_abs: percentile(1000),
        rmse: (squares / count).sqrt(),
        bias: sum / count,
        p99: percentile(990),
        p999: percentile(999),
    }
}

/// Writes infinity as a string: `serde_json` would write null, which readers take for "not measured".
fn number_or_inf<S: Serializer>(value: &f64, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    if value.is_infinite() { serializer.serialize_str("inf") } else { serializer.serialize_f64(*value) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that float32 holds exactly, so that the differences below are exact.
    fn truth() -> Vec<[f32; 4]> {
        (0_u8..200).map(|i| [f32::from(i) / 256.0, 0.5, 0.25, 1.0]).collect()
    }

    fn image(pixels: Vec<[f32; 4]>) -> Image {
        Image::new(20, 10, pixels).unwrap()
    }

    fn perturbed(change: impl Fn(&mut Vec<[f32; 4]>)) -> ImageErrors {
        let mut pixels = truth();
        change(&mut pixels);
        let truth64 = truth().iter().map(|p| p.map(f64::from)).collect();
        let errors = ImageErrors::between(&image(pixels.clone()), &image(truth())).unwrap();
        let exact = ReferenceImage::new(20, 10, truth64).unwrap();
        assert_eq!(ImageErrors::between_f64(&image(pixels), &exact).unwrap(), errors);
        errors
    }

    #[test]
    fn equal_images_have_no_error() {
        let errors = perturbed(|_| ());
        let none = ErrorStatistics { max_abs: 0.0, rmse: 0.0, bias: 0.0, p99: 0.0, p999: 0.0 };
        assert_eq!([errors.all, errors.red, errors.green, errors.blue, errors.alpha], [none; 5]);
        assert_eq!((errors.above_1_255, errors.non_finite), (0.0, 0));
        assert_eq!((errors.width, errors.height), (20, 10));
    }

    #[test]
    fn one_wrong_sample_shows_in_its_channel_and_in_all() {
        let errors = perturbed(|p| p[37][2] -= 0.125);
        assert_eq!(errors.all.max_abs, 0.125);
        // 800 samples in all, 200 of blue.
        assert_eq!(errors.all.rmse, (0.125_f64 * 0.125 / 800.0).sqrt());
        assert_eq!(errors.blue.rmse, (0.125_f64 * 0.125 / 200.0).sqrt());
        assert_eq!(errors.blue.bias, -0.125 / 200.0);
        assert_eq!(errors.above_1_255, 1.0 / 200.0);
        for clean in [errors.red, errors.green, errors.alpha] {
            assert_eq!((clean.max_abs, clean.rmse, clean.bias), (0.0, 0.0, 0.0));
        }
        // 1 of 800 is 0.125 %: above the 99.9th percentile's 0.1 %, below the 99th's 1 %.
        assert_eq!((errors.all.p99, errors.all.p999), (0.0, 0.125));
    }

    #[test]
    fn nan_and_infinity_are_infinite_errors_in_image_and_truth() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for place in [0, 100, 199] {
                let mut pixels = truth();
                pixels[place][3] = bad;
                let truth64 = pixels.iter().map(|p| p.map(f64::from)).collect();
                let (bad_image, good) = (image(pixels), image(truth()));
                let bad_truth = ReferenceImage::new(20, 10, truth64).unwrap();
                for errors in [
                    ImageErrors::between(&bad_image, &good).unwrap(),
                    ImageErrors::between(&good, &bad_image).unwrap(),
                    ImageErrors::between(&bad_image, &bad_image).unwrap(),
                    ImageErrors::between_f64(&good, &bad_truth).unwrap(),
                ] {
                    for s in [errors.all, errors.alpha] {
                        assert_eq!(
                            (s.max_abs, s.rmse, s.bias),
                            (f64::INFINITY, f64::INFINITY, f64::INFINITY)
                        );
                    }
                    // 1 of 200 alpha samples is inside the top 1 % but not below it.
                    assert_eq!((errors.alpha.p99, errors.alpha.p999), (0.0, f64::INFINITY));
                    assert_eq!(errors.red.max_abs, 0.0);
                    assert_eq!(errors.above_1_255, 1.0 / 200.0);
                    assert_eq!(errors.non_finite, 1);
                }
            }
        }
    }

    #[test]
    fn bias_keeps_its_sign_and_cancels() {
        let shift = |by: f32| perturbed(move |p| p.iter_mut().for_each(|p| p[0] += by));
        assert_eq!(shift(0.25).red.bias, 0.25);
        assert_eq!(shift(-0.25).red.bias, -0.25);
        assert_eq!(shift(-0.25).all.bias, -0.0625);
        let both = perturbed(|p| {
            p.iter_mut().enumerate().for_each(|(i, p)| p[0] += if i % 2 == 0 { 0.25 } else { -0.25 })
        });
        assert_eq!((both.red.bias, both.red.rmse), (0.0, 0.25));
    }

    #[test]
    fn percentiles_sit_at_their_rank() {
        // 1000 samples of alpha with errors 1/1024 ... 1000/1024 in a scrambled order.
        let zeros = vec![[0.0_f32; 4]; 1000];
        let mut pixels = zeros.clone();
        for (i, pixel) in pixels.iter_mut().enumerate() {
            let rank = u16::try_from((i * 379) % 1000 + 1).unwrap();
            pixel[3] = f32::from(rank) / 1024.0 * if i % 3 == 0 { -1.0 } else { 1.0 };
        }
        let errors =
            ImageErrors::between(&Image::new(40, 25, pixels).unwrap(), &Image::new(40, 25, zeros).unwrap())
                .unwrap();
        assert_eq!((errors.alpha.p99, errors.alpha.p999), (990.0 / 1024.0, 999.0 / 1024.0));
        assert_eq!(errors.alpha.max_abs, 1000.0 / 1024.0);
        // Over all 4000 samples rank 3960 is the 960th of alpha, rank 3996 the 996th.
        assert_eq!((errors.all.p99, errors.all.p999), (960.0 / 1024.0, 996.0 / 1024.0));
    }

    #[test]
    fn the_share_counts_pixels_strictly_above() {
        let level = 1.0 / 256.0;
        assert_eq!(perturbed(|p| p.iter_mut().take(10).for_each(|p| p[1] += level)).above_1_255, 0.0);
        let errors = perturbed(|p| {
            for p in p.iter_mut().take(10) {
                p[1] += 2.0 * level;
                p[2] -= 2.0 * level;
            }
        });
        assert_eq!(errors.above_1_255, 0.05);
        // The bound itself does not count as above.
        let truth = ReferenceImage::new(1, 1, vec![[0.0, 0.0, 0.0, -1.0 / 255.0]]).unwrap();
        let black = Image::new(1, 1, vec![[0.0; 4]]).unwrap();
        assert_eq!(ImageErrors::between_f64(&black, &truth).unwrap().above_1_255, 0.0);
    }

    #[test]
    fn a_float64_truth_is_not_rounded() {
        let third = 1.0 / 3.0;
        let truth = ReferenceImage::new(1, 1, vec![[third; 4]]).unwrap();
        let errors = ImageErrors::between_f64(&truth.to_image().unwrap(), &truth).unwrap();
        assert_eq!(errors.all.max_abs, (f64::from(num::f32_of(third)) - third).abs());
        assert!(errors.all.max_abs > 1e-9);
    }

    #[test]
    fn sizes_must_agree() {
        let flat = |w, h| Image::new(w, h, vec![[0.0; 4]; 200]).unwrap();
        let message = ImageErrors::between(&flat(20, 10), &flat(10, 20)).unwrap_err().to_string();
        assert!(message.contains("20 x 10 against 10 x 20"), "{message}");
    }

    #[test]
    fn infinities_survive_json_and_the_summary() {
        let errors = perturbed(|p| p[5][0] = f32::NAN);
        let json = serde_json::to_value(errors).unwrap();
        assert_eq!(json["all"]["rmse"], "inf");
        assert_eq!(json["red"]["max_abs"], "inf");
        assert_eq!(json["green"]["rmse"], 0.0);
        assert_eq!(json["non_finite"], 1);
        let line = errors.to_string();
        assert!(
            line.contains("rmse inf") && line.contains("0.50 %") && line.contains("1 samples NaN"),
            "{line}"
        );
        assert!(!line.contains('\n'));
        let line = perturbed(|p| p[5][0] += 0.25).to_string();
        assert!(line.contains("max 2.50e-1") && line.contains("bias +3.1"), "{line}");
    }
}
