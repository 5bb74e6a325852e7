//! From the cells and arrays of a file to a mesh or to points: what all formats of unstructured data share.

use std::collections::BTreeMap;

use glam::DVec3;

use super::arrays::{self, ArrayInfo, Association, Choice, Pick};
use super::source::{Budget, Source};
use super::{Data, Loaded, ReadOptions};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{CellKind, KernelSize, Points, Samples, TetScalars, Tets};

/// Points, and cells with nodes and types in the numbers of VTK.
#[derive(Debug, Default)]
pub(crate) struct Dataset {
    pub(crate) points: Vec<DVec3>,
    /// The type of each cell.
    pub(crate) types: Vec<u8>,
    /// Where each cell's nodes end in `nodes`.
    pub(crate) ends: Vec<u32>,
    /// Indices of points.
    pub(crate) nodes: Vec<u32>,
}

/// Bytes that a dataset of so many points, cells and nodes takes: to be taken from the budget first.
pub(crate) fn bytes(points: u64, cells: u64, nodes: u64) -> u64 {
    let (points, cells) = (points.saturating_mul(24), cells.saturating_mul(5));
    points.saturating_add(cells).saturating_add(nodes.saturating_mul(4))
}

/// Reads one number of each tuple of the array with an index.
pub(crate) type ReadArray<'r> = dyn FnMut(usize, Pick) -> Result<Samples> + 'r;

/// Ghost cells of VTK: a copy of another piece's, or hidden.
const DUPLICATE_OR_HIDDEN: u8 = 1 | 32;

/// The file that a dataset comes from.
pub(crate) struct Origin<'a> {
    pub(crate) source: &'a Source,
    pub(crate) format: &'static str,
    pub(crate) arrays: Vec<ArrayInfo>,
}

impl Dataset {
    /// Makes a mesh of solid cells, or points where there are none.
    pub(crate) fn build(
        self,
        origin: Origin,
        budget: &mut Budget,
        read: &mut ReadArray,
        options: &ReadOptions,
    ) -> Result<Loaded> {
        let source = origin.source;
        self.check(source)?;
        let mut counts: BTreeMap<u8, usize> = BTreeMap::new();
        for &kind in &self.types {
            *counts.entry(kind).or_insert(0) += 1;
        }
        let solid = counts.keys().any(|&number| CellKind::of_vtk(number).is_some());
        // Types 0 to 2 are nothing, vertex and vertices.
        if solid {
            self.mesh(&counts, origin, budget, read, options)
        } else if counts.keys().all(|&number| number <= 2) {
            points(self.points, origin, budget, read, options)
        } else {
            Err(source
                .error("cells", format!("{}: a volume needs solid cells, or points alone", named(&counts))))
        }
    }

    /// Whether nodes are points, and cells have as many as their type.
    fn check(&self, source: &Source) -> Result<()> {
        let Self { points, types, ends, nodes } = self;
        if types.len() != ends.len() {
            let rule = format!("{} types, {} offsets: must be as many", types.len(), ends.len());
            return Err(source.error("cells", rule));
        }
        let mut begin = 0;
        for (cell, (&end, &number)) in ends.iter().zip(types).enumerate() {
            if end < begin || num::index(end) > nodes.len() {
                return Err(source.error(
                    "cells",
                    format!(
                        "cell {cell}: its nodes are {begin} to {end} of {}: offsets must not fall",
                        nodes.len()
                    ),
                ));
            }
            if let Some(kind) = CellKind::of_vtk(number)
                && num::index(end - begin) != kind.nodes()
            {
                return Err(source.error(
                    "cells",
                    format!("cell {cell}: {} nodes, {} have {}", end - begin, kind.name(), kind.nodes()),
                ));
            }
            begin = end;
        }
        if num::index(begin) != nodes.len() {
            let rule = format!("{} nodes, the last cell ends at {begin}", nodes.len());
            return Err(source.error("cells", rule));
        }
        if let Some(node) = nodes.iter().find(|&&node| num::index(node) >= points.len()) {
            return Err(source.error("cells", format!("node {node}: there are {} points", points.len())));
        }
        Ok(())
    }

