//! Frames of a mesh in parts, for devices without room for the whole, or for the ranks and bins of all its faces: one recording a part.
//!
//! Each part is the faces whose centroids lie in a box of a k-d tree. The boxes are taken in visibility order, and the k-buffer waits for the
//! next one in storage images; so it meets the faces of a pixel in nearly the order in which a frame of the whole mesh does, and what leaves it is
//! the same.
//!
//! 1. The faces of a part are uploaded, ranked and binned, and each pixel takes those that its line meets (`tile_draw.rs`).
//! 2. Where pixels were out of order, all parts are gone through twice more: their fragments are counted, then listed. The lists are
//!    drawn as those of the whole mesh ([`Repairs`]).
//! 3. Where cells overlap, the same is done with the cells of these pixels, from the next frame after the first overlap on.
//!
//! The status that a recording leaves decides what comes next ([`Progress`]); [`Prepared::load`] then writes the next part where the device
//! reads it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::lists::{Band, Hits, Measured, Ranking, measured};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::Canvas;
use crate::gpu::shader::{FLAG_OVERLAPS, STATUS_WORDS, TILE};
use crate::gpu::{Buffer, Image, Recorder, TargetImage};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::bins::Fill;
use crate::primitives::dispatch::download;
use crate::resident::GpuScene;
use crate::resident::local_space::LocalSpace;
use crate::resident::mesh::{Needs, Primitives};
use crate::resident::mesh_parts::{MeshParts, PartSlot};
use crate::scene::View;
use crate::technique::mesh::cell_lists;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::flagged::FlaggedFrame;
use crate::technique::mesh::list_inputs::ListInputs;
use crate::technique::mesh::outcome::{MeshOutcome, Read};
use crate::technique::mesh::repairs::Repairs;
use crate::technique::mesh::shading::shading_push;
use crate::technique::mesh::tile_draw::{TileDraw, eye_inside};

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct PartsFrame {
    scene: Arc<GpuScene>,
    space: LocalSpace,
    push: MeshPush,
    view: View,
    faces: Sweep,
    draw: TileDraw,
    repair: Option<Repairs>,
    overlaps: Option<(Sweep, Repairs)>,
    outcome: Arc<PartsOutcome>,
    back_to_front: bool,
    /// The stage of the next recording, where it goes on with the image of the last one.
    next: Stage,
    resumes: AtomicBool,
}

/// The parts of the faces, or of the cells, with what each of them needs in turn.
#[derive(Debug)]
struct Sweep {
    parts: Arc<MeshParts>,
    slot: PartSlot,
    ranking: Ranking,
    hits: Arc<Hits>,
    /// The bands of each part.
    bands: Vec<Vec<Band>>,
    /// Numbers of the parts that a view sees, in visibility order.
    order: Vec<u32>,
}

/// The work that a recording does on a part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Task {
    /// Draws its faces.
    #[default]
    Draw,
    /// Counts the fragments of unsorted pixels, or lists them.
    Count,
    List,
    /// Does the same with cells where they overlap.
    CountCells,
    ListCells,
}

/// A task, and the place of its part in visibility order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Stage {
    task: Task,
    at: usize,
}

/// How far a frame has come.
#[derive(Debug, Default)]
struct Progress {
    /// The stage of the last recording.
    stage: Stage,
    /// The numbers of parts of faces, and of cells.
    parts: [usize; 2],
    /// The stage after it, once it has ended; none where all is drawn, where a frame with more room has to begin anew, and after a change of the
    /// view.
    next: Option<Stage>,
}

#[derive(Debug)]
struct PartsOutcome {
    mesh: MeshOutcome,
    repairs: bool,
    progress: Mutex<Progress>,
}

impl Stage {
    fn of_cells(self) -> bool {
        matches!(self.task, Task::CountCells | Task::ListCells)
    }
}

