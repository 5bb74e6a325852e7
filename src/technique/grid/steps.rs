//! Chooses the step of each tile of the image for an error that was asked for.
//!
//! 1. `raycast.glsl` PILOT marches the ray of each tile's centre with a step of 8 voxels, then with half of it, and so on, until its
//!    colour hardly changes.
//! 2. `steps.glsl` counts tiles by their error, finds the error that all may have, and chooses the steps.
//!
//! Accuracy: over 16 scenes and targets from 1e-3 to 1e-2 the RMSE that steps cause is 0.55 to 0.95 times the target, or less where a
//! step of 8 voxels has less; up to 1.3 times for an eye among thin shells, where the ray of a tile's centre misses what its tile shows,
//! as it also does where clip planes or depths hide the centres of tiles. Loop limits that leave out the finest steps add a fifth. Cost:
//! a sixty-fourth of the rays, with about four times the samples of their neighbours; images for which one dispatch cannot march the
//! finest step take as many dispatches as that.
//!
//! Source: error control along rays: Novins and Arvo, "Controlled precision volume integration", 1992.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::gpu::inputs::Write;
use crate::gpu::shader::{
    ERROR_BINS, PILOT_COARSEST, PILOT_LEVELS, STEPS_CHOICE, STEPS_ERRORS, StepsChoice, StepsErrors,
};
use crate::gpu::{Bound, Buffer, Gpu, Recorder};
use crate::interface::{GridPush, Pilot, StepsPush};
use crate::num::f32_of;
use crate::primitives::dispatch::{Dispatch, buffer, groups_of, pass, tiles_of};
use crate::scene::View;

/// The finest step, in units of the smallest voxel spacing. The last level is drawn for the error of the one before.
pub(super) const FINEST: f64 = step_of(PILOT_LEVELS - 2);

/// The step of a level.
const fn step_of(level: u32) -> f64 {
    PILOT_COARSEST as f64 / (1u32 << level) as f64
}

/// Levels without which no error is known.
const LEAST_LEVELS: u32 = 3;

/// Words of a tile in `pilots.glsl`.
const PILOT_WORDS: u64 = size_of::<Pilot>() as u64 / 4;

/// The ratio of the RMSE that the greatest errors around tiles add up to and that of the image: measured.
const MARGIN: f64 = 1.6;

/// The passes that choose the steps.
#[derive(Debug)]
pub(super) struct TileSteps {
    /// The step of each tile.
    pub(super) steps: Arc<Buffer>,
    errors: Arc<Buffer>,
    pilot: Dispatch,
    count: Dispatch,
    choose: Dispatch,
    tolerance: f64,
    /// Number of levels, each of which one dispatch can march.
    levels: u32,
    tiles: [u32; 2],
}

impl TileSteps {
    /// Makes the passes. `bind` binds the shader that marches; `slabs` is the number of segments with the finest step, and `most` returns
    /// how many of them one dispatch may walk for so many rays.
    pub(super) fn new(
        gpu: &Gpu,
        name: &str,
        tolerance: f64,
        view: &View,
        slabs: u32,
        most: impl FnOnce(u64) -> Result<u32>,
        bind: impl FnOnce(Write) -> Result<Bound>,
    ) -> Result<Self> {
        let [across, rows, _] = tiles_of(view.extent());
        let tiles = u64::from(across) * u64::from(rows);
        let made = |what: &str, words: u64| buffer(gpu, &format!("{name}.{what}"), words);
        let (pilots, steps) = (made("pilots", PILOT_WORDS * tiles)?, made("steps", tiles)?);
        let errors = made("errors", u64::from(ERROR_BINS))?;
        let counting = StepsErrors { errors: errors.write(), pilots: pilots.write() };
        let choosing =
            StepsChoice { errors: errors.write(), tile_steps: steps.write(), pilots: pilots.write() };
        let pass = |what: &str, bound: &Bound| pass(gpu, &format!("{name}.{what}"), bound);
        // Each level has twice the segments of the one before.
        let most = f64::from(most(tiles)?);
        let fits = |&level: &u32| f64::from(slabs) * FINEST / step_of(level) <= most;
        let levels = (0..PILOT_LEVELS).take_while(fits).last().map_or(0, |level| level + 1);
        if levels < LEAST_LEVELS {
            let step = step_of(LEAST_LEVELS - 1);
            let why = format!("a ray of step {step} exceeds the loop limit of this device; integral works");
            return Err(Error::unsupported(format!("{name} tolerance"), why));
        }
        Ok(Self {
            pilot: pass("pilot", &bind(pilots.write())?)?,
            count: pass("errors", &STEPS_ERRORS.with(&counting))?,
            choose: pass("steps", &STEPS_CHOICE.with(&choosing))?,
            steps,
            errors,
            tolerance,
            levels,
            tiles: [across, rows],
        })
    }

    /// Records the passes; `push` is that of the march.
    pub(super) fn record(&self, recorder: &mut Recorder<'_>, push: GridPush) {
        let [across, rows] = self.tiles;
        let groups = groups_of(across * rows, 64);
        let bound = (MARGIN * self.tolerance).powi(2);
        // Features may lie between the samples of two coarse steps: a ray goes on at least to a step that rarely misses any.
        let enough = (self.tolerance / 1e-3).sqrt();
        for level in 0..self.levels {
            let mut push = push;
            push.d0_h[3] = f32_of(step_of(level));
            push.first = level;
            let ends = level > 0 && step_of(level - 1) <= enough;
            push.seed = f32_of(if ends { bound } else { -1.0 }).to_bits();
            self.pilot.record(recorder, &push, groups);
        }
        let push = StepsPush { tiles: self.tiles, bound: f32_of(bound), pad0: 0 };
        recorder.clear_buffer(&format!("{}.clear", self.count.name), &self.errors);
        self.count.record(recorder, &push, groups);
        self.choose.record(recorder, &push, groups);
    }
}
