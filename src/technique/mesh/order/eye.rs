//! The eye of a view, and which cell of a face its rays enter first.

use std::cmp::Ordering;

use glam::DVec3;

use crate::num;
use crate::scene::View;
use crate::scene::predicates;
use crate::scene::topology::{Face, NONE};

/// The common origin of all rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Eye {
    /// A point.
    At(DVec3),
    /// Infinity: all rays have this direction.
    Along(DVec3),
}

impl Eye {
    /// Returns the eye of a view.
    pub(crate) fn of(view: &View) -> Self {
        if view.is_perspective() { Self::At(view.camera().eye) } else { Self::Along(view.forward()) }
    }

    /// Returns the side of a face's plane on which the eye is: `Greater` on the front side. Exact.
    ///
    /// `Equal` orders no cells: from an eye in the plane a ray either stays in the plane or meets it only in the eye, and
    /// so never crosses the face.
    pub(crate) fn side(self, face: &Face, points: &[DVec3]) -> Ordering {
        let [a, b, c] = face.corners.map(|i| points[num::index(i)]);
        match self {
            Self::At(eye) => predicates::sign([[b, a], [c, a], [eye, a]]),
            Self::Along(direction) => predicates::sign([[b, a], [c, a], predicates::along(-direction)]),
        }
    }

    /// Returns the cells of a face in the order in which rays pass them; `None` where one is missing or no ray crosses.
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
