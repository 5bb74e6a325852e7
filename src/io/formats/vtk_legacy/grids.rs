//! Structured points, rectilinear and structured grids.

use glam::{DMat3, DVec3};

use crate::error::Result;
use crate::io::build::arrays::Association;
use crate::io::build::dataset::{self, Dataset};
use crate::io::build::lattice::Places;
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::vtk_legacy::File;
use crate::io::formats::vtk_legacy::stored::{Stored, room};
use crate::io::report::Found;
use crate::num;
use crate::scene::Samples;

/// The distance that points may lie off an even lattice, relative to its smallest step: coordinates are often
/// float32, or printed with six digits.
const EVEN: f64 = 1e-4;

/// The VTK type of hexahedra.
const HEXAHEDRON: u8 = 12;

/// VTK's flag of hidden points.
const HIDDEN_POINT: u8 = 2;

impl File<'_> {
    pub(crate) fn structured_points(&mut self) -> Places {
        let contents = &mut self.contents;
        for (given, keyword, value) in
            [(contents.spacing.is_some(), "SPACING", "1"), (contents.origin.is_some(), "ORIGIN", "0")]
        {
            if !given {
                contents.warnings.push(format!("{keyword} is missing: {value} is taken"));
            }
        }
        let direction = contents.direction.unwrap_or(DMat3::IDENTITY.to_cols_array());
        let (origin, spacing) = (contents.origin.unwrap_or([0.0; 3]), contents.spacing.unwrap_or([1.0; 3]));
        Places::even(origin, spacing, &direction, contents.first, &mut contents.notes)
    }

    pub(crate) fn rectilinear(&mut self) -> Result<Places> {
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

    pub(crate) fn structured_grid(&mut self) -> Result<Found> {
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

    /// Returns whether each point is hidden; empty if the file has no ghost array.
    fn hidden_points(&mut self, count: u64) -> Result<Vec<bool>> {
        let mut arrays = self.contents.arrays.iter();
        let ghosts = arrays.find(|(array, _)| array.is_ghosts(Association::Point));
        let Some((_, ghosts)) = ghosts else { return Ok(Vec::new()) };
        self.budget.take("vtkGhostType", count.saturating_mul(2))?;
        let Samples::U8(flags) = ghosts.values(self.source, Pick::Component(0))?.into_samples() else {
            return Ok(Vec::new());
        };
        Ok(flags.into_iter().map(|flag| flag & HIDDEN_POINT != 0).collect())
    }
}

/// Returns the even lattice on which the points lie, if there is one.
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
    // Nearly flat cells would make an unusable grid; NaN fails the comparison.
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
