//! NIfTI-1: `.nii`, `.nii.gz`, and `.hdr` with `.img`.
//!
//! The sform places the grid if its code is positive, else the qform, else the voxel sizes alone. A voxel size counts
//! by its magnitude; one that is zero or not finite counts as 1.

mod header;

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};

use crate::error::{Error, Result};
use crate::io::build::data_file::Unit;
use crate::io::build::volume::{Chosen, Placement};
use crate::io::file::decode::Layout;
use crate::io::file::sample_type::SampleType;
use crate::io::file::samples::{self, Part};
use crate::io::file::source::Source;
use crate::io::formats::nifti::header::{HEADER, Header, PAIR, SINGLE};
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;
use crate::num;
use crate::scene::{Anatomy, Rescale};

pub(crate) struct Nifti;

impl Reader for Nifti {
    fn name(&self) -> &'static str {
        "NIfTI-1"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["nii", "nii.gz", "hdr", "hdr.gz", "img", "img.gz"]
    }

    fn recognises(&self, source: &Source) -> bool {
        source.head().get(344..HEADER).is_some_and(|magic| magic == SINGLE || magic == PAIR)
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let single = source.head().get(344..HEADER) == Some(SINGLE.as_slice());
        match sibling(source, "img", "hdr").filter(|_| !single) {
            Some(header) => read(&source.sibling(&header, request)?, self.name(), request),
            None => read(source, self.name(), request),
        }
    }
}

/// Returns the name with the extension `to`, if the file's own is `from` or `from.gz`.
fn sibling(source: &Source, from: &str, to: &str) -> Option<PathBuf> {
    let path = Path::new(source.path().file_name()?);
    let is = |path: &Path, ending: &str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
    let plain = if is(path, "gz") { path.with_extension("") } else { path.to_path_buf() };
    if !is(&plain, from) {
        return None;
    }
    // An extension in capitals stays in capitals.
    let capitals = plain.extension().is_some_and(|own| own.to_string_lossy().starts_with(char::is_uppercase));
    let ending = if capitals { to.to_uppercase() } else { to.to_owned() };
    let plain = plain.with_extension(&ending);
    let packed = plain.with_extension(format!("{ending}.gz"));
    Some(if !source.has_sibling(&plain) && source.has_sibling(&packed) { packed } else { plain })
}

fn read(source: &Source, format: &'static str, request: &Request) -> Result<Found> {
    let (header, endian) = Header::parse(source)?;
    let dims = dims(source, &header)?;
    let kind = sample_type(source, &header)?;

    let single = header.single;
    let first = if single { 352.0 } else { 0.0 };
    let mut warnings = doubts(&header);
    let mut offset = f64::from(header.vox_offset);
    if single && offset == 0.0 {
        offset = first;
        warnings.push("vox_offset is 0: taken as 352, where the data of a single file begins".to_owned());
    }
    let bits = kind.bytes() * 8;
    if u64::try_from(header.bitpix) != Ok(bits) {
        let (given, code) = (header.bitpix, header.datatype);
        warnings
            .push(format!("bitpix is {given}: datatype {code} ({}) has {bits}, which is used", kind.name()));
    }
    // 2^40 is beyond any plausible offset, and a float64 is exact up to there.
    if !(offset >= first && offset <= 1_099_511_627_776.0 && offset.fract() == 0.0) {
        let rule =
            format!("{offset}: must be a whole number of bytes, at least {first} in this kind of file");
        return Err(source.error("vox_offset", rule));
    }
    let skip = num::u64_of(offset);
    let data = if single {
        source.clone()
    } else {
        let path = sibling(source, "hdr", "img").ok_or_else(|| {
            source.error("magic", "\"ni1\": a header with a separate image must be named .hdr or .hdr.gz")
        })?;
        source.sibling(&path, request)?
    };
    let mut chosen = Chosen::new(source, "dim", Layout::scalar(dims, kind, endian), 1, request)?;
    // The codes of times share the byte.
    chosen.unit = Unit::ALL.get(usize::from(header.xyzt_units & 7)).map_or(Unit::Unknown, |&(unit, _)| unit);
    let part = |_, bytes| Ok(Part::sized(data.clone(), skip, bytes));
    let samples = samples::read(source, "dim", &chosen.layout, 1, &part, request)?;

    let (place, columns, origin, anatomy) = placement(&header);
    let axes = [columns.x_axis, columns.y_axis, columns.z_axis];
    let spacing = DVec3::from_array(axes.map(DVec3::length));
    let [x, y, z] = axes.map(|axis| axis / axis.length());
    let direction = DMat3::from_cols(x, y, z);
    let located = |place: &'static str, error: Error| error.at_place(source.path(), place);
    let grid = chosen.grid(samples).map_err(|error| error.in_file(data.path()))?;
    let grid = grid.with_rescale(rescale(&header)).map_err(|error| located("scl_slope, scl_inter", error))?;
    let placement = Placement { place, spacing, origin, direction, anatomy, notes: Vec::new(), warnings };
    chosen.placed(format, grid, placement, &located)
}

