//! Writers of data: VTK XML, NRRD, NIfTI-1, formats of Gaussian splats; and of text.
//!
//! They use `build` and `replace`; the program uses them, to convert files and to write reports.

pub(crate) mod gaussian;
mod nifti;
pub(crate) mod nrrd;
pub(crate) mod vtk;

use std::io::Write as _;
use std::path::Path;

use crate::error::{Error, Result};
use crate::io::build::data_file::{DataFile, Lattice, Shape};
use crate::replace::{self, replace};

/// A format that data is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OutputFormat {
    /// VTK's image data: all arrays of a grid.
    Vti,
    /// VTK's rectilinear grids: all arrays of a grid whose axes list coordinates.
    Vtr,
    /// VTK's unstructured grids: all arrays of a mesh or of points.
    Vtu,
    /// One array of a grid.
    Nrrd,
    /// One array of a grid, with one number for each voxel.
    Nifti {
        /// Whether the file is a gzip stream.
        packed: bool,
    },
    /// Gaussian splats as float32.
    GaussianPly,
    /// Gaussian splats in chunks of 256, in words of 32 bits.
    CompressedPly,
    /// Gaussian splats, quantised and packed.
    Spz,
}

impl OutputFormat {
    /// Returns the format that a file name asks for.
    ///
    /// # Errors
    ///
    /// [`Error::File`] with the known endings, for any other.
    pub fn of(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        let known = [
            (".vti", Self::Vti),
            (".vtr", Self::Vtr),
            (".vtu", Self::Vtu),
            (".nrrd", Self::Nrrd),
            (".nii", Self::Nifti { packed: false }),
            (".nii.gz", Self::Nifti { packed: true }),
            (".compressed.ply", Self::CompressedPly),
            (".ply", Self::GaussianPly),
            (".spz", Self::Spz),
        ];
        let found = known.into_iter().find(|(ending, _)| name.ends_with(ending));
        found.map(|(_, format)| format).ok_or_else(|| {
            let rule = "must end in .vti, .nrrd, .nii or .nii.gz (grids), .vtr (uneven grids), .vtu (meshes and points), or .ply, \
                        .compressed.ply or .spz (gaussians)";
            Error::file(path, "file name", rule)
        })
    }

    /// Whether a file holds Gaussian splats.
    #[must_use]
    pub fn holds_gaussians(self) -> bool {
        matches!(self, Self::GaussianPly | Self::CompressedPly | Self::Spz)
    }

    /// Whether a file holds one array only.
    #[must_use]
    pub fn holds_one_array(self) -> bool {
        matches!(self, Self::Nrrd | Self::Nifti { .. })
    }
}

/// Writes data in the format of the file name. Arrays keep their types and numbers. Returns notes on what the format
/// cannot hold as it is.
///
/// # Errors
///
/// [`Error::File`] if the format does not hold such data, or if the file must not be replaced; [`Error::Io`] if it cannot
/// be written. No partial file remains.
pub fn write_arrays(path: impl AsRef<Path>, data: DataFile) -> Result<Vec<String>> {
    let path = path.as_ref();
    let format = OutputFormat::of(path)?;
    let (holds, endings) = match &data.shape {
        Shape::Even(Lattice { listed: None, .. }) => {
            (format == OutputFormat::Vti || format.holds_one_array(), GRIDS)
        }
        Shape::Even(_) => (format != OutputFormat::Vtu && !format.holds_gaussians(), GRIDS),
        Shape::Uneven(_) => (format == OutputFormat::Vtr, ".vtr"),
        Shape::Cells(_) => (format == OutputFormat::Vtu, ".vtu"),
    };
    if !holds {
        return Err(Error::file(
            path,
            "file name",
            format!("must end in {endings}: the data is {}", data.shape.summary()),
        ));
    }
    match format {
        OutputFormat::Vti | OutputFormat::Vtr | OutputFormat::Vtu => {
            vtk::write(path, data, format == OutputFormat::Vtr)
        }
        OutputFormat::Nrrd => nrrd::write(path, data).map(|note| note.into_iter().collect()),
        OutputFormat::Nifti { packed } => nifti::write(path, data, packed),
        OutputFormat::GaussianPly | OutputFormat::CompressedPly | OutputFormat::Spz => {
            Err(Error::file(path, "file name", "is that of gaussians: the data are arrays"))
        }
    }
}

const GRIDS: &str = ".vti, .nrrd, .nii or .nii.gz";

/// Writes a text file completely or not at all.
///
/// # Errors
///
/// [`Error::File`] if the path must not be replaced, [`Error::Io`] if it cannot be written; no partial file remains.
pub fn write_text(path: impl AsRef<Path>, text: &str) -> Result<()> {
    replace(path.as_ref(), |writer| writer.write_all(text.as_bytes()))
}

/// Checks that a file of this path can be written, without writing it: programs ask before long work.
///
/// Regular files are written beside their place and renamed when they are complete; a symbolic link stays, and its target is replaced.
/// Pipes and character devices are written into.
///
/// # Errors
///
/// [`Error::File`] for a folder, a write-protected file, a block device and the like; [`Error::Io`] where no file can be made.
pub fn check_writable(path: impl AsRef<Path>) -> Result<()> {
    replace::check_writable(path.as_ref())
}
