//! Techniques for grids, and the frame that they share.

mod blue_noise;
pub(crate) mod frame;
pub mod options;
pub mod raycast;
pub(crate) mod rays;
pub mod slabs;
pub mod slices_2d;
pub mod slices_3d;
