//! VTK's legacy files (`.vtk`), versions 1.0 to 5.1, as text or binary.
//!
//! | data set | becomes |
//! |---|---|
//! | `STRUCTURED_POINTS` | a grid |
//! | `RECTILINEAR_GRID` | a grid; uneven coordinates are resampled |
//! | `STRUCTURED_GRID` | a grid where its points lie on an even lattice, which may be oblique; else hexahedra |
//! | `UNSTRUCTURED_GRID` | a mesh, or points where there are no solid cells but vertices |
//! | `POLYDATA` | points, if it has no lines and polygons |
//!
//! The first walk over the file finds where each array lies; what is needed is read from there. The scalars
//! of points that come first are the active array, else those of cells.
//!
//! Numbers of type `long` have 4 or 8 bytes in binary files, as the writer's machine had them: they have 4
//! where after so many there is a keyword, another array or the end of the file. `vtkIdType` has 4 always,
//! as VTK writes it.

mod stored;
mod walk;

use glam::{DMat3, DVec3};

use super::arrays::{ArrayInfo, Association, Pick};
use super::dataset::{self, Dataset, Origin};
use super::lattice::{self, Places};
use super::source::{Budget, Source};
use super::{Loaded, ReadOptions, Reader, SampleType, text};
use crate::error::{Error, Result};
use crate::io::vtk_legacy::stored::{Stored, room};
use crate::io::vtk_legacy::walk::{Cells, Contents, Kind, MAGIC, Walk};
use crate::num;
use crate::scene::Samples;

pub(super) struct VtkLegacy;

const NAME: &str = "VTK legacy";

/// How far points may lie off an even lattice, as a share of its smallest step: coordinates are often
/// float32, or printed with six digits.
const EVEN: f64 = 1e-4;

/// The type of hexahedra.
const HEXAHEDRON: u8 = 12;

/// A point that VTK's ghost array hides.
const HIDDEN_POINT: u8 = 2;

impl Reader for VtkLegacy {
    fn name(&self) -> &'static str {
        NAME
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["vtk", "vtk.gz"]
    }

    fn recognises(&self, source: &Source) -> bool {
        source.head().get(..MAGIC.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(MAGIC))
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let contents = Walk::over(source)?;
        let budget = Budget::new(source, options);
        File { source, options, budget, contents, shown: None }.read()
    }
}

/// A file that was walked over.
struct File<'a> {
    source: &'a Source,
    options: &'a ReadOptions,
    budget: Budget<'a>,
    contents: Contents,
    /// Which of the file's cells are read, where some are not.
    shown: Option<Vec<bool>>,
}

