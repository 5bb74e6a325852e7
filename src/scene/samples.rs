//! Stored samples of a grid, in memory or read when they are needed.

use std::collections::{HashMap, VecDeque};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::num;

/// The smallest number of samples along an axis.
pub(super) const MIN_SIDE: u32 = 2;

/// The types of samples that a device stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SampleKind {
    U8,
    U16,
    I16,
    F32,
}

/// The samples of a grid in the type that the device stores.
///
/// Readers convert other types (`i8`, `u32`, `i32`, `u64`, `i64`, `f64`) to `f32`.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 8-bit unsigned.
    U8(Vec<u8>),
    /// 16-bit unsigned.
    U16(Vec<u16>),
    /// 16-bit signed.
    I16(Vec<i16>),
    /// 32-bit float. NaN marks vacuum.
    F32(Vec<f32>),
    /// Read box by box from where they are kept, because memory has no room for all.
    OnDemand(OnDemand),
}

impl Samples {
    /// Returns the type of the samples.
    pub(crate) fn kind(&self) -> SampleKind {
        match self {
            Self::U8(_) => SampleKind::U8,
            Self::U16(_) => SampleKind::U16,
            Self::I16(_) => SampleKind::I16,
            Self::F32(_) => SampleKind::F32,
            Self::OnDemand(samples) => samples.kind(),
        }
    }

    /// Returns the number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::I16(v) => v.len(),
            Self::F32(v) => v.len(),
            Self::OnDemand(samples) => samples.len(),
        }
    }

    /// Returns whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the sample's stored number, before the grid's rescale.
    ///
    /// # Panics
    ///
    /// When `index` is not below [`Samples::len`]. Samples on demand that cannot be read are NaN.
    #[must_use]
    pub fn get(&self, index: usize) -> f64 {
        match self {
            Self::U8(v) => f64::from(v[index]),
            Self::U16(v) => f64::from(v[index]),
            Self::I16(v) => f64::from(v[index]),
            Self::F32(v) => f64::from(v[index]),
            Self::OnDemand(samples) => samples.get(index),
        }
    }

    /// Returns the name of the type in scene files.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        match self.kind() {
            SampleKind::U8 => "u8",
            SampleKind::U16 => "u16",
            SampleKind::I16 => "i16",
            SampleKind::F32 => "f32",
        }
    }

    /// Returns the size of one sample in bytes.
    #[must_use]
    pub fn sample_bytes(&self) -> usize {
        match self.kind() {
            SampleKind::U8 => 1,
            SampleKind::U16 | SampleKind::I16 => 2,
            SampleKind::F32 => 4,
        }
    }

    /// Returns the range of finite values, the number of NaN and the number of infinities. Without finite
    /// values the range is empty. Samples on demand are not counted: the range is that of their overview, and of floats one is taken to be NaN
    /// and one infinite.
    pub(crate) fn statistics(&self) -> ([f64; 2], usize, usize) {
        fn integers<T: Copy + Ord>(values: &[T]) -> [f64; 2]
        where
            f64: From<T>,
        {
            match (values.iter().min(), values.iter().max()) {
                (Some(&lo), Some(&hi)) => [f64::from(lo), f64::from(hi)],
                _ => [f64::INFINITY, f64::NEG_INFINITY],
            }
        }
        match self {
            Self::OnDemand(samples) => {
                let unknown = usize::from(samples.kind() == SampleKind::F32);
                (samples.overview().samples.statistics().0, unknown, unknown)
            }
            Self::U8(v) => (integers(v), 0, 0),
            Self::U16(v) => (integers(v), 0, 0),
            Self::I16(v) => (integers(v), 0, 0),
            Self::F32(v) => {
                let mut range = [f64::INFINITY, f64::NEG_INFINITY];
                let (mut nan, mut infinite) = (0, 0);
                for &value in v {
                    if value.is_finite() {
                        range[0] = range[0].min(f64::from(value));
                        range[1] = range[1].max(f64::from(value));
                    } else if value.is_nan() {
                        nan += 1;
                    } else {
                        infinite += 1;
                    }
                }
                (range, nan, infinite)
            }
        }
    }
}

/// Checks that each extent is at least [`MIN_SIDE`]; returns the number of samples, or `None` if memory cannot address them.
pub(super) fn sample_count(dims: [u32; 3]) -> Result<Option<usize>> {
    if let Some(extent) = dims.iter().find(|&&extent| extent < MIN_SIDE) {
        let why = format!("{dims:?} has {extent}: every extent must be at least {MIN_SIDE} samples");
        return Err(Error::invalid("grid extent", why));
    }
    Ok(dims.iter().try_fold(1_usize, |n, &extent| n.checked_mul(num::index(extent))))
}

