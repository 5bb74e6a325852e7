//! The result of a frame from lists: whether it is complete, and its counters.

use std::sync::{Arc, PoisonError};

use crate::error::{Error, Result};
use crate::frame::lists::Lists;
use crate::frame::prepared::Outcome;
use crate::gpu::shader::{
    STATUS_CUT, STATUS_FILLED, STATUS_LONGEST_BIN, STATUS_LOST, STATUS_NAN_KEYS, STATUS_OVERFLOW_PIXELS,
    STATUS_OVERLAPS, STATUS_UNREPAIRED,
};
use crate::gpu::{Buffer, Gpu};
use crate::num;
use crate::primitives::dispatch::{download, total, words};
use crate::resident::mesh::{MeshData, Needs};
use crate::technique::mesh::desc::MeshDesc;

/// Buffers that a frame copies its status and totals to, with the capacities that it had.
#[derive(Debug)]
pub(crate) struct MeshOutcome {
    data: Arc<MeshData>,
    pub(crate) status: Arc<Buffer>,
    /// Entries of all bins.
    pub(crate) bins: Arc<Buffer>,
    /// Entries of the lists of each band.
    pub(crate) lists: Vec<Arc<Buffer>>,
    capacities: Needs,
    primitives: u32,
    /// Whether pixels in which cells overlap must be drawn again.
    repairs_overlaps: bool,
    /// Name of the counter of pixels that were resolved out of order.
    unsorted: &'static str,
    /// Status of the passes that draw overlaps again, if there are any.
    pub(crate) overlaps: Option<Arc<Buffer>>,
}

impl MeshOutcome {
    /// Allocates the buffers of the totals; `capacities` are those of `lists`.
    pub(crate) fn new(
        gpu: &Gpu,
        data: &Arc<MeshData>,
        desc: &MeshDesc,
        status: Arc<Buffer>,
        lists: &Lists,
        capacities: Needs,
        primitives: u32,
    ) -> Result<Self> {
        Ok(Self {
            data: Arc::clone(data),
            status,
            bins: download(gpu, "bins.total", 8)?,
            lists: lists.bands.iter().map(|_| download(gpu, "lists.total", 8)).collect::<Result<_>>()?,
            capacities,
            primitives,
            repairs_overlaps: desc.repairs_overlaps(),
            unsorted: desc.unsorted,
            overlaps: None,
        })
    }
}

impl Outcome for MeshOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let status = words(&self.status.host_copy()?);
        let at = |word: u32| status.get(num::index(word)).copied().unwrap_or(0);
        check_loops(at(STATUS_CUT))?;
        let bins = total(&self.bins)?;
        let mut fullest = 0;
        let mut fragments = 0;
        for list in &self.lists {
            let band = total(list)?;
            fragments += band;
            fullest = band.max(fullest);
        }
        let fits = bins <= u64::from(self.capacities.bins)
            && fullest <= u64::from(self.capacities.lists)
            && at(STATUS_LONGEST_BIN) <= self.capacities.longest_bin
            && at(STATUS_LOST) == 0;
        if fits {
            check_filled(fragments, at(STATUS_FILLED))?;
        }
        let mut needs = self.data.needs.lock().unwrap_or_else(PoisonError::into_inner);
        let sorted = at(STATUS_UNREPAIRED) == 0;
        let overlaps = match &self.overlaps {
            Some(status) => overlaps_complete(status, &mut needs)?,
            None => at(STATUS_OVERLAPS) == 0 || !self.repairs_overlaps,
        };
        if self.overlaps.is_none() && !overlaps {
            needs.overlaps = true;
        }
        let complete = fits && sorted && overlaps;
        needs.bins = needs.bins.max(u32::try_from(bins).unwrap_or(u32::MAX));
        needs.lists = needs.lists.max(u32::try_from(fullest).unwrap_or(u32::MAX));
        needs.longest_bin = needs.longest_bin.max(at(STATUS_LONGEST_BIN));
        if fits && !sorted {
            needs.rounds = (self.capacities.rounds * 2).max(1);
        }
        let counters = vec![
            ("primitives", u64::from(self.primitives)),
            ("bin_entries", bins),
            ("fragments", fragments),
            (self.unsorted, u64::from(at(STATUS_OVERFLOW_PIXELS))),
            ("overlap_pixels", u64::from(at(STATUS_OVERLAPS))),
            ("nan_keys", u64::from(at(STATUS_NAN_KEYS))),
        ];
        Ok((complete, counters))
    }
}

/// Returns whether all overlaps were drawn again; raises `needs` to the capacities that were missing.
fn overlaps_complete(status: &Buffer, needs: &mut Needs) -> Result<bool> {
    let status = words(&status.host_copy()?);
    let at = |word: u32| status.get(num::index(word)).copied().unwrap_or(0);
    needs.longest_bin = needs.longest_bin.max(at(STATUS_LONGEST_BIN));
    check_loops(at(STATUS_CUT))?;
    if at(STATUS_UNREPAIRED) > 0 {
        needs.rounds = (needs.rounds * 2).max(2);
    }
    Ok(at(STATUS_LOST) == 0 && at(STATUS_UNREPAIRED) == 0)
}

/// Refuses a frame of which one pass counts other fragments than the other writes: then lists begin where others have not ended.
///
/// # Errors
///
/// [`Error::Unsupported`] with both numbers, the written one modulo 2^32.
fn check_filled(counted: u64, filled: u32) -> Result<()> {
    if counted & u64::from(u32::MAX) == u64::from(filled) {
        return Ok(());
    }
    let why = format!(
        "the same arithmetic in two passes: one counts {counted} fragments, the other writes {filled} (modulo 2^32)"
    );
    Err(Error::unsupported("this view of the mesh", why))
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
            "{pixels} pixels need more loop iterations than it makes; havs with chunk=5000 makes fewer in one dispatch"
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_that_disagree_are_refused() {
        assert!(check_filled(7, 7).is_ok() && check_filled((1 << 32) + 7, 7).is_ok());
        let why = check_filled(7, 8).unwrap_err().to_string();
        assert!(why.contains("counts 7") && why.contains("writes 8"), "{why}");
    }
}
