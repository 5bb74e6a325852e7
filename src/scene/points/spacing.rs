//! How far apart points are.

use std::cmp::Ordering;

use glam::DVec3;
use rayon::prelude::*;

use crate::num;

/// Distances that the median is taken of.
const DRAWN: usize = 1 << 16;

/// Points that are nearer than this share of the extent of the inner eight tenths are at one place.
const SAME: f64 = 1e-6;

/// Points in a leaf of the tree at most.
const LEAF: usize = 8;

/// Median distance to the nearest point at another place; `None` where all are at one.
///
/// Neighbours are found in a k-d tree (Friedman, Bentley and Finkel 1977), whose leaves hold equally many points: unlike
/// in cells of equal size an outlier costs no more than any other point.
pub(super) fn median(centres: &[DVec3]) -> Option<f64> {
    let mut tree = centres.to_vec();
    let same = SAME * inner_extent(&mut tree);
    // One point of each place.
    if same > 0.0 {
        let cell = |x: f64| (x / same).floor();
        tree.par_sort_unstable_by(|a, b| order(*a, *b, cell).then_with(|| order(*a, *b, |x| x)));
        tree.dedup_by(|a, b| order(*a, *b, cell).is_eq());
    } else {
        tree.par_sort_unstable_by(|a, b| order(*a, *b, |x| x));
        tree.dedup();
    }
    let step = tree.len().div_ceil(DRAWN).max(1);
    let asked: Vec<DVec3> = tree.iter().copied().step_by(step).collect();
    build(&mut tree, 0);
    let distance = |&p: &DVec3| {
        let mut nearest = f64::INFINITY;
        search(&tree, 0, p, &mut nearest);
        nearest.sqrt()
    };
    // Across the side of a cell points may still be at one place; far outliers have distances beyond float64.
    let apart = |distance: &f64| *distance > same && distance.is_finite();
    let mut distances: Vec<f64> = asked.par_iter().map(distance).filter(apart).collect();
    let middle = distances.len().checked_sub(1)? / 2;
    Some(*distances.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Extent along the longest axis, but for a tenth of the points at each end.
fn inner_extent(points: &mut [DVec3]) -> f64 {
    let Some(last) = points.len().checked_sub(1) else { return 0.0 };
    let mut rank =
        |axis: usize, i: usize| points.select_nth_unstable_by(i, |a, b| a[axis].total_cmp(&b[axis])).1[axis];
    let tenth = num::usize_of(0.1 * num::f64_of(last));
    (0..3).map(|axis| rank(axis, last - tenth) - rank(axis, tenth)).fold(0.0, f64::max)
}

/// By x, then y, then z, of each what a function makes of it, which is asked no more often than needed.
fn order(a: DVec3, b: DVec3, of: impl Fn(f64) -> f64) -> Ordering {
    let along = |axis: usize| of(a[axis]).total_cmp(&of(b[axis]));
    along(0).then_with(|| along(1)).then_with(|| along(2))
}

/// Puts the median along an axis into the middle, what is below before it, what is above behind, and so on.
fn build(points: &mut [DVec3], axis: usize) {
    if points.len() > LEAF {
        let middle = points.len() / 2;
        let (below, _, above) = points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
        let next = (axis + 1) % 3;
        rayon::join(|| build(below, next), || build(above, next));
    }
}

/// Lowers `nearest`, the square of a distance, to that of the nearest point that is not `p`.
fn search(points: &[DVec3], axis: usize, p: DVec3, nearest: &mut f64) {
    let mut look = |q: DVec3| {
        if q != p {
            *nearest = nearest.min(q.distance_squared(p));
        }
    };
    if points.len() <= LEAF {
        points.iter().for_each(|q| look(*q));
        return;
    }
    let middle = points.len() / 2;
    let q = points[middle];
    look(q);
    let (below, above) = (&points[..middle], &points[middle + 1..]);
    let offset = p[axis] - q[axis];
    let (near, far) = if offset < 0.0 { (below, above) } else { (above, below) };
    let next = (axis + 1) % 3;
    search(near, next, p, nearest);
    if offset * offset < *nearest {
        search(far, next, p, nearest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Field;

    #[test]
    fn it_is_the_median_of_all_distances() {
        let points = Field::Ramp.points(1501).unwrap();
        let centres = points.centres();
        let nearest = |p: &DVec3| {
            let others = centres.iter().filter(|q| *q != p);
            others.map(|q| q.distance(*p)).fold(f64::INFINITY, f64::min)
        };
        let mut all: Vec<f64> = centres.iter().map(nearest).collect();
        all.sort_by(f64::total_cmp);
        for scale in [1e-9, 1.0, 1e9] {
            let scaled: Vec<DVec3> = centres.iter().map(|p| *p * scale).collect();
            let got = median(&scaled).unwrap();
            assert!((got / scale - all[750]).abs() < 1e-12 * all[750], "{got} {}", all[750]);
        }
    }

    #[test]
    fn coincident_points_and_outliers_change_little() {
        let lattice = |n: u32| {
            let line = move || (0..n).map(f64::from);
            line().flat_map(move |z| line().flat_map(move |y| line().map(move |x| DVec3::new(x, y, z))))
        };
        assert_eq!(median(&lattice(9).collect::<Vec<_>>()), Some(1.0));
        // A flat one.
        assert_eq!(median(&lattice(9).map(|p| p * DVec3::new(1.0, 2.0, 0.0)).collect::<Vec<_>>()), Some(1.0));
        // Each point three times, one of them off by rounding; two far away, one of them at the end of float64.
        let far = [DVec3::splat(1e12), DVec3::new(-f64::MAX, 0.0, f64::MAX)];
        let thrice = |p: DVec3| [p, p, p + DVec3::splat(1e-8)];
        let many: Vec<DVec3> = lattice(9).flat_map(thrice).chain(far).collect();
        let got = median(&many).unwrap();
        assert!((got - 1.0).abs() < 1e-6, "{got}");
        // Hundreds of thousands at one place take no time of note, and are one place.
        let mut heap = vec![DVec3::ONE; 300_000];
        assert_eq!(median(&heap), None);
        heap.extend([DVec3::ZERO; 3]);
        assert_eq!(median(&heap), Some(3.0_f64.sqrt()));
        assert_eq!((median(&[]), median(&[DVec3::X])), (None, None));
    }
}
