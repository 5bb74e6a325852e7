//! VTK's XML files: image data (`.vti`), rectilinear grids (`.vtr`) and unstructured grids (`.vtu`), of
//! versions 0 to 2, with data as text, in base64 or appended, bare or compressed by zlib, LZ4 or xz.
//!
//! Pieces are put together: those of grids by their extents, those of unstructured grids one after the other.
//! The origin of an image is the place of index 0, also where its extent begins elsewhere. A negative spacing
//! turns the axis round. Field data is passed over.

use std::collections::{HashMap, HashSet};
use std::io::Read;

use glam::{DMat3, DVec3};

use super::arrays::{ArrayInfo, Association, Pick};
use super::dataset::{self, Dataset, Origin};
use super::lattice::{self, Places};
use super::samples::{self, Endian, Layout, SampleType};
use super::source::{Budget, Source};
use super::text::{index, shown};
use super::vtk_blocks::Store;
use super::vtk_document::{Array, Document, Extent, Kind, Piece, Section};
use super::{Loaded, ReadOptions, Reader};
use crate::error::Result;
use crate::num;
use crate::scene::Samples;

pub(super) struct VtkXml;

/// Most notes about arrays.
const MOST_NOTES: usize = 16;

/// Numbers that are taken from a stream at a time, where they change their type.
const CHUNK: usize = 3 << 13;

impl Reader for VtkXml {
    fn name(&self) -> &'static str {
        "VTK XML"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["vti", "vtu", "vtr"]
    }

    fn recognises(&self, source: &Source) -> bool {
        let head = source.head();
        let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
        head.starts_with(b"<") && head.windows(8).any(|window| window == b"<VTKFile")
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let mut budget = Budget::new(source, options);
        let mut document = Document::read(source, &mut budget)?;
        let fields = Fields::of(source, &document)?;
        fields.check(source, options)?;
        let warnings = std::mem::take(&mut document.warnings);
        let mut notes = fields.notes;
        let mut file = File {
            source,
            store: Store::new(source, document.storage, budget.clone()),
            document,
            arrays: fields.arrays,
            budget,
            notes: Vec::new(),
        };
        let format = self.name();
        let mut loaded = match file.document.kind {
            Kind::Image | Kind::Rectilinear => file.lattice(format, options),
            Kind::Unstructured => file.cells(format, options),
        }?;
        notes.append(&mut file.notes);
        notes.append(&mut loaded.report.notes);
        loaded.report.notes = notes;
        loaded.report.warnings.splice(0..0, warnings);
        Ok(loaded)
    }
}

/// Points of a piece along each axis; 0 where it is empty.
fn counts(extent: Extent) -> [u64; 3] {
    extent.map(|[first, last]| u64::try_from(last - first + 1).unwrap_or(0))
}

/// Tuples of point data or cell data in a piece, and along which extents.
fn tuples(kind: Kind, piece: &Piece, association: Association) -> u64 {
    match (kind, association) {
        (Kind::Unstructured, Association::Point) => piece.points,
        (Kind::Unstructured, Association::Cell) => piece.cells,
        _ => shape(piece.extent, association).into_iter().fold(1, u64::saturating_mul),
    }
}

/// Samples along each axis of an extent.
fn shape(extent: Extent, association: Association) -> [u64; 3] {
    let points = counts(extent);
    match association {
        Association::Point => points,
        Association::Cell => points.map(|count| count.saturating_sub(1)),
    }
}

fn section(association: Association) -> Section {
    match association {
        Association::Point => Section::PointData,
        Association::Cell => Section::CellData,
    }
}

/// The arrays that can be shown.
struct Fields {
    arrays: Vec<ArrayInfo>,
    /// Those that cannot, and why.
    skipped: Vec<(Association, String, String)>,
    notes: Vec<String>,
}

impl Fields {
    fn of(source: &Source, document: &Document) -> Result<Self> {
        if document.pieces.is_empty() {
            return Err(source.error("pieces", "none: the data set is empty"));
        }
        let mut fields = Self { arrays: Vec::new(), skipped: Vec::new(), notes: Vec::new() };
        for association in [Association::Point, Association::Cell] {
            fields.add(document, association);
        }
        // Scalars of points or cells come before vectors of either.
        let marks = document.pieces.first().map(|piece| &piece.active);
        for kind in 0..2 {
            for array in &mut fields.arrays {
                let place = usize::from(array.association == Association::Cell);
                array.active = marks
                    .and_then(|marks| marks[place][kind].as_ref())
                    .is_some_and(|name| *name == array.name);
            }
            if fields.arrays.iter().any(|array| array.active) {
                break;
            }
        }
        for (association, name, why) in fields.skipped.iter().take(MOST_NOTES) {
            fields.notes.push(format!("{}:{} left out: {why}", association.name(), shown(name)));
        }
        if fields.skipped.len() > MOST_NOTES {
            fields.notes.push(format!("{} more arrays left out", fields.skipped.len() - MOST_NOTES));
        }
        Ok(fields)
    }

