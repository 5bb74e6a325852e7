//! From an unstructured data set to a tetrahedral mesh, or to points if it has no cells with volume.

use std::collections::{BTreeMap, TryReserveError};
use std::ops::Range;

use glam::DVec3;

use crate::error::Result;
use crate::io::build::arrays::{self, Association, Choice};
use crate::io::build::data_file::Shape;
use crate::io::build::dataset::{Counts, Dataset, check_points, check_supported, flat};
use crate::io::build::origin::Origin;
use crate::io::build::points::points;
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::options::Request;
use crate::io::report::Found;
use crate::num;
use crate::scene::{CellKind, Data, Orientation, Samples, TetScalars, Tets};

/// VTK's flags of ghost cells: duplicate of a cell in another piece, or hidden.
const DUPLICATE_OR_HIDDEN: u8 = 1 | 32;

impl Dataset {
    /// Builds a mesh of the cells with volume, or points if there are none.
    pub(crate) fn build(self, origin: Origin) -> Result<Found> {
        self.check(origin.source)?;
        let mut counts = Counts::new();
        for &kind in &self.types {
            *counts.entry(kind).or_insert(0) += 1;
        }
        if counts.keys().any(|&number| CellKind::of_vtk(number).is_some()) {
            check_supported(origin.source, &counts)?;
            if origin.is_kept() { self.keep(origin) } else { mesh(self, &counts, origin) }
        } else {
            check_points(origin.source, &counts)?;
            if origin.is_kept() { self.keep(origin) } else { points(self.points, origin) }
        }
    }

    /// Keeps all cells and the requested arrays.
    fn keep(self, origin: Origin) -> Result<Found> {
        let counts = [self.points.len(), self.types.len()];
        origin.keep(Shape::Cells(self), counts)
    }
}

/// Builds a mesh of the cells that have a volume, with the chosen array as its scalars.
///
/// Cells that are no tetrahedra are cut into some: faces between cells match also where points coincide. Cells without
/// volume and ghost cells are left out, with a note.
fn mesh(dataset: Dataset, counts: &Counts, mut origin: Origin) -> Result<Found> {
    let Origin { source, request: &Request { options, .. }, .. } = origin;
    origin.check_places(&dataset.points)?;
    options.check_kernels("a mesh").map_err(|error| error.in_file(source.path()))?;
    let mut notes = Vec::new();
    let mut warnings = Vec::new();
    let surface: u64 = counts.iter().filter(|&(&number, _)| flat(number)).map(|(_, count)| count).sum();
    if surface > 0 {
        notes.push(format!("{surface} cells without volume (surfaces, lines, vertices) left out"));
    }
    let ghosts = origin.ghosts(Association::Cell, dataset.types.len())?;

    let chosen = arrays::choose(source, &origin.arrays, options.array.as_deref())?;
    let Some(Choice { index, pick }) = chosen else {
        return Err(source.error("arrays", "none: a mesh needs point or cell data to show"));
    };
    let association = origin.arrays[index].association;
    let per_tuple = match association {
        Association::Point => dataset.points.len(),
        Association::Cell => dataset.types.len(),
    };
    origin.budget.take("arrays", num::wide(per_tuple).saturating_mul(4))?;
    let values = (origin.read)(index, pick)?.into_samples().into_f32();
    if values.len() != per_tuple {
        let rule = format!("{} tuples: {per_tuple} are needed", values.len());
        return Err(source.error(format!("array {}", origin.arrays[index]), rule));
    }

    let values = Samples::F32(values);
    let ([low, high], ..) = values.statistics();
    let values = values.into_f32();
    let mut cutter = Cutter::new(source, dataset, counts, association, values, origin.budget)?;
    cutter.cut_all(ghosts.as_deref())?;
    cutter.describe(&mut notes, &mut warnings);
    let Cutter { data, tets, values, cell_values, .. } = cutter;
    let scalars = match association {
        Association::Point => TetScalars::Point(values),
        Association::Cell => TetScalars::Cell(cell_values),
    };
    let mesh = Tets::new(data.points, tets, scalars);
    let (mesh, mended) = mesh.map_err(|error| error.in_file(source.path()))?;
    for (count, what) in [
        (mended.reoriented, "tetrahedra were inside out and were reoriented"),
        (mended.flat, "tetrahedra without volume left out"),
        (mended.nowhere, "tetrahedra with a corner that is not finite left out"),
        (mesh.blank_count(), "tetrahedra are vacuum, because a scalar is NaN"),
    ] {
        if count > 0 {
            notes.push(format!("{count} {what}"));
        }
    }
    let mut loaded = origin.loaded(Data::Mesh(mesh), chosen, notes);
    loaded.report.warnings.splice(0..0, warnings);
    loaded.report.file_range = (low <= high).then_some([low, high]);
    Ok(loaded.into())
}