    fn mesh(
        self,
        counts: &BTreeMap<u8, usize>,
        origin: Origin,
        budget: &mut Budget,
        read: &mut ReadArray,
        options: &ReadOptions,
    ) -> Result<Loaded> {
        let Origin { source, format, arrays } = origin;
        for (name, wanted) in
            [("radius", &options.radius), ("covariance", &options.covariance), ("weight", &options.weight)]
        {
            if let Some(array) = wanted {
                return Err(source.error(format!("array \"{array}\""), format!("a mesh has no {name}")));
            }
        }
        let mut loaded_notes = Vec::new();
        let mut warnings = Vec::new();
        // Three-dimensional types without a rule must not be lost silently; flat ones are no volume.
        let flat =
            |number: u8| matches!(number, 0..=9 | 21..=23 | 28 | 30 | 34..=36 | 60..=63 | 68..=70 | 75..=77);
        if let Some((number, count)) =
            counts.iter().find(|&(&number, _)| CellKind::of_vtk(number).is_none() && !flat(number))
        {
            return Err(source.error(
                "cells",
                format!(
                    "{count} of type {number}: tetrahedra, voxels, hexahedra, wedges and pyramids, linear and \
                     quadratic, are supported"
                ),
            ));
        }
        let surface: usize = counts.iter().filter(|&(&number, _)| flat(number)).map(|(_, count)| count).sum();
        if surface > 0 {
            loaded_notes.push(format!("{surface} cells without volume (surfaces, lines, vertices) left out"));
        }

        let ghosts = match ghost_array(&arrays) {
            Some(index) => match read(index, Pick::Component(0))? {
                Samples::U8(ghosts) if ghosts.len() == self.types.len() => Some(ghosts),
                _ => None,
            },
            None => None,
        };
        let ghost =
            |cell: usize| ghosts.as_ref().is_some_and(|ghosts| ghosts[cell] & DUPLICATE_OR_HIDDEN != 0);

        let chosen = arrays::choose(source, &arrays, options.array.as_deref())?;
        let Some(Choice { index, pick }) = chosen else {
            return Err(source.error("arrays", "none: a mesh needs point or cell data to show"));
        };
        let association = arrays[index].association;
        let per_tuple = if association == Association::Point { self.points.len() } else { self.types.len() };
        budget.take("arrays", u64::try_from(per_tuple).unwrap_or(u64::MAX).saturating_mul(4))?;
        let mut values = read(index, pick)?.into_f32();
        if values.len() != per_tuple {
            let rule = format!("{} tuples: {per_tuple} are needed", values.len());
            return Err(source.error(format!("array {}", arrays[index]), rule));
        }

        // Tetrahedra, each with the cell that it comes from where that matters.
        let most: u64 = counts
            .iter()
            .filter_map(|(&number, &count)| {
                let most = CellKind::of_vtk(number)?.most_tets();
                u64::try_from(most).ok()?.checked_mul(u64::try_from(count).ok()?)
            })
            .fold(0, u64::saturating_add);
        budget.take("cells", most.saturating_mul(if association == Association::Cell { 24 } else { 16 }))?;
        let Self { mut points, types, ends, nodes } = self;
        let split = counts
            .keys()
            .any(|&number| !matches!(CellKind::of_vtk(number), None | Some(CellKind::Tetrahedron)));
        let ranks = if split {
            budget.take("points", u64::try_from(points.len()).unwrap_or(u64::MAX).saturating_mul(8))?;
            ranks(&points)
        } else {
            Vec::new()
        };
        let centres: usize =
            types.iter().filter(|&&n| CellKind::of_vtk(n).is_some_and(|k| k.centre().is_some())).count();
        budget.take("points", u64::try_from(centres).unwrap_or(u64::MAX).saturating_mul(28))?;

        let mut tets: Vec<[u32; 4]> = Vec::new();
        let mut cell_values = Vec::new();
        let mut begin = 0;
        let mut made: BTreeMap<u8, (usize, usize)> = BTreeMap::new();
        let mut ghost_count = 0;
        for (cell, (&end, &number)) in ends.iter().zip(&types).enumerate() {
            let own = &nodes[num::index(begin)..num::index(end)];
            begin = end;
            let Some(kind) = CellKind::of_vtk(number) else { continue };
            if ghost(cell) {
                ghost_count += 1;
                continue;
            }
            let before = tets.len();
            let mut centre = 0;
            if let Some(weights) = kind.centre() {
                let index = u32::try_from(points.len()).ok().filter(|&index| index < u32::MAX);
                centre = index.ok_or_else(|| source.error("cells", "more points than 32 bits can count"))?;
                let pairs = || own.iter().map(|&node| num::index(node)).zip(weights);
                points.push(pairs().map(|(node, weight)| points[node] * *weight).sum());
                if association == Association::Point {
                    let value: f64 = pairs().map(|(node, weight)| f64::from(values[node]) * weight).sum();
                    values.push(num::f32_of(value));
                }
            }
            let at = |node: u32| points[num::index(node)];
            let closer = |[a, b]: [u32; 2], [c, d]: [u32; 2]| {
                at(a).distance_squared(at(b)) < at(c).distance_squared(at(d))
            };
            kind.cut(own, centre, |node| ranks[num::index(node)], closer, |tet| tets.push(tet));
            let count = made.entry(number).or_insert((0, 0));
            *count = (count.0 + 1, count.1 + tets.len() - before);
            if association == Association::Cell {
                cell_values.resize(tets.len(), values[cell]);
            }
        }
        drop((types, ends, nodes, ranks));
        for (number, (cells, tets)) in made {
            if let Some(kind) = CellKind::of_vtk(number).filter(|&kind| kind != CellKind::Tetrahedron) {
                loaded_notes.push(format!("{cells} {} became {tets} tetrahedra", kind.name()));
            }
        }
        if ghost_count > 0 {
            loaded_notes.push(format!("{ghost_count} ghost cells left out"));
        }

        let scalars = match association {
            Association::Point => TetScalars::Point(values),
            Association::Cell => TetScalars::Cell(cell_values),
        };
        let (mesh, mended) =
            Tets::new(points, tets, scalars).map_err(|error| error.in_file(source.path()))?;
        for (count, what) in [
            (mended.reoriented, "tetrahedra were inside out and were turned"),
            (mended.flat, "tetrahedra without volume left out"),
            (mended.nowhere, "tetrahedra with a corner that is not finite left out"),
            (mesh.blank_count(), "tetrahedra are vacuum, because a scalar of theirs is NaN"),
        ] {
            if count > 0 {
                loaded_notes.push(format!("{count} {what}"));
            }
        }
        warnings.extend(coarse(mesh.range(), &arrays[index]));
        let mut loaded = Loaded::new(format, Data::Mesh(mesh));
        loaded.report.shown = Some(describe(&arrays[index], pick));
        loaded.report.arrays = arrays;
        loaded.report.notes = loaded_notes;
        loaded.report.warnings = warnings;
        Ok(loaded)
    }
}

