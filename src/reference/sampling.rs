//! Rays per pixel and progress over rows.

use glam::DVec2;

/// Options of a reference image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReferenceOptions {
    /// Rays along each side of a pixel: `samples` x `samples` rays at the centres of equal squares, averaged
    /// (a box filter). The default 1 samples the pixel's centre only, as every technique does.
    pub samples: u32,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self { samples: 1 }
    }
}

impl ReferenceOptions {
    /// Largest number of rays along each side of a pixel.
    pub const MAX_SAMPLES: u32 = 64;
}

/// A callback that receives the number of finished rows and of all rows.
pub(super) type Progress<'a> = dyn Fn(u32, u32) + Sync + 'a;

/// Returns the mean of `samples` x `samples` rays through the centres of equal squares of a pixel.
pub(super) fn box_filter(samples: u32, ray: impl Fn(DVec2) -> [f64; 4]) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for offset in samples_of(samples) {
        for (sum, value) in sum.iter_mut().zip(ray(offset)) {
            *sum += value;
        }
    }
    let n = f64::from(samples);
    sum.map(|sum| sum / (n * n))
}

/// Returns the centres of a pixel's equal squares, row by row.
pub(super) fn samples_of(samples: u32) -> impl Iterator<Item = DVec2> {
    let centre = move |i: u32| (f64::from(i) + 0.5) / f64::from(samples);
    (0..samples).flat_map(move |j| (0..samples).map(move |i| DVec2::new(centre(i), centre(j))))
}
