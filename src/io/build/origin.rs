//! The file that data comes from, with its arrays and the function that reads one of them.

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association};
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::{Pick, SampleType};
use crate::io::file::source::Source;
use crate::num;
use crate::scene::Samples;

/// Reads one number per tuple of the array with this index.
pub(crate) type ReadArray<'r> = dyn FnMut(usize, Pick) -> Result<Samples> + 'r;

/// The file that data comes from, its format and its arrays.
pub(crate) struct Origin<'a> {
    pub(crate) source: &'a Source,
    pub(crate) format: &'static str,
    pub(crate) arrays: Vec<ArrayInfo>,
}

/// Reads the flags of VTK's ghost array of points or cells, if there is one.
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
