//! The truth: images in float64 on the CPU, exact but for rounding.
//!
//! Every ray is cut at every voxel face. Inside a cell the trilinear scalar along the ray is a cubic of
//! the ray's parameter; the ray is cut again where that cubic meets a knot of the transfer function.
//! On such a piece extinction is a cubic and optical depth a quartic, both in closed form; the emission
//! is integrated by Gauss-Legendre over panels of bounded optical depth.
//!
//! Shares no code with the shaders or the pre-integration tables.

mod grid;
mod march;
mod polynomial;
mod quadrature;

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::frame::Image;
use crate::num;
use crate::scene::{Scene, View};

use grid::GridRays;

/// How a reference image is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReferenceOptions {
    /// Rays along each side of a pixel: `samples` x `samples` rays at the centres of equal squares,
    /// averaged (a box filter). 1, the default, is the pixel's centre only, as every technique
    /// samples it.
    pub samples: u32,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self { samples: 1 }
    }
}

impl ReferenceOptions {
    /// Most rays along each side of a pixel.
    pub const MAX_SAMPLES: u32 = 64;
}

/// A float64 image: premultiplied linear RGBA, top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceImage {
    width: u32,
    height: u32,
    pixels: Vec<[f64; 4]>,
}

impl ReferenceImage {
    /// An image of given pixels, row by row from the top.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if there are not `width * height` pixels.
    pub fn new(width: u32, height: u32, pixels: Vec<[f64; 4]>) -> Result<Self> {
        if num::index(width).checked_mul(num::index(height)) != Some(pixels.len()) {
            return Err(Error::invalid(
                "reference image",
                format!("{width} x {height} with {} pixels: must have one for each place", pixels.len()),
            ));
        }
        Ok(Self { width, height, pixels })
    }

    /// Pixels in a row.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All pixels, row by row from the top.
    #[must_use]
    pub fn pixels(&self) -> &[[f64; 4]] {
        &self.pixels
    }

    /// One pixel.
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

    /// The image rounded to float32.
    ///
    /// # Errors
    ///
    /// As [`Image::new`].
    pub fn to_image(&self) -> Result<Image> {
        Image::new(self.width, self.height, self.pixels.iter().map(|p| p.map(num::f32_of)).collect())
    }
}

/// Renders the reference image on all cores.
///
/// `progress` is told the rows done and the rows in all, from any thread, once for each row; counts
/// may arrive out of order. The image does not depend on the number of threads.
///
/// # Accuracy
///
/// 1e-9 of the largest colour in every channel; usually 1e-12. Two things bound that: a scalar is known
/// to float64 rounding, so where a ray runs along a jump of the transfer function within rounding,
/// either side of the jump is right; and coordinates carry the rounding of the eye's distance.
///
/// # Errors
///
/// [`Error::Invalid`] if `options.samples` is 0 or above [`ReferenceOptions::MAX_SAMPLES`], or the image
/// does not fit into memory.
pub fn render(
    scene: &Scene,
    view: &View,
    options: &ReferenceOptions,
    progress: Option<&(dyn Fn(u32, u32) + Sync)>,
) -> Result<ReferenceImage> {
    let samples = options.samples;
    if samples == 0 || samples > ReferenceOptions::MAX_SAMPLES {
        return Err(Error::invalid(
            "reference samples",
            format!("{samples}: must be 1 to {}", ReferenceOptions::MAX_SAMPLES),
        ));
    }
    let [width, height] = view.extent();
    let total = num::index(width) * num::index(height);
    let mut pixels = Vec::new();
    pixels.try_reserve_exact(total).map_err(|_| {
        Error::invalid("reference image", format!("{width} x {height}: does not fit into memory"))
    })?;
    pixels.resize(total, [0.0; 4]);

    let rays = rays(scene)?;
    let range = view_range(view);
    let done = AtomicU32::new(0);
    pixels.par_chunks_mut(num::index(width)).zip(0..height).for_each(|(row, y)| {
        for (pixel, x) in row.iter_mut().zip(0..width) {
            *pixel = box_filter(samples, |offset| {
                let (origin, direction) = view.ray(DVec2::new(f64::from(x), f64::from(y)) + offset);
                rays.trace(origin, direction, range)
            });
        }
        if let Some(progress) = progress {
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, height);
        }
    });
    Ok(ReferenceImage { width, height, pixels })
}

/// One ray, in float64: premultiplied linear RGBA of what lies at parameters `t_range`, in units of
/// world length from `origin` along `direction` (whose own length does not matter). An orthographic
/// ray has the range of all numbers, a perspective ray starts at 0.
///
/// # Accuracy
///
/// As [`render`].
///
/// # Errors
///
/// [`Error::Invalid`] if the origin is not finite, the direction has no finite length, or an end of the
/// range is NaN.
pub fn ray(scene: &Scene, origin: DVec3, direction: DVec3, t_range: [f64; 2]) -> Result<[f64; 4]> {
    if !origin.is_finite() {
        return Err(Error::invalid("ray origin", format!("{origin}: must be finite")));
    }
    let Some(direction) = direction.try_normalize() else {
        return Err(Error::invalid("ray direction", format!("{direction}: must have a finite length")));
    };
    if t_range.iter().any(|t| t.is_nan()) {
        return Err(Error::invalid("ray range", format!("{t_range:?}: must be two numbers")));
    }
    Ok(rays(scene)?.trace(origin, direction, t_range))
}

/// The scene's data and transfer function, prepared for rays.
fn rays(scene: &Scene) -> Result<GridRays<'_>> {
    let grid = scene.grid().ok_or_else(|| Error::invalid("reference", "the scene holds no grid"))?;
    Ok(GridRays::new(grid, &scene.transfer))
}

/// Orthographic rays run over all real numbers, perspective rays start at the eye.
fn view_range(view: &View) -> [f64; 2] {
    [if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY }, f64::INFINITY]
}

/// Mean of `samples` x `samples` rays through the centres of equal squares of a pixel.
fn box_filter(samples: u32, ray: impl Fn(DVec2) -> [f64; 4]) -> [f64; 4] {
    let n = f64::from(samples);
    let mut sum = [0.0; 4];
    for j in 0..samples {
        for i in 0..samples {
            let value = ray(DVec2::new((f64::from(i) + 0.5) / n, (f64::from(j) + 0.5) / n));
            for (sum, value) in sum.iter_mut().zip(value) {
                *sum += value;
            }
        }
    }
    sum.map(|sum| sum / (n * n))
}

#[cfg(test)]
mod tests;