/// A place from which the samples of a grid are read, box by box: a file, or a program's own data.
pub trait SampleSource: fmt::Debug + Send + Sync {
    /// Returns the samples of the box of `extent` samples from `first` on, x fastest, in memory and in the one type that all samples have.
    /// Several threads may ask at once.
    ///
    /// # Errors
    ///
    /// Errors of the source, in one line that names it.
    fn read(&self, first: [u32; 3], extent: [u32; 3]) -> Result<Samples>;

    /// Returns coarser samples of the whole grid, if the source has some; otherwise rows are read for them.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    fn overview(&self) -> Result<Option<Overview>> {
        Ok(None)
    }
}

/// Samples that are read from their source when they are needed.
#[derive(Clone, Debug)]
pub struct OnDemand(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    source: Box<dyn SampleSource>,
    dims: [u32; 3],
    kind: SampleKind,
    overview: Overview,
    cubes: Mutex<Cubes>,
    /// The first error of a single sample.
    failure: Mutex<Option<Error>>,
}

/// Coarser samples of a grid, on a lattice along the same axes.
#[derive(Clone, Debug)]
pub struct Overview {
    /// Number of samples along each axis.
    pub dims: [u32; 3],
    /// Where the first one lies, in indices of the grid.
    pub first: [f64; 3],
    /// The distance of two along each axis, in indices of the grid.
    pub step: [f64; 3],
    /// The samples in memory, x fastest, of the type of the grid's.
    pub samples: Samples,
}

/// Cubes of samples that were read last, for single samples.
#[derive(Debug, Default)]
struct Cubes {
    held: HashMap<[u32; 3], Arc<Samples>>,
    /// From the oldest to the newest.
    order: VecDeque<[u32; 3]>,
}

/// Side of the cubes of samples that are held.
const CUBE: u32 = 32;

/// Bytes of cubes that are held.
const HELD: usize = 256 << 20;

/// Most samples along an axis of an overview that is made of rows.
pub(crate) const OVERVIEW: u32 = 128;

impl OnDemand {
    /// Takes a source of `dims` samples and an overview: the source's, or one of at most 128 along each axis, which is read.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if an extent is below 2 or memory cannot address the samples; errors of the source.
    pub fn new(dims: [u32; 3], source: impl SampleSource + 'static) -> Result<Self> {
        sample_count(dims)?
            .ok_or_else(|| Error::invalid("grid extent", format!("{dims:?} overflows the address space")))?;
        let kind = source.read([0; 3], [1; 3])?.kind();
        let overview = match source.overview()? {
            Some(overview) => overview.checked(kind)?,
            None => Overview::read(&source, dims)?,
        };
        let source = Box::new(source);
        Ok(Self(Arc::new(Inner {
            source,
            dims,
            kind,
            overview,
            cubes: Mutex::default(),
            failure: Mutex::default(),
        })))
    }

    pub(crate) fn kind(&self) -> SampleKind {
        self.0.kind
    }

    /// Returns the number of samples along each axis.
    #[must_use]
    pub fn dims(&self) -> [u32; 3] {
        self.0.dims
    }

    pub(crate) fn len(&self) -> usize {
        self.0.dims.iter().map(|&n| num::index(n)).product()
    }

    /// Returns coarser samples of the whole grid.
    #[must_use]
    pub fn overview(&self) -> &Overview {
        &self.0.overview
    }

    /// Returns the samples of a box.
    ///
    /// # Errors
    ///
    /// Errors of the source; [`Error::Invalid`] if the box is not in the grid, or if the source gives other samples than were asked for.
    pub fn read(&self, first: [u32; 3], extent: [u32; 3]) -> Result<Samples> {
        let Inner { source, dims, kind, .. } = &*self.0;
        let inside = (0..3).all(|a| first[a].checked_add(extent[a]).is_some_and(|end| end <= dims[a]));
        if !inside || extent.contains(&0) {
            let why = format!("{extent:?} from {first:?} on: must lie within {dims:?}");
            return Err(Error::invalid("box of samples", why));
        }
        let samples = source.read(first, extent)?;
        let count: usize = extent.iter().map(|&n| num::index(n)).product();
        if samples.len() != count || samples.kind() != *kind || matches!(samples, Samples::OnDemand(_)) {
            let why = format!("{} of type {}: {count} were asked for", samples.len(), samples.type_name());
            return Err(Error::invalid("samples of a source", why));
        }
        Ok(samples)
    }

    /// Returns a run of samples in the order of the file, which take memory.
    pub(crate) fn run(&self, run: std::ops::Range<usize>) -> Samples {
        let all = run.map(|i| self.get(i));
        match self.kind() {
            SampleKind::U8 => Samples::U8(all.map(num::u8_code).collect()),
            SampleKind::U16 => Samples::U16(all.map(num::u16_code).collect()),
            SampleKind::I16 => Samples::I16(all.map(num::i16_code).collect()),
            SampleKind::F32 => Samples::F32(all.map(num::f32_of).collect()),
        }
    }

