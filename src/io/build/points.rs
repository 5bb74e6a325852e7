//! From points and arrays to kernels: scalars, radii, covariances and weights.

use glam::DVec3;

use crate::error::Result;
use crate::io::build::arrays::{self, ArrayInfo, Association, Choice};
use crate::io::build::data_file::Shape;
use crate::io::build::dataset::Dataset;
use crate::io::build::origin::Origin;
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::options::{ReadOptions, Request};
use crate::io::report::Found;
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
pub(crate) fn points(mut centres: Vec<DVec3>, origin: Origin) -> Result<Found> {
    let Origin { source, request: &Request { options, .. }, .. } = origin;
    if origin.is_kept() {
        let count = centres.len();
        origin.budget.take("points", num::wide(count).saturating_mul(9))?;
        return origin.keep(Shape::Cells(Dataset::of_points(centres)), [count; 2]);
    }
    origin.check_places(&centres)?;
    let finite = centres.iter().map(|centre| centre.is_finite()).collect();
    let mut columns = Columns { origin, finite };
    let chosen = columns.chosen(options)?;
    let scalars = chosen.map(|choice| columns.column(choice)).transpose()?;
    let radii = columns.named(&options.radius)?;
    let weights = columns.named(&options.weight)?;
    let covariances = columns.find(&options.covariance)?;
    let covariances = covariances.map(|choice| columns.covariances(choice.index)).transpose()?;
    if radii.is_some() && covariances.is_some() {
        return Err(source.error("arrays", "points have either radii or covariances"));
    }
    let mut notes = Vec::new();
    if radii.is_none() && covariances.is_none() {
        notes.extend(columns.origin.arrays.iter().find(|array| may_be_radii(array)).map(|array| {
            format!("array {array} may hold the radii of the points: it is not used as such unless `radius` names it")
        }));
    }
    let nowhere = columns.finite.iter().filter(|finite| !**finite).count();
    if nowhere > 0 {
        keep(&mut centres, &columns.finite);
        notes.push(format!("{nowhere} points with positions that are not finite left out"));
    }
    let attach = || -> Result<Points> {
        let mut points = Points::new(centres)?;
        if let Some(scalars) = scalars {
            points = points.with_scalars(scalars)?;
        }
        if let Some(weights) = weights {
            points = points.with_weights(weights)?;
        }
        let size = radii.map(KernelSize::Radii).or(covariances.map(KernelSize::Covariances));
        match size {
            Some(size) => points.with_size(size),
            None => Ok(points),
        }
    };
    let points = attach().map_err(|error| error.in_file(source.path()))?;
    Ok(columns.origin.loaded(Data::Points(points), chosen, notes).into())
}

/// Whether the name of an array says that it holds radii.
fn may_be_radii(array: &ArrayInfo) -> bool {
    let name = array.name.to_lowercase();
    let says = ["radius", "radii"].iter().any(|word| name.ends_with(word));
    says && array.association == Association::Point && array.components == 1
}

/// Keeps the entries that are marked.
pub(crate) fn keep<T>(list: &mut Vec<T>, marked: &[bool]) {
    let mut marks = marked.iter();
    list.retain(|_| marks.next() == Some(&true));
}

/// Reads arrays with one tuple per point.
struct Columns<'o, 'b> {
    origin: Origin<'o, 'b>,
    /// Whether each point is finite, and is kept.
    finite: Vec<bool>,
}

impl Columns<'_, '_> {
    /// Chooses the scalars to show.
    fn chosen(&self, options: &ReadOptions) -> Result<Option<Choice>> {
        // Cell data of vertices would be point data too, but nothing says that there is one vertex per point. An array
        // that gives sizes or weights is shown only on request.
        let taken: Vec<usize> = [&options.radius, &options.covariance, &options.weight]
            .into_iter()
            .filter_map(|name| self.find(name).ok().flatten().map(|choice| choice.index))
            .collect();
        let own =
            |i: usize, array: &ArrayInfo| array.association == Association::Point && !taken.contains(&i);
        Ok(self.find(&options.array)?.or_else(|| arrays::choose_among(&self.origin.arrays, own)))
    }

    /// The array of a name that an option gives.
    fn find(&self, name: &Option<String>) -> Result<Option<Choice>> {
        name.as_deref().map(|name| arrays::find(self.origin.source, &self.origin.arrays, name)).transpose()
    }

    /// Reads the array of a name that an option gives.
    fn named(&mut self, name: &Option<String>) -> Result<Option<Vec<f32>>> {
        self.find(name)?.map(|choice| self.column(choice)).transpose()
    }

    /// Reads one number per finite point.
    fn column(&mut self, Choice { index, pick }: Choice) -> Result<Vec<f32>> {
        let array = &self.origin.arrays[index];
        if array.association == Association::Cell && array.components > 0 {
            let rule = "cell data: points need point data";
            return Err(self.origin.source.error(format!("array {array}"), rule));
        }
        let count = self.finite.len();
        self.origin.budget.take("arrays", num::wide(count).saturating_mul(4))?;
        let mut values = (self.origin.read)(index, pick)?.into_samples().into_f32();
        if values.len() != count {
            let rule = format!("{} tuples: there are {count} points", values.len());
            return Err(self.origin.source.error(format!("array {array}"), rule));
        }
        keep(&mut values, &self.finite);
        Ok(values)
    }

    /// Reads covariances of 6 or 9 components as xx, xy, xz, yy, yz, zz.
    fn covariances(&mut self, index: usize) -> Result<Vec<[f32; 6]>> {
        let places: [usize; 6] = match self.origin.arrays[index].components {
            6 => [0, 1, 2, 3, 4, 5],
            9 => [0, 1, 2, 4, 5, 8],
            n => {
                let rule = format!("{n} components: a covariance has 6 or 9");
                return Err(self.origin.source.error(format!("array {}", self.origin.arrays[index]), rule));
            }
        };
        self.origin.budget.take("arrays", num::wide(self.finite.len()).saturating_mul(24))?;
        let mut all = vec![[0.0; 6]; self.finite.iter().filter(|finite| **finite).count()];
        for (i, place) in places.into_iter().enumerate() {
            let column = self.column(Choice { index, pick: Pick::Component(place) })?;
            all.iter_mut().zip(column).for_each(|(all, value)| all[i] = value);
        }
        Ok(all)
    }
}
