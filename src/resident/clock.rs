//! The time that uploads and tables of a scene have taken.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Milliseconds that the uploads of a scene have taken so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct UploadTimes {
    /// Uploads of samples, meshes and kernels, and the ranges of bricks.
    pub upload: f64,
    /// Tables of the transfer function, and the search for visible bricks.
    pub tables: f64,
}

/// Adds up the times of one scene.
#[derive(Debug, Default)]
pub(crate) struct Clock(Mutex<UploadTimes>);

impl Clock {
    /// Returns the times so far.
    pub(crate) fn times(&self) -> UploadTimes {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does the work of an upload.
    pub(crate) fn upload<T>(&self, work: impl FnOnce() -> T) -> T {
        self.measure(work, |times| &mut times.upload)
    }

    /// Does the work of a table.
    pub(crate) fn tables<T>(&self, work: impl FnOnce() -> T) -> T {
        self.measure(work, |times| &mut times.tables)
    }

    fn measure<T>(&self, work: impl FnOnce() -> T, sum: fn(&mut UploadTimes) -> &mut f64) -> T {
        let start = Instant::now();
        let result = work();
        let mut times = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *sum(&mut times) += start.elapsed().as_secs_f64() * 1e3;
        result
    }
}
