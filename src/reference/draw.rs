//! A scene prepared for rays, whatever its data: images, single pixels and depths of a view, and single rays.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::cover::{self, Progress, samples_of};
use super::gaussians::GaussianRays;
use super::grid::GridRays;
use super::image::ReferenceImage;
use super::kernels::KernelRays;
use super::surfaces::SurfaceRays;
use super::tets::{self, Piece, TetRays};
use super::view_ray::{ViewRay, ViewRays, view_range};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Data, Grid, Kernels, Scene, Surface, View};

/// A scene's data and transfer function, prepared for rays.
pub(super) enum Rays<'a> {
    Grid(Box<GridRays<'a>>),
    Mesh(Box<TetRays<'a>>),
    Kernels(Box<KernelRays>),
}

impl<'a> Rays<'a> {
    pub(super) fn new(scene: &'a Scene) -> Result<Self> {
        scene.check_mode()?;
        let kernels = match (&scene.data, scene.kernels) {
            (_, Some(kernels)) => kernels,
            (Data::Points(_) | Data::Gaussians(_), None) => Kernels::of_points(),
            (Data::Grid(grid), None) => {
                return Ok(Self::Grid(Box::new(GridRays::new(grid, &scene.transfer, scene.mode))));
            }
            (Data::Mesh(mesh), None) => return Ok(Self::Mesh(Box::new(TetRays::new(mesh, &scene.transfer)))),
        };
        Ok(Self::Kernels(Box::new(KernelRays::new(scene, &kernels)?)))
    }

    /// Integrates the volume on a ray and composites the surfaces.
    fn draw(&self, view_ray: &ViewRay) -> [f64; 4] {
        let ViewRay { origin, direction, .. } = *view_ray;
        view_ray.composite(|range| match self {
            Self::Grid(rays) => rays.trace(origin, direction, range),
            Self::Mesh(rays) => rays.trace(origin, direction, range),
            Self::Kernels(rays) => rays.trace(origin, direction, range),
        })
    }
}

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
    let mut pixels = filled("reference image", [width, height], [0.0; 4])?;
    let view_rays = ViewRays::new(scene, view);
    if let Some(rays) = GaussianRays::of(scene)? {
        rays.render(&view_rays, view, samples, &mut pixels, progress)?;
        return ReferenceImage::new(width, height, pixels);
    }
    let rays = Rays::new(scene)?;
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
    check_read(scene)?;
    ReferenceImage::new(width, height, pixels)
}

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

/// Returns one value for each pixel of an image.
fn filled<T: Clone>(what: &str, [width, height]: [u32; 2], value: T) -> Result<Vec<T>> {
    let total = num::index(width) * num::index(height);
    let mut values = Vec::new();
    let reserved = values.try_reserve_exact(total);
    reserved.map_err(|_| Error::invalid(what, format!("{width} x {height}: does not fit into memory")))?;
    values.resize(total, value);
    Ok(values)
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
    let view_rays = ViewRays::new(scene, view);
    if let Some(rays) = GaussianRays::of(scene)? {
        return rays.some(&view_rays, view, pixels);
    }
    let rays = Rays::new(scene)?;
    if let Rays::Mesh(rays) = &rays {
        return Ok(cover::some(rays, &view_rays, view, pixels));
    }
    let draw = |&[x, y]: &[u32; 2]| rays.draw(&view_rays.at(DVec2::new(f64::from(x), f64::from(y)) + 0.5));
    let colours = pixels.par_iter().map(draw).collect();
    check_read(scene)?;
    Ok(colours)
}

/// Checks that the samples of a grid could be read, where they are on demand.
fn check_read(scene: &Scene) -> Result<()> {
    scene.grid().map_or(Ok(()), Grid::failure)
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
    let mut depths = filled("reference depth", [width, height], f64::INFINITY)?;
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

/// Integrates one ray in float64; returns premultiplied linear RGBA.
///
/// The ray covers the parameters `t_range`, in units of world length from `origin` along `direction`, whose
/// own length has no effect. An orthographic ray has the range of all numbers, a perspective ray starts at 0. Trained splats have the
/// colours that they show along a ray that has no beginning, and towards the origin of others.
/// A surface at the end of the range is included, one at its beginning is not. There is no clip region.
///
/// # Accuracy
///
/// As [`render`].
///
/// # Errors
///
/// [`Error::Invalid`] if the origin is not finite, the direction has no finite length, an end of the range is
/// NaN, or kernels do not match the data, as for [`render`].
pub fn ray(scene: &Scene, origin: DVec3, direction: DVec3, t_range: [f64; 2]) -> Result<[f64; 4]> {
    let direction = checked(origin, direction, t_range)?;
    let surfaces = SurfaceRays::with_leaves(&scene.surfaces, |_| true, usize::MAX);
    let ray = ViewRay::new(surfaces.as_ref(), origin, direction, t_range, t_range);
    match GaussianRays::of(scene)? {
        Some(rays) => rays.trace(&ray),
        None => {
            let colour = Rays::new(scene)?.draw(&ray);
            check_read(scene)?;
            Ok(colour)
        }
    }
}

/// Returns the pieces of one ray inside the tetrahedra of a scene's mesh, front to back.
///
/// Parameters and range are as for [`ray`]. Tetrahedra with a NaN scalar are left out; infinite scalars are
/// replaced by the ends of the transfer function. Pieces of cells that share a face meet exactly, before
/// their parameters are rounded to distances from the origin.
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
    let cells = rays.all().filter_map(|cell| rays.cell(cell));
    let mut pieces: Vec<Piece> = cells.filter_map(|cell| cell.piece(&ray)).collect();
    tets::sort(&mut pieces);
    for piece in &mut pieces {
        piece.t = piece.t.map(|t| t + ray.nearest);
    }
    Ok(pieces)
}

/// Checks a ray and returns its direction with unit length.
fn checked(origin: DVec3, direction: DVec3, t_range: [f64; 2]) -> Result<DVec3> {
    if !origin.is_finite() {
        return Err(Error::invalid("ray origin", format!("{origin}: must be finite")));
    }
    let Some(direction) = direction.try_normalize() else {
        return Err(Error::invalid("ray direction", format!("{direction}: must have a finite length")));
    };
    if t_range.iter().any(|t| t.is_nan()) {
        return Err(Error::invalid("ray range", format!("{t_range:?}: the ends must not be NaN")));
    }
    Ok(direction)
}