/// The cutting of cells into tetrahedra, with all memory allocated beforehand.
struct Cutter<'a> {
    source: &'a Source,
    association: Association,
    /// The points of the data set, followed by the new centres of cells, and the cells.
    data: Dataset,
    /// The rank of each point; empty if all cells are tetrahedra.
    ranks: Vec<u32>,
    /// Scalars of points, or of the cells of the data set.
    values: Vec<f32>,
    tets: Vec<[u32; 4]>,
    /// Scalars of the tetrahedra, with cell data.
    cell_values: Vec<f32>,
    /// Results by cell type.
    made: BTreeMap<u8, Made>,
    ghosts: usize,
}

impl<'a> Cutter<'a> {
    /// Takes memory from the budget and allocates it.
    fn new(
        source: &'a Source,
        mut data: Dataset,
        counts: &Counts,
        association: Association,
        mut values: Vec<f32>,
        budget: &mut Budget,
    ) -> Result<Self> {
        let most: u64 = counts
            .iter()
            .filter_map(|(&number, &count)| {
                let most = CellKind::of_vtk(number)?.most_tets();
                u64::try_from(most).ok()?.checked_mul(count)
            })
            .fold(0, u64::saturating_add);
        budget.take("cells", most.saturating_mul(if association == Association::Cell { 24 } else { 16 }))?;
        let split = |&number: &u8| !matches!(CellKind::of_vtk(number), None | Some(CellKind::Tetrahedron));
        let ranks = if counts.keys().any(split) {
            budget.take("points", num::wide(data.points.len()).saturating_mul(8))?;
            ranks(&data.points)
        } else {
            Vec::new()
        };
        let has_centre = |number: u8| CellKind::of_vtk(number).is_some_and(|kind| kind.centre().is_some());
        let centres = data.types.iter().filter(|&&number| has_centre(number)).count();
        budget.take("points", num::wide(centres).saturating_mul(28))?;

        let full = |_: TryReserveError| source.error("cells", "memory is full");
        let most = usize::try_from(most).unwrap_or(usize::MAX);
        let (mut tets, mut cell_values, made) = (Vec::new(), Vec::new(), BTreeMap::new());
        tets.try_reserve_exact(most).map_err(full)?;
        data.points.try_reserve_exact(centres).map_err(full)?;
        match association {
            Association::Point => values.try_reserve_exact(centres).map_err(full)?,
            Association::Cell => cell_values.try_reserve_exact(most).map_err(full)?,
        }
        Ok(Self { source, association, data, ranks, values, tets, cell_values, made, ghosts: 0 })
    }

    /// Cuts every cell with a volume, except ghost cells.
    fn cut_all(&mut self, ghosts: Option<&[u8]>) -> Result<()> {
        let mut begin = 0;
        for cell in 0..self.data.types.len() {
            let (end, number) = (self.data.ends[cell], self.data.types[cell]);
            let own = num::index(begin)..num::index(end);
            begin = end;
            let Some(kind) = CellKind::of_vtk(number) else { continue };
            if ghosts.is_some_and(|ghosts| ghosts[cell] & DUPLICATE_OR_HIDDEN != 0) {
                self.ghosts += 1;
                continue;
            }
            self.cut(cell, number, kind, own)?;
        }
        let points = std::mem::take(&mut self.data.points);
        (self.data, self.ranks) = (Dataset { points, ..Dataset::default() }, Vec::new());
        Ok(())
    }

