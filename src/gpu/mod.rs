//! Everything that calls Vulkan: devices, resources, pipelines, recording, submission. `unsafe` code is only here and in
//! [`ffi`](crate::ffi).
//!
//! May use `error`, `num`, `interface`, and `io` for the pipeline cache. Used by `primitives`, `resident`, `frame`,
//! `technique`, `ffi` and the program. From bottom to top: `instance`, `select`; `device` (what exists once per
//! device); `host`, `memory`, `buffer`, `image`, `pipeline`, `inputs`, `descriptors`; `sync`, `steps`, `issue`, `recorder`; `submit`,
//! `transfer`; `probe`, `query`; `open` and `adopt` make the [`Gpu`].

#![expect(unsafe_code, reason = "calls Vulkan")]

mod addressing;
mod adopt;
mod budget;
mod buffer;
mod cache;
mod constants;
mod depth;
mod descriptors;
mod device;
mod emulation;
mod external;
#[cfg(feature = "testing")]
mod faults;
mod feature;
mod host;
mod image;
#[cfg(feature = "testing")]
mod inject;
pub(crate) mod inputs;
mod instance;
mod issue;
mod layer_lock;
mod memory;
mod open;
mod options;
mod pipeline;
mod pipeline_build;
mod probe;
mod query;
mod queue;
mod recorder;
mod select;
pub(crate) mod shader;
mod specialise;
mod statistics;
mod steps;
mod submit;
#[cfg(feature = "cli")]
mod surface;
pub(crate) mod sync;
#[cfg(test)]
pub(crate) mod testing;
mod timers;
mod transfer;
mod validation;

pub(crate) use buffer::{Buffer, BufferUse};
pub(crate) use descriptors::Descriptors;
pub(crate) use image::{Image, ImageDesc};
pub(crate) use inputs::{Bound, Sampled};
pub(crate) use pipeline::{Blend, GraphicsState, Pipeline};
pub(crate) use recorder::{Keep, Recorder};
pub(crate) use steps::{Attachment, Groups, Step, Used};
pub(crate) use submit::Commands;
#[cfg(feature = "cli")]
pub(crate) use surface::Surface;
pub(crate) use timers::Timers;

pub use adopt::GpuParts;
pub use cache::user_cache_folder;
pub use depth::{DepthImage, DepthProjection};
pub use device::{Gpu, Handles, LossNote};
pub use external::{CommandBuffer, TargetImage};
#[cfg(feature = "testing")]
pub use faults::Fault;
pub use feature::{Enabled, FeatureStructures, OptionalFeature};
pub use host::{AllocationCallbacks, Compilation, MemoryAccess, MemoryPart, MemoryRequest, MemorySource};
#[cfg(feature = "testing")]
pub use inject::Injection;
pub use open::devices;
pub use options::{GpuOptions, PipelineCache};
pub use queue::QueueLock;
pub use select::DeviceReport;
pub use statistics::{PipelineReport, ShaderStatistics};
pub use submit::PassTime;
pub use validation::{Validation, ValidationLog};
