//! What techniques for meshes share on the host: the lists of a frame (`glsl/mesh-lists.glsl`), and how they are drawn.
//!
//! A frame sees the points, finds each primitive's box and rank, sorts by rank, bins the primitives to tiles and from
//! there to pixels, and lets the technique resolve each pixel's list. The image is cut into bands of tiles whose lists
//! fit a buffer. How much room is needed is counted when a view is prepared; a frame that needs more says so.

use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;

use super::bins::{Bins, Fill};
use super::gpu_scene::{GpuScene, Knots, Table};
use super::grid_frame::own_image;
use super::grid_options::{Integrator, SegmentOptions};
use super::line_bounds::DepthMeasure;
use super::mesh_data::{MeshData, Needs};
use super::mesh_overlaps::{self, Overlaps};
use super::mesh_view::Frame;
use super::passes::{Pass, buffer, download, groups_of, pass, total, words};
use super::radix_sort::RadixSort;
use super::scan::Scan;
use super::{Canvas, Outcome, Prepared};
use crate::error::{Error, Result};
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_BIN_TABLE, BINDING_BINS, BINDING_BOXES, BINDING_CURSORS, BINDING_FLAGS,
    BINDING_KBUFFER_0, BINDING_KBUFFER_1, BINDING_KBUFFER_2, BINDING_KBUFFER_3, BINDING_KNOTS,
    BINDING_KNOTS_UNIFORM, BINDING_LISTS, BINDING_MESH_POINTS, BINDING_MESH_SCALARS, BINDING_ORDER,
    BINDING_PRIMITIVES, BINDING_RANK_KEYS, BINDING_STATUS, BINDING_TABLE, BINDING_TABLE_HEAD,
    BINDING_VIEW_POINTS, COUNT_BITS, FLAG_OVERLAPS, FLAG_REPAIRED, FLAG_UNSORTED, LIST_WINDOW,
    MESH_LISTS_BOXES, MESH_LISTS_LISTS, MESH_LISTS_POINTS, SPEC_BACK_TO_FRONT, SPEC_CELL_SCALARS, SPEC_CELLS,
    SPEC_EYE_INSIDE, SPEC_FILL, SPEC_INTEGRATOR, SPEC_K, SPEC_KNOT_WALK, SPEC_LAST_CHUNK, SPEC_REPAIR,
    SPEC_RESUME, STATUS_CUT, STATUS_LONGEST_BIN, STATUS_LOST, STATUS_NAN_KEYS, STATUS_OVERFLOW_PIXELS,
    STATUS_OVERLAPS, STATUS_UNREPAIRED, STATUS_WORDS, Shader, TILE, TILE_PIXELS,
};
use crate::gpu::sync::Use;
use crate::gpu::{
    Buffer, BufferUse, Commands, Gpu, Image, ImageDesc, Recorder, Resource, SpecConstant, TargetImage,
};
use crate::interface::MeshPush;
use crate::num::{self, f32_of};
use crate::scene::{TetScalars, View};

/// What is listed for pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Primitives {
    Faces,
    Cells,
}

/// How a technique for meshes draws.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeshDesc {
    pub(crate) name: &'static str,
    pub(crate) primitives: Primitives,
    pub(crate) segments: SegmentOptions,
    /// Extinction per scalar of the smoke model.
    pub(crate) smoke: f64,
    pub(crate) back_to_front: bool,
    /// Resolves lists.
    pub(crate) resolve: &'static Shader,
    /// Entries of the k-buffer.
    pub(crate) k: u32,
    /// Entries of a pixel that one dispatch takes; `None`: all.
    pub(crate) chunk: Option<u32>,
    /// Draws pixels whose sequence was not sorted again, sorted.
    pub(crate) repair: Option<&'static Shader>,
    /// What those pixels are counted as.
    pub(crate) unsorted: &'static str,
    /// Transmittance at which a line ends.
    pub(crate) stop: f64,
    /// Whether cells in which nothing is visible are left out.
    pub(crate) skip: bool,
}

/// Scalars that one may stand for the other, of the transfer function's domain: in the one segment behind two faces
/// that cannot be told apart, an error no greater than this.
const ALIKE: f64 = 1e-4;

