//! Device memory that a grid takes, computed without a device.

use crate::num;
use crate::resident::brick_ranges::{BRICK_BYTES, bricks_of};
use crate::scene::Grid;

/// Least bytes of device memory that techniques allocate for a grid.
///
/// Devices pad images; and on a device that filters 8-bit samples too coarsely they are stored in 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridBytes {
    /// Samples as one 3D image: `slices-3d`, `slabs`, `raycast`.
    pub volume: u64,
    /// Samples as one stack of 2D slices: `slices-2d` and `shear-warp`.
    pub stack: u64,
    /// All three stacks, as `stacks=all` keeps them.
    pub stacks: u64,
    /// Ranges of bricks, and which bricks are visible: with `empty-space`.
    pub bricks: u64,
}

impl GridBytes {
    /// Computes the bytes of a grid.
    #[must_use]
    pub fn of(grid: &Grid) -> Self {
        let product = |extents: [u32; 3]| extents.iter().fold(1_u64, |n, &e| n.saturating_mul(u64::from(e)));
        let volume = product(grid.dims()).saturating_mul(num::wide(grid.samples().sample_bytes()));
        Self {
            volume,
            stack: volume,
            stacks: volume.saturating_mul(3),
            bricks: product(bricks_of(grid.dims())).saturating_mul(BRICK_BYTES),
        }
    }
}
