//! Writers: grids as NRRD, meshes and points as VTU, text.
//!
//! They use scene data and `replace`; the program uses them, to convert files and to write reports.

pub(crate) mod nrrd;
pub(crate) mod text;
pub(crate) mod vtu;
