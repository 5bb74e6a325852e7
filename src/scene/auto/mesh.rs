//! The automatic transfer function of a mesh.

use glam::DVec3;
use rayon::prelude::*;

use super::statistics::{
    BINS, COOL, HALVES, Histogram, RAYS, SAMPLES, WARM, diverging, hazy, knot, quantile, ramp, ramp_down,
    signs, span, stride, substantial,
};
use crate::error::Result;
use crate::num;
use crate::scene::{Knot, TetScalars, Tets, TransferFunction};

/// Number of values for the histogram; each represents an equal share of the volume.
const DRAWN: usize = 1 << 16;

/// Share of the volume around the peak's value from which on the peak is background.
const BACKGROUND: f64 = 0.1;

/// If the values on one side of the background have no more than this share of the volume, and those on the
/// other side more, only the other side is shown.
const NEGLIGIBLE: f64 = 0.002;

pub(super) fn transfer(mesh: &Tets) -> Result<TransferFunction> {
    hazy(shape(mesh), |transfer| dense_depth(mesh, transfer))
}

/// Returns the knots, with extinction relative to its largest value.
fn shape(mesh: &Tets) -> Vec<Knot> {
    let [lo, hi] = mesh.range();
    let values = drawn(mesh);
    if lo >= hi || values.is_empty() {
        return vec![knot(lo, 1.0, WARM[3])];
    }
    let histogram = Histogram::new(&values, [lo, hi]);
    let peak = histogram.peak();
    let about = peak.saturating_sub(BINS / 64)..=(peak + BINS / 64).min(BINS - 1);
    let size = num::f64_of(histogram.counts[about].iter().sum());
    if size < BACKGROUND * num::f64_of(values.len()) {
        return match signs(&values, HALVES) {
            Some(_) => diverging(&values, 0.0),
            None => ramp(histogram.low, &values, &WARM),
        };
    }
    let [foot_below, foot_above] = [false, true].map(|upwards| histogram.foot(peak, upwards));
    let mut below = values[..values.partition_point(|s| *s < foot_below)].to_vec();
    let mut above = values[values.partition_point(|s| *s <= foot_above)..].to_vec();
    let few = num::usize_of(NEGLIGIBLE * num::f64_of(values.len()));
    if below.len() <= few && above.len() <= few {
        // The drawn values may have missed such a small part; the range still shows that it exists.
        below.extend((below.is_empty() && lo < foot_below).then_some(lo));
        above.extend((above.is_empty() && hi > foot_above).then_some(hi));
    } else if below.len() <= few {
        below.clear();
    } else if above.len() <= few {
        above.clear();
    }
    let cool = (!below.is_empty()).then(|| ramp_down(foot_below, &below, &COOL));
    let warm = (!above.is_empty()).then(|| ramp(foot_above, &above, &WARM));
    cool.into_iter().chain(warm).flatten().collect()
}

/// Returns corners and scalars of a tetrahedron, or `None` where a scalar is not finite.
fn tet(mesh: &Tets, cell: usize) -> Option<([DVec3; 4], [f64; 4])> {
    let corners = mesh.cells()[cell].map(num::index);
    let s = match mesh.scalars() {
        TetScalars::Point(values) => corners.map(|i| values[i]),
        TetScalars::Cell(values) => [values[cell]; 4],
    };
    s.iter().all(|s| s.is_finite()).then(|| (corners.map(|i| mesh.points()[i]), s.map(f64::from)))
}

/// Returns values that represent equal shares of the volume, ascending.
pub(super) fn drawn(mesh: &Tets) -> Vec<f64> {
    let count = mesh.cells().len();
    let mut values: Vec<(f64, f64)> = (0..count)
        .into_par_iter()
        .step_by(stride(count, SAMPLES))
        .filter_map(|cell| tet(mesh, cell))
        .flat_map_iter(|([a, b, c, d], s)| {
            // A quarter of the cell around each corner has the value halfway between corner and centroid.
            let volume = (b - a).cross(c - a).dot(d - a);
            let middle = s.iter().map(|s| 0.25 * s).sum::<f64>();
            s.into_iter().map(move |s| (0.5 * s + 0.5 * middle, volume))
        })
        .collect();
    values.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let total: f64 = values.iter().map(|(_, volume)| volume).sum();
    let mut drawn = Vec::with_capacity(DRAWN);
    let mut below = 0.0;
    for (s, volume) in values {
        below += volume;
        let wanted = num::usize_of(below / total * num::f64_of(DRAWN) + 0.5).min(DRAWN);
        drawn.resize(wanted.max(drawn.len()), s);
    }
    drawn
}

