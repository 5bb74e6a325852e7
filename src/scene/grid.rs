//! Regular grids: samples on a lattice and the lattice's placement in the world.

use std::borrow::Cow;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::samples::{MIN_SIDE, Samples, sample_count};
use crate::error::{Error, Result};
use crate::num;

/// The linear map from stored numbers to the data's own units: `value = slope * stored + intercept`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rescale {
    /// Units of the data per stored unit.
    pub slope: f64,
    /// Value of a stored zero.
    pub intercept: f64,
}

impl Rescale {
    /// Returns the range of values whose stored numbers have this range.
    pub(crate) fn of_range(self, stored: [f64; 2]) -> [f64; 2] {
        let [a, b] = stored.map(|stored| self.slope * stored + self.intercept);
        [a.min(b), a.max(b)]
    }

    /// The identity: stored numbers are the values.
    pub const IDENTITY: Self = Self { slope: 1.0, intercept: 0.0 };
}

/// The anatomical meaning of the world's axes. Only the automatic camera uses it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Anatomy {
    /// The file gives no meaning.
    #[default]
    Unknown,
    /// +x right, +y anterior, +z superior (NIfTI, NRRD `right-anterior-superior`).
    Ras,
    /// +x left, +y posterior, +z superior (DICOM, NRRD `left-posterior-superior`).
    Lps,
    /// +x left, +y anterior, +z superior (NRRD `left-anterior-superior`).
    Las,
}

/// A scalar field sampled on a regular lattice, trilinear between the samples, vacuum outside.
///
/// It holds the samples, not a texture, and is valid by construction.
///
/// # Shape
///
/// `values[z][y][x]`, x fastest. The sample of index `i` is at `origin + direction * (spacing * i)`. The
/// domain is the box that the samples span, without a border of half a voxel.
///
/// # Units
///
/// `spacing` and `origin` are in world units, values in the data's own units after [`Rescale`].
#[derive(Clone, Debug)]
pub struct Grid {
    dims: [u32; 3],
    spacing: DVec3,
    origin: DVec3,
    direction: DMat3,
    rescale: Rescale,
    /// Shared, so that a grid is cheap to clone.
    samples: Arc<Samples>,
    anatomy: Anatomy,
    range: [f64; 2],
    nan_count: usize,
    infinite_count: usize,
}

impl Grid {
    /// The smallest number of samples along an axis.
    pub const MIN_SIDE: u32 = MIN_SIDE;

    /// Makes a grid of unit spacing along the world's axes, at the origin.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if an extent is below 2, if their product is not the number of samples, or if no
    /// sample is finite.
    pub fn new(dims: [u32; 3], samples: Samples) -> Result<Self> {
        let expected = sample_count(dims)?
            .ok_or_else(|| Error::invalid("grid extent", format!("{dims:?} overflows the address space")))?;
        if expected != samples.len() {
            let why = format!("extent {dims:?} needs {expected} samples, {} were given", samples.len());
            return Err(Error::invalid("grid samples", why));
        }
        let (range, nan_count, infinite_count) = samples.statistics();
        if range[0] > range[1] {
            return Err(Error::invalid("grid samples", "no sample is a finite number"));
        }
        Ok(Self {
            dims,
            spacing: DVec3::ONE,
            origin: DVec3::ZERO,
            direction: DMat3::IDENTITY,
            rescale: Rescale::IDENTITY,
            samples: Arc::new(samples),
            anatomy: Anatomy::Unknown,
            range,
            nan_count,
            infinite_count,
        })
    }

