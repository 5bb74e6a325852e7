//! Scenes of trained Gaussian splats: one file per format. [`columns`](crate::io::build::gaussians) makes splats of their numbers.
//!
//! [`ply`] is called by the reader of PLY files, which know splats by their properties.

pub(crate) mod gltf;
pub(crate) mod ksplat;
pub(crate) mod ply;
mod rows;
pub(crate) mod sog;
pub(crate) mod splat;
pub(crate) mod spz;
