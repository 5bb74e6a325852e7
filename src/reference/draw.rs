//! Images, single pixels and depths of a view.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec2;
use rayon::prelude::*;

use super::cover;
use super::image::ReferenceImage;
use super::rays::Rays;
use super::sampling::{Progress, ReferenceOptions, box_filter};
use super::surfaces::SurfaceRays;
use super::view_ray::{ViewRays, view_range};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Scene, Surface, View};

/// Renders the reference image on all cores: the clipped volume and the scene's surfaces.
///
/// Surfaces are composited at their places in the volume: the volume is integrated up to a surface and again
/// behind it. Surfaces at one place are composited in the order of the scene. An opaque one ends the ray. The
/// clip region does not affect surfaces.
///
/// `progress` receives the number of finished rows and of all rows. It is called from any thread, once for
/// each row; counts may arrive out of order. The image does not depend on the number of threads.
///
/// # Accuracy
///
/// 1e-9 of the largest colour in every channel; usually 1e-12. Two effects limit it. A scalar has float64
/// rounding, so where a ray runs along a jump of the transfer function within rounding, either side of the
/// jump is correct. And coordinates carry the rounding of the eye's distance.
///
/// Scenes of kernels are also accurate to 1e-9 with [`Model::Density`](crate::scene::Model). With
/// `Interpolate` the scalar is accurate to 1e-9 of its range, and so is the image, unless a steep transfer
/// function amplifies the error.
///
/// # Errors
///
/// [`Error::Invalid`] if `options.samples` is 0 or above [`ReferenceOptions::MAX_SAMPLES`], the image does
/// not fit into memory, or the kernels do not match the data: points without a size, covariances or NaN
/// samples with B-splines.
pub fn render(
    scene: &Scene,
    view: &View,
    options: &ReferenceOptions,
    progress: Option<&Progress>,
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

    let rays = Rays::new(scene)?;
    let view_rays = ViewRays::new(scene, view);
    if let Rays::Mesh(rays) = &rays {
        cover::render(rays, &view_rays, view, samples, &mut pixels, progress);
        return ReferenceImage::new(width, height, pixels);
    }
    let done = AtomicU32::new(0);
    pixels.par_chunks_mut(num::index(width)).zip(0..height).for_each(|(row, y)| {
        for (pixel, x) in row.iter_mut().zip(0..width) {
            *pixel = box_filter(samples, |offset| {
                rays.draw(&view_rays.at(DVec2::new(f64::from(x), f64::from(y)) + offset))
            });
        }
        if let Some(progress) = progress {
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, height);
        }
    });
    ReferenceImage::new(width, height, pixels)
}

/// Renders single pixels, given as column and row, bit for bit as [`render`] does with one ray per pixel.
///
/// A subset of the pixels is enough to estimate an error.
///
/// # Accuracy
///
/// As [`render`].
///
/// # Errors
///
/// [`Error::Invalid`] if a pixel lies outside the image, or kernels do not match the data, as for [`render`].
pub fn pixels(scene: &Scene, view: &View, pixels: &[[u32; 2]]) -> Result<Vec<[f64; 4]>> {
    let [width, height] = view.extent();
    if let Some([x, y]) = pixels.iter().find(|[x, y]| *x >= width || *y >= height) {
        let why = format!("({x}, {y}): must lie inside {width} x {height}");
        return Err(Error::invalid("reference pixel", why));
    }
    let rays = Rays::new(scene)?;
    let view_rays = ViewRays::new(scene, view);
    if let Rays::Mesh(rays) = &rays {
        return Ok(cover::some(rays, &view_rays, view, pixels));
    }
    let draw = |&[x, y]: &[u32; 2]| rays.draw(&view_rays.at(DVec2::new(f64::from(x), f64::from(y)) + 0.5));
    Ok(pixels.par_iter().map(draw).collect())
}

/// Returns the depth of the nearest opaque surface at each pixel's centre, row by row from the top.
///
/// The depth is measured along the viewing direction in world units, as by [`View::project`]. It is infinite
/// where there is no opaque surface.
///
/// # Errors
///
/// [`Error::Invalid`] if the depths do not fit into memory.
pub fn depth(scene: &Scene, view: &View) -> Result<Vec<f64>> {
    let [width, height] = view.extent();
    let total = num::index(width) * num::index(height);
    let mut depths = Vec::new();
    depths.try_reserve_exact(total).map_err(|_| {
        Error::invalid("reference depth", format!("{width} x {height}: does not fit into memory"))
    })?;
    depths.resize(total, f64::INFINITY);
    let Some(surfaces) = SurfaceRays::new(&scene.surfaces, Surface::is_opaque) else { return Ok(depths) };
    let range = view_range(view);
    depths.par_chunks_mut(num::index(width)).zip(0..height).for_each(|(row, y)| {
        for (depth, x) in row.iter_mut().zip(0..width) {
            let (origin, direction) = view.ray(DVec2::new(f64::from(x), f64::from(y)) + 0.5);
            if let Some(hit) = surfaces.hits(origin, direction, range).first() {
                *depth = hit.t * direction.dot(view.forward());
            }
        }
    });
    Ok(depths)
}
