//! A technique and its options, chosen for an error or for a time, and verified.
//!
//! Users trade speed for accuracy: they say which error or which time is wanted, and what meets it best is found among
//! a fixed table of settings.
//!
//! 1. A [`Profile`] tells what each setting cost in time and error on scenes of its own: measured on this device, or
//!    built in.
//! 2. The setting that is predicted to be best is tried on the scene itself: its frame is timed, and its image compared
//!    with the float64 reference at up to 4096 pixels that are spread at random.
//! 3. What a trial finds different from its prediction corrects the predictions for settings like it; the search goes on
//!    while a setting is left that promises more.
//!
//! So the promise does not rest on the profile: what is returned has been measured on the scene and view that it is for.
//! An error is taken for held if its bound is, which 19 of 20 samples of pixels keep; images of up to 4096 pixels
//! are compared whole. The profile decides how many trials it takes, and how near the fastest setting the choice comes.

mod probes;
mod profile;
mod search;
mod table;

use std::sync::Arc;

pub use probes::Estimate;
pub use profile::{Profile, Source};

use crate::error::{Error, Result};
use crate::num;
use crate::resident::GpuScene;
use crate::scene::View;
use crate::technique::Renderer;
use crate::technique::Technique;
use probes::Probes;
use search::{Predicted, Search};
use table::Candidate;

/// What is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Root mean square error of premultiplied colour, at most; what holds it in the least time is chosen.
    MaxError(f64),
    /// Milliseconds for a frame, at most; what keeps to it with the least error is chosen.
    Budget(f64),
}

impl Goal {
    /// Colour that may be to come where a line ends: a small part of the error that is allowed.
    fn stop(self) -> f64 {
        match self {
            Self::MaxError(error) => (error / 8.0).min(0.01),
            Self::Budget(_) => 1e-4,
        }
    }

    /// # Errors
    ///
    /// [`Error::Invalid`] unless the number is finite and positive.
    fn check(self) -> Result<()> {
        let (what, value) = match self {
            Self::MaxError(error) => ("greatest error", error),
            Self::Budget(ms) => ("budget", ms),
        };
        if value.is_finite() && value > 0.0 {
            return Ok(());
        }
        Err(Error::invalid(what, format!("{value}: must be a positive number")))
    }
}

/// A setting that was tried on the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Technique and options, as [`Technique::parse`] reads them; what the goal adds is left out.
    pub spec: String,
    /// The error that was expected, root mean square; until the first trial, that on the profile's scenes.
    pub predicted_error: f64,
    /// The time that was expected, in milliseconds; until the first trial, that on the profile's scenes.
    pub predicted_ms: f64,
    /// What came of it.
    pub outcome: TrialOutcome,
}

/// What a trial came to.
#[derive(Clone, Debug, PartialEq)]
pub enum TrialOutcome {
    /// It drew.
    Drawn {
        /// Its error against the reference.
        error: Estimate,
        /// Milliseconds of a frame.
        ms: f64,
    },
    /// The device cannot do it, or the scene is not for it: why.
    Refused(String),
}

/// A setting that meets the goal.
#[derive(Clone, Debug)]
pub struct Choice {
    /// What was chosen.
    pub technique: Technique,
    /// Its place among the trials.
    pub chosen: usize,
    /// All that was tried, in order.
    pub trials: Vec<Trial>,
    /// Settings that there were to choose from.
    pub candidates: usize,
    /// Where predictions came from.
    pub source: Source,
}

impl Choice {
    /// Error and milliseconds of what was chosen, as measured on the scene.
    #[must_use]
    pub fn measured(&self) -> Option<(Estimate, f64)> {
        match self.trials.get(self.chosen)?.outcome {
            TrialOutcome::Drawn { error, ms } => Some((error, ms)),
            TrialOutcome::Refused(_) => None,
        }
    }
}

/// Chooses for a scene as it is seen in a view, by drawing it several times.
///
/// # Errors
///
/// [`Error::Invalid`] if the goal is no positive number, or nothing draws the kind of data.
/// [`Error::Unsupported`] if no setting meets the goal: with the nearest that there is. Whatever drawing
/// may meet, but for what a single setting cannot do.
pub fn choose(scene: &Arc<GpuScene>, view: &View, goal: Goal, profile: &Profile) -> Result<Choice> {
    goal.check()?;
    let candidates = table::candidates(scene.scene());
    if candidates.is_empty() {
        let why = format!("nothing draws data of this kind with its kernels: {}", scene.scene().data.kind());
        return Err(Error::invalid("technique", why));
    }
    let probes = Probes::new(scene.scene(), view)?;
    let mut search = Search::new(&candidates, profile, goal);
    let mut trials: Vec<Trial> = Vec::new();
    while let Some((candidate, Predicted { error, ms })) = search.next() {
        let outcome = tried(scene, view, &probes, &candidates[candidate], goal.stop())?;
        search.learn(candidate, &outcome);
        trials.push(Trial {
            spec: candidates[candidate].spec.clone(),
            predicted_error: error,
            predicted_ms: ms,
            outcome,
        });
    }
    let Some(best) = search.best() else { return Err(missed(goal, &trials)) };
    let chosen = trials.iter().position(|trial| trial.spec == candidates[best].spec).unwrap_or(0);
    Ok(Choice {
        technique: candidates[best].technique(goal.stop())?,
        chosen,
        trials,
        candidates: candidates.len(),
        source: profile.source(),
    })
}

/// Tries every setting that there is to choose from, and compares every pixel: what a choice can be measured by. Settings
/// and outcomes are those that [`choose`] would meet, in no order.
///
/// # Errors
///
/// As [`choose`], but for goals that are missed.
pub fn try_all(scene: &Arc<GpuScene>, view: &View, goal: Goal) -> Result<Vec<(String, TrialOutcome)>> {
    goal.check()?;
    let probes = Probes::whole(scene.scene(), view)?;
    let tried = |candidate: Candidate| {
        let outcome = tried(scene, view, &probes, &candidate, goal.stop())?;
        Ok((candidate.spec, outcome))
    };
    table::candidates(scene.scene()).into_iter().map(tried).collect()
}

/// The nearest that there is to a goal that is missed.
fn missed(goal: Goal, trials: &[Trial]) -> Error {
    let drawn = trials.iter().filter_map(|trial| match trial.outcome {
        TrialOutcome::Drawn { error, ms } => Some((trial, error.bound, ms)),
        TrialOutcome::Refused(_) => None,
    });
    let by = |key: fn(f64, f64) -> f64| {
        drawn
            .clone()
            .min_by(|a, b| key(a.1, a.2).total_cmp(&key(b.1, b.2)))
            .map(|(trial, error, ms)| format!("the nearest is {}: error {error:.2e}, {ms:.1} ms", trial.spec))
    };
    let (what, nearest) = match goal {
        Goal::MaxError(error) => (format!("an error of at most {error:e}"), by(|error, _| error)),
        Goal::Budget(budget) => (format!("a frame in {budget} ms"), by(|_, ms| ms)),
    };
    Error::unsupported(what, nearest.unwrap_or_else(|| "nothing drew the scene".to_string()))
}

/// Frames of a trial that are timed, while they are short.
const TIMED: u32 = 3;
/// From here on one is enough, in milliseconds.
const LONG: f64 = 200.0;

/// Draws the scene with a candidate.
fn tried(
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

/// Image, and median time of some frames after the first.
fn drawn(
    scene: &Arc<GpuScene>,
    view: &View,
    candidate: &Candidate,
    stop: f64,
    timed: u32,
) -> Result<(crate::image::Image, f64)> {
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
