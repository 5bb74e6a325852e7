//! Triangles from polygons: each face becomes a fan about its first corner.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::num;

/// A triangle mesh of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Triangles {
    /// Corners.
    pub points: Vec<DVec3>,
    /// Three indices into `points` each.
    pub triangles: Vec<[u32; 3]>,
}

/// The limit on triangles of a file.
const MAX_TRIANGLES: usize = (1 << 31) - 1;

/// A list that takes its growth from the memory budget.
pub(crate) struct Growing<T> {
    pub(crate) list: Vec<T>,
    what: &'static str,
}

impl<T> Growing<T> {
    pub(crate) fn new(what: &'static str) -> Self {
        Self { list: Vec::new(), what }
    }

    pub(crate) fn push(&mut self, source: &Source, budget: &mut Budget, value: T) -> Result<()> {
        let held = self.list.capacity();
        if self.list.len() == held {
            let wanted = held.saturating_mul(2).max(64);
            let bytes = |count: usize| num::wide(count.saturating_mul(size_of::<T>()));
            // Reallocation may hold the list twice.
            budget.take(self.what, bytes(wanted))?;
            self.list
                .try_reserve_exact(wanted - held)
                .map_err(|_| source.error(self.what, "memory is full"))?;
            budget.put_back(bytes(held));
        }
        self.list.push(value);
        Ok(())
    }
}

/// Builds triangles from the corners of faces, one corner at a time.
pub(crate) struct Faces<'s, 'b> {
    source: &'s Source,
    budget: Budget<'b>,
    triangles: Growing<[u32; 3]>,
    first: u32,
    last: u32,
    corners: u64,
}

impl<'s, 'b> Faces<'s, 'b> {
    pub(crate) fn new(source: &'s Source, budget: &Budget<'b>) -> Self {
        let triangles = Growing::new("triangles");
        Self { source, budget: budget.clone(), triangles, first: 0, last: 0, corners: 0 }
    }

    /// Adds the next corner of a face.
    pub(crate) fn corner(&mut self, point: u32) -> Result<()> {
        self.corners += 1;
        match self.corners {
            1 => self.first = point,
            2 => {}
            _ if self.triangles.list.len() == MAX_TRIANGLES => {
                return Err(self.source.error("triangles", format!("more than {MAX_TRIANGLES}")));
            }
            _ => self.triangles.push(self.source, &mut self.budget, [self.first, self.last, point])?,
        }
        self.last = point;
        Ok(())
    }

    /// Ends a face.
    ///
    /// # Errors
    ///
    /// The error that `error` makes of the rule that the face breaks.
    pub(crate) fn end(&mut self, error: impl FnOnce(String) -> Error) -> Result<()> {
        match std::mem::take(&mut self.corners) {
            corners @ 0..3 => Err(error(format!("a face of {corners} corners: must have at least 3"))),
            _ => Ok(()),
        }
    }

    pub(crate) fn finish(self) -> Vec<[u32; 3]> {
        self.triangles.list
    }
}
