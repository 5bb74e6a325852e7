//! Pixels in which cells overlap, drawn again from lists of cells.
//!
//! Faces tell where a line enters and leaves cells, not which scalar holds where it is in two at once. `havs` flags such
//! pixels; here they get lists of cells (`abuffer`), which stand for themselves. Built when a frame has met an overlap.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::lists::{Lists, Stage, measure};
use crate::gpu::shader::{
    ABUFFER_COMPUTE, BINDING_CURSORS, BINDING_LISTS, BINDING_STATUS, SPEC_FLAGGED, SPEC_K, SPEC_REPAIR,
    STATUS_CUT, STATUS_LONGEST_BIN, STATUS_LOST, STATUS_UNREPAIRED, STATUS_WORDS,
};
use crate::gpu::{Buffer, Recorder, Resource, SpecConstant};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::dispatch::{Dispatch, download, groups_of, pass, words};
use crate::resident::GpuScene;
use crate::resident::mesh::{MeshData, Needs, Primitives};
use crate::technique::mesh::shading::{MeshDesc, check_loops, constants, only_flagged, stage};

/// Entries that a list passes through before it is sorted in place.
const WINDOW: u32 = 7;

/// The step after `havs` where cells overlap.
#[derive(Debug)]
pub(crate) struct Overlaps {
    stage: Stage,
    lists: Lists,
    pass: Dispatch,
    rounds: u32,
    status: Arc<Buffer>,
}

impl Overlaps {
    /// Draws into what `resources` bind, where their flags say so. `shading` are the constants of segments.
    #[expect(clippy::too_many_arguments, reason = "one caller, which has all of these at hand")]
    pub(crate) fn new(
        scene: &GpuScene,
        desc: &MeshDesc,
        data: &MeshData,
        push: &MeshPush,
        [tiles, across]: [u32; 2],
        flags: &Arc<Buffer>,
        mut resources: Vec<(u32, Resource)>,
        shading: &[SpecConstant],
    ) -> Result<Self> {
        let gpu = scene.gpu();
        let desc = MeshDesc { name: "havs.overlaps", primitives: Primitives::Cells, chunk: None, ..*desc };
        let stage = stage(scene, data, &desc, None)?;
        let (runs, needs, bands) = measure(gpu, &stage, &data.needs, push, tiles, across)?;
        let mut lists = Lists::new(gpu, &stage, tiles, runs, bands, needs)?;
        only_flagged(&mut lists, scene, &desc, flags)?;
        let Some(entries) = lists.list_fill.descriptors.resource(BINDING_LISTS) else {
            return Err(Error::invalid(desc.name, "no lists"));
        };
        resources.retain(|(binding, _)| ![BINDING_CURSORS, BINDING_LISTS, BINDING_STATUS].contains(binding));
        resources.extend([
            (BINDING_CURSORS, Resource::ReadOnly(Arc::clone(&lists.cursors))),
            (BINDING_LISTS, entries),
            (BINDING_STATUS, Resource::Buffer(Arc::clone(&stage.status))),
        ]);
        let mut all = constants(scene, &desc)?;
        all.extend_from_slice(shading);
        all.extend([(SPEC_K, WINDOW), (SPEC_REPAIR, 1), (SPEC_FLAGGED, 1)]);
        let pass = pass(gpu, desc.name, &ABUFFER_COMPUTE, &all, &resources)?;
        let status = download(gpu, "overlaps.status", 4 * u64::from(STATUS_WORDS))?;
        Ok(Self { stage, lists, pass, rounds: needs.rounds, status })
    }

    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        self.stage.record(recorder, push);
        self.lists.bin(recorder, push, self.stage.count);
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
                    bins: u32::from(round == self.rounds),
                    ..*push
                };
                self.pass.record(recorder, &push, groups_of(band.tiles, 1));
            }
        }
        recorder.copy_buffer("overlaps.status", &self.stage.status, &self.status, self.status.size());
        recorder.release_to_host(&self.status);
    }

    /// Where a frame's status can be read when it has ended.
    pub(crate) fn status(&self) -> Arc<Buffer> {
        Arc::clone(&self.status)
    }
}

/// Whether everything was drawn; what was short is asked for.
pub(crate) fn complete(status: &Buffer, needs: &mut Needs) -> Result<bool> {
    let status = words(&status.host_copy()?);
    let at = |word: u32| status.get(num::index(word)).copied().unwrap_or(0);
    needs.longest_bin = needs.longest_bin.max(at(STATUS_LONGEST_BIN));
    check_loops(at(STATUS_CUT))?;
    if at(STATUS_UNREPAIRED) > 0 {
        needs.rounds = (needs.rounds * 2).max(2);
    }
    Ok(at(STATUS_LOST) == 0 && at(STATUS_UNREPAIRED) == 0)
}
