//! The arrays that can be shown.

use std::collections::{HashMap, HashSet};

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association, readings};
use crate::io::file::source::Source;
use crate::io::file::text::shown;
use crate::io::formats::vtk_xml::document::{Array, Document, Piece};
use crate::io::options::ReadOptions;

/// The limit on notes about arrays.
const MOST_NOTES: usize = 16;

/// The arrays that can be shown.
pub(crate) struct Fields {
    pub(crate) arrays: Vec<ArrayInfo>,
    /// Arrays that cannot be shown, and why.
    skipped: Vec<(Association, String, String)>,
    pub(crate) notes: Vec<String>,
}

impl Fields {
    pub(crate) fn of(source: &Source, document: &Document, options: &ReadOptions) -> Result<Self> {
        let Some(first) = document.pieces.first() else {
            return Err(source.error("pieces", "none: the data set is empty"));
        };
        let mut fields = Self { arrays: Vec::new(), skipped: Vec::new(), notes: Vec::new() };
        for association in [Association::Point, Association::Cell] {
            fields.add(document, association);
        }
        // Active scalars of points or cells take precedence over active vectors.
        for kind in 0..2 {
            for array in &mut fields.arrays {
                let place = usize::from(array.association == Association::Cell);
                array.active = first.active[place][kind].as_ref() == Some(&array.name);
            }
            if fields.arrays.iter().any(|array| array.active) {
                break;
            }
        }
        let note = |(association, name, why): &(Association, String, String)| {
            format!("{}:{} left out: {why}", association.name(), shown(name))
        };
        fields.notes.extend(fields.skipped.iter().take(MOST_NOTES).map(note));
        if fields.skipped.len() > MOST_NOTES {
            fields.notes.push(format!("{} more arrays left out", fields.skipped.len() - MOST_NOTES));
        }
        fields.check(source, options)?;
        Ok(fields)
    }

    /// Adds the arrays that all pieces with points, or cells, have.
    fn add(&mut self, document: &Document, association: Association) {
        let pieces: Vec<&Piece> =
            document.pieces.iter().filter(|piece| piece.tuples(association) > 0).collect();
        // Arrays in the order in which they are met, with the number of pieces that have them.
        let mut order: Vec<(&Array, usize)> = Vec::new();
        let mut places: HashMap<&str, usize> = HashMap::new();
        for (number, piece) in pieces.iter().enumerate() {
            let mut own: HashSet<&str> = HashSet::new();
            for array in piece.arrays(association.into()) {
                let name = array.name.as_str();
                if !own.insert(name) {
                    self.skip(association, name, "another array has the same name");
                    continue;
                }
                let place = *places.entry(name).or_insert(order.len());
                match order.get_mut(place) {
                    Some((like, count)) => {
                        let same = like.kind == array.kind && like.components == array.components;
                        *count += usize::from(same && *count == number);
                    }
                    None => order.push((array, usize::from(number == 0))),
                }
            }
        }
        for (array, count) in order {
            let Array { name, kind, components, .. } = array;
            match kind {
                _ if count < pieces.len() => {
                    self.skip(association, name, "not all pieces have it, or not of the same type");
                }
                Err(why) => self.skip(association, name, why),
                Ok(kind) => {
                    let (name, kind, components) = (name.clone(), *kind, *components);
                    self.arrays.push(ArrayInfo { name, association, kind, components, active: false });
                }
            }
        }
    }

    fn skip(&mut self, association: Association, name: &str, why: &str) {
        self.skipped.push((association, name.to_owned(), why.to_owned()));
    }

    /// Refuses selected arrays that cannot be read.
    fn check(&self, source: &Source, options: &ReadOptions) -> Result<()> {
        let wanted = [&options.array, &options.radius, &options.covariance, &options.weight];
        for wanted in wanted.into_iter().flatten() {
            let asked = |association: Association, own: &str| {
                readings(wanted).any(|(a, name)| own == name && a.is_none_or(|a| a == association))
            };
            if self.arrays.iter().any(|array| asked(array.association, &array.name)) {
                continue;
            }
            if let Some((_, _, why)) = self.skipped.iter().find(|(a, own, _)| asked(*a, own)) {
                let place = format!("array \"{}\"", shown(wanted));
                return Err(source.error(place, format!("cannot be read: {why}")));
            }
        }
        Ok(())
    }
}
