//! A base plane: the stack's axis, the lattice of texels, and their rays.

use glam::{DMat3, DVec2};

/// A base plane of a view. Positions are indices from the domain's centre, axes in the order of the stack.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BasePlane {
    /// The axis along which slices are stacked.
    pub(crate) axis: usize,
    /// 1 where rays go up that axis, -1 where they go down. Depth along the axis grows along rays.
    pub(crate) sign: f64,
    /// Texels along each side.
    pub(crate) size: [u32; 2],
    /// The ray of texel t, counted from the texel at half the size, rounded down, is at `q + step_q t + z (d + step_d t)` at depth z
    /// from the domain's centre.
    pub(crate) q: DVec2,
    pub(crate) step_q: DVec2,
    pub(crate) d: DVec2,
    pub(crate) step_d: DVec2,
    /// Depth of the eye; minus infinity for parallel rays.
    pub(crate) near: f64,
    /// Maps pixels, `(x, y, 1)`, x and y from the image's centre, y down, to texels, `(x w, y w, w)`; w is positive in front
    /// of the eye.
    pub(crate) to_texel: DMat3,
    /// Maps pixels to how steeply their ray crosses the slices of this axis and those of the other two. A pixel belongs to this plane
    /// if the first is the largest. Zero where there is one plane.
    pub(crate) steepness: DMat3,
    /// Largest extent of a pixel in texels.
    pub(crate) texels_per_pixel: f64,
    /// World length of the ray through the middle of the region that is drawn, per unit of depth along the stack.
    pub(crate) length: f64,
}
