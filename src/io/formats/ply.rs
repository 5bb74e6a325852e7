//! PLY points (`.ply`), as text or binary in either byte order.
//!
//! The element `vertex` is read, with its properties `x`, `y`, `z` of any type. Further numeric properties are arrays,
//! also grouped as described in [`columns`]: `nx ny nz` are `normal`, `red green blue` are
//! `colour`, `scale_0 scale_1 scale_2` are `scale`. List properties, faces and other elements are skipped, but must be
//! complete. In text, each vertex is a line. [`faces`] reads the faces of surfaces, [`gaussian`] scenes of Gaussian splats.

mod body;
pub(crate) mod faces;
pub(crate) mod header;

use crate::error::Result;
use crate::io::build::columns::{self, Column};
use crate::io::build::origin::Origin;
use crate::io::build::points;
use crate::io::file::budget::Budget;
use crate::io::file::decode::Values;
use crate::io::file::sample_type::Pick;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::{self, shown};
use crate::io::formats::gaussian;
use crate::io::formats::ply::header::{Element, Header, Property, recognises};
use crate::io::options::{Request, Wanted};
use crate::io::reader::Reader;
use crate::io::report::Found;

pub(crate) struct Ply;

impl Reader for Ply {
    fn name(&self) -> &'static str {
        "PLY"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["ply", "ply.gz"]
    }

    fn recognises(&self, source: &Source) -> bool {
        recognises(source)
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let mut budget = Budget::new(source, request);
        let mut scanner = Scanner::new(source);
        let header = Header::read(&mut scanner)?;
        // Whoever names arrays, or copies them, wants points; axes are those of splats.
        let has_axes = request.axes.is_some() || request.turn_to.is_some();
        let for_scene = (request.wanted == Wanted::Scene || has_axes) && request.selected().is_none();
        if let Some(form) = gaussian::ply::form(&header)
            && (for_scene || form == gaussian::ply::Form::Packed)
        {
            return gaussian::ply::read(scanner, &header, form, request);
        }
        let (place, axes) = header.vertex(source)?;
        let vertex = &header.elements[place];

        for element in &header.elements[..place] {
            header.pass(&mut scanner, element)?;
        }
        let begin = (scanner.position(), scanner.lines());
        header.holds(&scanner, vertex)?;
        let count = text::index(source, "element vertex", vertex.count)?;
        let each = |push: &mut dyn FnMut(&[f64])| header.each(&mut scanner, vertex, &axes, push);
        let points = points::positions(source, &mut budget, count, each)?;
        for element in &header.elements[place + 1..] {
            header.pass(&mut scanner, element)?;
        }
        header.end(&mut scanner)?;

        let mut notes = Vec::new();
        if gaussian::ply::form(&header).is_some() && request.wanted == Wanted::Scene {
            notes.push(
                "the properties are those of Gaussian splats, read as points because an array is named"
                    .to_owned(),
            );
        }
        for Element { name, count, .. } in &header.elements {
            match name.as_str() {
                "vertex" => {}
                _ if *count == 0 => {}
                "face" => notes.push(format!("{count} faces left out: points are read")),
                name => notes.push(format!("{count} elements \"{}\" left out", shown(name))),
            }
        }
        let (mut scalars, mut own) = (Vec::new(), Vec::new());
        for (place, Property { name, kind, list }) in vertex.properties.iter().enumerate() {
            if list.is_some() {
                notes.push(format!("property \"{}\": a list, left out", shown(name)));
            } else if !axes.contains(&place) {
                scalars.push(place);
                own.push(Column { name: name.clone(), kind: *kind });
            }
        }
        let groups = columns::groups(&own);
        let arrays = groups.iter().map(|group| group.info.clone()).collect();
        let mut read = |index: usize, pick: Pick| -> Result<Values> {
            let wanted: Vec<usize> = groups[index].needed(pick).iter().map(|&i| scalars[i]).collect();
            let mut scanner = Scanner::resume(source, begin.0, begin.1)?;
            columns::collect(&groups[index].info, pick, count, |push| {
                header.each(&mut scanner, vertex, &wanted, push)
            })
        };
        let (budget, read) = (&mut budget, &mut read);
        let origin = Origin {
            source,
            format: self.name(),
            arrays,
            spare: columns::spare(&groups),
            request,
            budget,
            read,
        };
        let mut loaded = points::points(points, origin)?;
        loaded.report.notes.splice(0..0, notes);
        Ok(loaded)
    }
}
