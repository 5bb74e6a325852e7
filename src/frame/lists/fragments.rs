//! The fragments of each pixel, in lists by rank (`mesh-lists.glsl`).

use std::sync::Arc;

use crate::error::Result;
use crate::frame::lists::bands::Band;
use crate::frame::lists::hits::{Flagged, Hits};
use crate::frame::lists::ranking::Ranking;
use crate::gpu::shader::{MESH_LISTS_COUNT, MESH_LISTS_FILL, MeshListsCount, MeshListsFill, TILE_PIXELS};
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::interface::MeshPush;
use crate::primitives::dispatch::{Dispatch, buffer, groups_of, pass};
use crate::primitives::scan::{Scan, WorkSplit};
use crate::resident::mesh::Primitives;

/// Lists of pixels, with the passes that write them.
///
/// A list is counted, then its place is the prefix sum of the counts, then it is filled.
#[derive(Debug)]
pub(crate) struct Lists {
    /// Entries that the lists of one band may have.
    pub(crate) capacity: u32,
    pub(crate) bands: Vec<Band>,
    /// Counts of each pixel of a band; after the scan and the fill, where its list ends.
    pub(crate) cursors: Arc<Buffer>,
    /// Entries of all lists of a band.
    pub(crate) entries: Arc<Buffer>,
    count: Dispatch,
    /// Prefix sums over the pixels of each band.
    scans: Vec<Scan>,
    fill: Dispatch,
}

impl Lists {
    /// Allocates `capacity` entries for lists from `hits`, band by band. With `flagged` only flagged pixels have lists.
    pub(crate) fn new(
        gpu: &Gpu,
        ranking: &Ranking,
        hits: &Hits,
        bands: Vec<Band>,
        capacity: u32,
        flagged: Option<Flagged<'_>>,
    ) -> Result<Self> {
        let name = |part: &str| format!("{}.lists{part}", ranking.name);
        let widest = bands.iter().map(|band| band.tiles).max().unwrap_or(1);
        let cursors = buffer(gpu, "lists.cursors", u64::from(widest) * u64::from(TILE_PIXELS))?;
        let entries = buffer(gpu, "lists", u64::from(capacity) * entry_words(ranking.kind))?;
        let (flags, listed) = flagged.unwrap_or((&ranking.boxed, 0));
        let count = MESH_LISTS_COUNT.with(&MeshListsCount {
            cursors: cursors.write(),
            flags: flags.read(),
            status: ranking.status.write(),
            listed,
            tile_walk: hits.walk(),
        });
        let fill = MESH_LISTS_FILL.with(&MeshListsFill {
            cursors: cursors.write(),
            flags: flags.read(),
            lists: entries.write(),
            status: ranking.status.write(),
            back_to_front: ranking.back_to_front,
            by_planes: ranking.by_planes,
            cell_scalars: ranking.cell_scalars,
            listed,
            coverage: ranking.coverage(),
            tile_walk: hits.walk(),
        });
        let split = WorkSplit::of(gpu);
        let scan = |band: &Band| Scan::new(gpu, &name(""), &cursors, band.tiles * TILE_PIXELS, split);
        Ok(Self {
            count: pass(gpu, &name(".count"), &count)?,
            fill: pass(gpu, &name(".fill"), &fill)?,
            scans: bands.iter().map(scan).collect::<Result<_>>()?,
            capacity,
            bands,
            cursors,
            entries,
        })
    }

    /// Returns the push constants of passes over the lists of tiles, which belong to the lists of a band.
    pub(crate) fn push(&self, push: &MeshPush, tiles: Band) -> MeshPush {
        let holds = |band: &&Band| tiles.first.wrapping_sub(band.first) < band.tiles;
        let first = self.bands.iter().find(holds).map_or(tiles.first, |band| band.first);
        MeshPush { count: tiles.tiles, band: tiles.first, first, number: 0, capacity: self.capacity, ..*push }
    }

    /// Records the pass that counts the entries of tiles; with `adds` to those that were counted before.
    pub(crate) fn record_count(&self, recorder: &mut Recorder<'_>, push: &MeshPush, tiles: Band, adds: bool) {
        let push = MeshPush { number: adds.into(), ..self.push(push, tiles) };
        self.count.record(recorder, &push, groups_of(tiles.tiles, 1));
    }

    /// Records the prefix sum over the counts of a band, and a copy of the number of its entries to `total`.
    pub(crate) fn record_places(
        &self,
        recorder: &mut Recorder<'_>,
        band: usize,
        total: Option<&Arc<Buffer>>,
    ) {
        let Some(scan) = self.scans.get(band) else { return };
        scan.record(recorder);
        if let Some(total) = total {
            recorder.copy_buffer("lists.total", scan.total(), total, 8);
            recorder.release_to_host(total);
        }
    }

    /// Records the pass that appends what pixels of tiles meet to their lists.
    pub(crate) fn record_fill(&self, recorder: &mut Recorder<'_>, push: &MeshPush, tiles: Band) {
        self.fill.record(recorder, &self.push(push, tiles), groups_of(tiles.tiles, 1));
    }
}

/// Returns the number of 32-bit words of a list's entry.
pub(crate) fn entry_words(primitives: Primitives) -> u64 {
    match primitives {
        Primitives::Faces => 2,
        Primitives::Cells => 4,
    }
}
