//! The median distance between neighbouring points.

use std::cmp::Ordering;

use glam::DVec3;
use rayon::prelude::*;

use crate::num;

/// Largest number of distances that the median is taken of.
const DRAWN: usize = 1 << 16;

/// Points that are closer together than this share of the inner extent are at one place.
const SAME: f64 = 1e-6;

/// Largest number of points in a leaf of the tree.
const LEAF: usize = 8;

/// Returns the median distance to the nearest point at another place, or `None` if all points are at one
/// place.
///
/// A k-d tree (Friedman, Bentley and Finkel 1977) finds the neighbours. Its leaves hold equal numbers of
/// points, so an outlier costs no more than any other point, unlike in a uniform grid.
pub(super) fn median(centres: &[DVec3]) -> Option<f64> {
    let mut tree = centres.to_vec();
    let same = SAME * inner_extent(&mut tree);
    // Keep one point of each place.
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
    // Points on both sides of a cell's border may still be at one place; distances of far outliers may
    // overflow float64.
    let apart = |distance: &f64| *distance > same && distance.is_finite();
    let mut distances: Vec<f64> = asked.par_iter().map(distance).filter(apart).collect();
    let middle = distances.len().checked_sub(1)? / 2;
    Some(*distances.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Returns the extent along the longest axis, without a tenth of the points at each end.
fn inner_extent(points: &mut [DVec3]) -> f64 {
    let Some(last) = points.len().checked_sub(1) else { return 0.0 };
    let mut rank =
        |axis: usize, i: usize| points.select_nth_unstable_by(i, |a, b| a[axis].total_cmp(&b[axis])).1[axis];
    let tenth = num::usize_of(0.1 * num::f64_of(last));
    (0..3).map(|axis| rank(axis, last - tenth) - rank(axis, tenth)).fold(0.0, f64::max)
}

/// Compares `of` each coordinate: by x, then y, then z, evaluated only as far as needed.
fn order(a: DVec3, b: DVec3, of: impl Fn(f64) -> f64) -> Ordering {
    let along = |axis: usize| of(a[axis]).total_cmp(&of(b[axis]));
    along(0).then_with(|| along(1)).then_with(|| along(2))
}

/// Builds the tree in place: the median along an axis goes to the middle, lower points before it, higher ones
/// after it, recursively.
fn build(points: &mut [DVec3], axis: usize) {
    if points.len() > LEAF {
        let middle = points.len() / 2;
        let (below, _, above) = points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
        let next = (axis + 1) % 3;
        rayon::join(|| build(below, next), || build(above, next));
    }
}

/// Lowers `nearest`, a squared distance, to that of the nearest point other than `p`.
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
        // A flat lattice.
        assert_eq!(median(&lattice(9).map(|p| p * DVec3::new(1.0, 2.0, 0.0)).collect::<Vec<_>>()), Some(1.0));
        // Each point three times, one of them off by rounding, and two outliers, one of them near the limit
        // of float64.
        let far = [DVec3::splat(1e12), DVec3::new(-f64::MAX, 0.0, f64::MAX)];
        let thrice = |p: DVec3| [p, p, p + DVec3::splat(1e-8)];
        let many: Vec<DVec3> = lattice(9).flat_map(thrice).chain(far).collect();
        let got = median(&many).unwrap();
        assert!((got - 1.0).abs() < 1e-6, "{got}");
        // Hundreds of thousands of coincident points take no noticeable time and are one place.
        let mut heap = vec![DVec3::ONE; 300_000];
        assert_eq!(median(&heap), None);
        heap.extend([DVec3::ZERO; 3]);
        assert_eq!(median(&heap), Some(3.0_f64.sqrt()));
        assert_eq!((median(&[]), median(&[DVec3::X])), (None, None));
    }
}
