//! Polygons of Wavefront OBJ (`.obj`).
//!
//! Vertices (`v`) and faces (`f`) are read, with positive or relative indices. Groups, normals, texture coordinates,
//! materials, lines, points and free-form curves and surfaces are skipped.

use glam::DVec3;

use crate::error::Result;
use crate::io::file::budget::Budget;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::{self, shown};
use crate::io::formats::fan::{Faces, Growing, Triangles};
use crate::num;

/// Statements that are skipped.
const OTHERS: &str = "vt vn vp l p o g s mg usemtl mtllib usemap maplib lod bevel c_interp d_interp shadow_obj \
    trace_obj cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con ctech stech call csh bsp bzp cdc cdp \
    res vc";

/// The limit on the length of a statement, in bytes.
const MAX_STATEMENT: usize = 1 << 20;

pub(crate) fn read(source: &Source, budget: &mut Budget) -> Result<Triangles> {
    let mut scanner = Scanner::new(source);
    let mut points = Growing::new("points");
    let mut faces = Faces::new(source, budget);
    // The largest index used before its vertex was read, and its line.
    let mut ahead = (0, 0);
    while let Some(mut line) = scanner.next_line()? {
        let begin = scanner.lines();
        // A backslash at the end continues the line.
        while line.ends_with('\\') {
            let Some(more) = scanner.next_line()? else { break };
            line.pop();
            line.push(' ');
            line.push_str(&more);
            if line.len() > MAX_STATEMENT {
                return Err(scanner.line_error(format!("a statement longer than {MAX_STATEMENT} bytes")));
            }
        }
        let statement = line.split('#').next().unwrap_or_default();
        let wrong = |word: &str, rule: &str| {
            source.error(format!("line {begin}"), format!("\"{}\": {rule}", shown(word)))
        };
        let mut words = statement.split_ascii_whitespace();
        match words.next() {
            None => {}
            Some("v") => {
                let mut numbers = Vec::new();
                for word in words {
                    let number = text::float::<f64>(word).ok_or_else(|| wrong(word, "must be a number"))?;
                    if numbers.len() < 3 && !number.is_finite() {
                        return Err(wrong(word, "a coordinate must be finite"));
                    }
                    numbers.push(number);
                }
                // A weight, a colour or both may follow the coordinates.
                let ([x, y, z] | [x, y, z, _] | [x, y, z, _, _, _] | [x, y, z, _, _, _, _]) = numbers[..]
                else {
                    let rule = "must be three coordinates, and a weight or a colour";
                    return Err(wrong(statement.trim(), rule));
                };
                if points.list.len() >= num::index(u32::MAX) {
                    return Err(source.error("points", format!("must be fewer than {}", u32::MAX)));
                }
                points.push(source, budget, DVec3::new(x, y, z))?;
            }
            Some("f" | "fo") => {
                let have = points.list.len();
                for word in words {
                    let point = corner(word, have).map_err(|rule| wrong(word, rule))?;
                    if num::index(point) >= have && point >= ahead.0 {
                        ahead = (point, begin);
                    }
                    faces.corner(point)?;
                }
                faces.end(|rule| source.error(format!("line {begin}"), rule))?;
            }
            Some(other) if OTHERS.split(' ').any(|name| name == other) => {}
            Some(other) => return Err(wrong(other, "is not a statement of OBJ")),
        }
    }
    let (points, triangles) = (points.list, faces.finish());
    if num::index(ahead.0) >= points.len() && ahead.1 > 0 {
        let rule = format!("vertex {}: there are {}", u64::from(ahead.0) + 1, points.len());
        return Err(source.error(format!("line {}", ahead.1), rule));
    }
    Ok(Triangles { points, triangles })
}

/// Parses a corner and returns the index of its vertex from 0. Files count from 1 or, with negative numbers,
/// backwards from the last vertex read. Indices of texture coordinates and normals may follow.
fn corner(word: &str, have: usize) -> std::result::Result<u32, &'static str> {
    let mut parts = word.split('/');
    let first: i64 = parts.next().and_then(|part| part.parse().ok()).ok_or("must begin with an index")?;
    for (i, part) in parts.enumerate() {
        if i > 1 || !(part.is_empty() || part.parse::<i64>().is_ok()) {
            return Err("must be vertex, vertex/texture, vertex//normal or vertex/texture/normal");
        }
    }
    let index = match first {
        0 => return Err("indices begin at 1"),
        1.. => first.unsigned_abs() - 1,
        _ => num::wide(have).checked_sub(first.unsigned_abs()).ok_or("is before the first vertex")?,
    };
    u32::try_from(index).ok().filter(|index| *index < u32::MAX).ok_or("is too large an index")
}
