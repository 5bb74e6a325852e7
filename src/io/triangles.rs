//! Triangle meshes: what surfaces are read from. Polygons become fans about their first corner.

use std::path::Path;

use glam::DVec3;

use super::ReadOptions;
use super::source::{Budget, Source};
use super::{obj, ply};
use crate::error::{Error, Result};
use crate::num;

/// Triangles as a file has them.
#[derive(Clone, Debug, PartialEq)]
pub struct Triangles {
    /// Corners.
    pub points: Vec<DVec3>,
    /// Three indices into `points` each.
    pub triangles: Vec<[u32; 3]>,
}

/// Most triangles of a file.
const MAX_TRIANGLES: usize = (1 << 31) - 1;

/// Reads the faces of a PLY file (`.ply`, known by its content) or a Wavefront OBJ file (`.obj`), either of which may be
/// packed by gzip. A face of more than three corners becomes a fan about its first one: what is meant if it is flat and
/// convex.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be read; [`Error::File`] if it is neither, its contents break a rule of the format,
/// it has no face or 2³¹ triangles, or it would take more than `options.max_bytes`.
pub fn read_triangles(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Triangles> {
    read(&Source::open(path.as_ref(), options)?, options)
}

/// The same for a file in memory: the first.
///
/// # Errors
///
/// As [`read_triangles`]; [`Error::Invalid`] if there is no file.
pub fn read_triangles_memory(files: &[(&str, &[u8])], options: &ReadOptions) -> Result<Triangles> {
    read(&Source::in_memory(files)?, options)
}

fn read(source: &Source, options: &ReadOptions) -> Result<Triangles> {
    let mut budget = Budget::new(source, options);
    let name = source.path().to_string_lossy().to_lowercase();
    let read = if ply::recognises(source) {
        ply::faces::read(source, &mut budget)?
    } else if name.ends_with(".obj") || name.ends_with(".obj.gz") {
        obj::read(source, &mut budget)?
    } else {
        let rule = "of no format that surfaces are read from: those are PLY (.ply) and Wavefront OBJ (.obj)";
        return Err(source.error("content", rule));
    };
    if read.triangles.is_empty() {
        return Err(source.error("content", "has no face"));
    }
    Ok(read)
}

/// A list that grows within the limit of memory.
pub(super) struct Growing<T> {
    pub(super) list: Vec<T>,
    what: &'static str,
}

impl<T> Growing<T> {
    pub(super) fn new(what: &'static str) -> Self {
        Self { list: Vec::new(), what }
    }

    pub(super) fn push(&mut self, source: &Source, budget: &mut Budget, value: T) -> Result<()> {
        let held = self.list.capacity();
        if self.list.len() == held {
            let wanted = held.saturating_mul(2).max(64);
            let bytes = |count: usize| num::wide(count.saturating_mul(size_of::<T>()));
            // While it moves, it is there twice.
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

/// Faces, corner by corner.
pub(super) struct Faces<'s, 'b> {
    source: &'s Source,
    budget: Budget<'b>,
    triangles: Growing<[u32; 3]>,
    first: u32,
    last: u32,
    corners: u64,
}

impl<'s, 'b> Faces<'s, 'b> {
    pub(super) fn new(source: &'s Source, budget: &Budget<'b>) -> Self {
        let triangles = Growing::new("triangles");
        Self { source, budget: budget.clone(), triangles, first: 0, last: 0, corners: 0 }
    }

    /// The next corner of a face.
    pub(super) fn corner(&mut self, point: u32) -> Result<()> {
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

    /// The end of a face.
    ///
    /// # Errors
    ///
    /// What is wrong with it, said by `error`.
    pub(super) fn end(&mut self, error: impl FnOnce(String) -> Error) -> Result<()> {
        match std::mem::take(&mut self.corners) {
            corners @ 0..3 => Err(error(format!("a face of {corners} corners: must have at least 3"))),
            _ => Ok(()),
        }
    }

    pub(super) fn finish(self) -> Vec<[u32; 3]> {
        self.triangles.list
    }
}