/// Returns the 90 % quantile of optical depth over axis-aligned rays, leaving out nearly empty ones.
pub(super) fn dense_depth(mesh: &Tets, transfer: &TransferFunction) -> f64 {
    let depths = (0..3).into_par_iter().flat_map(|axis| ray_depths(mesh, transfer, axis)).collect();
    let depth = quantile(&substantial(depths), 0.9);
    let [low, high] = mesh.bounds();
    // Features that every ray misses are smaller than the distance between rays.
    if depth > 0.0 { depth } else { (high - low).max_element() / num::f64_of(RAYS).sqrt() }
}

/// Returns the optical depths of parallel rays along one axis.
///
/// Each cell counts with the scalar at the middle of its chord.
fn ray_depths(mesh: &Tets, transfer: &TransferFunction, axis: usize) -> Vec<f64> {
    let side = num::usize_of(num::f64_of(RAYS).sqrt());
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let [low, high] = mesh.bounds();
    let step = (high - low) / num::f64_of(side);
    // Offset from the middle by different amounts, so that no ray lies in the faces of a lattice.
    let place =
        |axis: usize, i: usize| low[axis] + step[axis] * (num::f64_of(i) + [0.4427, 0.5839, 0.5][axis]);
    let mut depths = vec![0.0; side * side];
    for ([a, b, c, d], s) in (0..mesh.cells().len()).filter_map(|cell| tet(mesh, cell)) {
        let (least, most) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
        let span = |axis: usize| span([least[axis] - low[axis], most[axis] - low[axis]], step[axis], side);
        // Gradients of three barycentric coordinates.
        let [p, q, r] = [b - a, c - a, d - a];
        let volume = p.dot(q.cross(r));
        let gradients = [q.cross(r), r.cross(p), p.cross(q)].map(|normal| normal / volume);
        for j in span(v) {
            for i in span(u) {
                let mut from = a;
                (from[u], from[v]) = (place(u, i), place(v, j));
                // Value at the beginning of the ray and slope of each barycentric coordinate.
                let [x, y, z] = gradients.map(|gradient| (gradient.dot(from - a), gradient[axis]));
                let coordinates = [(1.0 - x.0 - y.0 - z.0, -x.1 - y.1 - z.1), x, y, z];
                let (mut t0, mut t1) = (f64::NEG_INFINITY, f64::INFINITY);
                for (at, slope) in coordinates {
                    if slope > 0.0 {
                        t0 = t0.max(-at / slope);
                    } else if slope < 0.0 {
                        t1 = t1.min(-at / slope);
                    } else if at < 0.0 {
                        t1 = f64::NEG_INFINITY;
                    }
                }
                if t0 < t1 && (t1 - t0).is_finite() {
                    let middle = 0.5 * (t0 + t1);
                    let scalar: f64 =
                        coordinates.iter().zip(s).map(|((at, slope), s)| (at + slope * middle) * s).sum();
                    depths[j * side + i] += (t1 - t0) * transfer.at(scalar).1;
                }
            }
        }
    }
    depths
}

#[cfg(test)]
mod tests {
    use super::super::statistics::HAZE;
    use super::*;
    use crate::scene::Field;

    /// A mesh of cubes in a box of a given side; scalars are a function of the position in [-1, 1]³.
    fn mesh(side: f64, value: impl Fn(DVec3) -> f64) -> Tets {
        let unit = Field::Ramp.tets(16).unwrap();
        let scalars = unit.points().iter().map(|&p| num::f32_of(value(p))).collect();
        let points = unit.points().iter().map(|p| *p * (0.5 * side)).collect();
        Tets::new(points, unit.cells().to_vec(), TetScalars::Point(scalars)).unwrap().0
    }

