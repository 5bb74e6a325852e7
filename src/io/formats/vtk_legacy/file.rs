//! A file after its first pass.

use crate::error::{Error, Result};
use crate::io::build::arrays::Association;
use crate::io::build::dataset::Dataset;
use crate::io::build::lattice::{self, Places};
use crate::io::build::origin::Origin;
use crate::io::build::points::keep;
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::formats::vtk_legacy::contents::Contents;
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::scene::Samples;

pub(crate) const NAME: &str = "VTK legacy";

/// A file after its first pass.
pub(crate) struct File<'a> {
    pub(crate) source: &'a Source,
    pub(crate) options: &'a ReadOptions,
    pub(crate) budget: Budget<'a>,
    pub(crate) contents: Contents,
    /// Whether each cell of the file is kept, if some are dropped.
    pub(crate) shown: Option<Vec<bool>>,
}

impl File<'_> {
    pub(crate) fn missing(&self, keyword: &str) -> Error {
        self.source.error(keyword, format!("missing: {} needs it", self.contents.kind.name()))
    }

    /// Returns the dimensions, and the numbers of points and cells that follow.
    pub(crate) fn dims(&self) -> Result<([u32; 3], u64, u64)> {
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

    pub(crate) fn origin(&mut self) -> (Origin<'_>, impl FnMut(usize, Pick) -> Result<Samples> + use<'_>) {
        let source = self.source;
        let stored = &self.contents.stored;
        let shown = self.shown.as_deref();
        let arrays = std::mem::take(&mut self.contents.arrays);
        let of_cells: Vec<bool> = arrays.iter().map(|a| a.association == Association::Cell).collect();
        let read = move |index: usize, pick| {
            let none = || source.error("arrays", format!("{index}: there is no such array"));
            let mut samples = stored.get(index).ok_or_else(none)?.samples(source, pick)?;
            if let Some(shown) = shown
                && of_cells.get(index) == Some(&true)
            {
                keep_samples(&mut samples, shown);
            }
            Ok(samples)
        };
        (Origin { source, format: NAME, arrays }, read)
    }

    pub(crate) fn lattice(&mut self, places: Places) -> Result<Loaded> {
        let (dims, points, cells) = self.dims()?;
        self.contents.fit(self.source, points, cells)?;
        let options = self.options;
        let mut budget = std::mem::replace(&mut self.budget, Budget::new(self.source, options));
        let (origin, mut read) = self.origin();
        lattice::build(origin, dims, places, &mut budget, &mut read, options)
    }

    pub(crate) fn dataset(&mut self, dataset: Dataset) -> Result<Loaded> {
        let options = self.options;
        let mut budget = std::mem::replace(&mut self.budget, Budget::new(self.source, options));
        let (origin, mut read) = self.origin();
        dataset.build(origin, &mut budget, &mut read, options)
    }
}

/// Keeps the samples that are marked.
fn keep_samples(samples: &mut Samples, marked: &[bool]) {
    match samples {
        Samples::U8(list) => keep(list, marked),
        Samples::U16(list) => keep(list, marked),
        Samples::I16(list) => keep(list, marked),
        Samples::F32(list) => keep(list, marked),
    }
}
