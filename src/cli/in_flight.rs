//! Frames that are drawn one after the other, or with two in flight.

use std::sync::Arc;
use std::time::Instant;

use volraster::scene::View;
use volraster::technique::{FrameTime, Frames, Renderer, Technique};
use volraster::{GpuScene, Result};

use super::timing::milliseconds_since;

/// Frames that are timed together with two in flight; the first of them has no other beside it.
const TOGETHER: usize = 4;

/// Draws frames of one size by one technique.
pub(crate) struct InFlight(Vec<Frames>);

impl InFlight {
    /// Prepares `count` frames in flight, one or two.
    pub(crate) fn new(scene: &Arc<GpuScene>, technique: Technique, view: &View, count: u8) -> Result<Self> {
        let renderer = Renderer::new(scene, technique);
        Ok(Self((0..count).map(|_| renderer.frames(view)).collect::<Result<_>>()?))
    }

    /// Lets frames end early ([`Frames::stop_within`]).
    pub(crate) fn stop_within(&mut self, rmse: f64) {
        self.0.iter_mut().for_each(|frames| frames.stop_within(rmse));
    }

    /// Returns the frames of one plan.
    pub(crate) fn first(&mut self) -> &mut Frames {
        &mut self.0[0]
    }

    /// Draws a frame and waits for it. With two in flight it draws several, and returns the last with the mean of their times.
    pub(crate) fn draw(&mut self, view: &View) -> Result<FrameTime> {
        let [first, second] = &mut self.0[..] else { return self.first().draw(view) };
        let begin = Instant::now();
        first.start(view)?;
        for _ in 1..TOGETHER / 2 {
            second.start(view)?;
            first.finish()?;
            first.start(view)?;
            second.finish()?;
        }
        second.start(view)?;
        first.finish()?;
        let last = second.finish()?;
        Ok(FrameTime { wall_ms: milliseconds_since(begin) / TOGETHER as f64, ..last })
    }
}
