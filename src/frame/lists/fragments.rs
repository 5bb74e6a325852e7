//! The fragments of each pixel, in lists by rank (`mesh-lists.glsl`).

use std::sync::Arc;

use crate::error::Result;
use crate::frame::lists::bands::Band;
use crate::frame::lists::ranking::Ranking;
use crate::gpu::shader::{
    BINDING_BIN_TABLE, BINDING_BINS, BINDING_BOXES, BINDING_CURSORS, BINDING_FLAGS, BINDING_LISTS,
    BINDING_MESH_SCALARS, BINDING_PRIMITIVES, BINDING_STATUS, BINDING_VIEW_POINTS, LIST_WINDOW,
    MESH_LISTS_LISTS, SPEC_FILL, SPEC_FLAGGED, TILE, TILE_PIXELS,
};
use crate::gpu::{Buffer, Gpu, Recorder, Resource};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::bins::Bins;
use crate::primitives::dispatch::{Dispatch, buffer, pass};
use crate::primitives::scan::Scan;
use crate::resident::mesh::{Needs, Primitives};

/// Bins of tiles and lists of pixels, with the passes that write them.
///
/// A list is counted, then its place is the prefix sum of the counts, then it is filled.
#[derive(Debug)]
pub(crate) struct Lists {
    pub(crate) bins: Bins,
    /// Entries that the lists of one band may have.
    pub(crate) list_capacity: u32,
    /// Dispatches that count, or fill, the lists of a band: each takes the next `LIST_WINDOW` entries of a bin.
    pub(crate) windows: u32,
    pub(crate) bands: Vec<Band>,
    /// Counts of each pixel of a band; after the scan and the fill, where its list ends.
    pub(crate) cursors: Arc<Buffer>,
    /// Entries of all lists of a band.
    pub(crate) entries: Arc<Buffer>,
    list_count: Dispatch,
    /// Prefix sums over the pixels of each band.
    pub(crate) list_scans: Vec<Scan>,
    pub(crate) list_fill: Dispatch,
}

impl Lists {
    /// Allocates the capacities in `needs`; bins are made in `runs` runs of ranks.
    pub(crate) fn new(
        gpu: &Gpu,
        ranking: &Ranking,
        tiles: u32,
        runs: u32,
        bands: Vec<Band>,
        needs: Needs,
    ) -> Result<Self> {
        let name = ranking.name;
        let bins =
            Bins::new(gpu, name, [&ranking.order, &ranking.boxed, &ranking.status], tiles, runs, needs.bins)?;
        let widest = bands.iter().map(|band| band.tiles).max().unwrap_or(1);
        let cursors = buffer(gpu, "lists.cursors", u64::from(widest) * u64::from(TILE_PIXELS))?;
        let entries = buffer(gpu, "lists", u64::from(needs.lists) * entry_words(ranking.kind))?;
        let resources = [
            (BINDING_PRIMITIVES, Resource::Buffer(Arc::clone(&ranking.primitives))),
            (BINDING_MESH_SCALARS, Resource::Buffer(Arc::clone(&ranking.scalars))),
            (BINDING_VIEW_POINTS, Resource::ReadOnly(Arc::clone(&ranking.view_points))),
            (BINDING_BOXES, Resource::ReadOnly(Arc::clone(&ranking.boxed))),
            (BINDING_BIN_TABLE, Resource::ReadOnly(Arc::clone(&bins.table))),
            (BINDING_BINS, Resource::ReadOnly(Arc::clone(&bins.entries))),
            (BINDING_CURSORS, Resource::Buffer(Arc::clone(&cursors))),
            (BINDING_LISTS, Resource::Buffer(Arc::clone(&entries))),
            (BINDING_STATUS, Resource::Buffer(Arc::clone(&ranking.status))),
            // A binding must hold something; only passes with SPEC_FLAGGED read flags.
            (BINDING_FLAGS, Resource::Buffer(Arc::clone(&ranking.status))),
        ];
        let pass = |part: &str, shader, fill: bool| {
            let constants: Vec<_> =
                ranking.constants.iter().copied().chain([(SPEC_FILL, u32::from(fill))]).collect();
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
            entries,
        })
    }

    /// Lists the fragments of flagged pixels only, and bins faces only if a pixel is flagged.
    pub(crate) fn restrict_to_flagged(
        &mut self,
        gpu: &Gpu,
        ranking: &Ranking,
        flags: &Arc<Buffer>,
    ) -> Result<()> {
        // Cells are listed only once a frame has flagged a pixel, so their bins are always needed.
        if ranking.kind == Primitives::Faces {
            self.bins.only_where_flagged(gpu)?;
        }
        let passes =
            [(&mut self.list_count, &MESH_LISTS_LISTS, 0), (&mut self.list_fill, &MESH_LISTS_LISTS, 1)];
        for (old, shader, fill) in passes {
            let resource = |&(binding, _): &(u32, _)| {
                let found = match binding {
                    BINDING_FLAGS => Some(Resource::ReadOnly(Arc::clone(flags))),
                    _ => old.descriptors.resource(binding),
                };
                found.map(|found| (binding, found))
            };
            let resources: Vec<_> = shader.bindings.iter().filter_map(resource).collect();
            let constants: Vec<_> =
                ranking.constants.iter().copied().chain([(SPEC_FILL, fill), (SPEC_FLAGGED, 1)]).collect();
            *old = pass(gpu, &old.name, shader, &constants, &resources)?;
        }
        Ok(())
    }

    /// Records the bins of all tiles.
    pub(crate) fn bin(&self, recorder: &mut Recorder<'_>, push: &MeshPush, count: u32) {
        // The same number as `tiles_across` in the shaders.
        let across = num::u32_of(f64::from(2.0 * push.half_extent[0])).div_ceil(TILE);
        self.bins.record(recorder, across, [0, self.bins.tiles], count);
    }

    /// Records the pass that counts the lists of a band, or with `fill` the one that writes them.
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

/// Returns the number of 32-bit words of a list's entry.
pub(crate) fn entry_words(primitives: Primitives) -> u64 {
    match primitives {
        Primitives::Faces => 2,
        Primitives::Cells => 4,
    }
}
