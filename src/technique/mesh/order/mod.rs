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
pub(crate) mod keys;
mod mpvo;
#[cfg(test)]
mod tests;

use std::cmp::Ordering;

use glam::DVec3;

use crate::num;
use crate::scene::View;
use crate::scene::predicates;
use crate::scene::topology::{Face, NONE};

pub(crate) use mpvo::mpvo;

/// How cells are ordered that are on no ray without a gap between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Boundary {
    /// By where the ray of each pixel leaves the mesh and enters it again: right at every pixel centre.
    Pixels,
    /// By the distance of centroids, which is wrong where the mesh has gaps or hollows and shows them.
    Centroid,
}

/// Cells in the order in which rays meet them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct VisibilityOrder {
    /// Every cell once, nearest first.
    pub front_to_back: Vec<u32>,
    /// Groups of cells that lie in front of one another in turn, so that no order is right for all.
    pub cycles: u32,
    /// Cells in such groups.
    pub cells_in_cycles: u32,
    /// Relations that the order does not keep, because of cycles.
    pub dropped_relations: u64,
    /// Whether cells with a gap between them were ordered by centroids.
    pub approximate: bool,
}

/// Where rays come from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Eye {
    /// From a point.
    At(DVec3),
    /// From infinity, in this direction.
    Along(DVec3),
}

impl Eye {
    fn of(view: &View) -> Self {
        if view.is_perspective() { Self::At(view.camera().eye) } else { Self::Along(view.forward()) }
    }

    /// On which side of a face's plane the eye is: Greater on the front side. Exact.
    ///
    /// Equal needs no relation between the cells of the face: from an eye in the plane a ray either stays in
    /// the plane or meets it in the eye only, and crosses the face in neither case.
    fn side(self, face: &Face, points: &[DVec3]) -> Ordering {
        let [a, b, c] = face.corners.map(|i| points[num::index(i)]);
        match self {
            Self::At(eye) => predicates::sign([[b, a], [c, a], [eye, a]]),
            Self::Along(direction) => predicates::sign([[b, a], [c, a], predicates::along(-direction)]),
        }
    }

    /// The cells of a face in the order in which rays cross it, if both are there and rays do.
    fn crossed(self, face: &Face, points: &[DVec3]) -> Option<[u32; 2]> {
        if face.front == NONE || face.back == NONE {
            return None;
        }
        match self.side(face, points) {
            Ordering::Greater => Some([face.front, face.back]),
            Ordering::Less => Some([face.back, face.front]),
            Ordering::Equal => None,
        }
    }
}
