//! The library for C programs; `include/volraster.h` declares it.
//!
//! Handles are boxes behind opaque pointers. A handle keeps everything alive that it was made from, so that handles may be
//! destroyed in any order. Each function catches panics, checks pointers for null, and stores a message for [`vr_last_error`]
//! when it fails. Structures begin with their size; see `argument`.
//!
//! May use everything but the program. Used by C programs only. `argument`, `result` and `vulkan` are the basis of the other
//! files, which have functions and their structures.

#![expect(unsafe_code, reason = "reads and writes through pointers from C")]
#![expect(non_camel_case_types, reason = "C names")]

mod argument;
mod data;
mod gpu;
mod host;
mod info;
mod plan;
mod recording;
mod result;
mod scene;
mod scene_from;
mod view;
mod vulkan;

pub use data::*;
pub use gpu::*;
pub use host::*;
pub use info::*;
pub use plan::*;
pub use recording::*;
pub use result::*;
pub use scene::*;
pub use scene_from::*;
pub use view::*;
pub use vulkan::*;
