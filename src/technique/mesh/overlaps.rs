//! Redraws those pixels of `havs` in which cells overlap, from lists of cells.
//!
//! Faces say where a ray enters and leaves cells, but not which scalar holds where the ray is in two cells at once.
//! `havs` flags such pixels; here they get lists of cells, whose entries need no neighbours (`abuffer.glsl`). The passes
//! are built once a frame has met an overlap.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::lists::{Lists, Ranking, measure};
use crate::gpu::shader::STATUS_WORDS;
use crate::gpu::{Buffer, Recorder};
use crate::interface::MeshPush;
use crate::primitives::dispatch::{Dispatch, download, groups_of, pass};
use crate::resident::mesh::Primitives;
use crate::technique::mesh::cell_lists;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::flagged::FlaggedFrame;
use crate::technique::mesh::list_inputs::ListInputs;

/// The passes after `havs` that draw overlaps.
#[derive(Debug)]
pub(crate) struct Overlaps {
    ranking: Ranking,
    lists: Lists,
    pass: Dispatch,
    rounds: u32,
    status: Arc<Buffer>,
}

impl Overlaps {
    /// Builds the passes; they draw into the image of the frame, where its flags say so.
    pub(crate) fn new(frame: &FlaggedFrame<'_>) -> Result<Self> {
        let FlaggedFrame { scene, data, push, tiles, across, drawn, .. } = *frame;
        let gpu = scene.gpu();
        let desc =
            MeshDesc { name: "havs.overlaps", primitives: Primitives::Cells, chunk: None, ..*frame.desc };
        let ranking = desc.rank_primitives(scene, data, None)?;
        let (runs, needs, bands) = measure(gpu, &ranking, &data.needs, push, tiles, across)?;
        let lists = Lists::new(gpu, &ranking, tiles, runs, bands, needs, Some(drawn.flags))?;
        let inputs = ListInputs {
            cursors: &lists.cursors,
            lists: &lists.entries,
            status: &ranking.status,
            k: cell_lists::WINDOW,
            repair: true,
            flagged: true,
            ..drawn.clone()
        };
        let pass = pass(gpu, desc.name, &cell_lists::resolve(&inputs))?;
        let status = download(gpu, "overlaps.status", 4 * u64::from(STATUS_WORDS))?;
        Ok(Self { ranking, lists, pass, rounds: needs.rounds, status })
    }

    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        self.ranking.record(recorder, push);
        self.lists.bin(recorder, push, self.ranking.count);
        for (i, band) in self.lists.bands.iter().enumerate() {
            recorder.clear_buffer("overlaps.clear", &self.lists.cursors);
            self.lists.list(recorder, push, i, false);
            if let Some(scan) = self.lists.list_scans.get(i) {
                scan.record(recorder);
            }
            self.lists.list(recorder, push, i, true);
            for round in 1..=self.rounds {
                let push = MeshPush {
                    count: band.tiles,
                    band: band.first,
                    capacity: self.lists.list_capacity,
                    last_round: u32::from(round == self.rounds),
                    ..*push
                };
                self.pass.record(recorder, &push, groups_of(band.tiles, 1));
            }
        }
        recorder.copy_buffer("overlaps.status", &self.ranking.status, &self.status, self.status.size());
        recorder.release_to_host(&self.status);
    }

    /// Returns the buffer that holds the status once the frame has ended.
    pub(crate) fn status(&self) -> Arc<Buffer> {
        Arc::clone(&self.status)
    }
}
