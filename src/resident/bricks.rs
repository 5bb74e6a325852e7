//! Which bricks of a grid are visible, on the device (`bricks.glsl`).

use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Result;
use crate::gpu::shader::{self, BRICKS_COMPUTE};
use crate::gpu::{Buffer, BufferUse, Commands, Descriptors, Gpu, Recorder};
use crate::interface::BricksPush;
use crate::num;
use crate::resident::brick_ranges::MinMax;
use crate::resident::clock::Clock;
use crate::resident::visible_scalars::nonzero_ranges;
use crate::scene::{Grid, TransferFunction};

/// The ranges of a grid's bricks on the device, and their number.
#[derive(Debug, Default)]
pub(crate) struct BrickRanges(Mutex<Option<(Arc<Buffer>, u32)>>);

impl BrickRanges {
    /// Returns one word for each brick: 0 where nothing is visible, with extinction smeared by `margin` scalars.
    ///
    /// `known` are the results for other margins.
    pub(crate) fn visible(
        &self,
        gpu: &Gpu,
        clock: &Clock,
        grid: &Grid,
        transfer: &TransferFunction,
        known: &Mutex<Vec<(f32, Arc<Buffer>)>>,
        margin: f32,
    ) -> Result<Arc<Buffer>> {
        let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known.iter().find(|(m, _)| *m == margin) {
            return Ok(Arc::clone(found));
        }
        let (ranges, count) = self.ranges(gpu, clock, grid)?;
        let mut scalars = nonzero_ranges(transfer);
        let push = BricksPush { bricks: count, ranges: num::count(scalars.len()), margin };
        if scalars.is_empty() {
            scalars.push([0.0; 2]);
        }
        let scalars = Buffer::with_data(gpu, "transfer.visible", bytemuck::cast_slice(&scalars))?;
        let bricks = Buffer::new(gpu, "bricks", 4 * u64::from(count), BufferUse::ShaderWrite)?;
        let bricks = Arc::new(bricks);
        let bound = BRICKS_COMPUTE.with(&shader::Bricks {
            ranges: ranges.read(),
            visible: scalars.read(),
            bricks: bricks.write(),
        });
        let pipeline = gpu.compute_pipeline("bricks.mark", &bound)?;
        let _time = clock.tables();
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &bound)?);
        let groups = count.div_ceil(64);
        // Every device allows this many workgroups along each side.
        let across = groups.min(65_535);
        let mut commands = Commands::new(gpu)?;
        let mut recorder = Recorder::new(gpu, commands.begin()?, None);
        let push = bytemuck::bytes_of(&push);
        recorder.dispatch("bricks.mark", &pipeline, &descriptors, push, [across, groups.div_ceil(across), 1]);
        recorder.release_buffer(&bricks);
        let (_, keep) = recorder.finish();
        commands.submit(keep, "bricks.mark")?;
        known.push((margin, Arc::clone(&bricks)));
        Ok(bricks)
    }

    /// Returns the smallest and largest scalar of each brick, and the number of bricks.
    fn ranges(&self, gpu: &Gpu, clock: &Clock, grid: &Grid) -> Result<(Arc<Buffer>, u32)> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = &*known {
            return Ok(found.clone());
        }
        let _time = clock.upload();
        let bricks = MinMax::of(grid);
        let buffer = Buffer::with_data(gpu, "bricks.ranges", bytemuck::cast_slice(&bricks.ranges))?;
        let made = (buffer, num::count(bricks.ranges.len()));
        *known = Some(made.clone());
        Ok(made)
    }
}
