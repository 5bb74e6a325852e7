//! Derives the push constants of the base planes of a view.

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::gpu::Gpu;
use crate::interface::{BasePlanePush, ShearBoundsPush, WarpPush};
use crate::num::{self, f32_of};
use crate::resident::GpuScene;
use crate::resident::tables::{Integrator, Knots};
use crate::resident::volume::Volume;
use crate::scene::grid::turned;
use crate::scene::{Grid, View};
use crate::technique::grid::cut::MAX_SLABS;
use crate::technique::shear_warp::base_plane::BasePlane;
use crate::technique::shear_warp::base_planes::{Capacity, base_planes};
use crate::technique::shear_warp::bounds::bounds_push;
use crate::technique::shear_warp::options::{NAME, Options, Warp};

/// Bytes of a texel: four float32 channels.
pub(crate) const TEXEL: u64 = 16;

/// Share of the intermediate buffer that the first view takes, so that other views fit it too.
pub(crate) const FILL: f64 = 0.6;

/// Most texels along a side: workgroups of 8, of which every device allows 65535.
const MOST_SIDE: u32 = 8 * 65_535;

/// Bits of `BasePlanePush::order`: rays go down the stack; the first bit of `every`.
pub(crate) const DOWN: u32 = crate::gpu::shader::PLANE_DOWN;
const EVERY: u32 = crate::gpu::shader::PLANE_EVERY_SHIFT;

/// One base plane of a view as the shaders take it.
#[derive(Clone, Debug, Default)]
pub(crate) struct DrawnPlane {
    /// Index of its stack.
    pub(crate) stack: usize,
    pub(crate) push: BasePlanePush,
    pub(crate) slabs: u32,
    pub(crate) bounds: ShearBoundsPush,
    pub(crate) warp: WarpPush,
    /// Levels of the intermediate image below the first.
    pub(crate) halves: Vec<WarpPush>,
}

/// The base planes of a view as the shaders take them.
#[derive(Clone, Debug, Default)]
pub(crate) struct DrawnPlanes {
    pub(crate) planes: Vec<DrawnPlane>,
    /// The axis of the only base plane.
    pub(crate) axis: Option<usize>,
    /// Texels of all levels; with raster, of all but the first.
    pub(crate) texels: u32,
    /// With raster: columns and rows of the image that holds all base planes, one below the other.
    pub(crate) atlas: [u32; 2],
}

/// The base planes of a view, and their axes.
pub(crate) struct ChosenPlanes {
    pub(crate) planes: Vec<BasePlane>,
    pub(crate) axes: Vec<usize>,
}

/// Chooses the base planes of a view, within the capacity of the device.
pub(crate) fn choose_planes(
    gpu: &Gpu,
    grid: &Grid,
    options: &Options,
    view: &View,
    current: Option<usize>,
    raster: bool,
) -> Result<ChosenPlanes> {
    // Smaller levels take a third more. Raster's planes lie below each other in one image, and do not fill it.
    let share = if raster { 0.3 } else { 0.7 };
    let texels = num::f64_of_u64(gpu.most_bound_bytes() / TEXEL) * FILL * share;
    let side = f64::from(if raster { gpu.max_image_2d() } else { MOST_SIDE });
    let capacity = Capacity { texels, side, rows: if raster { side } else { f64::INFINITY } };
    let planes = base_planes(grid, view, current, options.hysteresis, options.intermediate, capacity)?;
    let mut axes: Vec<usize> = planes.iter().map(|plane| plane.axis).collect();
    axes.dedup();
    Ok(ChosenPlanes { planes, axes })
}

impl DrawnPlanes {
    /// Derives the push constants of the chosen base planes.
    #[expect(clippy::too_many_arguments, reason = "two callers, which have all of these at hand")]
    pub(crate) fn of(
        scene: &GpuScene,
        options: &Options,
        chosen: &ChosenPlanes,
        axes: &[usize],
        volume: &Volume,
        knots: &Knots,
        view: &View,
        raster: bool,
    ) -> Result<Self> {
        let parted = chosen.planes.len() > 1;
        let grid = scene.grid()?;
        let measure = DepthMeasure::of_grid(grid);
        let axis = match chosen.planes.as_slice() {
            [only] => Some(only.axis),
            _ => None,
        };
        let mut drawn = Self { axis, ..Self::default() };
        drawn.atlas = chosen
            .planes
            .iter()
            .fold([0, 0], |[columns, rows], plane| [columns.max(plane.size[0]), rows + plane.size[1]]);
        let mut row = 0;
        for (i, plane) in chosen.planes.iter().enumerate() {
            let stack = axes.iter().position(|&axis| axis == plane.axis).unwrap_or(0);
            let (mut push, slabs) = base_plane_push(scene, options, plane, knots)?;
            push.value_scale = volume.scale;
            push.value_offset = volume.offset;
            let [width, height] = plane.size;
            // A pixel on a seam belongs to the plane of the axis that comes last.
            let [after_u, after_v] = [1, 2].map(|step| u32::from((plane.axis + step) % 3 > plane.axis));
            let seams = if parted { after_u << 2 | after_v << 3 } else { 0 };
            let flags = u32::from(parted) | u32::from(i > 0) << 1 | seams;
            let mut warp = warp_push(plane, view, flags);
            warp.offset = if raster { row } else { drawn.texels };
            push.offset = warp.offset;
            row += height;
            if !raster {
                drawn.texels += width * height;
            }
            let below = |at: u32| f32::from_bits(at);
            warp.to_w[3] = below(drawn.texels);
            let mut halves = Vec::new();
            if options.warp == Warp::Mip {
                let levels = plane.texels_per_pixel.max(1.0).log2().ceil();
                let mut level = warp;
                while f64::from(num::count(halves.len())) < levels && level.size != [1, 1] {
                    halves.push(level);
                    let [w, h] = level.size.map(|side| side.div_ceil(2));
                    level = WarpPush { size: [w, h], stride: w, offset: drawn.texels, ..level };
                    drawn.texels += w * h;
                    level.to_w[3] = below(drawn.texels);
                }
            }
            warp.levels = num::count(halves.len()) + 1;
            let bounds = bounds_push(grid, &measure, view, plane, &push);
            drawn.planes.push(DrawnPlane { stack, push, slabs, bounds, warp, halves });
        }
        Ok(drawn)
    }
}

