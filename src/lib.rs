#![doc = include_str!("../README.md")]

pub mod choice;
pub mod error;
#[cfg(feature = "capi")]
pub mod ffi;
mod frame;
pub mod gpu;
mod image;
mod interface;
#[cfg(feature = "io")]
pub mod io;
pub mod measure;
mod num;
mod optics;
#[cfg(feature = "cli")]
pub mod peak;
mod primitives;
pub mod ranks;
pub mod reference;
mod replace;
mod resident;
pub mod scene;
pub mod technique;
#[cfg(feature = "cli")]
pub mod window;

pub use ash;
pub use error::{Error, Result};
pub use frame::{ErrorBound, Offscreen, Plan, RecordInfo, Recorded, Status, TargetDesc, TargetMode};
pub use glam;
pub use gpu::Gpu;
pub use image::{Colours, Image};
pub use resident::{GpuScene, GridBytes, Integrator, SegmentOptions, UploadTimes};
pub use technique::{FrameTime, Frames, Method, Renderer, Technique};

/// Whether this run of the tests takes every case (`make test-all`), and not a selection (`make test`).
#[cfg(test)]
pub(crate) fn exhaustive() -> bool {
    std::env::var_os("VOLRASTER_TESTS").is_some_and(|tier| tier == "all")
}
