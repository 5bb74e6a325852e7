//! Passes of the raster routes of `havs` that draw flagged pixels again, from lists of their faces.

use crate::error::Result;
use crate::frame::lists::Lists;
use crate::gpu::Recorder;
use crate::interface::MeshPush;
use crate::primitives::dispatch::{Dispatch, groups_of, pass};
use crate::technique::mesh::flagged::FlaggedFrame;
use crate::technique::mesh::frame::REPAIR_K;
use crate::technique::mesh::list_inputs::ListInputs;
use crate::technique::mesh::outcome::MeshOutcome;

/// The passes that list the fragments of flagged pixels and draw them.
#[derive(Debug)]
pub(crate) struct Repairs {
    pub(crate) lists: Lists,
    pass: Dispatch,
    pub(crate) rounds: u32,
}

impl Repairs {
    /// Builds the pass that sorts and resolves `lists`.
    pub(crate) fn new(frame: &FlaggedFrame<'_>, lists: Lists, rounds: u32) -> Result<Self> {
        let FlaggedFrame { scene, desc, drawn, .. } = *frame;
        let inputs = ListInputs {
            cursors: &lists.cursors,
            lists: &lists.entries,
            k: REPAIR_K,
            repair: true,
            ..drawn.clone()
        };
        let pass = pass(scene.gpu(), &format!("{}.repair", desc.name), &(desc.resolve)(&inputs))?;
        Ok(Self { lists, pass, rounds })
    }

    /// Records bins, lists and repair rounds, band by band.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        push: &MeshPush,
        count: u32,
        outcome: &MeshOutcome,
    ) {
        let lists = &self.lists;
        lists.bin(recorder, push, count);
        recorder.copy_buffer("bins.total", lists.bins.total(), &outcome.bins, 8);
        recorder.release_to_host(&outcome.bins);
        for (i, band) in lists.bands.iter().enumerate() {
            recorder.clear_buffer("lists.clear", &lists.cursors);
            lists.list(recorder, push, i, false);
            if let (Some(scan), Some(host)) = (lists.list_scans.get(i), outcome.lists.get(i)) {
                scan.record(recorder);
                recorder.copy_buffer("lists.total", scan.total(), host, 8);
                recorder.release_to_host(host);
            }
            lists.list(recorder, push, i, true);
            for round in 1..=self.rounds {
                let push = MeshPush {
                    count: band.tiles,
                    band: band.first,
                    capacity: lists.list_capacity,
                    number: u32::MAX / 2,
                    last_round: u32::from(round == self.rounds),
                    ..*push
                };
                self.pass.record(recorder, &push, groups_of(band.tiles, 1));
            }
        }
    }
}