impl Sweep {
    /// Makes the buffers of a part, and bins that suit each part of a view. With `flagged` the bins are for lists alone.
    fn new(
        scene: &GpuScene,
        desc: &MeshDesc,
        parts: &Arc<MeshParts>,
        (view, push): (&View, &MeshPush),
        flagged: Option<&ListInputs<'_>>,
    ) -> Result<(Self, Needs)> {
        let (gpu, mesh) = (scene.gpu(), scene.mesh()?);
        let mut slot = PartSlot::new(gpu, parts)?;
        let ranking = desc.rank_part(scene, &slot)?;
        let order = parts.order(view, push, desc.options.back_to_front());
        let [across, down] = view.extent().map(|side| side.div_ceil(TILE));
        let tiles = across * down;
        let mut fills = Vec::new();
        for &part in &order {
            slot.stage(mesh, part, false);
            fills.push(Fill::measure(gpu, desc.name, &ranking.ranked(), [tiles, across], |recorder| {
                slot.record(recorder, false);
                ranking.record(recorder, push);
            })?);
        }
        let Measured { needs, bins, bands: found } =
            measured(gpu, &ranking, &parts.needs, &fills, tiles, flagged.is_some())?;
        // A part that comes into view later has bands as wide as the widest, until a frame finds that it needs more.
        let widest = found.iter().flatten().map(|band| band.tiles).max().unwrap_or(tiles);
        let unseen: Vec<Band> = Band::cut([0, tiles], widest).collect();
        let mut bands = vec![unseen; parts.count()];
        for (&part, found) in order.iter().zip(found) {
            bands[num::index(part)] = found;
        }
        let listed = parts.needs.lock().unwrap_or_else(PoisonError::into_inner).lists;
        if listed > needs.lists {
            let why = format!("{listed} fragments of pixels out of order; {} fit a buffer", needs.lists);
            return Err(Error::unsupported(format!("{} in parts of this view", desc.name), why));
        }
        let hits = Hits::new(gpu, &ranking, bins, flagged.map(|list| (list.flags, list.listed)))?;
        Ok((Self { parts: Arc::clone(parts), slot, ranking, hits, bands, order }, needs))
    }

    /// Returns the part at a place in visibility order, and its bands.
    fn part(&self, at: usize) -> (u32, &[Band]) {
        let part = self.order.get(at).copied().unwrap_or(0);
        (part, &self.bands[num::index(part)])
    }

    /// Returns the number of the first band of a part among those of all.
    fn first_band(&self, part: u32) -> usize {
        self.bands[..num::index(part)].iter().map(Vec::len).sum()
    }

    /// Returns the outcome of these parts.
    fn outcome(&self, scene: &GpuScene, desc: &MeshDesc, needs: Needs, lists: bool) -> Result<MeshOutcome> {
        let gpu = scene.gpu();
        let status = download(gpu, "status", 4 * u64::from(STATUS_WORDS))?;
        let totals = [self.bands.iter().map(Vec::len).sum(), usize::from(lists)];
        MeshOutcome::new(gpu, &self.parts.needs, desc, status, totals, needs, self.parts.primitives)
    }

    /// Records what clears the status of these parts before a frame.
    fn record_begin(&self, recorder: &mut Recorder<'_>, outcome: &MeshOutcome) {
        self.ranking.clear_status(recorder);
        for total in outcome.bins.iter().chain(&outcome.lists) {
            recorder.clear_buffer("totals.clear", total);
            recorder.release_to_host(total);
        }
    }
}

