//! What a grid takes on a device, told without one.

use crate::resident::brick_ranges::{MinMax, bricks_of};
use crate::resident::volume::texel_bytes;
use crate::scene::Grid;

/// Bytes of device memory that techniques ask for, at least: devices pad images, and some keep 8-bit samples in
/// 16 bits because they filter too coarsely.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridBytes {
    /// Samples as one 3D image: `slices-3d`, `slabs`, `raycast`.
    pub volume: u64,
    /// Samples as one stack of 2D slices: `slices-2d` and `shear-warp`.
    pub stack: u64,
    /// All three stacks, as `stacks=all` keeps them.
    pub stacks: u64,
    /// Ranges of bricks, and which of them show anything: with `empty-space`.
    pub bricks: u64,
}

impl GridBytes {
    /// Of a grid.
    #[must_use]
    pub fn of(grid: &Grid) -> Self {
        let product = |extents: [u32; 3]| extents.iter().fold(1_u64, |n, &e| n.saturating_mul(u64::from(e)));
        let volume = product(grid.dims()).saturating_mul(texel_bytes(grid.samples()));
        Self {
            volume,
            stack: volume,
            stacks: volume.saturating_mul(3),
            bricks: product(bricks_of(grid.dims())).saturating_mul(MinMax::BYTES),
        }
    }
}
