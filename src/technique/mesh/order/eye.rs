//! The eye of a view, and which cell of a face its rays enter first.

use std::cmp::Ordering;

use glam::DVec3;

use crate::num;
use crate::scene::View;
use crate::scene::predicates;
use crate::scene::topology::{Face, NONE};

/// Where rays come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Eye {
    /// From a point.
    At(DVec3),
    /// From infinity, in this direction.
    Along(DVec3),
}

impl Eye {
    pub(crate) fn of(view: &View) -> Self {
        if view.is_perspective() { Self::At(view.camera().eye) } else { Self::Along(view.forward()) }
    }

    /// On which side of a face's plane the eye is: Greater on the front side. Exact.
    ///
    /// Equal needs no relation between the cells of the face: from an eye in the plane a ray either stays in
    /// the plane or meets it in the eye only, and crosses the face in neither case.
    pub(crate) fn side(self, face: &Face, points: &[DVec3]) -> Ordering {
        let [a, b, c] = face.corners.map(|i| points[num::index(i)]);
        match self {
            Self::At(eye) => predicates::sign([[b, a], [c, a], [eye, a]]),
            Self::Along(direction) => predicates::sign([[b, a], [c, a], predicates::along(-direction)]),
        }
    }

    /// The cells of a face in the order in which rays cross it, if both are there and rays do.
    pub(crate) fn crossed(self, face: &Face, points: &[DVec3]) -> Option<[u32; 2]> {
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
