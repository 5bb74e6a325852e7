//! Samples in space: from the lattice of a file to an even one.

use std::cmp::Ordering;

use glam::{DMat3, DVec3};

use super::arrays::{self, Association, Choice, Pick};
use super::dataset::{self, Origin, ReadArray};
use super::source::{Budget, Source};
use super::{Loaded, ReadOptions};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Grid, Samples};

/// Where the points of a lattice lie.
#[derive(Clone, Debug)]
pub(crate) enum Places {
    /// Evenly: `origin + direction * (spacing * index)`.
    Even { origin: DVec3, spacing: DVec3, direction: DMat3 },
    /// At coordinates of their own along each axis, in the order of the samples: rising or falling.
    Listed([Vec<f64>; 3]),
}

impl Places {
    /// An even lattice whose first sample has an index: `origin` is the place of index 0, and a negative
    /// spacing turns its axis round. Returns notes of both, too.
    pub(crate) fn even(origin: DVec3, spacing: DVec3, direction: DMat3, first: DVec3) -> (Self, Vec<String>) {
        let mut notes = Vec::new();
        if first != DVec3::ZERO {
            let [x, y, z] = first.to_array();
            notes.push(format!("indices begin at {x} {y} {z}: the origin is moved there"));
        }
        let turned = spacing.map(|step| if step < 0.0 { -1.0 } else { 1.0 });
        if turned != DVec3::ONE {
            notes.push("negative spacing: axes are turned round".to_owned());
        }
        let origin = origin + direction * (spacing * first);
        let direction = direction * DMat3::from_diagonal(turned);
        (Self::Even { origin, spacing: spacing.abs(), direction }, notes)
    }
}

/// Differences of gaps that count as rounding: coordinates are often float32, or printed with six digits.
const EVEN: f64 = 1e-4;

/// How many times more samples than the file has resampling may make.
const MOST_GROWTH: f64 = 64.0;

/// Builds a grid from points on a lattice and arrays on its points or cells. `dims` counts points.
///
/// Cell data is a sample at the centre of each cell. Points and cells that VTK's ghost array hides are NaN.
pub(crate) fn build(
    origin: Origin,
    dims: [u32; 3],
    places: Places,
    budget: &mut Budget,
    read: &mut ReadArray,
    options: &ReadOptions,
) -> Result<Loaded> {
    let Origin { source, format, arrays } = origin;
    let Some(Choice { index, pick }) = arrays::choose(source, &arrays, options.array.as_deref())? else {
        return Err(source.error("arrays", "none: a grid needs point or cell data to show"));
    };
    let mut notes = Vec::new();
    let association = arrays[index].association;
    let (dims, places) = match association {
        Association::Point => (dims, places),
        Association::Cell => {
            notes.push("cell data: each value is a sample at the centre of its cell".to_owned());
            (dims.map(|extent| extent.saturating_sub(1)), centres(places))
        }
    };
    if let Some(extent) = dims.iter().find(|&&extent| extent < 2) {
        let [x, y, z] = dims;
        return Err(source.error(
            format!("array {}", arrays[index]),
            format!("{x} x {y} x {z} samples: {extent} is too few, every extent must be at least 2"),
        ));
    }
    let overflow = || source.error("dimensions", format!("{dims:?}: more samples than memory can address"));
    let count =
        dims.iter().try_fold(1_u64, |n, &extent| n.checked_mul(u64::from(extent))).ok_or_else(overflow)?;
    let stored = if pick == Pick::Magnitude { 4 } else { arrays[index].kind.stored_bytes() };
    budget.take("dimensions", count.saturating_mul(stored))?;
    let mut samples = read(index, pick)?;
    if Ok(samples.len()) != usize::try_from(count) {
        let [x, y, z] = dims;
        let rule = format!("{} tuples: {x} x {y} x {z} are needed", samples.len());
        return Err(source.error(format!("array {}", arrays[index]), rule));
    }

    if let Some(flags) = dataset::ghosts(&arrays, association, samples.len(), budget, read)? {
        let hidden = if association == Association::Point { 2 } else { 32 };
        let masked = flags.iter().filter(|&&flag| flag & hidden != 0).count();
        if masked > 0 {
            let narrow = !matches!(samples, Samples::F32(_));
            budget.take("vtkGhostType", if narrow { count.saturating_mul(4) } else { 0 })?;
            let mut values = samples.into_f32();
            for (value, flag) in values.iter_mut().zip(flags) {
                if flag & hidden != 0 {
                    *value = f32::NAN;
                }
            }
            samples = Samples::F32(values);
            notes.push(format!("{masked} hidden samples are NaN"));
        }
    }

    let located = |error: Error| error.in_file(source.path());
    let grid = match places {
        Places::Even { origin, spacing, direction } => {
            Grid::new(dims, samples).and_then(|grid| grid.with_placement(spacing, origin, direction))
        }
        Places::Listed(coordinates) => {
            let even = evenly(source, "coordinates", dims, samples, coordinates, budget)?;
            notes.extend(even.note);
            Grid::new(even.dims, even.samples).and_then(|grid| {
                grid.with_placement(even.steps.abs(), even.origin, DMat3::from_diagonal(even.steps.signum()))
            })
        }
    }
    .map_err(located)?;
    let warning = dataset::coarse(grid.range(), &arrays[index]);
    let mut loaded = Loaded::new(format, grid);
    loaded.report.shown = Some(dataset::describe(&arrays[index], pick));
    loaded.report.arrays = arrays;
    loaded.report.notes = notes;
    loaded.report.warnings.extend(warning);
    Ok(loaded)
}

