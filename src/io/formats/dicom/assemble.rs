//! From the slices of a series to one grid.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::io::build::data_file::{Lattice, Unit};
use crate::io::build::resample;
use crate::io::build::volume::Chosen;
use crate::io::file::decode::{self, Layout, Values};
use crate::io::file::sample_type::SampleType;
use crate::io::file::samples;
use crate::io::file::source::Source;
use crate::io::formats::dicom::header::{Account, Header, MAX_FRAMES};
use crate::io::formats::dicom::placement::{Frame, Line, Slice};
use crate::io::formats::dicom::recognise::NAME;
use crate::io::formats::dicom::syntax::Packing;
use crate::io::formats::dicom::{data_set, frames, placement};
use crate::io::options::{Request, Wanted};
use crate::io::report::{Found, Loaded};
use crate::num;
use crate::scene::{Anatomy, Grid, Rescale, Samples};

/// Opens a file by its index in a list.
type Open<'o> = dyn Fn(usize) -> Result<Source> + 'o;

/// Sorts the slices along their normal, reads their samples and places the grid. `headers` are those of the files that
/// `open` opens by index; `source` is for messages.
pub(crate) fn assemble(
    source: &Source,
    headers: Vec<Header>,
    open: &Open,
    mut notes: Vec<String>,
    mut account: Account,
    request: &Request,
) -> Result<Found> {
    let Some(first) = headers.first() else {
        return Err(source.error("PixelData", "there is none"));
    };
    let kind = frames::kind(first)?;
    let frame = Frame::of(first)?;
    let mut slices = collect(&headers, &frame)?;
    let mut warnings = Vec::new();
    let single = slices.len() == 1;
    if let [slice] = slices[..] {
        let (faces, warning) = slab(slice, first, &frame);
        slices = faces.to_vec();
        warnings.push(warning);
    } else {
        notes.insert(0, format!("{} slices in the order of their positions", slices.len()));
    }
    let count = slices.len();
    slices.sort_by(|a, b| a.height.total_cmp(&b.height));
    let line = Line::of(source, &headers, &slices, &frame)?;

    let rescale = slices[0].rescale;
    let same = slices.iter().all(|slice| slice.rescale == rescale);
    let extent = |size: u64| u32::try_from(size).unwrap_or(u32::MAX);
    let dims = [extent(first.columns), extent(first.rows), num::count(count)];
    let mut layout = Layout::scalar(dims, kind, first.syntax.endian);
    // Values that are computed, or samples that are repeated, are those of a scene.
    let mut kept = None;
    if request.wanted != Wanted::Scene && same && line.heights.is_none() && !single {
        let mut chosen = Chosen::new(source, "PixelData", layout, 1, request)?;
        chosen.unit = Unit::Millimetre;
        layout = chosen.layout;
        kept = Some(chosen);
    }
    let (total, _) = samples::data_size(source, "Rows, Columns, slices", &layout, request)?;
    let stored = if same { layout.pick.bytes(kind, 1) } else { 4 };
    account.budget.take("series", num::wide(total).saturating_mul(stored))?;
    let scratch = headers.iter().map(frames::scratch).max().unwrap_or(0);
    // One slice is converted at a time if slices differ in rescale.
    let one = if same { 0 } else { first.rows.saturating_mul(first.columns).saturating_mul(4) };
    account.budget.take("one slice", scratch.saturating_add(one))?;
    let mut values = Values::none(if same { kind } else { SampleType::F32 }, 1, layout.pick);
    values.reserve(total).map_err(|_| source.error("series", format!("{total} samples: memory is full")))?;
    append(&mut values, first, &slices, layout, same, open, &mut account)?;

    if first.table {
        warnings.push("ModalityLUTSequence is not applied: values are as stored".to_owned());
    }
    describe(first, same, &mut notes);
    if frame.guessed {
        warnings.push("no PixelSpacing: 1 mm is assumed".to_owned());
    }
    let tilt = line.step.angle_between(frame.normal).to_degrees();
    if tilt > 0.05 {
        notes.push(format!(
            "slices lie {tilt:.2} degrees off their normal, as with a tilted gantry: the axes are not at right angles"
        ));
    }
    let mut file_range = None;
    let (dims, values, length) = match line.heights {
        None => (dims, values, line.step.length()),
        Some(heights) => {
            let list = |extent: u32| (0..extent).map(f64::from).collect::<Vec<_>>();
            let places = [list(dims[0]), list(dims[1]), heights];
            warnings.push(format!("distances of slices are uneven: {} mm", line.gaps));
            let samples = values.into_samples();
            let even = resample::evenly(source, "slices", dims, samples, places, &mut account.budget)?;
            notes.extend(even.note);
            file_range = even.range;
            (even.dims, even.samples.into(), even.steps.z)
        }
    };
    let located = |error: Error| error.in_file(source.path());
    let spacing = DVec3::new(frame.spacing[1], frame.spacing[0], length);
    let direction = DMat3::from_cols(frame.row, frame.column, line.step.normalize());
    let grid = match &mut kept {
        Some(chosen) => chosen.grid(values),
        None => Grid::new(dims, values.into_samples()),
    };
    let mut grid =
        grid.and_then(|grid| grid.with_placement(spacing, slices[0].position, direction)).map_err(located)?;
    if same {
        grid = grid.with_rescale(rescale).map_err(located)?;
        file_range = file_range.map(|stored| rescale.of_range(stored));
    }
    let grid = grid.with_anatomy(Anatomy::Lps);
    let mut loaded = match kept {
        Some(chosen) => {
            let lattice =
                Lattice::new(dims, spacing, slices[0].position, direction, &grid).map_err(located)?;
            chosen.found(NAME, grid, lattice)
        }
        None => Loaded::new(NAME, grid).into(),
    };
    loaded.report.file_range = file_range;
    loaded.report.notes = notes;
    loaded.report.warnings = warnings;
    Ok(loaded)
}

