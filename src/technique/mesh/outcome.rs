//! The result of a frame of a mesh: whether it is complete, and its counters.

use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::frame::lists::Ranking;
use crate::frame::prepared::Outcome;
use crate::gpu::shader::{
    STATUS_CUT, STATUS_FRAGMENTS, STATUS_FRAGMENTS_HIGH, STATUS_LONGEST_BIN, STATUS_LOST, STATUS_NAN_KEYS,
    STATUS_OVERFLOW_PIXELS, STATUS_OVERLAPS, STATUS_UNREPAIRED,
};
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::num;
use crate::primitives::dispatch::{download, total, words};
use crate::resident::mesh::Needs;
use crate::technique::mesh::desc::MeshDesc;

/// Buffers that a frame copies its status and totals to, with the capacities that it had.
#[derive(Debug)]
pub(crate) struct MeshOutcome {
    /// What frames have needed so far.
    known: Arc<Mutex<Needs>>,
    pub(crate) status: Arc<Buffer>,
    /// Entries of the bins of each band.
    pub(crate) bins: Vec<Arc<Buffer>>,
    /// Entries of the lists of each band.
    pub(crate) lists: Vec<Arc<Buffer>>,
    capacities: Needs,
    /// Whether a tile is drawn chunk by chunk, which its longest bin counts.
    chunked: bool,
    /// Whether a larger k-buffer comes before larger lists.
    deepens: bool,
    primitives: u32,
    /// Whether pixels in which cells overlap must be drawn again.
    repairs_overlaps: bool,
    /// Whether pixels walk through their tiles, which counts fragments.
    pub(crate) walks: bool,
    /// Name of the counter of pixels that were resolved out of order.
    unsorted: &'static str,
    /// Outcome of the passes that draw overlaps again, if there are any.
    pub(crate) overlaps: Option<Arc<Self>>,
}

impl MeshOutcome {
    /// Allocates the buffers of the totals: of `binned` bands whose primitives are binned and `listed` bands whose fragments are listed.
    pub(crate) fn new(
        gpu: &Gpu,
        known: &Arc<Mutex<Needs>>,
        desc: &MeshDesc,
        status: Arc<Buffer>,
        [binned, listed]: [usize; 2],
        capacities: Needs,
        primitives: u32,
    ) -> Result<Self> {
        Ok(Self {
            known: Arc::clone(known),
            status,
            bins: (0..binned).map(|_| download(gpu, "bins.total", 8)).collect::<Result<_>>()?,
            lists: (0..listed).map(|_| download(gpu, "lists.total", 8)).collect::<Result<_>>()?,
            capacities,
            chunked: desc.chunk.is_some(),
            deepens: desc.deepens,
            primitives,
            repairs_overlaps: desc.repairs_overlaps(),
            walks: false,
            unsorted: desc.unsorted,
            overlaps: None,
        })
    }
}

/// The report of a frame of a mesh that has ended.
#[derive(Debug)]
pub(crate) struct Read {
    /// Whether everything had room.
    pub(crate) fits: bool,
    /// Whether lists were sorted in as many rounds as there were.
    pub(crate) sorted: bool,
    /// Whether nothing is left of the pixels in which cells overlap.
    pub(crate) apart: bool,
    /// Pixels whose pairs came out of order, and those in which cells overlap.
    pub(crate) flagged: [u32; 2],
    pub(crate) counters: Vec<(&'static str, u64)>,
}

impl Outcome for MeshOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let Read { fits, sorted, apart, counters, .. } = self.read_all()?;
        Ok((fits && sorted && apart, counters))
    }
}

impl MeshOutcome {
    /// Records the copy of the status to the host.
    pub(crate) fn record_status(&self, recorder: &mut Recorder<'_>, name: &str, ranking: &Ranking) {
        recorder.copy_buffer(name, &ranking.status, &self.status, self.status.size());
        recorder.release_to_host(&self.status);
    }

    /// Reads the status and the totals, and notes what later frames need.
    pub(crate) fn read_all(&self) -> Result<Read> {
        let status = words(&self.status.host_copy()?);
        let at = |word: u32| status.get(num::index(word)).copied().unwrap_or(0);
        let totals =
            |buffers: &[Arc<Buffer>]| buffers.iter().map(|band| total(band)).collect::<Result<Vec<u64>>>();
        let (bins, lists) = (totals(&self.bins)?, totals(&self.lists)?);
        let fullest = |totals: &[u64]| totals.iter().copied().max().unwrap_or(0);
        let (fullest_bins, fullest, fragments) = (fullest(&bins), fullest(&lists), lists.iter().sum::<u64>());
        let fits = fullest_bins <= u64::from(self.capacities.bins)
            && fullest <= u64::from(self.capacities.lists)
            && (!self.chunked || at(STATUS_LONGEST_BIN) <= self.capacities.longest_bin)
            && at(STATUS_LOST) == 0;
        if fits {
            check_loops(at(STATUS_CUT))?;
        }
        let sorted = at(STATUS_UNREPAIRED) == 0;
        let apart = match &self.overlaps {
            Some(overlaps) => overlaps.read()?.0,
            None => at(STATUS_OVERLAPS) == 0 || !self.repairs_overlaps,
        };
        let mut needs = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if self.overlaps.is_none() && !apart {
            needs.overlaps = true;
        }
        needs.bins = needs.bins.max(u32::try_from(fullest_bins).unwrap_or(u32::MAX));
        if self.deepens && fullest > u64::from(self.capacities.lists) {
            needs.deep = true;
        } else {
            needs.lists = needs.lists.max(u32::try_from(fullest).unwrap_or(u32::MAX));
        }
        needs.longest_bin = needs.longest_bin.max(at(STATUS_LONGEST_BIN));
        // (Parts have one list for all their bands.)
        for (pairs, listed) in bins.iter().zip(&lists).filter(|_| bins.len() == lists.len()) {
            // Smaller bands, where the lists of one did not fit.
            if *listed > u64::from(self.capacities.lists) && !self.deepens {
                let ratio = u32::try_from(listed.div_ceil((*pairs).max(1))).unwrap_or(u32::MAX);
                needs.listed_per_pair = needs.listed_per_pair.max(ratio);
            }
        }
        if fits && !sorted {
            needs.rounds = (self.capacities.rounds * 2).max(1);
        }
        let mut counters = vec![
            ("primitives", u64::from(self.primitives)),
            ("bin_entries", bins.iter().sum()),
            ("repaired_fragments", fragments),
            (self.unsorted, u64::from(at(STATUS_OVERFLOW_PIXELS))),
            ("overlap_pixels", u64::from(at(STATUS_OVERLAPS))),
            ("nan_keys", u64::from(at(STATUS_NAN_KEYS))),
        ];
        if self.walks {
            let high = u64::from(at(STATUS_FRAGMENTS_HIGH)) << 32;
            counters.push(("fragments", high | u64::from(at(STATUS_FRAGMENTS))));
        }
        let flagged = [at(STATUS_OVERFLOW_PIXELS), at(STATUS_OVERLAPS)];
        Ok(Read { fits, sorted, apart, flagged, counters })
    }
}

/// Refuses a frame in which the driver ended loops early.
///
/// # Errors
///
/// [`Error::Unsupported`] with the number of pixels.
fn check_loops(pixels: u32) -> Result<()> {
    if pixels == 0 {
        return Ok(());
    }
    Err(Error::unsupported(
        "this view of the mesh",
        format!(
            "{pixels} pixels need more loop iterations than it makes; havs with chunk=500 makes fewer in one dispatch"
        ),
    ))
}
