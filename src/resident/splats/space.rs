//! The space that splats lie in, and how their sizes are given.

use glam::{DMat3, DVec3};

use crate::gpu::shader::{SHAPE_ALIKE, SHAPE_COVARIANCES, SHAPE_RADII};

/// How the sizes of splats are given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    /// All kernels are alike: those of a lattice.
    Alike,
    /// Each kernel has a radius.
    Radii,
    /// Each kernel has a covariance matrix.
    Covariances,
}

impl Shape {
    /// Returns the shader's code.
    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Alike => SHAPE_ALIKE,
            Self::Radii => SHAPE_RADII,
            Self::Covariances => SHAPE_COVARIANCES,
        }
    }
}

/// The space that splats lie in, relative to the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Space {
    /// The middle of the data, in the world.
    pub(crate) centre: DVec3,
    /// World length of a unit of depth: the distance from the centre to the farthest corner of the data.
    pub(crate) unit: f64,
    /// From splat space to the world, relative to the centre.
    pub(crate) to_world: DMat3,
    /// Corners of a box that holds all kernels, relative to the centre, in world units.
    pub(crate) corners: [DVec3; 8],
    /// Half extents of a lattice's domain, in splat space; infinite where there is none.
    pub(crate) domain: DVec3,
    /// Distance of a lattice's layers, or of the sheets of points for a step of 1, in splat space.
    pub(crate) layer: f64,
    /// Position of the middle of sheet 0 along each axis, in sheets.
    pub(crate) middles: [f64; 3],
    /// World length of a step of 1.
    pub(crate) step: f64,
}
