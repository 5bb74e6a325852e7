//! Scattered points with kernels.

mod spacing;

use std::sync::Arc;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::num;

use super::{TetScalars, Tets};

/// Describes the extent of the kernels of points.
#[derive(Clone, Debug, PartialEq)]
pub enum KernelSize {
    /// The source gives no size.
    Unknown,
    /// One support radius for all points, in world units.
    Radius(f64),
    /// A support radius for each point, in world units.
    Radii(Vec<f32>),
    /// A covariance for each point, in world units squared: xx, xy, xz, yy, yz, zz.
    Covariances(Vec<[f32; 6]>),
}

/// Kernels at scattered centres, each with a scalar and a weight.
///
/// Valid by construction: centres are finite, and each list has one entry per point. A point with a NaN
/// scalar, weight or size is invisible.
#[derive(Clone, Debug)]
pub struct Points {
    /// Shared, so that points are cheap to clone.
    centres: Arc<Vec<DVec3>>,
    scalars: Option<Arc<Vec<f32>>>,
    weights: Option<Arc<Vec<f32>>>,
    size: Arc<KernelSize>,
    bounds: [DVec3; 2],
    range: [f64; 2],
}

impl Points {
    /// Makes points of unknown size with scalar 1 and weight 1. Centres are in world units.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if there is no centre, or one is not finite.
    pub fn new(centres: Vec<DVec3>) -> Result<Self> {
        if centres.is_empty() {
            return Err(Error::invalid("points", "there must be at least one"));
        }
        if let Some(i) = centres.iter().position(|centre| !centre.is_finite()) {
            return Err(Error::invalid("points", format!("centre {i} is {}: must be finite", centres[i])));
        }
        let all = |f: fn(DVec3, DVec3) -> DVec3| centres.iter().copied().reduce(f).unwrap_or(DVec3::ZERO);
        let bounds = [all(DVec3::min), all(DVec3::max)];
        Ok(Self {
            centres: Arc::new(centres),
            scalars: None,
            weights: None,
            size: Arc::new(KernelSize::Unknown),
            bounds,
            range: [1.0; 2],
        })
    }

    /// Makes points of the vertices that a mesh's tetrahedra use, in the mesh's order.
    ///
    /// The radius of a point is its longest edge, so its kernel reaches all its neighbours. If scalars belong
    /// to the cells, a point takes the mean of those around it that are not NaN. Its scalar is NaN where all
    /// of these are NaN, or where +Inf meets -Inf.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if no scalar is finite, or an edge is too long for float32.
    pub fn of_vertices(mesh: &Tets) -> Result<Self> {
        let all = mesh.points();
        let mut longest = vec![0.0_f64; all.len()];
        let mut used = vec![false; all.len()];
        for cell in mesh.cells() {
            let corners = cell.map(num::index);
            for (i, &a) in corners.iter().enumerate() {
                used[a] = true;
                for &b in &corners[i + 1..] {
                    let length = all[a].distance(all[b]);
                    longest[a] = longest[a].max(length);
                    longest[b] = longest[b].max(length);
                }
            }
        }
        let scalars = match mesh.scalars() {
            TetScalars::Point(values) => values.clone(),
            TetScalars::Cell(values) => {
                let mut sums = vec![(0.0, 0_u32); all.len()];
                for (cell, &value) in mesh.cells().iter().zip(values).filter(|(_, value)| !value.is_nan()) {
                    for corner in cell {
                        let (sum, count) = &mut sums[num::index(*corner)];
                        *sum += f64::from(value);
                        *count += 1;
                    }
                }
                sums.into_iter().map(|(sum, count)| num::f32_of(sum / f64::from(count))).collect()
            }
        };
        let kept = || used.iter().enumerate().filter_map(|(i, &used)| used.then_some(i));
        Self::new(kept().map(|i| all[i]).collect())?
            .with_scalars(kept().map(|i| scalars[i]).collect())?
            .with_size(KernelSize::Radii(kept().map(|i| num::f32_of(longest[i])).collect()))
    }

