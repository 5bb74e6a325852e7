//! The contents of a data file in the types of the file: its points and cells, and all its arrays.

use std::path::Path;

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::io::build::arrays::{ArrayInfo, Association, list};
use crate::io::build::dataset::Dataset;
use crate::io::file::decode::{Tuples, magnitude};
use crate::io::file::sample_type::{Pick, SampleType, by_type};
use crate::num;
use crate::scene::{Anatomy, Grid, Rescale, Samples};

/// The contents of a data file: the places of its samples and all its arrays, in the types that the file has. Scene
/// data, in contrast, has one array in a type that is rendered.
#[derive(Clone, Debug)]
pub struct DataFile {
    pub(crate) shape: Shape,
    pub(crate) arrays: Vec<Array>,
}

/// The places of samples.
#[derive(Clone, Debug)]
pub(crate) enum Shape {
    /// Points on an even lattice.
    Even(Lattice),
    /// Points whose coordinates along each axis are listed, unevenly spaced.
    Uneven([Vec<f64>; 3]),
    /// Points and cells.
    Cells(Dataset),
}

/// A lattice of points, `origin + direction * (spacing * index)`, with the meaning of world axes and stored numbers.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    /// The number of points along each axis.
    pub(crate) dims: [u32; 3],
    pub(crate) spacing: DVec3,
    pub(crate) origin: DVec3,
    pub(crate) direction: DMat3,
    pub(crate) anatomy: Anatomy,
    pub(crate) rescale: Rescale,
    pub(crate) unit: Unit,
    /// Coordinates that the file lists, even up to rounding.
    pub(crate) listed: Option<[Vec<f64>; 3]>,
}

/// The unit of lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    Unknown,
    Metre,
    Millimetre,
    Micrometre,
}

impl Unit {
    /// Every unit in the order of NIfTI's codes, from 0, with its symbol in NRRD.
    pub(crate) const ALL: [(Self, &'static str); 4] =
        [(Self::Unknown, ""), (Self::Metre, "m"), (Self::Millimetre, "mm"), (Self::Micrometre, "um")];

    pub(crate) fn symbol(self) -> &'static str {
        Self::ALL.iter().find(|(unit, _)| *unit == self).map_or("", |(_, symbol)| symbol)
    }
}

/// An array with its tuples.
#[derive(Clone, Debug)]
pub(crate) struct Array {
    pub(crate) info: ArrayInfo,
    pub(crate) tuples: Tuples,
}

impl Lattice {
    /// Makes a lattice that [`Grid::with_placement`] accepts.
    pub(crate) fn new(
        dims: [u32; 3],
        spacing: DVec3,
        origin: DVec3,
        direction: DMat3,
        rules: &Grid,
    ) -> Result<Self> {
        let rules = rules.clone().with_placement(spacing, origin, direction)?;
        let (anatomy, rescale) = (rules.anatomy(), rules.rescale());
        let unit = Unit::Unknown;
        Ok(Self { dims, spacing, origin, direction, anatomy, rescale, unit, listed: None })
    }

    /// Returns the lattice of a grid.
    pub(crate) fn of(grid: &Grid, dims: [u32; 3]) -> Self {
        let (spacing, axes) = (grid.spacing(), grid.index_to_world());
        let direction =
            DMat3::from_cols(axes.x_axis / spacing.x, axes.y_axis / spacing.y, axes.z_axis / spacing.z);
        let (origin, anatomy, rescale) = (grid.origin(), grid.anatomy(), grid.rescale());
        let unit = Unit::Unknown;
        Self { dims, spacing, origin, direction, anatomy, rescale, unit, listed: None }
    }

    /// Returns the steps from point to point along each axis.
    pub(crate) fn steps(&self) -> [DVec3; 3] {
        let Self { spacing, direction, .. } = self;
        [direction.x_axis * spacing.x, direction.y_axis * spacing.y, direction.z_axis * spacing.z]
    }

    /// Returns the lattice of the centres of cells.
    pub(crate) fn of_cells(&self) -> Self {
        let [x, y, z] = self.steps();
        let dims = self.dims.map(|extent| extent.saturating_sub(1));
        Self { dims, origin: self.origin + (x + y + z) * 0.5, listed: None, ..self.clone() }
    }
}

/// Returns a grid of no meaning: it checks the placement and rescale of samples that are not rendered.
pub(crate) fn stand_in() -> Result<Grid> {
    Grid::new([2; 3], Samples::U8(vec![0; 8]))
}

impl DataFile {
    /// Describes the arrays.
    pub fn arrays(&self) -> impl ExactSizeIterator<Item = &ArrayInfo> {
        self.arrays.iter().map(|array| &array.info)
    }

    /// Whether samples lie on a lattice whose coordinates are unevenly spaced.
    #[must_use]
    pub fn is_uneven(&self) -> bool {
        matches!(self.shape, Shape::Uneven(_))
    }

    /// Describes shape and arrays in one line.
    #[must_use]
    pub fn summary(&self) -> String {
        format!("{}, {}", self.shape.summary(), list(self.arrays()))
    }

