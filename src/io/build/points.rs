//! From points and arrays to kernels: scalars, radii, covariances and weights.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::build::arrays::describe;
use crate::io::build::arrays::{self, ArrayInfo, Association, Choice, coarse};
use crate::io::build::origin::{Origin, ReadArray};
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::Pick;
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::num;
use crate::scene::{Data, KernelSize, Points};

/// Points, with what the options ask of their arrays.
pub(crate) fn points(
    mut centres: Vec<DVec3>,
    origin: Origin,
    budget: &mut Budget,
    read: &mut ReadArray,
    options: &ReadOptions,
) -> Result<Loaded> {
    let Origin { source, format, arrays } = origin;
    let count = centres.len();
    let mut column = |budget: &mut Budget, index: usize, pick: Pick| -> Result<Vec<f32>> {
        let array = &arrays[index];
        if array.association == Association::Cell && array.components > 0 {
            return Err(source.error(format!("array {array}"), "cell data: points need point data"));
        }
        budget.take("arrays", num::wide(count).saturating_mul(4))?;
        let values = read(index, pick)?.into_f32();
        if values.len() != count {
            let rule = format!("{} tuples: there are {count} points", values.len());
            return Err(source.error(format!("array {array}"), rule));
        }
        Ok(values)
    };
    let wanted =
        |name: &Option<String>| name.as_deref().map(|name| arrays::find(source, &arrays, name)).transpose();
    // Cell data of vertices would be points' data too, but nothing says that there is a vertex for each. What
    // is a size or a weight is not what is shown, unless it is asked for.
    let taken: Vec<usize> = [&options.radius, &options.covariance, &options.weight]
        .into_iter()
        .filter_map(|name| wanted(name).ok().flatten().map(|choice| choice.index))
        .collect();
    let own = |i: usize, array: &ArrayInfo| array.association == Association::Point && !taken.contains(&i);
    let chosen = wanted(&options.array)?.or_else(|| arrays::choose_among(&arrays, own));
    let mut scalars = chosen.map(|choice| column(budget, choice.index, choice.pick)).transpose()?;
    let mut radii =
        wanted(&options.radius)?.map(|choice| column(budget, choice.index, choice.pick)).transpose()?;
    let mut weights =
        wanted(&options.weight)?.map(|choice| column(budget, choice.index, choice.pick)).transpose()?;
    let mut covariances = match wanted(&options.covariance)? {
        None => None,
        Some(Choice { index, .. }) => {
            let places: [usize; 6] = match arrays[index].components {
                6 => [0, 1, 2, 3, 4, 5],
                9 => [0, 1, 2, 4, 5, 8],
                n => {
                    let rule = format!("{n} components: a covariance has 6 or 9");
                    return Err(source.error(format!("array {}", arrays[index]), rule));
                }
            };
            budget.take("arrays", num::wide(count).saturating_mul(24))?;
            let mut all = vec![[0.0; 6]; count];
            for (i, place) in places.into_iter().enumerate() {
                for (all, value) in all.iter_mut().zip(column(budget, index, Pick::Component(place))?) {
                    all[i] = value;
                }
            }
            Some(all)
        }
    };
    if radii.is_some() && covariances.is_some() {
        return Err(source.error("arrays", "points have either radii or covariances"));
    }

    let mut notes = Vec::new();
    let mut warnings = Vec::new();
    let finite: Vec<bool> = centres.iter().map(|centre| centre.is_finite()).collect();
    let nowhere = finite.iter().filter(|finite| !**finite).count();
    if nowhere > 0 {
        fn keep<T>(list: &mut Vec<T>, finite: &[bool]) {
            let mut i = 0;
            list.retain(|_| {
                i += 1;
                finite[i - 1]
            });
        }
        keep(&mut centres, &finite);
        for list in [&mut scalars, &mut radii, &mut weights].into_iter().flatten() {
            keep(list, &finite);
        }
        if let Some(list) = &mut covariances {
            keep(list, &finite);
        }
        notes.push(format!("{nowhere} points whose place is not finite left out"));
    }

    let located = |error: Error| error.in_file(source.path());
    let mut points = Points::new(centres).map_err(located)?;
    if let Some(scalars) = scalars {
        points = points.with_scalars(scalars).map_err(located)?;
    }
    if let Some(weights) = weights {
        points = points.with_weights(weights).map_err(located)?;
    }
    if let Some(radii) = radii {
        points = points.with_size(KernelSize::Radii(radii)).map_err(located)?;
    }
    if let Some(covariances) = covariances {
        points = points.with_size(KernelSize::Covariances(covariances)).map_err(located)?;
    }
    if let Some(choice) = chosen {
        warnings.extend(coarse(points.range(), &arrays[choice.index]));
    }
    let mut loaded = Loaded::new(format, Data::Points(points));
    loaded.report.shown = chosen.map(|choice| describe(&arrays[choice.index], choice.pick));
    loaded.report.arrays = arrays;
    loaded.report.notes = notes;
    loaded.report.warnings = warnings;
    Ok(loaded)
}
