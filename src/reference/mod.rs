//! The truth: images in float64 on the CPU, exact but for rounding.
//!
//! Every ray is cut at every voxel face, or at every face of a tetrahedron. Inside a cell the trilinear scalar
//! along the ray is a cubic of the ray's parameter, that of a tetrahedron is linear; the ray is cut again where
//! it meets a knot of the transfer function. On such a piece extinction is a cubic and optical depth a quartic, both in closed form; the emission
//! is integrated by Gauss-Legendre over panels of bounded optical depth. Sums of kernels have no such closed forms:
//! rays through them are cut where a kernel begins or ends, and integrated numerically in between.
//!
//! Surfaces part a ray where it meets their triangles: what of the volume lies in front of one, between two and behind
//! is drawn on its own.
//!
//! Shares no code with the shaders or the pre-integration tables.

mod cover;
mod grid;
mod kernels;
mod march;
mod polynomial;
mod quadrature;
mod sight;
mod surfaces;
mod tets;

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::image::Image;
use crate::num;
use crate::scene::{Data, Scene, Surface, View};

use grid::GridRays;
use kernels::KernelRays;
use sight::{Sight, Sights};
use surfaces::SurfaceRays;
pub use tets::Piece;
use tets::TetRays;

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

/// Renders the reference image on all cores: the volume as the view's clip region leaves it, and the scene's surfaces.
///
/// Surfaces are composited at their places in the volume, in front of or behind it, as if the volume were drawn up to
/// them and behind them; those at one place in the order of the scene. An opaque one ends the ray.
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
/// Of scenes of kernels 1e-9, too, with [`Model::Density`](crate::scene::Model). With `Interpolate` the scalar is good
/// to 1e-9 of its range: the same for an image, unless a transfer function makes more of that.
///
/// # Errors
///
/// [`Error::Invalid`] if `options.samples` is 0 or above [`ReferenceOptions::MAX_SAMPLES`], the image does not
/// fit into memory, or the kernels do not fit the data: points without a size, covariances or NaN samples with B-splines.
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
    let sights = Sights::new(scene, view);
    if let Rays::Mesh(rays) = &rays {
        cover::render(rays, &sights, view, samples, &mut pixels, progress);
        return Ok(ReferenceImage { width, height, pixels });
    }
    let done = AtomicU32::new(0);
    pixels.par_chunks_mut(num::index(width)).zip(0..height).for_each(|(row, y)| {
        for (pixel, x) in row.iter_mut().zip(0..width) {
            *pixel = box_filter(samples, |offset| {
                rays.draw(&sights.at(DVec2::new(f64::from(x), f64::from(y)) + offset))
            });
        }
        if let Some(progress) = progress {
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, height);
        }
    });
    Ok(ReferenceImage { width, height, pixels })
}

/// Some pixels of the image that [`render`] makes with one ray a pixel, bit for bit, each as its column and row: what
/// is enough to estimate an error.
///
/// # Accuracy
///
/// As [`render`].
///
/// # Errors
///
/// [`Error::Invalid`] if a pixel lies outside the image, or kernels do not fit, as for [`render`].
pub fn pixels(scene: &Scene, view: &View, pixels: &[[u32; 2]]) -> Result<Vec<[f64; 4]>> {
    let [width, height] = view.extent();
    if let Some([x, y]) = pixels.iter().find(|[x, y]| *x >= width || *y >= height) {
        let why = format!("({x}, {y}): must lie inside {width} x {height}");
        return Err(Error::invalid("reference pixel", why));
    }
    let rays = Rays::new(scene)?;
    let sights = Sights::new(scene, view);
    if let Rays::Mesh(rays) = &rays {
        return Ok(cover::some(rays, &sights, view, pixels));
    }
    let draw = |&[x, y]: &[u32; 2]| rays.draw(&sights.at(DVec2::new(f64::from(x), f64::from(y)) + 0.5));
    Ok(pixels.par_iter().map(draw).collect())
}

/// One ray, in float64: premultiplied linear RGBA of what lies at parameters `t_range`, in units of
/// world length from `origin` along `direction` (whose own length does not matter). An orthographic
/// ray has the range of all numbers, a perspective ray starts at 0. A surface at the range's end belongs to it, one at
/// its beginning does not; nothing is clipped.
///
/// # Accuracy
///
/// As [`render`].
///
/// # Errors
///
/// [`Error::Invalid`] if the origin is not finite, the direction has no finite length, an end of the range is
/// NaN, or kernels do not fit, as for [`render`].
pub fn ray(scene: &Scene, origin: DVec3, direction: DVec3, t_range: [f64; 2]) -> Result<[f64; 4]> {
    let direction = checked(origin, direction, t_range)?;
    let surfaces = SurfaceRays::once(&scene.surfaces);
    Ok(Rays::new(scene)?.draw(&Sight::new(surfaces.as_ref(), origin, direction, t_range, t_range)))
}

