//! The search: selects the next trial from the profile and the trials so far.

use super::goal::Goal;
use super::profile::Profile;
use super::table::Candidate;
use super::trial::TrialOutcome;

/// The prediction for a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Predicted {
    /// Root mean square error.
    pub(super) error: f64,
    pub(super) ms: f64,
}

/// The state of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Known {
    Nothing,
    Refused,
    /// Upper bound of the error, and milliseconds.
    Measured(f64, f64),
}

/// A search in progress.
#[derive(Debug)]
pub(super) struct Search<'a> {
    candidates: &'a [Candidate],
    goal: Goal,
    /// Logarithms of error and time on the profile's scenes.
    prior: Vec<[f64; 2]>,
    known: Vec<Known>,
}

/// Errors below are rounding errors and predict nothing.
const LEAST_ERROR: f64 = 1e-7;
const LEAST_MS: f64 = 1e-3;

/// A trial must promise a cost below the best one times this factor.
const WORTH: f64 = 0.87;

/// Limit of the error factor of a prediction from a trial of the same family.
const NEAR: f64 = 10.0;

/// Largest factor by which a family may be better than predicted, and the improvement that it must then
/// promise to be tried.
const SURPRISE: f64 = 20.0;
const WORTH_A_SURPRISE: f64 = 0.5;

/// Safety factors of predictions: for settings of a family with a trial, and for others.
const SURE: f64 = 1.05;
const UNSURE: f64 = 1.3;

impl<'a> Search<'a> {
    pub(super) fn new(candidates: &'a [Candidate], profile: &Profile, goal: Goal) -> Self {
        let prior = candidates
            .iter()
            .map(|candidate| {
                // Settings missing in the profile get typical costs.
                let (error, ms) = profile.cost(&candidate.spec).unwrap_or((1e-3, 10.0));
                [error.max(LEAST_ERROR).ln(), ms.max(LEAST_MS).ln()]
            })
            .collect();
        Self { candidates, goal, prior, known: vec![Known::Nothing; candidates.len()] }
    }

    /// Returns the next candidate to try with its prediction.
    pub(super) fn next(&self) -> Option<(usize, Predicted)> {
        let best = self.best().map(|best| self.costs(best));
        let untried = || (0..self.candidates.len()).filter(|&i| self.known[i] == Known::Nothing);
        let promising = untried().filter_map(|i| {
            let predicted = self.predicted(i);
            let room = if self.has_family(i) { SURE } else { UNSURE };
            let (limited, price) = self.axes(predicted.error, predicted.ms);
            let gains = best.is_none_or(|[_, price_now]| price < price_now * WORTH);
            (limited * room <= self.limit() && gains).then_some((i, predicted, price))
        });
        if let Some((i, predicted, _)) = promising.min_by(|a, b| a.2.total_cmp(&b.2)) {
            return Some((i, predicted));
        }
        if let Some([_, price_now]) = best {
            return self.surprise(price_now);
        }
        // Nothing promises to meet the goal: try the nearest candidate, unless it is known to be far off.
        let near = |(i, predicted): &(usize, Predicted)| {
            !self.has_family(*i) || self.axes(predicted.error, predicted.ms).0 <= self.limit() * NEAR
        };
        untried()
            .map(|i| (i, self.predicted(i)))
            .filter(near)
            .min_by(|a, b| self.axes(a.1.error, a.1.ms).0.total_cmp(&self.axes(b.1.error, b.1.ms).0))
    }

    /// Returns the most accurate untried setting of an untried family that would be a large improvement if
    /// the family were much better than predicted.
    fn surprise(&self, price_now: f64) -> Option<(usize, Predicted)> {
        (0..self.candidates.len())
            .filter(|&i| self.known[i] == Known::Nothing && !self.was_tried(i))
            .map(|i| (i, self.predicted(i)))
            .filter(|(_, Predicted { error, ms })| {
                let (limited, price) = self.axes(error / SURPRISE, *ms);
                limited <= self.limit() && price < price_now * WORTH_A_SURPRISE
            })
            .min_by(|a, b| a.1.error.total_cmp(&b.1.error))
    }

