//! Rays through sums of kernels.
//!
//! A ray is cut where it enters or leaves a kernel, and where a kernel's formula changes. Between two cuts the sums
//! of kernels are smooth, and are integrated by panels that are short against every kernel there: the density model
//! by Gauss-Legendre, with the optical depth inside a panel from the same nodes; the interpolation model by cubics
//! that follow the scalar, which are then cut at the transfer function's knots.
//!
//! A kernel shows nothing whose scalar, weight or size is NaN, whose weight or radius is 0, or whose covariance is
//! not positive definite; nor, with the density model, one of negative weight.

mod density;
mod hits;
mod interpolate;
mod lattice;
mod scattered;

use glam::DVec3;

use crate::error::Result;
use crate::scene::{Data, Kernels, Model, Points, Scene, TransferFunction};

use super::march::Classes;
use density::{Density, Rule};
use interpolate::Interpolate;
use lattice::Lattice;
use scattered::Scattered;

/// Scalars and weights beyond this are taken for this: sums of their products must not overflow.
const LARGEST: f64 = 1e100;

/// Extinctions above this are taken for this, for the same reason.
const MAX_TAU: f64 = 1e150;

/// Sums over the kernels at a place. Density: extinction, and emission. Interpolation: weight, weighted scalar.
type Sums = [f64; 4];

/// A scene of kernels, prepared for rays.
pub(super) struct KernelRays {
    source: Source,
    model: Model,
    classes: Classes,
    rules: Vec<Rule>,
    least: f64,
    /// Smallest and largest scalar.
    range: [f64; 2],
}

enum Source {
    Lattice(Lattice),
    Scattered(Scattered),
}

impl KernelRays {
    /// None where the scene is drawn without kernels.
    pub(super) fn new(scene: &Scene) -> Result<Option<Self>> {
        let kernels = match (&scene.data, scene.kernels) {
            (_, Some(kernels)) => kernels,
            (Data::Points(_), None) => Kernels::of_points(),
            _ => return Ok(None),
        };
        let values = Values { transfer: &scene.transfer, model: kernels.model };
        let (source, range) = match &scene.data {
            Data::Grid(grid) => (Source::Lattice(Lattice::new(grid, &kernels, &values)?), grid.range()),
            Data::Mesh(mesh) => {
                let points = Points::of_vertices(mesh)?;
                (Source::Scattered(Scattered::new(&points, &kernels, &values)?), points.range())
            }
            Data::Points(points) => {
                (Source::Scattered(Scattered::new(points, &kernels, &values)?), points.range())
            }
        };
        Ok(Some(Self {
            source,
            model: kernels.model,
            classes: Classes::new(&scene.transfer),
            rules: Rule::all(),
            least: kernels.least,
            range,
        }))
    }

    /// One ray; `direction` has unit length, so that the parameter is a length in the world.
    pub(super) fn trace(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> [f64; 4] {
        match self.model {
            Model::Density => {
                let mut medium = Density::new(&self.rules);
                self.walk(origin, direction, range, &mut medium);
                medium.pixel()
            }
            Model::Interpolate => {
                let mut medium = Interpolate::new(&self.classes, self.least, self.range);
                self.walk(origin, direction, range, &mut medium);
                medium.pixel()
            }
        }
    }

    fn walk(&self, origin: DVec3, direction: DVec3, range: [f64; 2], medium: &mut impl Medium) {
        match &self.source {
            Source::Lattice(lattice) => lattice.walk(origin, direction, range, medium),
            Source::Scattered(scattered) => scattered.walk(origin, direction, range, medium),
        }
    }
}

/// What gathers light along a ray.
trait Medium {
    /// A stretch of the ray on which the sums are smooth, next to the last one or behind it. On `scale` of length they
    /// vary as a Gaussian does on one standard deviation, at most.
    fn add(&mut self, from: f64, to: f64, scale: f64, sums: &impl Fn(f64) -> Sums);

    /// Whether nothing shows where kernels overlap that add these values, whatever the place.
    fn is_vacuum(&self, values: impl Iterator<Item = Sums>) -> bool;

    /// Whether nothing behind can be seen.
    fn is_opaque(&self) -> bool;
}

/// What a kernel adds to the sums where its shape is 1.
struct Values<'a> {
    transfer: &'a TransferFunction,
    model: Model,
}

impl Values<'_> {
    /// The scalar that a sample stands for: infinities are the transfer function's ends.
    fn scalar(&self, s: f64) -> f64 {
        let [low, high] = self.transfer.domain();
        let s = if s == f64::INFINITY {
            high
        } else if s == f64::NEG_INFINITY {
            low
        } else {
            s
        };
        s.clamp(-LARGEST, LARGEST)
    }

    /// None for a kernel that shows nothing.
    fn of(&self, s: f64, weight: f64) -> Option<Sums> {
        if s.is_nan() || weight.is_nan() || weight == 0.0 {
            return None;
        }
        let (s, w) = (self.scalar(s), weight.clamp(-LARGEST, LARGEST));
        if self.model == Model::Interpolate {
            return Some([w, w * s, 0.0, 0.0]);
        }
        let (colour, tau) = self.transfer.at(s);
        let tau = (tau.min(MAX_TAU) * w).min(MAX_TAU);
        (tau > 0.0).then_some([tau, tau * colour.x, tau * colour.y, tau * colour.z])
    }
}
