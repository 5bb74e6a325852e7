//! Techniques that splat kernels: `splat-sheets` and `splat-ewa`, which share one frame, and `gaussians` for trained splats.
//!
//! Kernels are projected, sorted and binned to tiles, and each tile draws its bin. This
//! module uses `frame`, `resident`, `primitives` and `gpu`; the registry of techniques uses it.

mod bands;
mod desc;
pub mod ewa;
mod frame;
pub mod gaussians;
pub mod options;
mod outcome;
mod parts;
pub mod sheets;
mod template;
mod view;
