//! Public behaviour on a real device under validation. The tests share devices and their pipelines.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::too_many_lines,
    unreachable_pub,
    missing_debug_implementations,
    reason = "a test fails by panicking"
)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/folder.rs"]
mod folder;

mod accumulation;
mod bounds;
mod changes;
mod choice;
mod counts;
mod extremes;
mod gaussians;
mod grids;
mod hardware;
mod havs_routes;
mod hit_depths;
mod layers;
mod meshes;
mod off_centre;
mod orientation;
mod pages;
mod prefilter;
mod projected_tets;
mod ranks;
mod record;
mod resolution;
mod shear_warp;
mod slices_3d;
mod splat_parts;
mod splats;
mod stacks;
mod steps;
mod threads;
mod tolerance;
mod trained_scenes;
mod validation;