/// The lattice of the cells' centres.
fn centres(places: Places) -> Places {
    match places {
        Places::Even { origin, spacing, direction } => {
            Places::Even { origin: origin + direction * (spacing * 0.5), spacing, direction }
        }
        Places::Listed(axes) => {
            Places::Listed(axes.map(|axis| axis.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect()))
        }
    }
}

/// Samples on an even lattice along the axes.
#[derive(Debug)]
pub(crate) struct Even {
    pub(crate) dims: [u32; 3],
    pub(crate) samples: Samples,
    /// Coordinates of the first sample.
    pub(crate) origin: DVec3,
    /// From one sample to the next along each axis; negative where coordinates fall.
    pub(crate) steps: DVec3,
    /// What was done.
    pub(crate) note: Option<String>,
}

/// Brings samples at listed coordinates onto an even lattice. Along an axis with uneven gaps they are
/// interpolated linearly, at least as close together as the file has them anywhere; the first and the last
/// stay where they are.
///
/// # Errors
///
/// If coordinates do not rise or fall strictly, or the smallest gap is so small that the even lattice would
/// have more than 64 times the samples, or more than the budget has memory for.
pub(crate) fn evenly(
    source: &Source,
    place: &str,
    dims: [u32; 3],
    samples: Samples,
    coordinates: [Vec<f64>; 3],
    budget: &mut Budget,
) -> Result<Even> {
    let mut origin = DVec3::ZERO;
    let mut steps = DVec3::ONE;
    let mut counts = dims;
    let mut uneven = [false; 3];
    let mut notes = Vec::new();
    for (axis, list) in coordinates.iter().enumerate() {
        let letter = ['x', 'y', 'z'][axis];
        let at = |rule: String| source.error(format!("{place} along {letter}"), rule);
        if list.len() != num::index(dims[axis]) {
            return Err(at(format!("{}: {} are needed", list.len(), dims[axis])));
        }
        let (Some(&first), Some(&last)) = (list.first(), list.last()) else { continue };
        let sign = (last - first).signum();
        let gap = |pair: &[f64]| (pair[1] - pair[0]) * sign;
        // NaN is no gap either.
        let rises = |pair: &&[f64]| matches!(gap(pair).partial_cmp(&0.0), Some(Ordering::Greater));
        if let Some(pair) = list.windows(2).find(|pair| !rises(pair) || !gap(pair).is_finite()) {
            return Err(at(format!("{} after {}: must rise or fall strictly", pair[1], pair[0])));
        }
        let least = list.windows(2).map(gap).fold(f64::INFINITY, f64::min);
        let most = list.windows(2).map(gap).fold(0.0, f64::max);
        let intervals = f64::from(dims[axis] - 1);
        origin[axis] = first;
        steps[axis] = (last - first) / intervals;
        if most - least <= EVEN * most {
            continue;
        }
        let wanted = (((last - first) * sign) / least * (1.0 - 1e-9)).ceil();
        if wanted > MOST_GROWTH * intervals {
            let [least, most] = [least, most].map(short);
            return Err(at(format!(
                "gaps from {least} to {most}: an even lattice would need {wanted} samples instead of {intervals}; \
                 resample the data first"
            )));
        }
        uneven[axis] = true;
        steps[axis] = (last - first) / wanted;
        counts[axis] = num::u32_of(wanted) + 1;
        let [least, most] = [least, most].map(short);
        notes.push(format!(
            "{letter}: gaps from {least} to {most}, resampled linearly from {} to {} samples",
            dims[axis], counts[axis]
        ));
    }
    if notes.is_empty() {
        return Ok(Even { dims, samples, origin, steps, note: None });
    }
    let before: f64 = dims.iter().map(|&n| f64::from(n)).product();
    let after: f64 = counts.iter().map(|&n| f64::from(n)).product();
    if after > MOST_GROWTH * before {
        return Err(source.error(
            place,
            format!("uneven: an even lattice would have {counts:?} samples instead of {dims:?}; resample the data first"),
        ));
    }
    // Each axis in turn: what comes in, and what comes out, of the largest pass.
    budget.take(place, num::u64_of(after * 8.0))?;
    let mut values = samples.into_f32();
    let mut extents = dims.map(num::index);
    for axis in (0..3).filter(|&axis| uneven[axis]) {
        let places = shares(&coordinates[axis], origin[axis], steps[axis], counts[axis]);
        values = resample(&values, extents, axis, &places);
        extents[axis] = num::index(counts[axis]);
    }
    Ok(Even { dims: counts, samples: Samples::F32(values), origin, steps, note: Some(notes.join("; ")) })
}

