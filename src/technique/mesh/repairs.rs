//! Passes that draw flagged pixels again, from lists of their faces or cells.

use crate::error::Result;
use crate::frame::lists::{Band, Lists, tiles_across};
use crate::gpu::Recorder;
use crate::interface::MeshPush;
use crate::primitives::dispatch::{Dispatch, groups_of, pass};
use crate::technique::mesh::flagged::FlaggedFrame;
use crate::technique::mesh::list_inputs::{ListInputs, ListShader, REPAIR_K};
use crate::technique::mesh::outcome::MeshOutcome;

/// The passes that list the fragments of flagged pixels and draw them.
#[derive(Debug)]
pub(crate) struct Repairs {
    pub(crate) lists: Lists,
    pass: Dispatch,
    rounds: u32,
}

impl Repairs {
    /// Builds the pass that sorts and resolves `lists`.
    pub(crate) fn new(
        frame: &FlaggedFrame<'_>,
        shader: ListShader,
        lists: Lists,
        rounds: u32,
    ) -> Result<Self> {
        let FlaggedFrame { scene, desc, drawn, .. } = *frame;
        let inputs =
            ListInputs { cursors: &lists.cursors, lists: &lists.entries, k: REPAIR_K, ..drawn.clone() };
        let pass = pass(scene.gpu(), &format!("{}.repair", desc.name), &shader(&inputs))?;
        Ok(Self { lists, pass, rounds })
    }

    /// Records the lists of a band, from its bins, and the repair rounds.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        push: &MeshPush,
        band: usize,
        outcome: &MeshOutcome,
    ) {
        let lists = &self.lists;
        let Some(&Band { first, tiles }) = lists.bands.get(band) else { return };
        let push = MeshPush { binned: first, ..*push };
        recorder.clear_buffer("lists.clear", &lists.cursors);
        lists.list(recorder, &push, band, false);
        if let (Some(scan), Some(host)) = (lists.list_scans.get(band), outcome.lists.get(band)) {
            scan.record(recorder);
            recorder.copy_buffer("lists.total", scan.total(), host, 8);
            recorder.release_to_host(host);
        }
        lists.list(recorder, &push, band, true);
        for round in 1..=self.rounds {
            let push = MeshPush {
                count: tiles,
                band: first,
                capacity: lists.list_capacity,
                last_round: u32::from(round == self.rounds),
                ..push
            };
            self.pass.record(recorder, &push, groups_of(tiles, 1));
        }
    }

    /// Records the bins of a band, and the copy of their total.
    pub(crate) fn bin(
        &self,
        recorder: &mut Recorder<'_>,
        push: &MeshPush,
        band: usize,
        outcome: &MeshOutcome,
    ) {
        let (bins, Some(&Band { first, tiles })) = (&self.lists.bins, self.lists.bands.get(band)) else {
            return;
        };
        bins.record(recorder, tiles_across(push), [first, tiles]);
        if let Some(host) = outcome.bins.get(band) {
            recorder.copy_buffer("bins.total", bins.total(), host, 8);
            recorder.release_to_host(host);
        }
    }
}