/// Most entries of the k-buffer that a repair sorts with.
pub(super) const REPAIR_K: u32 = 15;

// A tile's counters hold what one dispatch lists; flags are bits.
const _: () = assert!(LIST_WINDOW < 1 << COUNT_BITS && FLAG_UNSORTED | FLAG_REPAIRED | FLAG_OVERLAPS == 7);

/// Tiles of an image whose lists are drawn together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Band {
    pub(super) first: u32,
    pub(super) tiles: u32,
}

/// Faces or cells on the device.
#[derive(Debug)]
pub(super) struct Geometry {
    pub(super) kind: Primitives,
    /// Points in radii from the centre.
    pub(super) points: Arc<Buffer>,
    pub(super) point_count: u32,
    pub(super) scalars: Arc<Buffer>,
    /// Whether scalars belong to cells.
    pub(super) cell_scalars: bool,
    pub(super) primitives: Arc<Buffer>,
    pub(super) count: u32,
}

/// What of a frame does not depend on how much the view needs.
#[derive(Debug)]
pub(super) struct Stage {
    name: &'static str,
    kind: Primitives,
    constants: Vec<SpecConstant>,
    pub(super) keys: Arc<Buffer>,
    pub(super) points: Pass,
    pub(super) boxes: Pass,
    pub(super) sort: RadixSort,
    pub(super) view_points: Arc<Buffer>,
    pub(super) primitives: Arc<Buffer>,
    pub(super) scalars: Arc<Buffer>,
    pub(super) order: Arc<Buffer>,
    pub(super) boxed: Arc<Buffer>,
    pub(super) status: Arc<Buffer>,
    pub(super) count: u32,
    pub(super) point_count: u32,
    /// Primitives by rank, from the host; sorted on the device where there are none.
    given: Option<Arc<Buffer>>,
}

