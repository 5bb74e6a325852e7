//! Trials of settings on a scene.

use std::sync::Arc;

use super::probes::{Estimate, Probes};
use super::table::Candidate;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::num;
use crate::resident::GpuScene;
use crate::scene::View;
use crate::technique::Renderer;

/// A setting that was tried on the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Specification for [`Technique::parse`](crate::technique::Technique::parse), without the options that
    /// the goal adds.
    pub spec: String,
    /// Predicted root mean square error; before the first trial, the error on the profile's scenes.
    pub predicted_error: f64,
    /// Predicted milliseconds; before the first trial, the time on the profile's scenes.
    pub predicted_ms: f64,
    /// The outcome.
    pub outcome: TrialOutcome,
}

/// The outcome of a trial.
#[derive(Clone, Debug, PartialEq)]
pub enum TrialOutcome {
    /// The setting drew the scene.
    Drawn {
        /// Error against the reference.
        error: Estimate,
        /// Time of a frame, in milliseconds.
        ms: f64,
    },
    /// The device or the technique does not support the scene, for this reason.
    Refused(String),
}

impl TrialOutcome {
    /// Returns the bound of the error and the milliseconds; infinite ones if nothing was drawn.
    pub(super) fn costs(&self) -> [f64; 2] {
        match self {
            Self::Drawn { error, ms } => [error.bound, *ms],
            Self::Refused(_) => [f64::INFINITY; 2],
        }
    }
}

/// Number of timed frames in a trial, unless they are long.
const TIMED: u32 = 3;
/// The same where a time is measured again.
const TIMED_AGAIN: u32 = 9;
/// Milliseconds of a frame from which on a third of the frames is enough.
const LONG: f64 = 200.0;

/// Draws the scene with a candidate and compares the image with the reference.
pub(super) fn tried(
    scene: &Arc<GpuScene>,
    view: &View,
    probes: &Probes,
    candidate: &Candidate,
    stop: f64,
) -> Result<TrialOutcome> {
    match drawn(scene, view, candidate, stop, TIMED) {
        Ok((image, times)) => Ok(TrialOutcome::Drawn { error: probes.error(&image), ms: median(times) }),
        Err(error @ (Error::Unsupported { .. } | Error::Invalid { .. } | Error::Memory { .. })) => {
            Ok(TrialOutcome::Refused(error.to_string()))
        }
        Err(error) => Err(error),
    }
}

/// Returns the median time of more frames than a trial has, which tells whether its time was one of chance.
pub(super) fn timed_again(
    scene: &Arc<GpuScene>,
    view: &View,
    candidate: &Candidate,
    stop: f64,
) -> Result<f64> {
    drawn(scene, view, candidate, stop, TIMED_AGAIN).map(|(_, times)| median(times))
}

/// Returns the image, and the times of some frames after the first; of fewer where they are long.
pub(super) fn drawn(
    scene: &Arc<GpuScene>,
    view: &View,
    candidate: &Candidate,
    stop: f64,
    timed: u32,
) -> Result<(Image, Vec<f64>)> {
    let mut frames = Renderer::new(scene, candidate.technique(stop)?).frames(view)?;
    frames.stop_within(stop);
    frames.draw(view)?;
    let image = frames.read_back()?;
    let mut times = vec![frames.draw(view)?.wall_ms];
    let longest = LONG * f64::from(timed);
    while num::count(times.len()) < timed && times.iter().sum::<f64>() < longest / 3.0 {
        times.push(frames.draw(view)?.wall_ms);
    }
    Ok((image, times))
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
