//! Visibility orders of the cells of a mesh, found on the host.
//!
//! - [`keys::centroid`] sorts by the distance of centroids. Approximate.
//! - [`keys::power`] sorts by the power distance of circumspheres. Exact for Delaunay meshes, up to ties.
//! - [`mpvo()`] sorts adjacent cells topologically (Williams 1992, Visibility-Ordering Meshed Polyhedra), with relations
//!   across gaps along the rays of the pixels (Cook, Max, Silva and Williams 2004, Image-Space Visibility Ordering for
//!   Cell Projection Volume Rendering of Unstructured Data). Exact wherever an order exists.

mod boundary;
mod cycles;
mod eye;
pub(crate) mod keys;
mod mpvo;
#[cfg(test)]
mod tests;

pub(crate) use mpvo::{Boundary, mpvo};
