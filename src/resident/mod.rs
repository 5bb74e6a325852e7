//! A scene on the device: each form of its data is uploaded when a technique first needs it, and shared.

mod brick_ranges;
mod bricks;
mod gpu_scene;
mod grid_bytes;
pub(crate) mod local_space;
pub(crate) mod mesh;
mod mips;
pub(crate) mod splats;
pub(crate) mod surfaces;
pub(crate) mod tables;
mod visible_scalars;
pub(crate) mod volume;

pub use gpu_scene::{GpuScene, UploadTimes};
pub use grid_bytes::GridBytes;
pub use tables::{Integrator, SegmentOptions};
