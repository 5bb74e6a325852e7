//! The pass that sorts and resolves lists of cells (`abuffer.glsl`). `abuffer` draws with it; `projected-tets` and `havs` repair
//! pixels with it.

use crate::gpu::Bound;
use crate::gpu::shader::{ABUFFER_COMPUTE, Abuffer};
use crate::technique::mesh::list_inputs::ListInputs;

/// Entries of the window that a list passes through before it is sorted in place.
pub(crate) const WINDOW: u32 = 7;

/// Binds the shader that sorts and resolves lists of cells.
pub(crate) fn resolve(list: &ListInputs<'_>) -> Bound {
    ABUFFER_COMPUTE.with(&Abuffer {
        accumulation: list.image.stored(),
        cursors: list.cursors.read(),
        flags: list.flags.write(),
        lists: list.lists.write(),
        status: list.status.write(),
        back_to_front: list.back_to_front,
        flagged: list.flagged,
        repair: list.repair,
        k: list.k,
        bounded: list.shading.bounded.clone(),
        layers: list.shading.layers.clone(),
        optics: list.shading.optics.clone(),
        segments: list.shading.segments.clone(),
    })
}