/// Points, with what the options ask of their arrays.
pub(crate) fn points(
    mut centres: Vec<DVec3>,
    origin: Origin,
    budget: &mut Budget,
    read: &mut ReadArray,
    options: &ReadOptions,
) -> Result<Loaded> {
    let Origin { source, format, arrays } = origin;
    let count = centres.len();
    let mut column = |index: usize, pick: Pick| -> Result<Vec<f32>> {
        let array = &arrays[index];
        if array.association == Association::Cell && array.components > 0 {
            return Err(source.error(format!("array {array}"), "cell data: points need point data"));
        }
        budget.take("arrays", u64::try_from(count).unwrap_or(u64::MAX).saturating_mul(4))?;
        let values = read(index, pick)?.into_f32();
        if values.len() != count {
            let rule = format!("{} tuples: there are {count} points", values.len());
            return Err(source.error(format!("array {array}"), rule));
        }
        Ok(values)
    };
    let wanted =
        |name: &Option<String>| name.as_deref().map(|name| arrays::find(source, &arrays, name)).transpose();
    // Cell data of vertices would be points' data too, but nothing says that there is a vertex for each.
    let own: Vec<ArrayInfo> =
        arrays.iter().filter(|array| array.association == Association::Point).cloned().collect();
    let chosen = match &options.array {
        Some(name) => Some(arrays::find(source, &arrays, name)?),
        None => arrays::choose(source, &own, None)?.and_then(|choice| {
            let index = arrays.iter().position(|array| *array == own[choice.index])?;
            Some(Choice { index, ..choice })
        }),
    };
    let mut scalars = chosen.map(|choice| column(choice.index, choice.pick)).transpose()?;
    let mut radii = wanted(&options.radius)?.map(|choice| column(choice.index, choice.pick)).transpose()?;
    let mut weights = wanted(&options.weight)?.map(|choice| column(choice.index, choice.pick)).transpose()?;
    let mut covariances = match wanted(&options.covariance)? {
        None => None,
        Some(Choice { index, .. }) => {
            let places: [usize; 6] = match arrays[index].components {
                6 => [0, 1, 2, 3, 4, 5],
                9 => [0, 1, 2, 4, 5, 8],
                n => {
                    let rule = format!("{n} components: a covariance has 6 or 9");
                    return Err(source.error(format!("array {}", arrays[index]), rule));
                }
            };
            let mut all = vec![[0.0; 6]; count];
            for (i, place) in places.into_iter().enumerate() {
                for (all, value) in all.iter_mut().zip(column(index, Pick::Component(place))?) {
                    all[i] = value;
                }
            }
            Some(all)
        }
    };
    if radii.is_some() && covariances.is_some() {
        return Err(source.error("arrays", "points have either radii or covariances"));
    }

    let mut notes = Vec::new();
    let mut warnings = Vec::new();
    let finite: Vec<bool> = centres.iter().map(|centre| centre.is_finite()).collect();
    let nowhere = finite.iter().filter(|finite| !**finite).count();
    if nowhere > 0 {
        fn keep<T>(list: &mut Vec<T>, finite: &[bool]) {
            let mut i = 0;
            list.retain(|_| {
                i += 1;
                finite[i - 1]
            });
        }
        keep(&mut centres, &finite);
        for list in [&mut scalars, &mut radii, &mut weights].into_iter().flatten() {
            keep(list, &finite);
        }
        if let Some(list) = &mut covariances {
            keep(list, &finite);
        }
        notes.push(format!("{nowhere} points whose place is not finite left out"));
    }

    let located = |error: Error| error.in_file(source.path());
    let mut points = Points::new(centres).map_err(located)?;
    if let Some(scalars) = scalars {
        points = points.with_scalars(scalars).map_err(located)?;
    }
    if let Some(weights) = weights {
        points = points.with_weights(weights).map_err(located)?;
    }
    if let Some(radii) = radii {
        points = points.with_size(KernelSize::Radii(radii)).map_err(located)?;
    }
    if let Some(covariances) = covariances {
        points = points.with_size(KernelSize::Covariances(covariances)).map_err(located)?;
    }
    if let Some(choice) = chosen {
        warnings.extend(coarse(points.range(), &arrays[choice.index]));
    }
    let mut loaded = Loaded::new(format, Data::Points(points));
    loaded.report.shown = chosen.map(|choice| describe(&arrays[choice.index], choice.pick));
    loaded.report.arrays = arrays;
    loaded.report.notes = notes;
    loaded.report.warnings = warnings;
    Ok(loaded)
}

