//! A frame: its target, the plan that fixes everything it needs, and the steps that all techniques share.

pub(crate) mod composite;
pub(crate) mod depth_measure;
pub(crate) mod dry_run;
pub(crate) mod lists;
mod offscreen;
pub(crate) mod plan;
pub(crate) mod prepared;
pub(crate) mod ray_bounds;
pub(crate) mod read_back;
pub(crate) mod surfaces;
pub(crate) mod target;

pub use offscreen::Offscreen;
pub use plan::{Plan, Recorded, Status};
pub use target::{TargetDesc, TargetMode};
