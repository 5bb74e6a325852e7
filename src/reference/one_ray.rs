//! Single rays: their colour, and the pieces of a mesh on them.

use glam::DVec3;

use super::rays::Rays;
use super::surfaces::SurfaceRays;
use super::tets::{self, Piece};
use super::view_ray::ViewRay;
use crate::error::{Error, Result};
use crate::scene::Scene;

/// Integrates one ray in float64; returns premultiplied linear RGBA.
///
/// The ray covers the parameters `t_range`, in units of world length from `origin` along `direction`, whose
/// own length has no effect. An orthographic ray has the range of all numbers, a perspective ray starts at 0.
/// A surface at the end of the range is included, one at its beginning is not. There is no clip region.
///
/// # Accuracy
///
/// As [`super::render`].
///
/// # Errors
///
/// [`Error::Invalid`] if the origin is not finite, the direction has no finite length, an end of the range is
/// NaN, or kernels do not match the data, as for [`super::render`].
pub fn ray(scene: &Scene, origin: DVec3, direction: DVec3, t_range: [f64; 2]) -> Result<[f64; 4]> {
    let direction = checked(origin, direction, t_range)?;
    let surfaces = SurfaceRays::once(&scene.surfaces);
    Ok(Rays::new(scene)?.draw(&ViewRay::new(surfaces.as_ref(), origin, direction, t_range, t_range)))
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
    let mut pieces: Vec<Piece> = rays.all().filter_map(|cell| rays.piece(cell, &ray)).collect();
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