    /// The arrays that all pieces with points, or cells, have.
    fn add(&mut self, document: &Document, association: Association) {
        let section = section(association);
        let pieces: Vec<&Piece> =
            document.pieces.iter().filter(|piece| tuples(document.kind, piece, association) > 0).collect();
        let mut found: HashMap<&str, (&Array, usize)> = HashMap::new();
        let mut order: Vec<&Array> = Vec::new();
        for (number, piece) in pieces.iter().enumerate() {
            let mut own: HashSet<&str> = HashSet::new();
            for array in piece.arrays(section) {
                let name = array.name.as_str();
                if !own.insert(name) {
                    self.skip(association, name, "another array has the same name");
                    continue;
                }
                match found.get_mut(name) {
                    Some((like, count)) if *count == number => {
                        if like.kind == array.kind && like.components == array.components {
                            *count += 1;
                        }
                    }
                    Some(_) => {}
                    None => {
                        found.insert(name, (array, usize::from(number == 0)));
                        order.push(array);
                    }
                }
            }
        }
        for array in order {
            let name = array.name.as_str();
            let everywhere = found.get(name).is_some_and(|(_, count)| *count == pieces.len());
            match &array.kind {
                _ if !everywhere => {
                    self.skip(association, name, "not all pieces have it, or not of the same type");
                }
                Err(why) => self.skip(association, name, why),
                Ok(kind) => self.arrays.push(ArrayInfo {
                    name: name.to_owned(),
                    association,
                    kind: *kind,
                    components: array.components,
                    active: false,
                }),
            }
        }
    }

    fn skip(&mut self, association: Association, name: &str, why: &str) {
        self.skipped.push((association, name.to_owned(), why.to_owned()));
    }

    /// Whether arrays are asked for that cannot be read.
    fn check(&self, source: &Source, options: &ReadOptions) -> Result<()> {
        let wanted = [&options.array, &options.radius, &options.covariance, &options.weight];
        for wanted in wanted.into_iter().flatten() {
            let (prefix, name) = [Association::Point, Association::Cell]
                .into_iter()
                .find_map(|a| Some((Some(a), wanted.strip_prefix(a.name())?.strip_prefix(':')?)))
                .unwrap_or((None, wanted));
            let asked = |association: Association, own: &str| {
                own == wanted || own == name && prefix.is_none_or(|prefix| prefix == association)
            };
            if self.arrays.iter().any(|array| asked(array.association, &array.name)) {
                continue;
            }
            if let Some((_, _, why)) = self.skipped.iter().find(|(a, own, _)| asked(*a, own)) {
                return Err(
                    source.error(format!("array \"{}\"", shown(wanted)), format!("cannot be read: {why}"))
                );
            }
        }
        Ok(())
    }
}

/// A file, while its arrays are read.
struct File<'a> {
    source: &'a Source,
    document: Document,
    store: Store<'a>,
    arrays: Vec<ArrayInfo>,
    budget: Budget<'a>,
    notes: Vec<String>,
}

/// Reads one number of each tuple of an array in a piece.
fn append(
    store: &mut Store,
    array: &Array,
    count: u64,
    pick: Pick,
    samples: &mut Samples,
    source: &Source,
) -> Result<()> {
    let tuples = index(source, &array.at(), count)?;
    let numbers = numbers(source, array, count, array.components)?;
    store.take(array, numbers, &mut |reader, kind, endian| {
        let layout = Layout { dims: [0; 3], kind, endian, components: array.components, pick };
        samples::append(reader, tuples, &layout, samples)
    })
}

/// Numbers in so many tuples.
fn numbers(source: &Source, array: &Array, count: u64, components: usize) -> Result<u64> {
    u64::try_from(components)
        .ok()
        .and_then(|components| count.checked_mul(components))
        .ok_or_else(|| source.error(array.at(), format!("{count} tuples: more than memory can address")))
}

/// Appends so many numbers from a stream to a list.
type Fill<T> = fn(&mut dyn Read, usize, SampleType, Endian, &mut Vec<T>) -> std::io::Result<()>;

