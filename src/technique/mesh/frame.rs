//! A frame of a technique for meshes, drawn from lists of the fragments of each pixel.
//!
//! 1. Points are projected, and each primitive gets a box of pixels and a rank ([`Ranking`]).
//! 2. Primitives are binned to tiles, and fragments are listed for each pixel by rank ([`Lists`]).
//! 3. The technique's shader resolves each list, in one dispatch or in chunks.
//! 4. Pixels whose list was out of order are repaired: the list is sorted in place and resolved again.
//! 5. Pixels in which cells overlap are drawn again from lists of cells ([`Overlaps`]), from the next frame after the first overlap on.
//!
//! All tiles are binned at once. Lists are written, resolved and repaired for one band of tiles after the other, because
//! the lists of a band must fit one buffer. The capacities of bins and lists are measured when a view is prepared; a frame
//! that needs more is incomplete, and is prepared again with the capacity that it lacked.

use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::lists::{Band, Lists, Ranking, measure};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::{Canvas, own_image};
use crate::gpu::shader::{FLAG_OVERLAPS, FLAG_REPAIRED, FLAG_UNSORTED, STATUS_WORDS, TILE, TILE_PIXELS};
use crate::gpu::{Buffer, Image, Recorder, TargetImage};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass};
use crate::resident::GpuScene;
use crate::resident::local_space::LocalSpace;
use crate::resident::mesh::{MeshData, Primitives};
use crate::scene::View;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::flagged::FlaggedFrame;
use crate::technique::mesh::list_inputs::{FORMAT, ListInputs, Shading, kbuffer_images};
use crate::technique::mesh::outcome::MeshOutcome;
use crate::technique::mesh::overlaps::Overlaps;
use crate::technique::mesh::shading::shading_push;

// Shaders write flags as bits 0 to 2.
const _: () = assert!(FLAG_UNSORTED | FLAG_REPAIRED | FLAG_OVERLAPS == 7);

/// Entries of the k-buffer that a repair sorts with.
pub(crate) const REPAIR_K: u32 = 15;

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct MeshFrame {
    scene: Arc<GpuScene>,
    data: Arc<MeshData>,
    desc: MeshDesc,
    shading: Shading,
    space: LocalSpace,
    push: MeshPush,
    tiles: u32,
    ranking: Ranking,
    lists: Lists,
    /// One pass that resolves whole lists, or those of the first, a middle and the last chunk.
    resolve: Vec<Dispatch>,
    chunks: u32,
    repair: Option<Dispatch>,
    overlaps: Option<Overlaps>,
    /// Repair passes of a frame: each sorts a list further.
    rounds: u32,
    image: Arc<Image>,
    flags: Arc<Buffer>,
    outcome: Arc<MeshOutcome>,
    /// Images that keep the k-buffer between chunks.
    kbuffer: Vec<Arc<Image>>,
}

/// Which of a frame's passes over lists a pipeline is for.
#[derive(Clone, Copy, Debug)]
enum Part {
    /// Resolves a chunk: `resume` loads the k-buffer that the one before left, `last_chunk` empties it.
    Resolve { resume: bool, last_chunk: bool },
    /// Sorts unsorted lists and resolves them again.
    Repair,
}

/// Whether the mesh may reach behind the eye.
fn eye_inside(push: &MeshPush) -> bool {
    // `forward[3]` is the eye's depth relative to the centre of the mesh, which lies within one unit of it.
    push.forward[3] > -1.001
}

impl MeshFrame {
    /// Prepares a frame whose primitives are ranked on the device.
    pub(crate) fn new(scene: &Arc<GpuScene>, view: &View, target: &Canvas, desc: MeshDesc) -> Result<Self> {
        Self::with_order(scene, view, target, desc, None)
    }

