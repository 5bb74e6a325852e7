//! Writer of grids as NRRD, with header and samples in one file.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DVec3;

use crate::error::Result;
use crate::io::file::sample_type::SampleType;
use crate::num;
use crate::replace::replace;
use crate::scene::{Anatomy, Grid, Rescale, Samples};

/// The number of samples encoded at a time.
const BLOCK: usize = 1 << 16;

/// Writes a grid as NRRD0005 with gzip-compressed samples. Returns a note if values were converted.
///
/// The format has no rescale: a grid with one is written as values instead of stored numbers. These are whole numbers
/// of at most 16 bits if all values are, else 32-bit floats, or 64-bit floats if 32 bits cannot keep the values
/// distinct. NaN and infinities are kept.
///
/// # Errors
///
/// [`crate::Error::Io`] if the file cannot be written, [`crate::Error::File`] if it must not be replaced; no partial
/// file remains.
pub fn write_nrrd(path: impl AsRef<Path>, grid: &Grid) -> Result<Option<String>> {
    let rescaled = grid.rescale() != Rescale::IDENTITY;
    let kind = if rescaled { kind_of_values(grid) } else { kind_of(grid.samples()) };
    let header = header(grid, kind);
    replace(path.as_ref(), |writer| {
        writer.write_all(header.as_bytes())?;
        let mut packed = GzEncoder::new(writer, Compression::default());
        let mut bytes = Vec::new();
        let count = grid.samples().len();
        for first in (0..count).step_by(BLOCK) {
            let range = first..count.min(first + BLOCK);
            bytes.clear();
            if rescaled {
                put_values(grid, kind, range, &mut bytes);
            } else {
                put_stored(grid.samples(), range, &mut bytes);
            }
            packed.write_all(&bytes)?;
        }
        packed.finish().map(drop)
    })?;
    let Rescale { slope, intercept } = grid.rescale();
    Ok(rescaled.then(|| {
        let stored = grid.samples().type_name();
        format!("values written as {}: {slope} * stored ({stored}) + {intercept}", kind.name())
    }))
}

fn kind_of(samples: &Samples) -> SampleType {
    match samples {
        Samples::U8(_) => SampleType::U8,
        Samples::U16(_) => SampleType::U16,
        Samples::I16(_) => SampleType::I16,
        Samples::F32(_) => SampleType::F32,
    }
}

/// Returns the smallest type that keeps the values distinct.
fn kind_of_values(grid: &Grid) -> SampleType {
    /// The least number of distinct float32 values that the range should have.
    const STEPS: f64 = 4096.0;
    let Rescale { slope, intercept } = grid.rescale();
    let [lo, hi] = grid.range();
    let codes = !matches!(grid.samples(), Samples::F32(_));
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

fn header(grid: &Grid, kind: SampleType) -> String {
    let name = match kind {
        SampleType::U8 => "uint8",
        SampleType::U16 => "uint16",
        SampleType::I16 => "int16",
        SampleType::F64 => "double",
        _ => "float",
    };
    // Without anatomy, nothing is said about the handedness of the world axes.
    let space = match grid.anatomy() {
        Anatomy::Unknown => "space dimension: 3",
        Anatomy::Ras => "space: right-anterior-superior",
        Anatomy::Lps => "space: left-posterior-superior",
        Anatomy::Las => "space: left-anterior-superior",
    };
    let vector = |v: DVec3| format!("({:?},{:?},{:?})", v.x, v.y, v.z);
    let [nx, ny, nz] = grid.dims();
    let axes = grid.index_to_world();
    let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis].map(vector);
    format!(
        "NRRD0005\ntype: {name}\ndimension: 3\n{space}\nsizes: {nx} {ny} {nz}\nspace directions: {x} {y} {z}\n\
         kinds: domain domain domain\nendian: little\nencoding: gzip\nspace origin: {}\n\n",
        vector(grid.origin())
    )
}

fn put_stored(samples: &Samples, range: std::ops::Range<usize>, bytes: &mut Vec<u8>) {
    match samples {
        Samples::U8(v) => bytes.extend_from_slice(&v[range]),
        Samples::U16(v) => bytes.extend(v[range].iter().flat_map(|x| x.to_le_bytes())),
        Samples::I16(v) => bytes.extend(v[range].iter().flat_map(|x| x.to_le_bytes())),
        Samples::F32(v) => bytes.extend(v[range].iter().flat_map(|x| x.to_le_bytes())),
    }
}

fn put_values(grid: &Grid, kind: SampleType, range: std::ops::Range<usize>, bytes: &mut Vec<u8>) {
    let Rescale { slope, intercept } = grid.rescale();
    let values = range.map(|i| slope * grid.samples().get(i) + intercept);
    match kind {
        SampleType::U8 => bytes.extend(values.map(num::u8_code)),
        SampleType::U16 => bytes.extend(values.flat_map(|x| num::u16_code(x).to_le_bytes())),
        SampleType::I16 => bytes.extend(values.flat_map(|x| num::i16_code(x).to_le_bytes())),
        SampleType::F64 => bytes.extend(values.flat_map(f64::to_le_bytes)),
        _ => bytes.extend(values.flat_map(|x| num::f32_of(x).to_le_bytes())),
    }
}
