//! The image that every renderer returns.

use crate::error::{Error, Result};
use crate::num;

/// Selects how the numbers of colours are meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Colours {
    /// Amounts of light: files of 8 bits encode them.
    #[default]
    Linear,
    /// Codes of sRGB from 0 to 1, as trained splats have them: files of 8 bits take them as they are.
    Displayed,
}

/// A premultiplied RGBA image in 32-bit float, over a transparent black background; linear unless it says otherwise.
///
/// # Shape
///
/// `pixels[y][x]`, top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<[f32; 4]>,
    colours: Colours,
}

impl Image {
    /// Checks the size and keeps the pixels. Their values are not restricted, so that wrong images can be
    /// viewed.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a side is 0 or `width * height` is not the number of pixels.
    pub fn new(width: u32, height: u32, pixels: Vec<[f32; 4]>) -> Result<Self> {
        let needed = num::index(width).checked_mul(num::index(height));
        if width == 0 || height == 0 || needed != Some(pixels.len()) {
            return Err(Error::invalid(
                "image",
                format!(
                    "{width} x {height} with {} pixels: both sides must be at least 1 and their product \
                     the number of pixels",
                    pixels.len()
                ),
            ));
        }
        Ok(Self { width, height, pixels, colours: Colours::Linear })
    }

    /// Returns the image with other colours, whose numbers stay.
    #[must_use]
    pub fn with_colours(self, colours: Colours) -> Self {
        Self { colours, ..self }
    }

    /// Returns what the numbers of its colours are.
    #[must_use]
    pub fn colours(&self) -> Colours {
        self.colours
    }

    /// Returns the number of pixels in a row.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Returns all pixels, premultiplied RGBA, top row first.
    #[must_use]
    pub fn pixels(&self) -> &[[f32; 4]] {
        &self.pixels
    }

    /// Takes the pixels out of the image, in the order of [`Self::pixels`].
    #[must_use]
    pub fn into_pixels(self) -> Vec<[f32; 4]> {
        self.pixels
    }

    /// Returns one pixel; row 0 is on top.
    ///
    /// # Panics
    ///
    /// When the position lies outside the image.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> [f32; 4] {
        assert!(
            x < self.width && y < self.height,
            "pixel ({x}, {y}) lies outside {} x {}",
            self.width,
            self.height
        );
        self.pixels[num::index(y) * num::index(self.width) + num::index(x)]
    }
}

/// Applies the sRGB transfer curve (IEC 61966-2-1). Values outside [0, 1] are clamped, NaN stays NaN.
#[cfg(any(feature = "io", feature = "window"))]
pub(crate) fn srgb(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_run_from_the_top_and_sizes_must_agree() {
        let pixels = (0..6_u8).map(|i| [f32::from(i); 4]).collect::<Vec<_>>();
        let image = Image::new(3, 2, pixels.clone()).unwrap();
        assert_eq!(image.pixel(2, 0), [2.0; 4]);
        assert_eq!(image.pixel(0, 1), [3.0; 4]);
        for (w, h) in [(2, 2), (0, 6), (6, 0), (u32::MAX, u32::MAX)] {
            let why = Image::new(w, h, pixels.clone()).unwrap_err().to_string();
            assert!(why.contains("6 pixels"), "{why}");
        }
    }
}
