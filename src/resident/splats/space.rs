//! The space that splats lie in, and how their sizes are given.

use glam::{DMat3, DVec3};

use crate::gpu::shader::{SHAPE_ALIKE, SHAPE_COVARIANCES, SHAPE_RADII};

/// Which sizes splats have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    Alike,
    Radii,
    Covariances,
}

impl Shape {
    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Alike => SHAPE_ALIKE,
            Self::Radii => SHAPE_RADII,
            Self::Covariances => SHAPE_COVARIANCES,
        }
    }
}

/// Where splats lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Space {
    /// The middle of the data, in the world.
    pub(crate) centre: DVec3,
    /// World length of a unit of depth: from the centre to the furthest corner of the data.
    pub(crate) unit: f64,
    /// From splat space to the world, relative to the centre.
    pub(crate) to_world: DMat3,
    /// A box that holds all kernels, half extents in the world relative to the centre, along its own axes.
    pub(crate) corners: [DVec3; 8],
    /// Half extents of a lattice's domain, in splat space; infinite where there is none.
    pub(crate) domain: DVec3,
    /// Distance of a lattice's layers, in splat space; of points, that of sheets for a step of 1.
    pub(crate) layer: f64,
    /// Where the middle of the sheet of number 0 lies, in sheets, for each axis.
    pub(crate) middles: [f64; 3],
    /// World length that a step of 1 means.
    pub(crate) step: f64,
}
