//! The density of a transfer function, colour times extinction, and its means over intervals of the scalar.

use glam::{DVec3, DVec4};

use super::knots::{MAX_SCALAR, MAX_TAU};
use crate::interface::TableHead;
use crate::num::f32_of;
use crate::scene::TransferFunction;

/// Largest product of extinction and colour: the sum over 65536 bins still fits in float32.
const MAX_DENSITY: f64 = 1e33;

/// Width below which a domain counts as a jump: the number of bins per unit of scalar must fit in float32.
const MIN_RANGE: f64 = 1e-30;

/// A transfer function with the rounding and limits of the tables.
///
/// Scalars are rounded as on the device, so that a voxel's value and a knot that are equal stay equal. Limits
/// keep every table entry finite.
#[derive(Clone, Debug)]
pub(super) struct Density {
    /// Scalar; colour (not premultiplied) and extinction.
    knots: Vec<(f64, DVec4)>,
}

impl Density {
    pub(super) fn new(transfer: &TransferFunction) -> Self {
        let max_tau = MAX_TAU.min(MAX_DENSITY / transfer.max_colour().clamp(1.0, MAX_TAU));
        let knots = transfer.knots().iter().map(|k| {
            let s = f64::from(f32_of(k.s.clamp(-MAX_SCALAR, MAX_SCALAR)));
            (s, k.colour.min(DVec3::splat(MAX_TAU)).extend(k.tau.min(max_tau)))
        });
        Self { knots: knots.collect() }
    }

    /// Returns the first and the last scalar, or the last one twice if the domain is so narrow that it counts
    /// as a jump.
    pub(super) fn domain(&self) -> [f64; 2] {
        let [first, last] = [self.knots.first(), self.knots.last()].map(|k| k.map_or(0.0, |k| k.0));
        if last - first < MIN_RANGE { [last; 2] } else { [first, last] }
    }

    /// Returns the head of a table over the domain with bins of `width`, `per_unit` of them per unit of
    /// scalar.
    pub(super) fn head(&self, per_unit: f64, width: f64) -> TableHead {
        let [first, last] = self.domain();
        let ends = [self.knots.first(), self.knots.last()];
        let [before, after] = ends.map(|k| k.map_or([0.0; 4], |k| k.1.to_array().map(f32_of)));
        TableHead { range: [first, last, per_unit, width].map(f32_of), before, after, size: [0.0; 4] }
    }

    /// Returns the density of the last knot.
    pub(super) fn last(&self) -> DVec4 {
        self.knots.last().map_or(DVec4::ZERO, |k| density(k.1))
    }

    /// Returns the density at a scalar, continuous from the right. A knot counts as reached from `slack`
    /// below it.
    pub(super) fn at(&self, s: f64, slack: f64) -> DVec4 {
        let next = self.knots.partition_point(|k| k.0 <= s + slack);
        let Some(start) = next.checked_sub(1) else {
            return self.knots.first().map_or(DVec4::ZERO, |k| density(k.1));
        };
        self.on_piece(next, s.max(self.knots[start].0))
    }

    /// Returns the density at a scalar on the piece that ends at a knot.
    fn on_piece(&self, end: usize, s: f64) -> DVec4 {
        let a = self.knots[end - 1];
        let Some(b) = self.knots.get(end) else { return density(a.1) };
        density(a.1.lerp(b.1, (s - a.0) / (b.0 - a.0)))
    }

    /// Starts integrals over consecutive intervals at the first scalar.
    pub(super) fn walk(&self) -> Walk<'_> {
        Walk { density: self, from: self.domain()[0], next: 0 }
    }
}

fn density(value: DVec4) -> DVec4 {
    let tau = value.w;
    (value * tau).with_w(tau)
}

/// A position on the scalar axis that only moves up, so that all intervals together cost O(intervals +
/// knots).
#[derive(Debug)]
pub(super) struct Walk<'a> {
    density: &'a Density,
    from: f64,
    /// Index of the first knot above `from`, or of one at `from` that is still to be passed.
    next: usize,
}

impl Walk<'_> {
    /// Moves to `to`; returns the mean density from the previous position and the rise over the interval.
    ///
    /// The rise is that of the least-squares line. For a quadratic it is the rise from end to end.
    pub(super) fn to(&mut self, to: f64) -> (DVec4, DVec4) {
        let (from, width) = (self.from, to - self.from);
        let (mut mean, mut moment, mut left) = (DVec4::ZERO, DVec4::ZERO, from);
        loop {
            let knot = self.density.knots.get(self.next).map(|k| k.0).filter(|&s| s <= to);
            let right = knot.unwrap_or(to);
            if right > left {
                // Simpson's rule is exact: density is quadratic on a piece, its first moment cubic.
                for (s, weight) in [(left, 1.0), (0.5 * (left + right), 4.0), (right, 1.0)] {
                    let part =
                        self.density.on_piece(self.next, s) * (weight * (right - left) / (6.0 * width));
                    mean += part;
                    moment += part * ((s - from) / width - 0.5);
                }
            }
            if knot.is_none() {
                break;
            }
            left = right;
            self.next += 1;
        }
        self.from = to;
        (mean, 12.0 * moment)
    }
}
