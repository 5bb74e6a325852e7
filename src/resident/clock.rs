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

/// Work in progress: its time counts when this is dropped.
#[derive(Debug)]
pub(crate) struct Running<'a> {
    clock: &'a Clock,
    start: Instant,
    tables: bool,
}

impl Clock {
    /// Returns the times so far.
    pub(crate) fn times(&self) -> UploadTimes {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins an upload.
    pub(crate) fn upload(&self) -> Running<'_> {
        Running { clock: self, start: Instant::now(), tables: false }
    }

    /// Begins a table.
    pub(crate) fn tables(&self) -> Running<'_> {
        Running { clock: self, start: Instant::now(), tables: true }
    }
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        let mut times = self.clock.0.lock().unwrap_or_else(PoisonError::into_inner);
        let sum = if self.tables { &mut times.tables } else { &mut times.upload };
        *sum += self.start.elapsed().as_secs_f64() * 1e3;
    }
}