/// Hands numbers out in chunks.
fn in_chunks<T>(
    reader: &mut dyn Read,
    count: usize,
    kind: SampleType,
    endian: Endian,
    fill: Fill<T>,
    chunk: &mut dyn FnMut(&[T]) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let mut list = Vec::new();
    let mut left = count;
    while left > 0 {
        let take = left.min(CHUNK);
        list.clear();
        fill(reader, take, kind, endian, &mut list)?;
        chunk(&list)?;
        left -= take;
    }
    Ok(())
}

/// An array that a piece must have, of so many components.
fn part<'d>(
    source: &Source,
    piece: &'d Piece,
    section: Section,
    name: Option<&str>,
    components: usize,
) -> Result<&'d Array> {
    let found = match name {
        Some(name) => piece.array(section, name),
        None => piece.arrays(section).next(),
    };
    let place = || format!("line {}, Piece", piece.line);
    let array = found.ok_or_else(|| {
        source.error(place(), format!("no array of {}", name.map_or("Points", |name| name)))
    })?;
    if array.components != components {
        let rule = format!("{} components: must be {components}", array.components);
        return Err(source.error(array.at(), rule));
    }
    Ok(array)
}

/// An error that goes through a stream.
fn wrong(rule: String) -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::InvalidData, rule)
}