    /// Prepares a frame whose primitives are ranked by `order`, if it is given.
    pub(crate) fn with_order(
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
        let (runs, needs, bands) = measure(gpu, &ranking, &data.needs, &push, tiles, across)?;
        let lists = Lists::new(gpu, &ranking, tiles, runs, bands, needs, None)?;

        let image = own_image(gpu, desc.name, FORMAT, vk::ImageUsageFlags::STORAGE, view, target)?;
        let flags = buffer(gpu, "flags", u64::from(tiles) * u64::from(TILE_PIXELS))?;
        let kbuffer = match (desc.primitives, desc.chunk) {
            (Primitives::Faces, Some(_)) => kbuffer_images(gpu, desc.k, view.extent())?,
            // A list is resolved at once, but the shader declares images.
            (Primitives::Faces, None) => kbuffer_images(gpu, 1, [1, 1])?,
            (Primitives::Cells, _) => Vec::new(),
        };
        let status = download(gpu, "status", 4 * u64::from(STATUS_WORDS))?;
        let outcome = MeshOutcome::new(gpu, &data, &desc, status, &lists, needs, ranking.count)?;
        let mut frame = Self {
            scene: Arc::clone(scene),
            data,
            desc,
            shading: Shading::new(scene, &desc.options.segments, target)?,
            space,
            push,
            tiles,
            ranking,
            lists,
            resolve: Vec::new(),
            chunks: 1,
            repair: None,
            overlaps: None,
            rounds: needs.rounds,
            image,
            flags,
            outcome: Arc::new(outcome),
            kbuffer,
        };
        frame.build_passes(needs.longest_bin)?;
        if desc.repairs_overlaps() && needs.overlaps {
            frame.build_overlaps(across)?;
        }
        Ok(frame)
    }

    /// Builds the passes that resolve and repair lists of at most `longest` entries.
    fn build_passes(&mut self, longest: u32) -> Result<()> {
        // A pixel's list is no longer than the bin of its tile.
        self.chunks = self.desc.chunk.map_or(1, |chunk| longest.div_ceil(chunk).max(1));
        let chunk = |resume, last_chunk| self.pass(Part::Resolve { resume, last_chunk });
        self.resolve = match self.chunks {
            1 => vec![chunk(false, true)?],
            _ => vec![chunk(false, false)?, chunk(true, false)?, chunk(true, true)?],
        };
        if self.desc.repair.is_some() {
            self.repair = Some(self.pass(Part::Repair)?);
        }
        Ok(())
    }

    /// Builds the passes that draw overlaps of cells again.
    fn build_overlaps(&mut self, across: u32) -> Result<()> {
        let overlaps = Overlaps::new(&FlaggedFrame {
            scene: &self.scene,
            data: &self.data,
            desc: &self.desc,
            push: &self.push,
            tiles: self.tiles,
            across,
            drawn: &self.inputs(),
        })?;
        if let Some(outcome) = Arc::get_mut(&mut self.outcome) {
            outcome.overlaps = Some(overlaps.status());
        }
        self.overlaps = Some(overlaps);
        Ok(())
    }

    /// Replaces the ranks from the host. Returns `false`, and changes nothing, while a recording reads the old ones.
    pub(crate) fn give_order(&mut self, order: &[u32]) -> bool {
        self.ranking.give_order(order)
    }

    /// Returns the number of primitives that are drawn.
    pub(crate) fn primitive_count(&self) -> u32 {
        self.ranking.count
    }

