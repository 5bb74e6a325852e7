//! The scalars of a transfer function that absorb light, as intervals of `f32`.

use crate::num::f32_of;
use crate::scene::{Knot, TransferFunction};

/// Returns the largest `f32` that is not above `value`.
pub(crate) fn below(value: f64) -> f32 {
    let near = f32_of(value);
    if f64::from(near) > value { near.next_down() } else { near }
}

/// Returns the smallest `f32` that is not below `value`.
pub(crate) fn above(value: f64) -> f32 {
    -below(-value)
}

/// Returns the scalars that absorb light as intervals `[first, last]` of `f32`, ascending and disjoint.
///
/// Outside of them no `f32` has an extinction above 0. Constant ends reach to the largest `f32`. An end where the
/// extinction falls to 0 continuously does not belong to the interval, so that a brick that holds only this scalar
/// (often the background) is empty; an end at a jump belongs to it. Adjacent segments that share a knot make one
/// interval.
///
/// Samples of minus infinity count as `-f32::MAX` in the ranges of bricks. They take the scalar of the first knot, and
/// the right side of a jump there. If that absorbs, and lower scalars do not, `[-f32::MAX, -f32::MAX]` is an interval
/// too. Plus infinity needs no such case: the value of the last knot is that of its constant end.
pub(crate) fn nonzero_ranges(transfer: &TransferFunction) -> Vec<[f32; 2]> {
    let mut ranges: Vec<[f32; 2]> = Vec::new();
    let mut push = |range: [f32; 2]| match ranges.last_mut() {
        // Intervals that are apart in float64 may touch in float32.
        Some(before) if before[1] >= range[0] => before[1] = before[1].max(range[1]),
        _ => ranges.push(range),
    };
    // On the device, knots that are equal in float32 make a jump.
    let jumps = |a: &Knot, b: &Knot| f32_of(a.s) == f32_of(b.s);
    let first = |s: f64, jump: bool| {
        let at = below(s);
        if jump { at } else { at.next_up() }.clamp(-f32::MAX, f32::MAX)
    };
    let last = |s: f64, jump: bool| -first(-s, jump);

    let knots = transfer.knots();
    let (Some(start), Some(end)) = (knots.first(), knots.last()) else { return ranges };
    let mut from = (start.tau > 0.0).then_some(-f32::MAX);
    if knots.iter().take_while(|knot| jumps(start, knot)).any(|knot| knot.tau > 0.0) {
        push([-f32::MAX, -f32::MAX]);
    }
    // Whether the segment before this one is a jump.
    let mut jump = false;
    for (a, b) in knots.iter().zip(knots.iter().skip(1)) {
        if a.tau > 0.0 || b.tau > 0.0 {
            from = from.or_else(|| Some(first(a.s, jumps(a, b))));
        } else if let Some(from) = from.take() {
            push([from, last(a.s, jump)]);
        }
        jump = jumps(a, b);
    }
    if let Some(from) = from {
        push([from, if end.tau > 0.0 { f32::MAX } else { last(end.s, jump) }]);
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAX: f32 = f32::MAX;

    fn transfer(taus: &[(f64, f64)]) -> TransferFunction {
        let rows: Vec<_> = taus.iter().map(|&(s, tau)| [s, 1.0, 1.0, 1.0, tau]).collect();
        TransferFunction::from_rows(&rows).unwrap()
    }

    #[test]
    fn intervals_merge_and_reach_the_constant_ends() {
        let of = |taus: &[(f64, f64)]| nonzero_ranges(&transfer(taus));
        assert_eq!(of(&[(0.0, 0.0), (1.0, 0.0)]), Vec::<[f32; 2]>::new());
        assert_eq!(of(&[(5.0, 0.0)]), Vec::<[f32; 2]>::new());
        assert_eq!(of(&[(5.0, 1.0)]), [[-MAX, MAX]]);
        // A ramp from 0 up, and the same down.
        assert_eq!(of(&[(1.0, 0.0), (2.0, 1.0)]), [[1.0_f32.next_up(), MAX]]);
        assert_eq!(of(&[(1.0, 3.0), (2.0, 0.0)]), [[-MAX, 2.0_f32.next_down()]]);
        // Two hats that share a knot, and one apart.
        let hats =
            [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 1.0), (4.0, 0.0), (5.0, 0.0), (6.0, 1.0), (7.0, 0.0)];
        let up = f32::next_up;
        let down = f32::next_down;
        assert_eq!(of(&hats), [[up(0.0), down(4.0)], [up(5.0), down(7.0)]]);
    }

    #[test]
    fn ends_at_jumps_belong_to_the_interval() {
        let of = |taus: &[(f64, f64)]| nonzero_ranges(&transfer(taus));
        let block = [(0.0, 0.0), (1.0, 0.0), (1.0, 4.0), (2.0, 4.0), (2.0, 0.0), (3.0, 0.0)];
        assert_eq!(of(&block), [[1.0, 2.0]]);
        // A jump up and down again on one scalar.
        assert_eq!(of(&[(0.0, 0.0), (1.0, 0.0), (1.0, 4.0), (1.0, 0.0), (2.0, 0.0)]), [[1.0, 1.0]]);
        // Not an f32: outward, and no closer than the device's own rounding.
        let [lo, hi] = of(&[(0.0, 0.0), (0.1, 0.0), (0.1, 4.0), (0.7, 4.0), (0.7, 0.0), (1.0, 0.0)])[0];
        assert!(f64::from(lo) < 0.1 && f64::from(hi) > 0.7 && lo > 0.099_999 && hi < 0.700_001);
        // A ramp narrower than float32 resolves is a jump on the device.
        assert_eq!(of(&[(0.0, 0.0), (1.0, 0.0), (1.0 + 1e-12, 4.0)]), [[1.0, MAX]]);
        let needle =
            of(&[(0.0, 0.0), (1.0 + 1e-12, 0.0), (1.0 + 2e-12, 4.0), (1.0 + 3e-12, 0.0), (2.0, 0.0)]);
        assert_eq!(needle, [[1.0, 1.0_f32.next_up()]]);
        // Apart in float64 only.
        let split = [(1.0, 0.0), (1.0, 4.0), (2.0, 4.0), (2.0, 0.0), (2.0 + 1e-12, 0.0), (2.0 + 1e-12, 4.0)];
        assert_eq!(of(&split)[1..], [[1.0, MAX]]);
    }

    #[test]
    fn knots_beyond_float32_keep_the_intervals_finite() {
        let of = |taus: &[(f64, f64)]| nonzero_ranges(&transfer(taus));
        let far = [(-1e300, 1.0), (-1e300, 0.0), (1e300, 0.0), (1e300, 1.0)];
        assert_eq!(of(&far), [[-MAX, -MAX], [MAX, MAX]]);
        assert_eq!(of(&[(-1e300, 0.0), (-1e300, 1.0), (1e300, 0.0)]), [[-MAX, MAX]]);
        assert_eq!(of(&[(0.0, 0.0), (f64::from(MAX), 0.0), (1e300, 1.0)]), [[MAX, MAX]]);
    }

    #[test]
    fn minus_infinity_takes_the_right_side_of_a_jump_at_the_first_knot() {
        let low = transfer(&[(0.0, 0.0), (0.0, 2.0), (1.0, 0.0)]);
        assert!(low.at(low.domain()[0]).1 > 0.0 && low.at(-1.0).1 == 0.0);
        assert_eq!(nonzero_ranges(&low), [[-MAX, -MAX], [0.0, 1.0_f32.next_down()]]);
    }

    #[test]
    fn outside_of_the_intervals_the_extinction_is_zero_and_inside_it_is_not() {
        // Every sequence of four taus on knots of which the middle two may coincide.
        for code in 0..32_u32 {
            let tau = |bit: u32| f64::from(code >> bit & 1);
            let middle = if code & 16 == 0 { 1.0 } else { 0.4 };
            let knots = [(0.1, tau(0)), (0.4, tau(1)), (middle, tau(2)), (2.0, tau(3))];
            let transfer = transfer(&knots);
            let ranges = nonzero_ranges(&transfer);
            assert!(ranges.iter().all(|range| range[0] <= range[1]));
            assert!(ranges.is_sorted_by(|a, b| a[1] < b[0]));
            for i in -100..300 {
                let centre = f32_of(f64::from(i) / 100.0);
                for s in [centre.next_down(), centre, centre.next_up()] {
                    let inside = ranges.iter().any(|range| range[0] <= s && s <= range[1]);
                    let tau = transfer.at(f64::from(s)).1;
                    assert!(inside || tau == 0.0, "{knots:?} at {s}: {tau}, {ranges:?}");
                    let at_a_knot = knots.iter().any(|knot| (knot.0 - f64::from(s)).abs() < 1e-6);
                    assert!(!inside || tau > 0.0 || at_a_knot, "{knots:?} at {s}: 0, {ranges:?}");
                }
            }
        }
    }
}
