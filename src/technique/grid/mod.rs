//! Techniques for grids, and the frame that they share.

mod blue_noise;
pub(crate) mod cut;
pub(crate) mod dispatch_limits;
pub(crate) mod frame;
pub mod options;
pub mod raycast;
pub(crate) mod rays;
mod route;
pub mod slabs;
pub mod slices_2d;
pub mod slices_3d;
pub(crate) mod technique;
