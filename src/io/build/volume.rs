//! Shared by the formats of grids: the component that is read, and the placement of the result.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::io::build::arrays::{self, ArrayInfo, Association, Choice};
use crate::io::build::data_file::{Array, DataFile, Lattice, Shape, Unit, stand_in};
use crate::io::file::decode::{Layout, MAX_COMPONENTS, Tuples, Values};
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::options::{Request, Wanted};
use crate::io::report::{Found, Loaded};
use crate::scene::{Anatomy, Grid, Rescale};

/// The name of the only array of a grid file.
const NAME: &str = "values";

/// The numbers at each sample of a grid, and the selected part.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub(crate) layout: Layout,
    array: ArrayInfo,
    /// The part that is kept as it is in the file, instead of samples for scenes.
    kept: Option<Pick>,
    tuples: Option<Tuples>,
    /// The unit of lengths, which scenes do not have.
    pub(crate) unit: Unit,
}

/// The placement of a grid, with notes and warnings on it.
pub(crate) struct Placement {
    /// The header field that errors about the placement name.
    pub(crate) place: &'static str,
    pub(crate) spacing: DVec3,
    pub(crate) origin: DVec3,
    pub(crate) direction: DMat3,
    pub(crate) anatomy: Anatomy,
    pub(crate) notes: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

impl Chosen {
    /// Chooses the component that the options select. `place` is the header field of the number of components.
    pub(crate) fn new(
        source: &Source,
        place: &str,
        layout: Layout,
        components: usize,
        request: &Request,
    ) -> Result<Self> {
        request.check_kernels("a grid").map_err(|error| error.in_file(source.path()))?;
        if !(1..=MAX_COMPONENTS).contains(&components) {
            let rule = format!("{components} components: must be 1 to {MAX_COMPONENTS}");
            return Err(source.error(place, rule));
        }
        let array = ArrayInfo {
            name: NAME.to_owned(),
            association: Association::Point,
            kind: layout.kind,
            components,
            active: true,
        };
        let arrays = std::slice::from_ref(&array);
        let mut kept = None;
        let mut pick = Pick::Component(0);
        if request.wanted == Wanted::Scene {
            let choice = arrays::choose(source, arrays, request.array.as_deref())?;
            pick = choice.map_or(pick, |choice| choice.pick);
        } else {
            let choices = arrays::select(source, arrays, &(0..0), request)?;
            kept = choices.first().map(|&Choice { pick, .. }| pick);
            pick = Pick::Whole;
        }
        let layout = Layout { components, pick, ..layout };
        Ok(Self { layout, array, kept, tuples: None, unit: Unit::Unknown })
    }

    /// Makes a grid of the samples. Whole tuples are put aside, and the grid stands in for theirs.
    pub(crate) fn grid(&mut self, values: Values) -> Result<Grid> {
        match values {
            Values::Samples(samples) => Grid::new(self.layout.dims, samples),
            Values::Whole(tuples) => {
                self.tuples = Some(tuples);
                stand_in()
            }
        }
    }

    /// Returns the rescale of the selected part, given that of stored numbers. `place` is the header field of the
    /// rescale.
    pub(crate) fn rescale(&self, source: &Source, place: &str, rescale: Rescale) -> Result<Rescale> {
        rescale_of(self.kept.unwrap_or(self.layout.pick), NAME, source, place, rescale)
    }

    /// Places the grid and adds the report. `located` adds the header field to an error about a value.
    pub(crate) fn placed(
        self,
        format: &'static str,
        grid: Grid,
        placement: Placement,
        located: &dyn Fn(&'static str, Error) -> Error,
    ) -> Result<Found> {
        let Placement { place, spacing, origin, direction, anatomy, notes, warnings } = placement;
        let grid = grid.with_anatomy(anatomy);
        let lattice = Lattice::new(self.layout.dims, spacing, origin, direction, &grid);
        let lattice = lattice.map_err(|error| located(place, error))?;
        let grid = grid.with_placement(spacing, origin, direction).map_err(|error| located(place, error))?;
        let mut found = self.found(format, grid, lattice);
        found.report.notes.extend(notes);
        found.report.warnings.extend(warnings);
        Ok(found)
    }

    /// Wraps the grid, or the tuples that were put aside, with a report on the array.
    pub(crate) fn found(self, format: &'static str, grid: Grid, lattice: Lattice) -> Found {
        let Self { array, kept: Some(pick), tuples: Some(tuples), unit, .. } = self else {
            return self.loaded(format, grid).into();
        };
        let kept = Array { info: array.clone(), tuples }.picked(pick);
        let mut found = Found::of_arrays(
            format,
            DataFile { shape: Shape::Even(Lattice { unit, ..lattice }), arrays: vec![kept] },
        );
        found.report.arrays = vec![array];
        found
    }

    /// Wraps the grid with a report on its array.
    pub(crate) fn loaded(self, format: &'static str, grid: Grid) -> Loaded {
        let Rescale { slope, intercept } = grid.rescale();
        let [a, b] = grid.range().map(|value| (value - intercept) / slope);
        let warning = arrays::coarse([a.min(b), a.max(b)], &self.array);
        let mut loaded = Loaded::new(format, grid);
        loaded.report.warnings.extend(warning);
        // A file with one number per sample names no arrays.
        if self.array.components > 1 {
            loaded.report.shown = Some(arrays::describe(&self.array, self.layout.pick));
            loaded.report.arrays = vec![self.array];
        }
        loaded
    }
}

/// Returns the rescale of the selected part, given that of stored numbers: the length of a tuple scales by the
/// magnitude of the slope, and has no intercept.
pub(crate) fn rescale_of(
    pick: Pick,
    array: &str,
    source: &Source,
    place: &str,
    rescale: Rescale,
) -> Result<Rescale> {
    if pick != Pick::Magnitude {
        return Ok(rescale);
    }
    if rescale.intercept != 0.0 {
        let rule = format!(
            "{}: shifts each component, which changes lengths: choose a component, such as {array}:0",
            rescale.intercept
        );
        return Err(source.error(place, rule));
    }
    Ok(Rescale { slope: rescale.slope.abs(), ..rescale })
}
