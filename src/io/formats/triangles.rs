//! Reader of triangle meshes for surfaces, from PLY and OBJ files.

use std::path::Path;

use crate::error::Result;
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::formats::fan::Triangles;
use crate::io::formats::obj;
use crate::io::formats::ply::{faces, header};
use crate::io::options::ReadOptions;

/// Reads the faces of a PLY file (recognised by content) or a Wavefront OBJ file (`.obj`), either of which may be
/// compressed with gzip. A face of more than three corners becomes a fan about its first one, which is correct if it
/// is flat and convex.
///
/// # Errors
///
/// [`Error::Io`](crate::Error::Io) if the file cannot be read; [`Error::File`](crate::Error::File) if it is neither, its contents break a rule of the
/// format, it has no face or 2³¹ triangles or more, or it would take more than `options.max_bytes`.
pub fn read_triangles(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Triangles> {
    read(&Source::open(path.as_ref(), options)?, options)
}

/// Reads the first of several files in memory as [`read_triangles`] does.
///
/// # Errors
///
/// As [`read_triangles`]; [`Error::Invalid`](crate::Error::Invalid) if there is no file.
pub fn read_triangles_memory(files: &[(&str, &[u8])], options: &ReadOptions) -> Result<Triangles> {
    read(&Source::in_memory(files)?, options)
}

fn read(source: &Source, options: &ReadOptions) -> Result<Triangles> {
    let mut budget = Budget::new(source, options);
    let name = source.path().to_string_lossy().to_lowercase();
    let read = if header::recognises(source) {
        faces::read(source, &mut budget)?
    } else if name.ends_with(".obj") || name.ends_with(".obj.gz") {
        obj::read(source, &mut budget)?
    } else {
        let rule = "no format of surfaces: PLY (.ply) and Wavefront OBJ (.obj) are supported";
        return Err(source.error("content", rule));
    };
    if read.triangles.is_empty() {
        return Err(source.error("content", "has no face"));
    }
    Ok(read)
}
