//! Kinds of data that a scene may hold.

use glam::DVec3;

use super::grid::box_corners;
use super::{Gaussians, Grid, Points, Tets};

/// The data of a file or a scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Data {
    /// Samples on a lattice.
    Grid(Grid),
    /// Tetrahedra.
    Mesh(Tets),
    /// Scattered points.
    Points(Points),
    /// Trained Gaussian splats.
    Gaussians(Gaussians),
}

impl Data {
    /// Returns the name of the kind for messages.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Grid(_) => "grid",
            Self::Mesh(_) => "mesh",
            Self::Points(_) => "points",
            Self::Gaussians(_) => "gaussians",
        }
    }

    /// Returns the smallest and the largest finite scalar. Gaussian splats have none: 0 and 1.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        match self {
            Self::Grid(grid) => grid.range(),
            Self::Mesh(mesh) => mesh.range(),
            Self::Points(points) => points.range(),
            Self::Gaussians(_) => [0.0, 1.0],
        }
    }

    /// Returns the corners of the smallest box that holds the data, in world units.
    ///
    /// The box is aligned with the grid's own axes for a grid, else with the world's axes. For points it
    /// includes their kernels, see [`Points::reach`], for Gaussian splats three standard deviations.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        match self {
            Self::Grid(grid) => grid.corners(),
            Self::Mesh(mesh) => box_corners(mesh.bounds()),
            Self::Points(points) => box_corners(points.reach()),
            Self::Gaussians(gaussians) => box_corners(gaussians.reach()),
        }
    }
}

impl From<Grid> for Data {
    fn from(grid: Grid) -> Self {
        Self::Grid(grid)
    }
}

impl From<Tets> for Data {
    fn from(mesh: Tets) -> Self {
        Self::Mesh(mesh)
    }
}

impl From<Points> for Data {
    fn from(points: Points) -> Self {
        Self::Points(points)
    }
}

impl From<Gaussians> for Data {
    fn from(gaussians: Gaussians) -> Self {
        Self::Gaussians(gaussians)
    }
}
