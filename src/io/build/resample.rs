//! Resampling of unevenly spaced samples onto an even lattice, linearly along each axis.

use std::cmp::Ordering;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::num;
use crate::scene::Samples;

/// The relative difference of gaps that is taken as rounding: coordinates are often float32, or printed with six
/// digits.
const EVEN: f64 = 1e-4;

/// The limit on the growth of the number of samples by resampling.
const MOST_GROWTH: f64 = 64.0;

/// Samples on an even lattice along the axes.
#[derive(Debug)]
pub(crate) struct Even {
    pub(crate) dims: [u32; 3],
    pub(crate) samples: Samples,
    /// Coordinates of the first sample.
    pub(crate) origin: DVec3,
    /// The distance between samples along each axis; negative if coordinates fall.
    pub(crate) steps: DVec3,
    /// A note on the resampling, and the range of the samples before it.
    pub(crate) note: Option<String>,
    pub(crate) range: Option<[f64; 2]>,
}

/// Resamples samples at listed coordinates onto an even lattice. Along an axis with uneven gaps it interpolates
/// linearly, with a step no larger than the smallest gap; the first and the last sample keep their positions.
///
/// # Errors
///
/// If coordinates do not rise or fall strictly, if the even lattice would have more than 64 times the samples, or if
/// it exceeds the memory budget.
pub(crate) fn evenly(
    source: &Source,
    place: &str,
    dims: [u32; 3],
    samples: Samples,
    coordinates: [Vec<f64>; 3],
    budget: &mut Budget,
) -> Result<Even> {
    let axes = Axes::of(source, place, dims, &coordinates)?;
    let Axes { origin, steps, counts, uneven, notes, refused } = axes;
    if let Some(refused) = refused {
        return Err(refused);
    }
    if notes.is_empty() {
        return Ok(Even { dims, samples, origin, steps, note: None, range: None });
    }
    let before: f64 = dims.iter().map(|&n| f64::from(n)).product();
    let after: f64 = counts.iter().map(|&n| f64::from(n)).product();
    if after > MOST_GROWTH * before {
        let rule = format!("{counts:?} samples instead of {dims:?}; resample the data first");
        return Err(source.error(place, format!("uneven: an even lattice would have {rule}")));
    }
    // Axes are resampled one after another; the largest pass holds its input and its output.
    budget.take(place, num::u64_of(after * 8.0))?;
    let range = Some(samples.statistics().0);
    let mut values = samples.into_f32();
    let mut extents = dims.map(num::index);
    for axis in (0..3).filter(|&axis| uneven[axis]) {
        let places = shares(&coordinates[axis], origin[axis], steps[axis], counts[axis]);
        values = resample(&values, extents, axis, &places);
        extents[axis] = num::index(counts[axis]);
    }
    Ok(Even {
        dims: counts,
        samples: Samples::F32(values),
        origin,
        steps,
        note: Some(notes.join("; ")),
        range,
    })
}

/// The even lattice along listed coordinates.
pub(crate) struct Axes {
    pub(crate) origin: DVec3,
    pub(crate) steps: DVec3,
    counts: [u32; 3],
    uneven: [bool; 3],
    /// Notes on axes that are uneven.
    notes: Vec<String>,
    /// The error of an axis that would have too many samples.
    refused: Option<Error>,
}

impl Axes {
    /// Whether the coordinates are evenly spaced, up to rounding.
    pub(crate) fn is_even(&self) -> bool {
        self.notes.is_empty()
    }

    pub(crate) fn of(
        source: &Source,
        place: &str,
        dims: [u32; 3],
        coordinates: &[Vec<f64>; 3],
    ) -> Result<Self> {
        let mut origin = DVec3::ZERO;
        let mut steps = DVec3::ONE;
        let mut counts = dims;
        let mut uneven = [false; 3];
        let mut notes = Vec::new();
        let mut refused = None;
        for (axis, list) in coordinates.iter().enumerate() {
            let letter = ['x', 'y', 'z'][axis];
            let at = |rule: String| source.error(format!("{place} along {letter}"), rule);
            if list.len() != num::index(dims[axis]) {
                return Err(at(format!("{}: {} are needed", list.len(), dims[axis])));
            }
            let (Some(&first), Some(&last)) = (list.first(), list.last()) else { continue };
            let sign = (last - first).signum();
            let gap = |pair: &[f64]| (pair[1] - pair[0]) * sign;
            // NaN fails the comparison.
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
            let [least, most] = [least, most].map(short);
            if wanted > MOST_GROWTH * intervals {
                let rule = format!("an even lattice would need {wanted} samples instead of {intervals}");
                let rule = format!("gaps from {least} to {most}: {rule}; resample the data first");
                refused.get_or_insert(at(rule));
            }
            uneven[axis] = true;
            steps[axis] = (last - first) / wanted;
            counts[axis] = num::u32_of(wanted).saturating_add(1);
            notes.push(format!(
                "{letter}: gaps from {least} to {most}, resampled linearly from {} to {} samples",
                dims[axis], counts[axis]
            ));
        }
        Ok(Self { origin, steps, counts, uneven, notes, refused })
    }
}

/// Rounds to six digits, because differences carry the rounding of their operands.
fn short(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// Returns, for each position on an even axis, its interval in the list and its fraction along it.
fn shares(list: &[f64], origin: f64, step: f64, count: u32) -> Vec<(usize, f64)> {
    let mut interval = 0;
    let place = |i: u32| {
        let at = origin + step * f64::from(i);
        while interval + 2 < list.len() && (at - list[interval + 1]) * step >= 0.0 {
            interval += 1;
        }
        let share = (at - list[interval]) / (list[interval + 1] - list[interval]);
        // Positions within rounding of a listed one take its value exactly.
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
                // A NaN neighbour must not spread to a sample that is hit exactly.
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
    use crate::io::options::ReadOptions;

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