    /// Places the lattice in the world.
    ///
    /// The columns of `direction` are the index axes. They need neither unit length nor right angles, and may
    /// mirror.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a spacing is not positive and finite, another number is not finite, or the axes
    /// do not span space.
    pub fn with_placement(self, spacing: DVec3, origin: DVec3, direction: DMat3) -> Result<Self> {
        if !(spacing.is_finite() && spacing.min_element() > 0.0) {
            let why = format!("{spacing}: every spacing must be positive and finite");
            return Err(Error::invalid("grid spacing", why));
        }
        if !origin.is_finite() {
            return Err(Error::invalid("grid origin", format!("{origin}: must be finite")));
        }
        // Divided by the axes' lengths, the determinant measures, like a sine, how far the axes are from
        // lying in one plane.
        let volume = direction.determinant().abs();
        let lengths = lengths(direction);
        if !(direction.is_finite() && volume > 1e-9 * lengths.x * lengths.y * lengths.z) {
            let why = format!("{direction}: the three axes must be finite and span space");
            return Err(Error::invalid("grid direction", why));
        }
        Ok(Self { spacing, origin, direction, ..self })
    }

    /// Returns the same lattice with other samples of any type and the same rescale.
    ///
    /// # Errors
    ///
    /// As [`Grid::new`].
    pub fn with_samples(&self, samples: Samples) -> Result<Self> {
        let other = Self::new(self.dims, samples)?;
        let (spacing, origin, direction) = (self.spacing, self.origin, self.direction);
        Ok(Self { spacing, origin, direction, rescale: self.rescale, anatomy: self.anatomy, ..other })
    }

    /// Sets the map from stored numbers to values.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a number is not finite or the slope is zero.
    pub fn with_rescale(self, rescale: Rescale) -> Result<Self> {
        let Rescale { slope, intercept } = rescale;
        if !(slope.is_finite() && slope != 0.0 && intercept.is_finite()) {
            let rule = "both must be finite and the slope not zero";
            let why = format!("slope {slope} and intercept {intercept}: {rule}");
            return Err(Error::invalid("grid rescale", why));
        }
        Ok(Self { rescale, ..self })
    }

    /// Sets the anatomical meaning of the world's axes.
    #[must_use]
    pub fn with_anatomy(self, anatomy: Anatomy) -> Self {
        Self { anatomy, ..self }
    }

    /// Returns the number of samples along x, y and z.
    #[must_use]
    pub fn dims(&self) -> [u32; 3] {
        self.dims
    }

    /// Returns the samples as stored.
    #[must_use]
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Returns the map from stored numbers to values.
    #[must_use]
    pub fn rescale(&self) -> Rescale {
        self.rescale
    }

    /// Returns the anatomical meaning of the world's axes.
    #[must_use]
    pub fn anatomy(&self) -> Anatomy {
        self.anatomy
    }

    /// Returns the distance between neighbouring samples along each index axis, in world units.
    ///
    /// It includes the lengths of the direction's columns.
    #[must_use]
    pub fn spacing(&self) -> DVec3 {
        lengths(self.index_to_world())
    }

    /// Returns the world position of the sample of index 0, 0, 0.
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Returns the linear part of the map from index to world: one column per index axis.
    #[must_use]
    pub fn index_to_world(&self) -> DMat3 {
        DMat3::from_cols(
            self.direction.x_axis * self.spacing.x,
            self.direction.y_axis * self.spacing.y,
            self.direction.z_axis * self.spacing.z,
        )
    }

    /// Returns the world position of a (fractional) index.
    #[must_use]
    pub fn world_of_index(&self, index: DVec3) -> DVec3 {
        self.origin + self.index_to_world() * index
    }

    /// Returns the index of the last sample along each axis: the far corner of the domain.
    #[must_use]
    pub fn last_index(&self) -> DVec3 {
        DVec3::new(f64::from(self.dims[0] - 1), f64::from(self.dims[1] - 1), f64::from(self.dims[2] - 1))
    }

