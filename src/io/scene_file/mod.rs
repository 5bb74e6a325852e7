//! The scene file: JSON that names the data and describes the view.
//!
//! Unknown keys are errors that name the allowed ones. Paths are relative to the scene file.
//! The structs of its keys also derive its JSON Schema, to which `technique` adds techniques.
//! It uses the readers of `io` and `scene`; the program, the C interface and tests use it.

mod data;
mod document;
mod gaussians;
mod kernels;
mod load;
mod mesh;
mod mode;
mod points;
mod schema;
mod surfaces;
mod technique;
mod transfer;
mod volume;

pub(crate) use document::Document;

pub use crate::scene::presets::{PRESETS, Preset};
pub use load::{LoadedScene, SceneFile};
pub use technique::TechniqueChoice;
