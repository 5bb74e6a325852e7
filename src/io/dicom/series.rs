//! From files or frames to one grid.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use super::frames;
use super::header::{self, Account, Header, Packing, Plane, vector};
use crate::error::{Error, Result};
use crate::io::arrays::Pick;
use crate::io::samples::{self, Layout, SampleType};
use crate::io::source::{Budget, Source};
use crate::io::{Loaded, ReadOptions, lattice, text};
use crate::num;
use crate::scene::{Anatomy, Grid, Rescale, Samples};

/// Most files of a folder that are looked at.
const MAX_FILES: usize = 1 << 16;

/// Differences of distances that count as rounding, of a distance: positions are decimal text.
const ROUNDING: f64 = 0.01;

/// How far slices may lie beside their line, of a pixel.
const BESIDE: f64 = 0.1;

/// Opens a file by its place in a list.
type Open<'o> = dyn Fn(usize) -> Result<Source> + 'o;

/// What a file is read for: its header alone.
fn header_of(source: &Source, account: &mut Account) -> Result<Header> {
    let (header, data) = header::read(source, account)?;
    drop(data);
    account.budget.put_back(header.inflated);
    Ok(header)
}

/// Why an image without samples is none.
fn cut(header: &Header) -> Error {
    header.error("PixelData", "there is none: the file may be cut short")
}

/// Reads the series that a file belongs to.
pub(super) fn read(source: &Source, options: &ReadOptions) -> Result<Loaded> {
    /// Most damaged files that are named.
    const NAMED: usize = 8;
    let mut account = Account::new(Budget::new(source, options));
    let own = header_of(source, &mut account)?;
    if own.pixels.is_none() {
        return Err(cut(&own));
    }
    if own.frames.is_some_and(|frames| frames > 1) {
        return assemble(source, vec![own], &|_| Ok(source.clone()), Vec::new(), account, options);
    }
    let mut names = Vec::new();
    let mut headers = Vec::new();
    let mut others = 0;
    let (mut damaged, mut named) = (0_usize, Vec::new());
    let mut is_damaged = |error: Error| {
        damaged += 1;
        if named.len() < NAMED {
            named.push(format!("left out: {error}"));
        }
    };
    for name in source.neighbours()? {
        let neighbour = source.sibling(&name, options)?;
        if !super::is(&neighbour) {
            continue;
        }
        let header = match header_of(&neighbour, &mut account) {
            Ok(header) => header,
            Err(error) if account.full => return Err(error),
            // It may be of another series, or a slice that is missing now.
            Err(error) => {
                is_damaged(error);
                continue;
            }
        };
        let same = header.series == own.series;
        if header.pixels.is_none() || !same || header.frames.is_some_and(|n| n > 1) {
            if same && header.pixels.is_none() {
                is_damaged(cut(&header));
            } else {
                others += 1;
            }
            account.budget.put_back(header.taken);
            continue;
        }
        if headers.len() == MAX_FILES {
            return Err(source.error("series", format!("more than {MAX_FILES} files")));
        }
        names.push(name);
        headers.push(header);
    }
    let mut notes = Vec::new();
    if others > 0 {
        notes.push(format!(
            "{others} DICOM files of the folder are of other series, or no single slices, and left out"
        ));
    }
    let open = |i: usize| source.sibling(&names[i], options);
    let mut loaded = assemble(source, headers, &open, notes, account, options)?;
    if damaged > 0 {
        loaded.report.warnings.extend(named);
        let files = if damaged == 1 { "file" } else { "files" };
        loaded.report.warnings.push(format!(
            "{damaged} damaged {files} of the folder left out: slices of the series may be missing, at its ends or \
             where values between others were made up"
        ));
    }
    Ok(loaded)
}

