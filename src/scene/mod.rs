//! What is drawn, without Vulkan: data, transfer function, camera.

pub mod auto;
mod camera;
mod cells;
mod clip;
mod data;
mod field;
pub(crate) mod grid;
mod kernel;
mod points;
pub(crate) mod predicates;
mod surface;
mod tets;
pub(crate) mod topology;
mod transfer;

pub use camera::{Camera, Projection, View};
pub use cells::CellKind;
pub use clip::{Clip, ClipPlane};
pub use data::Data;
pub use field::Field;
pub use grid::{Anatomy, Grid, Rescale, Samples};
pub use kernel::{Kernel, Kernels, Model};
pub use points::{KernelSize, Points};
pub use surface::{Shading, Surface};
pub(crate) use tets::Orientation;
pub use tets::{Mended, TetScalars, Tets};
pub use transfer::{Knot, TransferFunction};

use crate::error::{Error, Result};

/// A volume with the optical properties of its scalars: what every technique draws.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The data.
    pub data: Data,
    /// From scalar to emission and extinction.
    pub transfer: TransferFunction,
    /// Kernels that make a field of the samples; `None`: what is usual for the data, trilinear on a grid, linear in the
    /// cells of a mesh, [`Kernels::of_points`] on points.
    pub kernels: Option<Kernels>,
    /// Triangle meshes that stand in the volume, opaque and translucent.
    pub surfaces: Vec<Surface>,
}

impl Scene {
    /// A scene of data, which may be given as what it is: a grid, a mesh, points.
    #[must_use]
    pub fn new(data: impl Into<Data>, transfer: TransferFunction) -> Self {
        Self { data: data.into(), transfer, kernels: None, surfaces: Vec::new() }
    }

    /// The same with a field that kernels make of the samples: of a grid's, of the scalars at a mesh's points, of
    /// points. It is what the reference draws; techniques that splat draw it, others refuse it.
    ///
    /// # Errors
    ///
    /// As [`Kernels::check`]; [`Error::Invalid`] for a kernel that the data cannot have.
    pub fn with_kernels(mut self, kernels: Kernels) -> Result<Self> {
        kernels.check()?;
        let of_grids = matches!(kernels.kernel, Kernel::Tent | Kernel::Sinc);
        if of_grids && !matches!(self.data, Data::Grid(_)) {
            let why =
                format!("{}: is for grids, the scene holds a {}", kernels.kernel.name(), self.data.kind());
            return Err(Error::invalid("kernel", why));
        }
        self.kernels = Some(kernels);
        Ok(self)
    }

    /// The same with triangle meshes in it.
    #[must_use]
    pub fn with_surfaces(self, surfaces: Vec<Surface>) -> Self {
        Self { surfaces, ..self }
    }

    /// The grid, where the data is one.
    #[must_use]
    pub fn grid(&self) -> Option<&Grid> {
        match &self.data {
            Data::Grid(grid) => Some(grid),
            _ => None,
        }
    }

    /// The mesh, where the data is one.
    #[must_use]
    pub fn mesh(&self) -> Option<&Tets> {
        match &self.data {
            Data::Mesh(mesh) => Some(mesh),
            _ => None,
        }
    }

    /// The points, where the data is such.
    #[must_use]
    pub fn points(&self) -> Option<&Points> {
        match &self.data {
            Data::Points(points) => Some(points),
            _ => None,
        }
    }
}
