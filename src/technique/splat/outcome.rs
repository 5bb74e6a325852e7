//! The result of a frame of splats: whether it is complete, and its counters.

use std::sync::{Arc, PoisonError};

use crate::error::{Error, Result};
use crate::frame::prepared::Outcome;
use crate::gpu::Buffer;
use crate::gpu::shader::{
    PIXELS_COUNT, PIXELS_FIRST, STATUS_CUT, STATUS_LOST, STATUS_UNFINISHED, STATUS_WORDS,
};
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
        })
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
        Ok((fits && finished, counters))
    }
}
