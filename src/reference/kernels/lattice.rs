//! Kernels at the samples of a grid.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Grid, Kernel, Kernels, Model};

use super::super::index_space::{IndexRay, IndexSpace};
use super::hits::{self, Hit, Shape};
use super::values::{Medium, Sums, Values};

/// Half-width of the widest product kernel, in voxels.
const WIDEST: usize = 3;

#[derive(Clone, Debug)]
pub(super) struct Lattice {
    dims: [usize; 3],
    space: IndexSpace,
    kernels: Kernels,
    /// Contribution of each kernel, x fastest; all 0 for an invisible one.
    values: Vec<Sums>,
}

impl Lattice {
    pub(super) fn new(grid: &Grid, kernels: &Kernels, values: &Values) -> Result<Self> {
        let dims = grid.dims().map(num::index);
        let samples = || (0..grid.samples().len()).map(|i| sample(grid, i));
        let amplitude = match kernels.kernel {
            Kernel::Gaussian => kernels.peak_on_grid(),
            // The product kernels include their own peak.
            _ => 1.0,
        };
        let prefilters = kernels.kernel == Kernel::BSpline && kernels.model == Model::Interpolate;
        let value = |s: f64| values.of(s, amplitude).unwrap_or_default();
        let values: Vec<Sums> = if prefilters {
            if grid.nan_count() > 0 {
                let why = format!(
                    "bspline interpolates all samples: {} of the grid's are NaN (use gaussian or tent)",
                    grid.nan_count()
                );
                return Err(Error::invalid("kernel", why));
            }
            let mut coefficients: Vec<f64> = samples().map(|s| values.scalar(s)).collect();
            interpolating(&mut coefficients, dims);
            coefficients.into_iter().map(value).collect()
        } else {
            samples().map(value).collect()
        };
        Ok(Self { dims, space: IndexSpace::new(grid), kernels: *kernels, values })
    }

    pub(super) fn walk(&self, origin: DVec3, direction: DVec3, range: [f64; 2], medium: &mut impl Medium) {
        // Interpolation ends at the domain, density at the ends of the kernels.
        let beyond = if self.kernels.model == Model::Interpolate { 0.0 } else { self.kernels.reach() };
        let Some(ray) = self.space.ray(origin, direction, range, beyond) else { return };
        if self.kernels.kernel == Kernel::Gaussian {
            hits::sweep(&self.hits(ray), Shape::Gaussian, ray.range, medium);
        } else {
            self.products(ray, medium);
        }
    }

    fn value(&self, index: [usize; 3]) -> Sums {
        self.values[index[0] + self.dims[0] * (index[1] + self.dims[1] * index[2])]
    }

    /// Returns the Gaussians that a ray meets.
    fn hits(&self, ray: IndexRay) -> Vec<Hit> {
        let Kernels { sigma, cut, .. } = self.kernels;
        let reach = sigma * cut;
        let mut hits = Vec::new();
        // Visit slices across the steepest axis: a cylinder around the ray cuts an ellipse from each.
        let axis = ray.slope.abs().max_position();
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let steep = ray.slope[axis];
        let half = [u, v].map(|other| reach * (ray.slope[other] / steep).hypot(1.0));
        let ends = ray.range.map(|t| ray.start[axis] + ray.slope[axis] * t);
        let slices = self.between(axis, ends[0].min(ends[1]) - reach, ends[0].max(ends[1]) + reach);
        for k in slices {
            let t = (num::f64_of(k) - ray.start[axis]) / steep;
            let at = ray.start + ray.slope * t;
            for j in self.between(v, at[v] - half[1], at[v] + half[1]) {
                for i in self.between(u, at[u] - half[0], at[u] + half[0]) {
                    let mut index = [0; 3];
                    (index[axis], index[u], index[v]) = (k, i, j);
                    let value = self.value(index);
                    if value[0] == 0.0 {
                        continue;
                    }
                    let to = DVec3::from_array(index.map(num::f64_of)) - at;
                    let along = ray.slope.dot(to) / ray.slope.length_squared();
                    let nearest = (to - ray.slope * along).length_squared() / (sigma * sigma);
                    hits.extend(Hit::new(t + along, nearest, ray.slope.length() / sigma, cut, value));
                }
            }
        }
        hits
    }

    /// Returns the indices along an axis between two coordinates.
    fn between(&self, axis: usize, low: f64, high: f64) -> std::ops::Range<usize> {
        let last = self.dims[axis] - 1;
        if !(low <= num::f64_of(last) && high >= 0.0) {
            return 0..0;
        }
        num::usize_of(low.ceil().max(0.0))..num::usize_of(high.floor()).min(last) + 1
    }

