//! The primitives of each tile by rank, and for each pixel which of them its line meets (`mesh-tiles.glsl`).

use std::sync::Arc;

use crate::error::Result;
use crate::frame::lists::bands::Band;
use crate::frame::lists::ranking::Ranking;
use crate::gpu::shader::{
    HIT_PAIRS, MESH_TILES_HITS, MESH_TILES_MARK, MESH_TILES_MASKS, MeshTilesHits, MeshTilesMark,
    MeshTilesMasks, TILE, TileWalk,
};
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::bins::Bins;
use crate::primitives::dispatch::{Dispatch, buffer, groups_of, pass};

/// The bins of a band, and the hits of its pixels, with the passes that write them.
#[derive(Debug)]
pub(crate) struct Hits {
    bins: Arc<Bins>,
    hits: Arc<Buffer>,
    /// Marks the flagged pixels, where only their tiles have hits.
    mark: Option<Dispatch>,
    masks_of: Dispatch,
    hits_of: Dispatch,
}

/// The flags of pixels, a word each, and the bits of those that are drawn from lists.
pub(crate) type Flagged<'a> = (&'a Arc<Buffer>, u32);

impl Hits {
    /// Makes the hits of the tiles of `bins`; with `flagged` only of those that have flagged pixels.
    pub(crate) fn new(
        gpu: &Gpu,
        ranking: &Ranking,
        bins: Arc<Bins>,
        flagged: Option<Flagged<'_>>,
    ) -> Result<Arc<Self>> {
        let name = |part: &str| format!("{}.{part}", ranking.name);
        let words = 2 * u64::from(bins.capacity).next_multiple_of(HIT_PAIRS.into());
        // Where the sort of the pairs mixes keys and values, what it leaves between two digits has the size of the hits.
        let hits = match bins.scratch() {
            scratch if scratch.size() >= 4 * words => Arc::clone(scratch),
            _ => buffer(gpu, "hits", words)?,
        };
        let mark = |(flags, listed): Flagged<'_>| {
            let Some(marked) = &bins.marked else { return Ok(None) };
            let inputs = MeshTilesMark { flags: flags.read(), marked: marked.write(), listed };
            pass(gpu, &name("mark"), &MESH_TILES_MARK.with(&inputs)).map(Some)
        };
        let mark = flagged.map(mark).transpose()?.flatten();
        let masks_of = MESH_TILES_MASKS.with(&MeshTilesMasks {
            bins: bins.entries.read(),
            bin_ends: bins.ends.read(),
            bin_tiles: bins.of_pairs.read(),
            boxes: ranking.boxed.read(),
            // A binding must hold something.
            marked: bins.marked.as_ref().unwrap_or(&bins.ends).read(),
            hits: hits.write(),
            cell_scalars: ranking.cell_scalars,
            listed: flagged.map_or(0, |(_, listed)| listed),
            coverage: ranking.coverage(),
        });
        let hits_of = MESH_TILES_HITS.with(&MeshTilesHits { bin_ends: bins.ends.read(), hits: hits.write() });
        let masks_of = pass(gpu, &name("masks"), &masks_of)?;
        let hits_of = pass(gpu, &name("hits"), &hits_of)?;
        Ok(Arc::new(Self { bins, hits, mark, masks_of, hits_of }))
    }

    /// Returns the inputs of shaders that walk through the hits.
    pub(crate) fn walk(&self) -> TileWalk {
        TileWalk { bins: self.bins.entries.read(), bin_ends: self.bins.ends.read(), hits: self.hits.read() }
    }

    /// Records the bins and the hits of a band, and a copy of the bins' total to `total`.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        push: &MeshPush,
        band: Band,
        total: Option<&Arc<Buffer>>,
    ) {
        let across = tiles_across(push);
        let push = MeshPush { count: band.tiles, band: band.first, ..*push };
        if let (Some(mark), Some(marked)) = (&self.mark, &self.bins.marked) {
            recorder.clear_buffer("marked.clear", marked);
            mark.record(recorder, &push, groups_of(band.tiles, 1));
        }
        self.bins.record(recorder, across, [band.first, band.tiles]);
        self.masks_of.record(recorder, &push, groups_of(self.bins.capacity, 64));
        let rows = self.bins.capacity.div_ceil(32) * TILE;
        self.hits_of.record(recorder, &push, groups_of(rows, 64));
        if let Some(total) = total {
            recorder.copy_buffer("bins.total", self.bins.total(), total, 8);
            recorder.release_to_host(total);
        }
    }
}

/// Returns the tiles in a row of an image: the same number as `tiles_across` in the shaders.
fn tiles_across(push: &MeshPush) -> u32 {
    num::u32_of(f64::from(2.0 * push.half_extent[0])).div_ceil(TILE)
}
