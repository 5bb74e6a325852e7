//! The cells of a regular grid: their corners, the interpolant between these, and blocks of cells with the
//! range of their samples.

use std::sync::OnceLock;

use glam::DVec3;

use crate::num;
use crate::scene::{Grid, Samples};

use super::march::finite;
use super::polynomial::Cubic;

/// Samples are clamped to this magnitude, so that their differences and products do not overflow. Only a
/// rescale can exceed it; no stored type does.
const MAX_SAMPLE: f64 = 1e100;

/// Cells along each side of a block.
pub(super) const BLOCK: u32 = 8;

/// The cells of a grid.
#[derive(Debug)]
pub(super) struct Cells<'a> {
    grid: &'a Grid,
    /// Scalars that stand for -Inf and +Inf.
    ends: [f64; 2],
    /// Position of the last sample.
    last: DVec3,
    /// Number of blocks along each axis.
    counts: [usize; 3],
    /// Least and greatest sample of each block, x fastest, found when a ray first comes to it.
    ranges: Vec<OnceLock<[f64; 2]>>,
}

impl<'a> Cells<'a> {
    pub(super) fn new(grid: &'a Grid, ends: [f64; 2]) -> Self {
        let counts = grid.dims().map(|extent| num::index((extent - 1).div_ceil(BLOCK)));
        // Ranges would need all samples.
        let counts = if grid.is_on_demand() { [0; 3] } else { counts };
        let ranges = std::iter::repeat_with(OnceLock::new).take(counts.into_iter().product()).collect();
        Self { grid, ends, last: grid.last_index(), counts, ranges }
    }

    /// Returns the number of samples along each axis.
    pub(super) fn dims(&self) -> [u32; 3] {
        self.grid.dims()
    }

    /// Returns the samples at the corners of a cell. Bits number them: 1 is x, 2 is y, 4 is z.
    pub(super) fn corners(&self, cell: [u32; 3]) -> [f64; 8] {
        fn gather<T: Copy>(samples: &[T], first: usize, [row, plane]: [usize; 2]) -> [T; 8] {
            let pair = |first: usize| [samples[first], samples[first + 1]];
            let ([a, b], [c, d]) = (pair(first), pair(first + row));
            let ([e, f], [g, h]) = (pair(first + plane), pair(first + plane + row));
            [a, b, c, d, e, f, g, h]
        }
        let (first, strides) = (self.index(cell), self.strides());
        match self.grid.samples() {
            Samples::U8(samples) => self.scalars_of(gather(samples, first, strides)),
            Samples::U16(samples) => self.scalars_of(gather(samples, first, strides)),
            Samples::I16(samples) => self.scalars_of(gather(samples, first, strides)),
            Samples::F32(samples) => self.scalars_of(gather(samples, first, strides)),
            Samples::OnDemand(samples) => {
                let [row, plane] = strides;
                let beyond = |i: usize| (i & 1) + (i >> 1 & 1) * row + (i >> 2) * plane;
                self.scalars_of(std::array::from_fn(|i| samples.get(first + beyond(i))))
            }
        }
    }

    /// Returns the least and the greatest sample of the block that holds a cell, NaN apart. A block of NaN has
    /// an empty range.
    pub(super) fn range(&self, cell: [u32; 3]) -> [f64; 2] {
        if self.ranges.is_empty() {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        let [x, y, z] = cell.map(|place| num::index(place / BLOCK));
        *self.ranges[(z * self.counts[1] + y) * self.counts[0] + x].get_or_init(|| {
            let low = cell.map(|place| place - place % BLOCK);
            let high = [0, 1, 2].map(|axis| (low[axis] + BLOCK + 1).min(self.dims()[axis]));
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for z in low[2]..high[2] {
                for y in low[1]..high[1] {
                    let row = self.index([low[0], y, z])..self.index([high[0], y, z]);
                    match self.grid.samples() {
                        Samples::U8(samples) => self.extend(&mut range, &samples[row]),
                        Samples::U16(samples) => self.extend(&mut range, &samples[row]),
                        Samples::I16(samples) => self.extend(&mut range, &samples[row]),
                        Samples::F32(samples) => self.extend(&mut range, &samples[row]),
                        Samples::OnDemand(samples) => {
                            row.for_each(|i| self.extend(&mut range, &[samples.get(i)]))
                        }
                    }
                }
            }
            range
        })
    }

    /// Lets every block seem to hold all scalars.
    #[cfg(test)]
    pub(super) fn skip_nothing(&self) {
        for range in &self.ranges {
            range.set([f64::NEG_INFINITY, f64::INFINITY]).unwrap();
        }
    }

    /// Returns the cell that holds a position, and the position in it; beyond the grid those of the nearest place.
    pub(super) fn place(&self, position: DVec3) -> (DVec3, DVec3) {
        let place = self.clamp(position);
        let cell = place.floor().min(self.last - 1.0).max(DVec3::ZERO);
        (cell, place - cell)
    }

    /// Returns the nearest position in the grid.
    pub(super) fn clamp(&self, position: DVec3) -> DVec3 {
        position.clamp(DVec3::ZERO, self.last)
    }

    /// Returns the interpolant of the cell with this lowest corner.
    pub(super) fn interpolant(&self, cell: DVec3) -> Trilinear {
        Trilinear::new(&self.corners(cell.to_array().map(num::u32_of)))
    }

    fn strides(&self) -> [usize; 2] {
        let [nx, ny, _] = self.dims().map(num::index);
        [nx, nx * ny]
    }

    fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        let [row, plane] = self.strides();
        num::index(z) * plane + num::index(y) * row + num::index(x)
    }

