//! From the cells and arrays of a file to a mesh or to points: what all formats of unstructured data share.

use std::collections::{BTreeMap, TryReserveError};

use glam::DVec3;

use super::arrays::{self, ArrayInfo, Association, Choice, Pick};
use super::source::{Budget, Source};
use super::{Data, Loaded, ReadOptions, SampleType};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{CellKind, KernelSize, Orientation, Points, Samples, TetScalars, Tets};

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
        let mut counts = Counts::new();
        for &kind in &self.types {
            *counts.entry(kind).or_insert(0) += 1;
        }
        let solid = counts.keys().any(|&number| CellKind::of_vtk(number).is_some());
        if solid {
            self.mesh(&counts, origin, budget, read, options)
        } else {
            check_points(source, &counts)?;
            points(self.points, origin, budget, read, options)
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
        counts: &Counts,
        origin: Origin,
        budget: &mut Budget,
        read: &mut ReadArray,
        options: &ReadOptions,
    ) -> Result<Loaded> {
        let Origin { source, format, arrays } = origin;
        options.check_kernels("a mesh").map_err(|error| error.in_file(source.path()))?;
        let mut notes = Vec::new();
        let mut warnings = Vec::new();
        check_supported(source, counts)?;
        let surface: u64 = counts.iter().filter(|&(&number, _)| flat(number)).map(|(_, count)| count).sum();
        if surface > 0 {
            notes.push(format!("{surface} cells without volume (surfaces, lines, vertices) left out"));
        }

        let ghosts = ghosts(&arrays, Association::Cell, self.types.len(), budget, read)?;
        let ghost =
            |cell: usize| ghosts.as_ref().is_some_and(|ghosts| ghosts[cell] & DUPLICATE_OR_HIDDEN != 0);

        let chosen = arrays::choose(source, &arrays, options.array.as_deref())?;
        let Some(Choice { index, pick }) = chosen else {
            return Err(source.error("arrays", "none: a mesh needs point or cell data to show"));
        };
        let association = arrays[index].association;
        let per_tuple = if association == Association::Point { self.points.len() } else { self.types.len() };
        budget.take("arrays", num::wide(per_tuple).saturating_mul(4))?;
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
                u64::try_from(most).ok()?.checked_mul(count)
            })
            .fold(0, u64::saturating_add);
        budget.take("cells", most.saturating_mul(if association == Association::Cell { 24 } else { 16 }))?;
        let Self { mut points, types, ends, nodes } = self;
        let split = counts
            .keys()
            .any(|&number| !matches!(CellKind::of_vtk(number), None | Some(CellKind::Tetrahedron)));
        let ranks = if split {
            budget.take("points", num::wide(points.len()).saturating_mul(8))?;
            ranks(&points)
        } else {
            Vec::new()
        };
        let centres: usize =
            types.iter().filter(|&&n| CellKind::of_vtk(n).is_some_and(|k| k.centre().is_some())).count();
        budget.take("points", num::wide(centres).saturating_mul(28))?;

        let full = |_: TryReserveError| source.error("cells", "memory is full");
        let most = usize::try_from(most).unwrap_or(usize::MAX);
        let mut tets: Vec<[u32; 4]> = Vec::new();
        let mut cell_values = Vec::new();
        tets.try_reserve_exact(most).map_err(full)?;
        points.try_reserve_exact(centres).map_err(full)?;
        match association {
            Association::Point => values.try_reserve_exact(centres).map_err(full)?,
            Association::Cell => cell_values.try_reserve_exact(most).map_err(full)?,
        }
        let mut begin = 0;
        let mut made: BTreeMap<u8, Made> = BTreeMap::new();
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
            let count = made.entry(number).or_default();
            count.cells += 1;
            count.tets += tets.len() - before;
            if kind != CellKind::Tetrahedron {
                count.turn(&points, &mut tets[before..]);
            }
            if association == Association::Cell {
                cell_values.resize(tets.len(), values[cell]);
            }
        }
        drop((types, ends, nodes, ranks));
        for (number, Made { cells, tets, inside_out, twisted }) in made {
            let Some(kind) = CellKind::of_vtk(number).filter(|&kind| kind != CellKind::Tetrahedron) else {
                continue;
            };
            let name = kind.name();
            notes.push(format!("{cells} {name} became {tets} tetrahedra"));
            // Programs do not agree which way round a wedge is.
            if inside_out > 0 && !matches!(kind, CellKind::Wedge | CellKind::QuadraticWedge) {
                notes.push(format!("{inside_out} {name} were inside out and were turned"));
            }
            if twisted > 0 {
                warnings.push(format!("{twisted} {name} are twisted: tetrahedra of theirs overlap"));
            }
        }
        if ghost_count > 0 {
            notes.push(format!("{ghost_count} ghost cells left out"));
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
                notes.push(format!("{count} {what}"));
            }
        }
        warnings.extend(coarse(mesh.range(), &arrays[index]));
        let mut loaded = Loaded::new(format, Data::Mesh(mesh));
        loaded.report.shown = Some(describe(&arrays[index], pick));
        loaded.report.arrays = arrays;
        loaded.report.notes = notes;
        loaded.report.warnings = warnings;
        Ok(loaded)
    }
}

