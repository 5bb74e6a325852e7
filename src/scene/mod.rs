//! What is drawn, without Vulkan: data, transfer function, camera, scene file.

pub mod auto;
mod camera;
mod cells;
mod field;
pub mod file;
mod grid;
mod points;
mod tets;
mod transfer;

pub use camera::{Camera, Projection, View};
pub use cells::CellKind;
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
    pub grid: Grid,
    /// From scalar to emission and extinction.
    pub transfer: TransferFunction,
}
