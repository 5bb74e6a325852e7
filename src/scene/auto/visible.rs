//! The part of the data that a transfer function shows.

use glam::DVec3;
use rayon::prelude::*;

use crate::num;
use crate::scene::grid::box_corners;
use crate::scene::{
    Data, Gaussians, Grid, KernelSize, Points, Rescale, Samples, Scene, TetScalars, Tets, TransferFunction,
};

/// The least optical depth along the diagonal of the data's box that is visible.
const LEAST: f64 = 0.1;

/// The share of a layer's cells that may be visible and yet count as noise.
const NOISE: f64 = 2e-5;

/// Returns the corners of a box that holds what the scene shows of its data: in the order of [`Data::corners`], with the same axes, and no larger.
///
/// Visible is what has an optical depth of 0.1 along the diagonal of the data. Single cells of a grid's layers count as noise. Where nothing is visible, or triangle
/// meshes stand beside the data, it is the box of the data.
///
/// Of Gaussian splats the box is that of [`Gaussians`] near most others: those with a centre outside the middle 96 % of opacity along an axis, by
/// more than a quarter of the longest side of that middle, are left out. A splat counts as far as it has an opacity of 0.05.
#[must_use]
pub fn visible(scene: &Scene) -> [DVec3; 8] {
    let all = scene.data.corners();
    if let Data::Gaussians(gaussians) = &scene.data {
        return of_gaussians(gaussians).unwrap_or(all);
    }
    let shown = Shown::of(&scene.transfer, LEAST / all[0].distance(all[7]));
    let found = match &scene.data {
        _ if !scene.surfaces.is_empty() => None,
        Data::Grid(grid) => of_grid(grid, &shown),
        Data::Mesh(mesh) => of_mesh(mesh, &shown),
        Data::Points(points) => of_points(points, &shown),
        Data::Gaussians(_) => None,
    };
    found.unwrap_or(all)
}

/// The scalars that are visible: intervals in ascending order.
struct Shown(Vec<[f64; 2]>);

impl Shown {
    /// Collects the scalars with at least this extinction.
    fn of(transfer: &TransferFunction, least: f64) -> Self {
        let knots = transfer.knots();
        let (first, last) = (knots[0], knots[knots.len() - 1]);
        let beyond = |s: f64, tau: f64, end: f64| (tau >= least).then_some([s.min(end), s.max(end)]);
        let pieces = knots.windows(2).filter_map(|pair| {
            let [a, b] = [pair[0], pair[1]];
            let crossing = a.s + (b.s - a.s) * ((least - a.tau) / (b.tau - a.tau)).clamp(0.0, 1.0);
            match (a.tau >= least, b.tau >= least) {
                (true, true) => Some([a.s, b.s]),
                (true, false) => Some([a.s, crossing]),
                (false, true) => Some([crossing, b.s]),
                (false, false) => None,
            }
        });
        let ends = [beyond(first.s, first.tau, f64::NEG_INFINITY), beyond(last.s, last.tau, f64::INFINITY)];
        let mut intervals: Vec<[f64; 2]> = ends[0].into_iter().chain(pieces).chain(ends[1]).collect();
        // Adjacent pieces are one interval.
        intervals.dedup_by(|next, last| {
            let touches = next[0] <= last[1];
            last[1] = if touches { next[1] } else { last[1] };
            touches
        });
        Self(intervals)
    }

    /// Returns whether any scalar from one to another is visible.
    fn meets(&self, [low, high]: [f64; 2]) -> bool {
        self.0.iter().any(|[from, to]| *from <= high && *to >= low)
    }

    /// Marks the cells that are visible: each lies between two columns of samples, of which these are the ranges. NaN makes a cell
    /// vacuum.
    fn mark(&self, columns: &[[f64; 2]], visible: &mut [bool]) {
        visible.fill(false);
        for [from, to] in &self.0 {
            for (visible, pair) in visible.iter_mut().zip(columns.windows(2)) {
                let ([low, high], [next_low, next_high]) = (pair[0], pair[1]);
                let no_nan = !(low.is_nan() | next_low.is_nan());
                *visible |=
                    no_nan & ((low <= *to) | (next_low <= *to)) & ((high >= *from) | (next_high >= *from));
            }
        }
    }
}