impl File<'_> {
    fn read(mut self) -> Result<Loaded> {
        let mut loaded = match self.contents.kind {
            Kind::StructuredPoints => {
                let places = self.structured_points();
                self.lattice(places)
            }
            Kind::RectilinearGrid => {
                let places = self.rectilinear()?;
                self.lattice(places)
            }
            Kind::StructuredGrid => self.structured_grid(),
            Kind::UnstructuredGrid => self.unstructured_grid(),
            Kind::PolyData => self.poly_data(),
        }?;
        // What was noted on the way comes first.
        self.contents.notes.append(&mut loaded.report.notes);
        self.contents.warnings.append(&mut loaded.report.warnings);
        loaded.report.notes = self.contents.notes;
        loaded.report.warnings = self.contents.warnings;
        Ok(loaded)
    }

    fn missing(&self, keyword: &str) -> Error {
        self.source.error(keyword, format!("missing: {} needs it", self.contents.kind.name()))
    }

    /// Numbers of samples, and how many samples and cells that makes.
    fn dims(&self) -> Result<([u32; 3], u64, u64)> {
        let dims = self.contents.dims.ok_or_else(|| self.missing("DIMENSIONS"))?;
        let [x, y, z] = dims;
        let product = |dims: [u32; 3]| dims.iter().try_fold(1_u64, |n, &d| n.checked_mul(u64::from(d)));
        let points = product(dims).ok_or_else(|| {
            self.source.error("DIMENSIONS", format!("{x} x {y} x {z}: more points than 64 bits can count"))
        })?;
        // A flat grid has cells that are flat.
        let cells = product(dims.map(|d| d.saturating_sub(1).max(1))).unwrap_or(u64::MAX);
        Ok((dims, points, cells))
    }

    fn origin(&mut self) -> (Origin<'_>, impl FnMut(usize, Pick) -> Result<Samples> + use<'_>) {
        let source = self.source;
        let stored = &self.contents.stored;
        let shown = self.shown.as_deref();
        let arrays = std::mem::take(&mut self.contents.arrays);
        let of_cells: Vec<bool> = arrays.iter().map(|a| a.association == Association::Cell).collect();
        let read = move |index: usize, pick| {
            let none = || source.error("arrays", format!("{index}: there is no such array"));
            let mut samples = stored.get(index).ok_or_else(none)?.samples(source, pick)?;
            if let Some(shown) = shown
                && of_cells.get(index) == Some(&true)
            {
                keep(&mut samples, shown);
            }
            Ok(samples)
        };
        (Origin { source, format: NAME, arrays }, read)
    }

    fn lattice(&mut self, places: Places) -> Result<Loaded> {
        let (dims, points, cells) = self.dims()?;
        self.contents.fit(self.source, points, cells)?;
        let options = self.options;
        let mut budget = Budget::new(self.source, options);
        std::mem::swap(&mut budget, &mut self.budget);
        let (origin, mut read) = self.origin();
        lattice::build(origin, dims, places, &mut budget, &mut read, options)
    }

    fn dataset(&mut self, dataset: Dataset) -> Result<Loaded> {
        let options = self.options;
        let mut budget = Budget::new(self.source, options);
        std::mem::swap(&mut budget, &mut self.budget);
        let (origin, mut read) = self.origin();
        dataset.build(origin, &mut budget, &mut read, options)
    }

    fn structured_points(&mut self) -> Places {
        let contents = &mut self.contents;
        for (given, keyword, value) in
            [(contents.spacing.is_some(), "SPACING", "1"), (contents.origin.is_some(), "ORIGIN", "0")]
        {
            if !given {
                contents.warnings.push(format!("{keyword} is missing: {value} is taken"));
            }
        }
        let spacing = DVec3::from_array(contents.spacing.unwrap_or([1.0; 3]));
        let rows =
            contents.direction.map_or(DMat3::IDENTITY, |rows| DMat3::from_cols_array(&rows).transpose());
        let origin = DVec3::from_array(contents.origin.unwrap_or([0.0; 3]));
        let (places, notes) = Places::even(origin, spacing, rows, DVec3::from_array(contents.first));
        contents.notes.extend(notes);
        places
    }

    fn rectilinear(&mut self) -> Result<Places> {
        let mut lists = [const { Vec::new() }; 3];
        let keywords = ["X_COORDINATES", "Y_COORDINATES", "Z_COORDINATES"];
        let (dims, ..) = self.dims()?;
        for (axis, list) in lists.iter_mut().enumerate() {
            let stored = self.contents.coordinates[axis].ok_or_else(|| self.missing(keywords[axis]))?;
            if stored.tuples != u64::from(dims[axis]) {
                let rule = format!("{}: DIMENSIONS has {}", stored.tuples, dims[axis]);
                return Err(self.source.error(keywords[axis], rule));
            }
            self.budget.take(keywords[axis], stored.tuples.saturating_mul(8))?;
            *list = stored.coordinates(self.source)?;
        }
        Ok(Places::Listed(lists))
    }

    fn structured_grid(&mut self) -> Result<Loaded> {
        let source = self.source;
        let (dims, count, cells) = self.dims()?;
        let [x, y, z] = dims;
        let points = self.contents.points.ok_or_else(|| self.missing("POINTS"))?;
        if points.tuples != count {
            let rule = format!("{}: {x} x {y} x {z} are needed", points.tuples);
            return Err(source.error("POINTS", rule));
        }
        if let Some(extent) = dims.iter().find(|&&extent| extent < 2) {
            let rule = format!("{x} x {y} x {z} has {extent}: every extent must be at least 2");
            return Err(source.error("DIMENSIONS", rule));
        }
        if let Some(places) = even(source, &points, dims)? {
            self.contents.notes.push("the structured grid's points lie on an even lattice".to_owned());
            return self.lattice(places);
        }
        self.contents.fit(source, count, cells)?;
        let number = text::index(source, "POINTS", count)?;
        let nodes = cells.saturating_mul(8);
        self.budget.take("POINTS", dataset::bytes(count, cells, nodes))?;
        let hidden = self.hidden_points(count)?;
        let mut dataset = Dataset {
            points: points.points(source)?,
            types: room(source, "DIMENSIONS", cells)?,
            ends: room(source, "DIMENSIONS", cells)?,
            nodes: room(source, "DIMENSIONS", nodes)?,
        };
        let mut all_shown = Vec::new();
        if !hidden.is_empty() {
            self.budget.take("DIMENSIONS", cells)?;
            all_shown = room(source, "DIMENSIONS", cells)?;
        }
        let (row, layer) = (x, x * y);
        debug_assert!(num::index(layer) <= number, "a layer of the points that are there");
        for k in 0..z - 1 {
            for j in 0..y - 1 {
                for i in 0..x - 1 {
                    let base = i + row * j + layer * k;
                    let around = |base: u32| [base, base + 1, base + 1 + row, base + row];
                    let [bottom, top] = [around(base), around(base + layer)];
                    let own = bottom.into_iter().chain(top);
                    let is_hidden = |node: u32| hidden.get(num::index(node)).is_some_and(|&hidden| hidden);
                    if !hidden.is_empty() {
                        let shown = !own.clone().any(is_hidden);
                        all_shown.push(shown);
                        if !shown {
                            continue;
                        }
                    }
                    dataset.types.push(HEXAHEDRON);
                    dataset.nodes.extend(own);
                    dataset.ends.push(num::count(dataset.nodes.len()));
                }
            }
        }
        self.contents.notes.push("the structured grid is curved: it is read as hexahedra".to_owned());
        if !hidden.is_empty() {
            let count = all_shown.iter().filter(|shown| !**shown).count();
            self.contents.notes.push(format!("{count} hexahedra with a hidden point left out"));
            if dataset.types.is_empty() {
                return Err(source.error("POINTS", "every hexahedron of the grid has a hidden point"));
            }
            self.shown = Some(all_shown);
        }
        self.dataset(dataset)
    }

    /// The points of a grid that are hidden; empty where none is.
    fn hidden_points(&mut self, count: u64) -> Result<Vec<bool>> {
        let is_ghosts = |array: &ArrayInfo| {
            array.association == Association::Point
                && array.name == "vtkGhostType"
                && array.components == 1
                && array.kind == SampleType::U8
        };
        let Some(index) = self.contents.arrays.iter().position(is_ghosts) else { return Ok(Vec::new()) };
        self.budget.take("vtkGhostType", count.saturating_mul(2))?;
        let Samples::U8(flags) = self.contents.stored[index].samples(self.source, Pick::Component(0))? else {
            return Ok(Vec::new());
        };
        Ok(flags.into_iter().map(|flag| flag & HIDDEN_POINT != 0).collect())
    }

    fn unstructured_grid(&mut self) -> Result<Loaded> {
        let source = self.source;
        let points = self.contents.points.ok_or_else(|| self.missing("POINTS"))?;
        let (cells, types) = (self.contents.cells, self.contents.types);
        let count = cells.map_or(0, |cells| cells.count());
        match types {
            Some(types) if types.tuples != count => {
                return Err(
                    types.error(source, format!("CELL_TYPES {}: there are {count} cells", types.tuples))
                );
            }
            None if count > 0 => return Err(self.missing("CELL_TYPES")),
            _ => {}
        }
        self.contents.fit(source, points.tuples, count)?;
        let numbers = match cells {
            None => 0,
            Some(Cells::Inline { numbers, .. }) => numbers.tuples.saturating_sub(count),
            Some(Cells::Offsets { nodes, .. }) => nodes.tuples,
        };
        self.budget.take("POINTS", dataset::bytes(points.tuples, count, numbers))?;
        let mut dataset = Dataset { points: points.points(source)?, ..Dataset::default() };
        match cells {
            None => {}
            Some(Cells::Inline { numbers, .. }) => inline(source, &numbers, count, &mut dataset)?,
            Some(Cells::Offsets { offsets, nodes }) => separate(source, &offsets, &nodes, &mut dataset)?,
        }
        if let Some(types) = types {
            dataset.types = types.room(source)?;
            types.indices(source, &mut |piece| {
                for &number in piece {
                    let number = u8::try_from(number).map_err(|_| {
                        types.error(source, format!("cell type {number}: must be from 0 to 255"))
                    })?;
                    dataset.types.push(number);
                }
                Ok(())
            })?;
        }
        self.dataset(dataset)
    }

    fn poly_data(&mut self) -> Result<Loaded> {
        let source = self.source;
        let points = self.contents.points.ok_or_else(|| self.missing("POINTS"))?;
        let counts = self.contents.surface.map(|count| count.unwrap_or(0));
        let all = counts.iter().fold(0_u64, |all, &count| all.saturating_add(count));
        self.contents.fit(source, points.tuples, all)?;
        // Nodes do not matter: vertices are the points, and whatever else there is has no volume.
        let counts = [2, 4, 7, 6].into_iter().zip(counts).filter(|&(_, count)| count > 0).collect();
        dataset::check_points(source, &counts)?;
        self.budget.take("POINTS", dataset::bytes(points.tuples, 0, 0))?;
        let points = points.points(source)?;
        let options = self.options;
        let mut budget = self.budget.clone();
        let (origin, mut read) = self.origin();
        dataset::points(points, origin, &mut budget, &mut read, options)
    }
}