/// The array, and what of it.
pub(crate) fn describe(array: &ArrayInfo, pick: Pick) -> String {
    let name = format!("{}:{}", array.association.name(), array.name);
    match pick {
        Pick::Component(_) if array.components == 1 => name,
        Pick::Component(component) => format!("{name}:{component}"),
        Pick::Magnitude => format!("{name}:magnitude"),
    }
}

/// A warning where 32-bit floats are coarse for values of such a range.
pub(crate) fn coarse([lo, hi]: [f64; 2], array: &ArrayInfo) -> Option<String> {
    /// Steps that a range should have.
    const STEPS: f64 = 4096.0;
    if array.kind.bytes() < 4 || array.kind == super::SampleType::F32 || lo >= hi {
        return None;
    }
    let step = lo.abs().max(hi.abs()) * f64::from(f32::EPSILON);
    let whole = !matches!(array.kind, super::SampleType::F64);
    let coarse = if whole { step > 1.0 } else { (hi - lo) / step < STEPS };
    coarse.then(|| {
        format!(
            "{} values are kept as f32: steps of {step:.1e} in a range of {:.1e}",
            array.kind.name(),
            hi - lo
        )
    })
}

/// The rank of each point: the smallest index of a point at the same position.
fn ranks(points: &[DVec3]) -> Vec<u32> {
    // Zero has two signs and one position.
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

fn ghost_array(arrays: &[ArrayInfo]) -> Option<usize> {
    arrays.iter().position(|array| {
        array.association == Association::Cell && array.name == "vtkGhostType" && array.components == 1
    })
}

fn named(counts: &BTreeMap<u8, usize>) -> String {
    let name = |number: u8| match number {
        3 => "lines".to_owned(),
        4 => "polylines".to_owned(),
        5 => "triangles".to_owned(),
        6 => "triangle strips".to_owned(),
        7 => "polygons".to_owned(),
        8 => "pixels".to_owned(),
        9 => "quadrilaterals".to_owned(),
        _ => format!("cells of type {number}"),
    };
    counts.iter().map(|(&number, count)| format!("{count} {}", name(number))).collect::<Vec<_>>().join(", ")
}