/// Finds the first and the last layer of cells along each axis of which more than noise is visible.
fn of_grid(grid: &Grid, shown: &Shown) -> Option<[DVec3; 8]> {
    let grid = &*grid.overview();
    let counts = match grid.samples() {
        Samples::U8(samples) => count(grid, shown, samples),
        Samples::U16(samples) => count(grid, shown, samples),
        Samples::I16(samples) => count(grid, shown, samples),
        Samples::F32(samples) => count(grid, shown, samples),
        Samples::OnDemand(_) => return None,
    };
    let cells = grid.dims().map(|side| side - 1);
    let ends = |axis: usize| {
        let layer = f64::from(cells[(axis + 1) % 3]) * f64::from(cells[(axis + 2) % 3]);
        let visible = |count: &u32| f64::from(*count) > NOISE * layer;
        let low = counts[axis].iter().position(visible)?;
        let high = counts[axis].iter().rposition(visible)?;
        Some([num::f64_of(low), num::f64_of(high + 1)])
    };
    let [x, y, z] = [ends(0)?, ends(1)?, ends(2)?];
    let bounds = [0, 1].map(|end| DVec3::new(x[end], y[end], z[end]));
    Some(box_corners(bounds).map(|corner| grid.world_of_index(corner)))
}

/// Counts the visible cells in each layer across x, y and z.
fn count<T: Copy + PartialOrd + Into<f64> + Sync>(
    grid: &Grid,
    shown: &Shown,
    samples: &[T],
) -> [Vec<u32>; 3] {
    let [width, height, depth] = grid.dims().map(num::index);
    let none = || [width, height, depth].map(|side| vec![0_u32; side - 1]);
    let row = |j: usize, k: usize| &samples[(k * height + j) * width..][..width];
    let of_slab = |mut counts: [Vec<u32>; 3], k: usize| {
        let (mut columns, mut visible) = (vec![[0.0; 2]; width], vec![false; width - 1]);
        for j in 0..height - 1 {
            let rows = [row(j, k), row(j + 1, k), row(j, k + 1), row(j + 1, k + 1)];
            for (i, column) in columns.iter_mut().enumerate() {
                *column = range(rows.map(|row| row[i]), grid.rescale());
            }
            shown.mark(&columns, &mut visible);
            for (count, visible) in counts[0].iter_mut().zip(&visible) {
                *count += u32::from(*visible);
            }
            let sum = visible.iter().map(|visible| u32::from(*visible)).sum::<u32>();
            counts[1][j] += sum;
            counts[2][k] += sum;
        }
        counts
    };
    let sum = |mut counts: [Vec<u32>; 3], others: [Vec<u32>; 3]| {
        for (count, other) in counts.iter_mut().flatten().zip(others.iter().flatten()) {
            *count += other;
        }
        counts
    };
    (0..depth - 1).into_par_iter().fold(none, of_slab).reduce(none, sum)
}

/// Returns the range of the scalars of four samples, or NaN if one is.
fn range<T: Copy + PartialOrd + Into<f64>>(samples: [T; 4], rescale: Rescale) -> [f64; 2] {
    let [mut low, mut high] = [samples[0]; 2];
    for sample in &samples[1..] {
        low = if *sample < low { *sample } else { low };
        high = if *sample > high { *sample } else { high };
    }
    // A sample that is not equal to itself is NaN.
    let any_nan = samples.iter().any(|sample| sample.partial_cmp(sample).is_none());
    if any_nan { [f64::NAN; 2] } else { rescale.of_range([low.into(), high.into()]) }
}

/// Bounds that hold nothing.
const NONE: [DVec3; 2] = [DVec3::INFINITY, DVec3::NEG_INFINITY];

fn joined([low, high]: [DVec3; 2], [other_low, other_high]: [DVec3; 2]) -> [DVec3; 2] {
    [low.min(other_low), high.max(other_high)]
}

