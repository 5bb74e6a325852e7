//! The cells on a ray through a grid, in order, without those of blocks that show nothing.

use glam::DVec3;

use crate::num;

use super::cells::{BLOCK, Cells};
use super::index_space::IndexRay;

/// The segment of a ray inside one cell.
pub(super) struct Segment {
    pub(super) cell: [u32; 3],
    /// Parameters of the ray at both ends.
    pub(super) t: [f64; 2],
}

/// A ray on its way through the cells, from face to face.
///
/// A face's parameter is computed from its index, not accumulated, so that a ray has the same segments whether
/// it came through blocks cell by cell or in one step.
pub(super) struct Walk<'a> {
    cells: &'a Cells<'a>,
    start: [f64; 3],
    slope: [f64; 3],
    last: f64,
    cell: [u32; 3],
    /// Parameters of the faces through which the ray may leave the cell.
    next: [f64; 3],
    t: f64,
    /// The ray has entered a block.
    enters: bool,
    ended: bool,
}

impl<'a> Walk<'a> {
    pub(super) fn new(cells: &'a Cells, ray: &IndexRay) -> Self {
        let IndexRay { start, slope, range: [t, last] } = *ray;
        let cell = (start + slope * t).to_array().map(num::u32_of);
        let cell = [0, 1, 2].map(|axis| cell[axis].min(cells.dims()[axis] - 2));
        let (start, slope) = (start.to_array(), slope.to_array());
        let mut walk =
            Self { cells, start, slope, last, cell, next: [0.0; 3], t, enters: true, ended: false };
        walk.next = [0, 1, 2].map(|axis| walk.face(axis, cell[axis]));
        walk
    }

    /// Returns the next segment of positive length, except for those in blocks that are `empty` by the range of
    /// their samples.
    pub(super) fn next(&mut self, empty: impl Fn([f64; 2]) -> bool) -> Option<Segment> {
        while !self.ended {
            if self.enters {
                self.enters = false;
                if empty(self.cells.range(self.cell)) {
                    self.leave_block();
                    continue;
                }
            }
            let axis = first(self.next);
            let end = self.next[axis].min(self.last);
            let segment = Segment { cell: self.cell, t: [self.t, end] };
            self.leave_cell(axis);
            // Two faces at one place leave a segment of length zero between them.
            if end > segment.t[0] {
                return Some(segment);
            }
        }
        None
    }

    /// Returns the place of a parameter in a cell's own coordinates.
    pub(super) fn local(&self, cell: [u32; 3], t: f64) -> DVec3 {
        let at = |axis: usize| self.start[axis] + self.slope[axis] * t - f64::from(cell[axis]);
        DVec3::new(at(0), at(1), at(2))
    }

    /// Returns the parameter of the face through which the ray leaves the cells of an index.
    fn face(&self, axis: usize, cell: u32) -> f64 {
        let far = f64::from(cell + u32::from(self.slope[axis] > 0.0));
        if self.slope[axis] == 0.0 { f64::INFINITY } else { (far - self.start[axis]) / self.slope[axis] }
    }

    /// Goes through the face across an axis.
    fn leave_cell(&mut self, axis: usize) {
        self.t = self.t.max(self.next[axis]);
        let before = self.cell[axis];
        let end = if self.slope[axis] > 0.0 { self.cells.dims()[axis] - 2 } else { 0 };
        if self.next[axis] >= self.last || before == end {
            self.ended = true;
            return;
        }
        self.cell[axis] = if self.slope[axis] > 0.0 { before + 1 } else { before - 1 };
        self.next[axis] = self.face(axis, self.cell[axis]);
        self.enters |= self.cell[axis] / BLOCK != before / BLOCK;
    }

    /// Goes to the face of the block through which the ray leaves it, as [`Self::leave_cell`] does step by step.
    fn leave_block(&mut self) {
        let far = [0, 1, 2].map(|axis| {
            let begin = self.cell[axis] - self.cell[axis] % BLOCK;
            let end = (begin + BLOCK - 1).min(self.cells.dims()[axis] - 2);
            if self.slope[axis] > 0.0 { end } else { begin }
        });
        let faces = [0, 1, 2].map(|axis| self.face(axis, far[axis]));
        let out = first(faces);
        if faces[out] >= self.last {
            self.ended = true;
            return;
        }
        for axis in (0..3).filter(|&axis| axis != out) {
            // Guess the cell. If rounding led too far, go back: the ray must pass all faces before it. If it did not
            // lead far enough, the faces left are passed without segments.
            let [near, far] = [self.cell[axis], far[axis]];
            let guess = num::u32_of(self.start[axis] + self.slope[axis] * faces[out]);
            let mut cell = guess.clamp(near.min(far), near.max(far));
            while cell != near && self.face(axis, self.back(axis, cell)) >= faces[out] {
                cell = self.back(axis, cell);
            }
            self.cell[axis] = cell;
            self.next[axis] = self.face(axis, cell);
        }
        self.cell[out] = far[out];
        self.next[out] = faces[out];
        self.leave_cell(out);
    }

    /// Returns the index of the cells before those of an index.
    fn back(&self, axis: usize, cell: u32) -> u32 {
        if self.slope[axis] > 0.0 { cell - 1 } else { cell + 1 }
    }
}

/// Returns the axis of the nearest of three faces.
fn first(faces: [f64; 3]) -> usize {
    match faces {
        [x, y, z] if x <= y && x <= z => 0,
        [_, y, z] if y <= z => 1,
        _ => 2,
    }
}
