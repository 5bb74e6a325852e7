//! The slabs of a view with the push constants that draw them.

use crate::error::{Error, Result};
use crate::gpu::shader::{BRICK, TILE};
use crate::interface::GridPush;
use crate::num::{self, f32_of};
use crate::resident::GpuScene;
use crate::resident::tables::Knots;
use crate::resident::volume::Volume;
use crate::scene::View;
use crate::scene::grid::turned;
use crate::technique::grid::options::Dither;
use crate::technique::grid::rays::GridRays;
use crate::technique::grid::technique::GridTechnique;

/// Most slabs of a frame. Float32 cannot order more, and no image needs them.
pub(crate) const MAX_SLABS: f64 = 4_194_304.0;

/// Most draws of a frame. More take the device, and the host that records them, too long.
const MAX_DRAWS: f64 = 65_536.0;

/// The slabs of a view as shaders take them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    pub(super) push: GridPush,
    /// Number of slabs.
    pub(super) count: u32,
    /// The slab at which front-to-back order begins.
    pub(super) first: u32,
    /// Whether rays of a tile lie so far from the ray of its centre, where the domain is farthest, that they may be beyond the bricks
    /// around it.
    pub(super) wide: bool,
}

/// Cuts the domain into the slabs of a view, and derives the push constants that draw them.
pub(super) fn cut(
    name: &str,
    scene: &GpuScene,
    technique: &dyn GridTechnique,
    volume: &Volume,
    knots: &Knots,
    view: &View,
    axis: Option<usize>,
) -> Result<Cut> {
    let grid = scene.grid()?;
    let options = technique.options();
    let rays = GridRays::new(grid, view).turned(axis.unwrap_or(2));
    let slabs = technique.slabs(grid, &rays, axis);
    // Each slab that the shader blends is a draw of its own.
    let most = if options.dither == Dither::None { MAX_SLABS } else { MAX_DRAWS };
    if slabs.count > most {
        return Err(Error::invalid(
            format!("{name} option step"),
            format!("{}: makes {} slices of this grid, at most {most} are drawn", options.step, slabs.count),
        ));
    }
    // Depth is in units of the smallest voxel spacing on the device, because the world's unit may be a parsec or an angstrom.
    let unit = grid.spacing().min_element();
    let pack = |v: glam::DVec3, w: f64| num::vec3_of(v).extend(f32_of(w)).to_array();
    let [slope_x, slope_y, slopes @ ..] = view.slopes();
    let half = turned((grid.last_index() * 0.5).to_array(), axis.unwrap_or(2));
    let push = GridPush {
        // Pixels of parallel rays have one size at every depth.
        q0_kq: pack(rays.q0, if rays.kd == 0.0 { 1.0 } else { rays.kq / unit }),
        px_slope: pack(rays.px * if rays.kd == 0.0 { 1.0 } else { unit }, slope_x),
        py_z0: pack(rays.py * if rays.kd == 0.0 { 1.0 } else { unit }, slabs.begin),
        d0_h: pack(rays.d0 * unit, slabs.thickness),
        half_slope: pack(half.into(), slope_y),
        slopes: slopes.map(f32_of),
        sides: view.sides(),
        value_scale: volume.scale,
        value_offset: volume.offset,
        knots: knots.count,
        first: 0,
        count: num::u32_of(slabs.count),
        order: 0,
        unit: f32_of(unit),
        opaque: f32_of(options.stop / scene.max_colour()),
        seed: options.seed,
    };
    let numbers = [push.q0_kq, push.px_slope, push.py_z0, push.d0_h, push.half_slope];
    let finite = numbers.iter().flatten().chain(&push.slopes).all(|number| number.is_finite());
    if !(finite && push.unit.is_normal()) {
        return Err(Error::invalid(
            "view",
            "the camera is so far from the grid, or its voxels so large or small, that float32 cannot hold the rays",
        ));
    }
    let side =
        (rays.px.abs() + rays.py.abs()) * (0.5 * f64::from(TILE) * (rays.kq + rays.kd * rays.depths[1]));
    // A tenth of a cell for rounding.
    let wide = side.max_element() > f64::from(BRICK) - 0.1;
    Ok(Cut { wide, push, count: num::u32_of(slabs.count), first: slabs.first.min(num::u32_of(slabs.count)) })
}