    /// Returns the first error of [`OnDemand::get`] since the last call.
    pub(crate) fn failure(&self) -> Result<()> {
        let error = self.0.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        error.map_or(Ok(()), Err)
    }

    /// Returns one sample, of a cube that is held; NaN where it cannot be read, which [`OnDemand::failure`] tells.
    pub(crate) fn get(&self, index: usize) -> f64 {
        let [nx, ny, _] = self.0.dims.map(num::index);
        let place = [index % nx, index / nx % ny, index / nx / ny].map(num::count);
        let corner = place.map(|i| i - i % CUBE);
        let extent = [0, 1, 2].map(|a| CUBE.min(self.0.dims[a] - corner[a]));
        let within = [0, 1, 2].map(|a| num::index(place[a] - corner[a]));
        let [across, rows, _] = extent.map(num::index);
        match self.cube(corner, extent) {
            Ok(cube) => cube.get((within[2] * rows + within[1]) * across + within[0]),
            Err(error) => {
                self.0.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                f64::NAN
            }
        }
    }

    fn cube(&self, corner: [u32; 3], extent: [u32; 3]) -> Result<Arc<Samples>> {
        let cubes = || self.0.cubes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cube) = cubes().held.get(&corner) {
            return Ok(Arc::clone(cube));
        }
        let cube = Arc::new(self.read(corner, extent)?);
        let mut cubes = cubes();
        if cubes.held.insert(corner, Arc::clone(&cube)).is_none() {
            cubes.order.push_back(corner);
        }
        let bytes = num::index(CUBE).pow(3) * cube.sample_bytes();
        while cubes.order.len() * bytes > HELD
            && let Some(oldest) = cubes.order.pop_front()
        {
            cubes.held.remove(&oldest);
        }
        Ok(cube)
    }
}

/// Sources are compared by identity.
impl PartialEq for OnDemand {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Overview {
    /// Checks what a source has given.
    fn checked(self, kind: SampleKind) -> Result<Self> {
        let Self { dims, first, step, samples } = &self;
        let is_placed = first.iter().all(|x| x.is_finite()) && step.iter().all(|x| *x > 0.0 && x.is_finite());
        let count = sample_count(*dims)?;
        let is_held = samples.kind() == kind && !matches!(samples, Samples::OnDemand(_));
        if !is_placed || !is_held || count != Some(samples.len()) {
            let why = format!(
                "{} of type {} for {dims:?} from {first:?} on, {step:?} apart: must be as many, of the source's type, and their distances positive",
                samples.len(),
                samples.type_name()
            );
            return Err(Error::invalid("overview of a source", why));
        }
        Ok(self)
    }

    /// Reads the rows that have every so many samples of the grid.
    fn read(source: &dyn SampleSource, dims: [u32; 3]) -> Result<Self> {
        fn every<T: Copy>(all: &mut Vec<T>, row: &[T], stride: u32) {
            all.extend(row.iter().step_by(num::index(stride)));
        }
        let strides = dims.map(|n| n.div_ceil(OVERVIEW));
        let counts = [0, 1, 2].map(|a| dims[a].div_ceil(strides[a]));
        let mut samples: Option<Samples> = None;
        for (z, y) in (0..counts[2]).flat_map(|z| (0..counts[1]).map(move |y| (z, y))) {
            let row = source.read([0, y * strides[1], z * strides[2]], [dims[0], 1, 1])?;
            let all = samples.get_or_insert_with(|| match row.kind() {
                SampleKind::U8 => Samples::U8(Vec::new()),
                SampleKind::U16 => Samples::U16(Vec::new()),
                SampleKind::I16 => Samples::I16(Vec::new()),
                SampleKind::F32 => Samples::F32(Vec::new()),
            });
            match (all, &row) {
                (Samples::U8(all), Samples::U8(row)) => every(all, row, strides[0]),
                (Samples::U16(all), Samples::U16(row)) => every(all, row, strides[0]),
                (Samples::I16(all), Samples::I16(row)) => every(all, row, strides[0]),
                (Samples::F32(all), Samples::F32(row)) => every(all, row, strides[0]),
                _ => {
                    return Err(Error::invalid(
                        "samples of a source",
                        "are of several types: must be of one",
                    ));
                }
            }
            if row.len() != num::index(dims[0]) {
                let why = format!("{} in a row: {} were asked for", row.len(), dims[0]);
                return Err(Error::invalid("samples of a source", why));
            }
        }
        let samples = samples.ok_or_else(|| Error::invalid("samples of a source", "there are none"))?;
        Ok(Self { dims: counts, first: [0.0; 3], step: strides.map(f64::from), samples })
    }
}
