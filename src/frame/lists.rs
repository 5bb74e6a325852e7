//! The fragments of each pixel in lists by rank: of cells or faces of a mesh, or of triangles (`glsl/mesh/mesh-lists.glsl`).

use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::gpu::shader::{
    BINDING_BIN_TABLE, BINDING_BINS, BINDING_BOXES, BINDING_CURSORS, BINDING_FLAGS, BINDING_LISTS,
    BINDING_MESH_POINTS, BINDING_MESH_SCALARS, BINDING_ORDER, BINDING_PRIMITIVES, BINDING_RANK_KEYS,
    BINDING_STATUS, BINDING_VIEW_POINTS, LIST_WINDOW, MESH_LISTS_BOXES, MESH_LISTS_LISTS, MESH_LISTS_POINTS,
    SPEC_BACK_TO_FRONT, SPEC_CELL_SCALARS, SPEC_CELLS, SPEC_FILL, STATUS_WORDS, TILE, TILE_PIXELS,
};
use crate::gpu::{Buffer, BufferUse, Commands, Gpu, Recorder, Resource, SpecConstant};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::bins::{Bins, Fill};
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass, words};
use crate::primitives::radix_sort::RadixSort;
use crate::primitives::scan::Scan;
use crate::resident::mesh::{Needs, Primitives};

/// Tiles of an image whose lists are drawn together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Band {
    pub(crate) first: u32,
    pub(crate) tiles: u32,
}

/// Faces or cells on the device.
#[derive(Debug)]
pub(crate) struct Geometry {
    pub(crate) kind: Primitives,
    /// Points in radii from the centre.
    pub(crate) points: Arc<Buffer>,
    pub(crate) point_count: u32,
    pub(crate) scalars: Arc<Buffer>,
    /// Whether scalars belong to cells.
    pub(crate) cell_scalars: bool,
    pub(crate) primitives: Arc<Buffer>,
    pub(crate) count: u32,
}

/// What of a frame does not depend on how much the view needs.
#[derive(Debug)]
pub(crate) struct Stage {
    name: &'static str,
    kind: Primitives,
    constants: Vec<SpecConstant>,
    pub(crate) keys: Arc<Buffer>,
    pub(crate) points: Dispatch,
    pub(crate) boxes: Dispatch,
    pub(crate) sort: RadixSort,
    pub(crate) view_points: Arc<Buffer>,
    pub(crate) primitives: Arc<Buffer>,
    pub(crate) scalars: Arc<Buffer>,
    pub(crate) order: Arc<Buffer>,
    pub(crate) boxed: Arc<Buffer>,
    pub(crate) status: Arc<Buffer>,
    pub(crate) count: u32,
    pub(crate) point_count: u32,
    /// Primitives by rank, from the host; sorted on the device where there are none.
    given: Option<Arc<Buffer>>,
}

/// Bins and lists.
#[derive(Debug)]
pub(crate) struct Lists {
    pub(crate) bins: Bins,
    pub(crate) list_capacity: u32,
    pub(crate) windows: u32,
    pub(crate) bands: Vec<Band>,
    pub(crate) cursors: Arc<Buffer>,
    pub(crate) list_count: Dispatch,
    pub(crate) list_scans: Vec<Scan>,
    pub(crate) list_fill: Dispatch,
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
    pub(crate) fn of(
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

    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        self.record_points(recorder, push);
        self.record_boxes(recorder, push);
        self.record_order(recorder);
    }

    /// Points as a view sees them.
    pub(crate) fn record_points(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        recorder.clear_buffer("status.clear", &self.status);
        let push = MeshPush { count: self.point_count, ..*push };
        self.points.record(recorder, &push, groups_of(self.point_count, 64));
    }

    /// Boxes and keys.
    pub(crate) fn record_boxes(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        let push = MeshPush { count: self.count, ..*push };
        self.boxes.record(recorder, &push, groups_of(self.count, 64));
    }

    /// Primitives by rank: by their keys, or as given.
    pub(crate) fn record_order(&self, recorder: &mut Recorder<'_>) {
        match &self.given {
            Some(order) => recorder.copy_buffer("order", order, &self.order, self.order.size()),
            None => self.sort.record(recorder),
        }
    }

    /// Takes other ranks from the host. `false`, and nothing is changed, where a recording still reads those before.
    pub(crate) fn give_order(&mut self, order: &[u32]) -> bool {
        let bytes: &[u8] = bytemuck::cast_slice(order);
        let place = self.given.as_mut().and_then(Arc::get_mut).and_then(Buffer::bytes_mut);
        let place = place.and_then(|place| place.get_mut(..bytes.len()));
        let Some(place) = place else { return false };
        place.copy_from_slice(bytes);
        true
    }
}

impl Lists {
    /// Room for what `needs` says.
    pub(crate) fn new(
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

    pub(crate) fn bin(&self, recorder: &mut Recorder<'_>, push: &MeshPush, count: u32) {
        // As `tiles_across` has it.
        let across = num::u32_of(f64::from(2.0 * push.half_extent[0])).div_ceil(TILE);
        self.bins.record(recorder, across, [0, self.bins.tiles], count);
    }

    pub(crate) fn list(&self, recorder: &mut Recorder<'_>, push: &MeshPush, band: usize, fill: bool) {
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

/// A little more than was needed: views turn.
fn with_margin(need: u32) -> u32 {
    need.saturating_add(need / 4).saturating_add(64)
}

/// What a view needs: runs of ranks, entries of bins and lists, bands. Draws its lists once, without keeping them.
pub(crate) fn measure(
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

pub(crate) fn listing_constants(
    kind: Primitives,
    cell_scalars: bool,
    back_to_front: bool,
) -> Vec<SpecConstant> {
    vec![
        (SPEC_CELLS, u32::from(kind == Primitives::Cells)),
        (SPEC_CELL_SCALARS, u32::from(cell_scalars)),
        (SPEC_BACK_TO_FRONT, u32::from(back_to_front)),
    ]
}
