//! The geometry of slices: orientation, spacing, order along their normal.

use glam::DVec3;

use crate::error::Result;
use crate::io::file::source::Source;
use crate::io::formats::dicom::header::{Header, Plane};
use crate::num;
use crate::scene::Rescale;

/// The relative difference of slice distances that is taken as rounding: positions are decimal text.
const ROUNDING: f64 = 0.01;

/// The distance, in pixels, that slices may lie beside their common line.
const BESIDE: f64 = 0.1;

/// A frame, its position and its height along the normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slice {
    pub(crate) file: usize,
    pub(crate) frame: usize,
    pub(crate) position: DVec3,
    pub(crate) height: f64,
    pub(crate) rescale: Rescale,
}

fn called(headers: &[Header], slice: &Slice) -> String {
    let header = &headers[slice.file];
    let name = header.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if header.frames > 1 { format!("{name} frame {}", slice.frame + 1) } else { name }
}

/// Returns the directions of rows and columns.
fn axes(orientation: &[f64; 6]) -> [DVec3; 2] {
    [DVec3::from_slice(orientation), DVec3::from_slice(&orientation[3..])]
}

/// Checks that the samples of a file have the size and type of those of the first.
pub(crate) fn check(first: &Header, header: &Header) -> Result<()> {
    let of = |header: &Header| {
        let Header { rows, columns, samples, allocated, stored, high, signed, float, .. } = *header;
        (rows, columns, samples, allocated, stored, high, signed, float)
    };
    if of(first) == of(header) && first.photometric == header.photometric {
        return Ok(());
    }
    let text = |header: &Header| {
        let Header { rows, columns, stored, allocated, signed, ref photometric, .. } = *header;
        let sign = if signed { "signed" } else { "unsigned" };
        format!("{columns} x {rows} {photometric} samples, {sign}, {stored} of {allocated} bits")
    };
    let name = first.path.file_name().unwrap_or_default().to_string_lossy();
    Err(header.error("samples", format!("{}: {name} has {}", text(header), text(first))))
}

/// The orientation of the first slice, which all others share.
pub(crate) struct Frame {
    /// Unit vectors towards the next column, towards the next row, and normal to both.
    pub(crate) row: DVec3,
    pub(crate) column: DVec3,
    pub(crate) normal: DVec3,
    /// Distance of rows, then of columns, in millimetres.
    pub(crate) spacing: [f64; 2],
    /// Whether the spacing is an assumption.
    pub(crate) guessed: bool,
}

impl Frame {
    pub(crate) fn of(header: &Header) -> Result<Self> {
        let plane = header.plane_of(0);
        let Some(orientation) = plane.orientation else {
            return Err(header.error("ImageOrientationPatient", "missing: slices cannot be placed"));
        };
        let [row, column] = axes(&orientation);
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

    pub(crate) fn check_plane(&self, header: &Header, place: &str, plane: &Plane) -> Result<()> {
        let Some(orientation) = plane.orientation else {
            return Err(header.error(place, "no ImageOrientationPatient"));
        };
        let [row, column] = axes(&orientation);
        // A deviation of 1/1000 moves the hundredth pixel by a tenth of a pixel.
        if (row - self.row).length() > 1e-3 || (column - self.column).length() > 1e-3 {
            let rule = "other slices of the series lie differently";
            return Err(header.error(place, format!("ImageOrientationPatient {orientation:?}: {rule}")));
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

/// The line along which slices are stacked.
pub(crate) struct Line {
    /// The mean step from one slice to the next.
    pub(crate) step: DVec3,
    /// Distances from the first slice, if they are uneven.
    pub(crate) heights: Option<Vec<f64>>,
    /// The distances of neighbours, as text.
    pub(crate) gaps: String,
}

impl Line {
    pub(crate) fn of(source: &Source, headers: &[Header], slices: &[Slice], frame: &Frame) -> Result<Self> {
        let pixel = frame.spacing[0].min(frame.spacing[1]);
        for pair in slices.windows(2) {
            if pair[1].height - pair[0].height <= 1e-3 * pixel {
                let [one, other] = [&pair[0], &pair[1]].map(|slice| called(headers, slice));
                let rule = format!(
                    "{one} and {other} lie at the same place, {:.3} mm along the normal: one volume has one slice there",
                    pair[1].height
                );
                return Err(headers[pair[1].file].error("ImagePositionPatient", rule));
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
                let [slice, first, last] = [slice, &first, &last].map(|slice| called(headers, slice));
                let rule = format!(
                    "{slice} lies {beside:.3} mm beside the line from {first} to {last}: slices must follow one line"
                );
                return Err(source.error("ImagePositionPatient", rule));
            }
            even &= (share * intervals - num::f64_of(i)).abs() <= ROUNDING;
        }
        // Distances are measured along the line, which is the third axis.
        let along = whole.length() / (last.height - first.height);
        let heights: Vec<f64> = slices.iter().map(|slice| (slice.height - first.height) * along).collect();
        let gaps = gaps(&heights);
        Ok(Self { step, heights: (!even).then_some(heights), gaps })
    }
}

/// Lists the distances of neighbours, with runs of equal ones combined.
fn gaps(heights: &[f64]) -> String {
    /// The limit on listed distances.
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
