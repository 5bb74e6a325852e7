//! Samples of a grid that are read when they are needed.

use std::collections::{HashMap, VecDeque};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use super::samples::{SampleKind, Samples};
use crate::error::{Error, Result};
use crate::num;

/// A place from which the samples of a grid are read, box by box: a file, or a program's own data.
pub trait SampleSource: fmt::Debug + Send + Sync {
    /// Returns the samples of the box of `extent` samples from `first` on, x fastest, in memory and in the one type that all samples have.
    /// Several threads may ask at once.
    ///
    /// # Errors
    ///
    /// Errors of the source, in one line that names it.
    fn read(&self, first: [u32; 3], extent: [u32; 3]) -> Result<Samples>;
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

/// Samples at equal distances along each axis, beginning with the first.
#[derive(Debug)]
pub(crate) struct Overview {
    pub(crate) dims: [u32; 3],
    /// Samples from one to the next along each axis.
    pub(crate) strides: [u32; 3],
    pub(crate) samples: Samples,
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

/// Most samples along an axis of an overview.
const OVERVIEW: u32 = 64;

impl OnDemand {
    /// Takes a source of `dims` samples, and reads an overview of at most 64 along each axis.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if an extent is below 2 or memory cannot address the samples; errors of the source.
    pub fn new(dims: [u32; 3], source: impl SampleSource + 'static) -> Result<Self> {
        super::grid::sample_count(dims)?
            .ok_or_else(|| Error::invalid("grid extent", format!("{dims:?} overflows the address space")))?;
        let kind = source.read([0; 3], [1; 3])?.kind();
        let strides = dims.map(|n| n.div_ceil(OVERVIEW));
        let overview = Overview::read(&source, dims, strides)?;
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

    pub(crate) fn overview(&self) -> &Overview {
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
    /// Reads the rows that have samples of the overview.
    fn read(source: &dyn SampleSource, dims: [u32; 3], strides: [u32; 3]) -> Result<Self> {
        fn every<T: Copy>(all: &mut Vec<T>, row: &[T], stride: u32) {
            all.extend(row.iter().step_by(num::index(stride)));
        }
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
        }
        let samples = samples.ok_or_else(|| Error::invalid("samples of a source", "there are none"))?;
        Ok(Self { dims: counts, strides, samples })
    }
}