/// Cells of each type.
pub(crate) type Counts = BTreeMap<u8, u64>;

/// Whether cells of a type have no volume.
fn flat(number: u8) -> bool {
    matches!(number, 0..=9 | 21..=23 | 28 | 30 | 34..=36 | 60..=63 | 68..=70 | 75..=77)
}

/// Three-dimensional types without a rule must not be lost silently.
fn check_supported(source: &Source, counts: &Counts) -> Result<()> {
    let unknown = |number: u8| CellKind::of_vtk(number).is_none() && !flat(number);
    let Some((number, count)) = counts.iter().find(|&(&number, _)| unknown(number)) else { return Ok(()) };
    let name = match number {
        42 => " (polyhedra)",
        64..=67 | 71..=74 | 78..=81 => " (of a higher order)",
        _ => "",
    };
    let rule = format!(
        "{count} of type {number}{name}: tetrahedra, voxels, hexahedra, wedges and pyramids, linear and \
         quadratic, are supported"
    );
    Err(source.error("cells", rule))
}

/// Whether cells among which none is solid leave the points alone. Types 0 to 2 are nothing, vertex and
/// vertices.
pub(crate) fn check_points(source: &Source, counts: &Counts) -> Result<()> {
    check_supported(source, counts)?;
    if counts.keys().all(|&number| number <= 2) {
        return Ok(());
    }
    Err(source.error("cells", format!("{}: a volume needs solid cells, or points alone", named(counts))))
}

/// What became of the cells of one type.
#[derive(Default)]
struct Made {
    cells: usize,
    tets: usize,
    inside_out: usize,
    twisted: usize,
}

