//! What bounds the lines of base planes' texels, and the pixels that texels do not tell (`glsl/shear-bounds.glsl`).
//!
//! Clip planes and depth images bound the lines of pixels. A texel's line is cut at depths that are interpolated from the four
//! pixels around it. Where a pixel's own line is cut elsewhere than its four texels say, as at outlines of surfaces, what was composited
//! along them is another matter: after the warp such pixels are marched by themselves, along their own lines, in the same slices.

use std::sync::Arc;

use glam::DMat3;

use crate::error::Result;
use crate::frame::depth_measure::DepthMeasure;
use crate::gpu::shader::{
    BINDING_EDGES, BINDING_LINE_BOUNDS, BINDING_TEXEL_BOUNDS, EDGE_NONE, SHEAR_BOUNDS_EDGES,
    SHEAR_BOUNDS_TEXELS,
};
use crate::gpu::{Buffer, Gpu, Recorder, Resource, SpecConstant};
use crate::interface::{BasePlanePush, ShearBoundsPush};
use crate::num::{self, f32_of};
use crate::primitives::dispatch::{Dispatch, buffer, pass, tiles_of};
use crate::scene::grid::turned;
use crate::scene::{Grid, View};
use crate::technique::shear_warp::base_plane::BasePlane;
use crate::technique::shear_warp::options::NAME;

/// Depth along the stack, in slabs, by which pixel and texels may differ.
const TOLERANCE: f64 = 0.05;

/// The same among a pixel's four texels.
const SPREAD: f64 = 1.0;

// No depth in a stack is as large.
const _: () = assert!(EDGE_NONE > 1 << 24);

/// The passes beside those of the unbounded frame, but for the march of single pixels.
#[derive(Debug)]
pub(crate) struct ShearBounds {
    texels: Dispatch,
    edges: Dispatch,
    /// Two depths for each texel.
    pub(crate) texel_bounds: Arc<Buffer>,
    /// For each pixel its texel and, where it is to be marched by itself, two depths.
    pub(crate) edge_pixels: Arc<Buffer>,
}

impl ShearBounds {
    /// `bounds` are those of pixels; there are at most `texels` texels, and `warp` is the filter between them.
    pub(crate) fn new(
        gpu: &Gpu,
        bounds: &Arc<Buffer>,
        view: &View,
        texels: u64,
        warp: SpecConstant,
    ) -> Result<Self> {
        let pixels: u64 = view.extent().map(u64::from).iter().product();
        let texel_bounds = buffer(gpu, &format!("{NAME}.texel-bounds"), 2 * texels)?;
        let edge_pixels = buffer(gpu, &format!("{NAME}.edges"), 4 * pixels)?;
        let of_pixels = (BINDING_LINE_BOUNDS, Resource::ReadOnly(Arc::clone(bounds)));
        Ok(Self {
            texels: pass(
                gpu,
                &format!("{NAME}.bounds"),
                &SHEAR_BOUNDS_TEXELS,
                &[],
                &[of_pixels.clone(), (BINDING_TEXEL_BOUNDS, Resource::Buffer(Arc::clone(&texel_bounds)))],
            )?,
            edges: pass(
                gpu,
                &format!("{NAME}.edges"),
                &SHEAR_BOUNDS_EDGES,
                &[warp],
                &[
                    of_pixels,
                    (BINDING_TEXEL_BOUNDS, Resource::ReadOnly(Arc::clone(&texel_bounds))),
                    (BINDING_EDGES, Resource::Buffer(Arc::clone(&edge_pixels))),
                ],
            )?,
            texel_bounds,
            edge_pixels,
        })
    }

    /// Before a base plane is composited.
    pub(crate) fn record_texels(&self, recorder: &mut Recorder<'_>, push: &ShearBoundsPush) {
        self.texels.record(recorder, push, tiles_of(push.size));
    }

    /// After its warp.
    pub(crate) fn record_edges(&self, recorder: &mut Recorder<'_>, push: &ShearBoundsPush, extent: [u32; 2]) {
        self.edges.record(recorder, push, tiles_of(extent));
    }
}

/// What the passes need to know of a base plane; the place of its texels as in `base`.
pub(crate) fn bounds_push(
    grid: &Grid,
    measure: &DepthMeasure,
    view: &View,
    plane: &BasePlane,
    base: &BasePlanePush,
) -> ShearBoundsPush {
    let forward = view.forward() / measure.unit;
    let axes = grid.index_to_world();
    let ahead = turned([axes.x_axis, axes.y_axis, axes.z_axis].map(|axis| forward.dot(axis)), plane.axis);
    // A matrix's size says nothing of places.
    let to_pixel = plane.to_texel.inverse();
    let largest = to_pixel.to_cols_array().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let to_pixel: DMat3 = to_pixel * (1.0 / largest.max(f64::MIN_POSITIVE));
    let [width, height] = view.extent().map(|side| f64::from(side) * 0.5);
    let row = |i: usize, last: f64| to_pixel.row(i).extend(last).to_array().map(f32_of);
    ShearBoundsPush {
        q0_step: base.q0_step,
        d0_step: base.d0_step,
        ahead_sign: [ahead[0], ahead[1], ahead[2], plane.sign].map(f32_of),
        to_x: row(0, width),
        to_y: row(1, height),
        to_w: num::vec3_of(to_pixel.row(2)).extend(base.half_scale[2]).to_array(),
        size: plane.size,
        offset: base.offset,
        stride: plane.size[0],
        tolerance: f32_of(TOLERANCE * f64::from(base.h)),
        spread: f32_of(SPREAD * f64::from(base.h)),
        ..ShearBoundsPush::default()
    }
}