    /// Returns the world position of the domain's centre.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        self.world_of_index(self.last_index() * 0.5)
    }

    /// Returns the world positions of the domain's eight corners; bit 0 of the place selects x, bit 1 y, bit
    /// 2 z.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        box_corners([DVec3::ZERO, self.last_index()]).map(|corner| self.world_of_index(corner))
    }

    /// Returns the smallest and the largest finite value after the rescale, in ascending order.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        self.rescale.of_range(self.range)
    }

    /// Returns the number of NaN samples. Every cell that touches one is vacuum.
    #[must_use]
    pub fn nan_count(&self) -> usize {
        self.nan_count
    }

    /// Returns the number of infinite samples. They count as the ends of the transfer function's domain.
    #[must_use]
    pub fn infinite_count(&self) -> usize {
        self.infinite_count
    }

    /// Returns the samples of a cube from a corner on; beyond the domain the nearest sample stands there.
    ///
    /// # Errors
    ///
    /// Errors of the source of samples on demand.
    pub(crate) fn cube(&self, corner: [i64; 3], side: u32) -> Result<Samples> {
        fn cube<T: Copy>(values: &[T], dims: [usize; 3], corner: [i64; 3], side: i64) -> Vec<T> {
            let place = |axis: usize, at: i64| {
                let last = i64::try_from(dims[axis]).unwrap_or(i64::MAX) - 1;
                usize::try_from((corner[axis] + at).clamp(0, last)).unwrap_or(0)
            };
            let [first, last] = [place(0, 0), place(0, side - 1)];
            // Samples that stand before the first, and beyond the last.
            let before = usize::try_from((-corner[0]).clamp(0, side - 1)).unwrap_or(0);
            let mut all = Vec::with_capacity(usize::try_from(side.pow(3)).unwrap_or(0));
            for (z, y) in (0..side).flat_map(|z| (0..side).map(move |y| (z, y))) {
                let row = (place(2, z) * dims[1] + place(1, y)) * dims[0];
                let end = all.len() + usize::try_from(side).unwrap_or(0);
                all.resize(all.len() + before, values[row + first]);
                all.extend_from_slice(&values[row + first..=row + last]);
                all.resize(end, values[row + last]);
            }
            all
        }
        let (mut dims, mut corner, side) = (self.dims, corner, i64::from(side));
        let part;
        let samples = match &*self.samples {
            Samples::OnDemand(samples) => {
                let place =
                    |axis: usize, at: i64| u32::try_from(at.clamp(0, i64::from(dims[axis]))).unwrap_or(0);
                let first = [0, 1, 2].map(|a| place(a, corner[a]).min(dims[a] - 1));
                let extent = [0, 1, 2].map(|a| (place(a, corner[a] + side) - first[a]).max(1));
                corner = [0, 1, 2].map(|a| corner[a] - i64::from(first[a]));
                dims = extent;
                part = samples.read(first, extent)?;
                &part
            }
            samples => samples,
        };
        let dims = dims.map(num::index);
        Ok(match samples {
            Samples::U8(v) => Samples::U8(cube(v, dims, corner, side)),
            Samples::U16(v) => Samples::U16(cube(v, dims, corner, side)),
            Samples::I16(v) => Samples::I16(cube(v, dims, corner, side)),
            Samples::F32(v) => Samples::F32(cube(v, dims, corner, side)),
            Samples::OnDemand(_) => return Err(Error::invalid("samples of a source", "must be in memory")),
        })
    }

    /// Returns whether samples are read from their source when they are needed.
    #[must_use]
    pub fn is_on_demand(&self) -> bool {
        matches!(*self.samples, Samples::OnDemand(_))
    }

    /// Returns the grid; in place of one whose samples are read on demand, a coarser one in memory.
    #[must_use]
    pub fn overview(&self) -> Cow<'_, Self> {
        let Samples::OnDemand(samples) = &*self.samples else { return Cow::Borrowed(self) };
        let overview = samples.overview();
        let coarse = Self {
            dims: overview.dims,
            spacing: self.spacing * DVec3::from_array(overview.step),
            origin: self.origin + self.direction * (self.spacing * DVec3::from_array(overview.first)),
            samples: Arc::new(overview.samples.clone()),
            ..self.clone()
        };
        Cow::Owned(coarse)
    }

    /// Returns the error by which a sample on demand could not be read since the last call.
    pub(crate) fn failure(&self) -> Result<()> {
        match &*self.samples {
            Samples::OnDemand(samples) => samples.failure(),
            _ => Ok(()),
        }
    }

    /// Returns the value of one sample after the rescale.
    ///
    /// # Panics
    ///
    /// When an index is not below its extent.
    #[must_use]
    pub fn value(&self, x: u32, y: u32, z: u32) -> f64 {
        assert!(
            x < self.dims[0] && y < self.dims[1] && z < self.dims[2],
            "sample [{x}, {y}, {z}] lies outside {:?}",
            self.dims
        );
        let [nx, ny, _] = self.dims.map(num::index);
        let index = (num::index(z) * ny + num::index(y)) * nx + num::index(x);
        self.rescale.slope * self.samples.get(index) + self.rescale.intercept
    }
}

