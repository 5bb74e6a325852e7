//! A scene prepared for rays, whatever its data.

use glam::DVec3;

use super::grid::GridRays;
use super::kernels::KernelRays;
use super::tets::TetRays;
use super::view_ray::ViewRay;
use crate::error::{Error, Result};
use crate::scene::{Data, Scene};

/// A scene's data and transfer function, prepared for rays.
pub(super) enum Rays<'a> {
    Grid(GridRays<'a>),
    Mesh(TetRays<'a>),
    Kernels(Box<KernelRays>),
}

impl<'a> Rays<'a> {
    pub(super) fn new(scene: &'a Scene) -> Result<Self> {
        if let Some(rays) = KernelRays::new(scene)? {
            return Ok(Self::Kernels(Box::new(rays)));
        }
        match &scene.data {
            Data::Grid(grid) => Ok(Self::Grid(GridRays::new(grid, &scene.transfer))),
            Data::Mesh(mesh) => Ok(Self::Mesh(TetRays::new(mesh, &scene.transfer))),
            Data::Points(_) => Err(Error::invalid("reference", "points require kernels")),
        }
    }

    /// Integrates the volume on a ray and composites the surfaces.
    pub(super) fn draw(&self, view_ray: &ViewRay) -> [f64; 4] {
        view_ray.composite(|range| self.trace(view_ray.origin, view_ray.direction, range))
    }

    /// Integrates the volume in a range of a ray.
    pub(super) fn trace(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> [f64; 4] {
        match self {
            Self::Grid(rays) => rays.trace(origin, direction, range),
            Self::Mesh(rays) => rays.trace(origin, direction, range),
            Self::Kernels(rays) => rays.trace(origin, direction, range),
        }
    }
}
