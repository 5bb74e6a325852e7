//! Techniques for tetrahedral meshes, and the frame that they share.

pub mod abuffer;
mod frame;
pub mod havs;
mod havs_raster;
pub mod options;
pub(crate) mod order;
mod overlaps;
pub mod projected_tets;
mod projected_tets_options;
mod projected_tets_raster;
mod ranks;
mod shading;
