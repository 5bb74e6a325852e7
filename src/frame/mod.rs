//! A frame is one image drawn once. This room holds the plan that fixes everything a frame needs, the target that it is drawn into, and
//! the steps that all techniques share: bounds of rays, surfaces, lists of fragments, the composite, and the read-back.
//!
//! It uses `scene`, `resident`, `primitives` and `gpu`, and no technique: a technique implements [`prepared::Prepared`]. `technique`
//! builds plans; `cli`, `ffi` and engines record them.

pub(crate) mod counts;
pub(crate) mod depth_measure;
pub(crate) mod dry_run;
pub(crate) mod hit_depths;
pub(crate) mod in_parts;
pub(crate) mod lists;
mod offscreen;
pub(crate) mod plan;
pub(crate) mod prepared;
pub(crate) mod ray_bounds;
pub(crate) mod read_back;
pub(crate) mod surfaces;
pub(crate) mod target;
pub(crate) mod upsampling;

pub use offscreen::Offscreen;
pub use plan::{Plan, RecordInfo, Recorded, Status};
pub use prepared::ErrorBound;
pub use target::{TargetDesc, TargetMode};
