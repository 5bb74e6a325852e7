//! Image data and rectilinear grids: pieces joined by their extents.

use glam::{DMat3, DVec3};

use crate::error::Result;
use crate::io::build::arrays::ArrayInfo;
use crate::io::build::lattice::{self, Places};
use crate::io::build::origin::Origin;
use crate::io::file::budget::Budget;
use crate::io::file::decode;
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::file::text::index;
use crate::io::formats::vtk_xml::File;
use crate::io::formats::vtk_xml::document::{Document, Extent, Kind, Piece, Section};
use crate::io::formats::vtk_xml::pieces::{append, counts, f64_of, numbers, section, shape, words};
use crate::io::formats::vtk_xml::store::Store;
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::num;
use crate::scene::Samples;

impl File<'_> {
    /// Reads image data or a rectilinear grid.
    pub(crate) fn lattice(&mut self, format: &'static str, options: &ReadOptions) -> Result<Loaded> {
        let source = self.source;
        let Document { whole, origin, spacing, direction, kind, .. } = self.document;
        let empty = |extent: Extent| counts(extent).contains(&0);
        let pieces: Vec<&Piece> = self.document.pieces.iter().filter(|piece| !empty(piece.extent)).collect();
        let mut extent: Option<Extent> = None;
        for piece in &pieces {
            let inside = |axis: usize| {
                whole[axis][0] <= piece.extent[axis][0] && piece.extent[axis][1] <= whole[axis][1]
            };
            if !(0..3).all(inside) {
                let rule = format!("{}: not within the whole extent {}", words(piece.extent), words(whole));
                return Err(source.error(format!("line {}, Piece Extent", piece.line), rule));
            }
            let all = extent.get_or_insert(piece.extent);
            for (all, own) in all.iter_mut().zip(piece.extent) {
                *all = [all[0].min(own[0]), all[1].max(own[1])];
            }
        }
        let Some(extent) = extent else {
            return Err(source.error("pieces", "all are empty: the data set has no points"));
        };
        let mut warnings = Vec::new();
        if extent != whole {
            warnings.push(format!("pieces cover {} of the whole extent {}", words(extent), words(whole)));
        }
        let points = |extent: Extent| counts(extent).into_iter().fold(1, u64::saturating_mul);
        let sum = pieces.iter().map(|piece| points(piece.extent)).fold(0, u64::saturating_add);
        // Pieces share points: with one cell each, they have up to eight times the points of the whole.
        if sum > points(extent).saturating_mul(8) {
            let rule = format!("they overlap: {sum} points in all, {} in {}", points(extent), words(extent));
            return Err(source.error("pieces", rule));
        }
        let mut dims = [0; 3];
        for (dim, count) in dims.iter_mut().zip(counts(extent)) {
            *dim = num::count(index(source, "WholeExtent", count)?);
        }
        if pieces.len() > 1 {
            self.notes.push(format!("{} pieces were joined", pieces.len()));
        }

        let places = if kind == Kind::Image {
            let rows = DMat3::from_cols_array(&direction).transpose();
            let spacing = DVec3::from_array(spacing);
            let first = DVec3::from_array(extent.map(|[first, _]| f64_of(first)));
            let (places, notes) = Places::even(DVec3::from_array(origin), spacing, rows, first);
            self.notes.extend(notes);
            places
        } else {
            Places::Listed(coordinates(source, &mut self.store, &mut self.budget, &pieces, extent)?)
        };

        let arrays = self.arrays.clone();
        let origin = Origin { source, format, arrays: arrays.clone() };
        let (store, mut scratch) = (&mut self.store, self.budget.clone());
        let mut loaded = lattice::build(
            origin,
            dims,
            places,
            &mut self.budget,
            &mut |index, pick| samples_of(source, store, &mut scratch, &pieces, extent, &arrays[index], pick),
            options,
        )?;
        loaded.report.warnings.splice(0..0, warnings);
        Ok(loaded)
    }
}

/// Reads the coordinates along each axis and joins those of the pieces.
fn coordinates(
    source: &Source,
    store: &mut Store,
    budget: &mut Budget,
    pieces: &[&Piece],
    extent: Extent,
) -> Result<[Vec<f64>; 3]> {
    const LETTERS: [char; 3] = ['x', 'y', 'z'];
    let mut all = [const { Vec::new() }; 3];
    for (axis, all) in all.iter_mut().enumerate() {
        let count = counts(extent)[axis];
        for (number, piece) in pieces.iter().enumerate() {
            let Some(array) = piece.arrays(Section::Coordinates).nth(axis) else {
                let rule = format!("no coordinates along {}", LETTERS[axis]);
                return Err(source.error(format!("line {}, Piece", piece.line), rule));
            };
            if array.components != 1 {
                let rule = format!("{} components: coordinates have 1", array.components);
                return Err(source.error(array.at(), rule));
            }
            let own = counts(piece.extent)[axis];
            store.check(array, own)?;
            // Memory is taken for the list of the piece, and below for that of the whole.
            let bytes = own.saturating_mul(8);
            budget.take(&array.at(), bytes)?;
            let mut list = Vec::new();
            store.take(array, own, &mut |reader, kind, endian| {
                let count = usize::try_from(own).unwrap_or(usize::MAX);
                decode::append_f64(reader, count, kind, endian, &mut list)
            })?;
            if number == 0 {
                budget.take(&array.at(), count.saturating_mul(8))?;
                all.resize(index(source, &array.at(), count)?, f64::NAN);
            }
            let begin = usize::try_from(piece.extent[axis][0] - extent[axis][0]).unwrap_or(0);
            for (all, own) in all.iter_mut().skip(begin).zip(list) {
                if !all.is_nan() && *all != own {
                    let rule = format!("{own}: another piece has {all} along {} here", LETTERS[axis]);
                    return Err(source.error(array.at(), rule));
                }
                *all = own;
            }
            budget.put_back(bytes);
        }
    }
    Ok(all)
}

