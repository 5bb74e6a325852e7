#![doc = include_str!("../README.md")]

pub mod choice;
pub mod error;
#[cfg(feature = "capi")]
pub mod ffi;
pub mod frame;
pub mod gpu;
mod interface;
pub mod io;
pub mod measure;
mod num;
mod optics;
pub mod reference;
pub mod scene;
pub mod technique;

pub use ash;
pub use error::{Error, Result};
pub use frame::Image;
pub use glam;
pub use gpu::Gpu;
pub use technique::{GpuScene, Plan, Recorded, Renderer, TargetDesc, TargetMode, Technique};