/// A number of six digits: differences carry the rounding of what they are made of.
fn short(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// For each place of an even axis: the interval of the list that it lies in, and how far along.
fn shares(list: &[f64], origin: f64, step: f64, count: u32) -> Vec<(usize, f64)> {
    let mut interval = 0;
    let place = |i: u32| {
        let at = origin + step * f64::from(i);
        while interval + 2 < list.len() && (at - list[interval + 1]) * step >= 0.0 {
            interval += 1;
        }
        let share = (at - list[interval]) / (list[interval + 1] - list[interval]);
        // Within rounding of a listed place it is that place, and its value exact.
        let share = if share < 1e-9 {
            0.0
        } else if share > 1.0 - 1e-9 {
            1.0
        } else {
            share
        };
        (interval, share)
    };
    (0..count).map(place).collect()
}

/// Interpolates along one axis.
fn resample(values: &[f32], extents: [usize; 3], axis: usize, places: &[(usize, f64)]) -> Vec<f32> {
    let inner: usize = extents[..axis].iter().product();
    let outer: usize = extents[axis + 1..].iter().product();
    let row = inner * extents[axis];
    let mut result = Vec::with_capacity(inner * places.len() * outer);
    for block in 0..outer {
        for &(interval, share) in places {
            let a = block * row + interval * inner;
            for i in a..a + inner {
                let (lo, hi) = (f64::from(values[i]), f64::from(values[i + inner]));
                // NaN beside a place that is hit exactly must not spread.
                let value = match share {
                    0.0 => lo,
                    1.0 => hi,
                    _ => lo + (hi - lo) * share,
                };
                result.push(num::f32_of(value));
            }
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn even(lists: [&[f64]; 3], values: impl Fn(f64, f64, f64) -> f64) -> Result<Even> {
        let source = Source::in_memory(&[("a.vtr", b"")]).unwrap();
        let mut budget = Budget::new(&source, &ReadOptions::within(1 << 20));
        let mut samples = Vec::new();
        for &z in lists[2] {
            for &y in lists[1] {
                for &x in lists[0] {
                    samples.push(num::f32_of(values(x, y, z)));
                }
            }
        }
        let dims = lists.map(|list| num::count(list.len()));
        evenly(&source, "coordinates", dims, Samples::F32(samples), lists.map(<[f64]>::to_vec), &mut budget)
    }

    #[test]
    fn linear_fields_survive_and_places_are_right() {
        let field = |x: f64, y: f64, z: f64| 1.0 + 2.0 * x - y + 0.5 * z;
        let result = even([&[0.0, 1.0, 1.5, 4.0], &[3.0, 2.0, 0.0], &[-1.0, 0.0, 1.0]], field).unwrap();
        assert_eq!(result.dims, [9, 4, 3]);
        assert_eq!(result.origin, DVec3::new(0.0, 3.0, -1.0));
        assert_eq!(result.steps, DVec3::new(0.5, -1.0, 1.0));
        let Samples::F32(values) = result.samples else { panic!() };
        let mut i = 0;
        for z in 0..3 {
            for y in 0..4 {
                for x in 0..9 {
                    let at =
                        result.origin + result.steps * DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                    assert!((f64::from(values[i]) - field(at.x, at.y, at.z)).abs() < 1e-6, "{at}");
                    i += 1;
                }
            }
        }
        assert!(result.note.unwrap().contains("x: gaps from 0.5 to 2.5"));
    }

    #[test]
    fn even_lattices_are_left_alone() {
        let list: Vec<f64> =
            (0..10).map(|i| f64::from(0.1_f32) * f64::from(i) + 1e-7 * f64::from(i % 2)).collect();
        let result = even([&list, &[0.0, 1.0], &[5.0, 3.0]], |x, _, _| x).unwrap();
        assert_eq!((result.dims, result.note), ([10, 2, 2], None));
        assert_eq!(result.steps.z, -2.0);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let why = |list: &[f64]| even([list, &[0.0, 1.0], &[0.0, 1.0]], |x, _, _| x).unwrap_err().to_string();
        assert!(why(&[0.0, 1.0, 1.0]).contains("along x: 1 after 1: must rise or fall strictly"));
        assert!(why(&[0.0, 2.0, 1.0, 3.0]).contains("strictly"));
        assert!(why(&[0.0, f64::NAN, 1.0]).contains("strictly"));
        assert!(why(&[0.0, 1e-6, 1.0]).contains("resample the data first"));
    }
}