fn of_mesh(mesh: &Tets, shown: &Shown) -> Option<[DVec3; 8]> {
    let bounds = mesh.cells().par_iter().enumerate().map(|(cell, corners)| {
        let corners = corners.map(num::index);
        let s = match mesh.scalars() {
            TetScalars::Point(values) => corners.map(|i| f64::from(values[i])),
            TetScalars::Cell(values) => [f64::from(values[cell]); 4],
        };
        let range =
            s.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| [low.min(*s), high.max(*s)]);
        let visible = !s.iter().any(|s| s.is_nan()) && shown.meets(range);
        corners.iter().filter(|_| visible).fold(NONE, |bounds, &i| joined(bounds, [mesh.points()[i]; 2]))
    });
    let [low, high] = bounds.reduce(|| NONE, joined);
    (low.x <= high.x).then(|| box_corners([low, high]))
}

fn of_points(points: &Points, shown: &Shown) -> Option<[DVec3; 8]> {
    let scalars = points.scalars()?;
    if *points.size() == KernelSize::Unknown {
        return None;
    }
    let [low, high] = points.reach_of(|i| shown.meets([f64::from(scalars[i]); 2]))?;
    // A single point without extent is no box.
    (low != high).then(|| box_corners([low, high]))
}

/// Opacity down to which a splat counts as visible.
const LEAST_OPACITY: f64 = 0.05;
/// Share of opacity that lies beyond either end of the middle.
const TAIL: f64 = 0.02;
/// Distance from the middle up to which splats count, in its longest sides.
const MARGIN: f64 = 0.25;

/// Finds the box of the splats that are visible and not far from most others.
fn of_gaussians(splats: &Gaussians) -> Option<[DVec3; 8]> {
    let opacity = |i: usize| f64::from(splats.opacities()[i]);
    let shown: Vec<usize> = (0..splats.len()).filter(|&i| opacity(i) > LEAST_OPACITY).collect();
    let total: f64 = shown.iter().map(|&i| opacity(i)).sum();
    let middle = |axis: usize| {
        let mut places: Vec<(f64, f64)> =
            shown.iter().map(|&i| (f64::from(splats.centres()[i][axis]), opacity(i))).collect();
        places.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        Some([quantile_of(places.iter(), TAIL * total)?, quantile_of(places.iter().rev(), TAIL * total)?])
    };
    let [x, y, z]: [[f64; 2]; 3] = [middle(0)?, middle(1)?, middle(2)?];
    let [low, high] = [0, 1].map(|end| DVec3::new(x[end], y[end], z[end]));
    let margin = MARGIN * (high - low).max_element();
    let [low, high] = [low - margin, high + margin];
    let near = shown.into_par_iter().filter(|&i| {
        let centre = splats.centre(i);
        centre.cmpge(low).all() && centre.cmple(high).all()
    });
    let boxes = near.map(|i| {
        // At D deviations the opacity has fallen to the least one that counts.
        let reach = splats.deviations(i) * (2.0 * (opacity(i) / LEAST_OPACITY).ln()).sqrt();
        [splats.centre(i) - reach, splats.centre(i) + reach]
    });
    let [least, greatest] = boxes.reduce(|| NONE, joined);
    // A giant splat must not do what a far one may not.
    let [low, high] = if margin > 0.0 { [least.max(low), greatest.min(high)] } else { [least, greatest] };
    // A single place without extent is no box.
    let least = if low == high { low.abs().max_element().max(1e6) * 1e-6 } else { 0.0 };
    let [low, high] = [low - least, high + least];
    (low.is_finite() && high.is_finite()).then(|| box_corners([low, high]))
}

