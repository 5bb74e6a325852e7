//! The file that data comes from, with its arrays and what it takes to read them.

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association, Choice, coarse, describe};
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::num;
use crate::scene::{Data, Samples};

/// Reads one number per tuple of the array with this index.
pub(crate) type ReadArray<'r> = dyn FnMut(usize, Pick) -> Result<Samples> + 'r;

/// The file that data comes from, and what it takes to build scene data.
pub(crate) struct Origin<'o, 'b> {
    pub(crate) source: &'o Source,
    pub(crate) format: &'static str,
    pub(crate) arrays: Vec<ArrayInfo>,
    pub(crate) options: &'o ReadOptions,
    pub(crate) budget: &'o mut Budget<'b>,
    pub(crate) read: &'o mut ReadArray<'o>,
}

impl Origin<'_, '_> {
    /// Reads the flags of VTK's ghost array of points or cells, if there is one.
    pub(crate) fn ghosts(&mut self, association: Association, count: usize) -> Result<Option<Vec<u8>>> {
        let index = self.arrays.iter().position(|array| array.is_ghosts(association));
        let Some(index) = index else { return Ok(None) };
        self.budget.take("vtkGhostType", num::wide(count))?;
        Ok(match (self.read)(index, Pick::Component(0))? {
            Samples::U8(flags) if flags.len() == count => Some(flags),
            _ => None,
        })
    }

    /// Wraps data with a report on its arrays and the one that it shows.
    pub(crate) fn loaded(self, data: Data, shown: Option<Choice>, notes: Vec<String>) -> Loaded {
        let range = match &data {
            Data::Grid(grid) => grid.range(),
            Data::Mesh(mesh) => mesh.range(),
            Data::Points(points) => points.range(),
        };
        let mut loaded = Loaded::new(self.format, data);
        let report = &mut loaded.report;
        if let Some(Choice { index, pick }) = shown {
            report.shown = Some(describe(&self.arrays[index], pick));
            report.warnings.extend(coarse(range, &self.arrays[index]));
        }
        report.arrays = self.arrays;
        report.notes = notes;
        loaded
    }
}
