//! The file that data comes from, with its arrays and what it takes to read them.

use std::ops::Range;

use glam::DVec3;

use crate::error::Result;
use crate::io::build::arrays::{self, ArrayInfo, Association, Choice, coarse, describe};
use crate::io::build::data_file::{Array, DataFile, Shape};
use crate::io::file::budget::Budget;
use crate::io::file::decode::Values;
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::options::{Request, Wanted};
use crate::io::report::{Found, Loaded};
use crate::num;
use crate::scene::{Data, Samples};

/// The limit on the magnitude of coordinates that are rendered. Cubes of lengths stay within 64-bit floats.
const FARTHEST: f64 = 1e100;

/// Whether a place is near enough to be rendered.
pub(crate) fn is_near(place: DVec3) -> bool {
    place.abs().max_element() <= FARTHEST
}

/// Returns the rule that a place breaks.
pub(crate) fn too_far(place: DVec3) -> String {
    let [x, y, z] = place.to_array();
    format!("{x:e}, {y:e}, {z:e}: coordinates that are rendered must be within {FARTHEST:e} of 0")
}

/// Reads the picked part of each tuple of the array with this index.
pub(crate) type ReadArray<'r> = dyn FnMut(usize, Pick) -> Result<Values> + 'r;

/// The file that data comes from, and what it takes to build scene data.
pub(crate) struct Origin<'o, 'b> {
    pub(crate) source: &'o Source,
    pub(crate) format: &'static str,
    pub(crate) arrays: Vec<ArrayInfo>,
    /// The arrays that are also parts of others.
    pub(crate) spare: Range<usize>,
    pub(crate) request: &'o Request<'o>,
    pub(crate) budget: &'o mut Budget<'b>,
    pub(crate) read: &'o mut ReadArray<'o>,
}

impl Origin<'_, '_> {
    /// Reads the flags of VTK's ghost array of points or cells, if there is one.
    pub(crate) fn ghosts(&mut self, association: Association, count: usize) -> Result<Option<Vec<u8>>> {
        let index = self.arrays.iter().position(|array| array.is_ghosts(association));
        let Some(index) = index else { return Ok(None) };
        self.budget.take("vtkGhostType", num::wide(count))?;
        Ok(match (self.read)(index, Pick::Component(0))?.into_samples() {
            Samples::U8(flags) if flags.len() == count => Some(flags),
            _ => None,
        })
    }

    /// Whether the arrays are kept as they are in the file.
    pub(crate) fn is_kept(&self) -> bool {
        self.request.wanted != Wanted::Scene
    }

    /// Reads the requested arrays as they are in the file. `counts` are the numbers of points and of cells.
    pub(crate) fn keep(self, shape: Shape, counts: [usize; 2]) -> Result<Found> {
        let &Request { options, wanted } = self.request;
        let mut kept = Vec::new();
        let mut warnings = Vec::new();
        let chosen = if wanted == Wanted::OneArray && matches!(shape, Shape::Cells(_)) {
            // Formats of one array hold no cells: their writers refuse them, whatever the arrays.
            Vec::new()
        } else {
            arrays::select(self.source, &self.arrays, &self.spare, self.request)?
        };
        let twice = (self.arrays.len() - self.spare.len()).saturating_sub(chosen.len());
        if wanted == Wanted::Arrays && options.array.is_none() && twice > 0 {
            warnings.push(format!("{twice} arrays left out: others have the same names"));
        }
        for &Choice { index, pick } in &chosen {
            let info = self.arrays[index].clone();
            let count = counts[usize::from(info.association == Association::Cell)];
            let place = format!("array {info}");
            self.budget.take(
                &place,
                num::wide(count).saturating_mul(Pick::Whole.bytes(info.kind, info.components)),
            )?;
            let values = (self.read)(index, Pick::Whole)?;
            match values {
                Values::Whole(tuples) if tuples.bytes.len() == count.saturating_mul(tuples.size) => {
                    kept.push(Array { info, tuples }.picked(pick));
                }
                values => {
                    let rule = format!("{} tuples: {count} are needed", values.len());
                    if options.array.is_some() {
                        return Err(self.source.error(place, rule));
                    }
                    warnings.push(format!("{place} left out: {rule}"));
                }
            }
        }
        let mut found = Found::of_arrays(self.format, DataFile { shape, arrays: kept });
        found.report.arrays = self.arrays;
        found.report.warnings = warnings;
        Ok(found)
    }

    /// Refuses points that lie too far away to be rendered. Those that are not finite are left out later.
    pub(crate) fn check_places(&self, points: &[DVec3]) -> Result<()> {
        let far = points.iter().position(|point| point.is_finite() && !is_near(*point));
        match far {
            Some(i) => Err(self.source.error(format!("point {i}"), too_far(points[i]))),
            None => Ok(()),
        }
    }

    /// Wraps data with a report on its arrays and the one that it shows.
    pub(crate) fn loaded(self, data: Data, shown: Option<Choice>, notes: Vec<String>) -> Loaded {
        let range = data.range();
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
