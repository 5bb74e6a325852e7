//! Points and cells of an unstructured data set, and which cells by VTK type number have a volume and are supported.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::error::Result;
use crate::io::file::source::Source;
use crate::num;
use crate::scene::CellKind;

/// Points, and cells with VTK type numbers and lists of nodes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Dataset {
    pub(crate) points: Vec<DVec3>,
    /// The VTK type of each cell.
    pub(crate) types: Vec<u8>,
    /// The end of each cell's nodes in `nodes`.
    pub(crate) ends: Vec<u32>,
    /// Indices of points.
    pub(crate) nodes: Vec<u32>,
}

/// Returns the memory of a data set in bytes, to be taken from the budget before it is allocated.
pub(crate) fn bytes(points: u64, cells: u64, nodes: u64) -> u64 {
    let (points, cells) = (points.saturating_mul(24), cells.saturating_mul(5));
    points.saturating_add(cells).saturating_add(nodes.saturating_mul(4))
}

impl Dataset {
    /// Makes each point a vertex.
    pub(crate) fn of_points(points: Vec<DVec3>) -> Self {
        let count = num::count(points.len());
        Self {
            types: vec![1; points.len()],
            ends: (1..=count).collect(),
            nodes: (0..count).collect(),
            points,
        }
    }

    /// Checks that nodes are indices of points, and that each cell has as many as its type needs.
    pub(crate) fn check(&self, source: &Source) -> Result<()> {
        let Self { points, types, ends, nodes } = self;
        if types.len() != ends.len() {
            let rule = format!("{} types, {} offsets: must be as many", types.len(), ends.len());
            return Err(source.error("cells", rule));
        }
        let mut begin = 0;
        for (cell, (&end, &number)) in ends.iter().zip(types).enumerate() {
            if end < begin || num::index(end) > nodes.len() {
                let rule =
                    format!("its nodes are {begin} to {end} of {}: offsets must not decrease", nodes.len());
                return Err(source.error("cells", format!("cell {cell}: {rule}")));
            }
            if let Some(kind) = CellKind::of_vtk(number)
                && num::index(end - begin) != kind.nodes()
            {
                let (own, name) = (end - begin, kind.name());
                let rule = format!("cell {cell}: {own} nodes, {name} have {}", kind.nodes());
                return Err(source.error("cells", rule));
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
}

/// The number of cells of each VTK type.
pub(crate) type Counts = BTreeMap<u8, u64>;

/// Whether cells of this VTK type have no volume.
pub(crate) fn flat(number: u8) -> bool {
    matches!(number, 0..=9 | 21..=23 | 28 | 30 | 34..=36 | 60..=63 | 68..=70 | 75..=77)
}

/// Refuses cells with a volume that cannot be cut into tetrahedra, which must not be dropped silently.
pub(crate) fn check_supported(source: &Source, counts: &Counts) -> Result<()> {
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

/// Checks that cells without volume are vertices at most (types 0 to 2: empty, vertex, poly-vertex), so that the data
/// set can be read as points.
pub(crate) fn check_points(source: &Source, counts: &Counts) -> Result<()> {
    check_supported(source, counts)?;
    if counts.keys().all(|&number| number <= 2) {
        return Ok(());
    }
    Err(source.error("cells", format!("{}: a volume needs solid cells, or points alone", named(counts))))
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