impl File<'_> {
    /// Cells, or points.
    fn cells(&mut self, format: &'static str, options: &ReadOptions) -> Result<Loaded> {
        let source = self.source;
        let Document { pieces, kind, .. } = &self.document;
        let sum = |count: fn(&Piece) -> u64| pieces.iter().map(count).fold(0, u64::saturating_add);
        let (points, cells) = (sum(|piece| piece.points), sum(|piece| piece.cells));
        index(source, "NumberOfPoints", points)?;
        index(source, "NumberOfCells", cells)?;
        self.budget.take("points and cells", dataset::bytes(points, cells, 0))?;
        let mut data = Dataset::default();

        for piece in pieces.iter().filter(|piece| piece.points > 0) {
            let array = part(source, piece, Section::Points, None, 3)?;
            let count = numbers(source, array, piece.points, 3)?;
            let list = &mut data.points;
            self.store.take(array, count, &mut |reader, kind, endian| {
                let count = usize::try_from(count).unwrap_or(usize::MAX);
                list.try_reserve_exact(count / 3).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
                in_chunks(reader, count, kind, endian, samples::append_f64, &mut |chunk| {
                    list.extend(chunk.as_chunks::<3>().0.iter().map(|&point| DVec3::from_array(point)));
                    Ok(())
                })
            })?;
        }

        // Where the nodes of each piece end. Those that are text say nowhere else how many they are.
        let mut ends: Vec<u64> = Vec::new();
        let mut nodes = 0_u64;
        for piece in pieces.iter().filter(|piece| piece.cells > 0) {
            let array = part(source, piece, Section::Cells, Some("offsets"), 1)?;
            let list = &mut data.ends;
            let count = index(source, &array.at(), piece.cells)?;
            let mut last = 0;
            self.store.take(array, piece.cells, &mut |reader, kind, endian| {
                list.try_reserve_exact(count).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
                in_chunks(reader, count, kind, endian, samples::append_indices, &mut |chunk| {
                    for &end in chunk {
                        last = end;
                        let end = nodes.checked_add(u64::from(end)).and_then(|end| u32::try_from(end).ok());
                        list.push(end.ok_or_else(|| wrong("more nodes than 32 bits can count".to_owned()))?);
                    }
                    Ok(())
                })
            })?;
            nodes = nodes.saturating_add(u64::from(last));
            ends.push(u64::from(last));
        }
        self.budget.take("nodes of cells", dataset::bytes(0, 0, nodes))?;

        let mut before = 0_u64;
        let mut ends = ends.into_iter();
        for piece in pieces {
            if piece.cells > 0 {
                let array = part(source, piece, Section::Cells, Some("connectivity"), 1)?;
                let count = ends.next().unwrap_or_default();
                let list = &mut data.nodes;
                self.store.take(array, count, &mut |reader, kind, endian| {
                    let count = usize::try_from(count).unwrap_or(usize::MAX);
                    list.try_reserve_exact(count).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
                    in_chunks(reader, count, kind, endian, samples::append_indices, &mut |chunk| {
                        for &node in chunk {
                            if u64::from(node) >= piece.points {
                                return Err(wrong(format!(
                                    "node {node}: the piece has {} points",
                                    piece.points
                                )));
                            }
                            let node = u32::try_from(before + u64::from(node));
                            list.push(
                                node.map_err(|_| wrong("more points than 32 bits can count".to_owned()))?,
                            );
                        }
                        Ok(())
                    })
                })?;
            }
            before = before.saturating_add(piece.points);
        }

        for piece in pieces.iter().filter(|piece| piece.cells > 0) {
            let array = part(source, piece, Section::Cells, Some("types"), 1)?;
            let count = index(source, &array.at(), piece.cells)?;
            let list = &mut data.types;
            self.store.take(array, piece.cells, &mut |reader, kind, endian| {
                list.try_reserve_exact(count).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
                in_chunks(reader, count, kind, endian, samples::append_indices, &mut |chunk| {
                    for &number in chunk {
                        list.push(
                            u8::try_from(number)
                                .map_err(|_| wrong(format!("{number}: no type of a cell")))?,
                        );
                    }
                    Ok(())
                })
            })?;
        }

        let full = pieces.iter().filter(|piece| piece.points > 0).count();
        if full > 1 {
            self.notes.push(format!("{full} pieces were put together"));
        }
        let arrays = self.arrays.clone();
        let origin = Origin { source, format, arrays: arrays.clone() };
        let store = &mut self.store;
        data.build(
            origin,
            &mut self.budget,
            &mut |index, pick| {
                let ArrayInfo { name, association, kind: number, .. } = &arrays[index];
                let mut samples = Samples::none(*number, pick);
                for piece in pieces {
                    let count = tuples(*kind, piece, *association);
                    if let Some(array) = piece.array(section(*association), name).filter(|_| count > 0) {
                        append(store, array, count, pick, &mut samples, source)?;
                    }
                }
                Ok(samples)
            },
            options,
        )
    }

    /// A grid.
    fn lattice(&mut self, format: &'static str, options: &ReadOptions) -> Result<Loaded> {
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
        // Pieces share points: one cell each, they have eight times as many as the whole.
        if sum > points(extent).saturating_mul(8) {
            let rule = format!("they overlap: {sum} points in all, {} in {}", points(extent), words(extent));
            return Err(source.error("pieces", rule));
        }
        let mut dims = [0; 3];
        for (dim, count) in dims.iter_mut().zip(counts(extent)) {
            *dim = num::count(index(source, "WholeExtent", count)?);
        }
        if pieces.len() > 1 {
            self.notes.push(format!("{} pieces were put together", pieces.len()));
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

/// An index as a coordinate. Extents are 32-bit numbers: exact.
fn f64_of(index: i64) -> f64 {
    i32::try_from(index).map_or(f64::NAN, f64::from)
}

/// An extent as files write it.
fn words(extent: Extent) -> String {
    let [[a, b], [c, d], [e, f]] = extent;
    format!("{a} {b} {c} {d} {e} {f}")
}

/// Coordinates of the points along each axis.
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
            // Its own and the whole list.
            let bytes = own.saturating_mul(8);
            budget.take(&array.at(), bytes)?;
            let mut list = Vec::new();
            store.take(array, own, &mut |reader, kind, endian| {
                let count = usize::try_from(own).unwrap_or(usize::MAX);
                samples::append_f64(reader, count, kind, endian, &mut list)
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

/// One number of each tuple of an array, of all pieces.
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
    // All arrays must be able to hold their share before the whole is made.
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
    // The whole has been taken from the budget; which of it is there takes a byte each.
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
    /// Fills up with zeros.
    fn resize(&mut self, count: usize) {
        match self {
            Self::U8(v) => v.resize(count, 0),
            Self::U16(v) => v.resize(count, 0),
            Self::I16(v) => v.resize(count, 0),
            Self::F32(v) => v.resize(count, 0.0),
        }
    }

    /// Copies from samples of the same type.
    fn copy(&mut self, to: usize, other: &Self, from: usize, count: usize) {
        match (self, other) {
            (Self::U8(a), Self::U8(b)) => a[to..to + count].copy_from_slice(&b[from..from + count]),
            (Self::U16(a), Self::U16(b)) => a[to..to + count].copy_from_slice(&b[from..from + count]),
            (Self::I16(a), Self::I16(b)) => a[to..to + count].copy_from_slice(&b[from..from + count]),
            (Self::F32(a), Self::F32(b)) => a[to..to + count].copy_from_slice(&b[from..from + count]),
            // Both are of the array's type.
            _ => {}
        }
    }
}
