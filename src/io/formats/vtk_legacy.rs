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
mod file;
mod grids;
mod keywords;
mod stored;
mod walk;
mod walk_arrays;
mod walk_keywords;

use crate::error::Result;
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::formats::vtk_legacy::contents::Kind;
use crate::io::formats::vtk_legacy::file::{File, NAME};
use crate::io::formats::vtk_legacy::keywords::MAGIC;
use crate::io::formats::vtk_legacy::walk::Walk;
use crate::io::options::ReadOptions;
use crate::io::reader::Reader;
use crate::io::report::Loaded;

pub(crate) struct VtkLegacy;

impl Reader for VtkLegacy {
    fn name(&self) -> &'static str {
        NAME
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["vtk", "vtk.gz"]
    }

    fn recognises(&self, source: &Source) -> bool {
        source.head().get(..MAGIC.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(MAGIC))
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let contents = Walk::over(source)?;
        let budget = Budget::new(source, options);
        File { source, options, budget, contents, shown: None }.read()
    }
}

impl File<'_> {
    pub(crate) fn read(mut self) -> Result<Loaded> {
        let mut loaded = match self.contents.kind {
            Kind::StructuredPoints => {
                let places = self.structured_points();
                self.lattice(places)
            }
            Kind::RectilinearGrid => {
                let places = self.rectilinear()?;
                self.lattice(places)
            }
            Kind::StructuredGrid => self.structured_grid(),
            Kind::UnstructuredGrid => self.unstructured_grid(),
            Kind::PolyData => self.poly_data(),
        }?;
        // Notes of the first pass come first.
        self.contents.notes.append(&mut loaded.report.notes);
        self.contents.warnings.append(&mut loaded.report.warnings);
        loaded.report.notes = self.contents.notes;
        loaded.report.warnings = self.contents.warnings;
        Ok(loaded)
    }
}