/// Reads the one series of several files.
pub(in crate::io) fn read_files(folder: &Path, files: &[PathBuf], options: &ReadOptions) -> Result<Loaded> {
    let Some(path) = files.first() else {
        return Err(Error::file(folder, "files", "there is none"));
    };
    let source = &Source::open(path, options)?;
    let mut account = Account::new(Budget::new(source, options));
    let mut headers: Vec<Header> = Vec::new();
    let mut without = 0;
    for path in files {
        let header = header_of(&Source::open(path, options)?, &mut account)?;
        if header.pixels.is_none() {
            if header.rows > 0 && header.columns > 0 {
                return Err(cut(&header));
            }
            account.budget.put_back(header.taken);
            without += 1;
        } else if headers.len() == MAX_FILES {
            return Err(Error::file(folder, "series", format!("more than {MAX_FILES} files")));
        } else {
            headers.push(header);
        }
    }
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for header in &headers {
        *counts.entry(&header.series).or_insert(0) += 1;
    }
    if counts.len() > 1 {
        let mut list: Vec<String> = counts
            .iter()
            .take(8)
            .map(|(series, count)| format!("{} of {count} files", text::shown(series)))
            .collect();
        if counts.len() > list.len() {
            list.push(format!("and {} more", counts.len() - list.len()));
        }
        let rule = format!(
            "{} series: {}; name one file of the series that is meant",
            counts.len(),
            list.join(", ")
        );
        return Err(Error::file(folder, "SeriesInstanceUID", rule));
    }
    let Some(first) = headers.first() else {
        return Err(Error::file(folder, "series", "no DICOM file with samples"));
    };
    let mut notes = Vec::new();
    if without > 0 {
        notes.push(format!("{without} DICOM files without samples are left out"));
    }
    let source = Source::open(&first.path, options)?;
    let paths: Vec<PathBuf> = headers.iter().map(|header| header.path.clone()).collect();
    assemble(&source, headers, &|i| Source::open(&paths[i], options), notes, account, options)
}

/// A frame, and how far along the normal it lies.
#[derive(Clone, Copy, Debug)]
struct Slice {
    file: usize,
    frame: usize,
    position: DVec3,
    height: f64,
    rescale: Rescale,
}

/// What a slice is called in messages.
fn called(headers: &[Header], slice: &Slice) -> String {
    let header = &headers[slice.file];
    let name = header.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if header.frames.is_some_and(|frames| frames > 1) {
        format!("{name} frame {}", slice.frame + 1)
    } else {
        name
    }
}

