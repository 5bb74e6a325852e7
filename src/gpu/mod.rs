//! The one module that talks to Vulkan, and the only one with `unsafe`.
//!
//! | file | what |
//! |---|---|
//! | `instance`, `validation` | loader, instance, validation layer and its log |
//! | `select`, `device` | choice of a device, the logical device, optional features |
//! | `budget` | own account of device memory |
//! | `buffer`, `image`, `transfer` | owning resources, staging up and down |
//! | `shader`, `pipeline`, `cache` | modules, pipelines built on first use, the pipeline cache on disk |
//! | `sync`, `recorder`, `submit` | uses and the barriers between them, passes, submissions |
//! | `provoke` | errors on purpose, one for each kind of validation |
//! | `probe` | what the device really does, asked when it matters |
//! | `external` | command buffers and images that belong to the caller |
//! | `loss` | a device that is lost |
//! | `inject` | Vulkan calls that fail on request, for tests |

#![expect(unsafe_code, reason = "the one module that talks to Vulkan")]

mod budget;
mod buffer;
mod cache;
mod device;
mod external;
mod image;
mod inject;
mod instance;
mod loss;
mod pipeline;
mod probe;
mod provoke;
mod recorder;
mod select;
pub(crate) mod shader;
mod submit;
pub(crate) mod sync;
#[cfg(test)]
pub(crate) mod testing;
mod transfer;
mod validation;

pub(crate) use buffer::{Buffer, BufferUse};
pub(crate) use image::{Image, ImageDesc};
pub(crate) use pipeline::{Blend, ComputeDesc, Descriptors, GraphicsDesc, Pipeline, Resource, SpecConstant};
pub(crate) use recorder::{Attachment, Keep, Recorder, Timers};
pub(crate) use submit::Commands;

pub use cache::user_cache_folder;
pub use device::{Gpu, GpuOptions, Handles, OptionalFeature, devices};
pub use external::{CommandBuffer, DepthImage, TargetImage};
pub use inject::Injection;
pub use provoke::Provocation;
pub use select::DeviceReport;
pub use submit::PassTime;
pub use validation::{Validation, ValidationLog};