    /// Extends a range by stored numbers, NaN apart.
    fn extend<T: Into<f64> + Copy>(&self, [low, high]: &mut [f64; 2], stored: &[T]) {
        for stored in stored {
            let [scalar] = self.scalars_of([*stored]);
            (*low, *high) =
                (if scalar < *low { scalar } else { *low }, if scalar > *high { scalar } else { *high });
        }
    }

    /// Returns the scalars of stored numbers. NaN stays and means vacuum; infinities become the ends of the
    /// transfer function.
    fn scalars_of<T: Into<f64> + Copy, const N: usize>(&self, stored: [T; N]) -> [f64; N] {
        let rescale = self.grid.rescale();
        let mut scalars = [0.0; N];
        for (scalar, stored) in scalars.iter_mut().zip(stored) {
            *scalar = rescale.slope * stored.into() + rescale.intercept;
        }
        if !scalars.iter().all(|scalar| scalar.abs() <= MAX_SAMPLE) {
            for scalar in &mut scalars {
                let infinite = scalar.is_infinite();
                *scalar =
                    if infinite { finite(*scalar, self.ends) } else { scalar.clamp(-MAX_SAMPLE, MAX_SAMPLE) };
            }
        }
        scalars
    }
}

/// The trilinear interpolant of a cell's corners: the first corner, and differences along one, two and three
/// axes.
///
/// Where corners are equal, their differences are exactly zero.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trilinear {
    first: f64,
    x: f64,
    y: f64,
    z: f64,
    xy: f64,
    xz: f64,
    yz: f64,
    xyz: f64,
}

impl Trilinear {
    /// Takes the corners; bits number them: 1 is x, 2 is y, 4 is z.
    pub(super) fn new(v: &[f64; 8]) -> Self {
        let (x, y, z) = (v[1] - v[0], v[2] - v[0], v[4] - v[0]);
        let xy = (v[3] - v[2]) - x;
        let xz = (v[5] - v[4]) - x;
        let yz = (v[6] - v[4]) - y;
        let xyz = ((v[7] - v[6]) - (v[5] - v[4])) - xy;
        Self { first: v[0], x, y, z, xy, xz, yz, xyz }
    }

    /// Returns the value at a position in the cell.
    pub(super) fn at(&self, at: DVec3) -> f64 {
        let Self { first, x, y, z, xy, xz, yz, xyz } = *self;
        first + at.x * x + at.y * (y + at.x * xy) + at.z * (z + at.x * xz + at.y * (yz + at.x * xyz))
    }

    /// Returns the values along a line, as a cubic of its parameter.
    pub(super) fn along(&self, at: DVec3, d: DVec3) -> Cubic {
        let Self { x, y, z, xy, xz, yz, xyz, .. } = *self;
        [
            self.at(at),
            d.x * (x + at.y * xy + at.z * (xz + at.y * xyz))
                + d.y * (y + at.x * xy + at.z * (yz + at.x * xyz))
                + d.z * (z + at.x * xz + at.y * (yz + at.x * xyz)),
            d.x * d.y * (xy + at.z * xyz) + d.x * d.z * (xz + at.y * xyz) + d.y * d.z * (yz + at.x * xyz),
            d.x * d.y * d.z * xyz,
        ]
    }
}
