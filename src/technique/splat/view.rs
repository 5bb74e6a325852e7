//! The push constants of a view of splats.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::interface::{SplatPush, SplatViewPush};
use crate::num::f32_of;
use crate::resident::local_space::{LocalSpace, LocalView};
use crate::resident::splats::{Shape, SplatSet};
use crate::scene::{Kernel, Projection, View};
use crate::technique::grid::rays::GridRays;
use crate::technique::splat::desc::{Accumulation, SplatDesc};

/// Most sheets of a frame.
const MAX_SHEETS: f64 = 4_194_304.0;

/// A view as the shaders see it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplatView {
    /// For the pass that projects kernels.
    pub(crate) project: SplatViewPush,
    /// For the passes that draw bins.
    pub(crate) draw: SplatPush,
    /// Whether data may reach behind the eye.
    pub(crate) eye_inside: bool,
    /// The axis of the data that sheets are stacked along.
    pub(crate) axis: usize,
}

impl SplatView {
    /// Derives the push constants in float64; `opaque` is the transmittance at which a ray ends.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] where slabs are so thin that float32 cannot count them, or the view exceeds float32.
    pub(crate) fn new(
        set: &SplatSet,
        desc: &SplatDesc,
        knots: u32,
        opaque: f64,
        view: &View,
    ) -> Result<Self> {
        let space = &set.space;
        let local = LocalSpace { centre: space.centre, radius: space.unit }.view(view);
        let rays = GridRays::of(space.to_world.inverse(), space.centre, &space.corners, view);
        let axis = sheet_axis(set, view);
        let thickness = sheet_thickness(set, desc)?;
        let project = project_push(set, desc, view, &local, thickness, axis);
        let h = if desc.accumulation == Accumulation::ByPixel {
            reach_of_footprints(set, desc, &local, view.pixel_aspect())
        } else {
            thickness
        };
        let draw =
            SplatPush { h: f32_of(h), opaque: f32_of(opaque), knots, ..ray_push(set, &local, &rays, view) };
        let numbers = [
            project.right,
            project.up,
            project.forward,
            draw.q0_kq,
            draw.px_slope,
            draw.py_slope,
            draw.d0_slope,
        ];
        let finite = numbers.iter().flatten().all(|number| number.is_finite());
        if !(finite && project.pixel.is_normal() && project.unit.is_normal()) {
            return Err(Error::invalid(
                "view",
                "the camera is so far from the data, or the data so large or small, that float32 cannot hold the view",
            ));
        }
        // The data lies within one unit of its centre.
        let eye_inside = rays.near / space.unit > -1.001;
        Ok(Self { project, draw, eye_inside, axis })
    }
}

/// Returns the thickness of slabs in units of depth, or the distance of layers in splat space.
fn sheet_thickness(set: &SplatSet, desc: &SplatDesc) -> Result<f64> {
    let space = &set.space;
    let thickness = if desc.accumulation == Accumulation::Sheets {
        space.layer * if set.shape == Shape::Alike { 1.0 } else { desc.options.step }
    } else {
        desc.options.step * space.step / space.unit
    };
    // All data lies within two units of depth, or of extent along an axis. Float32 counts sheets.
    let sheets = match desc.accumulation {
        Accumulation::Slabs => 2.0 / thickness,
        Accumulation::Sheets if set.shape != Shape::Alike => 2.0 / thickness,
        _ => 0.0,
    };
    if sheets > MAX_SHEETS {
        return Err(Error::invalid(
            format!("{} option step", desc.name),
            format!(
                "{}: makes {sheets:.0} sheets of this scene, at most {MAX_SHEETS} are drawn",
                desc.options.step
            ),
        ));
    }
    Ok(thickness)
}

/// Returns a bound of the distance between a kernel's centre and where it is met by the lines that its footprint
/// covers, in units of depth.
fn reach_of_footprints(set: &SplatSet, desc: &SplatDesc, local: &LocalView, aspect: f64) -> f64 {
    let kernel = set.reach / set.space.unit;
    // An ellipse is met at most as far before or behind the centre as aside, and aside at most the kernel's reach, wider by the pixel's filter. A
    // quarter more is for lines off the axis.
    let ellipse = || {
        let filter =
            set.cut * desc.variance.sqrt() * local.pixel * aspect.max(1.0) * (local.w0 + local.w1).abs();
        2.5 * (kernel + filter)
    };
    // Depths in float32 have less rounding than this.
    1.001 * if desc.ewa { ellipse() } else { kernel } + 1e-5
}