    /// Integrates product kernels, cutting the ray at every plane of samples.
    fn products(&self, ray: IndexRay, medium: &mut impl Medium) {
        let range = ray.range;
        let mut cuts = range.to_vec();
        for axis in 0..3 {
            let (start, slope) = (ray.start[axis], ray.slope[axis]);
            if slope == 0.0 {
                continue;
            }
            let ends = range.map(|t| start + slope * t);
            let (mut plane, end) = (ends[0].min(ends[1]).ceil(), ends[0].max(ends[1]));
            while plane <= end {
                let t = (plane - start) / slope;
                if t > range[0] && t < range[1] {
                    cuts.push(t);
                }
                plane += 1.0;
            }
        }
        cuts.sort_unstable_by(f64::total_cmp);
        let reach = num::usize_of(self.kernels.reach());
        let mut block = Vec::with_capacity(8 * reach * reach * reach);
        for ends in cuts.windows(2) {
            let (from, to) = (ends[0], ends[1]);
            if to <= from {
                continue;
            }
            let cell = (ray.start + ray.slope * (0.5 * (from + to))).floor();
            self.gather(cell, reach, &mut block);
            // Negative lobes: the sums are not means of the samples, so the test does not apply.
            if self.kernels.kernel != Kernel::Sinc && medium.is_vacuum(block.iter().copied()) {
                continue;
            }
            let scale = match (self.kernels.kernel, self.kernels.model) {
                // Polynomials of degree 9 and 3, which the rule for this scale integrates exactly.
                (Kernel::BSpline | Kernel::Tent, Model::Density) => (to - from) / 1.5,
                (Kernel::Tent, Model::Interpolate) => to - from,
                _ => 0.5 / ray.slope.length(),
            };
            let sums = |t: f64| {
                let place = ray.start + ray.slope * t - cell;
                product(self.kernels.kernel, reach, &block, place)
            };
            medium.add(from, to, scale, &sums);
            if medium.is_opaque() {
                return;
            }
        }
    }

    /// Collects the values of the kernels that reach a cell, 0 for those outside the grid.
    fn gather(&self, cell: DVec3, reach: usize, block: &mut Vec<Sums>) {
        block.clear();
        let first = cell - (num::f64_of(reach) - 1.0);
        let inside = |axis: usize, offset: usize| {
            let at = first[axis] + num::f64_of(offset);
            (at >= 0.0 && at <= self.space.last[axis]).then(|| num::usize_of(at))
        };
        for z in 0..2 * reach {
            for y in 0..2 * reach {
                for x in 0..2 * reach {
                    let index = (inside(0, x), inside(1, y), inside(2, z));
                    let (Some(x), Some(y), Some(z)) = index else {
                        block.push([0.0; 4]);
                        continue;
                    };
                    block.push(self.value([x, y, z]));
                }
            }
        }
    }
}

/// Returns a sample; infinities and NaN are unchanged.
fn sample(grid: &Grid, i: usize) -> f64 {
    let rescale = grid.rescale();
    rescale.slope * grid.samples().get(i) + rescale.intercept
}

/// Returns the sums at a position in a cell from the kernels at 2 `reach` samples around it along each axis.
fn product(kernel: Kernel, reach: usize, block: &[Sums], place: DVec3) -> Sums {
    let [wx, wy, wz] = place.to_array().map(|f| weights(kernel, f));
    let n = 2 * reach;
    let mut sums = [0.0; 4];
    for (plane, wz) in block.chunks(n * n).zip(wz) {
        for (row, wy) in plane.chunks(n).zip(wy) {
            for (value, wx) in row.iter().zip(wx) {
                let w = wx * wy * wz;
                for (sum, value) in sums.iter_mut().zip(value) {
                    *sum += w * value;
                }
            }
        }
    }
    sums
}

/// Returns the weights of the samples around a position between two of them, from the lowest on. Weights
/// beyond the kernel's reach have no meaning.
fn weights(kernel: Kernel, f: f64) -> [f64; 2 * WIDEST] {
    let g = 1.0 - f;
    match kernel {
        Kernel::BSpline => {
            let near = |f: f64| 2.0 / 3.0 + f * f * (0.5 * f - 1.0);
            [g * g * g / 6.0, near(f), near(g), f * f * f / 6.0, 0.0, 0.0]
        }
        Kernel::Sinc => {
            let sinc = |x: f64| {
                let x = x * std::f64::consts::PI;
                if x.abs() < 1e-8 { 1.0 } else { x.sin() / x }
            };
            std::array::from_fn(|i| {
                let x = f + 2.0 - num::f64_of(i);
                sinc(x) * sinc(x / 3.0)
            })
        }
        _ => [g, f, 0.0, 0.0, 0.0, 0.0],
    }
}

/// Replaces samples by the coefficients of an interpolating sum of cubic B-splines, divided by the sum of the
/// splines.
///
/// Along each axis the rows are (1, 4, 1) / 6, and (4, 1) / 5 at the ends, where a neighbour is missing. The
/// system is diagonally dominant and solved by elimination without pivoting.
fn interpolating(values: &mut [f64], dims: [usize; 3]) {
    let strides = [1, dims[0], dims[0] * dims[1]];
    for axis in 0..3 {
        let (n, stride) = (dims[axis], strides[axis]);
        let mut ratio = vec![0.0; n];
        for first in 0..values.len() {
            if (first / stride) % n != 0 {
                continue;
            }
            let at = |i: usize| first + i * stride;
            // Multiply each row by its divisor, so that the off-diagonal entries are 1.
            let mut before = 0.0;
            for i in 0..n {
                let whole = if i == 0 || i == n - 1 { 5.0 } else { 6.0 };
                let pivot = if i == 0 { 4.0 } else { 4.0 - ratio[i - 1] };
                ratio[i] = 1.0 / pivot;
                before = (whole * values[at(i)] - before) / pivot;
                values[at(i)] = before;
            }
            for i in (0..n - 1).rev() {
                values[at(i)] -= ratio[i] * values[at(i + 1)];
            }
        }
    }
}
