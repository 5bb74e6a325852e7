//! The visible kernels of a grid.

use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::num::{self, f32_of};
use crate::optics::kernel::prefilter;
use crate::resident::splats::space::{classified, finite};
use crate::resident::visible_scalars::nonzero_ranges;
use crate::scene::{Grid, Kernel, Kernels, Model, TransferFunction};

/// Returns the visible kernels of a grid: centre and scalar, or for the density model centre, colour and extinction.
///
/// `slab` is the thickness of a sheet, in steps.
///
/// # Errors
///
/// [`Error::Unsupported`] for B-splines on a grid with NaN samples.
pub(crate) fn lattice(
    grid: &Grid,
    transfer: &TransferFunction,
    kernels: &Kernels,
    slab: f64,
) -> Result<Vec<[f32; 4]>> {
    if grid.is_on_demand() {
        let missing = "samples in memory: a grid that is larger is drawn by slices, slabs and rays";
        return Err(Error::unsupported("kernels of this grid", missing));
    }
    let dims = grid.dims().map(num::index);
    let ends = transfer.domain();
    let rescale = grid.rescale();
    let value = |i: usize| finite(rescale.slope * grid.samples().get(i) + rescale.intercept, ends);
    let sigma = if kernels.kernel == Kernel::Gaussian { kernels.sigma } else { 1.0 };
    let half = grid.last_index() * 0.5;
    let centre = |voxel: [usize; 3], last: f32| {
        let [x, y, z] = ((DVec3::from_array(voxel.map(num::f64_of)) - half) / sigma).to_array().map(f32_of);
        [x, y, z, last]
    };
    if kernels.model == Model::Density {
        return Ok(each_voxel(dims, |i, voxel, list| {
            let shown = classified(transfer, value(i), 1.0);
            if shown[3] > 0.0 {
                list.extend([centre(voxel, 1.0), shown]);
            }
        }));
    }
    let spline = kernels.kernel == Kernel::BSpline;
    if spline && grid.nan_count() > 0 {
        let missing = "samples without NaN: its coefficients need all";
        return Err(Error::unsupported("kernel bspline on this grid", missing));
    }
    let mut scalars: Vec<f64> = (0..dims.iter().product()).into_par_iter().map(value).collect();
    if spline {
        prefilter(&mut scalars, dims);
    }
    let shown = needed(&scalars, dims, transfer, kernels, slab);
    Ok(each_voxel(dims, |i, voxel, list| {
        if shown[i] && !scalars[i].is_nan() {
            list.push(centre(voxel, f32_of(scalars[i])));
        }
    }))
}

/// Collects the entries that `add` makes of each voxel, given its number and indices, x fastest.
fn each_voxel(
    [nx, ny, nz]: [usize; 3],
    add: impl Fn(usize, [usize; 3], &mut Vec<[f32; 4]>) + Sync,
) -> Vec<[f32; 4]> {
    let slice = |z: usize| {
        let mut list = Vec::new();
        for y in 0..ny {
            for x in 0..nx {
                add((z * ny + y) * nx + x, [x, y, z], &mut list);
            }
        }
        list
    };
    (0..nz).into_par_iter().flat_map_iter(slice).collect()
}