    /// Records the outcome of a trial.
    pub(super) fn learn(&mut self, candidate: usize, outcome: &TrialOutcome) {
        self.known[candidate] = match outcome {
            TrialOutcome::Drawn { error, ms } => Known::Measured(error.bound, *ms),
            TrialOutcome::Refused(_) => Known::Refused,
        };
    }

    /// Returns the best tried candidate that meets the goal.
    pub(super) fn best(&self) -> Option<usize> {
        (0..self.candidates.len())
            .filter(|&i| self.costs(i)[0] <= self.limit())
            .min_by(|&a, &b| self.costs(a)[1].total_cmp(&self.costs(b)[1]))
    }

    /// Returns the measured costs: the one that the goal limits, then the one that it minimises.
    fn costs(&self, candidate: usize) -> [f64; 2] {
        match self.known[candidate] {
            Known::Measured(error, ms) => self.axes(error, ms).into(),
            _ => [f64::INFINITY; 2],
        }
    }

    fn axes(&self, error: f64, ms: f64) -> (f64, f64) {
        match self.goal {
            Goal::MaxError(_) => (error, ms),
            Goal::Budget(_) => (ms, error),
        }
    }

    fn limit(&self) -> f64 {
        match self.goal {
            Goal::MaxError(limit) | Goal::Budget(limit) => limit,
        }
    }

    /// Returns whether a setting of the same family was tried, whether drawn or refused.
    fn was_tried(&self, candidate: usize) -> bool {
        let family = self.candidates[candidate].family;
        self.candidates
            .iter()
            .zip(&self.known)
            .any(|(c, known)| c.family == family && *known != Known::Nothing)
    }

    fn has_family(&self, candidate: usize) -> bool {
        self.measured().any(|(i, _)| self.candidates[i].family == self.candidates[candidate].family)
    }

    /// Returns the drawn candidates with the logarithms of their ratios to the profile's costs.
    fn measured(&self) -> impl Iterator<Item = (usize, [f64; 2])> {
        (0..self.candidates.len()).filter_map(|i| match self.known[i] {
            Known::Measured(error, ms) => {
                let [prior_error, prior_ms] = self.prior[i];
                let error = if error.is_finite() { error.max(LEAST_ERROR).ln() } else { 0.0 };
                Some((i, [error - prior_error, ms.max(LEAST_MS).ln() - prior_ms]))
            }
            _ => None,
        })
    }

