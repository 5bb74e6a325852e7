//! Image data and rectilinear grids: pieces joined by their extents.

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association, Choice, choose};
use crate::io::build::lattice::{self, Places};
use crate::io::build::origin::Origin;
use crate::io::file::budget::Budget;
use crate::io::file::decode::{self, Values};
use crate::io::file::sample_type::Pick;
use crate::io::file::text::index;
use crate::io::formats::vtk_xml::document::{Document, Extent, Kind, Piece, Section, shape, volume, words};
use crate::io::formats::vtk_xml::store::Store;
use crate::io::formats::vtk_xml::{File, VtkXml};
use crate::io::options::{Request, Wanted};
use crate::io::reader::Reader as _;
use crate::io::report::Found;
use crate::num;
use crate::scene::Samples;

impl File<'_> {
    /// Reads image data or a rectilinear grid.
    pub(crate) fn lattice(&mut self, request: &Request) -> Result<Found> {
        let source = self.source;
        let Document { whole, origin, spacing, direction, kind, .. } = self.document;
        let pieces: Vec<&Piece> = self.document.pieces.iter().filter(|piece| piece.points > 0).collect();
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
        if extent != whole {
            let warning = format!("pieces cover {} of the whole extent {}", words(extent), words(whole));
            self.document.warnings.push(warning);
        }
        let points = volume(extent, Association::Point);
        let sum = pieces.iter().map(|piece| piece.points).fold(0, u64::saturating_add);
        // Pieces share points: with one cell each, they have up to eight times the points of the whole.
        if sum > points.saturating_mul(8) {
            let rule = format!("they overlap: {sum} points in all, {points} in {}", words(extent));
            return Err(source.error("pieces", rule));
        }
        let mut dims = [0; 3];
        for (dim, count) in dims.iter_mut().zip(shape(extent, Association::Point)) {
            *dim = num::count(index(source, "WholeExtent", count)?);
        }
        if pieces.len() > 1 {
            self.notes.push(format!("{} pieces were joined", pieces.len()));
        }

        let places = if kind == Kind::Image {
            let first = extent.map(|[first, _]| i32::try_from(first).map_or(f64::NAN, f64::from));
            Places::even(origin, spacing, &direction, first, &mut self.notes)
        } else {
            Places::Listed(coordinates(&mut self.store, &mut self.budget, &pieces, extent)?)
        };

        let arrays = self.arrays.clone();
        let in_file = if kind == Kind::Image {
            in_file(&mut self.store, &arrays, request, &pieces, dims)?
        } else {
            None
        };
        let (store, mut scratch) = (&mut self.store, self.budget.clone());
        let mut read =
            |index: usize, pick| samples_of(store, &mut scratch, &pieces, extent, &arrays[index], pick);
        let (arrays, budget, read) = (arrays.clone(), &mut self.budget, &mut read);
        let origin = Origin { source, format: VtkXml.name(), arrays, spare: 0..0, request, budget, read };
        lattice::build(origin, dims, places, in_file)
    }
}

/// Returns the samples of the array that is shown, on so many points along each axis, where they stay in the file.
fn in_file(
    store: &mut Store,
    arrays: &[ArrayInfo],
    request: &Request,
    pieces: &[&Piece],
    points: [u32; 3],
) -> Result<Option<Samples>> {
    let ([piece], Wanted::Scene) = (pieces, request.wanted) else { return Ok(None) };
    let Some(Choice { index, pick }) = choose(store.source, arrays, request.array.as_deref())? else {
        return Ok(None);
    };
    let info = &arrays[index];
    let dims = match info.association {
        Association::Point => points,
        Association::Cell => points.map(|extent| extent.saturating_sub(1)),
    };
    // Hidden samples become NaN, which takes all of them.
    let hides = arrays.iter().any(|array| array.is_ghosts(info.association));
    if hides || dims.iter().any(|&extent| extent < 2) {
        return Ok(None);
    }
    store.in_file(piece, info, pick, dims, request.options)
}

/// Reads the coordinates along each axis and joins those of the pieces.
fn coordinates(
    store: &mut Store,
    budget: &mut Budget,
    pieces: &[&Piece],
    extent: Extent,
) -> Result<[Vec<f64>; 3]> {
    let source = store.source;
    let mut all = [const { Vec::new() }; 3];
    for (axis, (all, letter)) in all.iter_mut().zip(['x', 'y', 'z']).enumerate() {
        let count = shape(extent, Association::Point)[axis];
        for (number, piece) in pieces.iter().enumerate() {
            let Some(array) = piece.arrays(Section::Coordinates).nth(axis) else {
                let rule = format!("no coordinates along {letter}");
                return Err(source.error(format!("line {}, Piece", piece.line), rule));
            };
            if array.components != 1 {
                let rule = format!("{} components: coordinates have 1", array.components);
                return Err(source.error(array.at(), rule));
            }
            let own = shape(piece.extent, Association::Point)[axis];
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
                    let rule = format!("{own}: another piece has {all} along {letter} here");
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
    store: &mut Store,
    budget: &mut Budget,
    pieces: &[&Piece],
    extent: Extent,
    info: &ArrayInfo,
    pick: Pick,
) -> Result<Values> {
    let (source, association) = (store.source, info.association);
    let mut samples = Values::none(info.kind, info.components, pick);
    if let [piece] = pieces {
        store.values(piece, info, pick, &mut samples)?;
        return Ok(samples);
    }
    // All pieces are checked before the whole is allocated.
    pieces.iter().try_for_each(|piece| store.check_samples(piece, info))?;
    let place = format!("array {info}");
    let unaddressable = |_| source.error(&place, "more samples than memory can address");
    let count = usize::try_from(volume(extent, association)).map_err(unaddressable)?;
    // The memory of the whole has been taken; the record of filled samples takes a byte each.
    budget.take(&place, num::wide(count))?;
    let full = |_| source.error(&place, "memory is full");
    samples.reserve(count).map_err(full)?;
    samples.resize(count);
    let mut there: Vec<bool> = Vec::new();
    there.try_reserve_exact(count).map_err(full)?;
    there.resize(count, false);
    let shape = |extent: Extent| shape(extent, association).map(|n| usize::try_from(n).unwrap_or(0));
    let dims = shape(extent);
    for piece in pieces {
        let bytes = piece.tuples(association).saturating_mul(pick.bytes(info.kind, info.components).max(4));
        budget.take(&place, bytes)?;
        let mut share = Values::none(info.kind, info.components, pick);
        store.values(piece, info, pick, &mut share)?;
        let own = if share.len() == 0 { [0; 3] } else { shape(piece.extent) };
        let at = [0, 1, 2].map(|i| usize::try_from(piece.extent[i][0] - extent[i][0]).unwrap_or(0));
        for row in 0..own[1] * own[2] {
            let (y, z) = (row % own[1], row / own[1]);
            let to = at[0] + dims[0] * (at[1] + y + dims[1] * (at[2] + z));
            samples.copy(to, &share, row * own[0], own[0]);
            there[to..to + own[0]].fill(true);
        }
        budget.put_back(bytes);
    }
    if let Some(gap) = there.iter().position(|there| !there) {
        let at = [gap % dims[0], gap / dims[0] % dims[1], gap / dims[0] / dims[1]];
        let [x, y, z] = [0, 1, 2].map(|i: usize| i64::try_from(at[i]).unwrap_or(0) + extent[i][0]);
        let rule = format!("no piece has the {} with index {x} {y} {z}", association.name());
        return Err(source.error(&place, rule));
    }
    budget.put_back(num::wide(count));
    Ok(samples)
}
