//! Kernels at scattered centres, with a tree of boxes to find those on a ray.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::scene::{Kernel, KernelSize, Kernels, Points};

use super::super::tree::{Node, tree};
use super::hits::{self, Hit, Shape};
use super::values::{Medium, Sums, Values};

/// A kernel.
#[derive(Clone, Debug)]
struct Blob {
    centre: DVec3,
    /// Maps world vectors to the kernel's own unit of distance: standard deviations, or halves of the radius.
    measure: DMat3,
    /// Half of the sides of its box.
    reach: DVec3,
    value: Sums,
}

/// Largest number of blobs in a leaf.
const LEAF: usize = 4;

#[derive(Clone, Debug)]
pub(super) struct Scattered {
    blobs: Vec<Blob>,
    nodes: Vec<Node>,
    shape: Shape,
    support: f64,
    centre: DVec3,
}

impl Scattered {
    pub(super) fn new(points: &Points, kernels: &Kernels, values: &Values) -> Result<Self> {
        let (shape, support) = match kernels.kernel {
            Kernel::Gaussian => (Shape::Gaussian, kernels.cut),
            Kernel::BSpline => (Shape::BSpline, 2.0),
            _ => return Err(Error::invalid("kernel", format!("{}: requires a grid", kernels.kernel.name()))),
        };
        // Units of distance per radius.
        let units = if shape == Shape::Gaussian { 3.0 } else { 2.0 };
        let round = |radius: f64| {
            (radius > 0.0).then(|| {
                // Squares must neither overflow nor underflow.
                let radius = radius.clamp(1e-100, 1e100);
                (DMat3::from_diagonal(DVec3::splat(units / radius)), DVec3::splat(support * radius / units))
            })
        };
        if *points.size() == KernelSize::Unknown {
            return Err(Error::invalid("points", "have no size: they need a radius"));
        }
        if matches!(points.size(), KernelSize::Covariances(_)) && shape == Shape::BSpline {
            return Err(Error::invalid("points", "have covariances: these require the kernel gaussian"));
        }
        let blob = |i: usize| {
            let (measure, reach) = match points.size() {
                KernelSize::Unknown => None,
                KernelSize::Radius(radius) => round(*radius),
                KernelSize::Radii(radii) => round(f64::from(radii[i])),
                KernelSize::Covariances(all) => ellipsoid(all[i].map(f64::from), support),
            }?;
            let scalar = points.scalars().map_or(1.0, |s| f64::from(s[i]));
            let weight = points.weights().map_or(1.0, |w| f64::from(w[i]));
            let value = values.of(scalar, weight)?;
            Some(Blob { centre: points.centres()[i], measure, reach, value })
        };
        let mut blobs: Vec<Blob> = (0..points.centres().len()).filter_map(blob).collect();
        let bounds = |blob: &Blob| [blob.centre - blob.reach, blob.centre + blob.reach];
        let nodes = tree(&mut blobs, LEAF, bounds, |blob| blob.centre);
        let [low, high] = points.bounds();
        Ok(Self { blobs, nodes, shape, support, centre: 0.5 * low + 0.5 * high })
    }

    pub(super) fn walk(&self, origin: DVec3, direction: DVec3, range: [f64; 2], medium: &mut impl Medium) {
        // Measure from the point of the ray nearest to the common centre.
        let nearest = (self.centre - origin).dot(direction);
        let start = origin + direction * nearest;
        let range = range.map(|t| t - nearest);
        let mut hits = Vec::new();
        let mut open = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(node) = open.pop() {
            let node = &self.nodes[node];
            if !meets(node, start, direction, range) {
                continue;
            }
            if node.count == 0 {
                open.extend([node.first, node.first + 1]);
            }
            for blob in &self.blobs[node.first..][..node.count] {
                hits.extend(self.hit(blob, start, direction));
            }
        }
        hits::sweep(&hits, self.shape, range, medium);
    }

    fn hit(&self, blob: &Blob, start: DVec3, direction: DVec3) -> Option<Hit> {
        let (way, to) = (blob.measure * direction, blob.measure * (blob.centre - start));
        let middle = way.dot(to) / way.length_squared();
        // Use the residual instead of a difference of squares: it keeps its digits far from the centre.
        let rest = to - way * middle;
        Hit::new(middle, rest.length_squared(), way.length(), self.support, blob.value)
    }
}

/// Returns the measure of a covariance (xx, xy, xz, yy, yz, zz) and half of the sides of its box at a
/// distance.
///
/// The measure is the inverse of the covariance's Cholesky factor. Returns `None` if the covariance is not
/// positive definite beyond rounding.
fn ellipsoid([xx, xy, xz, yy, yz, zz]: [f64; 6], support: f64) -> Option<(DMat3, DVec3)> {
    let pivot = |rest: f64, variance: f64| {
        (rest > 16.0 * f64::EPSILON * variance && rest.is_finite()).then(|| rest.sqrt())
    };
    let a = pivot(xx, xx)?;
    let (b, c) = (xy / a, xz / a);
    let d = pivot(yy - b * b, yy)?;
    let e = (yz - b * c) / d;
    let f = pivot(zz - c * c - e * e, zz)?;
    let lower = DMat3::from_cols(DVec3::new(a, b, c), DVec3::new(0.0, d, e), DVec3::new(0.0, 0.0, f));
    let measure = lower.inverse();
    measure.is_finite().then(|| (measure, DVec3::new(xx.sqrt(), yy.sqrt(), zz.sqrt()) * support))
}

/// Returns whether a ray may meet a box.
fn meets(node: &Node, start: DVec3, direction: DVec3, [mut from, mut to]: [f64; 2]) -> bool {
    for axis in 0..3 {
        let (low, high) = (node.low[axis] - start[axis], node.high[axis] - start[axis]);
        if direction[axis] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return false;
            }
        } else {
            let (a, b) = (low / direction[axis], high / direction[axis]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
    }
    // Tolerance for the rounding of the parameters.
    from <= to + 1e-12 * (from.abs() + to.abs())
}