    /// Returns the inputs of passes over lists, as for one that resolves whole lists.
    fn inputs(&self) -> ListInputs<'_> {
        ListInputs {
            shading: &self.shading,
            cursors: &self.lists.cursors,
            lists: &self.lists.entries,
            status: &self.ranking.status,
            flags: &self.flags,
            image: &self.image,
            kbuffer: &self.kbuffer,
            cell_scalars: self.ranking.cell_scalars,
            back_to_front: self.desc.options.back_to_front(),
            eye_inside: eye_inside(&self.push),
            k: self.desc.k,
            resume: false,
            last_chunk: true,
            repair: false,
            flagged: false,
        }
    }

    /// Builds one pass over lists.
    fn pass(&self, part: Part) -> Result<Dispatch> {
        let desc = &self.desc;
        let (name, bound) = match part {
            Part::Resolve { resume, last_chunk } => {
                ("resolve", (desc.resolve)(&ListInputs { resume, last_chunk, ..self.inputs() }))
            }
            Part::Repair => {
                let shader = desc.repair.unwrap_or(desc.resolve);
                ("repair", shader(&ListInputs { k: REPAIR_K, repair: true, ..self.inputs() }))
            }
        };
        pass(self.scene.gpu(), &format!("{}.{name}", desc.name), &bound)
    }

    /// Records the bins of all tiles.
    fn record_bins(&self, recorder: &mut Recorder<'_>) {
        self.lists.bin(recorder, &self.push, self.ranking.count);
        recorder.copy_buffer("bins.total", self.lists.bins.total(), &self.outcome.bins, 8);
        recorder.release_to_host(&self.outcome.bins);
    }

    /// Records the lists of a band: counted, summed up, written.
    fn record_lists(&self, recorder: &mut Recorder<'_>, band: usize) {
        recorder.clear_buffer("lists.clear", &self.lists.cursors);
        self.lists.list(recorder, &self.push, band, false);
        if let Some(scan) = self.lists.list_scans.get(band) {
            scan.record(recorder);
            recorder.copy_buffer("lists.total", scan.total(), &self.outcome.lists[band], 8);
            recorder.release_to_host(&self.outcome.lists[band]);
        }
        self.lists.list(recorder, &self.push, band, true);
    }

    /// Records the passes that resolve the lists of a band, chunk by chunk, and then repair them.
    fn record_resolve(&self, recorder: &mut Recorder<'_>, band: &Band) {
        /// More entries than any list has.
        const ALL: u32 = u32::MAX / 2;
        let groups = groups_of(band.tiles, 1);
        let push = MeshPush {
            count: band.tiles,
            band: band.first,
            capacity: self.lists.list_capacity,
            number: ALL,
            ..self.push
        };
        let length = self.desc.chunk.unwrap_or(0);
        for chunk in 0..self.chunks {
            let last = chunk + 1 == self.chunks;
            let pass = match (chunk, last) {
                (0, _) => self.resolve.first(),
                (_, false) => self.resolve.get(1),
                (_, true) => self.resolve.get(2),
            };
            let push = MeshPush { first: chunk * length, number: if last { ALL } else { length }, ..push };
            if let Some(pass) = pass {
                pass.record(recorder, &push, groups);
            }
        }
        if let Some(repair) = &self.repair {
            for round in 1..=self.rounds {
                // The last round counts the pixels that are still unsorted.
                let push = MeshPush { last_round: u32::from(round == self.rounds), ..push };
                repair.record(recorder, &push, groups);
            }
        }
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
        Some(&self.image)
    }

    fn overflow(&self) -> Option<&Arc<Buffer>> {
        Some(&self.flags)
    }

    fn route(&self) -> &'static str {
        "compute"
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        vec![
            ("tiles", self.tiles.into()),
            ("bands", num::wide(self.lists.bands.len())),
            ("chunks", self.chunks.into()),
        ]
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }

    fn record(&self, recorder: &mut Recorder<'_>, _target: Option<&TargetImage>, _clear: bool) {
        self.ranking.record(recorder, &self.push);
        self.record_bins(recorder);
        for (i, band) in self.lists.bands.iter().enumerate() {
            self.record_lists(recorder, i);
            self.record_resolve(recorder, band);
        }
        if let Some(overlaps) = &self.overlaps {
            overlaps.record(recorder, &self.push);
        }
        let status = &self.outcome.status;
        recorder.copy_buffer("status", &self.ranking.status, status, status.size());
        recorder.release_to_host(status);
    }
}
