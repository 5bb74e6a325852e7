//! The contents of a file: its data set, and where each array lies.

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association};
use crate::io::file::source::Source;
use crate::io::formats::vtk_legacy::stored::Stored;

/// The limit on names in one note.
pub(crate) const MAX_NAMES: usize = 16;

/// The kind of a data set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Kind {
    #[default]
    StructuredPoints,
    RectilinearGrid,
    StructuredGrid,
    UnstructuredGrid,
    PolyData,
}

impl Kind {
    pub(crate) const ALL: [Self; 5] = [
        Self::StructuredPoints,
        Self::RectilinearGrid,
        Self::StructuredGrid,
        Self::UnstructuredGrid,
        Self::PolyData,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::StructuredPoints => "STRUCTURED_POINTS",
            Self::RectilinearGrid => "RECTILINEAR_GRID",
            Self::StructuredGrid => "STRUCTURED_GRID",
            Self::UnstructuredGrid => "UNSTRUCTURED_GRID",
            Self::PolyData => "POLYDATA",
        }
    }
}

/// Cells and their nodes in the file.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Cells {
    /// Each cell gives its number of nodes, then its nodes.
    Inline { count: u64, numbers: Stored },
    /// Since version 5: the begin of each cell's nodes, and the end of the last.
    Offsets { offsets: Stored, nodes: Stored },
}

impl Cells {
    pub(crate) fn count(&self) -> u64 {
        match self {
            Self::Inline { count, .. } => *count,
            Self::Offsets { offsets, .. } => offsets.tuples.saturating_sub(1),
        }
    }
}

/// The contents of a file.
#[derive(Debug, Default)]
pub(crate) struct Contents {
    pub(crate) kind: Kind,
    pub(crate) dims: Option<[u32; 3]>,
    /// Index of the first sample along each axis.
    pub(crate) first: [f64; 3],
    pub(crate) spacing: Option<[f64; 3]>,
    pub(crate) origin: Option<[f64; 3]>,
    /// A matrix, row by row; its columns are the axes.
    pub(crate) direction: Option<[f64; 9]>,
    pub(crate) coordinates: [Option<Stored>; 3],
    pub(crate) points: Option<Stored>,
    pub(crate) cells: Option<Cells>,
    pub(crate) types: Option<Stored>,
    /// Numbers of vertices, lines, polygons and triangle strips.
    pub(crate) surface: [Option<u64>; 4],
    /// Arrays of points and cells, each with its place.
    pub(crate) arrays: Vec<(ArrayInfo, Stored)>,
    pub(crate) notes: Vec<String>,
    pub(crate) warnings: Vec<String>,
    /// The numbers of points and cells for which data is announced.
    pub(crate) announced: [Option<u64>; 2],
    /// The first scalars of points and of cells.
    pub(crate) scalars: [Option<usize>; 2],
}

impl Contents {
    /// Marks the active array, and drops arrays whose size does not fit the numbers of points and cells.
    pub(crate) fn fit(&mut self, source: &Source, points: u64, cells: u64) -> Result<()> {
        let wanted = [points, cells];
        for ((count, wanted), what) in self.announced.iter().zip(wanted).zip(["POINT_DATA", "CELL_DATA"]) {
            if let Some(count) = count.filter(|&count| count != wanted) {
                return Err(source.error(what, format!("{count}: the data set has {wanted}")));
            }
        }
        if let Some(active) = self.scalars[0].or(self.scalars[1])
            && let Some((array, _)) = self.arrays.get_mut(active)
        {
            array.active = true;
        }
        let mut misfits = Vec::new();
        self.arrays.retain(|(array, Stored { tuples, .. })| {
            let wanted = wanted[side(array.association)];
            if *tuples != wanted {
                remember(&mut misfits, format!("{array} has {tuples} tuples instead of {wanted}"));
            }
            *tuples == wanted
        });
        if !misfits.is_empty() {
            self.warnings.push(format!("arrays left out: {}", misfits.join(", ")));
        }
        Ok(())
    }
}

/// Adds a name to those of a note, once, up to the limit.
pub(crate) fn remember(names: &mut Vec<String>, name: String) {
    match names.len() {
        0..MAX_NAMES if !names.contains(&name) => names.push(name),
        MAX_NAMES => names.push("and more".to_owned()),
        _ => {}
    }
}

/// Returns the place of data of points or cells in pairs.
pub(crate) fn side(association: Association) -> usize {
    usize::from(association == Association::Cell)
}