fn assemble(
    source: &Source,
    headers: Vec<Header>,
    open: &Open,
    mut notes: Vec<String>,
    mut account: Account,
    options: &ReadOptions,
) -> Result<Loaded> {
    let Some(first) = headers.first() else {
        return Err(source.error("PixelData", "there is none"));
    };
    let kind = frames::kind(first)?;
    let frame = Frame::of(first)?;
    let mut slices = collect(&headers, &frame)?;
    let count = slices.len();
    if count < 2 {
        let rule = "1 slice: a volume needs at least 2, each in a file of its own or a frame of one";
        return Err(source.error("series", rule));
    }
    slices.sort_by(|a, b| a.height.total_cmp(&b.height));
    let line = Line::of(source, &headers, &slices, &frame)?;

    let rescale = slices[0].rescale;
    let same = slices.iter().all(|slice| slice.rescale == rescale);
    let extent = |size: u64| u32::try_from(size).unwrap_or(u32::MAX);
    let dims = [extent(first.columns), extent(first.rows), num::count(count)];
    let layout = Layout::scalar(dims, kind, first.endian);
    let (total, _) = samples::data_size(source, "Rows, Columns, slices", &layout, options)?;
    let mut budget = account.budget.clone();
    let stored = if same { kind.stored_bytes() } else { 4 };
    budget.take("series", num::wide(total).saturating_mul(stored))?;
    let scratch = headers.iter().map(frames::scratch).max().unwrap_or(0);
    // Numbers of one slice, where each has a map of its own.
    let one = if same { 0 } else { first.rows.saturating_mul(first.columns).saturating_mul(4) };
    budget.take("one slice", scratch.saturating_add(one))?;

    let list = if same { kind } else { SampleType::F32 };
    let mut values = Samples::none(list, Pick::Component(0));
    values.reserve(total).map_err(|_| source.error("series", format!("{total} samples: memory is full")))?;
    let mut opened: Option<(usize, Source, Source, Header)> = None;
    for slice in &slices {
        if opened.as_ref().is_none_or(|(file, ..)| *file != slice.file) {
            if let Some((.., data, header)) = opened.take() {
                drop(data);
                budget.put_back(header.taken.saturating_add(header.inflated));
            }
            let source = open(slice.file)?;
            let (header, data) = header::read(&source, &mut account)?;
            // The file may be another one by now.
            frame.check(first, &header)?;
            frames::check(&header, frames_of(&header))?;
            opened = Some((slice.file, source, data, header));
        }
        let Some((_, source, data, header)) = &opened else { continue };
        let (bytes, endian) = frames::bytes(data, header, slice.frame)?;
        let layout = Layout { endian, ..layout };
        let pixels = total / count;
        let append = |values: &mut Samples| {
            samples::append(&mut bytes.as_slice(), pixels, &layout, values)
                .map_err(|error| source.io_error(error))
        };
        match &mut values {
            Samples::F32(list) if !same => {
                let mut own = Samples::none(kind, Pick::Component(0));
                append(&mut own)?;
                let Rescale { slope, intercept } = slice.rescale;
                list.extend((0..own.len()).map(|i| num::f32_of(slope * own.get(i) + intercept)));
            }
            list => append(list)?,
        }
    }

    let mut warnings: Vec<String> = first.warnings.iter().map(|&warning| warning.to_owned()).collect();
    if first.photometric == "MONOCHROME1" {
        notes.push("MONOCHROME1: the smallest value is white; values are kept as they are stored".to_owned());
    }
    if first.stored < first.allocated && !first.float {
        notes.push(format!(
            "{} of {} bits are samples, the others are left out",
            first.stored, first.allocated
        ));
    }
    if first.packing == Packing::Jpeg
        && matches!(first.syntax.as_str(), "1.2.840.10008.1.2.4.50" | "1.2.840.10008.1.2.4.51")
    {
        notes.push("JPEG: values are those of a lossy compression".to_owned());
    }
    if !same {
        notes.push(
            "slices differ in slope and intercept: values are kept after them, as 32-bit floats".to_owned(),
        );
    }
    if frame.guessed {
        warnings.push("no PixelSpacing: 1 mm is assumed".to_owned());
    }
    let tilt = line.step.angle_between(frame.normal).to_degrees();
    if tilt > 0.05 {
        notes.push(format!(
            "slices lie {tilt:.2} degrees off their normal, as with a tilted gantry: the axes are not at right angles"
        ));
    }
    let (dims, values, length) = match line.heights {
        None => (dims, values, line.step.length()),
        Some(heights) => {
            let list = |extent: u32| (0..extent).map(f64::from).collect::<Vec<_>>();
            let places = [list(dims[0]), list(dims[1]), heights];
            warnings.push(format!("distances of slices are uneven: {} mm", line.gaps));
            let even = lattice::evenly(source, "slices", dims, values, places, &mut budget)?;
            notes.extend(even.note);
            (even.dims, even.samples, even.steps.z)
        }
    };
    let located = |error: Error| error.in_file(source.path());
    let spacing = DVec3::new(frame.spacing[1], frame.spacing[0], length);
    let direction = DMat3::from_cols(frame.row, frame.column, line.step.normalize());
    let mut grid = Grid::new(dims, values)
        .and_then(|grid| grid.with_placement(spacing, slices[0].position, direction))
        .map_err(located)?;
    if same {
        grid = grid.with_rescale(rescale).map_err(located)?;
    }
    let mut loaded = Loaded::new(super::NAME, grid.with_anatomy(Anatomy::Lps));
    notes.insert(0, format!("{count} slices in the order of their positions"));
    loaded.report.notes = notes;
    loaded.report.warnings = warnings;
    Ok(loaded)
}

fn frames_of(header: &Header) -> usize {
    header.frames.and_then(|frames| usize::try_from(frames).ok()).unwrap_or(1)
}

