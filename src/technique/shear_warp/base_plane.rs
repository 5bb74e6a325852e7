//! A base plane: the stack's axis, the lattice of texels, and their rays.

use glam::{DMat3, DVec2};

/// What sets the distance of texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Resolution {
    /// A texel for each voxel of the nearest slice.
    Voxel,
    /// So many texels for each pixel, along each side, in the middle of what is drawn.
    Pixel(f64),
    /// A texel for each voxel of the nearest slice, but no finer than pixels, and no coarser than [`COARSEST`] of them.
    Auto,
}

/// A base plane of a view. Positions are indices from the domain's centre, axes in the order of the stack.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BasePlane {
    /// Axis that the slices are stacked along.
    pub(crate) axis: usize,
    /// 1 where lines of sight go up that axis, -1 where they go down. Depth along it grows with them.
    pub(crate) sign: f64,
    /// Texels along each side.
    pub(crate) size: [u32; 2],
    /// The line of a texel t, counted from the one at half the size, rounded down, at depth z from the domain's centre is at
    /// `q + step_q t + z (d + step_d t)`.
    pub(crate) q: DVec2,
    pub(crate) step_q: DVec2,
    pub(crate) d: DVec2,
    pub(crate) step_d: DVec2,
    /// Depth of the eye; minus infinity for parallel rays.
    pub(crate) near: f64,
    /// From pixels, `(x, y, 1)`, x and y from the image's centre, y down, to texels, `(x w, y w, w)`; w is positive in front
    /// of the eye.
    pub(crate) to_texel: DMat3,
    /// From pixels to how steeply their line crosses the planes of the slices, and those of the other two axes. Only
    /// pixels with the first as large as the others are this plane's; zero where there is one plane.
    pub(crate) steepness: DMat3,
    /// Most texels that a pixel is long, along the line where it is longest.
    pub(crate) texels_per_pixel: f64,
    /// World length of the line through the middle of what is drawn, for a step along the stack.
    pub(crate) length: f64,
}
