//! A scene on the device.
//!
//! Each form of the data is uploaded when a technique first needs it, and shared from then on: samples, meshes,
//! kernels, surfaces, tables of the transfer function. This module uses `scene`, `optics`, `gpu` and `primitives`; `frame` and the
//! techniques use it.

pub(crate) mod bricks;
mod cache;
pub(crate) mod clock;
mod gpu_scene;
mod light;
pub(crate) mod local_space;
pub(crate) mod mesh;
pub(crate) mod mesh_parts;
mod mips;
pub(crate) mod pages;
pub(crate) mod part_buffers;
pub(crate) mod splats;
pub(crate) mod surfaces;
pub(crate) mod tables;
pub(crate) mod visible_scalars;
pub(crate) mod volume;

pub use clock::UploadTimes;
pub use gpu_scene::GpuScene;
pub use tables::{Integrator, SegmentOptions};
pub use volume::GridBytes;
