//! Unstructured grids and polygonal data.

use crate::error::Result;
use crate::io::build::dataset::{self, Dataset};
use crate::io::build::points;
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::vtk_legacy::File;
use crate::io::formats::vtk_legacy::contents::Cells;
use crate::io::formats::vtk_legacy::stored::{Stored, room};
use crate::io::report::Found;
use crate::num;

impl File<'_> {
    pub(crate) fn unstructured_grid(&mut self) -> Result<Found> {
        let source = self.source;
        let points = self.contents.points.ok_or_else(|| self.missing("POINTS"))?;
        let (cells, types) = (self.contents.cells, self.contents.types);
        let count = cells.map_or(0, |cells| cells.count());
        match types {
            Some(types) if types.tuples != count => {
                let rule = format!("CELL_TYPES {}: there are {count} cells", types.tuples);
                return Err(types.error(source, rule));
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
            types.indices(source, &mut |number| {
                let kind =
                    u8::try_from(number).map_err(|_| format!("cell type {number}: must be from 0 to 255"))?;
                dataset.types.push(kind);
                Ok(())
            })?;
        }
        self.dataset(dataset)
    }

    pub(crate) fn poly_data(&mut self) -> Result<Found> {
        let source = self.source;
        let points = self.contents.points.ok_or_else(|| self.missing("POINTS"))?;
        let counts = self.contents.surface.map(|count| count.unwrap_or(0));
        let all = counts.iter().fold(0_u64, |all, &count| all.saturating_add(count));
        self.contents.fit(source, points.tuples, all)?;
        // Nodes are not read: vertices are the points, and other cells have no volume.
        let counts = [2, 4, 7, 6].into_iter().zip(counts).filter(|&(_, count)| count > 0).collect();
        dataset::check_points(source, &counts)?;
        self.budget.take("POINTS", dataset::bytes(points.tuples, 0, 0))?;
        let points = points.points(source)?;
        self.build(|origin| points::points(points, origin))
    }
}

/// Reads cells that give their number of nodes before the nodes.
fn inline(source: &Source, numbers: &Stored, count: u64, dataset: &mut Dataset) -> Result<()> {
    let nodes = numbers.tuples.saturating_sub(count);
    // Memory is reserved for exactly this number, so that lists never grow.
    dataset.ends = room(source, "CELLS", count)?;
    dataset.nodes = room(source, "CELLS", nodes)?;
    let most = text::index(source, "CELLS", count)?;
    let mut left = 0;
    numbers.indices(source, &mut |number| {
        if left > 0 {
            dataset.nodes.push(number);
            left -= 1;
            return Ok(());
        }
        let cell = dataset.ends.len();
        if cell == most {
            return Err(format!("{count} cells have fewer than {} numbers", numbers.tuples));
        }
        left = number;
        let end = num::wide(dataset.nodes.len()) + u64::from(number);
        if end > nodes {
            return Err(format!("cell {cell}: {number} nodes, fewer are left"));
        }
        dataset.ends.push(u32::try_from(end).unwrap_or(u32::MAX));
        Ok(())
    })?;
    if dataset.ends.len() != most {
        let rule = format!("{} cells, {count} are announced", dataset.ends.len());
        return Err(numbers.error(source, rule));
    }
    Ok(())
}

/// Reads cells with separate lists of offsets and nodes.
fn separate(source: &Source, offsets: &Stored, nodes: &Stored, dataset: &mut Dataset) -> Result<()> {
    dataset.ends = offsets.room(source)?;
    let mut first = true;
    offsets.indices(source, &mut |offset| {
        if !std::mem::take(&mut first) {
            dataset.ends.push(offset);
        } else if offset != 0 {
            return Err(format!("the first offset is {offset}: must be 0"));
        }
        Ok(())
    })?;
    dataset.nodes = nodes.room(source)?;
    nodes.indices(source, &mut |node| {
        dataset.nodes.push(node);
        Ok(())
    })
}
