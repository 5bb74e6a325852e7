//! The result of a frame of splats: whether it is complete, and its counters.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::{Error, Result};
use crate::frame::prepared::Outcome;
use crate::gpu::shader::{
    PIXELS_COUNT, PIXELS_FIRST, STATUS_CUT, STATUS_LOST, STATUS_UNFINISHED, STATUS_WORDS,
};
use crate::gpu::{Buffer, Recorder};
use crate::num;
use crate::primitives::dispatch::{download, total, words};
use crate::resident::GpuScene;

/// Buffers that a frame copies its status and totals to, with the capacities that it had.
#[derive(Debug)]
pub(crate) struct SplatOutcome {
    pub(crate) scene: Arc<GpuScene>,
    pub(crate) name: &'static str,
    pub(crate) status: Arc<Buffer>,
    /// Entries of the bins of each band.
    pub(crate) bins: Vec<Arc<Buffer>>,
    /// Heads of the lists of pixels that are drawn again, of each band.
    pub(crate) repaired: Vec<Arc<Buffer>>,
    /// Entries that the bins of a band may have.
    pub(crate) capacity: u32,
    /// Dispatches for each band.
    pub(crate) rounds: u32,
    pub(crate) splats: u32,
    progress: Mutex<Progress>,
}

/// How far a frame in parts has come.
#[derive(Clone, Copy, Debug)]
struct Progress {
    /// The part of the last recording, and the number of parts.
    at: usize,
    count: usize,
    /// The part after it, once it has ended; none where a frame with more room has to begin anew, and after a change of the view.
    next: Option<usize>,
}

impl SplatOutcome {
    /// Makes the buffers of a frame: of `bands`, with the capacity of bins, the dispatches of a band and the number of splats.
    pub(super) fn new(
        scene: &Arc<GpuScene>,
        name: &'static str,
        bands: usize,
        [capacity, rounds, splats]: [u32; 3],
        repairs: bool,
    ) -> Result<Self> {
        let gpu = scene.gpu();
        let host = |name: &str, words: u32, wanted: bool| -> Result<Vec<_>> {
            let bands = if wanted { bands } else { 0 };
            (0..bands).map(|_| download(gpu, name, 4 * u64::from(words))).collect()
        };
        Ok(Self {
            scene: Arc::clone(scene),
            name,
            status: download(gpu, "status", 4 * u64::from(STATUS_WORDS))?,
            bins: host("bins.total", 2, true)?,
            repaired: host("pixels.count", PIXELS_FIRST, repairs)?,
            capacity,
            rounds,
            splats,
            progress: Mutex::new(Progress { at: 0, count: 1, next: None }),
        })
    }

    /// Notes that the recording is one of a part, of so many.
    pub(super) fn begin(&self, at: usize, count: usize) {
        *self.progress() = Progress { at, count, next: None };
    }

    /// Returns the part of the next recording, once.
    pub(super) fn take_next(&self) -> Option<usize> {
        self.progress().next.take()
    }

    fn progress(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records what clears the counts of a frame before its first part.
    pub(super) fn record_begin(&self, recorder: &mut Recorder<'_>) {
        for counts in self.bins.iter().chain(&self.repaired) {
            recorder.clear_buffer("counts.clear", counts);
            recorder.release_to_host(counts);
        }
    }

    /// Records the copy of the status.
    pub(super) fn record_status(&self, recorder: &mut Recorder<'_>, status: &Arc<Buffer>) {
        recorder.copy_buffer("status", status, &self.status, self.status.size());
        recorder.release_to_host(&self.status);
    }
}

impl Outcome for SplatOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let status = words(&self.status.host_copy()?);
        let at = |word: u32| status.get(num::index(word)).copied().unwrap_or(0);
        if at(STATUS_CUT) > 0 {
            return Err(Error::unsupported(
                format!("{} of this view", self.name),
                format!(
                    "{} invocations need more loop iterations than devices make: thinner slabs, smaller kernels or a larger image need fewer in one dispatch",
                    at(STATUS_CUT)
                ),
            ));
        }
        let (mut pairs, mut fullest) = (0, 0);
        for bins in &self.bins {
            let band = total(bins)?;
            pairs += band;
            fullest = band.max(fullest);
        }
        let mut counters = vec![("splats", self.splats.into()), ("pairs", pairs)];
        if !self.repaired.is_empty() {
            let counts = self.repaired.iter().map(|head| {
                let head = words(&head.host_copy()?);
                Ok(head.get(num::index(PIXELS_COUNT)).map_or(0, |&count| u64::from(count)))
            });
            counters.push(("repaired_pixels", counts.sum::<Result<_>>()?));
        }
        let fits = fullest <= u64::from(self.capacity) && at(STATUS_LOST) == 0;
        let finished = at(STATUS_UNFINISHED) == 0;
        let mut needs = self.scene.splat_needs.lock().unwrap_or_else(PoisonError::into_inner);
        needs.entries = needs.entries.max(u32::try_from(fullest).unwrap_or(u32::MAX));
        if fits && !finished {
            needs.rounds = self.rounds * 2;
        }
        let mut progress = self.progress();
        let next = Some(progress.at + 1).filter(|&next| next < progress.count);
        progress.next = next.filter(|_| fits && finished);
        Ok((fits && finished && next.is_none(), counters))
    }
}
