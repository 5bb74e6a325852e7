//! Options of readers: memory limit, array selection, progress.

use std::fmt;
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::scene::{Axes, Data, StoredAxes};

/// A callback that receives the progress of reading: bytes read so far and in total, of the file as stored. A
/// two-pass read reports each pass.
#[derive(Clone)]
pub struct Progress(Arc<dyn Fn(u64, u64) + Send + Sync>);

impl Progress {
    /// Wraps the function that is called with bytes read and bytes in total.
    pub fn new(function: impl Fn(u64, u64) + Send + Sync + 'static) -> Self {
        Self(Arc::new(function))
    }

    pub(crate) fn call(&self, done: u64, all: u64) {
        (self.0)(done, all);
    }
}

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("Progress")
    }
}

/// Options of a reader: its memory limit, and the arrays that it reads.
///
/// Arrays are selected by `NAME`, `NAME:PART`, `point:NAME` or `cell:NAME:PART`. If the text is also a complete array
/// name, that array is meant. `PART` is a component, as a number from 0 or a letter of `x y z w` or `r g b a`, or
/// `magnitude`. Without `PART`, an array of several components is read as its magnitude.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// The limit, in bytes, on the memory of one data set, or of the pixels of one image. The memory for cutting
    /// cells and for resampling counts too.
    pub max_bytes: u64,
    /// The size, in bytes, from which on the samples of a grid that are uncompressed, or in chunks of OME-Zarr, stay in their file and are read when they are needed
    /// ([`Samples::OnDemand`](crate::scene::Samples::OnDemand)); [`Self::max_bytes`] does not count them. The default is none.
    pub on_demand: Option<u64>,
    /// The array to show. The default is the file's active array, else the first with one component, point data
    /// before cell data, else the first. Arrays of identifiers and flags (`id`, `vtkGhostType`, ...) come last.
    pub array: Option<String>,
    /// For points: the array of support radii.
    pub radius: Option<String>,
    /// For points: the array of covariances, with 6 components (xx, xy, xz, yy, yz, zz) or 9.
    pub covariance: Option<String>,
    /// For points: the array of weights.
    pub weight: Option<String>,
    /// For Gaussian splats: the axes that the file's data are in, whatever it says.
    pub axes: Option<StoredAxes>,
    /// For Gaussian splats: the axes to turn them to; the default is none.
    pub turn_to: Option<Axes>,
    /// The step to read of a time series, counted from 0; the default is the first. Other files have no steps.
    pub step: Option<u32>,
    /// The callback for progress.
    pub progress: Option<Progress>,
}

impl ReadOptions {
    /// Returns the defaults with this memory limit in bytes.
    #[must_use]
    pub const fn within(max_bytes: u64) -> Self {
        Self {
            max_bytes,
            on_demand: None,
            array: None,
            radius: None,
            covariance: None,
            weight: None,
            axes: None,
            turn_to: None,
            step: None,
            progress: None,
        }
    }

    /// Returns the first option that selects arrays, by its name.
    pub(crate) fn selected(&self) -> Option<(&'static str, &str)> {
        let all = [
            ("array", &self.array),
            ("radius", &self.radius),
            ("covariance", &self.covariance),
            ("weight", &self.weight),
        ];
        all.into_iter().find_map(|(name, array)| Some((name, array.as_deref()?)))
    }

    /// Refuses axes for data that is not turned.
    pub(crate) fn check_axes(&self, path: &Path, data: &Data) -> Result<()> {
        match data {
            Data::Gaussians(_) => Ok(()),
            _ if self.axes.is_none() && self.turn_to.is_none() => Ok(()),
            other => {
                let why = format!("only gaussians have axes to name, not a {}", other.kind());
                Err(Error::file(path, "axes", why))
            }
        }
    }

    /// Refuses kernel sizes and weights for data without kernels.
    pub(crate) fn check_kernels(&self, what: &str) -> Result<()> {
        let wanted = [("radius", &self.radius), ("covariance", &self.covariance), ("weight", &self.weight)];
        match wanted.into_iter().find_map(|(name, array)| Some((name, array.as_ref()?))) {
            Some((name, array)) => {
                Err(Error::invalid(format!("array \"{array}\""), format!("{what} has no {name}")))
            }
            None => Ok(()),
        }
    }
}

/// Selects what is read of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// Scene data.
    Scene,
    /// The array that the options name, or all arrays, as they are in the file.
    Arrays,
    /// The array that the options name, or the only one, as it is in the file.
    OneArray,
}

/// Options of a reader, with what it reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Request<'a> {
    pub(crate) options: &'a ReadOptions,
    pub(crate) wanted: Wanted,
}

impl<'a> Request<'a> {
    /// Requests scene data.
    pub(crate) fn scene(options: &'a ReadOptions) -> Self {
        Self { options, wanted: Wanted::Scene }
    }
}

impl Deref for Request<'_> {
    type Target = ReadOptions;

    fn deref(&self) -> &ReadOptions {
        self.options
    }
}

impl Default for ReadOptions {
    /// Returns no selected array and a memory limit of 16 GiB.
    fn default() -> Self {
        Self::within(16 << 30)
    }
}
