//! From the arrays of a file to scene data, which are grids, meshes and points, or to arrays in the types of the file.
//!
//! Formats describe points, cells and arrays; these modules choose the array to show, read it and build the result.
//! They use `file` and `scene`; `formats` use them.

pub(crate) mod arrays;
pub(crate) mod columns;
pub(crate) mod data_file;
pub(crate) mod dataset;
pub(crate) mod file_names;
mod from_scene;
pub(crate) mod gaussians;
pub(crate) mod lattice;
pub(crate) mod mesh;
pub(crate) mod origin;
pub(crate) mod points;
pub(crate) mod resample;
pub(crate) mod volume;
