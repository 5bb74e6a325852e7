//! Techniques that draw scalar grids along the rays of pixels: stacks of slices, view-aligned slices, slabs, ray casting.
//!
//! Each technique implements `technique::GridTechnique`; `frame` builds and records what they share, by the `route` that options and
//! device allow. It uses `frame`, `resident`, `primitives`, `gpu`, `scene` and `technique::declare`. `technique::registry`
//! builds its frames; `shear_warp` and `splat` use its rays, options and dispatch limits.

mod blue_noise;
pub(crate) mod cut;
pub(crate) mod dispatch_limits;
pub(crate) mod frame;
pub mod options;
pub(crate) mod paging;
pub mod raycast;
pub(crate) mod rays;
mod route;
pub mod slabs;
pub mod slices_2d;
pub mod slices_3d;
mod steps;
pub(crate) mod technique;
