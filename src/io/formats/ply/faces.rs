//! Faces: the element `face` with its list `vertex_indices` or `vertex_index`.

use crate::error::Result;
use crate::io::build::points::positions;
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::SampleType;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::{self, shown};
use crate::io::formats::fan::{Faces, Triangles};
use crate::io::formats::ply::body::number;
use crate::io::formats::ply::header::{Element, Header};
use crate::num;

/// Reads positions of vertices and faces, with elements in any order.
pub(crate) fn read(source: &Source, budget: &mut Budget) -> Result<Triangles> {
    let mut scanner = Scanner::new(source);
    let header = Header::read(&mut scanner)?;
    let (place, axes) = header.vertex(source)?;
    let count = text::index(source, "element vertex", header.elements[place].count)?;
    let Some(of_faces) = header.elements.iter().position(|element| element.name == "face") else {
        return Err(source.error("element face", "none: a surface needs faces"));
    };
    let mut points = Vec::new();
    let mut faces = Faces::new(source, budget);
    for (i, element) in header.elements.iter().enumerate() {
        if i == place {
            header.holds(&scanner, element)?;
            let each = |push: &mut dyn FnMut(&[f64])| header.each(&mut scanner, element, &axes, push);
            points = positions(source, budget, count, each)?;
        } else if i == of_faces {
            header.holds(&scanner, element)?;
            header.faces(&mut scanner, element, num::count(count), &mut faces)?;
        } else {
            header.pass(&mut scanner, element)?;
        }
    }
    header.end(&mut scanner)?;
    if let Some(i) = points.iter().position(|point| !point.is_finite()) {
        return Err(source.error(format!("vertex {i}"), format!("{}: must be finite", points[i])));
    }
    Ok(Triangles { points, triangles: faces.finish() })
}

impl Header {
    /// Reads the faces; `points` is the number of vertices.
    fn faces(&self, scanner: &mut Scanner, element: &Element, points: u32, faces: &mut Faces) -> Result<()> {
        let source = scanner.source();
        let named = |name: &str| matches!(name, "vertex_indices" | "vertex_index");
        let Some(list) = element.properties.iter().position(|p| named(&p.name) && p.list.is_some()) else {
            let rule = "has no list \"vertex_indices\" or \"vertex_index\"";
            return Err(source.error("element face", rule));
        };
        if matches!(element.properties[list].kind, SampleType::F32 | SampleType::F64) {
            let rule =
                format!("list {}: indices must be whole numbers", shown(&element.properties[list].name));
            return Err(source.error("element face", rule));
        }
        for i in 0..element.count {
            // Checks the index of a vertex, in text and binary.
            let index = |number: f64| {
                (number >= 0.0 && number < f64::from(points)).then(|| num::u32_of(number)).ok_or_else(|| {
                    source
                        .error(format!("face {i}"), format!("vertex {number}: there are {points}, from 0 on"))
                })
            };
            for (place, property) in element.properties.iter().enumerate() {
                let Some(length) = property.list.filter(|_| place == list) else {
                    self.skip(scanner, element, i, property)?;
                    continue;
                };
                for _ in 0..self.list_length(scanner, element, i, property, length)? {
                    let number = match self.binary {
                        Some(endian) => number(scanner, element, i, property.kind, endian)?,
                        // Indices beyond 2^53, where rounding begins, are too large anyway.
                        None => scanner.number::<i64>("an index")? as f64,
                    };
                    faces.corner(index(number)?)?;
                }
            }
            faces.end(|rule| source.error(format!("face {i}"), rule))?;
            if self.binary.is_none() {
                scanner.end_line()?;
            }
        }
        Ok(())
    }
}
