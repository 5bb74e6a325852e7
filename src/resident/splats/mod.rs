//! The visible kernels of a scene on the device: of a grid, of points, and of the vertices of a mesh.
//!
//! [`SplatSet`] is made from a scene by `lattice` or `scattered`.

mod lattice;
mod scattered;
mod set;
mod space;

pub(crate) use set::{SplatNeeds, SplatSet};
pub(crate) use space::Shape;