/// Returns the push constants that composite a base plane, without the place of its texels, and its number of slabs.
fn base_plane_push(
    scene: &GpuScene,
    options: &Options,
    plane: &BasePlane,
    knots: &Knots,
) -> Result<(BasePlanePush, u32)> {
    let grid = scene.grid()?;
    let half = turned((grid.last_index() * 0.5).to_array(), plane.axis);
    let last = 2.0 * half[2];
    let midpoint = options.segments.integrator == Integrator::Midpoint;
    let every = f64::from(options.every);
    let (begin, thickness, count) = if options.between {
        let thickness = options.grid.step * grid.spacing().min_element() / plane.length;
        (-half[2], thickness, (last / thickness).ceil())
    } else if midpoint {
        // Slices 0, every, 2 every... from the near side; the last slab may reach over it.
        (-half[2] - 0.5 * every, every, ((last + 0.5 * every) / every).ceil())
    } else {
        (-half[2], every, (last / every).ceil())
    };
    if count > MAX_SLABS {
        return Err(Error::invalid(
            format!("{NAME} option step"),
            format!(
                "{}: makes {count} slices of this grid, at most {MAX_SLABS} are drawn",
                options.grid.step
            ),
        ));
    }
    // Lengths: the axes as an upper triangular matrix, by Gram-Schmidt from the normal of the slices.
    let axes = grid.index_to_world();
    let [u, v, w] = turned([axes.x_axis, axes.y_axis, axes.z_axis], plane.axis);
    let across = u.cross(v).normalize_or_zero();
    let along_u = u.normalize_or_zero();
    let along_v = across.cross(along_u);
    let unit = across.dot(w).abs();
    let slope_u = [u.dot(along_u), v.dot(along_u), w.dot(along_u) * plane.sign].map(|x| x / unit);
    let slope_v = [v.dot(along_v), w.dot(along_v) * plane.sign].map(|x| x / unit);
    let push = BasePlanePush {
        q0_step: [plane.q.x, plane.q.y, plane.step_q.x, plane.step_q.y].map(f32_of),
        d0_step: [plane.d.x, plane.d.y, plane.step_d.x, plane.step_d.y].map(f32_of),
        half_scale: [half[0], half[1], half[2], unit].map(f32_of),
        slope_u: [slope_u[0], slope_u[1], slope_u[2], plane.near.max(-1e30)].map(f32_of),
        slope_v: slope_v.map(f32_of),
        z0: f32_of(begin),
        h: f32_of(thickness),
        value_scale: 1.0,
        value_offset: 0.0,
        knots: knots.count,
        first: 0,
        count: num::u32_of(count),
        order: num::count(plane.axis) | options.every << EVERY | if plane.sign < 0.0 { DOWN } else { 0 },
        opaque: f32_of(options.grid.stop / scene.max_colour()),
        offset: 0,
        size: plane.size,
        atlas: [0; 2],
    };
    let numbers = [push.q0_step, push.d0_step, push.half_scale, push.slope_u];
    let finite = numbers.iter().flatten().chain(&push.slope_v).all(|number| number.is_finite());
    if !(finite && push.half_scale[3].is_normal() && push.h > 0.0) && count > 0.0 {
        return Err(Error::invalid(
            "view",
            "the camera is so far from the grid, or its voxels so large or small, that float32 cannot hold the rays",
        ));
    }
    Ok((push, num::u32_of(count)))
}

/// Returns the push constants that warp a base plane, without the place of its texels.
fn warp_push(plane: &BasePlane, view: &View, flags: u32) -> WarpPush {
    let [width, height] = view.extent();
    let row = |m: glam::DMat3, i: usize| num::vec3_of(m.row(i)).extend(0.0).to_array();
    WarpPush {
        to_x: row(plane.to_texel, 0),
        to_y: row(plane.to_texel, 1),
        to_w: row(plane.to_texel, 2),
        ahead: row(plane.steepness, 0),
        aside_u: row(plane.steepness, 1),
        aside_v: row(plane.steepness, 2),
        half_extent: [f32_of(f64::from(width) * 0.5), f32_of(f64::from(height) * 0.5)],
        size: plane.size,
        offset: 0,
        stride: plane.size[0],
        levels: 1,
        flags,
    }
}
