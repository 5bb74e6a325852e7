//! Writer of grids as NIfTI-1, header and samples in one file, packed if its name ends in `.gz`.
//!
//! World axes of NIfTI point to the right, front and top (RAS). The sform places the grid: it may be oblique.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::build::data_file::{DataFile, Lattice, Shape, Unit};
use crate::io::file::sample_type::SampleType;
use crate::num;
use crate::replace::replace;
use crate::scene::{Anatomy, Rescale};

/// The size of the header and of the four bytes that say that no extension follows.
const BEGIN: usize = 352;

/// Writes the one array of a lattice. Returns notes on what was converted.
pub(crate) fn write(path: &Path, data: DataFile, packed: bool) -> Result<Vec<String>> {
    let is_f32 = |x: f64| f64::from(num::f32_of(x)) == x;
    let exact = match &data.shape {
        Shape::Even(Lattice { rescale, .. }) => is_f32(rescale.slope) && is_f32(rescale.intercept),
        _ => true,
    };
    let (data, note) = if exact { (data, None) } else { data.rescaled() };
    let mut notes: Vec<String> = note.into_iter().collect();
    let (mut lattice, array) = data.one_array(path)?;
    if array.info.components > 1 {
        let rule = format!(
            "array {}: a voxel holds one number, choose a part, as --only {}:0",
            array.info, array.info.name
        );
        return Err(Error::file(path, "content", rule));
    }
    let mut dims = [0_i16; 3];
    for (dim, extent) in dims.iter_mut().zip(lattice.dims) {
        let rule = || {
            Error::file(path, "dim", format!("{extent} samples along an axis: must be at most {}", i16::MAX))
        };
        *dim = i16::try_from(extent).map_err(|_| rule())?;
    }
    if lattice.anatomy == Anatomy::Unknown {
        notes.push("the unknown world axes are written as RAS".to_owned());
    }
    let turn = match lattice.anatomy {
        Anatomy::Unknown | Anatomy::Ras => DVec3::ONE,
        Anatomy::Lps => DVec3::new(-1.0, -1.0, 1.0),
        Anatomy::Las => DVec3::new(-1.0, 1.0, 1.0),
    };
    lattice.origin *= turn;
    let steps = lattice.steps().map(|step| step * turn);
    let places = [steps[0], steps[1], steps[2], lattice.origin];
    if !places.iter().all(|v| v.to_array().into_iter().all(is_f32)) {
        notes.push("the placement is rounded to 32-bit floats".to_owned());
    }
    let mut header = header(dims, array.info.kind, places, lattice.rescale);
    let unit = Unit::ALL.iter().zip(0..).find(|((unit, _), _)| *unit == lattice.unit);
    header[123] = unit.map_or(0, |(_, code)| code);
    let put = |writer: &mut dyn Write| {
        writer.write_all(&header)?;
        writer.write_all(&array.tuples.bytes)
    };
    replace(path, |writer| {
        if !packed {
            return put(writer);
        }
        let mut writer = GzEncoder::new(writer, Compression::default());
        put(&mut writer)?;
        writer.finish().map(drop)
    })?;
    Ok(notes)
}

fn header(dims: [i16; 3], kind: SampleType, places: [DVec3; 4], rescale: Rescale) -> [u8; BEGIN] {
    let (code, bits): (i16, i16) = match kind {
        SampleType::U8 => (2, 8),
        SampleType::I8 => (256, 8),
        SampleType::U16 => (512, 16),
        SampleType::I16 => (4, 16),
        SampleType::U32 => (768, 32),
        SampleType::I32 => (8, 32),
        SampleType::U64 => (1280, 64),
        SampleType::I64 => (1024, 64),
        SampleType::F32 => (16, 32),
        SampleType::F64 => (64, 64),
    };
    let mut header = [0_u8; BEGIN];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    let mut float = |at: usize, value: f64| put(at, &num::f32_of(value).to_le_bytes());
    let [x, y, z, _] = places;
    // pixdim; the first number is the handedness of the qform, which is not used.
    for (i, size) in [1.0, x.length(), y.length(), z.length()].into_iter().enumerate() {
        float(76 + 4 * i, size);
    }
    float(108, 352.0);
    float(112, rescale.slope);
    float(116, rescale.intercept);
    for row in 0..3 {
        for (column, place) in places.iter().enumerate() {
            float(280 + 16 * row + 4 * column, place[row]);
        }
    }
    put(0, &348_i32.to_le_bytes());
    for (axis, extent) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * axis, &extent.to_le_bytes());
    }
    put(70, &code.to_le_bytes());
    put(72, &bits.to_le_bytes());
    // The sform is aligned to some anatomy.
    put(254, &2_i16.to_le_bytes());
    put(344, b"n+1\0");
    header
}