/// How far away the nearest opaque surface is seen through each pixel's centre: along the view's direction, in world
/// units, as [`View::project`] measures. Infinite where there is none. Row by row from the top.
///
/// # Errors
///
/// [`Error::Invalid`] if so many numbers do not fit into memory.
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

/// What of one ray lies in the tetrahedra of a scene's mesh, front to back, with parameters and range as for
/// [`ray`]. Those with a scalar that is NaN are left out; infinite scalars have become the transfer function's ends.
/// Pieces of cells that share a face meet exactly, before rounding to parameters that count from the origin.
///
/// # Errors
///
/// As [`ray`]; [`Error::Invalid`] if the scene holds no mesh, or a mesh that is drawn by kernels.
pub fn pieces(scene: &Scene, origin: DVec3, direction: DVec3, t_range: [f64; 2]) -> Result<Vec<Piece>> {
    let direction = checked(origin, direction, t_range)?;
    let Rays::Mesh(rays) = Rays::new(scene)? else {
        let drawn = if scene.kernels.is_some() { ", drawn by kernels" } else { "" };
        return Err(Error::invalid("reference", format!("the scene holds a {}{drawn}", scene.data.kind())));
    };
    let ray = rays.ray(origin, direction, t_range);
    let mut pieces: Vec<Piece> = rays.all().filter_map(|cell| rays.piece(cell, &ray)).collect();
    tets::sort(&mut pieces);
    for piece in &mut pieces {
        piece.t = piece.t.map(|t| t + ray.nearest);
    }
    Ok(pieces)
}

/// The ray's direction with unit length.
fn checked(origin: DVec3, direction: DVec3, t_range: [f64; 2]) -> Result<DVec3> {
    if !origin.is_finite() {
        return Err(Error::invalid("ray origin", format!("{origin}: must be finite")));
    }
    let Some(direction) = direction.try_normalize() else {
        return Err(Error::invalid("ray direction", format!("{direction}: must have a finite length")));
    };
    if t_range.iter().any(|t| t.is_nan()) {
        return Err(Error::invalid("ray range", format!("{t_range:?}: must be two numbers")));
    }
    Ok(direction)
}

/// Told the rows done and the rows in all.
type Progress<'a> = dyn Fn(u32, u32) + Sync + 'a;

/// A scene's data and transfer function, prepared for rays.
enum Rays<'a> {
    Grid(GridRays<'a>),
    Mesh(TetRays<'a>),
    Kernels(Box<KernelRays>),
}

impl<'a> Rays<'a> {
    fn new(scene: &'a Scene) -> Result<Self> {
        if let Some(rays) = KernelRays::new(scene)? {
            return Ok(Self::Kernels(Box::new(rays)));
        }
        match &scene.data {
            Data::Grid(grid) => Ok(Self::Grid(GridRays::new(grid, &scene.transfer))),
            Data::Mesh(mesh) => Ok(Self::Mesh(TetRays::new(mesh, &scene.transfer))),
            Data::Points(_) => Err(Error::invalid("reference", "points without kernels")),
        }
    }

    /// Volume and surfaces.
    fn draw(&self, sight: &Sight) -> [f64; 4] {
        sight.composite(|range| self.trace(sight.origin, sight.direction, range))
    }

    /// The volume.
    fn trace(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> [f64; 4] {
        match self {
            Self::Grid(rays) => rays.trace(origin, direction, range),
            Self::Mesh(rays) => rays.trace(origin, direction, range),
            Self::Kernels(rays) => rays.trace(origin, direction, range),
        }
    }
}

/// Orthographic rays run over all real numbers, perspective rays start at the eye.
fn view_range(view: &View) -> [f64; 2] {
    [if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY }, f64::INFINITY]
}

/// Mean of `samples` x `samples` rays through the centres of equal squares of a pixel.
fn box_filter(samples: u32, ray: impl Fn(DVec2) -> [f64; 4]) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for offset in samples_of(samples) {
        for (sum, value) in sum.iter_mut().zip(ray(offset)) {
            *sum += value;
        }
    }
    let n = f64::from(samples);
    sum.map(|sum| sum / (n * n))
}

/// Centres of a pixel's equal squares, row by row.
fn samples_of(samples: u32) -> impl Iterator<Item = DVec2> {
    let centre = move |i: u32| (f64::from(i) + 0.5) / f64::from(samples);
    (0..samples).flat_map(move |j| (0..samples).map(move |i| DVec2::new(centre(i), centre(j))))
}

#[cfg(test)]
mod tests;
