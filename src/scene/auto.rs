//! A camera and a transfer function for data that comes without them.
//!
//! Both are functions of the data alone: the same file gives the same picture.

mod grid;
mod mesh;
mod points;

use glam::DVec3;

use super::{Anatomy, Camera, Data, Kernels, Knot, Projection, TransferFunction, View};
use crate::error::Result;
use crate::num;

/// Vertical angle of view, in degrees.
const FOV_Y_DEG: f64 = 30.0;
/// How far the eye is turned from the front, to the side and upwards, in degrees.
const TURN: f64 = 35.0;
const RISE: f64 = 20.0;
/// Share of the half image that the data's box fills in the tighter direction.
const FILL: f64 = 0.98;

/// A camera that frames the box of data: perspective, from the front, turned to one side and slightly
/// from above.
///
/// Where a grid's [`Anatomy`] is known, up is superior and the front is anterior, seen past the
/// patient's left. Otherwise up is +z and the front is -y: most scanners stack slices along z.
///
/// # Errors
///
/// [`crate::Error::Invalid`] if `width` or `height` is not a valid image side, or if the box is so large,
/// so small or so far from the origin that no camera sees it in float64.
pub fn camera(data: &Data, width: u32, height: u32) -> Result<Camera> {
    let anatomy = match data {
        Data::Grid(grid) => grid.anatomy(),
        Data::Mesh(_) | Data::Points(_) => Anatomy::Unknown,
    };
    // Towards the viewer, and to the viewer's right, in world coordinates.
    let (front, right) = match anatomy {
        Anatomy::Unknown => (DVec3::NEG_Y, DVec3::X),
        Anatomy::Ras => (DVec3::Y, DVec3::NEG_X),
        Anatomy::Lps => (DVec3::NEG_Y, DVec3::X),
        Anatomy::Las => (DVec3::Y, DVec3::X),
    };
    let up = DVec3::Z;
    let (turn, rise) = (TURN.to_radians(), RISE.to_radians());
    let towards = (front * turn.cos() + right * turn.sin()) * rise.cos() + up * rise.sin();

    // The eye moves back until every corner of the box lies inside the image.
    let corners = data.corners();
    let target = 0.5 * (corners[0] + corners[7]);
    let at = |distance: f64| Camera {
        eye: target + towards * distance,
        target,
        up,
        projection: Projection::Perspective { fov_y_deg: FOV_Y_DEG },
    };
    let radius = corners.iter().map(|corner| (*corner - target).length()).fold(0.0, f64::max);
    let view = View::new(at(radius), width, height)?;
    let half = FILL * view.pixel_size() * 0.5;
    let tangents = [half * f64::from(width), half * f64::from(height)];
    let distance = corners.into_iter().map(|corner| {
        let relative = corner - target;
        let across =
            (relative.dot(view.right()).abs() / tangents[0]).max(relative.dot(view.up()).abs() / tangents[1]);
        across - relative.dot(view.forward())
    });
    let camera = at(distance.fold(0.0, f64::max));
    View::new(camera, width, height)?;
    Ok(camera)
}

/// Optical depth that the densest tenth of the lines through the data gets.
const DEPTH: f64 = 5.0;
/// Most samples, or cells, that the histogram looks at.
const SAMPLES: usize = 1 << 20;
/// Lines along each axis that the optical depth is measured on.
const LINES: usize = 4096;
const BINS: usize = 256;

/// Shares of the foreground's samples that lie below the knots, and relative extinction there.
const RAMP: [(f64, f64); 7] =
    [(0.0, 0.0), (0.25, 0.025), (0.50, 0.08), (0.70, 0.20), (0.85, 0.45), (0.95, 0.80), (0.995, 1.0)];

/// Linear colours of the knots. Warm and neutral: from brown for the thin and frequent to white for the dense and
/// rare.
const WARM: [[f64; 3]; RAMP.len()] = [
    [0.24, 0.06, 0.03],
    [0.34, 0.09, 0.04],
    [0.50, 0.17, 0.07],
    [0.68, 0.31, 0.14],
    [0.84, 0.54, 0.30],
    [0.95, 0.82, 0.60],
    [1.0, 0.98, 0.92],
];