/// Returns warnings about the placement.
fn doubts(header: &Header) -> Vec<String> {
    let mut doubts = Vec::new();
    if header.sform_code > 0 || header.qform_code <= 0 {
        return doubts;
    }
    let handed = header.pixdim[0];
    if ![-1.0, 0.0, 1.0].contains(&handed) {
        doubts.push(format!("pixdim[0] is {handed}: must be 1 or -1, only its sign is used"));
    }
    let sum: f64 = header.quatern.iter().map(|x| x.powi(2)).sum();
    // The tolerance exceeds the rounding of float32.
    if sum > 1.0 + 1e-5 {
        doubts
            .push(format!("quatern_b, c and d: squares sum up to {sum:.6}, beyond 1: scaled to unit length"));
    }
    if (1..=3).any(|axis| header.pixdim[axis] < 0.0) {
        doubts.push("pixdim is negative: its magnitude is used".to_owned());
    }
    doubts
}

fn dims(source: &Source, header: &Header) -> Result<[u32; 3]> {
    let rank = usize::try_from(header.dim[0]).unwrap_or(0);
    for (axis, &extent) in header.dim.iter().enumerate().skip(1).take(rank) {
        if extent < 1 {
            return Err(source.error(format!("dim[{axis}]"), format!("{extent}: must be positive")));
        }
        if axis > 3 && extent > 1 {
            let what = match axis {
                4 => "times",
                5 => "components",
                _ => "entries",
            };
            let rule = format!("{extent} {what}: a volume has three dimensions, further ones must be 1");
            return Err(source.error(format!("dim[{axis}]"), rule));
        }
    }
    if rank < 3 {
        return Err(source.error("dim[0]", format!("{rank}: a volume has three dimensions")));
    }
    // Extents are positive.
    Ok([1, 2, 3].map(|axis| u32::try_from(header.dim[axis]).unwrap_or(0)))
}

fn sample_type(source: &Source, header: &Header) -> Result<SampleType> {
    let code = header.datatype;
    Ok(match code {
        2 => SampleType::U8,
        256 => SampleType::I8,
        512 => SampleType::U16,
        4 => SampleType::I16,
        768 => SampleType::U32,
        8 => SampleType::I32,
        1280 => SampleType::U64,
        1024 => SampleType::I64,
        16 => SampleType::F32,
        64 => SampleType::F64,
        _ => {
            let name = match code {
                32 => " (Complex64)",
                128 => " (Rgb24)",
                1536 => " (Float128)",
                1792 => " (Complex128)",
                2048 => " (Complex256)",
                2304 => " (Rgba32)",
                _ => "",
            };
            let rule = format!("{code}{name}: whole numbers of 8 to 64 bits, f32 and f64 are supported");
            return Err(source.error("datatype", rule));
        }
    })
}

/// Returns the header field that places the grid, the columns of the index-to-world map, its origin and the anatomy
/// of the world axes.
fn placement(header: &Header) -> (&'static str, DMat3, DVec3, Anatomy) {
    let size = |axis: usize| {
        let size = f64::from(header.pixdim[axis]).abs();
        if size > 0.0 && size.is_finite() { size } else { 1.0 }
    };
    let sizes = DVec3::new(size(1), size(2), size(3));
    if header.sform_code > 0 {
        let [x, y, z, origin] = [0, 1, 2, 3].map(|i| DVec3::from_array(header.srow.map(|row| row[i])));
        return ("srow_x, srow_y, srow_z", DMat3::from_cols(x, y, z), origin, Anatomy::Ras);
    }
    if header.qform_code > 0 {
        let [b, c, d] = header.quatern;
        // The scalar part completes the quaternion to unit length; rounding may make its square negative.
        let a = (1.0 - (b * b + c * c + d * d)).max(0.0).sqrt();
        let rotation = DMat3::from_quat(DQuat::from_xyzw(b, c, d, a).normalize());
        let handed = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
        let columns = rotation * DMat3::from_diagonal(sizes * DVec3::new(1.0, 1.0, handed));
        return ("quatern", columns, header.qoffset.into(), Anatomy::Ras);
    }
    ("pixdim", DMat3::from_diagonal(sizes), DVec3::ZERO, Anatomy::Unknown)
}

/// Returns the rescale. A slope of zero or NaN means that stored numbers are the values.
fn rescale(header: &Header) -> Rescale {
    let slope = f64::from(header.scl_slope);
    if slope == 0.0 || slope.is_nan() {
        return Rescale::IDENTITY;
    }
    Rescale { slope, intercept: f64::from(header.scl_inter) }
}
