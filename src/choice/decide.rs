//! The choice itself: runs trials until no remaining setting promises an improvement.

use std::sync::Arc;

use super::goal::Goal;
use super::probes::{Estimate, Probes};
use super::profile::{Profile, Source};
use super::search::Search;
use super::table::{self, Candidate};
use super::trial::{Trial, TrialOutcome, tried};
use crate::error::{Error, Result};
use crate::resident::GpuScene;
use crate::scene::View;
use crate::technique::Technique;

/// A setting that meets the goal.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The chosen technique with its options.
    pub technique: Technique,
    /// Index of the chosen setting among the trials.
    pub chosen: usize,
    /// All trials, in order.
    pub trials: Vec<Trial>,
    /// Number of settings that were available.
    pub candidates: usize,
    /// Source of the predictions.
    pub source: Source,
}

impl Choice {
    /// Returns error and milliseconds of the chosen setting, as measured on the scene.
    #[must_use]
    pub fn measured(&self) -> Option<(Estimate, f64)> {
        match self.trials.get(self.chosen)?.outcome {
            TrialOutcome::Drawn { error, ms } => Some((error, ms)),
            TrialOutcome::Refused(_) => None,
        }
    }
}

/// Chooses a setting for a scene in a view by drawing it several times.
///
/// The result is measured on this scene and view, so its accuracy does not depend on the profile. The profile
/// affects only the number of trials and how close the choice is to the optimum.
///
/// # Accuracy
///
/// An error counts as met if its upper bound with 95 % confidence is. Images are compared at up to 4096
/// random pixels; smaller ones are compared completely.
///
/// # Errors
///
/// [`Error::Invalid`] if the goal is not a positive number, or no technique draws the kind of data.
/// [`Error::Unsupported`] if no setting meets the goal; the message names the nearest one. Any error of
/// drawing that is not a limit of one setting.
pub fn choose(scene: &Arc<GpuScene>, view: &View, goal: Goal, profile: &Profile) -> Result<Choice> {
    goal.check()?;
    let candidates = table::candidates(scene.scene());
    if candidates.is_empty() {
        let why =
            format!("no technique draws this kind of data with these kernels: {}", scene.scene().data.kind());
        return Err(Error::invalid("technique", why));
    }
    let probes = Probes::new(scene.scene(), view, Probes::MOST)?;
    let mut search = Search::new(&candidates, profile, goal);
    let mut trials: Vec<Trial> = Vec::new();
    while let Some((candidate, [error, ms])) = search.next() {
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

/// Tries every available setting on every pixel, as a standard that a choice can be compared with.
///
/// Settings and outcomes are those of [`choose`], in no particular order.
///
/// # Errors
///
/// As [`choose`], except that a missed goal is no error.
pub fn try_all(scene: &Arc<GpuScene>, view: &View, goal: Goal) -> Result<Vec<(String, TrialOutcome)>> {
    goal.check()?;
    let probes = Probes::new(scene.scene(), view, u32::MAX)?;
    let tried = |candidate: Candidate| {
        let outcome = tried(scene, view, &probes, &candidate, goal.stop())?;
        Ok((candidate.spec, outcome))
    };
    table::candidates(scene.scene()).into_iter().map(tried).collect()
}

/// Makes the error of a missed goal, which names the nearest setting.
fn missed(goal: Goal, trials: &[Trial]) -> Error {
    let drawn = trials.iter().filter_map(|trial| match trial.outcome {
        TrialOutcome::Drawn { error, ms } => Some((trial, error.bound, ms)),
        TrialOutcome::Refused(_) => None,
    });
    let (what, key): (_, fn(f64, f64) -> f64) = match goal {
        Goal::MaxError(error) => (format!("an error of at most {error:e}"), |error, _| error),
        Goal::Budget(budget) => (format!("a frame in {budget} ms"), |_, ms| ms),
    };
    let nearest = drawn.min_by(|a, b| key(a.1, a.2).total_cmp(&key(b.1, b.2)));
    let nearest = nearest
        .map(|(trial, error, ms)| format!("the nearest is {}: error {error:.2e}, {ms:.1} ms", trial.spec));
    Error::unsupported(what, nearest.unwrap_or_else(|| "no setting drew the scene".to_string()))
}