/// Keeps what is marked.
fn keep(samples: &mut Samples, marked: &[bool]) {
    fn retain<T>(list: &mut Vec<T>, marked: &[bool]) {
        let mut marks = marked.iter();
        list.retain(|_| marks.next() == Some(&true));
    }
    match samples {
        Samples::U8(list) => retain(list, marked),
        Samples::U16(list) => retain(list, marked),
        Samples::I16(list) => retain(list, marked),
        Samples::F32(list) => retain(list, marked),
    }
}

/// The even lattice that points lie on, if they do.
fn even(source: &Source, points: &Stored, dims: [u32; 3]) -> Result<Option<Places>> {
    let [x, y, z] = dims.map(u64::from);
    let corners = [0, x - 1, x * (y - 1), x * y * (z - 1)];
    let mut found = [DVec3::NAN; 4];
    let mut at = 0;
    points.each_point(source, &mut |point| {
        if let Some(corner) = corners.iter().position(|&corner| corner == at) {
            found[corner] = point;
        }
        at += 1;
        at <= corners[3]
    })?;
    let [origin, i, j, k] = found;
    let [nx, ny, nz] = dims.map(|extent| f64::from(extent) - 1.0);
    let steps = [(i - origin) / nx, (j - origin) / ny, (k - origin) / nz];
    let lengths = DVec3::from_array(steps.map(DVec3::length));
    let [u, v, w] = steps;
    let direction = DMat3::from_cols(u / lengths.x, v / lengths.y, w / lengths.z);
    // Nearly flat cells would make an unusable grid; what is no number compares as false.
    if !(direction.is_finite() && origin.is_finite() && direction.determinant().abs() > 1e-6) {
        return Ok(None);
    }
    let most = EVEN * lengths.min_element();
    let mut index = [0_u32; 3];
    let mut fits = true;
    points.each_point(source, &mut |point| {
        let [a, b, c] = index.map(f64::from);
        fits = point.distance(origin + u * a + v * b + w * c) <= most;
        index[0] += 1;
        for axis in 0..2 {
            if index[axis] == dims[axis] {
                index[axis] = 0;
                index[axis + 1] += 1;
            }
        }
        fits
    })?;
    Ok(fits.then_some(Places::Even { origin, spacing: lengths, direction }))
}