/// The slices of all files, in no order, with everything checked that need not their samples.
fn collect(headers: &[Header], frame: &Frame) -> Result<Vec<Slice>> {
    let mut slices = Vec::new();
    for (file, header) in headers.iter().enumerate() {
        frame.check(&headers[0], header)?;
        let frames = frames_of(header);
        if frames > header::MAX_FRAMES {
            let rule = format!("{frames}: at most {}", header::MAX_FRAMES);
            return Err(header.error("NumberOfFrames", rule));
        }
        if !header.planes.is_empty() && header.planes.len() != frames {
            let rule = format!("{} items for {frames} frames", header.planes.len());
            return Err(header.error("PerFrameFunctionalGroupsSequence", rule));
        }
        frames::check(header, frames)?;
        for number in 0..frames {
            let plane = header.plane_of(number);
            let place = if frames > 1 { format!("frame {}", number + 1) } else { "slice".to_owned() };
            let position = if frames > 1 {
                header.planes.get(number).and_then(|own| own.position)
            } else {
                plane.position
            };
            let Some(position) = position else {
                let rule = "no ImagePositionPatient of its own: slices cannot be put in order";
                return Err(header.error(&*place, rule));
            };
            frame.check_plane(header, &place, &plane)?;
            let slope = plane.slope.unwrap_or(1.0);
            let intercept = plane.intercept.unwrap_or(0.0);
            if slope == 0.0 {
                return Err(header.error(&*place, "RescaleSlope 0: must not be zero"));
            }
            let position = vector(&position);
            let height = position.dot(frame.normal);
            slices.push(Slice {
                file,
                frame: number,
                position,
                height,
                rescale: Rescale { slope, intercept },
            });
        }
    }
    Ok(slices)
}

/// How the first slice lies; all others lie so.
struct Frame {
    /// Towards the next column, towards the next row, and their normal.
    row: DVec3,
    column: DVec3,
    normal: DVec3,
    /// Distance of rows, then of columns.
    spacing: [f64; 2],
    /// Whether the file does not say.
    guessed: bool,
}

impl Frame {
    fn of(header: &Header) -> Result<Self> {
        let plane = header.plane_of(0);
        let Some(orientation) = plane.orientation else {
            return Err(header.error("ImageOrientationPatient", "missing: slices cannot be placed"));
        };
        let (row, column) = (vector(&orientation[..3]), vector(&orientation[3..]));
        let upright = (row.length() - 1.0).abs() < 0.01 && (column.length() - 1.0).abs() < 0.01;
        if !upright || row.dot(column).abs() > 0.01 {
            let rule = format!("{row} and {column}: must have unit length and be at right angles");
            return Err(header.error("ImageOrientationPatient", rule));
        }
        let (row, column) = (row.normalize(), column.normalize());
        let spacing = plane.spacing.unwrap_or([1.0; 2]);
        if !(spacing[0] > 0.0 && spacing[1] > 0.0) {
            let rule = format!("{}, {}: must be positive", spacing[0], spacing[1]);
            return Err(header.error("PixelSpacing", rule));
        }
        let normal = row.cross(column).normalize();
        Ok(Self { row, column, normal, spacing, guessed: plane.spacing.is_none() })
    }

    /// Whether a file's samples are as the first one's.
    fn check(&self, first: &Header, header: &Header) -> Result<()> {
        let of = |header: &Header| {
            let Header { rows, columns, samples, allocated, stored, high, signed, float, .. } = *header;
            (rows, columns, samples, allocated, stored, high, signed, float)
        };
        if of(first) != of(header) || first.photometric != header.photometric {
            let text = |header: &Header| {
                let Header { rows, columns, stored, allocated, signed, .. } = *header;
                let sign = if signed { "signed" } else { "unsigned" };
                format!(
                    "{columns} x {rows} {} samples, {sign}, {stored} of {allocated} bits",
                    header.photometric
                )
            };
            let name = first.path.file_name().unwrap_or_default().to_string_lossy();
            return Err(header.error("samples", format!("{}: {name} has {}", text(header), text(first))));
        }
        Ok(())
    }