    /// Sets the scalars.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if their number is not that of the points, or none is finite.
    pub fn with_scalars(mut self, scalars: Vec<f32>) -> Result<Self> {
        self.fits("scalars", scalars.len())?;
        let finite = || scalars.iter().copied().filter(|s| s.is_finite()).map(f64::from);
        let range = [finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max)];
        if range[0] > range[1] {
            return Err(Error::invalid("scalars of points", "at least one must be finite"));
        }
        self.range = range;
        self.scalars = Some(Arc::new(scalars));
        Ok(self)
    }

    /// Sets the weights.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if their number is not that of the points.
    pub fn with_weights(mut self, weights: Vec<f32>) -> Result<Self> {
        self.fits("weights", weights.len())?;
        self.weights = Some(Arc::new(weights));
        Ok(self)
    }

    /// Sets the size of the kernels.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the length of a list is not the number of points, or a radius or a variance is
    /// negative or infinite.
    pub fn with_size(mut self, size: KernelSize) -> Result<Self> {
        let valid = |x: f64| x.is_nan() || (x >= 0.0 && x.is_finite());
        let wrong = match &size {
            KernelSize::Unknown => None,
            KernelSize::Radius(radius) => (!(*radius > 0.0 && radius.is_finite())).then_some((0, *radius)),
            KernelSize::Radii(radii) => {
                self.fits("radii", radii.len())?;
                radii.iter().map(|&r| f64::from(r)).enumerate().find(|&(_, r)| !valid(r))
            }
            KernelSize::Covariances(all) => {
                self.fits("covariances", all.len())?;
                let variances = |(i, c): (usize, &[f32; 6])| [c[0], c[3], c[5]].map(|v| (i, f64::from(v)));
                all.iter().enumerate().flat_map(variances).find(|&(_, v)| !valid(v))
            }
        };
        if let Some((i, size)) = wrong {
            let rule = "radii and variances must be finite and not negative, a common radius positive";
            return Err(Error::invalid("sizes of points", format!("point {i} has {size}: {rule}")));
        }
        self.size = Arc::new(size);
        Ok(self)
    }

    fn fits(&self, what: &str, count: usize) -> Result<()> {
        if count == self.centres.len() {
            return Ok(());
        }
        let why = format!("{count} are given, there are {} points", self.centres.len());
        Err(Error::invalid(format!("{what} of points"), why))
    }

    /// Returns the centres, in world units.
    #[must_use]
    pub fn centres(&self) -> &[DVec3] {
        &self.centres
    }

    /// Returns the scalars. `None` means that each is 1.
    #[must_use]
    pub fn scalars(&self) -> Option<&[f32]> {
        self.scalars.as_ref().map(|scalars| scalars.as_slice())
    }

    /// Returns the weights. `None` means that each is 1.
    #[must_use]
    pub fn weights(&self) -> Option<&[f32]> {
        self.weights.as_ref().map(|weights| weights.as_slice())
    }

    /// Returns the size of the kernels.
    #[must_use]
    pub fn size(&self) -> &KernelSize {
        &self.size
    }

    /// Returns the least and the greatest coordinates of the centres.
    #[must_use]
    pub fn bounds(&self) -> [DVec3; 2] {
        self.bounds
    }

    /// Returns the smallest and the largest finite scalar.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// Returns whether a point may be visible: scalar, weight and size are not NaN, weight and size not zero.
    #[must_use]
    pub fn shows(&self, i: usize) -> bool {
        let scalar = self.scalars().is_none_or(|scalars| !scalars[i].is_nan());
        let weight = self.weights().is_none_or(|weights| !weights[i].is_nan() && weights[i] != 0.0);
        let sized = match self.size() {
            KernelSize::Unknown | KernelSize::Radius(_) => true,
            KernelSize::Radii(radii) => radii[i] > 0.0,
            KernelSize::Covariances(all) => {
                let c = all[i];
                !c.iter().any(|c| c.is_nan()) && c[0].max(c[3]).max(c[5]) > 0.0
            }
        };
        scalar && weight && sized
    }

    /// Returns the least and the greatest coordinates of the kernels of all visible points.
    ///
    /// A kernel extends by its radius, or by three standard deviations of its covariance. If no point is
    /// visible or the size is unknown, these are the bounds of the centres.
    #[must_use]
    pub fn reach(&self) -> [DVec3; 2] {
        self.reach_of(|_| true).unwrap_or(self.bounds)
    }

    /// How far a kernel reaches from its centre along each axis.
    fn extent(&self, i: usize) -> DVec3 {
        let deviations = |c: &[f32; 6]| DVec3::new(c[0].into(), c[3].into(), c[5].into()).map(f64::sqrt);
        match self.size() {
            KernelSize::Unknown => DVec3::ZERO,
            KernelSize::Radius(radius) => DVec3::splat(*radius),
            KernelSize::Radii(radii) => DVec3::splat(radii[i].into()),
            KernelSize::Covariances(all) => 3.0 * deviations(&all[i]),
        }
    }

    /// Returns the points that are kept by their centres, and by how far their kernels reach along each axis; the first alone where none is.
    pub(crate) fn within(&self, keeps: impl Fn(DVec3, DVec3) -> bool) -> Self {
        let all = 0..self.centres.len();
        let mut kept: Vec<usize> = all.filter(|&i| keeps(self.centres[i], self.extent(i))).collect();
        if kept.is_empty() {
            kept.push(0);
        }
        fn of<T: Copy>(values: &[T], kept: &[usize]) -> Vec<T> {
            kept.iter().map(|&i| values[i]).collect()
        }
        let size = match &*self.size {
            KernelSize::Radii(radii) => KernelSize::Radii(of(radii, &kept)),
            KernelSize::Covariances(all) => KernelSize::Covariances(of(all, &kept)),
            size => size.clone(),
        };
        Self {
            centres: Arc::new(of(&self.centres, &kept)),
            scalars: self.scalars.as_ref().map(|scalars| Arc::new(of(scalars, &kept))),
            weights: self.weights.as_ref().map(|weights| Arc::new(of(weights, &kept))),
            size: Arc::new(size),
            // Positions are rounded as those of the whole, from whose middle the device counts them.
            ..self.clone()
        }
    }

    /// Returns the bounds of the kernels of those visible points that are wanted, or `None` without any.
    pub(crate) fn reach_of(&self, wanted: impl Fn(usize) -> bool) -> Option<[DVec3; 2]> {
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let shown = (0..self.centres.len()).filter(|&i| self.shows(i) && wanted(i));
        let [low, high] = shown.fold(none, |[low, high], i| {
            let (centre, reach) = (self.centres[i], self.extent(i));
            [low.min(centre - reach), high.max(centre + reach)]
        });
        (low.x <= high.x).then_some([low, high])
    }

    /// Returns the median distance from a point to its nearest neighbour at another place, in world units, or
    /// `None` if all points are at one place.
    ///
    /// Coincident points and a few outliers change it little. It is exact up to 65,536 places; above, it is
    /// the median of an evenly spread subset.
    #[must_use]
    pub fn spacing(&self) -> Option<f64> {
        spacing::median(&self.centres)
    }

    /// The estimated radius in units of [`Self::spacing`].
    ///
    /// On a cubic lattice a Gaussian then has a standard deviation of one spacing, and the sum of all is
    /// constant to 6e-3. For random points, 19 kernels reach a place on average, and the probability that
    /// none does is 7e-9.
    pub const RADIUS_IN_SPACINGS: f64 = 3.0;

    /// Returns the points with one radius for all at which kernels overlap: [`Self::RADIUS_IN_SPACINGS`]
    /// times the spacing.
    ///
    /// If all points are at one place, the radius is the greater of 1 and a millionth of the largest
    /// coordinate, which exceeds the coordinates' rounding.
    #[must_use]
    pub fn with_estimated_radius(mut self) -> Self {
        let alone = || {
            let [low, high] = self.bounds;
            (1e-6 * low.abs().max(high.abs()).max_element()).max(1.0)
        };
        let radius = self.spacing().map_or_else(alone, |spacing| Self::RADIUS_IN_SPACINGS * spacing);
        self.size = Arc::new(KernelSize::Radius(radius.min(f64::MAX)));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_have_an_entry_for_each_point() {
        let points = || Points::new(vec![DVec3::ZERO, DVec3::ONE]).unwrap();
        assert_eq!((points().range(), points().bounds()), ([1.0; 2], [DVec3::ZERO, DVec3::ONE]));
        let with = points().with_scalars(vec![f32::NAN, 3.0]).unwrap();
        assert_eq!(with.range(), [3.0; 2]);
        assert!(points().with_scalars(vec![1.0]).unwrap_err().to_string().contains("1 are given"));
        assert!(points().with_scalars(vec![f32::NAN; 2]).is_err());
        assert!(points().with_weights(vec![]).is_err());
        assert!(
            points()
                .with_size(KernelSize::Radii(vec![1.0, -1.0]))
                .unwrap_err()
                .to_string()
                .contains("point 1")
        );
        assert!(points().with_size(KernelSize::Radius(0.0)).is_err());
        let mut covariance = [0.1; 6];
        covariance[3] = -0.1;
        assert!(points().with_size(KernelSize::Covariances(vec![[0.0; 6], covariance])).is_err());
        assert!(Points::new(vec![]).is_err() && Points::new(vec![DVec3::NAN]).is_err());
    }

    #[test]
    fn vertices_reach_their_neighbours() {
        let corners = vec![
            DVec3::ZERO,
            DVec3::X * 3.0,
            DVec3::NAN,
            DVec3::Y * 4.0,
            DVec3::Z,
            DVec3::new(1.0, 1.0, -2.0),
        ];
        let cells = vec![[0, 1, 3, 4], [0, 1, 3, 5]];
        let scalars = TetScalars::Point(vec![1.0, 2.0, 9.0, f32::NAN, 4.0, 5.0]);
        let (mesh, _) = Tets::new(corners, cells, TetScalars::Cell(vec![2.0, 5.0])).unwrap();
        let points = Points::of_vertices(&mesh).unwrap();
        assert_eq!(points.centres().len(), 5, "a point that no cell uses");
        assert_eq!(points.centres()[2], DVec3::Y * 4.0);
        assert_eq!(points.scalars().unwrap(), [3.5, 3.5, 3.5, 2.0, 5.0]);
        let KernelSize::Radii(radii) = points.size() else { panic!("{:?}", points.size()) };
        assert_eq!(radii[..], [16.0_f64, 25.0, 25.0, 17.0, 14.0].map(|square| num::f32_of(square.sqrt())));

        let blank = mesh.clone().with_scalars(TetScalars::Cell(vec![f32::NAN, 5.0])).unwrap();
        let blank = Points::of_vertices(&blank).unwrap();
        let values = blank.scalars().unwrap();
        assert!(values[3].is_nan() && values[0] == 5.0, "{values:?}");

        let mesh = mesh.with_scalars(TetScalars::Point(vec![1.0, 2.0, 9.0, 3.0, 4.0, 5.0])).unwrap();
        assert_eq!(Points::of_vertices(&mesh).unwrap().scalars().unwrap(), [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!(mesh.with_scalars(scalars).is_err(), "both cells are blank");
    }

    #[test]
    fn kernels_reach_beyond_centres_where_they_show_anything() {
        let line = || Points::new((0..4).map(|i| DVec3::X * f64::from(i)).collect()).unwrap();
        let box_of = |low: [f64; 3], high: [f64; 3]| [DVec3::from_array(low), DVec3::from_array(high)];
        assert_eq!(line().reach(), line().bounds());
        let sized = |size: KernelSize| line().with_size(size).unwrap();
        assert_eq!(sized(KernelSize::Radius(0.5)).reach(), box_of([-0.5; 3], [3.5, 0.5, 0.5]));
        let radii = sized(KernelSize::Radii(vec![0.0, 0.5, 2.0, f32::NAN]));
        assert_eq!(radii.reach(), box_of([0.0, -2.0, -2.0], [4.0, 2.0, 2.0]));
        assert_eq!((0..4).map(|i| radii.shows(i)).collect::<Vec<_>>(), [false, true, true, false]);
        let dark = radii.clone().with_scalars(vec![1.0, 1.0, f32::NAN, 1.0]).unwrap();
        assert_eq!(dark.reach(), box_of([0.5, -0.5, -0.5], [1.5, 0.5, 0.5]));
        let nothing = dark.with_weights(vec![1.0, 0.0, 1.0, 1.0]).unwrap();
        assert_eq!(nothing.reach(), nothing.bounds());
        let one = [4.0, 0.0, 0.0, 1.0, 0.0, 0.25];
        let all = sized(KernelSize::Covariances(vec![one, [0.0; 6], [f32::NAN; 6], one]));
        assert_eq!(all.reach(), box_of([-6.0, -3.0, -1.5], [9.0, 3.0, 1.5]));
    }

    #[test]
    fn an_estimated_radius_is_three_spacings_or_what_coordinates_resolve() {
        let radius = |centres: Vec<DVec3>| match Points::new(centres).unwrap().with_estimated_radius().size()
        {
            KernelSize::Radius(radius) => *radius,
            other => panic!("{other:?}"),
        };
        let small = radius((0..7).map(|i| DVec3::Y * f64::from(i) * 1e-9).collect());
        assert!((small - 3e-9).abs() < 1e-20, "{small}");
        assert_eq!(radius(vec![DVec3::X; 4]), 1.0);
        assert_eq!(radius(vec![DVec3::NEG_X * 1e9; 4]), 1e3);
        assert_eq!(radius(vec![DVec3::ZERO]), 1.0);
    }
}