    /// Optical depth of the ray through the middle along x.
    fn middle_depth(side: f64, transfer: &TransferFunction, value: impl Fn(DVec3) -> f64) -> f64 {
        let steps = 1000;
        let place = |i: i32| DVec3::new((f64::from(i) + 0.5) / f64::from(steps) * 2.0 - 1.0, 0.0, 0.0);
        (0..steps).map(|i| transfer.at(value(place(i))).1).sum::<f64>() * side / f64::from(steps)
    }

    /// A stream of value 7 with a hot ball and a cold one.
    fn stream(p: DVec3) -> f64 {
        let ball = |x: f64| 1.0 - ((p - DVec3::new(x, 0.0, 0.0)).length() / 0.45).min(1.0);
        7.0 + 5.0 * ball(-0.5) - 2.0 * ball(0.5)
    }

    #[test]
    fn displacements_of_both_signs_diverge() {
        let mesh = Field::Ramp.tets(6).unwrap();
        let scalars = mesh.points().iter().map(|p| num::f32_of(p.x + 0.3 * p.y)).collect();
        let mesh =
            Tets::new(mesh.points().to_vec(), mesh.cells().to_vec(), TetScalars::Point(scalars)).unwrap().0;
        let transfer = transfer(&mesh).unwrap();
        assert!(
            crate::scene::auto::diverges(&transfer) && transfer.at(-0.9).1 > transfer.at(0.0).1,
            "{transfer:?}"
        );
    }

    #[test]
    fn what_differs_from_the_stream_is_seen_on_both_sides_in_any_unit_of_length() {
        let mut depths = Vec::new();
        for side in [2e-3, 2.0, 2e6] {
            let transfer = transfer(&mesh(side, stream)).unwrap();
            let (background, bg_tau) = transfer.at(7.0);
            let ((hot, hot_tau), (cold, cold_tau)) = (transfer.at(11.0), transfer.at(5.3));
            assert!(hot_tau > 20.0 * bg_tau && cold_tau > 20.0 * bg_tau && bg_tau > 0.0, "{transfer:?}");
            assert!(hot.x > hot.z && cold.z > cold.x && background.max_element() < 0.5, "{transfer:?}");
            // In the stream alone the whole mesh is a haze.
            assert!((bg_tau * side - HAZE).abs() < 0.01, "{}", bg_tau * side);
            depths.push(middle_depth(side, &transfer, stream));
            let ascending = transfer.knots().windows(2).all(|pair| pair[0].s < pair[1].s);
            assert!(ascending, "no jumps: {transfer:?}");
        }
        assert!(depths[0] > 2.0 && depths[0] < 40.0, "{depths:?}");
        assert!(depths.iter().all(|depth| (depth - depths[0]).abs() < 1e-3 * depths[0]), "{depths:?}");
    }

    #[test]
    fn without_a_background_the_whole_range_has_the_ramp() {
        // The ends are rare: the histogram's peak lies between them.
        let value = |p: DVec3| 10.0 + p.x + 0.2 * (p.y + p.z);
        let transfer = transfer(&mesh(2.0, value)).unwrap();
        let tau = [9.1, 9.5, 10.0, 10.5, 10.9].map(|s| transfer.at(s).1);
        // Extinction is not below the haze.
        assert!(tau.windows(2).all(|pair| pair[0] <= pair[1]) && tau[1] < tau[2], "{tau:?}");
        assert!((tau[0] * 2.0 - HAZE).abs() < 0.01 && tau[4] > 10.0 * tau[0], "{tau:?}");
        let depth = middle_depth(2.0, &transfer, value);
        assert!(depth > 2.0 && depth < 12.0, "{depth}");
    }

