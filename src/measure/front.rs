//! Time at equal error: the Pareto front of measured costs, and times interpolated on it.
//!
//! Each setting of a technique costs time and leaves an error. Only settings that no other one beats in both
//! are worth choosing; they form the front. Two techniques are compared by their times at one error. These
//! are interpolated linearly between neighbours of the front in the logarithms of both, since time and error
//! are powers of a technique's parameter. Nothing is extrapolated beyond the ends of a front.

/// The cost of one setting of a technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Time, in any unit; more than 0.
    pub time: f64,
    /// Error, in any measure; 0 or more.
    pub error: f64,
}

/// The costs that no other cost beats in both time and error.
#[derive(Clone, Debug, PartialEq)]
pub struct Front {
    members: Vec<(usize, Cost)>,
}

/// The time in which a technique reaches an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TimeAt {
    /// Interpolated between two members of the front, or the time of one.
    Interpolated(f64),
    /// Upper bound: the fastest member takes this time and has a smaller error still. Coarser and faster
    /// settings have not been measured.
    AtMost(f64),
    /// No member's error is so small.
    NotReached,
}

impl TimeAt {
    /// Returns the time or its upper bound if the error is reached.
    #[must_use]
    pub fn time(self) -> Option<f64> {
        match self {
            Self::Interpolated(time) | Self::AtMost(time) => Some(time),
            Self::NotReached => None,
        }
    }
}

impl Front {
    /// Finds the front of some costs.
    ///
    /// A cost is ignored if its time is not positive and finite, or if its error is negative, infinite or
    /// NaN. The first of equal costs is kept.
    #[must_use]
    pub fn new(costs: &[Cost]) -> Self {
        let valid = |cost: &Cost| {
            cost.time > 0.0 && cost.time.is_finite() && cost.error >= 0.0 && cost.error.is_finite()
        };
        let mut sorted: Vec<(usize, Cost)> =
            costs.iter().copied().enumerate().filter(|(_, cost)| valid(cost)).collect();
        // Stable: equal costs keep their order.
        sorted.sort_by(|(_, a), (_, b)| a.time.total_cmp(&b.time).then(a.error.total_cmp(&b.error)));
        let mut members: Vec<(usize, Cost)> = Vec::new();
        for (place, cost) in sorted {
            // A slower setting belongs to the front only if it is more accurate than all faster ones.
            if members.last().is_none_or(|(_, last)| cost.error < last.error) {
                members.push((place, cost));
            }
        }
        Self { members }
    }

    /// Returns the members with their indices among the given costs; times ascend, errors descend.
    #[must_use]
    pub fn members(&self) -> &[(usize, Cost)] {
        &self.members
    }

    /// Returns the time in which the error is reached.
    #[must_use]
    pub fn time_at(&self, error: f64) -> TimeAt {
        // Errors descend: the first member that is good enough is the fastest one.
        let Some(place) = self.members.iter().position(|(_, cost)| cost.error <= error) else {
            return TimeAt::NotReached;
        };
        let fine = self.members[place].1;
        if fine.error.total_cmp(&error).is_eq() {
            return TimeAt::Interpolated(fine.time);
        }
        // An error of 0 has no logarithm, so nothing can be interpolated towards it.
        let coarse = place.checked_sub(1).map(|before| self.members[before].1);
        let Some(coarse) = coarse.filter(|_| fine.error > 0.0) else {
            return TimeAt::AtMost(fine.time);
        };
        let share = (coarse.error / error).ln() / (coarse.error / fine.error).ln();
        TimeAt::Interpolated(coarse.time * (fine.time / coarse.time).powf(share))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn front(costs: &[(f64, f64)]) -> Front {
        let costs: Vec<Cost> = costs.iter().map(|&(time, error)| Cost { time, error }).collect();
        Front::new(&costs)
    }

    fn places(costs: &[(f64, f64)]) -> Vec<usize> {
        front(costs).members().iter().map(|(place, _)| *place).collect()
    }

    #[test]
    fn only_what_nothing_beats_is_on_the_front() {
        // Beaten in both; equal in time; equal in error; a duplicate.
        let costs = [(4.0, 0.1), (5.0, 0.2), (4.0, 0.3), (6.0, 0.1), (1.0, 0.5), (1.0, 0.5), (9.0, 0.01)];
        assert_eq!(places(&costs), [4, 0, 6]);
        let members: Vec<Cost> = front(&costs).members().iter().map(|(_, cost)| *cost).collect();
        assert!(members.windows(2).all(|pair| pair[0].time < pair[1].time && pair[0].error > pair[1].error));
        assert!(places(&[]).is_empty());
    }

    #[test]
    fn what_is_no_measurement_takes_no_part() {
        let costs = [
            (f64::NAN, 0.1),
            (1.0, f64::NAN),
            (1.0, f64::INFINITY),
            (f64::INFINITY, 0.0),
            (0.0, 0.0),
            (-1.0, 0.0),
            (1.0, -0.1),
            (2.0, 0.1),
        ];
        assert_eq!(places(&costs), [7]);
    }

    #[test]
    fn times_lie_on_straight_lines_in_logarithms() {
        // error = 1 / time^2 between the first two, 1e-2 / time beyond: powers are interpolated exactly.
        let front = front(&[(100.0, 1e-4), (1.0, 1.0), (10.0, 1e-2), (50.0, 0.5)]);
        for (error, time) in [(0.25, 2.0), (1.0 / 49.0, 7.0), (1e-3, 10.0_f64.powf(1.5))] {
            let TimeAt::Interpolated(found) = front.time_at(error) else {
                panic!("{error}: {:?}", front.time_at(error));
            };
            assert!((found / time - 1.0).abs() < 1e-12, "{error}: {found}, not {time}");
        }
        // The time of a member is returned as measured.
        for (time, error) in [(1.0, 1.0), (10.0, 1e-2), (100.0, 1e-4)] {
            assert_eq!(front.time_at(error), TimeAt::Interpolated(time));
        }
    }

    #[test]
    fn nothing_is_said_beyond_the_ends() {
        let front = front(&[(10.0, 1e-2), (100.0, 1e-4)]);
        assert_eq!(front.time_at(1e-1), TimeAt::AtMost(10.0));
        assert_eq!(front.time_at(0.99e-4), TimeAt::NotReached);
        assert_eq!(front.time_at(f64::NAN), TimeAt::NotReached);
        assert_eq!(super::Front::new(&[]).time_at(1.0), TimeAt::NotReached);
        assert_eq!(TimeAt::AtMost(10.0).time(), Some(10.0));
        assert_eq!(TimeAt::NotReached.time(), None);
    }

    #[test]
    fn an_error_of_nought_is_reached_only_by_its_own_member() {
        let front = front(&[(10.0, 1e-2), (100.0, 0.0)]);
        assert_eq!(front.time_at(1e-3), TimeAt::AtMost(100.0));
        assert_eq!(front.time_at(0.0), TimeAt::Interpolated(100.0));
    }
}
