//! From points on a lattice and an array to a grid.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::io::build::arrays::{self, Association, Choice};
use crate::io::build::data_file::{Lattice, Shape, stand_in};
use crate::io::build::origin::Origin;
use crate::io::build::resample::{Axes, evenly};
use crate::io::file::sample_type::Pick;
use crate::io::options::Wanted;
use crate::io::report::Found;
use crate::num;
use crate::scene::{Data, Grid, Samples};

/// The positions of the points of a lattice.
#[derive(Clone, Debug)]
pub(crate) enum Places {
    /// Points are evenly spaced: `origin + direction * (spacing * index)`.
    Even { origin: DVec3, spacing: DVec3, direction: DMat3 },
    /// Each axis lists its coordinates in the order of the samples, rising or falling.
    Listed([Vec<f64>; 3]),
}

impl Places {
    /// Builds an even lattice whose first sample has the index `first`; `origin` is the position of index 0, and
    /// `direction` is a matrix, row by row. A negative spacing reverses its axis. Adds notes on both.
    pub(crate) fn even(
        origin: [f64; 3],
        spacing: [f64; 3],
        direction: &[f64; 9],
        first: [f64; 3],
        notes: &mut Vec<String>,
    ) -> Self {
        let [x, y, z] = first;
        let (origin, spacing, first) = (DVec3::from(origin), DVec3::from(spacing), DVec3::from(first));
        let direction = DMat3::from_cols_array(direction).transpose();
        if first != DVec3::ZERO {
            notes.push(format!("indices begin at {x} {y} {z}: the origin is moved there"));
        }
        let turned = spacing.map(|step| if step < 0.0 { -1.0 } else { 1.0 });
        if turned != DVec3::ONE {
            notes.push("negative spacing: axes are reversed".to_owned());
        }
        let origin = origin + direction * (spacing * first);
        Self::Even { origin, spacing: spacing.abs(), direction: direction * DMat3::from_diagonal(turned) }
    }
}

/// Builds a grid from points on a lattice and arrays on its points or cells. `dims` counts points.
///
/// Cell data gives a sample at the centre of each cell. Points and cells hidden by VTK's ghost array become NaN. `in_file` has the samples of
/// the array that is shown where they stay in the file.
pub(crate) fn build(
    mut origin: Origin,
    dims: [u32; 3],
    places: Places,
    in_file: Option<Samples>,
) -> Result<Found> {
    let source = origin.source;
    if origin.is_kept() {
        return keep(origin, dims, places);
    }
    let chosen = arrays::choose(source, &origin.arrays, origin.request.array.as_deref())?;
    let Some(Choice { index, pick }) = chosen else {
        return Err(source.error("arrays", "none: a grid needs point or cell data to show"));
    };
    let array = origin.arrays[index].clone();
    let mut notes = Vec::new();
    let association = array.association;
    let (dims, places) = match association {
        Association::Point => (dims, places),
        Association::Cell => {
            notes.push("cell data: each value is a sample at the centre of its cell".to_owned());
            (dims.map(|extent| extent.saturating_sub(1)), centres(places))
        }
    };
    if let Some(extent) = dims.iter().find(|&&extent| extent < 2) {
        let [x, y, z] = dims;
        let rule = format!("{x} x {y} x {z} samples: {extent} is too few, every extent must be at least 2");
        return Err(source.error(format!("array {array}"), rule));
    }
    let overflow = || source.error("dimensions", format!("{dims:?}: more samples than memory can address"));
    let count =
        dims.iter().try_fold(1_u64, |n, &extent| n.checked_mul(u64::from(extent))).ok_or_else(overflow)?;
    let mut samples = match in_file {
        Some(samples) => samples,
        None => {
            let stored = if pick == Pick::Magnitude { 4 } else { array.kind.stored_bytes() };
            origin.budget.take("dimensions", count.saturating_mul(stored))?;
            (origin.read)(index, pick)?.into_samples()
        }
    };
    if Ok(samples.len()) != usize::try_from(count) {
        let [x, y, z] = dims;
        let rule = format!("{} tuples: {x} x {y} x {z} are needed", samples.len());
        return Err(source.error(format!("array {array}"), rule));
    }

    if let Some(flags) = origin.ghosts(association, samples.len())? {
        let hidden = if association == Association::Point { 2 } else { 32 };
        let masked = flags.iter().filter(|&&flag| flag & hidden != 0).count();
        if masked > 0 {
            let narrow = !matches!(samples, Samples::F32(_));
            origin.budget.take("vtkGhostType", if narrow { count.saturating_mul(4) } else { 0 })?;
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
    let mut file_range = None;
    let grid = match places {
        Places::Even { origin, spacing, direction } => {
            Grid::new(dims, samples).and_then(|grid| grid.with_placement(spacing, origin, direction))
        }
        Places::Listed(coordinates) => {
            let even = evenly(source, "coordinates", dims, samples, coordinates, origin.budget)?;
            notes.extend(even.note);
            file_range = even.range;
            Grid::new(even.dims, even.samples).and_then(|grid| {
                grid.with_placement(even.steps.abs(), even.origin, DMat3::from_diagonal(even.steps.signum()))
            })
        }
    }
    .map_err(located)?;
    let mut loaded = origin.loaded(Data::Grid(grid), chosen, notes);
    loaded.report.file_range = file_range;
    Ok(loaded.into())
}

/// Keeps the lattice and the requested arrays.
fn keep(mut origin: Origin, dims: [u32; 3], places: Places) -> Result<Found> {
    let source = origin.source;
    let located = |error: Error| error.in_file(source.path());
    if let Some(extent) = dims.iter().find(|&&extent| extent < 2) {
        let [x, y, z] = dims;
        let rule = format!("{x} x {y} x {z} points: {extent} is too few, every extent must be at least 2");
        return Err(source.error("dimensions", rule));
    }
    let lattice = |spacing, origin, direction| Lattice::new(dims, spacing, origin, direction, &stand_in()?);
    let shape = match places {
        Places::Even { origin, spacing, direction } => {
            Shape::Even(lattice(spacing, origin, direction).map_err(located)?)
        }
        Places::Listed(listed) => {
            let axes = Axes::of(source, "coordinates", dims, &listed)?;
            if axes.is_even() {
                let direction = DMat3::from_diagonal(axes.steps.signum());
                let lattice = lattice(axes.steps.abs(), axes.origin, direction).map_err(located)?;
                Shape::Even(Lattice { listed: Some(listed), ..lattice })
            } else {
                Shape::Uneven(listed)
            }
        }
    };
    let count = |dims: [u32; 3]| dims.into_iter().map(num::index).fold(1_usize, usize::saturating_mul);
    let counts = [count(dims), count(dims.map(|extent| extent - 1))];
    let mut warnings = Vec::new();
    // Only VTK's own files have a place for hidden samples.
    if origin.request.wanted == Wanted::OneArray {
        for (association, hidden) in [(Association::Point, 2), (Association::Cell, 32)] {
            let flags = origin.ghosts(association, counts[usize::from(association == Association::Cell)])?;
            let masked = flags.unwrap_or_default().iter().filter(|&flag| flag & hidden != 0).count();
            if masked > 0 {
                let what = association.name();
                warnings.push(format!(
                    "{masked} hidden {what}s: the output has their values but not that they are hidden"
                ));
            }
        }
    }
    let mut found = origin.keep(shape, counts)?;
    found.report.warnings.splice(0..0, warnings);
    Ok(found)
}

/// Returns the lattice of the cell centres.
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
