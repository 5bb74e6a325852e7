//! The kinds of data that a scene may hold.

use super::{Grid, Points, Tets};

/// What a file or a scene holds.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Data {
    /// Samples on a lattice.
    Grid(Grid),
    /// Tetrahedra.
    Mesh(Tets),
    /// Scattered points.
    Points(Points),
}

impl Data {
    /// What it is, in words.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Grid(_) => "grid",
            Self::Mesh(_) => "mesh",
            Self::Points(_) => "points",
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
