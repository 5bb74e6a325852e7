//! Scattered points.

use std::sync::Arc;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::num;

use super::{TetScalars, Tets};

/// How far the kernels of points reach.
#[derive(Clone, Debug, PartialEq)]
pub enum KernelSize {
    /// Nobody said.
    Unknown,
    /// The same support radius for all, in world units.
    Radius(f64),
    /// A support radius for each point, in world units.
    Radii(Vec<f32>),
    /// A covariance for each point, in world units squared: xx, xy, xz, yy, yz, zz.
    Covariances(Vec<[f32; 6]>),
}

/// Kernels at scattered centres, each with a scalar and a weight.
///
/// Valid by construction: centres are finite, and each list has one entry for each point. A point whose
/// scalar, weight or size is NaN shows nothing.
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
    /// Points at some centres, in world units, with the scalar and the weight 1, of unknown size.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if there is none, or a centre is not finite.
    pub fn new(centres: Vec<DVec3>) -> Result<Self> {
        if centres.is_empty() {
            return Err(Error::invalid("points", "there is none"));
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

    /// The points of a mesh that tetrahedra use, in the mesh's order, each with its scalar and with the longest edge
    /// that ends there as its radius, in world units: a point's kernel reaches all its neighbours.
    ///
    /// Where each tetrahedron has a scalar, a point takes the mean of those around it that are not NaN; it is NaN where
    /// all are, or where +Inf meets -Inf.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if no scalar is finite, or an edge is longer than float32 can tell.
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
    /// [`Error::Invalid`] if their number does not fit, or none is finite.
    pub fn with_scalars(mut self, scalars: Vec<f32>) -> Result<Self> {
        self.fits("scalars", scalars.len())?;
        let finite = || scalars.iter().copied().filter(|s| s.is_finite()).map(f64::from);
        let range = [finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max)];
        if range[0] > range[1] {
            return Err(Error::invalid("scalars of points", "none is finite"));
        }
        self.range = range;
        self.scalars = Some(Arc::new(scalars));
        Ok(self)
    }

    /// Sets the weights.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if their number does not fit.
    pub fn with_weights(mut self, weights: Vec<f32>) -> Result<Self> {
        self.fits("weights", weights.len())?;
        self.weights = Some(Arc::new(weights));
        Ok(self)
    }

    /// Sets how far kernels reach.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a list does not fit, or a size is negative or infinite: a radius, or a
    /// variance.
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
                let variances = |c: &[f32; 6]| [c[0], c[3], c[5]].map(f64::from);
                all.iter()
                    .enumerate()
                    .find_map(|(i, c)| variances(c).into_iter().find(|&v| !valid(v)).map(|v| (i, v)))
            }
        };
        if let Some((i, size)) = wrong {
            return Err(Error::invalid(
                "sizes of points",
                format!(
                    "point {i} has {size}: radii and variances must be finite and not negative, one for all positive"
                ),
            ));
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

    /// The centres, in world units.
    #[must_use]
    pub fn centres(&self) -> &[DVec3] {
        &self.centres
    }

    /// The scalars; without, each is 1.
    #[must_use]
    pub fn scalars(&self) -> Option<&[f32]> {
        self.scalars.as_ref().map(|scalars| scalars.as_slice())
    }

    /// The weights; without, each is 1.
    #[must_use]
    pub fn weights(&self) -> Option<&[f32]> {
        self.weights.as_ref().map(|weights| weights.as_slice())
    }

    /// How far kernels reach.
    #[must_use]
    pub fn size(&self) -> &KernelSize {
        &self.size
    }

    /// Least and greatest coordinates of the centres.
    #[must_use]
    pub fn bounds(&self) -> [DVec3; 2] {
        self.bounds
    }

    /// Smallest and largest finite scalar.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        self.range
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
}
