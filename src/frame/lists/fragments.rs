//! The fragments of each pixel, in lists by rank (`mesh-lists.glsl`), and bands: tiles that are drawn together because their
//! entries fit one buffer.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::lists::ranking::Ranking;
use crate::gpu::shader::{COUNT_BITS, MESH_LISTS_COMPUTE, MeshLists, TILE, TILE_PIXELS};
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::bins::Bins;
use crate::primitives::dispatch::{Dispatch, buffer, groups_of, pass};
use crate::primitives::scan::{Scan, WorkSplit};
use crate::resident::mesh::{Needs, Primitives};

/// Bins of tiles and lists of pixels, with the passes that write them.
///
/// A list is counted, then its place is the prefix sum of the counts, then it is filled.
#[derive(Debug)]
pub(crate) struct Lists {
    pub(crate) bins: Arc<Bins>,
    /// Entries that the lists of one band may have.
    pub(crate) list_capacity: u32,
    /// Entries of a bin that one dispatch takes.
    window: u32,
    /// Dispatches that count, or fill, the lists of a band: each takes the next window of each bin.
    windows: u32,
    pub(crate) bands: Vec<Band>,
    /// Counts of each pixel of a band; after the scan and the fill, where its list ends.
    pub(crate) cursors: Arc<Buffer>,
    /// Entries of all lists of a band.
    pub(crate) entries: Arc<Buffer>,
    list_count: Dispatch,
    /// Prefix sums over the pixels of each band.
    pub(crate) list_scans: Vec<Scan>,
    list_fill: Dispatch,
}

impl Lists {
    /// Allocates the capacities in `needs` for lists from `bins`. With the flags of pixels, only the fragments
    /// of those with given flags are listed.
    pub(crate) fn new(
        gpu: &Gpu,
        ranking: &Ranking,
        bins: Arc<Bins>,
        bands: Vec<Band>,
        needs: Needs,
        flagged: Option<(&Arc<Buffer>, u32)>,
    ) -> Result<Self> {
        let name = ranking.name;
        let widest = bands.iter().map(|band| band.tiles).max().unwrap_or(1);
        let cursors = buffer(gpu, "lists.cursors", u64::from(widest) * u64::from(TILE_PIXELS))?;
        let entries = buffer(gpu, "lists", u64::from(needs.lists) * entry_words(ranking.kind))?;
        let pass = |part: &str, fill: bool| {
            let inputs = MeshLists {
                boxes: ranking.boxed.read(),
                bin_ends: bins.ends.read(),
                bins: bins.entries.read(),
                cursors: cursors.write(),
                lists: entries.write(),
                status: ranking.status.write(),
                // A binding must hold something; only passes with `flagged` read flags.
                flags: flagged.map_or(&ranking.boxed, |(flags, _)| flags).read(),
                cell_scalars: ranking.cell_scalars,
                back_to_front: ranking.back_to_front,
                fill,
                listed: flagged.map_or(0, |(_, listed)| listed),
                coverage: ranking.coverage(),
            };
            pass(gpu, &format!("{name}.{part}"), &MESH_LISTS_COMPUTE.with(&inputs))
        };
        // An entry takes at most one iteration for each pixel of its tile; the shader counts the entries of a pixel in COUNT_BITS bits.
        let window = (gpu.turns()? / (TILE_PIXELS + 2)).clamp(1, (1 << COUNT_BITS) - 1);
        let split = WorkSplit::of(gpu);
        let band_scan =
            |band: &Band| Scan::new(gpu, &format!("{name}.lists"), &cursors, band.tiles * TILE_PIXELS, split);
        let (list_count, list_fill) = (pass("lists.count", false)?, pass("lists.fill", true)?);
        Ok(Self {
            bins,
            list_capacity: needs.lists,
            window,
            windows: needs.longest_bin.div_ceil(window).max(1),
            list_count,
            list_scans: bands.iter().map(band_scan).collect::<Result<_>>()?,
            list_fill,
            bands,
            cursors,
            entries,
        })
    }

    /// Records the bins of all tiles.
    pub(crate) fn bin(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        self.bins.record(recorder, tiles_across(push), [0, self.bins.tiles]);
    }

    /// Records the pass that counts the lists of a band, or with `fill` the one that writes them. The bins are those from the tile
    /// `push.binned` on.
    pub(crate) fn list(&self, recorder: &mut Recorder<'_>, push: &MeshPush, band: usize, fill: bool) {
        let Some(Band { first, tiles }) = self.bands.get(band).copied() else { return };
        let groups = groups_of(tiles, 8);
        for window in 0..self.windows {
            let push = MeshPush {
                count: tiles,
                band: first,
                first: window * self.window,
                number: self.window,
                capacity: self.list_capacity,
                ..*push
            };
            let pass = if fill { &self.list_fill } else { &self.list_count };
            pass.record(recorder, &push, groups);
        }
    }
}

/// Returns the tiles in a row of an image: the same number as `tiles_across` in the shaders.
pub(crate) fn tiles_across(push: &MeshPush) -> u32 {
    num::u32_of(f64::from(2.0 * push.half_extent[0])).div_ceil(TILE)
}

/// Returns the number of 32-bit words of a list's entry.
pub(crate) fn entry_words(primitives: Primitives) -> u64 {
    match primitives {
        Primitives::Faces => 2,
        Primitives::Cells => 4,
    }
}

/// Consecutive tiles of an image that are drawn together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Band {
    /// Number of the first tile, row by row.
    pub(crate) first: u32,
    /// Number of tiles.
    pub(crate) tiles: u32,
}

/// Cuts an image into bands of at most `soft` entries and `widest` tiles each; a tile of more entries is a band of its own.
///
/// `entries` are those of each tile. Returns the bands, and the entries of the fullest.
///
/// # Errors
///
/// The entries of a single tile that exceeds `hard`.
pub(crate) fn cut_into_bands(
    entries: impl IntoIterator<Item = u64>,
    [soft, hard]: [u64; 2],
    widest: u32,
) -> std::result::Result<(Vec<Band>, u64), u64> {
    let mut bands = vec![Band { first: 0, tiles: 0 }];
    let (mut sum, mut fullest) = (0_u64, 0_u64);
    for (tile, count) in (0_u32..).zip(entries) {
        if count > hard {
            return Err(count);
        }
        let last = bands.len() - 1;
        if (sum + count > soft && bands[last].tiles > 0) || bands[last].tiles >= widest {
            bands.push(Band { first: tile, tiles: 1 });
            sum = count;
        } else {
            bands[last].tiles += 1;
            sum += count;
        }
        fullest = fullest.max(sum);
    }
    Ok((bands, fullest))
}
