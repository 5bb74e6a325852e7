//! Readers and writers of files: volumes, meshes, points, surfaces, scene files and images.
//!
//! [`read`] finds the format by content, else by file name, and returns scene data with a [`Report`].
//! Rooms, each may use those before it: `file` (open files, text, samples), `build` (from arrays to scene data),
//! `formats` (one reader per format), then the registry and `read_data`; `write`, `image`; `scene_file`.
//! The module uses `scene`, `image`, `num`, `error` and `replace`; the program, the C interface and tests use it.
//!
//! Every size is checked against the file and the memory limit before memory is allocated. Compressed streams are read
//! at most one byte past the announced size. Missing or excess data is an error.

mod build;
mod file;
mod formats;
mod image;
mod options;
mod read_data;
mod reader;
mod registry;
mod report;
pub mod scene_file;
mod write;

pub use crate::scene::Data;
pub use build::arrays::{ArrayInfo, Association};
pub use build::data_file::DataFile;
pub use build::file_names::{Numbered, in_order};
pub use file::sample_type::{Endian, SampleType};
pub use formats::fan::Triangles;
pub use formats::raw::layout::RawLayout;
pub use formats::raw::read_raw;
pub use formats::triangles::{read_triangles, read_triangles_memory};
pub use image::{encode_png, read_exr, to_srgb8, write_exr, write_image, write_png};
pub use options::{Progress, ReadOptions};
pub use read_data::{read, read_arrays, read_arrays_memory, read_grid, read_memory};
pub use registry::known_formats;
pub use report::{GaussiansReport, Loaded, Report, Step};
pub use write::gaussian::{GaussiansOutput, write_gaussians};
pub use write::nrrd::write_nrrd;
pub use write::vtk::write_vtu;
pub use write::{OutputFormat, check_writable, write_arrays, write_text};
