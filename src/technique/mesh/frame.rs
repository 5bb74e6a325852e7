//! The route `compute` of the techniques for meshes: each pixel walks through the faces or cells of its tile, and no fragment is stored.
//!
//! 1. Points are projected, and each primitive gets a box of pixels and a rank ([`Ranking`]).
//! 2. Primitives are binned to tiles, and each tile learns which of its primitives the line of each pixel meets ([`Hits`]).
//! 3. The technique's shader takes the primitives of each pixel by rank, in one dispatch or in chunks.
//! 4. Pixels that were out of order are drawn again from lists of their primitives alone ([`Repairs`]).
//! 5. Pixels in which cells overlap are drawn again from lists of cells ([`Overlaps`]), from the next frame after the first overlap on, where
//!    faces were drawn.
//!
//! Steps 2 to 4 are done for one band of tiles after the other, because the pairs of a tile and a primitive of a band must fit one buffer. Few
//! images need more than one band.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::lists::{Band, Hits, Measured, Ranking, measure};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::Canvas;
use crate::gpu::shader::{FLAG_OVERLAPS, FLAG_REPAIRED, FLAG_UNSORTED, STATUS_WORDS, TILE};
use crate::gpu::{Buffer, Image, Recorder, TargetImage};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::dispatch::download;
use crate::resident::GpuScene;
use crate::resident::local_space::LocalSpace;
use crate::scene::View;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::flagged::FlaggedFrame;
use crate::technique::mesh::outcome::MeshOutcome;
use crate::technique::mesh::overlaps::Overlaps;
use crate::technique::mesh::repairs::Repairs;
use crate::technique::mesh::shading::shading_push;
use crate::technique::mesh::tile_draw::{TileDraw, eye_inside};

// Shaders write flags as bits 0 to 2.
const _: () = assert!(FLAG_UNSORTED | FLAG_REPAIRED | FLAG_OVERLAPS == 7);

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct MeshFrame {
    space: LocalSpace,
    push: MeshPush,
    bands: Vec<Band>,
    ranking: Ranking,
    hits: Arc<Hits>,
    draw: TileDraw,
    repair: Option<Repairs>,
    overlaps: Option<Overlaps>,
    outcome: Arc<MeshOutcome>,
}

impl MeshFrame {
    /// Prepares frames of one view size. Primitives are ranked by `order`, or on the device.
    pub(crate) fn new(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
        desc: MeshDesc,
        order: Option<&[u32]>,
    ) -> Result<Self> {
        if desc.options.back_to_front() {
            target.refuse_layers(&format!("{} order=back-to-front", desc.name), "order=front-to-back")?;
        }
        let gpu = scene.gpu();
        let data = scene.mesh_data();
        let space = LocalSpace::of(scene.mesh()?);
        let knots = scene.knots()?;
        let push = space.push(view, &shading_push(scene, &desc, &knots)?)?;
        let [width, height] = view.extent();
        let across = width.div_ceil(TILE);
        let tiles = across * height.div_ceil(TILE);

        let ranking = desc.rank_primitives(scene, &data, order)?;
        let known = data.needs(desc.primitives);
        let Measured { needs, bins, bands } = measure(gpu, &ranking, known, &push, [tiles, across], false)?;
        let hits = Hits::new(gpu, &ranking, bins, None)?;

        let draw =
            TileDraw::new(scene, (view, target), &desc, (&ranking, &hits), &push, needs.longest_bin, false)?;
        let status = download(gpu, "status", 4 * u64::from(STATUS_WORDS))?;
        let repairs = desc.repair.is_some();
        let totals = [bands.len(), if repairs { bands.len() } else { 0 }];
        let mut outcome = MeshOutcome::new(gpu, known, &desc, status, totals, needs, ranking.count)?;
        outcome.walks = true;
        let (mut repair, mut overlaps) = (None, None);
        if let Some(shader) = desc.repair {
            let drawn = draw.inputs(&ranking, &push);
            let frame =
                FlaggedFrame { scene, data: &data, desc: &desc, push: &push, tiles, across, drawn: &drawn };
            repair = Some(Repairs::new(&frame, shader, &ranking, Arc::clone(&hits), bands.clone(), needs)?);
            if desc.repairs_overlaps() && needs.overlaps {
                let found = Overlaps::new(&frame)?;
                outcome.overlaps = Some(found.outcome());
                overlaps = Some(found);
            }
        }
        Ok(Self { space, push, bands, ranking, hits, draw, repair, overlaps, outcome: Arc::new(outcome) })
    }

    /// Replaces the ranks from the host. Returns `false`, and changes nothing, while a recording reads the old ones.
    pub(crate) fn give_order(&mut self, order: &[u32]) -> bool {
        self.ranking.give_order(order)
    }

    /// Returns the number of primitives that are drawn.
    pub(crate) fn primitive_count(&self) -> u32 {
        self.ranking.count
    }
}

impl Prepared for MeshFrame {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        let push = self.space.push(view, &self.push)?;
        if eye_inside(&push) && !eye_inside(&self.push) {
            return Ok(false);
        }
        self.push = push;
        Ok(true)
    }

    fn measure(&self) -> DepthMeasure {
        DepthMeasure::of_frame(&self.space)
    }

    fn image(&self) -> Option<&Arc<Image>> {
        Some(&self.draw.image)
    }

    fn overflow(&self) -> Option<&Arc<Buffer>> {
        Some(&self.draw.flags)
    }

    fn route(&self) -> &'static str {
        "compute"
    }

    fn hit_depths(&self) -> std::result::Result<(), &'static str> {
        self.draw.hit_depths()
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        vec![
            ("tiles", self.bands.iter().map(|band| u64::from(band.tiles)).sum()),
            ("bands", num::wide(self.bands.len())),
            ("chunks", self.draw.chunks.into()),
        ]
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }

    fn record(&self, recorder: &mut Recorder<'_>, _target: Option<&TargetImage>, _clear: bool) {
        self.ranking.record(recorder, &self.push);
        for (i, band) in self.bands.iter().enumerate() {
            self.hits.record(recorder, &self.push, *band, self.outcome.bins.get(i));
            self.draw.record(recorder, &self.push, *band, [true; 2]);
            if let Some(repair) = &self.repair {
                repair.record(recorder, &self.push, i, &self.outcome);
            }
        }
        if let Some(overlaps) = &self.overlaps {
            overlaps.record(recorder, &self.push);
        }
        self.outcome.record_status(recorder, "status", &self.ranking);
    }
}
