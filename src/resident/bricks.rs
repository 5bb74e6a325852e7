//! Which bricks of a grid are visible, on the device (`bricks.glsl`).

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::shader::{self, BRICKS_COMPUTE};
use crate::gpu::{Buffer, Commands, Gpu, Recorder};
use crate::interface::BricksPush;
use crate::num;
use crate::primitives::dispatch::{buffer, groups_of, pass};
use crate::resident::brick_ranges::brick_ranges;
use crate::resident::clock::Clock;
use crate::resident::visible_scalars::nonzero_ranges;
use crate::scene::{Grid, TransferFunction};

/// The smallest and largest scalar of each brick on the device, and the number of bricks.
#[derive(Clone, Debug)]
pub(crate) struct BrickRanges {
    buffer: Arc<Buffer>,
    count: u32,
}

impl BrickRanges {
    /// Computes and uploads the ranges of a grid.
    pub(crate) fn new(gpu: &Gpu, grid: &Grid) -> Result<Self> {
        let ranges = brick_ranges(grid);
        let buffer = Buffer::with_data(gpu, "bricks.ranges", bytemuck::cast_slice(&ranges))?;
        Ok(Self { buffer, count: num::count(ranges.len()) })
    }

    /// Returns one word for each brick: 0 where nothing is visible, with extinction smeared by `margin` scalars.
    pub(crate) fn visible(
        self,
        gpu: &Gpu,
        clock: &Clock,
        transfer: &TransferFunction,
        margin: f32,
    ) -> Result<Arc<Buffer>> {
        let mut scalars = nonzero_ranges(transfer);
        let push = BricksPush { bricks: self.count, ranges: num::count(scalars.len()), margin };
        if scalars.is_empty() {
            scalars.push([0.0; 2]);
        }
        let scalars = Buffer::with_data(gpu, "transfer.visible", bytemuck::cast_slice(&scalars))?;
        let bricks = buffer(gpu, "bricks", self.count.into())?;
        let bound = BRICKS_COMPUTE.with(&shader::Bricks {
            ranges: self.buffer.read(),
            visible: scalars.read(),
            bricks: bricks.write(),
        });
        let mark = pass(gpu, "bricks.mark", &bound)?;
        clock.tables(|| {
            let mut commands = Commands::new(gpu)?;
            let mut recorder = Recorder::new(gpu, commands.begin()?, None);
            mark.record(&mut recorder, &push, groups_of(self.count, 64));
            recorder.release_buffer(&bricks);
            let (_, keep) = recorder.finish();
            commands.submit(keep, "bricks.mark")
        })?;
        Ok(bricks)
    }
}