    /// Cuts one cell; `own` is its range of nodes.
    fn cut(&mut self, cell: usize, number: u8, kind: CellKind, own: Range<usize>) -> Result<()> {
        let Self { source, data: Dataset { points, nodes, .. }, ranks, values, tets, .. } = self;
        let own = &nodes[own];
        let before = tets.len();
        let (mut centre, mut overshoot) = (0, false);
        if let Some(weights) = kind.centre() {
            let index = u32::try_from(points.len()).ok().filter(|&index| index < u32::MAX);
            centre = index.ok_or_else(|| source.error("cells", "more points than 32 bits can count"))?;
            let pairs = || own.iter().map(|&node| num::index(node)).zip(weights);
            points.push(pairs().map(|(node, weight)| points[node] * *weight).sum());
            if self.association == Association::Point {
                // The function of the cell may overshoot the values of its nodes, which are those of the file.
                let value = num::f32_of(pairs().map(|(node, weight)| f64::from(values[node]) * weight).sum());
                let within = |limit: fn(f32, f32) -> f32| pairs().map(|(node, _)| values[node]).reduce(limit);
                let limits = within(f32::min).zip(within(f32::max));
                // NaN stays.
                let beyond = limits.filter(|(low, high)| value < *low || value > *high);
                overshoot = beyond.is_some();
                let kept = beyond.map_or(value, |(low, high)| value.max(low).min(high));
                values.push(kept);
            }
        }
        let at = |node: u32| points[num::index(node)];
        let closer = |[a, b]: [u32; 2], [c, d]: [u32; 2]| {
            at(a).distance_squared(at(b)) < at(c).distance_squared(at(d))
        };
        kind.cut(own, centre, |node| ranks[num::index(node)], closer, |tet| tets.push(tet));
        let made = self.made.entry(number).or_default();
        made.cells += 1;
        made.overshoots += usize::from(overshoot);
        made.tets += tets.len() - before;
        if kind != CellKind::Tetrahedron {
            made.turn(points, &mut tets[before..]);
        }
        if self.association == Association::Cell {
            self.cell_values.resize(tets.len(), values[cell]);
        }
        Ok(())
    }

    /// Reports what was cut, turned and left out.
    fn describe(&self, notes: &mut Vec<String>, warnings: &mut Vec<String>) {
        for (&number, &Made { cells, tets, inside_out, twisted, overshoots }) in &self.made {
            let Some(kind) = CellKind::of_vtk(number).filter(|&kind| kind != CellKind::Tetrahedron) else {
                continue;
            };
            let name = kind.name();
            notes.push(format!("{cells} {name} became {tets} tetrahedra"));
            if overshoots > 0 {
                notes.push(format!(
                    "{overshoots} {name} overshoot the values of their nodes at their centres, which keep within these"
                ));
            }
            // Programs disagree about the orientation of wedges.
            if inside_out > 0 && !matches!(kind, CellKind::Wedge | CellKind::QuadraticWedge) {
                notes.push(format!("{inside_out} {name} were inside out and were reoriented"));
            }
            if twisted > 0 {
                warnings.push(format!("{twisted} {name} are twisted: their tetrahedra overlap"));
            }
        }
        if self.ghosts > 0 {
            notes.push(format!("{} ghost cells left out", self.ghosts));
        }
    }
}

/// Statistics of the cells of one type.
#[derive(Default)]
struct Made {
    cells: usize,
    tets: usize,
    inside_out: usize,
    twisted: usize,
    /// Cells whose function goes beyond the values of their nodes at the centre.
    overshoots: usize,
}

impl Made {
    /// Reorients the tetrahedra of a cell that are inside out. If only some are, the cell is twisted.
    fn turn(&mut self, points: &[DVec3], tets: &mut [[u32; 4]]) {
        let (mut positive, mut negative) = (false, false);
        for tet in tets {
            // Coincident corners make flat tetrahedra, whose sign is rounding error.
            match Orientation::of(tet.map(|i| points[num::index(i)])) {
                Orientation::Positive => positive = true,
                Orientation::Negative => {
                    negative = true;
                    tet.swap(2, 3);
                }
                Orientation::Flat | Orientation::Nowhere => {}
            }
        }
        self.inside_out += usize::from(negative && !positive);
        self.twisted += usize::from(negative && positive);
    }
}

/// Returns the rank of each point: the smallest index of a point at the same position.
fn ranks(points: &[DVec3]) -> Vec<u32> {
    // Adding 0 makes -0 equal to 0.
    let key = |i: u32| points[num::index(i)].to_array().map(|x| x + 0.0);
    let mut order: Vec<u32> = (0..num::count(points.len())).collect();
    order.sort_unstable_by(|&a, &b| {
        let (p, q) = (key(a), key(b));
        p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1])).then(p[2].total_cmp(&q[2])).then(a.cmp(&b))
    });
    let mut ranks = vec![0; points.len()];
    let mut first = 0;
    for i in 0..order.len() {
        if i == 0 || key(order[i]) != key(order[i - 1]) {
            first = order[i];
        }
        ranks[num::index(order[i])] = first;
    }
    ranks
}

#[cfg(test)]
mod tests;
