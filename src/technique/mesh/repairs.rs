//! Passes that draw flagged pixels again, from lists of their faces or cells.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::lists::{Band, Hits, Lists, Ranking};
use crate::gpu::Recorder;
use crate::interface::MeshPush;
use crate::primitives::dispatch::{Dispatch, groups_of, pass};
use crate::resident::mesh::Needs;
use crate::technique::mesh::flagged::FlaggedFrame;
use crate::technique::mesh::list_inputs::{ListInputs, ListShader, REPAIR_K};
use crate::technique::mesh::outcome::MeshOutcome;

/// The passes that list the fragments of flagged pixels and draw them.
#[derive(Debug)]
pub(crate) struct Repairs {
    hits: Arc<Hits>,
    pub(crate) lists: Lists,
    pass: Dispatch,
    rounds: u32,
}

impl Repairs {
    /// Builds the passes that list the primitives that the pixels in `drawn.listed` meet, sort these lists and resolve them.
    pub(crate) fn new(
        frame: &FlaggedFrame<'_>,
        shader: ListShader,
        ranking: &Ranking,
        hits: Arc<Hits>,
        bands: Vec<Band>,
        needs: Needs,
    ) -> Result<Self> {
        let FlaggedFrame { scene, desc, drawn, .. } = *frame;
        let gpu = scene.gpu();
        let flagged = Some((drawn.flags, drawn.listed));
        let lists = Lists::new(gpu, ranking, &hits, bands, needs.lists, flagged)?;
        let inputs =
            ListInputs { cursors: &lists.cursors, lists: &lists.entries, k: REPAIR_K, ..drawn.clone() };
        let pass = pass(gpu, &format!("{}.repair", desc.name), &shader(&inputs))?;
        Ok(Self { hits, lists, pass, rounds: needs.rounds })
    }

    /// Records the lists of a band, from its hits, and the repair rounds.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        push: &MeshPush,
        band: usize,
        outcome: &MeshOutcome,
    ) {
        let Some(&tiles) = self.lists.bands.get(band) else { return };
        self.lists.record_count(recorder, push, tiles, false);
        self.lists.record_places(recorder, band, outcome.lists.get(band));
        self.lists.record_fill(recorder, push, tiles);
        self.record_rounds(recorder, push, tiles);
    }

    /// Records the rounds that sort the lists of a band and draw its pixels.
    pub(crate) fn record_rounds(&self, recorder: &mut Recorder<'_>, push: &MeshPush, band: Band) {
        for round in 1..=self.rounds {
            let last_round = u32::from(round == self.rounds);
            let push = MeshPush { last_round, ..self.lists.push(push, band) };
            self.pass.record(recorder, &push, groups_of(band.tiles, 1));
        }
    }

    /// Records the hits of each band, and its repair.
    pub(crate) fn record_all(&self, recorder: &mut Recorder<'_>, push: &MeshPush, outcome: &MeshOutcome) {
        for (i, band) in self.lists.bands.iter().enumerate() {
            self.hits.record(recorder, push, *band, outcome.bins.get(i));
            self.record(recorder, push, i, outcome);
        }
    }
}