/// Bins and lists.
#[derive(Debug)]
pub(super) struct Lists {
    pub(super) bins: Bins,
    pub(super) list_capacity: u32,
    pub(super) windows: u32,
    pub(super) bands: Vec<Band>,
    pub(super) cursors: Arc<Buffer>,
    pub(super) list_count: Pass,
    pub(super) list_scans: Vec<Scan>,
    pub(super) list_fill: Pass,
}

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct MeshFrame {
    scene: Arc<GpuScene>,
    data: Arc<MeshData>,
    desc: MeshDesc,
    canvas: Canvas,
    frame: Frame,
    push: MeshPush,
    tiles: u32,
    stage: Stage,
    lists: Lists,
    resolve: Vec<Pass>,
    chunks: u32,
    repair: Option<Pass>,
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
pub(super) struct MeshOutcome {
    pub(super) data: Arc<MeshData>,
    pub(super) status: Arc<Buffer>,
    pub(super) bins: Arc<Buffer>,
    pub(super) lists: Vec<Arc<Buffer>>,
    pub(super) capacities: Needs,
    pub(super) primitives: u32,
    /// Whether pixels in which cells overlap are to be drawn again, and the status of that.
    pub(super) repairs_overlaps: bool,
    /// What pixels whose sequence was not sorted are counted as.
    pub(super) unsorted: &'static str,
    pub(super) overlaps: Option<Arc<Buffer>>,
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
            Some(status) => mesh_overlaps::complete(status, &mut needs)?,
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

/// Refuses a frame in which the device has ended loops before they were through.
///
/// # Errors
///
/// [`Error::Unsupported`] with the number of pixels.
pub(super) fn check_loops(pixels: u32) -> Result<()> {
    if pixels == 0 {
        return Ok(());
    }
    Err(Error::unsupported(
        "this view of the mesh",
        format!(
            "{pixels} pixels need more turns of a loop than it makes; havs with chunk=5000 makes fewer in one"
        ),
    ))
}

/// Ranks from the host, to be copied from each frame.
fn given_order(gpu: &Gpu, order: &[u32]) -> Result<Arc<Buffer>> {
    let bytes: &[u8] = bytemuck::cast_slice(order);
    let mut buffer = Buffer::new(gpu, "order.given", num::wide(bytes.len()).max(4), BufferUse::Upload)?;
    if let Some(place) = buffer.bytes_mut().and_then(|place| place.get_mut(..bytes.len())) {
        place.copy_from_slice(bytes);
    }
    Ok(Arc::new(buffer))
}

impl Stage {
    pub(super) fn new(
        scene: &GpuScene,
        data: &MeshData,
        desc: &MeshDesc,
        order_given: Option<&[u32]>,
    ) -> Result<Self> {
        let gpu = scene.gpu();
        let mesh = scene.mesh()?;
        let margin = desc.skip.then(|| scene.margin(Some(&desc.segments)));
        let drawn = scene.primitives(desc.primitives, margin)?;
        let scalars = match drawn.scalars {
            Some(scalars) => scalars,
            None => data.scalars(gpu, mesh, scene.scene().transfer.domain())?,
        };
        let geometry = Geometry {
            kind: desc.primitives,
            points: data.points(gpu, mesh)?,
            point_count: num::count(mesh.points().len()),
            scalars,
            cell_scalars: matches!(mesh.scalars(), TetScalars::Cell(_)),
            primitives: drawn.buffer,
            count: drawn.count,
        };
        Self::of(gpu, desc.name, geometry, desc.back_to_front, order_given)
    }

    /// The same of faces or cells that are there already.
    pub(super) fn of(
        gpu: &Gpu,
        name: &'static str,
        geometry: Geometry,
        back_to_front: bool,
        order_given: Option<&[u32]>,
    ) -> Result<Self> {
        let Geometry { kind, points, point_count, scalars, cell_scalars, primitives, count } = geometry;
        let view_points = buffer(gpu, "view.points", 4 * u64::from(point_count))?;
        let keys = buffer(gpu, "order.keys", count.into())?;
        let order = buffer(gpu, "order", count.into())?;
        let boxed = buffer(gpu, "boxes", 2 * u64::from(count))?;
        let status = buffer(gpu, "status", STATUS_WORDS.into())?;
        let constants = listing_constants(kind, cell_scalars, back_to_front);
        let pass = |part: &str, shader, resources: &[(u32, Resource)]| {
            pass(gpu, &format!("{name}.{part}"), shader, &constants, resources)
        };
        Ok(Self {
            name,
            kind,
            points: pass(
                "points",
                &MESH_LISTS_POINTS,
                &[
                    (BINDING_MESH_POINTS, Resource::Buffer(points)),
                    (BINDING_MESH_SCALARS, Resource::Buffer(Arc::clone(&scalars))),
                    (BINDING_VIEW_POINTS, Resource::Buffer(Arc::clone(&view_points))),
                ],
            )?,
            boxes: pass(
                "boxes",
                &MESH_LISTS_BOXES,
                &[
                    (BINDING_PRIMITIVES, Resource::Buffer(Arc::clone(&primitives))),
                    (BINDING_VIEW_POINTS, Resource::ReadOnly(Arc::clone(&view_points))),
                    (BINDING_RANK_KEYS, Resource::Buffer(Arc::clone(&keys))),
                    (BINDING_ORDER, Resource::Buffer(Arc::clone(&order))),
                    (BINDING_BOXES, Resource::Buffer(Arc::clone(&boxed))),
                    (BINDING_STATUS, Resource::Buffer(Arc::clone(&status))),
                ],
            )?,
            sort: RadixSort::new(gpu, &format!("{name}.sort"), &keys, &order, count, 32)?,
            view_points,
            primitives,
            scalars,
            keys,
            order,
            boxed,
            status,
            count,
            point_count,
            given: match order_given {
                Some(order) => Some(given_order(gpu, order)?),
                None => None,
            },
            constants,
        })
    }

    pub(super) fn record(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        self.record_points(recorder, push);
        self.record_boxes(recorder, push);
        self.record_order(recorder);
    }

    /// Points as a view sees them.
    pub(super) fn record_points(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        recorder.clear_buffer("status.clear", &self.status);
        let push = MeshPush { count: self.point_count, ..*push };
        self.points.record(recorder, &push, groups_of(self.point_count, 64));
    }

    /// Boxes and keys.
    pub(super) fn record_boxes(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        let push = MeshPush { count: self.count, ..*push };
        self.boxes.record(recorder, &push, groups_of(self.count, 64));
    }

    /// Primitives by rank: by their keys, or as given.
    pub(super) fn record_order(&self, recorder: &mut Recorder<'_>) {
        match &self.given {
            Some(order) => recorder.copy_buffer("order", order, &self.order, self.order.size()),
            None => self.sort.record(recorder),
        }
    }

    /// Takes other ranks from the host. `false`, and nothing is changed, where a recording still reads those before.
    pub(super) fn give_order(&mut self, order: &[u32]) -> bool {
        let bytes: &[u8] = bytemuck::cast_slice(order);
        let place = self.given.as_mut().and_then(Arc::get_mut).and_then(Buffer::bytes_mut);
        let place = place.and_then(|place| place.get_mut(..bytes.len()));
        let Some(place) = place else { return false };
        place.copy_from_slice(bytes);
        true
    }
}

/// Specialisation constants that every pass of a technique shares.
pub(super) fn constants(scene: &GpuScene, desc: &MeshDesc) -> Result<Vec<SpecConstant>> {
    let cell_scalars = matches!(scene.mesh()?.scalars(), TetScalars::Cell(_));
    Ok(listing_constants(desc.primitives, cell_scalars, desc.back_to_front))
}

fn listing_constants(kind: Primitives, cell_scalars: bool, back_to_front: bool) -> Vec<SpecConstant> {
    vec![
        (SPEC_CELLS, u32::from(kind == Primitives::Cells)),
        (SPEC_CELL_SCALARS, u32::from(cell_scalars)),
        (SPEC_BACK_TO_FRONT, u32::from(back_to_front)),
    ]
}

/// What push constants tell of the scene and the technique.
///
/// # Errors
///
/// [`Error::Unsupported`] where knots are more than a line can be cut at on this device.
pub(super) fn shading_push(scene: &GpuScene, desc: &MeshDesc, knots: &Knots) -> Result<MeshPush> {
    /// Every device manages this many iterations; the probe runs only where the answer counts.
    const ALWAYS: u32 = 32_768;
    // A segment may span every knot, and a line has several that do.
    let turns = knots.count.saturating_mul(8).saturating_add(1024);
    if desc.segments.integrator == Integrator::Exact && turns > ALWAYS {
        let limit = scene.gpu().loop_limit()?;
        if turns > limit {
            return Err(Error::unsupported(
                format!("{} integrator=exact", desc.name),
                format!(
                    "{turns} loop iterations for this transfer function, the limit is {limit}; integral works"
                ),
            ));
        }
    }
    let transfer = &scene.scene().transfer;
    let [low, high] = transfer.domain();
    Ok(MeshPush {
        knots: knots.count,
        opaque: f32_of(desc.stop / scene.max_colour()),
        smoke: f32_of(desc.smoke),
        alike: f32_of((high - low) * ALIKE),
        ..MeshPush::default()
    })
}

/// What a segment's colour comes from.
pub(super) fn shading(
    scene: &GpuScene,
    knots: &Knots,
    table: Option<&Arc<Table>>,
) -> Result<Vec<(u32, Resource)>> {
    let knots = || Resource::Buffer(Arc::clone(&knots.buffer));
    let head = table.map_or_else(knots, |table| Resource::Buffer(Arc::clone(&table.buffer)));
    let texels = table.map_or_else(|| scene.no_table(), |table| Ok(Arc::clone(&table.image)))?;
    Ok(vec![
        (BINDING_KNOTS, knots()),
        (BINDING_KNOTS_UNIFORM, knots()),
        (BINDING_TABLE_HEAD, head),
        (BINDING_TABLE, Resource::Sampled(texels, vk::Filter::NEAREST)),
    ])
}

impl Lists {
    /// Room for what `needs` says.
    pub(super) fn new(
        gpu: &Gpu,
        stage: &Stage,
        tiles: u32,
        runs: u32,
        bands: Vec<Band>,
        needs: Needs,
    ) -> Result<Self> {
        let name = stage.name;
        let bins =
            Bins::new(gpu, name, [&stage.order, &stage.boxed, &stage.status], tiles, runs, needs.bins)?;
        let widest = bands.iter().map(|band| band.tiles).max().unwrap_or(1);
        let cursors = buffer(gpu, "lists.cursors", u64::from(widest) * u64::from(TILE_PIXELS))?;
        let lists = buffer(gpu, "lists", u64::from(needs.lists) * entry_words(stage.kind))?;
        let resources = [
            (BINDING_PRIMITIVES, Resource::Buffer(Arc::clone(&stage.primitives))),
            (BINDING_MESH_SCALARS, Resource::Buffer(Arc::clone(&stage.scalars))),
            (BINDING_VIEW_POINTS, Resource::ReadOnly(Arc::clone(&stage.view_points))),
            (BINDING_BOXES, Resource::ReadOnly(Arc::clone(&stage.boxed))),
            (BINDING_BIN_TABLE, Resource::ReadOnly(Arc::clone(&bins.table))),
            (BINDING_BINS, Resource::ReadOnly(Arc::clone(&bins.entries))),
            (BINDING_CURSORS, Resource::Buffer(Arc::clone(&cursors))),
            (BINDING_LISTS, Resource::Buffer(lists)),
            (BINDING_STATUS, Resource::Buffer(Arc::clone(&stage.status))),
            // Of no pixel, unless `havs_raster` has it otherwise.
            (BINDING_FLAGS, Resource::Buffer(Arc::clone(&stage.status))),
        ];
        let pass = |part: &str, shader, fill: bool| {
            let constants: Vec<_> =
                stage.constants.iter().copied().chain([(SPEC_FILL, u32::from(fill))]).collect();
            pass(gpu, &format!("{name}.{part}"), shader, &constants, &resources)
        };
        let band_scan =
            |band: &Band| Scan::new(gpu, &format!("{name}.lists"), &cursors, band.tiles * TILE_PIXELS);
        Ok(Self {
            bins,
            list_capacity: needs.lists,
            windows: needs.longest_bin.div_ceil(LIST_WINDOW).max(1),
            list_count: pass("lists.count", &MESH_LISTS_LISTS, false)?,
            list_scans: bands.iter().map(band_scan).collect::<Result<_>>()?,
            list_fill: pass("lists.fill", &MESH_LISTS_LISTS, true)?,
            bands,
            cursors,
        })
    }

    pub(super) fn bin(&self, recorder: &mut Recorder<'_>, push: &MeshPush, count: u32) {
        // As `tiles_across` has it.
        let across = num::u32_of(f64::from(2.0 * push.half_extent[0])).div_ceil(TILE);
        self.bins.record(recorder, across, [0, self.bins.tiles], count);
    }

    pub(super) fn list(&self, recorder: &mut Recorder<'_>, push: &MeshPush, band: usize, fill: bool) {
        let Some(Band { first, tiles }) = self.bands.get(band).copied() else { return };
        let groups = [tiles.div_ceil(8), 1, 1];
        for window in 0..self.windows {
            let push = MeshPush {
                count: tiles,
                band: first,
                first: window * LIST_WINDOW,
                number: LIST_WINDOW,
                runs: self.bins.runs,
                capacity: self.list_capacity,
                bins: self.bins.capacity,
                ..*push
            };
            let pass = if fill { &self.list_fill } else { &self.list_count };
            pass.record(recorder, &push, groups);
        }
    }
}

/// Words of an entry of a pixel's list.
fn entry_words(primitives: Primitives) -> u64 {
    match primitives {
        Primitives::Faces => 2,
        Primitives::Cells => 4,
    }
}

/// Whether the mesh may reach behind the eye.
fn eye_inside(push: &MeshPush) -> bool {
    // It lies within a unit of its centre.
    push.forward[3] > -1.001
}

/// A little more than was needed: views turn.
fn with_margin(need: u32) -> u32 {
    need.saturating_add(need / 4).saturating_add(64)
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
        let frame = Frame::of(mesh);
        let knots = scene.knots()?;
        let table = scene.table(&desc.segments)?;
        let push = frame.push(view, &shading_push(scene, &desc, &knots)?)?;
        let [width, height] = view.extent();
        let across = width.div_ceil(TILE);
        let tiles = across * height.div_ceil(TILE);
        let stage = Stage::new(scene, &data, &desc, order)?;

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
    pub(super) fn primitive_count(&self) -> u32 {
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

    fn resolve_pass(&self, resume: bool, last: bool, repair: bool) -> Result<Pass> {
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

/// What a view needs: runs of ranks, entries of bins and lists, bands. Draws its lists once, without keeping them.
pub(super) fn measure(
    gpu: &Gpu,
    stage: &Stage,
    known: &Mutex<Needs>,
    push: &MeshPush,
    tiles: u32,
    across: u32,
) -> Result<(u32, Needs, Vec<Band>)> {
    let Stage { name, order, boxed, count, .. } = stage;
    let fill = Fill::measure(gpu, name, [order, boxed], *count, [tiles, across], |recorder| {
        stage.record(recorder, push);
    })?;
    let runs = fill.runs;
    let submit = |recorder: Recorder<'_>| recorder.finish().1;
    let mut commands = Commands::new(gpu)?;
    let known = *known.lock().unwrap_or_else(PoisonError::into_inner);
    let whole = |what: &str, n: u64| {
        u32::try_from(n).map_err(|_| {
            Error::unsupported(format!("{name} of this view"), format!("{n} {what} in one frame"))
        })
    };
    let mut needs = Needs {
        bins: with_margin(whole("entries of bins", fill.entries())?.max(known.bins)),
        longest_bin: with_margin(fill.longest().max(known.longest_bin)),
        lists: 1,
        rounds: known.rounds.max(1),
        overlaps: known.overlaps,
    };

    // Fragments of each tile.
    let most_words = u64::from(gpu.inner.properties.limits.max_storage_buffer_range) / 4;
    let widest = u32::try_from(most_words / u64::from(TILE_PIXELS)).unwrap_or(u32::MAX).min(tiles);
    let trial: Vec<Band> = (0..tiles)
        .step_by(num::index(widest))
        .map(|first| Band { first, tiles: widest.min(tiles - first) })
        .collect();
    let lists = Lists::new(gpu, stage, tiles, runs, trial.clone(), needs)?;
    let mut fragments = Vec::with_capacity(num::index(tiles));
    for (i, band) in trial.iter().enumerate() {
        let bytes = 4 * u64::from(band.tiles) * u64::from(TILE_PIXELS);
        let host = download(gpu, "fragments", bytes)?;
        let keep = {
            let mut recorder = Recorder::new(gpu, commands.begin()?, None);
            stage.record(&mut recorder, push);
            lists.bin(&mut recorder, push, stage.count);
            recorder.clear_buffer("lists.clear", &lists.cursors);
            lists.list(&mut recorder, push, i, false);
            recorder.copy_buffer("fragments", &lists.cursors, &host, bytes);
            recorder.release_to_host(&host);
            submit(recorder)
        };
        commands.submit(keep, name)?;
        let counts = words(&host.host_copy()?);
        fragments.extend(
            counts
                .chunks_exact(num::index(TILE_PIXELS))
                .map(|tile| tile.iter().map(|&n| u64::from(n)).sum::<u64>()),
        );
    }

    // Bands as wide as a buffer holds.
    let most = most_words / entry_words(stage.kind);
    let most = most - most / 5 - 64;
    let mut bands = vec![Band { first: 0, tiles: 0 }];
    let (mut sum, mut fullest) = (0_u64, 0_u64);
    for (tile, &count) in (0..tiles).zip(&fragments) {
        if count > most {
            return Err(Error::unsupported(
                format!("{name} of this view"),
                format!("{count} fragments in one tile of {TILE} pixels; {most} fit a buffer"),
            ));
        }
        let last = bands.len() - 1;
        if sum + count > most || bands[last].tiles >= widest {
            bands.push(Band { first: tile, tiles: 1 });
            sum = count;
        } else {
            bands[last].tiles += 1;
            sum += count;
        }
        fullest = fullest.max(sum);
    }
    needs.lists = with_margin(whole("fragments", fullest)?);
    if bands.len() == 1 {
        needs.lists = needs.lists.max(known.lists.min(num::u32_of(num::f64_of_u64(most))));
    }
    Ok((runs, needs, bands))
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

    fn passes(&self) -> u32 {
        let bands = num::count(self.lists.bands.len());
        // Status, points, boxes, a sort of at most four digits; bins; lists and what is drawn of them.
        let sort = 16;
        let overlaps = self.overlaps.as_ref().map_or(0, Overlaps::passes);
        overlaps + 7 + sort + 6 + bands * (4 + 2 * self.lists.windows + self.chunks + self.rounds) + 2 + bands
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