/// A transfer function that shows what is in the data, without knowing what it is.
///
/// The background of a grid - air, zero, padding - is the histogram's peak, if that is also what the box's faces
/// show; it is vacuum, and the foreground starts at the peak's foot. The background of a mesh is what a tenth of its
/// volume or more has about one value - the free stream, rest -; it is a haze that shows the mesh's shape, and what
/// differs is warm above it and cool below. Of points those with low scalars are a haze; points without scalars have one
/// colour.
///
/// Knots stand at quantiles of the foreground, by samples or by volume, so that outliers do not matter
/// and every kind of data uses all colours. Extinction is scaled so that the densest tenth of the lines through the
/// foreground has an optical depth of at least 5: the picture is neither empty nor a solid block, whatever the unit
/// of length.
///
/// # Errors
///
/// [`crate::Error::Invalid`] if the values are so large that float64 cannot hold their differences.
pub fn transfer(data: &Data) -> Result<TransferFunction> {
    transfer_of(data, None)
}

/// The same for a scene with kernels of its own: where those of points add up, extinction is scaled by their sums; where
/// they interpolate, by the length on which there are any.
///
/// # Errors
///
/// As [`transfer`].
pub fn transfer_of(data: &Data, kernels: Option<&Kernels>) -> Result<TransferFunction> {
    match data {
        Data::Grid(grid) => grid::transfer(grid),
        Data::Mesh(mesh) => mesh::transfer(mesh),
        Data::Points(points) => points::transfer(points, kernels.unwrap_or(&Kernels::of_points())),
    }
}

fn knot(s: f64, tau: f64, [r, g, b]: [f64; 3]) -> Knot {
    Knot { s, colour: DVec3::new(r, g, b), tau }
}

/// Knots from the foot of the background up, at quantiles of the values above it, which ascend; extinction is
/// relative to its largest value.
fn ramp(foot: f64, above: &[f64], colours: &[[f64; 3]; RAMP.len()]) -> Vec<Knot> {
    let mut knots = vec![knot(foot, RAMP[0].1, colours[0])];
    let mut group = 0;
    for (i, &(rank, tau)) in RAMP.iter().enumerate().skip(1) {
        let s = quantile(above, rank);
        if knots.len() > 1 && s <= knots[knots.len() - 1].s {
            // Quantiles that coincide share one knot: the middle one of them.
            group += 1;
            let middle = i - group / 2;
            let last = knots.len() - 1;
            knots[last] = knot(s, RAMP[middle].1, colours[middle]);
        } else {
            group = 0;
            knots.push(knot(s, tau, colours[i]));
        }
    }
    knots
}

/// The same downwards: the values below the foot, still in ascending order.
fn ramp_down(foot: f64, below: &[f64], colours: &[[f64; 3]; RAMP.len()]) -> Vec<Knot> {
    let mirrored: Vec<f64> = below.iter().rev().map(|s| -s).collect();
    let mut knots = ramp(-foot, &mirrored, colours);
    for knot in &mut knots {
        knot.s = -knot.s;
    }
    knots.reverse();
    knots
}

/// How often values occur.
struct Histogram {
    low: f64,
    width: f64,
    counts: [usize; BINS],
}

impl Histogram {
    /// Of ascending values; `range` is what they lie in.
    fn new(values: &[f64], range: [f64; 2]) -> Self {
        // Outliers would squeeze everything else into a few bins; but very few samples may be all there is.
        let inner = [quantile(values, 0.001), quantile(values, 0.999)];
        let [low, high] = if inner[0] < inner[1] { inner } else { range };
        let mut histogram = Self { low, width: (high - low) / num::f64_of(BINS), counts: [0; BINS] };
        for &s in values {
            histogram.counts[histogram.bin(s)] += 1;
        }
        histogram
    }

    /// The bin of a value; what lies beyond is in the bins at the ends.
    fn bin(&self, s: f64) -> usize {
        num::usize_of((s - self.low) / self.width).min(BINS - 1)
    }

    /// The fullest bin.
    fn peak(&self) -> usize {
        let fullest = self.counts.iter().enumerate().max_by_key(|&(bin, count)| (*count, BINS - bin));
        fullest.map_or(0, |(bin, _)| bin)
    }

