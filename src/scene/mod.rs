//! What is drawn, without Vulkan: data, transfer function, camera, scene file.

pub mod auto;
mod camera;
mod cells;
mod data;
mod field;
pub mod file;
mod grid;
mod points;
mod tets;
mod transfer;

pub use camera::{Camera, Projection, View};
pub use cells::CellKind;
pub use data::Data;
pub use field::Field;
pub use grid::{Anatomy, Grid, Rescale, Samples};
pub use points::{KernelSize, Points};
pub(crate) use tets::Orientation;
pub use tets::{Mended, TetScalars, Tets};
pub use transfer::{Knot, TransferFunction};

/// A volume with the optical properties of its scalars: what every technique draws.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The data.
    pub data: Data,
    /// From scalar to emission and extinction.
    pub transfer: TransferFunction,
}

impl Scene {
    /// A scene of data, which may be given as what it is: a grid, a mesh, points.
    #[must_use]
    pub fn new(data: impl Into<Data>, transfer: TransferFunction) -> Self {
        Self { data: data.into(), transfer }
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
}
