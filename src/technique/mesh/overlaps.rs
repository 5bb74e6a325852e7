//! Redraws those pixels of `havs` in which cells overlap, from lists of cells.
//!
//! Faces say where a ray enters and leaves cells, but not which scalar holds where the ray is in two cells at once.
//! `havs` flags such pixels; here they get lists of cells, whose entries need no neighbours (`abuffer.glsl`). The passes
//! are built once a frame has met an overlap.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::lists::{Hits, Measured, Ranking, measure};
use crate::gpu::Recorder;
use crate::gpu::shader::{FLAG_OVERLAPS, STATUS_WORDS};
use crate::interface::MeshPush;
use crate::primitives::dispatch::download;
use crate::resident::mesh::Primitives;
use crate::technique::mesh::cell_lists;
use crate::technique::mesh::flagged::FlaggedFrame;
use crate::technique::mesh::list_inputs::ListInputs;
use crate::technique::mesh::outcome::MeshOutcome;
use crate::technique::mesh::repairs::Repairs;

/// The passes after `havs` that draw overlaps.
#[derive(Debug)]
pub(crate) struct Overlaps {
    ranking: Ranking,
    repair: Repairs,
    outcome: Arc<MeshOutcome>,
}

impl Overlaps {
    /// Builds the passes; they draw into the image of the frame, where its flags say so.
    pub(crate) fn new(frame: &FlaggedFrame<'_>) -> Result<Self> {
        let FlaggedFrame { scene, data, push, tiles, across, drawn, .. } = *frame;
        let gpu = scene.gpu();
        let desc = frame.desc.of_overlaps();
        let ranking = desc.rank_primitives(scene, data, None)?;
        let known = data.needs(Primitives::Cells);
        let Measured { needs, bins, bands } = measure(gpu, &ranking, known, push, [tiles, across], true)?;
        let status = download(gpu, "overlaps.status", 4 * u64::from(STATUS_WORDS))?;
        let outcome = MeshOutcome::new(gpu, known, &desc, status, [bands.len(); 2], needs, ranking.count)?;
        let hits = Hits::new(gpu, &ranking, bins, Some((drawn.flags, FLAG_OVERLAPS)))?;
        let drawn = ListInputs { status: &ranking.status, listed: FLAG_OVERLAPS, ..drawn.clone() };
        let frame = FlaggedFrame { desc: &desc, drawn: &drawn, ..*frame };
        let repair = Repairs::new(&frame, cell_lists::repair, &ranking, hits, bands, needs)?;
        Ok(Self { ranking, repair, outcome: Arc::new(outcome) })
    }

    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        self.ranking.record(recorder, push);
        self.repair.record_all(recorder, push, &self.outcome);
        self.outcome.record_status(recorder, "overlaps.status", &self.ranking);
    }

    /// Returns the outcome of these passes.
    pub(crate) fn outcome(&self) -> Arc<MeshOutcome> {
        Arc::clone(&self.outcome)
    }
}