impl PartsFrame {
    /// Prepares frames of one view size of the faces of a mesh in parts.
    pub(crate) fn new(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
        desc: &MeshDesc,
        parts: &Arc<MeshParts>,
    ) -> Result<Self> {
        if desc.options.back_to_front() {
            target.refuse_layers(&format!("{} order=back-to-front", desc.name), "order=front-to-back")?;
        }
        let (mesh, data) = (scene.mesh()?, scene.mesh_data());
        let space = LocalSpace::of(mesh);
        let push = space.push(view, &shading_push(scene, desc, &*scene.knots()?)?)?;
        let (mut faces, needs) = Sweep::new(scene, desc, parts, (view, &push), None)?;
        faces.slot.stage(mesh, faces.order[0], true);
        let drawn = (&faces.ranking, &*faces.hits);
        let draw = TileDraw::new(scene, (view, target), desc, drawn, &push, needs.longest_bin, true)?;
        let [across, down] = view.extent().map(|side| side.div_ceil(TILE));
        let tiles = across * down;
        let image = vec![Band { first: 0, tiles }];
        let mut outcome = faces.outcome(scene, desc, needs, desc.repair.is_some())?;
        outcome.walks = true;
        let (mut repair, mut overlaps) = (None, None);
        if let Some(shader) = desc.repair {
            let list = draw.inputs(&faces.ranking, &push);
            let frame = FlaggedFrame { scene, data: &data, desc, push: &push, tiles, across, drawn: &list };
            let hits = Arc::clone(&faces.hits);
            repair = Some(Repairs::new(&frame, shader, &faces.ranking, hits, image.clone(), needs)?);
            if needs.overlaps {
                let desc = desc.of_overlaps();
                let margin = desc.margin(scene);
                let cells = scene.mesh_parts(Primitives::Cells, margin, num::count(parts.count()))?;
                let flagged = ListInputs { listed: FLAG_OVERLAPS, ..list.clone() };
                let (sweep, needs) = Sweep::new(scene, &desc, &cells, (view, &push), Some(&flagged))?;
                let list = ListInputs { status: &sweep.ranking.status, ..flagged };
                let frame = FlaggedFrame { desc: &desc, drawn: &list, ..frame };
                let hits = Arc::clone(&sweep.hits);
                let repair = Repairs::new(&frame, cell_lists::repair, &sweep.ranking, hits, image, needs)?;
                outcome.overlaps = Some(Arc::new(sweep.outcome(scene, &desc, needs, true)?));
                overlaps = Some((sweep, repair));
            }
        }
        let outcome = PartsOutcome { mesh: outcome, repairs: repair.is_some(), progress: Mutex::default() };
        Ok(Self {
            scene: Arc::clone(scene),
            space,
            push,
            view: *view,
            faces,
            draw,
            repair,
            overlaps,
            outcome: Arc::new(outcome),
            back_to_front: desc.options.back_to_front(),
            next: Stage::default(),
            resumes: AtomicBool::new(false),
        })
    }

    /// Records a stage.
    fn record_stage(&self, recorder: &mut Recorder<'_>, stage: Stage) {
        let cells = self.overlaps.as_ref().zip(self.outcome.mesh.overlaps.as_deref());
        let begins = stage == Stage::default();
        if begins {
            self.faces.record_begin(recorder, &self.outcome.mesh);
            if let Some(((sweep, _), outcome)) = cells {
                sweep.record_begin(recorder, outcome);
            }
        }
        let (sweep, repair, outcome) = match cells {
            Some(((sweep, repair), outcome)) if stage.of_cells() => (sweep, Some(repair), outcome),
            _ => (&self.faces, self.repair.as_ref(), &self.outcome.mesh),
        };
        let (part, bands) = sweep.part(stage.at);
        let ends = [stage.at == 0, stage.at + 1 == sweep.order.len()];
        sweep.slot.record(recorder, begins);
        sweep.ranking.record_ranks(recorder, &self.push);
        let first = sweep.first_band(part);
        for (i, band) in bands.iter().enumerate() {
            sweep.hits.record(recorder, &self.push, *band, outcome.bins.get(first + i));
            match (stage.task, repair) {
                (Task::Draw, _) => self.draw.record(recorder, &self.push, *band, ends),
                (Task::Count | Task::CountCells, Some(repair)) => {
                    repair.lists.record_count(recorder, &self.push, *band, stage.at > 0);
                }
                (_, Some(repair)) => repair.lists.record_fill(recorder, &self.push, *band),
                (_, None) => {}
            }
        }
        if let (Some(repair), true) = (repair, ends[1]) {
            match stage.task {
                Task::Draw => {}
                Task::Count | Task::CountCells => {
                    repair.lists.record_places(recorder, 0, outcome.lists.first());
                }
                Task::List | Task::ListCells => {
                    repair.record_rounds(recorder, &self.push, repair.lists.bands[0]);
                }
            }
        }
        self.outcome.mesh.record_status(recorder, "status", &self.faces.ranking);
        if let Some(((sweep, _), outcome)) = cells {
            outcome.record_status(recorder, "status", &sweep.ranking);
        }
    }
}

