//! The one module that talks to Vulkan, and the only one with `unsafe`.
//!
//! | file | what |
//! |---|---|
//! | `instance`, `validation` | loader, instance, validation layer and its log |
//! | `select`, `device`, `feature` | choice of a device, the logical device, what is enabled on it |
//! | `adopt`, `queue` | a device that the caller made; the queue and its lock |
//! | `budget` | own account of device memory |
//! | `buffer`, `image`, `transfer` | owning resources, staging up and down |
//! | `shader`, `pipeline`, `cache` | modules, pipelines built on first use, the pipeline cache on disk |
//! | `sync`, `recorder`, `submit` | uses and the barriers between them, passes, submissions |
//! | `provoke` | errors on purpose, one for each kind of validation |
//! | `probe` | what the device really does, asked when it matters |
//! | `external`, `depth` | command buffers and images that belong to the caller; depth images and their projections |
//! | `loss` | a device that is lost |
//! | `inject` | Vulkan calls that fail on request, for tests |

#![expect(unsafe_code, reason = "the one module that talks to Vulkan")]

mod adopt;
mod budget;
mod buffer;
mod cache;
mod copy;
mod depth;
mod descriptors;
mod device;
mod draw;
mod external;
mod feature;
mod image;
#[cfg(feature = "testing")]
mod inject;
mod instance;
mod layer_lock;
mod loader;
mod loss;
mod memory;
mod open;
mod options;
mod pipeline;
mod pipeline_build;
mod probe;
#[cfg(feature = "testing")]
mod provoke;
mod query;
mod queue;
mod recorder;
mod sampler;
mod select;
pub(crate) mod shader;
mod submit;
pub(crate) mod sync;
#[cfg(test)]
pub(crate) mod testing;
mod timers;
mod transfer;
mod validation;

pub(crate) use buffer::{Buffer, BufferUse};
pub(crate) use descriptors::{Descriptors, Resource};
pub(crate) use draw::Attachment;
pub(crate) use image::{Image, ImageDesc};
pub(crate) use pipeline::{Blend, ComputeDesc, GraphicsDesc, Pipeline, SpecConstant};
pub(crate) use recorder::{Keep, Recorder};
pub(crate) use submit::Commands;
pub(crate) use timers::Timers;

pub use adopt::GpuParts;
pub use cache::user_cache_folder;
pub use depth::{DepthImage, DepthProjection};
pub use device::{Gpu, Handles};
pub use external::{CommandBuffer, TargetImage};
pub use feature::{Enabled, OptionalFeature};
#[cfg(feature = "testing")]
pub use inject::Injection;
pub use open::devices;
pub use options::GpuOptions;
#[cfg(feature = "testing")]
pub use provoke::Provocation;
pub use queue::QueueLock;
pub use select::DeviceReport;
pub use submit::PassTime;
pub use validation::{Validation, ValidationLog};
