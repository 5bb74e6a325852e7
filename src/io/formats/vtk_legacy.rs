//! VTK's legacy files (`.vtk`), versions 1.0 to 5.1, as text or binary.
//!
//! | data set | result |
//! |---|---|
//! | `STRUCTURED_POINTS` | a grid |
//! | `RECTILINEAR_GRID` | a grid; uneven coordinates are resampled |
//! | `STRUCTURED_GRID` | a grid if its points lie on an even lattice, which may be oblique; else hexahedra |
//! | `UNSTRUCTURED_GRID` | a mesh, or points if it has vertices but no cells with volume |
//! | `POLYDATA` | points, if it has no lines and polygons |
//!
//! A first pass over the file finds where each array lies; needed arrays are then read from there. The first scalars of
//! points are the active array, else the first of cells.
//!
//! Numbers of type `long` have 4 or 8 bytes in binary files, depending on the writer's machine. They are taken as 4 bytes
//! if a keyword, another array or the end of the file follows at that distance. `vtkIdType` always has 4 bytes, as VTK
//! writes it.

mod cells;
mod contents;
mod grids;
mod keywords;
mod stored;
mod walk;
mod walk_arrays;

use crate::error::{Error, Result};
use crate::io::build::arrays::Association;
use crate::io::build::dataset::Dataset;
use crate::io::build::lattice::{self, Places};
use crate::io::build::origin::Origin;
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::formats::vtk_legacy::contents::{Contents, Kind};
use crate::io::formats::vtk_legacy::keywords::MAGIC;
use crate::io::formats::vtk_legacy::walk::Walk;
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;

pub(crate) struct VtkLegacy;

impl Reader for VtkLegacy {
    fn name(&self) -> &'static str {
        "VTK legacy"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["vtk", "vtk.gz"]
    }

    fn recognises(&self, source: &Source) -> bool {
        source.head().get(..MAGIC.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(MAGIC))
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let contents = Walk::over(source)?;
        let budget = Budget::new(source, request);
        let mut file = File { source, request, budget, contents, shown: None };
        let mut loaded = match file.contents.kind {
            Kind::StructuredPoints => {
                let places = file.structured_points();
                file.lattice(places)
            }
            Kind::RectilinearGrid => {
                let places = file.rectilinear()?;
                file.lattice(places)
            }
            Kind::StructuredGrid => file.structured_grid(),
            Kind::UnstructuredGrid => file.unstructured_grid(),
            Kind::PolyData => file.poly_data(),
        }?;
        // Notes of the first pass come first.
        loaded.report.notes.splice(0..0, file.contents.notes);
        loaded.report.warnings.splice(0..0, file.contents.warnings);
        Ok(loaded)
    }
}

/// A file after its first pass.
struct File<'a> {
    source: &'a Source,
    request: &'a Request<'a>,
    budget: Budget<'a>,
    contents: Contents,
    /// Whether each cell of the file is kept, if some are dropped.
    shown: Option<Vec<bool>>,
}

impl File<'_> {
    fn missing(&self, keyword: &str) -> Error {
        self.source.error(keyword, format!("missing: {} needs it", self.contents.kind.name()))
    }

    /// Returns the dimensions, and the numbers of points and cells that follow.
    fn dims(&self) -> Result<([u32; 3], u64, u64)> {
        let dims = self.contents.dims.ok_or_else(|| self.missing("DIMENSIONS"))?;
        let [x, y, z] = dims;
        let product = |dims: [u32; 3]| dims.iter().try_fold(1_u64, |n, &d| n.checked_mul(u64::from(d)));
        let points = product(dims).ok_or_else(|| {
            self.source.error("DIMENSIONS", format!("{x} x {y} x {z}: more points than 64 bits can count"))
        })?;
        // A grid of one layer has flat cells.
        let cells = product(dims.map(|d| d.saturating_sub(1).max(1))).unwrap_or(u64::MAX);
        Ok((dims, points, cells))
    }

    /// Passes the arrays of the file, its memory and the function that reads an array to a builder.
    fn build(&mut self, build: impl FnOnce(Origin) -> Result<Found>) -> Result<Found> {
        let (source, shown, arrays) = (self.source, self.shown.as_deref(), &self.contents.arrays);
        let mut read = |index: usize, pick| {
            let (info, stored) = &arrays[index];
            let mut samples = stored.values(source, pick)?;
            if let Some(shown) = shown.filter(|_| info.association == Association::Cell) {
                samples.keep(shown);
            }
            Ok(samples)
        };
        let arrays = arrays.iter().map(|(info, _)| info.clone()).collect();
        let (request, budget, read) = (self.request, &mut self.budget, &mut read);
        build(Origin { source, format: VtkLegacy.name(), arrays, spare: 0..0, request, budget, read })
    }

    fn lattice(&mut self, places: Places) -> Result<Found> {
        let (dims, points, cells) = self.dims()?;
        self.contents.fit(self.source, points, cells)?;
        self.build(|origin| lattice::build(origin, dims, places, None))
    }

    fn dataset(&mut self, dataset: Dataset) -> Result<Found> {
        self.build(|origin| dataset.build(origin))
    }
}
