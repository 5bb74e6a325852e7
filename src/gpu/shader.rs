//! Compiled shader modules with their bindings, which `build.rs` has read from the SPIR-V.

pub(crate) use crate::interface::constants::*;

/// Pipeline stage of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Stage {
    Vertex,
    Fragment,
    Compute,
}

/// Kind of a descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum BindingKind {
    UniformBuffer,
    StorageBuffer,
    SampledImage,
    StorageImage,
}

/// One entry of one GLSL file, compiled.
#[derive(Debug)]
pub(crate) struct Shader {
    /// File and entry, such as `SLICES_3D_FRAGMENT`; unique.
    pub(crate) name: &'static str,
    pub(crate) stage: Stage,
    /// Size of the push constants in bytes; 0 if there are none.
    pub(crate) push_bytes: u32,
    /// Bindings of set 0, ascending.
    pub(crate) bindings: &'static [(u32, BindingKind)],
    /// SPIR-V, little endian.
    pub(crate) code: &'static [u8],
}

/// Marks the shader of `Provocation` as used; nothing dispatches it without the feature.
#[cfg(not(feature = "testing"))]
const _: &Shader = &PROBE_OVERRUN;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

// The bit fields of `glsl/interface.glsl`: the fields of one word do not overlap.
const _: () = {
    assert!(FLAG_UNSORTED == 1 && SWEEP_OVERLAPS_BIT == 1 && SWEEP_INSIDE_SHIFT == 2);
    assert!(SWEEP_INSIDE_SHIFT + SWEEP_INSIDE_BITS == SWEEP_PASSED_SHIFT);
    assert!(MOST_LAYERS < 1 << (32 - SWEEP_PASSED_SHIFT));
    assert!(FLAG_UNSORTED | DRAW_BEGUN | DRAW_OVERLAPS == (1 << DRAW_INSIDE_SHIFT) - 1);
    assert!(RASTER_BACK_TO_FRONT == (1 << RASTER_FIRST_SHIFT) - 1);
    assert!(MARCH_AXIS + 1 == MARCH_CONTINUES && 2 * MARCH_CONTINUES == PLANE_DOWN);
    assert!(2 * PLANE_DOWN == PLANE_BACK_TO_FRONT && PLANE_BACK_TO_FRONT < 1 << PLANE_EVERY_SHIFT);
    assert!(BOUNDS_PLANES + 1 == BOUNDS_PERSPECTIVE && 2 * BOUNDS_PERSPECTIVE == BOUNDS_FAR_AT_ONE);
    assert!(WARP_SHARED == 1 && WARP_LATER == 2 && WARP_YIELDS_U == 4 && WARP_YIELDS_V == 8);
};