    /// Predicts a candidate's costs: those of the profile, corrected by trials.
    ///
    /// The correction is interpolated between the nearest trials of the same family on both sides; without
    /// any it is the mean of all trials.
    fn predicted(&self, candidate: usize) -> Predicted {
        let Candidate { family, place, .. } = self.candidates[candidate];
        let of_family = || self.measured().filter(|(i, _)| self.candidates[*i].family == family);
        let place_of = |i: usize| self.candidates[i].place;
        let below = of_family().filter(|(i, _)| place_of(*i) < place).max_by_key(|(i, _)| place_of(*i));
        let above = of_family().filter(|(i, _)| place_of(*i) > place).min_by_key(|(i, _)| place_of(*i));
        let shift = match (below, above) {
            (Some((_, shift)), None) | (None, Some((_, shift))) => shift,
            (Some((a, low)), Some((b, high))) => {
                let [a, b, at] = [place_of(a), place_of(b), place].map(crate::num::f64_of);
                let x = (at - a) / (b - a);
                [0, 1].map(|axis| low[axis] + (high[axis] - low[axis]) * x)
            }
            (None, None) => {
                let mut sum = [0.0; 2];
                let mut count = 0.0;
                for (_, shift) in self.measured() {
                    sum = [sum[0] + shift[0], sum[1] + shift[1]];
                    count += 1.0;
                }
                sum.map(|sum| sum / f64::max(count, 1.0))
            }
        };
        let [error, ms] = self.prior[candidate];
        Predicted { error: (error + shift[0]).exp(), ms: (ms + shift[1]).exp() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Estimate, Source};
    use super::*;
    use crate::choice::table;

    /// Settings for grids with a step.
    fn stepped() -> Vec<Candidate> {
        let is_one = |c: &Candidate| c.spec.contains("step=") && !c.spec.starts_with("splat");
        table::every().into_iter().filter(is_one).collect()
    }

    /// Runs a search in which `cost` gives the true costs.
    fn search(goal: Goal, cost: impl Fn(&Candidate) -> Option<(f64, f64)>) -> (Option<usize>, Vec<usize>) {
        let candidates = stepped();
        let profile = Profile::new(
            Source::BuiltIn,
            candidates.iter().map(|c| (c.spec.clone(), rule(c, 1.0))).collect(),
        );
        let mut search = Search::new(&candidates, &profile, goal);
        let mut tried = Vec::new();
        while let Some((i, _)) = search.next() {
            assert!(!tried.contains(&i));
            tried.push(i);
            let outcome = match cost(&candidates[i]) {
                Some((bound, ms)) => {
                    TrialOutcome::Drawn { error: Estimate { rmse: bound, bound, pixels: 1 }, ms }
                }
                None => TrialOutcome::Refused("no".to_string()),
            };
            search.learn(i, &outcome);
        }
        (search.best(), tried)
    }

    /// Second order, with a different factor for each family.
    fn rule(candidate: &Candidate, scale: f64) -> (f64, f64) {
        let fine = (candidate.place as f64).exp2();
        let family = candidate.family as f64 + 1.0;
        (scale * family / (fine * fine), 2.0 * fine / family.sqrt() + 1.0)
    }

    fn best_of(limit: f64, cost: impl Fn(&Candidate) -> Option<(f64, f64)>) -> Option<f64> {
        let met =
            stepped().into_iter().filter_map(|c| cost(&c)).filter(|cost| cost.0 <= limit).map(|cost| cost.1);
        met.min_by(f64::total_cmp)
    }

    #[test]
    fn what_is_predicted_right_is_found_at_once() {
        for limit in [0.3, 1e-2, 1e-3] {
            let cost = |c: &Candidate| Some(rule(c, 1.0));
            let (best, tried) = search(Goal::MaxError(limit), cost);
            let candidates = stepped();
            let found = rule(&candidates[best.unwrap()], 1.0);
            assert!(found.0 <= limit);
            assert!(found.1 <= 1.3 * best_of(limit, cost).unwrap(), "{limit}: {found:?}");
            assert!(tried.len() <= 8, "{tried:?}");
        }
    }

    /// Scenes may be harder or easier than the profile's, slower or faster, and one family may differ from
    /// the others.
    #[test]
    fn what_is_predicted_wrong_is_corrected() {
        for (scale, slower, odd) in [(30.0, 5.0, 1.0), (0.02, 0.3, 1.0), (1.0, 1.0, 40.0), (3.0, 1.0, 0.05)] {
            let cost = |c: &Candidate| {
                let (error, ms) = rule(c, scale);
                Some((if c.family == 1 { error * odd } else { error }, ms * slower))
            };
            for limit in [0.1, 1e-2] {
                let candidates = stepped();
                let (best, tried) = search(Goal::MaxError(limit), cost);
                let found = cost(&candidates[best.unwrap()]).unwrap();
                assert!(found.0 <= limit);
                let fastest = best_of(limit, cost).unwrap();
                assert!(found.1 <= 1.5 * fastest, "{scale} {slower} {odd}: {found:?}, {fastest}");
                assert!(tried.len() <= 12, "{}", tried.len());
                let (best, _) = search(Goal::Budget(20.0 * slower), cost);
                assert!(cost(&candidates[best.unwrap()]).unwrap().1 <= 20.0 * slower);
            }
        }
    }

    #[test]
    fn what_cannot_be_met_is_not() {
        let (best, tried) = search(Goal::MaxError(1e-30), |c| Some(rule(c, 1.0)));
        assert!(best.is_none());
        let mut all = tried.clone();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), tried.len());
        // One trial of each family is enough.
        assert!((5..12).contains(&tried.len()), "{}", tried.len());
        // A refused setting is never the result.
        let (best, tried) = search(Goal::MaxError(1e-3), |_| None);
        assert!(best.is_none() && tried.len() > 30, "all were tried");
        let refused = |c: &Candidate| (c.family != 0).then(|| rule(c, 1.0));
        let (best, _) = search(Goal::MaxError(1e-2), refused);
        assert!(best.is_some());
    }
}