/// Reads cells with their numbers of nodes before their nodes.
fn inline(source: &Source, numbers: &Stored, count: u64, dataset: &mut Dataset) -> Result<()> {
    let wrong = |rule: String| numbers.error(source, rule);
    let nodes = numbers.tuples.saturating_sub(count);
    dataset.ends = room(source, "CELLS", count)?;
    dataset.nodes = room(source, "CELLS", nodes)?;
    // Room was made for so many, so that lists never grow.
    let most = text::index(source, "CELLS", count)?;
    let mut left = 0;
    numbers.indices(source, &mut |piece| {
        for &number in piece {
            if left > 0 {
                dataset.nodes.push(number);
                left -= 1;
            } else if dataset.ends.len() == most {
                return Err(wrong(format!("{count} cells have fewer than {} numbers", numbers.tuples)));
            } else {
                left = number;
                let end = u64::from(num::count(dataset.nodes.len())) + u64::from(number);
                if end > nodes {
                    let cell = dataset.ends.len();
                    return Err(wrong(format!("cell {cell}: {number} nodes, fewer are left")));
                }
                dataset.ends.push(u32::try_from(end).unwrap_or(u32::MAX));
            }
        }
        Ok(())
    })?;
    if dataset.ends.len() != most {
        return Err(wrong(format!("{} cells, {count} are announced", dataset.ends.len())));
    }
    Ok(())
}

/// Reads cells whose nodes are listed apart.
fn separate(source: &Source, offsets: &Stored, nodes: &Stored, dataset: &mut Dataset) -> Result<()> {
    dataset.ends = offsets.room(source)?;
    let mut first = true;
    offsets.indices(source, &mut |piece| {
        let mut piece = piece;
        if first && let Some((&begin, rest)) = piece.split_first() {
            if begin != 0 {
                return Err(offsets.error(source, format!("the first offset is {begin}: must be 0")));
            }
            first = false;
            piece = rest;
        }
        dataset.ends.extend_from_slice(piece);
        Ok(())
    })?;
    dataset.nodes = nodes.room(source)?;
    nodes.indices(source, &mut |piece| {
        dataset.nodes.extend_from_slice(piece);
        Ok(())
    })
}
