//! The file that data comes from, with its arrays and the function that reads one of them.

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association, Choice, coarse, describe};
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::report::Loaded;
use crate::num;
use crate::scene::{Data, Samples};

/// Reads one number per tuple of the array with this index.
pub(crate) type ReadArray<'r> = dyn FnMut(usize, Pick) -> Result<Samples> + 'r;

/// The file that data comes from, its format and its arrays.
pub(crate) struct Origin<'a> {
    pub(crate) source: &'a Source,
    pub(crate) format: &'static str,
    pub(crate) arrays: Vec<ArrayInfo>,
}

impl Origin<'_> {
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

/// Reads the flags of VTK's ghost array of points or cells, if there is one.
pub(crate) fn ghosts(
    arrays: &[ArrayInfo],
    association: Association,
    count: usize,
    budget: &mut Budget,
    read: &mut ReadArray,
) -> Result<Option<Vec<u8>>> {
    let Some(index) = arrays.iter().position(|array| array.is_ghosts(association)) else { return Ok(None) };
    budget.take("vtkGhostType", num::wide(count))?;
    Ok(match read(index, Pick::Component(0))? {
        Samples::U8(flags) if flags.len() == count => Some(flags),
        _ => None,
    })
}