impl Made {
    /// Turns the tetrahedra of a cell that are inside out: all of them, or some, where the cell is twisted.
    fn turn(&mut self, points: &[DVec3], tets: &mut [[u32; 4]]) {
        let (mut positive, mut negative) = (false, false);
        for tet in tets {
            // A cell with corners at one place has flat ones, whose sign is rounding.
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
    let mut column = |budget: &mut Budget, index: usize, pick: Pick| -> Result<Vec<f32>> {
        let array = &arrays[index];
        if array.association == Association::Cell && array.components > 0 {
            return Err(source.error(format!("array {array}"), "cell data: points need point data"));
        }
        budget.take("arrays", num::wide(count).saturating_mul(4))?;
        let values = read(index, pick)?.into_f32();
        if values.len() != count {
            let rule = format!("{} tuples: there are {count} points", values.len());
            return Err(source.error(format!("array {array}"), rule));
        }
        Ok(values)
    };
    let wanted =
        |name: &Option<String>| name.as_deref().map(|name| arrays::find(source, &arrays, name)).transpose();
    // Cell data of vertices would be points' data too, but nothing says that there is a vertex for each. What
    // is a size or a weight is not what is shown, unless it is asked for.
    let taken: Vec<usize> = [&options.radius, &options.covariance, &options.weight]
        .into_iter()
        .filter_map(|name| wanted(name).ok().flatten().map(|choice| choice.index))
        .collect();
    let own = |i: usize, array: &ArrayInfo| array.association == Association::Point && !taken.contains(&i);
    let chosen = wanted(&options.array)?.or_else(|| arrays::choose_among(&arrays, own));
    let mut scalars = chosen.map(|choice| column(budget, choice.index, choice.pick)).transpose()?;
    let mut radii =
        wanted(&options.radius)?.map(|choice| column(budget, choice.index, choice.pick)).transpose()?;
    let mut weights =
        wanted(&options.weight)?.map(|choice| column(budget, choice.index, choice.pick)).transpose()?;
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
            budget.take("arrays", num::wide(count).saturating_mul(24))?;
            let mut all = vec![[0.0; 6]; count];
            for (i, place) in places.into_iter().enumerate() {
                for (all, value) in all.iter_mut().zip(column(budget, index, Pick::Component(place))?) {
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
    /// Up to here f32 has every whole number.
    const WHOLE: f64 = 16_777_216.0;
    if array.kind.bytes() < 4 || array.kind == SampleType::F32 || lo >= hi {
        return None;
    }
    let magnitude = lo.abs().max(hi.abs());
    let step = magnitude * f64::from(f32::EPSILON);
    let whole = !matches!(array.kind, SampleType::F64);
    let coarse = if whole { magnitude > WHOLE } else { (hi - lo) / step < STEPS };
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

/// The flags of VTK's ghost array of points or cells, where there is one.
pub(crate) fn ghosts(
    arrays: &[ArrayInfo],
    association: Association,
    count: usize,
    budget: &mut Budget,
    read: &mut ReadArray,
) -> Result<Option<Vec<u8>>> {
    let is = |array: &ArrayInfo| {
        array.association == association
            && array.name == "vtkGhostType"
            && array.components == 1
            && array.kind == SampleType::U8
    };
    let Some(index) = arrays.iter().position(is) else { return Ok(None) };
    budget.take("vtkGhostType", num::wide(count))?;
    Ok(match read(index, Pick::Component(0))? {
        Samples::U8(flags) if flags.len() == count => Some(flags),
        _ => None,
    })
}

fn named(counts: &Counts) -> String {
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

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    fn array(name: &str, association: Association, components: usize) -> ArrayInfo {
        ArrayInfo { name: name.into(), association, kind: SampleType::F32, components, active: false }
    }

    /// Builds a dataset with one array of each association: a linear field, and the cell's number.
    fn build_with(dataset: Dataset, options: &ReadOptions, ghosts: Option<Vec<u8>>) -> Result<Loaded> {
        let source = Source::in_memory(&[("a.vtu", b"")])?;
        let field: Vec<f32> = dataset.points.iter().map(|p| num::f32_of(linear(*p))).collect();
        let cells: Vec<f32> = (0..dataset.types.len()).map(|i| num::f32_of(num::f64_of(i))).collect();
        let mut arrays = vec![array("field", Association::Point, 1), array("cell", Association::Cell, 1)];
        if ghosts.is_some() {
            arrays.push(ArrayInfo { kind: SampleType::U8, ..array("vtkGhostType", Association::Cell, 1) });
        }
        let mut read = |index: usize, _: Pick| {
            Ok(match index {
                0 => Samples::F32(field.clone()),
                1 => Samples::F32(cells.clone()),
                _ => Samples::U8(ghosts.clone().unwrap_or_default()),
            })
        };
        let mut budget = Budget::new(&source, options);
        dataset.build(Origin { source: &source, format: "test", arrays }, &mut budget, &mut read, options)
    }

    fn mesh_of(dataset: Dataset, array: &str) -> (Tets, Vec<String>) {
        let options = ReadOptions { array: Some(array.into()), ..ReadOptions::within(1 << 24) };
        let loaded = build_with(dataset, &options, None).unwrap();
        let Data::Mesh(mesh) = loaded.data else { panic!() };
        (mesh, loaded.report.notes)
    }

    fn linear(p: DVec3) -> f64 {
        1.0 + 2.0 * p.x - 3.0 * p.y + 0.5 * p.z
    }

    fn refusal(dataset: Dataset) -> String {
        build_with(dataset, &ReadOptions::within(1 << 24), None).unwrap_err().to_string()
    }

    impl Dataset {
        fn add(&mut self, number: u8, corners: &[DVec3], shared: bool) {
            for &corner in corners {
                let found = self.points.iter().position(|&point| shared && point == corner);
                let index = found.unwrap_or_else(|| {
                    self.points.push(corner);
                    self.points.len() - 1
                });
                self.nodes.push(num::count(index));
            }
            self.types.push(number);
            self.ends.push(num::count(self.nodes.len()));
        }
    }

    /// Every face inside a convex body of some volume is met by two tetrahedra of opposite sides, where faces
    /// are told by their places.
    fn assert_conforming(mesh: &Tets, volume: f64, hull: f64) {
        let mut faces: HashMap<[[u64; 3]; 3], usize> = HashMap::new();
        let (mut sum, mut area) = (0.0, 0.0);
        let key = |p: DVec3| (p + 0.0).to_array().map(f64::to_bits);
        let mut places: HashMap<[u64; 3], DVec3> = HashMap::new();
        for cell in mesh.cells() {
            let [a, b, c, d] = cell.map(|i| mesh.points()[num::index(i)]);
            sum += (b - a).cross(c - a).dot(d - a) / 6.0;
            for face in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
                let mut keys = face.map(|p| {
                    places.insert(key(p), p);
                    key(p)
                });
                keys.sort_unstable();
                *faces.entry(keys).or_default() += 1;
            }
        }
        for (face, count) in faces {
            assert!(count <= 2);
            if count == 1 {
                let [a, b, c] = face.map(|key| places[&key]);
                area += (b - a).cross(c - a).length() / 2.0;
            }
        }
        assert!((sum - volume).abs() < 1e-10, "volume {sum}, not {volume}");
        assert!((area - hull).abs() < 1e-10, "hull {area}, not {hull}: faces do not match");
    }

    const HEXAHEDRON: [[f64; 3]; 8] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
    ];

    /// 3 x 3 x 3 cells: columns of hexahedra, voxels, pairs of wedges and six pyramids round a centre, so
    /// that wedges meet in triangles, and all others in quadrilaterals.
    fn block(shared: bool, turn: usize) -> Dataset {
        let mut dataset = Dataset::default();
        for i in 0..27 {
            let base = DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9));
            let corner = HEXAHEDRON.map(|c| base + DVec3::from_array(c));
            let pick = |list: &[usize]| list.iter().map(|&i| corner[i]).collect::<Vec<_>>();
            match (usize::try_from(i % 9).unwrap() + turn) % 4 {
                0 => dataset.add(12, &corner, shared),
                1 => dataset.add(11, &pick(&[0, 1, 3, 2, 4, 5, 7, 6]), shared),
                2 => {
                    dataset.add(13, &pick(&[0, 1, 2, 4, 5, 6]), shared);
                    dataset.add(13, &pick(&[0, 2, 3, 4, 6, 7]), shared);
                }
                _ => {
                    let centre = base + DVec3::splat(0.5);
                    for face in
                        [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
                    {
                        let mut corners = pick(&face);
                        corners.push(centre);
                        dataset.add(14, &corners, shared);
                    }
                }
            }
        }
        dataset
    }

    #[test]
    fn faces_match_also_across_seams_of_coincident_points() {
        for turn in 0..4 {
            let (mesh, _) = mesh_of(block(true, turn), "field");
            assert_conforming(&mesh, 27.0, 54.0);
            // Each cell with points of its own: the rule goes by place.
            let (mesh, notes) = mesh_of(block(false, turn), "cell");
            assert_conforming(&mesh, 27.0, 54.0);
            assert!(notes.iter().any(|note| note.contains("wedges became")), "{notes:?}");
        }
    }

    #[test]
    fn cell_data_follows_its_cell_and_point_data_its_point() {
        let (mesh, _) = mesh_of(block(true, 1), "cell");
        let TetScalars::Cell(values) = mesh.scalars() else { panic!() };
        let source = block(true, 1);
        for (cell, value) in mesh.cells().iter().zip(values) {
            let middle: DVec3 = cell.iter().map(|&i| mesh.points()[num::index(i)]).sum::<DVec3>() / 4.0;
            let index = num::usize_of(f64::from(*value));
            let begin = if index == 0 { 0 } else { num::index(source.ends[index - 1]) };
            let corners: Vec<DVec3> = source.nodes[begin..num::index(source.ends[index])]
                .iter()
                .map(|&n| source.points[num::index(n)])
                .collect();
            let lo = corners.iter().copied().reduce(DVec3::min).unwrap();
            let hi = corners.iter().copied().reduce(DVec3::max).unwrap();
            assert!(middle.cmpge(lo).all() && middle.cmple(hi).all());
        }
        let (mesh, _) = mesh_of(block(true, 1), "field");
        let TetScalars::Point(values) = mesh.scalars() else { panic!() };
        assert!(mesh.points().iter().zip(values).all(|(p, v)| (linear(*p) - f64::from(*v)).abs() < 1e-6));
    }

    /// Two quadratic hexahedra side by side: their common face is cut alike, and new centres carry the field.
    #[test]
    fn quadratic_cells_match_and_their_centres_have_values() {
        let mut dataset = Dataset::default();
        for x in [0.0, 1.0] {
            let corner = HEXAHEDRON.map(|c| DVec3::from_array(c) + DVec3::X * x);
            let mut nodes = corner.to_vec();
            for [a, b] in [
                [0, 1],
                [1, 2],
                [2, 3],
                [3, 0],
                [4, 5],
                [5, 6],
                [6, 7],
                [7, 4],
                [0, 4],
                [1, 5],
                [2, 6],
                [3, 7],
            ] {
                nodes.push((corner[a] + corner[b]) / 2.0);
            }
            dataset.add(25, &nodes, true);
        }
        let (mesh, notes) = mesh_of(dataset, "field");
        assert_conforming(&mesh, 2.0, 10.0);
        assert_eq!(notes, ["2 quadratic hexahedra became 72 tetrahedra"]);
        let TetScalars::Point(values) = mesh.scalars() else { panic!() };
        assert_eq!(values.len(), 12 + 20 + 2);
        assert!(mesh.points().iter().zip(values).all(|(p, v)| (linear(*p) - f64::from(*v)).abs() < 1e-6));
    }

    fn tet() -> [DVec3; 4] {
        [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]
    }

    #[test]
    fn ghosts_and_flat_cells_are_left_out_and_counted() {
        let mut dataset = Dataset::default();
        dataset.add(10, &tet(), true);
        dataset.add(5, &tet()[..3], true);
        dataset.add(10, &tet().map(|p| p + DVec3::ONE), true);
        dataset.add(10, &tet().map(|p| p - DVec3::ONE), true);
        let loaded = build_with(dataset, &ReadOptions::within(1 << 20), Some(vec![0, 0, 1, 32])).unwrap();
        let Data::Mesh(mesh) = loaded.data else { panic!() };
        assert_eq!(mesh.cells().len(), 1);
        assert_eq!(
            loaded.report.notes,
            ["1 cells without volume (surfaces, lines, vertices) left out", "2 ghost cells left out"]
        );
        assert_eq!(loaded.report.shown.as_deref(), Some("point:field"));
    }

    #[test]
    fn what_is_no_dataset_is_refused() {
        let of = |types: &[u8], ends: &[u32], nodes: &[u32]| Dataset {
            points: tet().to_vec(),
            types: types.to_vec(),
            ends: ends.to_vec(),
            nodes: nodes.to_vec(),
        };
        assert!(refusal(of(&[10], &[4], &[0, 1, 2, 4])).contains("node 4: there are 4 points"));
        assert!(refusal(of(&[10], &[3], &[0, 1, 2])).contains("3 nodes, tetrahedra have 4"));
        assert!(refusal(of(&[10], &[4], &[0, 1, 2, 3, 3])).contains("5 nodes, the last cell ends at 4"));
        assert!(refusal(of(&[10, 10], &[4, 2], &[0, 1, 2, 3])).contains("offsets must not fall"));
        assert!(refusal(of(&[10], &[4, 8], &[0, 1, 2, 3])).contains("1 types, 2 offsets"));
        assert!(refusal(of(&[5], &[3], &[0, 1, 2])).contains("1 triangles: a volume needs solid cells"));
        assert!(refusal(of(&[10, 42], &[4, 8], &[0, 1, 2, 3, 0, 1, 2, 3])).contains("1 of type 42"));
        let options = ReadOptions::within(100);
        let error = build_with(of(&[10], &[4], &[0, 1, 2, 3]), &ReadOptions::within(20), None).unwrap_err();
        assert!(error.to_string().contains("the limit of 20"), "{error}");
        assert!(build_with(of(&[10], &[4], &[0, 1, 2, 3]), &options, None).is_ok());
    }

    #[test]
    fn vertices_are_points_with_what_is_asked_for() {
        let dataset = || Dataset {
            points: vec![DVec3::ZERO, DVec3::NAN, DVec3::ONE],
            types: vec![1; 3],
            ends: vec![1, 2, 3],
            nodes: vec![0, 1, 2],
        };
        let options = ReadOptions {
            radius: Some("field".into()),
            weight: Some("field".into()),
            ..ReadOptions::within(1 << 20)
        };
        let mut some = dataset();
        some.points[1] = DVec3::X;
        some.points[2] = DVec3::Z;
        let loaded = build_with(some, &options, None).unwrap();
        let Data::Points(points) = loaded.data else { panic!() };
        assert_eq!(points.size(), &KernelSize::Radii(vec![1.0, 3.0, 1.5]));
        assert_eq!(points.weights().unwrap(), [1.0, 3.0, 1.5]);
        assert!(points.scalars().is_none(), "a size is not what is shown");
        // The place that is no place goes with everything that belongs to it.
        let source = Source::in_memory(&[("a.vtu", b"")]).unwrap();
        let options = ReadOptions::within(1 << 20);
        let origin =
            Origin { source: &source, format: "test", arrays: vec![array("s", Association::Point, 1)] };
        let mut read = |_: usize, _: Pick| Ok(Samples::F32(vec![5.0, 6.0, 7.0]));
        let mut budget = Budget::new(&source, &options);
        let loaded = dataset().build(origin, &mut budget, &mut read, &options).unwrap();
        let Data::Points(points) = loaded.data else { panic!() };
        assert_eq!((points.centres().len(), points.scalars().unwrap()), (2, [5.0, 7.0].as_slice()));
        assert_eq!(loaded.report.notes, ["1 points whose place is not finite left out"]);
    }

    #[test]
    fn coarse_values_are_told() {
        let of =
            |kind, range| coarse(range, &ArrayInfo { kind, ..array("a", Association::Point, 1) }).is_some();
        assert!(of(SampleType::F64, [100_000.0, 100_001.0]) && !of(SampleType::F64, [0.0, 1.0]));
        assert!(of(SampleType::I64, [0.0, 1e9]) && !of(SampleType::I32, [-16_777_216.0, 1e6]));
        assert!(!of(SampleType::F32, [100_000.0, 100_001.0]));
    }
}
