//! The index space of a grid, and rays in it.

use glam::{DMat3, DVec3};

use crate::scene::Grid;

/// The index space of a grid, where samples are one unit apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct IndexSpace {
    to_index: DMat3,
    centre: DVec3,
    /// Position of the last sample.
    pub(super) last: DVec3,
}

/// The part of a ray inside a box of index space. The parameter is a world length.
#[derive(Clone, Copy, Debug)]
pub(super) struct IndexRay {
    pub(super) start: DVec3,
    pub(super) slope: DVec3,
    pub(super) range: [f64; 2],
}

impl IndexSpace {
    pub(super) fn new(grid: &Grid) -> Self {
        Self { to_index: grid.index_to_world().inverse(), centre: grid.centre(), last: grid.last_index() }
    }

    /// Clips a ray to the closed box that reaches `beyond` the samples on each side. `direction` has unit length.
    pub(super) fn ray(
        &self,
        origin: DVec3,
        direction: DVec3,
        range: [f64; 2],
        beyond: f64,
    ) -> Option<IndexRay> {
        // Measure from the point of the ray nearest to the grid's centre: coordinates along the ray are then
        // as small as the grid, however far the eye is.
        let nearest = (self.centre - origin).dot(direction);
        let start = self.to_index * (origin + direction * nearest - self.centre) + self.last * 0.5;
        let slope = self.to_index * direction;
        let [mut from, mut to] = range.map(|t| t - nearest);
        let (low, high) = (DVec3::ZERO - beyond, self.last + beyond);
        for axis in 0..3 {
            if slope[axis] == 0.0 {
                if !(start[axis] >= low[axis] && start[axis] <= high[axis]) {
                    return None;
                }
                continue;
            }
            let [a, b] = [low, high].map(|side| (side[axis] - start[axis]) / slope[axis]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        let inside = from < to && from.is_finite() && to.is_finite();
        inside.then_some(IndexRay { start, slope, range: [from, to] })
    }
}
