//! One reader per file format.
//!
//! A format with children keeps its `Reader` in the file of its name. Formats use `file` and `build`; the registry,
//! `folder` and `scene_file` use them.

pub(crate) mod csv;
pub(crate) mod dicom;
pub(crate) mod fan;
pub(crate) mod gaussian;
pub(crate) mod gmsh;
pub(crate) mod jpeg;
pub(crate) mod metaimage;
pub(crate) mod nifti;
pub(crate) mod npy;
pub(crate) mod nrrd;
pub(crate) mod obj;
pub(crate) mod ply;
pub(crate) mod raw;
pub(crate) mod refused;
pub(crate) mod series;
pub(crate) mod tiff;
pub(crate) mod triangles;
pub(crate) mod vtk_legacy;
pub(crate) mod vtk_xml;
#[cfg(feature = "zarr")]
pub(crate) mod zarr;
