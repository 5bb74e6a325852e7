//! Counts of what a frame samples: the device adds samples and fetches of all rays (`glsl/frame/counts.glsl`).

use std::sync::Arc;

use crate::error::Result;
use crate::frame::prepared::Outcome;
use crate::gpu::shader::{COUNTS_FETCHES, COUNTS_SAMPLES, COUNTS_WORDS};
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::num;
use crate::primitives::dispatch::{buffer, download, words};

/// The sums that shaders add to, and where the host reads them.
#[derive(Debug)]
pub(crate) struct Counts {
    pub(crate) sums: Arc<Buffer>,
    read: Arc<Read>,
}

#[derive(Debug)]
struct Read(Arc<Buffer>);

impl Counts {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self> {
        let sums = buffer(gpu, "counts", u64::from(COUNTS_WORDS))?;
        let read = Arc::new(Read(download(gpu, "counts.read", sums.size())?));
        Ok(Self { sums, read })
    }

    /// Records what comes before the first pass that counts.
    pub(crate) fn record_begin(&self, recorder: &mut Recorder<'_>) {
        recorder.clear_buffer("counts.clear", &self.sums);
    }

    /// Records what comes after the last.
    pub(crate) fn record_end(&self, recorder: &mut Recorder<'_>) {
        recorder.copy_buffer("counts.read", &self.sums, &self.read.0, self.sums.size());
        recorder.release_to_host(&self.read.0);
    }

    pub(crate) fn outcome(&self) -> Arc<dyn Outcome> {
        Arc::clone(&self.read) as _
    }
}

impl Outcome for Read {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let words = words(&self.0.host_copy()?);
        let sum = |lower: u32| {
            let at = |word: u32| words.get(num::index(word)).copied().map_or(0, u64::from);
            at(lower) | at(lower + 1) << 32
        };
        Ok((true, vec![("samples", sum(COUNTS_SAMPLES)), ("fetches", sum(COUNTS_FETCHES))]))
    }
}