    /// Replaces stored numbers by values, as the rescale says, and returns a note on it. Values become whole numbers of
    /// 8 or 16 bits if all are such; otherwise 32-bit floats, or 64-bit floats where 32 bits may merge neighbours.
    pub(crate) fn rescaled(mut self) -> (Self, Option<String>) {
        let Shape::Even(lattice) = &mut self.shape else { return (self, None) };
        let rescale = std::mem::replace(&mut lattice.rescale, Rescale::IDENTITY);
        if rescale == Rescale::IDENTITY {
            return (self, None);
        }
        let Rescale { slope, intercept } = rescale;
        let mut note = None;
        for array in &mut self.arrays {
            let (stored, kind) = (array.info.kind, kind_of_values(array, rescale));
            let values = |numbers: &mut Vec<f64>| {
                numbers.iter_mut().for_each(|number| *number = slope * *number + intercept);
            };
            array.convert(kind, array.info.components, values);
            let (kind, stored) = (kind.name(), stored.name());
            note = Some(format!("values written as {kind}: {slope} * stored ({stored}) + {intercept}"));
        }
        (self, note)
    }

    /// Returns the one array of an even grid, with the lattice of its samples: the points, or the centres of cells.
    /// `path` is the output, for messages.
    pub(crate) fn one_array(&self, path: &Path) -> Result<(Lattice, &Array)> {
        let (Shape::Even(lattice), [array]) = (&self.shape, self.arrays.as_slice()) else {
            return Err(Error::file(path, "content", "must be one array of an even grid"));
        };
        let lattice = match array.info.association {
            Association::Point => lattice.clone(),
            Association::Cell => lattice.of_cells(),
        };
        Ok((lattice, array))
    }
}

impl Shape {
    /// Describes the shape in a few words.
    pub(crate) fn summary(&self) -> String {
        let lattice = |[x, y, z]: [usize; 3]| format!("a grid of {x} x {y} x {z} points");
        match self {
            Self::Even(own) => lattice(own.dims.map(num::index)),
            Self::Uneven(lists) => lattice([0, 1, 2].map(|axis| lists[axis].len())),
            Self::Cells(Dataset { points, types, .. }) if types.iter().all(|&kind| kind <= 2) => {
                format!("{} points", points.len())
            }
            Self::Cells(Dataset { points, types, .. }) => {
                format!("a mesh of {} points and {} cells", points.len(), types.len())
            }
        }
    }
}

impl Array {
    /// Keeps a part of each tuple. A magnitude is a 32-bit float, or a 64-bit float if components have more digits.
    pub(crate) fn picked(mut self, pick: Pick) -> Self {
        let components = self.info.components;
        match pick {
            Pick::Whole => {}
            Pick::Component(at) => {
                let size = self.tuples.size / components;
                let tuples = self.tuples.bytes.chunks_exact(self.tuples.size);
                let bytes = tuples.flat_map(|tuple| &tuple[at * size..(at + 1) * size]).copied().collect();
                (self.tuples, self.info.components) = (Tuples { size, bytes }, 1);
            }
            Pick::Magnitude => {
                let exact = self.info.kind == SampleType::F32 || self.info.kind.bytes() < 4;
                let kind = if exact { SampleType::F32 } else { SampleType::F64 };
                self.convert(kind, 1, |numbers| {
                    *numbers = numbers.chunks_exact(components).map(magnitude).collect();
                });
            }
        }
        self
    }

    /// Replaces tuples by those that a function makes of their numbers, a block at a time.
    fn convert(&mut self, kind: SampleType, components: usize, make: impl Fn(&mut Vec<f64>)) {
        const BLOCK: usize = 1 << 13;
        let old = std::mem::replace(&mut self.tuples, Tuples::none(kind, components));
        for bytes in old.bytes.chunks(BLOCK * old.size) {
            let mut numbers = numbers(self.info.kind, bytes);
            make(&mut numbers);
            self.tuples.push(kind, &numbers);
        }
        (self.info.kind, self.info.components) = (kind, components);
    }
}

fn numbers(kind: SampleType, bytes: &[u8]) -> Vec<f64> {
    macro_rules! numbers {
        ($type:ty) => {
            bytes.as_chunks().0.iter().map(|&bytes| <$type>::from_le_bytes(bytes) as f64).collect()
        };
    }
    by_type!(kind, numbers)
}

/// Returns the smallest type that keeps the values distinct.
fn kind_of_values(array: &Array, rescale: Rescale) -> SampleType {
    /// The least number of distinct float32 values that the range should have.
    const STEPS: f64 = 4096.0;
    let stored = array.info.kind;
    let codes = match stored {
        SampleType::F32 => false,
        kind if kind.bytes() < 4 => true,
        _ => return SampleType::F64,
    };
    let blocks = array.tuples.bytes.chunks(1 << 16);
    let range = blocks
        .flat_map(|bytes| numbers(stored, bytes))
        .filter(|x| x.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], x| [lo.min(x), hi.max(x)]);
    let Rescale { slope, intercept } = rescale;
    let [lo, hi] = rescale.of_range(range);
    if codes && slope.fract() == 0.0 && intercept.fract() == 0.0 {
        let whole = [
            (SampleType::U8, 0.0, f64::from(u8::MAX)),
            (SampleType::U16, 0.0, f64::from(u16::MAX)),
            (SampleType::I16, f64::from(i16::MIN), f64::from(i16::MAX)),
        ];
        if let Some((kind, ..)) = whole.into_iter().find(|&(_, least, most)| least <= lo && hi <= most) {
            return kind;
        }
    }
    let largest = lo.abs().max(hi.abs());
    let step = f64::from(f32::EPSILON) * largest.max(f64::from(f32::MIN_POSITIVE));
    let apart = if codes { slope.abs() >= 2.0 * step } else { lo == hi || (hi - lo) / step >= STEPS };
    if apart && largest <= f64::from(f32::MAX) { SampleType::F32 } else { SampleType::F64 }
}
