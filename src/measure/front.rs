//! Time at equal error: the lower-left front of measured costs, and times read off it.
//!
//! A technique has knobs, and each setting costs a time and leaves an error. Only settings that no other
//! one beats in both are worth choosing: they are the front. Two techniques are compared by their times at
//! one error, read off their fronts by straight lines between neighbours in logarithms of both, since
//! time and error are powers of the knob. Beyond the ends of a front nothing has been measured, and
//! nothing is said.

/// What one setting of a technique costs.
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
    /// Between two members of the front, or at one.
    Interpolated(f64),
    /// The fastest member has a smaller error still: it takes this time, and whether a coarser and faster
    /// setting would do has not been measured.
    AtMost(f64),
    /// No member's error is so small.
    NotReached,
}

impl TimeAt {
    /// The time, if the error is reached: exact, or the most that it is.
    #[must_use]
    pub fn time(self) -> Option<f64> {
        match self {
            Self::Interpolated(time) | Self::AtMost(time) => Some(time),
            Self::NotReached => None,
        }
    }
}

impl Front {
    /// The front of some costs. A cost whose time is not positive and finite, or whose error is negative,
    /// infinite or NaN, takes no part. Of equal costs the first is kept.
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
            // A slower setting is worth its time only when it is more accurate than all faster ones.
            if members.last().is_none_or(|(_, last)| cost.error < last.error) {
                members.push((place, cost));
            }
        }
        Self { members }
    }

    /// The members with their places among the costs given; times ascend, errors descend.
    #[must_use]
    pub fn members(&self) -> &[(usize, Cost)] {
        &self.members
    }

    /// The time in which the error is reached.
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
        // An error of 0 has no logarithm, and so no line leads to it.
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
        // Beaten in both; equal in time; equal in error; the same again.
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
        // error = 1 / time^2 between the first two, 1e-2 / time beyond: powers are met exactly.
        let front = front(&[(100.0, 1e-4), (1.0, 1.0), (10.0, 1e-2), (50.0, 0.5)]);
        for (error, time) in [(0.25, 2.0), (1.0 / 49.0, 7.0), (1e-3, 10.0_f64.powf(1.5))] {
            let TimeAt::Interpolated(found) = front.time_at(error) else {
                panic!("{error}: {:?}", front.time_at(error));
            };
            assert!((found / time - 1.0).abs() < 1e-12, "{error}: {found}, not {time}");
        }
        // A member is met as measured.
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
