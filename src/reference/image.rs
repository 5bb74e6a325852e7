//! The image that the reference returns.

use crate::error::{Error, Result};
use crate::image::Image;
use crate::num;

/// A float64 image: premultiplied linear RGBA, top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceImage {
    width: u32,
    height: u32,
    pixels: Vec<[f64; 4]>,
}

impl ReferenceImage {
    /// Makes an image of the given pixels, row by row from the top.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if there are not `width * height` pixels.
    pub fn new(width: u32, height: u32, pixels: Vec<[f64; 4]>) -> Result<Self> {
        if num::index(width).checked_mul(num::index(height)) != Some(pixels.len()) {
            return Err(Error::invalid(
                "reference image",
                format!(
                    "{width} x {height} with {} pixels: there must be width x height pixels",
                    pixels.len()
                ),
            ));
        }
        Ok(Self { width, height, pixels })
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

    /// Returns all pixels, row by row from the top.
    #[must_use]
    pub fn pixels(&self) -> &[[f64; 4]] {
        &self.pixels
    }

    /// Returns one pixel.
    ///
    /// # Panics
    ///
    /// When a coordinate is not below its extent.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> [f64; 4] {
        assert!(
            x < self.width && y < self.height,
            "pixel ({x}, {y}) lies outside {} x {}",
            self.width,
            self.height
        );
        self.pixels[num::index(y) * num::index(self.width) + num::index(x)]
    }

    /// Rounds the image to float32.
    ///
    /// # Errors
    ///
    /// As [`Image::new`].
    pub fn to_image(&self) -> Result<Image> {
        Image::new(self.width, self.height, self.pixels.iter().map(|p| p.map(num::f32_of)).collect())
    }
}
