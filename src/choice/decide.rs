//! The choice itself: runs trials until no remaining setting promises an improvement.

use std::sync::Arc;

use super::goal::Goal;
use super::probes::{Estimate, Probes};
use super::profile::{Profile, Source};
use super::search::{Costs, Search};
use super::table::{self, Candidate};
use super::trial::{Trial, TrialOutcome, timed_again, tried};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::resident::GpuScene;
use crate::scene::{Scene, View};
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
    let mut trials = Trials { scene, view, probes, goal, all: Vec::new() };
    let mut search = Search::new(&candidates, profile, goal);
    while let Some((candidate, predicted)) = search.next() {
        search.learn(candidate, trials.add(&candidates[candidate], predicted)?);
    }
    if let Some(best) = search.best()
        && let Some((other, costs)) = search.bracket(best)
    {
        trials.refine([&candidates[best], &candidates[other]], costs)?;
    }
    let best = trials.best()?;
    let (tried, trials): (Vec<Candidate>, Vec<Trial>) = trials.all.into_iter().unzip();
    let Some(chosen) = best else { return Err(missed(goal, &trials)) };
    Ok(Choice {
        technique: tried[chosen].technique(goal.stop())?,
        chosen,
        trials,
        candidates: candidates.len(),
        source: profile.source(),
    })
}

/// Largest number of trials between the last setting of the table that meets the goal and the next that does not.
const REFINEMENTS: u32 = 3;

/// The part of what the goal allows that a refined setting aims at, and the part from which on it is not refined further.
const AIM: f64 = 0.96;
const CLOSE: f64 = 0.92;

/// Largest number of chosen settings whose time is measured again.
const CONFIRMATIONS: u32 = 4;

/// Trials of a scene in a view.
struct Trials<'a> {
    scene: &'a Arc<GpuScene>,
    view: &'a View,
    probes: Probes,
    goal: Goal,
    all: Vec<(Candidate, Trial)>,
}

impl Trials<'_> {
    /// Tries a setting, and returns the outcome.
    fn add(&mut self, candidate: &Candidate, [error, ms]: Costs) -> Result<&TrialOutcome> {
        let outcome = tried(self.scene, self.view, &self.probes, candidate, self.goal.stop())?;
        let (spec, predicted_error, predicted_ms) = (candidate.spec.clone(), error, ms);
        self.all.push((candidate.clone(), Trial { spec, predicted_error, predicted_ms, outcome }));
        Ok(&self.all[self.all.len() - 1].1.outcome)
    }

    /// Tries steps between a setting that meets the goal and its neighbour that does not, whose costs are known or
    /// predicted: costs are powers of the step between them.
    fn refine(&mut self, [inner, outer]: [&Candidate; 2], outer_costs: Costs) -> Result<()> {
        let limit = self.goal.limit();
        let Some(inner_costs) =
            self.all.iter().find_map(|(own, trial)| (own == inner).then(|| trial.outcome.costs()))
        else {
            return Ok(());
        };
        let mut ends = [(inner.clone(), inner_costs), (outer.clone(), outer_costs)];
        for _ in 0..REFINEMENTS {
            let [inner, outer] = &ends;
            let limited = ends.each_ref().map(|(_, costs)| self.goal.axes(*costs)[0].max(f64::MIN_POSITIVE));
            if limited[0] > CLOSE * limit {
                break;
            }
            let share = (AIM * limit / limited[0]).ln() / (limited[1] / limited[0]).ln();
            let Some(candidate) = inner.0.between(&outer.0, share) else { break };
            let predicted = [0, 1].map(|axis| inner.1[axis] * (outer.1[axis] / inner.1[axis]).powf(share));
            let costs = self.add(&candidate, predicted)?.costs();
            let end = usize::from(self.goal.axes(costs)[0] > limit);
            ends[end] = (candidate, costs);
        }
        Ok(())
    }

    /// Returns the best trial that meets the goal. A budget must be met by more frames than those of the trial.
    fn best(&mut self) -> Result<Option<usize>> {
        let limit = self.goal.limit();
        for confirmed in 0.. {
            let axes = |i: &usize| self.goal.axes(self.all[*i].1.outcome.costs());
            let meeting = (0..self.all.len()).filter(|i| axes(i)[0] <= limit);
            let Some(best) = meeting.min_by(|a, b| axes(a)[1].total_cmp(&axes(b)[1])) else { break };
            let (candidate, trial) = &mut self.all[best];
            if confirmed < CONFIRMATIONS
                && let (Goal::Budget(_), TrialOutcome::Drawn { ms, .. }) = (self.goal, &mut trial.outcome)
            {
                *ms = timed_again(self.scene, self.view, candidate, self.goal.stop())?;
                if *ms > limit {
                    continue;
                }
            }
            return Ok(Some(best));
        }
        Ok(None)
    }
}

/// Estimates the error of an image of a scene in a view, as [`choose`] does for its trials.
///
/// # Errors
///
/// As [`reference::pixels`](crate::reference::pixels).
pub fn estimate(scene: &Scene, view: &View, image: &Image) -> Result<Estimate> {
    Ok(Probes::new(scene, view, Probes::MOST)?.error(image))
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