/// Returns the push constants of the pass that projects kernels.
fn project_push(
    set: &SplatSet,
    desc: &SplatDesc,
    view: &View,
    local: &LocalView,
    thickness: f64,
    axis: usize,
) -> SplatViewPush {
    let space = &set.space;
    // Rows of the matrix from splat space to view coordinates, in units.
    let row = |(vector, offset): (DVec3, f64)| {
        let v = space.to_world.transpose() * vector / space.unit;
        [v.x, v.y, v.z, offset].map(f32_of)
    };
    let [right, up, forward] = local.rows;
    let (aspect, skew) = view.shape();
    // Where the eye is along the axis of sheets; far beyond all data for parallel rays.
    let ahead = space.to_world.inverse() * view.forward();
    let eye = match view.camera().projection {
        Projection::Perspective { .. } => (space.to_world.inverse() * (view.camera().eye - space.centre))
            .to_array()[axis]
            .clamp(-1e29, 1e29),
        Projection::Orthographic { .. } if ahead.to_array()[axis] > 0.0 => -1e38,
        Projection::Orthographic { .. } => 1e38,
    };
    SplatViewPush {
        right: row(right),
        up: row(up),
        forward: row((forward.0, local.begin)),
        half_extent: view.half_extent(),
        pixel: f32_of(local.pixel),
        w0: f32_of(local.w0),
        w1: f32_of(local.w1),
        unit: f32_of(space.unit),
        cut: f32_of(set.cut),
        amplitude: f32_of(set.amplitude),
        lowpass: f32_of(desc.variance),
        thickness: f32_of(thickness),
        eye: f32_of(eye),
        middle: f32_of(space.middles[axis]),
        count: set.count,
        aspect: f32_of(aspect),
        skew: skew.to_array().map(f32_of),
        room: set.count,
        pad0: 0,
    }
}

/// Returns the push constants of rays in splat space.
fn ray_push(set: &SplatSet, local: &LocalView, rays: &GridRays, view: &View) -> SplatPush {
    let space = &set.space;
    let pack = |v: DVec3, w: f64| [v.x, v.y, v.z, w].map(f32_of);
    let gradient = space.to_world.transpose() * local.rows[2].0 / space.unit;
    // Half the depth that a kernel of sigma 1 spans; for a product of kernels, half the depth of its box.
    let product = set.shape == Shape::Alike && set.kernels.kernel != Kernel::Gaussian;
    let reach = set.cut * if product { gradient.abs().element_sum() } else { gradient.length() };
    let reach = if set.shape == Shape::Alike { reach } else { set.cut };
    let [slope_x, slope_y, middle_x, middle_y] = view.slopes();
    SplatPush {
        q0_kq: pack(rays.q0, rays.kq),
        px_slope: pack(rays.px, slope_x),
        py_slope: pack(rays.py, slope_y),
        // Shaders measure depth in units, `GridRays` in the world's.
        d0_slope: pack(rays.d0 * space.unit, middle_x),
        slope_y: f32_of(middle_y),
        forward_reach: pack(gradient, reach),
        sides: view.sides(),
        unit: f32_of(space.unit),
        cut: f32_of(set.cut),
        least: f32_of(set.kernels.least),
        amplitude: f32_of(set.amplitude),
        ..SplatPush::default()
    }
}

/// Returns the axis of the data along which sheets are stacked: the one whose layers face the view most.
fn sheet_axis(set: &SplatSet, view: &View) -> usize {
    let space = &set.space;
    let from_centre = view.camera().eye - space.centre;
    let outside = from_centre.length() > space.unit;
    let direction =
        if view.is_perspective() && outside { from_centre.normalize_or_zero() } else { view.forward() };
    let inverse = space.to_world.inverse();
    let cosines = [0, 1, 2].map(|axis| inverse.row(axis).normalize_or_zero().dot(direction).abs());
    let mut best = 2;
    for axis in [1, 0] {
        if cosines[axis] > cosines[best] {
            best = axis;
        }
    }
    best
}
