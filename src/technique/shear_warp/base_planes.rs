//! Chooses the base planes of a view: the stack, the region of the image and the lattice of texels of each.
//!
//! Parallel rays have one base plane, perpendicular to the axis that they are closest to. In perspective one plane
//! suffices where no ray through the domain has a shear above [`MOST_SHEAR`]. Otherwise up to six pyramids about the axes'
//! directions share the rays, each with a base plane of its own: a ray belongs to the axis
//! whose planes it crosses most steeply. Nothing divides by the eye's distance to the domain, so the eye may be anywhere.
//!
//! A base plane carries a lattice of texels, each of which is exactly one ray. The lattice covers the intersection of
//! domain, image and pyramid, and a margin for the warp's filter.

use glam::DVec2;

use crate::error::Result;
use crate::scene::{Grid, View};
use crate::technique::grid::slices_2d::{planes, steepest_axis};
use crate::technique::shear_warp::base_plane::BasePlane;
use crate::technique::shear_warp::options::Intermediate;
use crate::technique::shear_warp::region::{GridView, MARGIN, MOST_SHEAR, SEAM};

/// Most texels of all base planes per pixel of the image, or per requested texel of a pixel, without margins.
const TEXELS_PER_PIXEL: f64 = 4.0;

/// The capacity of a device for base planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capacity {
    /// Texels of all base planes.
    pub(crate) texels: f64,
    /// Texels along a side of one.
    pub(crate) side: f64,
    /// Rows of all base planes.
    pub(crate) rows: f64,
}

/// Chooses the base planes of a view. `current` is the axis of the only base plane of the view before, which is kept within the
/// hysteresis.
///
/// # Errors
///
/// [`Error::Invalid`](crate::Error::Invalid) where float64 cannot hold the view, or the planes of every axis are seen edge-on.
pub(crate) fn base_planes(
    grid: &Grid,
    view: &View,
    current: Option<usize>,
    hysteresis: f64,
    resolution: Intermediate,
    capacity: Capacity,
) -> Result<Vec<BasePlane>> {
    let [width, height] = view.extent().map(f64::from);
    let seen = GridView {
        grid,
        view,
        normals: planes(grid).map(|(normal, _)| normal),
        half_image: DVec2::new(width, height) * 0.5,
    };
    let axis = steepest_axis(grid, view, current, hysteresis);
    let mut regions = Vec::new();
    if !view.is_perspective() {
        // The plane in use is given up before it is seen edge-on.
        let cosines = seen.normals.map(|normal| normal.dot(view.ahead()).abs());
        let too_flat = cosines.iter().any(|cosine| *cosine > MOST_SHEAR * cosines[axis]);
        let axis = if too_flat { steepest_axis(grid, view, None, 0.0) } else { axis };
        let sign = seen.normals[axis].dot(view.ahead()).signum();
        regions.extend(seen.region(axis, sign, None)?);
    } else if let Some(only) = seen.only_region(axis)? {
        regions.extend(only);
    } else {
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                regions.extend(seen.region(axis, sign, Some(SEAM))?);
            }
        }
    }
    let parted = regions.len() > 1;
    let pixels = (width * height).max(4096.0);
    // Where texels are too many, coarser ones replace them.
    let mut pitches: Vec<DVec2> = regions.iter().map(|region| region.pitch(resolution)).collect();
    // An explicit resolution raises the limit.
    let most = match resolution {
        Intermediate::Voxel => capacity.texels,
        Intermediate::Auto => TEXELS_PER_PIXEL * pixels,
        Intermediate::Pixel(side) => TEXELS_PER_PIXEL * pixels * (side * side).max(1.0),
    };
    let around = 2.0 * MARGIN + 3.0;
    for (region, pitch) in regions.iter().zip(&mut pitches) {
        *pitch = pitch.max(region.extent() / (capacity.side - around).max(1.0));
    }
    for _ in 0..16 {
        let sum = |of: &dyn Fn(DVec2) -> f64| -> f64 {
            regions.iter().zip(&pitches).map(|(region, &pitch)| of(region.extent() / pitch)).sum()
        };
        // Around an image of one row there are more texels than in it.
        let texels = sum(&|sides| (sides + around).element_product()) / capacity.texels;
        let over = texels.max(sum(&|sides| (sides + 1.0).element_product()) / most);
        let rows = sum(&|sides| sides.y + around) / capacity.rows;
        if over <= 1.0 && rows <= 1.0 {
            break;
        }
        let coarser = if rows > 1.0 { over.sqrt().max(rows) } else { over.sqrt() };
        for pitch in &mut pitches {
            *pitch *= coarser * 1.01;
        }
    }
    regions.iter().zip(pitches).map(|(region, pitch)| region.base_plane(&seen, pitch, parted)).collect()
}

#[cfg(test)]
mod tests;
