//! Shear-warp: slices composited in a base plane along the lines of sight, and the result warped to the image (Lacroute and
//! Levoy 1994; Peikert, Object Space Volume Rendering, SciVis 2007, pages 4-5 to 4-17).
//!
//! A view is factored into a permutation of the axes, a shear of the slices (in perspective with a scaling) and a warp
//! that does not depend on depth. A texel of the base plane is one line of sight: what is composited there is what
//! `slices-2d` or, with an integrator of segments, `slabs` composites along that line. How many lines there are is
//! independent of the image's pixels, and that is what is saved.
//!
//! 1. `factorisation` factors views; `base_planes` chooses base planes, up to six where the eye is near the domain or in it,
//!    and lays a lattice of texels on each.
//! 2. `glsl/shear-warp.glsl` composites slabs: a march along the line of each texel (route `compute`), or a quad a slab,
//!    blended by fixed function (route `raster`).
//! 3. `glsl/warp.glsl` resamples the intermediate image: each pixel that of the base plane whose slices its line
//!    crosses most steeply. `warp=mip` averages texels that are smaller than pixels.
//!
//! Error: along a line that of `slices-2d` or `slabs`; then that of resampling, second order in the texels' distance (third
//! with `warp=bicubic`) where the image is smooth, and blur of the size of a texel at edges. The homogeneous domain is
//! exact for lines through both faces. Cost: per slab and covered texel one bilinear look-up (with `step` two) and one
//! classification or integration; four to sixteen texels a pixel. Each axis is one more copy of the grid. Needs: core Vulkan
//! 1.3.

mod base_plane;
mod base_planes;
mod bounds;
mod build;
mod factorisation;
mod frame;
mod march;
mod options;
mod planes;
mod region;

pub(crate) use frame::ShearFrame;
pub(crate) use options::OPTIONS;
pub use options::{Intermediate, Options, Warp};
