//! The entries of the shaders and the types of their inputs, which `build.rs` has written.

use ash::vk;

use super::inputs::{Bound, Entry, Inputs, Read, Sampled, Stored, Uniform, Write};
use super::pipeline::{DeviceConstant, Shader};
pub(crate) use crate::interface::constants::*;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

// The bit fields of `glsl/interface.glsl`: the fields of one word do not overlap.
const _: () = {
    assert!(FLAG_UNSORTED | FLAG_REPAIRED | FLAG_OVERLAPS | STATE_BEGUN == (1 << STATE_INSIDE_SHIFT) - 1);
    assert!(STATE_INSIDE_SHIFT + STATE_INSIDE_BITS == STATE_PASSED_SHIFT);
    assert!(MOST_LAYERS < 1 << (32 - STATE_PASSED_SHIFT));
    assert!(RASTER_BACK_TO_FRONT == (1 << RASTER_FIRST_SHIFT) - 1);
    assert!(MARCH_AXIS + 1 == MARCH_CONTINUES && 2 * MARCH_CONTINUES == PLANE_DOWN);
    assert!(2 * PLANE_DOWN == PLANE_BACK_TO_FRONT && PLANE_BACK_TO_FRONT < 1 << PLANE_EVERY_SHIFT);
    assert!(BOUNDS_PLANES + 1 == BOUNDS_PERSPECTIVE && 2 * BOUNDS_PERSPECTIVE == BOUNDS_FAR_AT_ONE);
    assert!(WARP_SHARED == 1 && WARP_LATER == 2 && WARP_YIELDS_U == 4 && WARP_YIELDS_V == 8);
};

#[cfg(test)]
mod tests {
    use super::*;

    /// The marches of grids with and without empty-space skipping draw the same image to the bit, so no driver may contract their
    /// arithmetic: each addition, subtraction and multiplication of floats is decorated with `NoContraction` (42), and there is no
    /// `FMix` (46), which drivers expand.
    #[test]
    fn no_march_of_a_grid_is_contracted() {
        let marches = [
            MAXIMUM_COMPUTE.shader(),
            RAYCAST_COMPUTE.shader(),
            SHEAR_WARP_COMPUTE.shader(),
            SLABS_COMPUTE.shader(),
            SLICES_2D_COMPUTE.shader(),
            SLICES_3D_COMPUTE.shader(),
        ];
        for shader in marches {
            let words = shader.words();
            let (mut kept, mut arithmetic, mut at) = (Vec::new(), Vec::new(), 5);
            while at < words.len() {
                match words[at] & 0xffff {
                    71 if words[at + 2] == 42 => kept.push(words[at + 1]),
                    129 | 131 | 133 | 142 | 148 => arithmetic.push(words[at + 2]),
                    12 => assert!(words[at + 4] != 46, "{} has a `mix` of floats", shader.name),
                    _ => {}
                }
                at += (words[at] >> 16) as usize;
            }
            assert!(arithmetic.len() > 50, "{}: {} operations", shader.name, arithmetic.len());
            assert!(arithmetic.iter().all(|id| kept.contains(id)), "{} may be contracted", shader.name);
        }
    }
}
