//! Shared by the formats of grids: the component that is read, and the placement of the result.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::io::build::arrays::{self, ArrayInfo, Association};
use crate::io::file::decode::{Layout, MAX_COMPONENTS};
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::scene::{Anatomy, Grid, Rescale};

/// The name of the only array of a grid file.
const NAME: &str = "values";

/// The numbers at each sample of a grid, and the selected part.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub(crate) layout: Layout,
    array: ArrayInfo,
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
        options: &ReadOptions,
    ) -> Result<Self> {
        options.check_kernels("a grid").map_err(|error| error.in_file(source.path()))?;
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
        let choice = arrays::choose(source, std::slice::from_ref(&array), options.array.as_deref())?;
        let pick = choice.map_or(Pick::Component(0), |choice| choice.pick);
        Ok(Self { layout: Layout { components, pick, ..layout }, array })
    }

    /// Returns the rescale of the selected part, given that of stored numbers. `place` is the header field of the
    /// rescale.
    pub(crate) fn rescale(&self, source: &Source, place: &str, rescale: Rescale) -> Result<Rescale> {
        rescale_of(self.layout.pick, NAME, source, place, rescale)
    }

    /// Places the grid and adds the report. `located` adds the header field to an error about a value.
    pub(crate) fn placed(
        self,
        format: &'static str,
        grid: Grid,
        placement: Placement,
        located: &dyn Fn(&'static str, Error) -> Error,
    ) -> Result<Loaded> {
        let Placement { place, spacing, origin, direction, anatomy, notes, warnings } = placement;
        let grid = grid.with_placement(spacing, origin, direction).map_err(|error| located(place, error))?;
        let mut loaded = self.loaded(format, grid.with_anatomy(anatomy));
        loaded.report.notes.extend(notes);
        loaded.report.warnings.extend(warnings);
        Ok(loaded)
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
