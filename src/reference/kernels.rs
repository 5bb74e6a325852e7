//! Rays through sums of kernels.
//!
//! A ray is cut where it enters or leaves a kernel, and where a kernel's formula changes. Between two cuts
//! the sums are smooth and are integrated over panels that are short compared with every kernel there. The
//! density model uses Gauss-Legendre quadrature, with the optical depth inside a panel from the same nodes.
//! The interpolation model approximates the scalar by cubics, which are then cut at the transfer function's
//! knots.
//!
//! A kernel is invisible if its scalar, weight or size is NaN, its weight or radius is 0, or its covariance
//! is not positive definite. With the density model, kernels of negative weight are invisible too.

mod density;
mod hits;
mod interpolate;
mod lattice;
mod scattered;
mod values;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::scene::{Data, Kernel, Kernels, Model, Points, Scene};

use super::march::Classes;
use density::{Density, Rule};
pub(super) use hits::Hit;
use interpolate::Interpolate;
use lattice::Lattice;
use scattered::Scattered;
use values::{Medium, Values};

/// Integrates Gaussians on a ray whose extinctions add up.
pub(super) struct Overlapping(Vec<Rule>);

impl Overlapping {
    pub(super) fn new() -> Self {
        Self(Rule::all())
    }

    pub(super) fn trace(&self, hits: &[Hit], range: [f64; 2]) -> [f64; 4] {
        let mut medium = Density::new(&self.0, [f64::INFINITY; 3]);
        hits::sweep(hits, hits::Shape::Gaussian, range, &mut medium);
        medium.pixel()
    }
}

/// A scene of kernels, prepared for rays.
pub(super) struct KernelRays {
    source: Source,
    model: Model,
    is_sinc: bool,
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
    pub(super) fn new(scene: &Scene, kernels: &Kernels) -> Result<Self> {
        let values = Values { transfer: &scene.transfer, model: kernels.model };
        let (source, range) = match &scene.data {
            Data::Grid(grid) => (Source::Lattice(Lattice::new(grid, kernels, &values)?), grid.range()),
            Data::Mesh(mesh) => {
                let points = Points::of_vertices(mesh)?;
                (Source::Scattered(Scattered::new(&points, kernels, &values)?), points.range())
            }
            Data::Points(points) => {
                (Source::Scattered(Scattered::new(points, kernels, &values)?), points.range())
            }
            Data::Gaussians(_) => {
                return Err(Error::invalid("kernels", "trained splats are kernels themselves"));
            }
        };
        Ok(Self {
            source,
            model: kernels.model,
            is_sinc: kernels.kernel == Kernel::Sinc,
            classes: Classes::new(&scene.transfer),
            rules: Rule::all(),
            least: kernels.least,
            range,
        })
    }

    /// Integrates one ray. `direction` has unit length, so the parameter is a world length.
    pub(super) fn trace(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> [f64; 4] {
        match self.model {
            Model::Density => self.walk(origin, direction, range, Density::new(&self.rules, self.most())),
            Model::Interpolate => {
                let medium = Interpolate::new(&self.classes, self.least, self.range);
                self.walk(origin, direction, range, medium)
            }
        }
    }

    /// Returns the bounds of the colours of sums of densities; where weights are negative there are none.
    fn most(&self) -> [f64; 3] {
        if self.is_sinc { [f64::INFINITY; 3] } else { self.classes.most.to_array() }
    }

    fn walk(&self, origin: DVec3, direction: DVec3, range: [f64; 2], mut medium: impl Medium) -> [f64; 4] {
        match &self.source {
            Source::Lattice(lattice) => lattice.walk(origin, direction, range, &mut medium),
            Source::Scattered(scattered) => scattered.walk(origin, direction, range, &mut medium),
        }
        medium.pixel()
    }
}
