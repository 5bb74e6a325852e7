//! The techniques by name, their options, and the renderer that draws a scene with one of them.
//!
//! `declare` declares options and techniques, `registry` lists the techniques; `renderer` prepares plans and
//! draws frames; `grid`, `shear_warp`, `mesh` and `splat` hold the techniques by kind of data, each behind
//! `frame::prepared::Prepared`. The room uses `frame`, `resident`, `primitives`, `optics`, `scene` and `gpu`; `choice`, `cli`, `ffi` and
//! engines use it.

pub(crate) mod declare;
pub mod grid;
pub mod mesh;
mod registry;
mod renderer;
#[cfg(feature = "io")]
mod scene_schema;
pub mod shear_warp;
pub mod splat;

pub use declare::draw::Sample;
pub use declare::{BlendOrder, EmptySpace, Numbers, OptionInfo, Resolution, Route};
pub use registry::{Method, Technique};
pub use renderer::{FrameTime, Frames, Renderer};
#[cfg(feature = "io")]
pub use scene_schema::scene_schema;
