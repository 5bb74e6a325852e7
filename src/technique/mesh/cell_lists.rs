//! The passes of `abuffer.glsl`: from tiles for `abuffer`, from lists for the pixels that `abuffer`, `projected-tets` and `havs` draw again.

use crate::gpu::Bound;
use crate::gpu::shader::{ABUFFER_LISTS, ABUFFER_TILES, AbufferLists, AbufferTiles};
use crate::technique::mesh::list_inputs::{ListInputs, TileInputs};

/// Binds the shader that draws the cells of each tile.
pub(crate) fn draw(TileInputs { list, coverage, tile_walk, .. }: &TileInputs<'_>) -> Bound {
    ABUFFER_TILES.with(&AbufferTiles {
        accumulation: list.image.stored(),
        flags: list.flags.write(),
        status: list.status.write(),
        back_to_front: list.back_to_front,
        listed: 0,
        cell_scalars: list.cell_scalars,
        bounded: list.shading.bounded.clone(),
        coverage: coverage.clone(),
        hit_depths: list.shading.hit_depths.clone(),
        layers: list.shading.layers.clone(),
        optics: list.shading.optics.clone(),
        segments: list.shading.segments.clone(),
        tile_walk: tile_walk.clone(),
    })
}

/// Binds the shader that sorts and draws lists of cells.
pub(crate) fn repair(list: &ListInputs<'_>) -> Bound {
    ABUFFER_LISTS.with(&AbufferLists {
        accumulation: list.image.stored(),
        cursors: list.cursors.read(),
        flags: list.flags.write(),
        lists: list.lists.write(),
        status: list.status.write(),
        back_to_front: list.back_to_front,
        listed: list.listed,
        bounded: list.shading.bounded.clone(),
        hit_depths: list.shading.hit_depths.clone(),
        layers: list.shading.layers.clone(),
        optics: list.shading.optics.clone(),
        segments: list.shading.segments.clone(),
    })
}