/// Makes two slices of a single one, the faces of the slab that it stands for.
fn slab(slice: Slice, header: &Header, frame: &Frame) -> ([Slice; 2], String) {
    let pixel = frame.spacing[0].min(frame.spacing[1]);
    let known = header.plane_of(slice.frame).thickness.filter(|thickness| *thickness > 0.01 * pixel);
    let thickness = known.unwrap_or(pixel);
    let whence =
        if known.is_some() { "its SliceThickness" } else { "a pixel: it has no usable SliceThickness" };
    let face = |side: f64| Slice {
        position: slice.position + frame.normal * (side * thickness),
        height: slice.height + side * thickness,
        ..slice
    };
    let warning = format!("1 slice: it is drawn as a slab of {thickness} mm, {whence}");
    ([face(-0.5), face(0.5)], warning)
}

/// Notes on the meaning of the samples.
fn describe(first: &Header, same: bool, notes: &mut Vec<String>) {
    if first.photometric == "MONOCHROME1" {
        notes.push("MONOCHROME1: the smallest value is white; values are kept as they are stored".to_owned());
    }
    if first.stored < first.allocated && !first.float {
        let Header { stored, allocated, .. } = first;
        notes.push(format!("{stored} of {allocated} bits are samples, the others are left out"));
    }
    if first.packing == Packing::Jpeg
        && matches!(first.uid.as_str(), "1.2.840.10008.1.2.4.50" | "1.2.840.10008.1.2.4.51")
    {
        notes.push("JPEG: values are those of a lossy compression".to_owned());
    }
    if !same {
        let note = "slices differ in slope and intercept: values are rescaled and kept as 32-bit floats";
        notes.push(note.to_owned());
    }
}

/// Appends the samples of slice after slice; a file with several frames is opened once. If slices differ in rescale, it
/// is applied here.
fn append(
    values: &mut Values,
    first: &Header,
    slices: &[Slice],
    layout: Layout,
    same: bool,
    open: &Open,
    account: &mut Account,
) -> Result<()> {
    let pixels = num::index(layout.dims[0]) * num::index(layout.dims[1]);
    let mut opened: Option<(usize, Source, Source, Header)> = None;
    for slice in slices {
        if opened.as_ref().is_none_or(|(file, ..)| *file != slice.file) {
            if let Some((.., data, header)) = opened.take() {
                drop(data);
                account.budget.put_back(header.taken.saturating_add(header.inflated));
            }
            let source = open(slice.file)?;
            let (header, data) = data_set::read(&source, account)?;
            // The file may have been replaced in the meantime.
            placement::check(first, &header)?;
            frames::check(&header)?;
            opened = Some((slice.file, source, data, header));
        }
        let Some((_, source, data, header)) = &opened else { continue };
        let (bytes, endian) = frames::bytes(data, header, slice.frame)?;
        let layout = Layout { endian, ..layout };
        let append = |values: &mut Values| {
            decode::append(&mut bytes.as_slice(), pixels, &layout, values)
                .map_err(|error| source.io_error(error))
        };
        match &mut *values {
            Values::Samples(Samples::F32(list)) if !same => {
                let mut own = Values::none(layout.kind, 1, layout.pick);
                append(&mut own)?;
                let own = own.into_samples();
                let Rescale { slope, intercept } = slice.rescale;
                list.extend((0..own.len()).map(|i| num::f32_of(slope * own.get(i) + intercept)));
            }
            list => append(list)?,
        }
    }
    Ok(())
}

/// Collects the slices of all files, unsorted, and checks everything that can be checked without their samples.
fn collect(headers: &[Header], frame: &Frame) -> Result<Vec<Slice>> {
    let mut slices = Vec::new();
    for (file, header) in headers.iter().enumerate() {
        placement::check(&headers[0], header)?;
        let frames = usize::try_from(header.frames).unwrap_or(usize::MAX);
        if frames > MAX_FRAMES {
            return Err(header.error("NumberOfFrames", format!("{frames}: at most {MAX_FRAMES}")));
        }
        if !header.planes.is_empty() && header.planes.len() != frames {
            let rule = format!("{} items for {frames} frames", header.planes.len());
            return Err(header.error("PerFrameFunctionalGroupsSequence", rule));
        }
        frames::check(header)?;
        for number in 0..frames {
            let plane = header.plane_of(number);
            // Each of several frames needs its own position.
            let (place, position) = if frames > 1 {
                let own = header.planes.get(number).and_then(|own| own.position);
                (format!("frame {}", number + 1), own)
            } else {
                ("slice".to_owned(), plane.position)
            };
            let Some(position) = position else {
                let rule = "no ImagePositionPatient of its own: slices cannot be put in order";
                return Err(header.error(&*place, rule));
            };
            frame.check_plane(header, &place, &plane)?;
            let (slope, intercept) = (plane.slope.unwrap_or(1.0), plane.intercept.unwrap_or(0.0));
            if slope == 0.0 {
                return Err(header.error(&*place, "RescaleSlope 0: must not be zero"));
            }
            let position = DVec3::from_array(position);
            let (height, rescale) = (position.dot(frame.normal), Rescale { slope, intercept });
            slices.push(Slice { file, frame: number, position, height, rescale });
        }
    }
    Ok(slices)
}