impl PartsOutcome {
    fn progress(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Outcome for PartsOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let Read { fits, sorted, apart, flagged: [unsorted, overlapping], counters } =
            self.mesh.read_all()?;
        let mut progress = self.progress();
        let Stage { task, at } = progress.stage;
        let count = progress.parts[usize::from(progress.stage.of_cells())];
        let begin = |task| Some(Stage { task, at: 0 });
        let cells = self.mesh.overlaps.is_some() && overlapping > 0;
        let stage = match task {
            _ if at + 1 < count => Some(Stage { task, at: at + 1 }),
            Task::Draw if self.repairs && unsorted > 0 => begin(Task::Count),
            Task::Count => begin(Task::List),
            Task::Draw | Task::List if cells => begin(Task::CountCells),
            Task::CountCells => begin(Task::ListCells),
            Task::Draw | Task::List | Task::ListCells => None,
        };
        // Another plan has to follow where room was short, and where overlaps are met for the first time.
        progress.next = stage.filter(|_| fits && apart);
        Ok((fits && sorted && apart && stage.is_none(), counters))
    }
}

impl Prepared for PartsFrame {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        if self.view == *view {
            return Ok(true);
        }
        let push = self.space.push(view, &self.push)?;
        if eye_inside(&push) && !eye_inside(&self.push) {
            return Ok(false);
        }
        let order = self.faces.parts.order(view, &push, self.back_to_front);
        if !self.faces.slot.stage(self.scene.mesh()?, order[0], true) {
            return Ok(false);
        }
        self.faces.order = order;
        if let Some((cells, _)) = &mut self.overlaps {
            cells.order = cells.parts.order(view, &push, self.back_to_front);
        }
        (self.push, self.view, self.resumes) = (push, *view, AtomicBool::new(false));
        self.outcome.progress().next = None;
        Ok(true)
    }

    fn load(&mut self) -> Result<bool> {
        let Some(next) = self.outcome.progress().next.take() else { return Ok(false) };
        let sweep = match &mut self.overlaps {
            Some((cells, _)) if next.of_cells() => cells,
            _ => &mut self.faces,
        };
        let (part, _) = sweep.part(next.at);
        if !sweep.slot.stage(self.scene.mesh()?, part, false) {
            return Err(Error::invalid("plan", "what was recorded together with it has not been completed"));
        }
        self.next = next;
        self.resumes.store(true, Ordering::Relaxed);
        Ok(true)
    }

    fn resumes(&self) -> bool {
        self.resumes.load(Ordering::Relaxed)
    }

    fn kept(&self) -> Vec<Arc<Image>> {
        self.draw.kept()
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
        let (parts, seen) = (num::wide(self.faces.parts.count()), num::wide(self.faces.order.len()));
        vec![("parts", parts), ("parts_seen", seen), ("chunks", self.draw.chunks.into())]
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }

    fn record(&self, recorder: &mut Recorder<'_>, _target: Option<&TargetImage>, _clear: bool) {
        let mut stage = Stage::default();
        if recorder.records() {
            if self.resumes.swap(false, Ordering::Relaxed) {
                stage = self.next;
            }
            let parts =
                [self.faces.order.len(), self.overlaps.as_ref().map_or(0, |(cells, _)| cells.order.len())];
            *self.outcome.progress() = Progress { stage, parts, next: None };
        }
        self.record_stage(recorder, stage);
    }

    fn record_most(&self, recorder: &mut Recorder<'_>, _target: &TargetImage) {
        // More than any stage has: the last part of each task, and each part of the first.
        for at in 0..self.faces.order.len() {
            self.record_stage(recorder, Stage { task: Task::Draw, at });
        }
        for task in [Task::Count, Task::List] {
            self.record_stage(recorder, Stage { task, at: self.faces.order.len() - 1 });
        }
        if let Some((cells, _)) = &self.overlaps {
            for task in [Task::CountCells, Task::ListCells] {
                self.record_stage(recorder, Stage { task, at: cells.order.len() - 1 });
            }
        }
    }
}