/// Returns the lengths of the columns.
fn lengths(m: DMat3) -> DVec3 {
    DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
}

/// Returns the corners of a box; bit 0 of the place selects the high x, bit 1 the high y, bit 2 the high z.
pub(crate) fn box_corners([low, high]: [DVec3; 2]) -> [DVec3; 8] {
    std::array::from_fn(|i| DVec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), high, low))
}

/// Returns the length of the domain's longest diagonal, world units.
pub(crate) fn diagonal(grid: &Grid) -> f64 {
    grid.corners().iter().map(|corner| 2.0 * (*corner - grid.centre()).length()).fold(0.0, f64::max)
}

/// Permutes axes cyclically so that `axis`, along which a stack runs, comes last.
pub(crate) fn turned<T: Copy>(xyz: [T; 3], axis: usize) -> [T; 3] {
    [xyz[(axis + 1) % 3], xyz[(axis + 2) % 3], xyz[axis % 3]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Grid {
        Grid::new([2, 3, 4], Samples::U8((0..24).collect())).unwrap()
    }

    #[test]
    fn refuses_what_is_not_a_grid() {
        let message = |result: Result<Grid>| result.unwrap_err().to_string();
        assert!(message(Grid::new([1, 2, 2], Samples::U8(vec![0; 4]))).contains("at least 2"));
        assert!(message(Grid::new([2, 2, 2], Samples::U8(vec![0; 7]))).contains("needs 8 samples, 7"));
        assert!(message(Grid::new([u32::MAX; 3], Samples::U8(vec![]))).contains("overflows"));
        assert!(message(Grid::new([2, 2, 2], Samples::F32(vec![f32::NAN; 8]))).contains("finite"));
        let place = |spacing, origin, direction| message(ramp().with_placement(spacing, origin, direction));
        assert!(place(DVec3::new(1.0, 0.0, 1.0), DVec3::ZERO, DMat3::IDENTITY).contains("positive"));
        assert!(place(DVec3::ONE, DVec3::NAN, DMat3::IDENTITY).contains("finite"));
        let flat = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::X + DVec3::Y);
        assert!(place(DVec3::ONE, DVec3::ZERO, flat).contains("span space"));
        assert!(message(ramp().with_rescale(Rescale { slope: 0.0, intercept: 0.0 })).contains("slope"));
    }

    #[test]
    fn x_is_fastest_and_the_domain_ends_at_the_samples() {
        let grid = ramp()
            .with_placement(DVec3::new(1.0, 2.0, 3.0), DVec3::new(10.0, 0.0, 0.0), DMat3::IDENTITY)
            .unwrap();
        assert_eq!(grid.value(1, 0, 0), 1.0);
        assert_eq!(grid.value(0, 1, 0), 2.0);
        assert_eq!(grid.value(0, 0, 1), 6.0);
        assert_eq!(grid.corners()[7], DVec3::new(11.0, 4.0, 9.0));
        assert_eq!(grid.range(), [0.0, 23.0]);
    }

    #[test]
    fn a_negative_slope_keeps_the_range_ascending() {
        let grid = ramp().with_rescale(Rescale { slope: -2.0, intercept: 1.0 }).unwrap();
        assert_eq!(grid.range(), [-45.0, 1.0]);
        assert_eq!(grid.value(1, 0, 0), -1.0);
    }
}
