//! Options of readers: memory limit, array selection, progress.

use std::fmt;
use std::sync::Arc;

use crate::error::{Error, Result};

/// What is called while a file is read: bytes behind, and bytes in all, of the file as stored. A file that
/// is gone through twice is told of twice.
#[derive(Clone)]
pub struct Progress(Arc<dyn Fn(u64, u64) + Send + Sync>);

impl Progress {
    /// A function to call.
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

/// What a reader may take, and which of a file's arrays it shall read.
///
/// Arrays are named as `NAME`, `NAME:PART`, `point:NAME` or `cell:NAME:PART`: a file's own name wins over
/// a reading with prefix or part. `PART` is a component, from 0 or one of `x y z` or `r g b a`, or
/// `magnitude`; an array of several components without it is read as its magnitude.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// Most bytes of memory that what is read of one data set, or the pixels of one image, may occupy.
    /// Splitting cells of a mesh, and resampling, count.
    pub max_bytes: u64,
    /// The array to show. Left out: the file's active one, else the first with one component, point data
    /// before cell data, else the first. What numbers or flags things (`id`, `vtkGhostType`, ...) comes last.
    pub array: Option<String>,
    /// Of points: the array of support radii.
    pub radius: Option<String>,
    /// Of points: the array of covariances, of 6 components (xx, xy, xz, yy, yz, zz) or 9.
    pub covariance: Option<String>,
    /// Of points: the array of weights.
    pub weight: Option<String>,
    /// Whom to tell how far reading is.
    pub progress: Option<Progress>,
}

impl ReadOptions {
    /// The defaults, with another limit of memory.
    #[must_use]
    pub const fn within(max_bytes: u64) -> Self {
        Self { max_bytes, array: None, radius: None, covariance: None, weight: None, progress: None }
    }

    /// Refuses sizes and weights of kernels for data that has no kernels.
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

impl Default for ReadOptions {
    /// 16 GiB.
    fn default() -> Self {
        Self::within(16 << 30)
    }
}