/// Returns the place at which the sum of the weights exceeds a limit.
fn quantile_of<'a>(places: impl Iterator<Item = &'a (f64, f64)>, limit: f64) -> Option<f64> {
    let mut sum = 0.0;
    for (place, weight) in places {
        sum += weight;
        if sum > limit {
            return Some(*place);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Field, Surface};

    fn extent(scene: &Scene) -> [DVec3; 2] {
        let corners = visible(scene);
        [corners[0], corners[7]]
    }

    fn ramp(from: f64, to: f64) -> TransferFunction {
        TransferFunction::from_rows(&[[from, 1.0, 1.0, 1.0, 0.0], [to, 1.0, 1.0, 1.0, 5.0]]).unwrap()
    }

    #[test]
    fn a_grid_is_cut_to_its_visible_layers() {
        // A block from 5 to 8, 3 to 9 and 2 to 4 in 20^3 samples, and a single bright cell as noise.
        let value = |i: u32| {
            let [x, y, z] = [i % 20, i / 20 % 20, i / 400];
            if (5..=8).contains(&x) && (3..=9).contains(&y) && (2..=4).contains(&z) { 200 } else { 0 }
        };
        let grid = |samples: Vec<u8>| Grid::new([20; 3], Samples::U8(samples)).unwrap();
        let samples: Vec<u8> = (0..8000).map(value).collect();
        let scene = Scene::new(grid(samples.clone()), ramp(100.0, 200.0));
        assert_eq!(extent(&scene), [DVec3::new(4.0, 2.0, 1.0), DVec3::new(9.0, 10.0, 5.0)]);
        // A band between the block's scalar and that of the air shows their border alone.
        let band = TransferFunction::from_rows(&[
            [90.0, 1.0, 1.0, 1.0, 0.0],
            [100.0, 1.0, 1.0, 1.0, 9.0],
            [110.0, 1.0, 1.0, 1.0, 0.0],
        ]);
        assert_eq!(extent(&Scene::new(grid(samples), band.unwrap())), extent(&scene));
        let empty = Scene::new(scene.data.clone(), ramp(201.0, 210.0));
        assert_eq!(visible(&empty), empty.data.corners());
        let surface = Field::Ramp.tets(1).unwrap();
        let surface = Surface::new(surface.points().to_vec(), vec![[0, 1, 2]], [1.0; 4]).unwrap();
        let beside = scene.clone().with_surfaces(vec![surface]);
        assert_eq!(visible(&beside), beside.data.corners());
    }

    #[test]
    fn meshes_and_points_are_cut_to_what_is_visible() {
        let mesh = Field::Ramp.tets(4).unwrap();
        let x = mesh.points().iter().map(|p| num::f32_of(p.x)).collect();
        let mesh = mesh.with_scalars(TetScalars::Point(x)).unwrap();
        let scene = Scene::new(mesh, ramp(0.6, 1.0));
        assert_eq!(extent(&scene), [DVec3::new(0.5, -1.0, -1.0), DVec3::ONE]);

        let centres: Vec<DVec3> = (0..5).map(|i| DVec3::splat(f64::from(i))).collect();
        let points = Points::new(centres).unwrap().with_size(KernelSize::Radius(0.5)).unwrap();
        let points = points.with_scalars((0..5_u8).map(f32::from).collect()).unwrap();
        let scene = Scene::new(points, ramp(2.5, 4.0));
        assert_eq!(extent(&scene), [DVec3::splat(2.5), DVec3::splat(4.5)]);
    }

    #[test]
    fn scalars_beyond_the_knots_count_as_those_at_the_ends() {
        let shown = Shown::of(&ramp(1.0, 2.0), 1.0);
        assert_eq!(shown.0, [[1.2, f64::INFINITY]]);
        let constant = TransferFunction::from_rows(&[[3.0, 1.0, 1.0, 1.0, 1.0]]).unwrap();
        assert_eq!(Shown::of(&constant, 0.5).0, [[f64::NEG_INFINITY, f64::INFINITY]]);
        let holes = TransferFunction::from_rows(&[
            [0.0, 0.0, 0.0, 0.0, 2.0],
            [1.0, 0.0, 0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0, 0.0, 2.0],
        ])
        .unwrap();
        assert_eq!(Shown::of(&holes, 1.0).0, [[f64::NEG_INFINITY, 0.5], [1.5, f64::INFINITY]]);
    }
}