    /// The foot of a peak on one side.
    ///
    /// Zack, Rogers and Latt (1977): it is where the histogram lies farthest below the line from the peak's top to
    /// the end of the tail.
    fn foot(&self, peak: usize, upwards: bool) -> f64 {
        let tail = if upwards { BINS - 1 - peak } else { peak };
        let at = |i: usize| if upwards { peak + i } else { peak - i };
        let top = num::f64_of(self.counts[peak]);
        let drop = top / num::f64_of(tail);
        // A second peak close by is background too: air beside padding, noise beside zero.
        let near = |i: usize| (i..=tail.min(i + BINS / 16)).map(|i| self.counts[at(i)]).max().unwrap_or(0);
        let below = |i: usize| top - drop * num::f64_of(i) - num::f64_of(near(i));
        let foot = (1..=tail).max_by(|&a, &b| below(a).total_cmp(&below(b)).then(b.cmp(&a)));
        // Of the foot's bin the edge that is nearer to the peak.
        let edge = match foot {
            None => peak + usize::from(upwards),
            Some(foot) => at(foot) + usize::from(!upwards),
        };
        self.low + self.width * num::f64_of(edge)
    }
}

/// The step that takes about `wanted` of `count` things; odd and, where it is large, not a multiple of
/// small numbers, so that it does not walk along one column of a grid with round extents.
fn stride(count: usize, wanted: usize) -> usize {
    let step = count.div_ceil(wanted.max(1)).max(1);
    let shares = |step: usize| [2, 3, 5, 7].iter().any(|factor| step.is_multiple_of(*factor));
    if step < 4 {
        step
    } else {
        (step..).find(|&step| step < 11 && step % 2 == 1 || !shares(step)).unwrap_or(step)
    }
}

/// The numbers of a list in ascending order, without what is not finite.
fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    values
}

/// The value below which a share of a sorted list lies; NaN for an empty one.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    sorted[num::usize_of((share * num::f64_of(last)).round()).min(last)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Field, Grid, Samples};

    #[test]
    fn every_corner_lies_in_the_image_and_superior_is_up() {
        for anatomy in [Anatomy::Unknown, Anatomy::Ras, Anatomy::Lps, Anatomy::Las] {
            for (width, height, spacing) in
                [(512, 512, [1.0; 3]), (800, 200, [0.1, 1.0, 9.0]), (100, 700, [1e6; 3])]
            {
                let grid = Grid::new([8, 9, 10], Samples::U8(vec![1; 720])).unwrap().with_anatomy(anatomy);
                let origin = DVec3::new(-3.0, 70.0, 5.0);
                let grid =
                    grid.with_placement(DVec3::from_array(spacing), origin, glam::DMat3::IDENTITY).unwrap();
                let camera = camera(&grid.clone().into(), width, height).unwrap();
                let view = View::new(camera, width, height).unwrap();
                let mut reach = 0.0_f64;
                for corner in grid.corners() {
                    let (pixel, depth) = view.project(corner).unwrap();
                    let u = (pixel.x / f64::from(width) * 2.0 - 1.0).abs();
                    let v = (pixel.y / f64::from(height) * 2.0 - 1.0).abs();
                    assert!(depth > 0.0 && u <= 1.0 && v <= 1.0, "{anatomy:?}: {u} {v}");
                    reach = reach.max(u).max(v);
                }
                assert!((reach - FILL).abs() < 1e-6, "{anatomy:?}: {reach}");
                assert!(view.up().z > 0.9);
                let anterior =
                    if matches!(anatomy, Anatomy::Ras | Anatomy::Las) { DVec3::Y } else { DVec3::NEG_Y };
                assert!(view.forward().dot(anterior) < -0.5, "{anatomy:?}");
            }
        }
    }

    #[test]
    fn a_mesh_is_framed_by_the_box_of_what_is_drawn() {
        let mut points = Field::Ramp.tets(2).unwrap().points().to_vec();
        // A point that no tetrahedron uses.
        points.push(DVec3::splat(1e6));
        let mesh = Field::Ramp.tets(2).unwrap();
        let scalars = vec![1.0; points.len()];
        let mesh =
            crate::scene::Tets::new(points, mesh.cells().to_vec(), crate::scene::TetScalars::Point(scalars));
        let data = Data::from(mesh.unwrap().0);
        let camera = camera(&data, 300, 200).unwrap();
        assert_eq!(camera.target, DVec3::ZERO);
        let view = View::new(camera, 300, 200).unwrap();
        let heights = data.corners().map(|corner| (view.project(corner).unwrap().0.y / 100.0 - 1.0).abs());
        let reach = heights.into_iter().fold(0.0, f64::max);
        assert!((reach - FILL).abs() < 1e-6, "{reach}");
    }
}
