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

/// Number of timed frames in a trial, unless they are long.
const TIMED: u32 = 3;
/// Milliseconds from which on one timed frame is enough.
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
        Ok((image, ms)) => Ok(TrialOutcome::Drawn { error: probes.error(&image), ms }),
        Err(error @ (Error::Unsupported { .. } | Error::Invalid { .. } | Error::Memory { .. })) => {
            Ok(TrialOutcome::Refused(error.to_string()))
        }
        Err(error) => Err(error),
    }
}

/// Returns the image and the median time of some frames after the first.
pub(super) fn drawn(
    scene: &Arc<GpuScene>,
    view: &View,
    candidate: &Candidate,
    stop: f64,
    timed: u32,
) -> Result<(Image, f64)> {
    let mut frames = Renderer::new(scene, candidate.technique(stop)?).frames(view)?;
    frames.draw(view)?;
    let image = frames.read_back()?;
    let mut times = vec![frames.draw(view)?.wall_ms];
    while num::count(times.len()) < timed && times[0] < LONG {
        times.push(frames.draw(view)?.wall_ms);
    }
    times.sort_by(f64::total_cmp);
    Ok((image, times[times.len() / 2]))
}