    fn check_plane(&self, header: &Header, place: &str, plane: &Plane) -> Result<()> {
        let Some(orientation) = plane.orientation else {
            return Err(header.error(place, "no ImageOrientationPatient"));
        };
        let (row, column) = (vector(&orientation[..3]), vector(&orientation[3..]));
        // A thousandth is a tenth of a pixel's width over a hundred pixels.
        if (row - self.row).length() > 1e-3 || (column - self.column).length() > 1e-3 {
            let rule = format!(
                "ImageOrientationPatient {orientation:?}: other slices of the series lie differently"
            );
            return Err(header.error(place, rule));
        }
        let spacing = plane.spacing.unwrap_or([1.0; 2]);
        let differs = |a: f64, b: f64| (a - b).abs() > 1e-4 * b;
        if differs(spacing[0], self.spacing[0]) || differs(spacing[1], self.spacing[1]) {
            let rule =
                format!("PixelSpacing {spacing:?}: other slices of the series have {:?}", self.spacing);
            return Err(header.error(place, rule));
        }
        Ok(())
    }
}

/// How slices follow each other.
struct Line {
    /// From one slice to the next, on average.
    step: DVec3,
    /// Distances from the first, where they are uneven.
    heights: Option<Vec<f64>>,
    /// Distances of neighbours, in words.
    gaps: String,
}

impl Line {
    fn of(source: &Source, headers: &[Header], slices: &[Slice], frame: &Frame) -> Result<Self> {
        let pixel = frame.spacing[0].min(frame.spacing[1]);
        for pair in slices.windows(2) {
            if pair[1].height - pair[0].height <= 1e-3 * pixel {
                return Err(headers[pair[1].file].error(
                    "ImagePositionPatient",
                    format!(
                        "{} and {} lie at the same place, {:.3} mm along the normal: one volume has one slice there",
                        called(headers, &pair[0]),
                        called(headers, &pair[1]),
                        pair[1].height
                    ),
                ));
            }
        }
        let (first, last) = (slices[0], slices[slices.len() - 1]);
        let whole = last.position - first.position;
        let intervals = num::f64_of(slices.len() - 1);
        let step = whole / intervals;
        let mut even = true;
        for (i, slice) in slices.iter().enumerate() {
            let share = (slice.height - first.height) / (last.height - first.height);
            let beside = (slice.position - first.position - whole * share).length();
            if beside > BESIDE * pixel {
                return Err(source.error(
                    "ImagePositionPatient",
                    format!(
                        "{} lies {beside:.3} mm beside the line from {} to {}: slices must follow one line",
                        called(headers, slice),
                        called(headers, &first),
                        called(headers, &last)
                    ),
                ));
            }
            even &= (share * intervals - num::f64_of(i)).abs() <= ROUNDING;
        }
        // Distances along the line, which is the third axis.
        let along = whole.length() / (last.height - first.height);
        let heights: Vec<f64> = slices.iter().map(|slice| (slice.height - first.height) * along).collect();
        let gaps = gaps(&heights);
        Ok(Self { step, heights: (!even).then_some(heights), gaps })
    }
}

/// Distances of neighbours, where several that are alike follow each other as one.
fn gaps(heights: &[f64]) -> String {
    /// Most that are listed.
    const MOST: usize = 8;
    let mut runs: Vec<(f64, usize)> = Vec::new();
    for pair in heights.windows(2) {
        let gap = pair[1] - pair[0];
        match runs.last_mut() {
            Some((last, count)) if (gap - *last).abs() <= ROUNDING * *last => *count += 1,
            _ => runs.push((gap, 1)),
        }
    }
    let more = runs.len().saturating_sub(MOST);
    let one = |(gap, count): &(f64, usize)| {
        let gap = (gap * 1e4).round() / 1e4;
        if *count == 1 { format!("{gap}") } else { format!("{gap} ({count} times)") }
    };
    let mut list: Vec<String> = runs.iter().take(MOST).map(one).collect();
    if more > 0 {
        list.push(format!("and {more} more changes"));
    }
    list.join(", ")
}
