//! Bounds the rays of base planes' texels, and finds the pixels that need a march of their own (`glsl/shear-warp/shear-bounds.glsl`).
//!
//! Clip planes and depth images bound the rays of pixels. The bounds of a texel's ray are interpolated from the four
//! pixels around it. A pixel whose own bounds differ from those of its four texels, as at outlines of surfaces, cannot take the texels'
//! colour: after the warp it is marched along its own ray, in the same slices.

use std::sync::Arc;

use glam::DMat3;

use crate::error::Result;
use crate::frame::depth_measure::DepthMeasure;
use crate::gpu::shader::{
    EDGE_NONE, SHEAR_BOUNDS_EDGES, SHEAR_BOUNDS_TEXELS, ShearBoundsEdges, ShearBoundsTexels,
};
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::interface::{BasePlanePush, ShearBoundsPush};
use crate::num::{self, f32_of};
use crate::primitives::dispatch::{Dispatch, buffer, pass, tiles_of};
use crate::scene::grid::turned;
use crate::scene::{Grid, View};
use crate::technique::shear_warp::base_plane::BasePlane;
use crate::technique::shear_warp::options::NAME;

/// Most difference in depth along the stack, in slabs, between a pixel and its texels.
const TOLERANCE: f64 = 0.05;

/// Most difference among a pixel's four texels.
const SPREAD: f64 = 1.0;

// Larger than every depth in a stack.
const _: () = assert!(EDGE_NONE > 1 << 24);

/// The passes that a bounded frame adds, except for the march of single pixels.
#[derive(Debug)]
pub(crate) struct ShearBounds {
    texels: Dispatch,
    edges: Dispatch,
    /// Two depths per texel.
    pub(crate) texel_bounds: Arc<Buffer>,
    /// For each pixel its texel and, where it has a march of its own, two depths.
    pub(crate) edge_pixels: Arc<Buffer>,
}

impl ShearBounds {
    /// Builds the passes from the bounds of pixels, for at most `texels` texels and the filter of the warp.
    pub(crate) fn new(gpu: &Gpu, bounds: &Arc<Buffer>, view: &View, texels: u64, warp: u32) -> Result<Self> {
        let pixels: u64 = view.extent().map(u64::from).iter().product();
        let texel_bounds = buffer(gpu, &format!("{NAME}.texel-bounds"), 2 * texels)?;
        let edge_pixels = buffer(gpu, &format!("{NAME}.edges"), 4 * pixels)?;
        let of_texels = SHEAR_BOUNDS_TEXELS
            .with(&ShearBoundsTexels { line_bounds: bounds.read(), texel_bounds: texel_bounds.write() });
        let of_edges = SHEAR_BOUNDS_EDGES.with(&ShearBoundsEdges {
            edges: edge_pixels.write(),
            line_bounds: bounds.read(),
            texel_bounds: texel_bounds.read(),
            warp,
        });
        Ok(Self {
            texels: pass(gpu, &format!("{NAME}.bounds"), &of_texels)?,
            edges: pass(gpu, &format!("{NAME}.edges"), &of_edges)?,
            texel_bounds,
            edge_pixels,
        })
    }

    /// Records the bounds of the texels of a base plane, before it is composited.
    pub(crate) fn record_texels(&self, recorder: &mut Recorder<'_>, push: &ShearBoundsPush) {
        self.texels.record(recorder, push, tiles_of(push.size));
    }

    /// Records the search for pixels with a march of their own, after the warp of the base plane.
    pub(crate) fn record_edges(&self, recorder: &mut Recorder<'_>, push: &ShearBoundsPush, extent: [u32; 2]) {
        self.edges.record(recorder, push, tiles_of(extent));
    }
}

/// Returns the push constants of a base plane; the place of its texels is that in `base`.
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
    // The scale of a homogeneous matrix is free.
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
