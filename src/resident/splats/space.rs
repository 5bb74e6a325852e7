//! The space that splats lie in, how their sizes are given, and the scalars and colours of their records.

use glam::{DMat3, DVec3};

use crate::gpu::shader::{SHAPE_ALIKE, SHAPE_COVARIANCES, SHAPE_RADII};
use crate::num::f32_of;
use crate::scene::TransferFunction;

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

/// Returns the colour of a scalar, not premultiplied, and its extinction times `weight`.
pub(crate) fn classified(transfer: &TransferFunction, s: f64, weight: f64) -> [f32; 4] {
    let (colour, tau) = transfer.at(s);
    // A kernel is opaque long before its extinction overflows.
    let extinction = (tau * weight).clamp(0.0, 1e30);
    [colour.x, colour.y, colour.z, extinction].map(f32_of)
}

/// Returns a scalar, with infinities replaced by the ends of the transfer function.
pub(crate) fn finite(s: f64, [low, high]: [f64; 2]) -> f64 {
    match s {
        f64::INFINITY => high,
        f64::NEG_INFINITY => low,
        s => s,
    }
}
