//! What techniques for meshes share on the host: the lists of a frame (`glsl/mesh-lists.glsl`), and how they are drawn.
//!
//! A frame sees the points, finds each primitive's box and rank, sorts by rank, bins the primitives to tiles and from
//! there to pixels, and lets the technique resolve each pixel's list. The image is cut into bands of tiles whose lists
//! fit a buffer. How much room is needed is counted when a view is prepared; a frame that needs more says so.

use std::sync::{Arc, PoisonError};

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::lists::{Lists, Stage, measure};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::{Canvas, own_image};
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_CURSORS, BINDING_FLAGS, BINDING_KBUFFER_0, BINDING_KBUFFER_1,
    BINDING_KBUFFER_2, BINDING_KBUFFER_3, BINDING_LISTS, BINDING_STATUS, COUNT_BITS, FLAG_OVERLAPS,
    FLAG_REPAIRED, FLAG_UNSORTED, LIST_WINDOW, SPEC_EYE_INSIDE, SPEC_INTEGRATOR, SPEC_K, SPEC_KNOT_WALK,
    SPEC_LAST_CHUNK, SPEC_REPAIR, SPEC_RESUME, STATUS_CUT, STATUS_LONGEST_BIN, STATUS_LOST, STATUS_NAN_KEYS,
    STATUS_OVERFLOW_PIXELS, STATUS_OVERLAPS, STATUS_UNREPAIRED, STATUS_WORDS, TILE, TILE_PIXELS,
};
use crate::gpu::sync::Use;
use crate::gpu::{Buffer, Image, ImageDesc, Recorder, Resource, SpecConstant, TargetImage};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass, total, words};
use crate::resident::GpuScene;
use crate::resident::local_space::LocalSpace;
use crate::resident::mesh::{MeshData, Needs, Primitives};
use crate::resident::tables::{Knots, Table};
use crate::scene::View;
use crate::technique::mesh::overlaps::{Overlaps, complete};
use crate::technique::mesh::shading::{
    MeshDesc, REPAIR_K, check_loops, constants, shading, shading_push, stage,
};

// A tile's counters hold what one dispatch lists; flags are bits.
const _: () = assert!(LIST_WINDOW < 1 << COUNT_BITS && FLAG_UNSORTED | FLAG_REPAIRED | FLAG_OVERLAPS == 7);

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct MeshFrame {
    scene: Arc<GpuScene>,
    data: Arc<MeshData>,
    desc: MeshDesc,
    canvas: Canvas,
    frame: LocalSpace,
    push: MeshPush,
    tiles: u32,
    stage: Stage,
    lists: Lists,
    resolve: Vec<Dispatch>,
    chunks: u32,
    repair: Option<Dispatch>,
    overlaps: Option<Overlaps>,
    rounds: u32,
    image: Arc<Image>,
    flags: Arc<Buffer>,
    outcome: Arc<MeshOutcome>,
    /// Images of the k-buffer, where it leaves the registers.
    kbuffer: Vec<Arc<Image>>,
    _knots: Arc<Knots>,
    table: Option<Arc<Table>>,
}

