//! Techniques for tetrahedral meshes: `havs`, `abuffer` and `projected-tets`.
//!
//! They share the ranking of primitives, the walk of each pixel through its tile (`frame`), lists of flagged pixels (`frame/lists`) and the
//! passes that shade segments. This module uses `frame`, `resident`, `primitives` and `gpu`; the registry of techniques uses it.

pub mod abuffer;
mod cell_lists;
mod desc;
mod flagged;
mod frame;
pub mod havs;
mod list_inputs;
pub mod options;
mod order;
mod outcome;
mod overlaps;
mod parts;
pub mod projected_tets;
mod repairs;
mod shading;
mod tile_draw;