/// Returns for each voxel whether its kernel may contribute to a visible place.
///
/// The sum of kernels in a cell lies between the scalars whose kernels reach the cell. If the transfer function shows a
/// scalar between them, the cell may be visible, and the kernels that reach it, or its sheet of `slab` voxels, are
/// needed.
fn needed(
    scalars: &[f64],
    dims: [usize; 3],
    transfer: &TransferFunction,
    kernels: &Kernels,
    slab: f64,
) -> Vec<bool> {
    let reach = num::usize_of(kernels.reach().ceil());
    let slab = num::usize_of(slab.ceil());
    let wider = |a: [f32; 2], b: [f32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let below = |s: f64| f32_of(s).next_down();
    let above = |s: f64| f32_of(s).next_up();
    let mut ranges: Vec<[f32; 2]> = scalars.par_iter().map(|&s| [below(s), above(s)]).collect();
    let mut extent = dims;
    for (axis, n) in dims.into_iter().enumerate() {
        // Cell j lies between voxels j and j + 1.
        let cells = n.saturating_sub(1).max(1);
        ranges = windows(&ranges, &mut extent, axis, cells, [reach - 1, reach], wider);
    }
    let seen = nonzero_ranges(transfer);
    // Negative lobes overshoot the scalars in reach; those of a product of three sum to at most 2.4.
    let beyond = if kernels.kernel == Kernel::Sinc { 0.75 } else { 1e-6 };
    let shows = |[low, high]: &[f32; 2]| {
        let margin = beyond * (high - low) + 1e-6 * low.abs().max(high.abs());
        seen.iter().any(|range| low - margin <= range[1] && high + margin >= range[0])
    };
    let mut shown: Vec<bool> = ranges.par_iter().map(shows).collect();
    for (axis, n) in dims.into_iter().enumerate() {
        let around = [reach + slab, reach + slab - 1];
        shown = windows(&shown, &mut extent, axis, n, around, |a, b| a || b);
    }
    shown
}

/// Joins values in a window along an axis: `count` results, each of the values from `before` ahead of its place to
/// `behind` after it.
fn windows<T: Copy + Send + Sync>(
    values: &[T],
    extent: &mut [usize; 3],
    axis: usize,
    count: usize,
    [before, behind]: [usize; 2],
    join: impl Fn(T, T) -> T + Sync,
) -> Vec<T> {
    let old = *extent;
    extent[axis] = count;
    let new = *extent;
    let stride = [1, old[0], old[0] * old[1]][axis];
    let row = |row: usize| {
        let (y, z) = (row % new[1], row / new[1]);
        let join = &join;
        (0..new[0]).map(move |x| {
            let mut place = [x, y, z];
            let first = place[axis].saturating_sub(before).min(old[axis] - 1);
            let last = (place[axis] + behind).min(old[axis] - 1);
            place[axis] = first;
            let start = (place[2] * old[1] + place[1]) * old[0] + place[0];
            (first..=last).map(|p| values[start + (p - first) * stride]).reduce(join).unwrap_or(values[start])
        })
    };
    (0..new[1] * new[2]).into_par_iter().flat_map_iter(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_join_what_is_in_reach() {
        let mut values = vec![false; 5 * 3 * 2];
        values[5 + 1] = true;
        let set = |values: &[bool]| (0..values.len()).filter(|&i| values[i]).collect::<Vec<_>>();
        let mut extent = [5, 3, 2];
        assert_eq!(set(&windows(&values, &mut extent, 0, 5, [2, 1], |a, b| a || b)), [5, 6, 7, 8]);
        assert_eq!(set(&windows(&values, &mut extent, 0, 4, [0, 1], |a, b| a || b)), [4, 5]);
        assert_eq!(extent, [4, 3, 2]);
        let mut extent = [5, 3, 2];
        assert_eq!(set(&windows(&values, &mut extent, 2, 2, [1, 1], |a, b| a || b)), [6, 21]);
    }

    /// Every voxel whose kernel reaches a visible place is needed, and few others are.
    #[test]
    fn what_shows_is_needed() {
        let dims = [9, 8, 7];
        let mut scalars = vec![0.0; 9 * 8 * 7];
        scalars[(3 * 8 + 4) * 9 + 5] = 1.0;
        let transfer =
            TransferFunction::from_rows(&[[0.0; 5], [0.5, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0, 1.0]])
                .unwrap();
        let tent = Kernels { kernel: Kernel::Tent, ..Kernels::of_samples() };
        let shown = needed(&scalars, dims, &transfer, &tent, 0.0);
        let count = |shown: &[bool]| shown.iter().filter(|&&s| s).count();
        assert_eq!(count(&shown), 27);
        assert_eq!(count(&needed(&scalars, dims, &transfer, &tent, 1.0)), 5 * 5 * 5);
        let flat = needed(&[1.0], [1, 1, 1], &transfer, &tent, 1.0);
        assert_eq!(flat, [true]);
    }
}