    #[test]
    fn outliers_nan_and_infinities_do_not_hide_the_rest() {
        let clean = mesh(2.0, stream);
        let want = transfer(&clean).unwrap();
        let mut scalars = clean.scalars().values().to_vec();
        for (i, s) in [1e9, -1e9, f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
            scalars[i] = s;
        }
        let dirty = clean.with_scalars(TetScalars::Point(scalars)).unwrap();
        let got = transfer(&dirty).unwrap();
        assert!(got.domain()[0] > 4.0 && got.domain()[1] < 13.0, "{:?}", got.domain());
        for s in [5.0, 7.0, 9.0, 11.0] {
            let (got, want) = (got.at(s).1, want.at(s).1);
            assert!((got - want).abs() < 0.2 * want.max(0.01 * got), "{s}: {got} instead of {want}");
        }
    }

    /// Volumes count, not numbers of cells: a small corner full of cells is no background.
    #[test]
    fn refinement_does_not_matter() {
        let coarse = mesh(2.0, |p| 10.0 + p.x);
        let fine = Field::Ramp.tets(16).unwrap();
        let first = num::count(coarse.points().len());
        let points = coarse.points().iter().copied().chain(fine.points().iter().map(|p| *p * 0.05)).collect();
        let cells = coarse.cells().iter().copied();
        let cells = cells.chain(fine.cells().iter().map(|cell| cell.map(|i| first + i))).collect();
        let scalars = coarse.scalars().values().iter().copied().chain(vec![10.5; fine.points().len()]);
        let both = Tets::new(points, cells, TetScalars::Point(scalars.collect())).unwrap().0;
        let (want, got) = (transfer(&coarse).unwrap(), transfer(&both).unwrap());
        for (want, got) in want.knots().iter().zip(got.knots()) {
            assert!((want.s - got.s).abs() < 0.01, "{} {}", want.s, got.s);
        }
    }

    #[test]
    fn constant_data_masks_and_one_cell_in_many_are_seen() {
        let side = 0.02;
        let constant = transfer(&mesh(side, |_| -3.0)).unwrap();
        let depth = constant.at(-3.0).1 * side;
        assert!(depth > 2.0 && depth < 12.0, "{depth}");

        let mesh = mesh(side, |_| 0.0);
        let count = mesh.cells().len();
        let cells = |inside: &dyn Fn(usize) -> bool| {
            let values = (0..count).map(|i| if inside(i) { 1.0 } else { 0.0 }).collect();
            transfer(&mesh.clone().with_scalars(TetScalars::Cell(values)).unwrap()).unwrap()
        };
        for mask in [cells(&|i| i > count * 2 / 3), cells(&|i| i == count / 2)] {
            assert!(mask.at(1.0).1 > 10.0 * mask.at(0.0).1, "{mask:?}");
        }
        // Too small for any value to be drawn from it.
        let first = num::count(mesh.points().len());
        let tiny = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| p * 1e-3 * side);
        let points = mesh.points().iter().copied().chain(tiny).collect();
        let with_tiny = mesh.cells().iter().copied().chain([[0, 1, 2, 3].map(|i| first + i)]).collect();
        let values = (0..=count).map(|i| if i == count { 1.0 } else { 0.0 }).collect();
        let lost = transfer(&Tets::new(points, with_tiny, TetScalars::Cell(values)).unwrap().0).unwrap();
        assert!(lost.at(1.0).1 > 10.0 * lost.at(0.0).1, "{lost:?}");
        // Mostly 1, so 0 is the foreground.
        let holes = cells(&|i| i > count / 3);
        assert!(holes.at(0.0).1 > 10.0 * holes.at(1.0).1, "{holes:?}");
        assert_eq!(holes, cells(&|i| i > count / 3), "the same data, the same function");
    }

    #[test]
    fn lines_measure_the_mesh() {
        let unit = TransferFunction::new(vec![knot(0.0, 1.0, WARM[0])]).unwrap();
        let box_ = mesh(3.0, stream);
        for axis in 0..3 {
            for length in ray_depths(&box_, &unit, axis) {
                assert!((length - 3.0).abs() < 1e-9, "{length}");
            }
        }
        let ramp =
            TransferFunction::from_rows(&[[-1.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 2.0]]).unwrap();
        for depth in ray_depths(&mesh(2.0, |p| p.x), &ramp, 0) {
            assert!((depth - 2.0).abs() < 1e-6, "{depth}");
        }
    }
}
