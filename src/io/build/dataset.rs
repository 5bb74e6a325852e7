//! Points and cells of an unstructured data set, and their consistency.

use glam::DVec3;

use crate::error::Result;
use crate::io::file::source::Source;
use crate::num;
use crate::scene::CellKind;

/// Points, and cells with VTK type numbers and lists of nodes.
#[derive(Debug, Default)]
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
                return Err(source.error(
                    "cells",
                    format!(
                        "cell {cell}: its nodes are {begin} to {end} of {}: offsets must not decrease",
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
}
