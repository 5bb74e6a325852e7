//! Visibility orders: which cell of a mesh to draw first.
//!
//! - [`keys::centroid`]: by the distance of centroids. Approximate.
//! - [`keys::power`]: by the power distance of circumspheres. Exact for Delaunay meshes, up to ties.
//! - [`mpvo()`]: a topological sort of what lies directly in front of what (Williams 1992, Visibility-Ordering
//!   Meshed Polyhedra), with relations across gaps along the rays of the pixels (Cook, Max, Silva and Williams
//!   2004, Image-Space Visibility Ordering for Cell Projection Volume Rendering of Unstructured Data). Exact
//!   wherever an order exists.

mod boundary;
mod cycles;
mod eye;
pub(crate) mod keys;
mod mpvo;
#[cfg(test)]
mod tests;

pub(crate) use mpvo::{Boundary, mpvo};