/// What a frame tells of itself when it has ended.
#[derive(Debug)]
pub(crate) struct MeshOutcome {
    pub(crate) data: Arc<MeshData>,
    pub(crate) status: Arc<Buffer>,
    pub(crate) bins: Arc<Buffer>,
    pub(crate) lists: Vec<Arc<Buffer>>,
    pub(crate) capacities: Needs,
    pub(crate) primitives: u32,
    /// Whether pixels in which cells overlap are to be drawn again, and the status of that.
    pub(crate) repairs_overlaps: bool,
    /// What pixels whose sequence was not sorted are counted as.
    pub(crate) unsorted: &'static str,
    pub(crate) overlaps: Option<Arc<Buffer>>,
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
        let mut needs = self.data.needs.lock().unwrap_or_else(PoisonError::into_inner);
        let sorted = at(STATUS_UNREPAIRED) == 0;
        let overlaps = match &self.overlaps {
            Some(status) => complete(status, &mut needs)?,
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

/// Whether the mesh may reach behind the eye.
fn eye_inside(push: &MeshPush) -> bool {
    // It lies within a unit of its centre.
    push.forward[3] > -1.001
}

impl MeshFrame {
    pub(crate) fn new(scene: &Arc<GpuScene>, view: &View, target: &Canvas, desc: MeshDesc) -> Result<Self> {
        Self::with_order(scene, view, target, desc, None)
    }

    /// The same with ranks from the host.
    pub(crate) fn with_order(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
        desc: MeshDesc,
        order: Option<&[u32]>,
    ) -> Result<Self> {
        if desc.back_to_front {
            target.refuse_layers(&format!("{} order=back-to-front", desc.name), "order=front-to-back")?;
        }
        let gpu = scene.gpu();
        let mesh = scene.mesh()?;
        let name = desc.name;
        let data = scene.mesh_data();
        let frame = LocalSpace::of(mesh);
        let knots = scene.knots()?;
        let table = scene.table(&desc.segments)?;
        let push = frame.push(view, &shading_push(scene, &desc, &knots)?)?;
        let [width, height] = view.extent();
        let across = width.div_ceil(TILE);
        let tiles = across * height.div_ceil(TILE);
        let stage = stage(scene, &data, &desc, order)?;

        let (runs, needs, bands) = measure(gpu, &stage, &data.needs, &push, tiles, across)?;
        let lists = Lists::new(gpu, &stage, tiles, runs, bands, needs)?;

        let format = vk::Format::R32G32B32A32_SFLOAT;
        let image = own_image(gpu, name, format, vk::ImageUsageFlags::STORAGE, view, target)?;
        let flags = buffer(gpu, "flags", u64::from(tiles) * u64::from(TILE_PIXELS))?;
        let mut kbuffer = Vec::new();
        if desc.chunk.is_some() && desc.k > 0 {
            let wide = if desc.k > 7 { 2 * width } else { width };
            let image_desc = ImageDesc::flat(format, [wide, height], vk::ImageUsageFlags::STORAGE);
            for i in 0..4 {
                kbuffer.push(Arc::new(Image::new(gpu, &format!("kbuffer.{i}"), &image_desc)?));
            }
        }
        let mut frame = Self {
            outcome: Arc::new(MeshOutcome {
                data: Arc::clone(&data),
                status: download(gpu, "status", 4 * u64::from(STATUS_WORDS))?,
                bins: download(gpu, "bins.total", 8)?,
                lists: lists.bands.iter().map(|_| download(gpu, "lists.total", 8)).collect::<Result<_>>()?,
                capacities: Needs { rounds: needs.rounds, ..needs },
                primitives: stage.count,
                repairs_overlaps: desc.repair.is_some() && desc.primitives == Primitives::Faces,
                unsorted: desc.unsorted,
                overlaps: None,
            }),
            scene: Arc::clone(scene),
            data,
            desc,
            canvas: target.clone(),
            frame,
            push,
            tiles,
            stage,
            lists,
            resolve: Vec::new(),
            chunks: 1,
            repair: None,
            overlaps: None,
            rounds: needs.rounds,
            image,
            flags,
            kbuffer,
            _knots: knots,
            table,
        };
        frame.chunks = match desc.chunk {
            // Lists are no longer than what a tile has.
            Some(chunk) => needs.longest_bin.div_ceil(chunk).max(1),
            None => 1,
        };
        frame.resolve = match frame.chunks {
            1 => vec![frame.resolve_pass(false, true, false)?],
            _ => vec![
                frame.resolve_pass(false, false, false)?,
                frame.resolve_pass(true, false, false)?,
                frame.resolve_pass(true, true, false)?,
            ],
        };
        if desc.repair.is_some() {
            frame.repair = Some(frame.resolve_pass(false, true, true)?);
        }
        if desc.repair.is_some() && desc.primitives == Primitives::Faces && needs.overlaps {
            let overlaps = Overlaps::new(
                scene,
                &desc,
                &frame.data,
                &frame.push,
                [tiles, across],
                &frame.flags,
                frame.resolve_resources()?,
                &frame.shading_constants(),
            )?;
            if let Some(outcome) = Arc::get_mut(&mut frame.outcome) {
                outcome.overlaps = Some(overlaps.status());
            }
            frame.overlaps = Some(overlaps);
        }
        Ok(frame)
    }

    /// Takes other ranks from the host. `false`, and nothing is changed, where a recording still reads those before.
    pub(crate) fn give_order(&mut self, order: &[u32]) -> bool {
        self.stage.give_order(order)
    }

    /// Primitives that are drawn.
    pub(crate) fn primitive_count(&self) -> u32 {
        self.stage.count
    }

    /// What passes that resolve lists bind.
    fn resolve_resources(&self) -> Result<Vec<(u32, Resource)>> {
        let image = || Resource::Storage(Arc::clone(&self.image));
        let kbuffer = |i: usize| self.kbuffer.get(i).map_or_else(image, |k| Resource::Storage(Arc::clone(k)));
        let lists = self.lists.list_fill.descriptors.resource(BINDING_LISTS);
        let Some(lists) = lists else { return Err(Error::invalid(self.desc.name, "no lists")) };
        let mut resources = shading(&self.scene, &self._knots, self.table.as_ref())?;
        resources.extend([
            (BINDING_CURSORS, Resource::ReadOnly(Arc::clone(&self.lists.cursors))),
            (BINDING_LISTS, lists),
            (BINDING_STATUS, Resource::Buffer(Arc::clone(&self.stage.status))),
            (BINDING_FLAGS, Resource::Buffer(Arc::clone(&self.flags))),
            (BINDING_ACCUMULATION, image()),
            (BINDING_KBUFFER_0, kbuffer(0)),
            (BINDING_KBUFFER_1, kbuffer(1)),
            (BINDING_KBUFFER_2, kbuffer(2)),
            (BINDING_KBUFFER_3, kbuffer(3)),
        ]);
        resources.extend(self.canvas.bounds(&self._knots.buffer));
        resources.extend(self.canvas.layers(&self._knots.buffer));
        Ok(resources)
    }

    fn shading_constants(&self) -> [SpecConstant; 4] {
        let integrator = (SPEC_INTEGRATOR, self.desc.segments.integrator.code());
        let canvas = &self.canvas;
        [(SPEC_KNOT_WALK, self._knots.walk), integrator, canvas.bounded(), canvas.layered()]
    }

    fn resolve_pass(&self, resume: bool, last: bool, repair: bool) -> Result<Dispatch> {
        let gpu = self.scene.gpu();
        let resources = self.resolve_resources()?;
        let mut constants = constants(&self.scene, &self.desc)?;
        constants.extend(self.shading_constants());
        constants.extend([
            (SPEC_K, if repair { REPAIR_K } else { self.desc.k }),
            (SPEC_RESUME, u32::from(resume)),
            (SPEC_LAST_CHUNK, u32::from(last)),
            (SPEC_REPAIR, u32::from(repair)),
            (SPEC_EYE_INSIDE, u32::from(eye_inside(&self.push))),
        ]);
        let part = if repair { "repair" } else { "resolve" };
        let shader = self.desc.repair.filter(|_| repair).unwrap_or(self.desc.resolve);
        pass(gpu, &format!("{}.{part}", self.desc.name), shader, &constants, &resources)
    }
}

impl Prepared for MeshFrame {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        let push = self.frame.push(view, &self.push)?;
        if eye_inside(&push) && !eye_inside(&self.push) {
            return Ok(false);
        }
        self.push = push;
        Ok(true)
    }

    fn measure(&self) -> DepthMeasure {
        DepthMeasure::of_frame(&self.frame)
    }

    fn image(&self) -> Option<&Arc<Image>> {
        Some(&self.image)
    }

    fn overflow(&self) -> Option<&Arc<Buffer>> {
        Some(&self.flags)
    }

    fn last_use(&self) -> Use {
        Use::ComputeReadWrite
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
        if let Some(table) = &self.table {
            recorder.assume_ready(&table.image);
        }
        self.stage.record(recorder, &self.push);
        self.lists.bin(recorder, &self.push, self.stage.count);
        recorder.copy_buffer("bins.total", self.lists.bins.total(), &self.outcome.bins, 8);
        recorder.release_to_host(&self.outcome.bins);
        for (i, band) in self.lists.bands.iter().enumerate() {
            recorder.clear_buffer("lists.clear", &self.lists.cursors);
            self.lists.list(recorder, &self.push, i, false);
            if let Some(scan) = self.lists.list_scans.get(i) {
                scan.record(recorder);
                recorder.copy_buffer("lists.total", scan.total(), &self.outcome.lists[i], 8);
                recorder.release_to_host(&self.outcome.lists[i]);
            }
            self.lists.list(recorder, &self.push, i, true);
            let groups = groups_of(band.tiles, 1);
            let push = MeshPush {
                count: band.tiles,
                band: band.first,
                capacity: self.lists.list_capacity,
                number: u32::MAX / 2,
                ..self.push
            };
            for chunk in 0..self.chunks {
                let which = match (self.chunks, chunk) {
                    (1, _) | (_, 0) => 0,
                    (chunks, chunk) if chunk + 1 < chunks => 1,
                    _ => 2,
                };
                let length = self.desc.chunk.unwrap_or(0);
                let push = match which {
                    0 if self.chunks == 1 => push,
                    2 => MeshPush { first: chunk * length, ..push },
                    _ => MeshPush { first: chunk * length, number: length, ..push },
                };
                if let Some(pass) = self.resolve.get(which) {
                    pass.record(recorder, &push, groups);
                }
            }
            if let Some(repair) = &self.repair {
                for round in 1..=self.rounds {
                    let push = MeshPush { bins: u32::from(round == self.rounds), ..push };
                    repair.record(recorder, &push, groups);
                }
            }
        }
        if let Some(overlaps) = &self.overlaps {
            overlaps.record(recorder, &self.push);
        }
        recorder.copy_buffer("status", &self.stage.status, &self.outcome.status, self.outcome.status.size());
        recorder.release_to_host(&self.outcome.status);
    }
}