/// Reads the selected part of an array and joins the pieces.
fn samples_of(
    source: &Source,
    store: &mut Store,
    budget: &mut Budget,
    pieces: &[&Piece],
    extent: Extent,
    info: &ArrayInfo,
    pick: Pick,
) -> Result<Samples> {
    let association = info.association;
    let own = |piece: &Piece| shape(piece.extent, association).into_iter().fold(1, u64::saturating_mul);
    let mut samples = Samples::none(info.kind, pick);
    if let [piece] = pieces {
        if let Some(array) = piece.array(section(association), &info.name) {
            append(store, array, own(piece), pick, &mut samples, source)?;
        }
        return Ok(samples);
    }
    // All pieces are checked before the whole is allocated.
    for piece in pieces {
        if let Some(array) = piece.array(section(association), &info.name) {
            store.check(array, numbers(source, array, own(piece), array.components)?)?;
        }
    }
    let place = format!("array {info}");
    let dims = shape(extent, association);
    let count = dims.into_iter().fold(1, u64::saturating_mul);
    let count =
        usize::try_from(count).map_err(|_| source.error(&place, "more samples than memory can address"))?;
    // The memory of the whole has been taken; the record of filled samples takes a byte each.
    budget.take(&place, num::wide(count))?;
    let full = |_| source.error(&place, "memory is full");
    samples.reserve(count).map_err(full)?;
    samples.resize(count);
    let mut there: Vec<bool> = Vec::new();
    there.try_reserve_exact(count).map_err(full)?;
    there.resize(count, false);
    for piece in pieces {
        let count = own(piece);
        let Some(array) = piece.array(section(association), &info.name).filter(|_| count > 0) else {
            continue;
        };
        let bytes = count.saturating_mul(info.kind.stored_bytes().max(4));
        budget.take(&place, bytes)?;
        let mut share = Samples::none(info.kind, pick);
        append(store, array, count, pick, &mut share, source)?;
        let own = shape(piece.extent, association).map(|n| usize::try_from(n).unwrap_or(0));
        let dims = dims.map(|n| usize::try_from(n).unwrap_or(0));
        let mut at = [0; 3];
        for axis in 0..3 {
            at[axis] = usize::try_from(piece.extent[axis][0] - extent[axis][0]).unwrap_or(0);
        }
        for row in 0..own[1] * own[2] {
            let (y, z) = (row % own[1], row / own[1]);
            let from = row * own[0];
            let to = at[0] + dims[0] * (at[1] + y + dims[1] * (at[2] + z));
            samples.copy(to, &share, from, own[0]);
            there[to..to + own[0]].fill(true);
        }
        budget.put_back(bytes);
    }
    if let Some(gap) = there.iter().position(|there| !there) {
        let gap = u64::try_from(gap).unwrap_or(0);
        let at = [gap % dims[0], gap / dims[0] % dims[1], gap / dims[0] / dims[1]];
        let [x, y, z] = [0, 1, 2].map(|i: usize| i64::try_from(at[i]).unwrap_or(0) + extent[i][0]);
        let rule = format!("no piece has the {} with index {x} {y} {z}", association.name());
        return Err(source.error(&place, rule));
    }
    budget.put_back(u64::try_from(count).unwrap_or(0));
    Ok(samples)
}

impl Samples {
    /// Extends the list with zeros.
    fn resize(&mut self, count: usize) {
        match self {
            Self::U8(v) => v.resize(count, 0),
            Self::U16(v) => v.resize(count, 0),
            Self::I16(v) => v.resize(count, 0),
            Self::F32(v) => v.resize(count, 0.0),
        }
    }

    /// Copies a range from samples of the same type.
    fn copy(&mut self, to: usize, other: &Self, from: usize, count: usize) {
        match (self, other) {
            (Self::U8(a), Self::U8(b)) => a[to..to + count].copy_from_slice(&b[from..from + count]),
            (Self::U16(a), Self::U16(b)) => a[to..to + count].copy_from_slice(&b[from..from + count]),
            (Self::I16(a), Self::I16(b)) => a[to..to + count].copy_from_slice(&b[from..from + count]),
            (Self::F32(a), Self::F32(b)) => a[to..to + count].copy_from_slice(&b[from..from + count]),
            // Both lists have the type of the array.
            _ => {}
        }
    }
}
