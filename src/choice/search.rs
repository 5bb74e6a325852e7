//! The search: selects the next trial from the profile and the trials so far.

use super::goal::Goal;
use super::profile::Profile;
use super::table::Candidate;
use super::trial::TrialOutcome;
use crate::num;

/// Error (root mean square, or its upper bound) and milliseconds of a setting.
pub(super) type Costs = [f64; 2];

/// The state of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Known {
    Nothing,
    Refused,
    Measured(Costs),
}

/// A search in progress.
#[derive(Debug)]
pub(super) struct Search<'a> {
    candidates: &'a [Candidate],
    goal: Goal,
    /// Logarithms of the costs on the profile's scenes.
    prior: Vec<Costs>,
    known: Vec<Known>,
}

/// Errors below are rounding errors and predict nothing.
const LEAST_ERROR: f64 = 1e-7;
const LEAST_MS: f64 = 1e-3;

/// A search with a result ends after so many trials that miss the goal.
const MOST_MISSES: usize = 3;

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
        let prior = candidates.iter().map(|candidate| {
            // Settings missing in the profile get typical costs.
            let (error, ms) = profile.costs.get(&candidate.spec).copied().unwrap_or((1e-3, 10.0));
            [error.max(LEAST_ERROR).ln(), ms.max(LEAST_MS).ln()]
        });
        let known = vec![Known::Nothing; candidates.len()];
        Self { candidates, goal, prior: prior.collect(), known }
    }

    /// Returns the next candidate to try with its prediction.
    pub(super) fn next(&self) -> Option<(usize, Costs)> {
        let untried = || {
            let all = (0..self.candidates.len()).filter(|&i| self.known[i] == Known::Nothing);
            all.map(|i| (i, self.predicted(i)))
        };
        let least = |axis: usize| {
            move |a: &(usize, Costs), b: &(usize, Costs)| {
                self.goal.axes(a.1)[axis].total_cmp(&self.goal.axes(b.1)[axis])
            }
        };
        if let (Goal::Budget(_), Some(anchor)) = (self.goal, self.anchor()) {
            return Some((anchor, self.predicted(anchor)));
        }
        let price_now = self.best().map(|best| self.costs(best)[1]);
        if price_now.is_some() && self.misses() >= MOST_MISSES {
            return None;
        }
        let promising = untried().filter(|&(i, predicted)| {
            let safety = if self.was_drawn(i) { SURE } else { UNSURE };
            let [limited, price] = self.goal.axes(predicted);
            limited * safety <= self.goal.limit() && price_now.is_none_or(|now| price < now * WORTH)
        });
        if let Some(next) = promising.min_by(least(1)) {
            return Some(next);
        }
        let Some(price_now) = price_now else {
            // Nothing promises to meet the goal: try the nearest candidate, unless it is known to be far off.
            let near = |&(i, predicted): &(usize, Costs)| {
                !self.was_drawn(i) || self.goal.axes(predicted)[0] <= self.goal.limit() * NEAR
            };
            return untried().filter(near).min_by(least(0));
        };
        // The most accurate setting of an untried family that would be a large improvement if the family were
        // much better than predicted.
        let surprise = |&(i, [error, ms]): &(usize, Costs)| {
            let was_tried = self.family(i).any(|other| self.known[other] != Known::Nothing);
            let [limited, price] = self.goal.axes([error / SURPRISE, ms]);
            !was_tried && limited <= self.goal.limit() && price < price_now * WORTH_A_SURPRISE
        };
        untried().filter(surprise).min_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]))
    }

    /// Returns the setting that tells how fast this scene is drawn, unless something was drawn: the fastest of those with
    /// a step, whose time grows with the picture as most others' does.
    fn anchor(&self) -> Option<usize> {
        if self.known.iter().any(|known| matches!(known, Known::Measured(_))) {
            return None;
        }
        let untried = (0..self.candidates.len()).filter(|&i| self.known[i] == Known::Nothing);
        let rank = |i: &usize| (!self.candidates[*i].has_step(), self.prior[*i][1]);
        untried.min_by(|a, b| {
            let ((a, a_ms), (b, b_ms)) = (rank(a), rank(b));
            a.cmp(&b).then(a_ms.total_cmp(&b_ms))
        })
    }

    /// Returns the number of trials that miss the goal.
    fn misses(&self) -> usize {
        let drawn = (0..self.candidates.len()).filter(|&i| matches!(self.known[i], Known::Measured(_)));
        drawn.filter(|&i| self.costs(i)[0] > self.goal.limit()).count()
    }

    /// Returns the neighbour of a setting in its family that misses the goal, with its costs, measured or predicted.
    pub(super) fn bracket(&self, best: usize) -> Option<(usize, Costs)> {
        let place = self.candidates[best].place;
        let next = match self.goal {
            Goal::MaxError(_) => place.checked_sub(1)?,
            Goal::Budget(_) => place + 1,
        };
        let other = self.family(best).find(|&i| self.candidates[i].place == next)?;
        let costs = match self.known[other] {
            Known::Measured(costs) => costs,
            Known::Nothing => self.predicted(other),
            Known::Refused => return None,
        };
        (self.goal.axes(costs)[0] > self.goal.limit()).then_some((other, costs))
    }

    /// Records the outcome of a trial.
    pub(super) fn learn(&mut self, candidate: usize, outcome: &TrialOutcome) {
        self.known[candidate] = match outcome {
            TrialOutcome::Drawn { .. } => Known::Measured(outcome.costs()),
            TrialOutcome::Refused(_) => Known::Refused,
        };
    }

    /// Returns the best tried candidate that meets the goal.
    pub(super) fn best(&self) -> Option<usize> {
        (0..self.candidates.len())
            .filter(|&i| self.costs(i)[0] <= self.goal.limit())
            .min_by(|&a, &b| self.costs(a)[1].total_cmp(&self.costs(b)[1]))
    }

    /// Returns the measured costs as [`Goal::axes`] orders them.
    fn costs(&self, candidate: usize) -> [f64; 2] {
        match self.known[candidate] {
            Known::Measured(costs) => self.goal.axes(costs),
            _ => [f64::INFINITY; 2],
        }
    }

    /// Returns the settings of the same family.
    fn family(&self, candidate: usize) -> impl Iterator<Item = usize> {
        let family = self.candidates[candidate].family;
        (0..self.candidates.len()).filter(move |&i| self.candidates[i].family == family)
    }

    /// Returns whether a setting of the same family was drawn.
    fn was_drawn(&self, candidate: usize) -> bool {
        self.family(candidate).any(|i| matches!(self.known[i], Known::Measured(_)))
    }

    /// Returns the logarithms of a drawn candidate's costs relative to those of the profile.
    fn shift(&self, candidate: usize) -> Option<Costs> {
        let Known::Measured([error, ms]) = self.known[candidate] else { return None };
        let [prior_error, prior_ms] = self.prior[candidate];
        let error = if error.is_finite() { error.max(LEAST_ERROR).ln() } else { 0.0 };
        Some([error - prior_error, ms.max(LEAST_MS).ln() - prior_ms])
    }

    /// Predicts a candidate's costs: those of the profile, corrected by trials.
    ///
    /// The correction is interpolated between the nearest trials of the same family on both sides; without
    /// any it is the mean of all trials.
    fn predicted(&self, candidate: usize) -> Costs {
        let place_of = |i: usize| self.candidates[i].place;
        let place = place_of(candidate);
        let of_family =
            || self.family(candidate).filter_map(|i| self.shift(i).map(|shift| (place_of(i), shift)));
        let below = of_family().filter(|(at, _)| *at < place).max_by_key(|(at, _)| *at);
        let above = of_family().filter(|(at, _)| *at > place).min_by_key(|(at, _)| *at);
        let shift = match (below, above) {
            (Some((_, shift)), None) | (None, Some((_, shift))) => shift,
            (Some((a, low)), Some((b, high))) => {
                let [a, b, at] = [a, b, place].map(num::f64_of);
                let x = (at - a) / (b - a);
                [0, 1].map(|axis| low[axis] + (high[axis] - low[axis]) * x)
            }
            (None, None) => {
                let all: Vec<Costs> = (0..self.candidates.len()).filter_map(|i| self.shift(i)).collect();
                let count = num::f64_of(all.len()).max(1.0);
                [0, 1].map(|axis| all.iter().map(|shift| shift[axis]).sum::<f64>() / count)
            }
        };
        [0, 1].map(|axis| (self.prior[candidate][axis] + shift[axis]).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Estimate, Source};
    use super::*;
    use crate::choice::table;

    /// Settings for grids with a step.
    fn stepped() -> Vec<Candidate> {
        let is_splats = |spec: &str| spec.starts_with("splat") || spec.starts_with("gaussians");
        let is_one = |c: &Candidate| c.spec.contains("step=") && !is_splats(&c.spec);
        table::every().into_iter().filter(is_one).collect()
    }

    /// Runs a search in which `cost` gives the true costs.
    fn search(goal: Goal, cost: impl Fn(&Candidate) -> Option<(f64, f64)>) -> (Option<usize>, Vec<usize>) {
        let candidates = stepped();
        let costs = candidates.iter().map(|c| (c.spec.clone(), rule(c, 1.0))).collect();
        let profile = Profile { source: Source::BuiltIn, costs };
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

    /// A budget says nothing of a scene whose scale is unknown: the fastest setting tells it, and what is tried then
    /// seldom misses.
    #[test]
    fn budgets_begin_with_the_fastest_setting_and_seldom_miss() {
        let candidates = stepped();
        for slower in [0.1, 1.0, 30.0] {
            for budget in [3.0, 10.0, 50.0] {
                let (limit, cost) = (budget * slower, |c: &Candidate| {
                    let (error, ms) = rule(c, 1.0);
                    Some((error, ms * slower))
                });
                let (best, tried) = search(Goal::Budget(limit), cost);
                let ms = |i: usize| cost(&candidates[i]).unwrap().1;
                let fastest = (0..candidates.len()).map(ms).fold(f64::INFINITY, f64::min);
                assert_eq!(ms(tried[0]), fastest, "{slower} {budget}");
                let missed = tried.iter().filter(|&&i| ms(i) > limit).count();
                assert!(missed <= 1, "{slower} {budget}: {missed} of {}", tried.len());
                assert!(ms(best.unwrap()) <= limit);
            }
        }
        // Where times are quite unlike those of the profile, a search with a result ends after some misses.
        let odd = |c: &Candidate| Some((1e-3 / (c.place + 1) as f64, if c.place == 0 { 1.0 } else { 6.0 }));
        let (best, tried) = search(Goal::Budget(5.0), odd);
        assert!(best.is_some());
        let missed = tried.iter().filter(|&&i| candidates[i].place > 0).count();
        assert_eq!(missed, 3, "{}", tried.len());
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
