//! From points and arrays to kernels: scalars, radii, covariances and weights.

use glam::DVec3;

use crate::error::Result;
use crate::io::build::arrays::{self, ArrayInfo, Association, Choice, coarse, describe};
use crate::io::build::origin::{Origin, ReadArray};
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::num;
use crate::scene::{Data, KernelSize, Points};

/// Reads positions, once memory for all of them is reserved. `each` passes on three numbers for each.
pub(crate) fn positions(
    source: &Source,
    budget: &mut Budget,
    count: usize,
    each: impl FnOnce(&mut dyn FnMut(&[f64])) -> Result<()>,
) -> Result<Vec<DVec3>> {
    budget.take("points", num::wide(count).saturating_mul(24))?;
    let mut points = Vec::new();
    points.try_reserve_exact(count).map_err(|_| source.error("points", "memory is full"))?;
    each(&mut |xyz| points.extend(<[f64; 3]>::try_from(xyz).map(DVec3::from_array)))?;
    Ok(points)
}

/// Builds kernels at points, with the arrays that the options select. Points that are not finite are left out, with a
/// note.
pub(crate) fn points(
    mut centres: Vec<DVec3>,
    origin: Origin,
    budget: &mut Budget,
    read: &mut ReadArray,
    options: &ReadOptions,
) -> Result<Loaded> {
    let Origin { source, format, arrays } = origin;
    let mut columns = Columns { source, arrays: &arrays, count: centres.len(), budget, read };
    let (chosen, mut values) = columns.read_all(options)?;
    let mut notes = Vec::new();
    let finite: Vec<bool> = centres.iter().map(|centre| centre.is_finite()).collect();
    let nowhere = finite.iter().filter(|finite| !**finite).count();
    if nowhere > 0 {
        keep(&mut centres, &finite);
        values.keep(&finite);
        notes.push(format!("{nowhere} points with positions that are not finite left out"));
    }
    let points = values.attach(centres).map_err(|error| error.in_file(source.path()))?;
    let mut warnings = Vec::new();
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

/// Keeps the entries that are marked.
fn keep<T>(list: &mut Vec<T>, marked: &[bool]) {
    let mut i = 0;
    list.retain(|_| {
        i += 1;
        marked[i - 1]
    });
}

/// The numbers of all points, as far as they are selected.
struct Values {
    scalars: Option<Vec<f32>>,
    radii: Option<Vec<f32>>,
    weights: Option<Vec<f32>>,
    covariances: Option<Vec<[f32; 6]>>,
}

impl Values {
    /// Keeps the points that are marked.
    fn keep(&mut self, marked: &[bool]) {
        for list in [&mut self.scalars, &mut self.radii, &mut self.weights].into_iter().flatten() {
            keep(list, marked);
        }
        if let Some(list) = &mut self.covariances {
            keep(list, marked);
        }
    }

    /// Makes points of their centres and these numbers.
    fn attach(self, centres: Vec<DVec3>) -> Result<Points> {
        let mut points = Points::new(centres)?;
        if let Some(scalars) = self.scalars {
            points = points.with_scalars(scalars)?;
        }
        if let Some(weights) = self.weights {
            points = points.with_weights(weights)?;
        }
        if let Some(radii) = self.radii {
            points = points.with_size(KernelSize::Radii(radii))?;
        }
        if let Some(covariances) = self.covariances {
            points = points.with_size(KernelSize::Covariances(covariances))?;
        }
        Ok(points)
    }
}

/// Reads arrays with one tuple per point.
struct Columns<'c, 'b, 'r> {
    source: &'c Source,
    arrays: &'c [ArrayInfo],
    count: usize,
    budget: &'c mut Budget<'b>,
    read: &'c mut ReadArray<'r>,
}

impl Columns<'_, '_, '_> {
    /// Reads everything that the options select, and the scalars to show.
    fn read_all(&mut self, options: &ReadOptions) -> Result<(Option<Choice>, Values)> {
        // Cell data of vertices would be point data too, but nothing says that there is one vertex per point. An array
        // that gives sizes or weights is shown only on request.
        let taken: Vec<usize> = [&options.radius, &options.covariance, &options.weight]
            .into_iter()
            .filter_map(|name| self.find(name).ok().flatten().map(|choice| choice.index))
            .collect();
        let own =
            |i: usize, array: &ArrayInfo| array.association == Association::Point && !taken.contains(&i);
        let chosen = self.find(&options.array)?.or_else(|| arrays::choose_among(self.arrays, own));
        let scalars = chosen.map(|choice| self.column(choice.index, choice.pick)).transpose()?;
        let radii = self.named(&options.radius)?;
        let weights = self.named(&options.weight)?;
        let covariances =
            self.find(&options.covariance)?.map(|choice| self.covariances(choice.index)).transpose()?;
        if radii.is_some() && covariances.is_some() {
            return Err(self.source.error("arrays", "points have either radii or covariances"));
        }
        Ok((chosen, Values { scalars, radii, weights, covariances }))
    }

    /// The array of a name that an option gives.
    fn find(&self, name: &Option<String>) -> Result<Option<Choice>> {
        name.as_deref().map(|name| arrays::find(self.source, self.arrays, name)).transpose()
    }

    /// Reads the array of a name that an option gives.
    fn named(&mut self, name: &Option<String>) -> Result<Option<Vec<f32>>> {
        self.find(name)?.map(|choice| self.column(choice.index, choice.pick)).transpose()
    }

    /// Reads one number per point.
    fn column(&mut self, index: usize, pick: Pick) -> Result<Vec<f32>> {
        let array = &self.arrays[index];
        if array.association == Association::Cell && array.components > 0 {
            return Err(self.source.error(format!("array {array}"), "cell data: points need point data"));
        }
        self.budget.take("arrays", num::wide(self.count).saturating_mul(4))?;
        let values = (self.read)(index, pick)?.into_f32();
        if values.len() != self.count {
            let rule = format!("{} tuples: there are {} points", values.len(), self.count);
            return Err(self.source.error(format!("array {array}"), rule));
        }
        Ok(values)
    }

    /// Reads covariances of 6 or 9 components as xx, xy, xz, yy, yz, zz.
    fn covariances(&mut self, index: usize) -> Result<Vec<[f32; 6]>> {
        let places: [usize; 6] = match self.arrays[index].components {
            6 => [0, 1, 2, 3, 4, 5],
            9 => [0, 1, 2, 4, 5, 8],
            n => {
                let rule = format!("{n} components: a covariance has 6 or 9");
                return Err(self.source.error(format!("array {}", self.arrays[index]), rule));
            }
        };
        self.budget.take("arrays", num::wide(self.count).saturating_mul(24))?;
        let mut all = vec![[0.0; 6]; self.count];
        for (i, place) in places.into_iter().enumerate() {
            for (all, value) in all.iter_mut().zip(self.column(index, Pick::Component(place))?) {
                all[i] = value;
            }
        }
        Ok(all)
    }
}
