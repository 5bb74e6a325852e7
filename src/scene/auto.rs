//! A camera and a transfer function for data that comes without them.
//!
//! Both are functions of the data alone: the same file gives the same picture.

use glam::DVec3;

use super::{Anatomy, Camera, Data, Grid, Knot, Projection, TransferFunction, View};
use crate::error::{Error, Result};
use crate::num;

/// Vertical angle of view, in degrees.
const FOV_Y_DEG: f64 = 30.0;
/// How far the eye is turned from the front, to the side and upwards, in degrees.
const TURN: f64 = 35.0;
const RISE: f64 = 20.0;
/// Share of the half image that the data's box fills in the tighter direction.
const FILL: f64 = 0.98;

/// A camera that frames data.
///
/// # Errors
///
/// As [`camera`]; [`Error::Invalid`] for data that no camera is chosen for.
pub fn camera_for(data: &Data, width: u32, height: u32) -> Result<Camera> {
    match data {
        Data::Grid(grid) => camera(grid, width, height),
        other => Err(Error::invalid("camera", format!("must be given for a {}", other.kind()))),
    }
}

/// A camera that frames the grid's box: perspective, from the front, turned to one side and slightly
/// from above.
///
/// Where the grid's [`Anatomy`] is known, up is superior and the front is anterior, seen past the
/// patient's left. Otherwise up is +z and the front is -y: most scanners stack slices along z.
///
/// # Errors
///
/// [`crate::Error::Invalid`] if `width` or `height` is not a valid image side, or if the box is so large,
/// so small or so far from the origin that no camera sees it in float64.
pub fn camera(grid: &Grid, width: u32, height: u32) -> Result<Camera> {
    // Towards the viewer, and to the viewer's right, in world coordinates.
    let (front, right) = match grid.anatomy() {
        Anatomy::Unknown => (DVec3::NEG_Y, DVec3::X),
        Anatomy::Ras => (DVec3::Y, DVec3::NEG_X),
        Anatomy::Lps => (DVec3::NEG_Y, DVec3::X),
        Anatomy::Las => (DVec3::Y, DVec3::X),
    };
    let up = DVec3::Z;
    let (turn, rise) = (TURN.to_radians(), RISE.to_radians());
    let towards = (front * turn.cos() + right * turn.sin()) * rise.cos() + up * rise.sin();

    // The eye moves back until every corner of the box lies inside the image.
    let target = grid.centre();
    let at = |distance: f64| Camera {
        eye: target + towards * distance,
        target,
        up,
        projection: Projection::Perspective { fov_y_deg: FOV_Y_DEG },
    };
    let radius = grid.corners().iter().map(|corner| (*corner - target).length()).fold(0.0, f64::max);
    let view = View::new(at(radius), width, height)?;
    let half = FILL * view.pixel_size() * 0.5;
    let tangents = [half * f64::from(width), half * f64::from(height)];
    let distance = grid.corners().into_iter().map(|corner| {
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
/// Most samples that the histogram looks at.
const SAMPLES: usize = 1 << 20;
/// Lines along each axis that the optical depth is measured on.
const LINES: usize = 4096;
const BINS: usize = 256;

/// Shares of the foreground's samples that lie below the knots; relative extinction and linear colour
/// there. Warm and neutral: from brown for the thin and frequent to white for the dense and rare.
const RAMP: [(f64, f64, [f64; 3]); 7] = [
    (0.0, 0.0, [0.24, 0.06, 0.03]),
    (0.25, 0.025, [0.34, 0.09, 0.04]),
    (0.50, 0.08, [0.50, 0.17, 0.07]),
    (0.70, 0.20, [0.68, 0.31, 0.14]),
    (0.85, 0.45, [0.84, 0.54, 0.30]),
    (0.95, 0.80, [0.95, 0.82, 0.60]),
    (0.995, 1.0, [1.0, 0.98, 0.92]),
];

/// A transfer function that shows what is in the data, without knowing what it is.
///
/// The background - air, zero, padding - is the histogram's peak, if that is also what the box's faces
/// show; the foreground starts at the peak's foot. Knots stand at quantiles of the foreground, so that
/// outliers do not matter and every kind of scan uses all colours. Extinction is scaled so that the
/// densest tenth of the lines through the foreground has an optical depth of at least 5: the picture is
/// neither empty nor a solid block, whatever the unit of length.
///
/// # Errors
///
/// [`crate::Error::Invalid`] if the values are so large that float64 cannot hold their differences.
pub fn transfer(grid: &Grid) -> Result<TransferFunction> {
    let knots = shape(grid);
    let depth = dense_depth(grid, &TransferFunction::new(knots.clone())?);
    // Things that every line misses are a few samples wide.
    let scale = DEPTH / if depth > 0.0 { depth } else { grid.spacing().max_element() };
    TransferFunction::new(knots.into_iter().map(|knot| Knot { tau: knot.tau * scale, ..knot }).collect())
}

/// The knots, with the extinction relative to its largest value.
fn shape(grid: &Grid) -> Vec<Knot> {
    let [lo, hi] = grid.range();
    let values = sorted(all_samples(grid));
    let knot = |s: f64, tau: f64, [r, g, b]: [f64; 3]| Knot { s, colour: DVec3::new(r, g, b), tau };
    if lo >= hi || values.is_empty() {
        return vec![knot(lo, 1.0, RAMP[3].2)];
    }

    // A foreground below the background is treated as its mirror image.
    let (foot, sign) = foreground(grid, &values);
    let mut inside: Vec<f64> = values.iter().map(|s| s * sign).filter(|s| *s > foot * sign).collect();
    if sign < 0.0 {
        inside.reverse();
    }
    if inside.is_empty() {
        // So few samples that the subset has none of them: the range knows of them all the same.
        inside.push(if sign > 0.0 { hi } else { -lo });
    }

    let mut knots = vec![knot(foot * sign, RAMP[0].1, RAMP[0].2)];
    let mut group = 0;
    for (i, &(rank, tau, colour)) in RAMP.iter().enumerate().skip(1) {
        let s = quantile(&inside, rank);
        if knots.len() > 1 && s <= knots[knots.len() - 1].s {
            // Quantiles that coincide share one knot: the middle one of them.
            group += 1;
            let (_, tau, colour) = RAMP[i - group / 2];
            let last = knots.len() - 1;
            knots[last] = knot(s, tau, colour);
        } else {
            group = 0;
            knots.push(knot(s, tau, colour));
        }
    }
    if sign < 0.0 {
        for knot in &mut knots {
            knot.s = -knot.s;
        }
        knots.reverse();
    }
    knots
}

/// Where the foreground starts, and whether it lies above (1) or below (-1) that.
fn foreground(grid: &Grid, values: &[f64]) -> (f64, f64) {
    let [lo, hi] = grid.range();
    // Outliers would squeeze everything else into a few bins; but very few samples may be all there is.
    let inner = [quantile(values, 0.001), quantile(values, 0.999)];
    let [lo, hi] = if inner[0] < inner[1] { inner } else { [lo, hi] };
    let width = (hi - lo) / num::f64_of(BINS);
    let bin_of = |s: f64| num::usize_of((s - lo) / width).min(BINS - 1);
    let mut histogram = [0_usize; BINS];
    for &s in values {
        histogram[bin_of(s)] += 1;
    }

    let peak = histogram.iter().enumerate().max_by_key(|&(bin, count)| (*count, BINS - bin));
    let (peak, top) = peak.map_or((0, 0), |(bin, &count)| (bin, count));
    let border = bin_of(quantile(&sorted(faces(grid)), 0.5));
    if border.abs_diff(peak) > BINS / 16 {
        return (lo, 1.0); // no background to leave out
    }

    // Zack, Rogers and Latt (1977): the foot of a peak is where the histogram lies farthest below the
    // line from the peak's top to the end of the longer tail.
    let upwards = peak < BINS / 2;
    let tail = if upwards { BINS - 1 - peak } else { peak };
    let at = |i: usize| if upwards { peak + i } else { peak - i };
    let drop = num::f64_of(top) / num::f64_of(tail);
    // A second peak close by is background too: air beside padding, noise beside zero.
    let near = |i: usize| (i..=tail.min(i + BINS / 16)).map(|i| histogram[at(i)]).max().unwrap_or(0);
    let below = |i: usize| num::f64_of(top) - drop * num::f64_of(i) - num::f64_of(near(i));
    let foot = (1..=tail).max_by(|&a, &b| below(a).total_cmp(&below(b)).then(b.cmp(&a))).unwrap_or(1);
    if upwards {
        (lo + width * num::f64_of(at(foot)), 1.0)
    } else {
        (lo + width * num::f64_of(at(foot) + 1), -1.0)
    }
}

/// Optical depth that a tenth of the index lines with something on them exceeds.
fn dense_depth(grid: &Grid, transfer: &TransferFunction) -> f64 {
    let dims = grid.dims();
    let mut depths = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let step = grid.spacing()[axis];
        let area = num::index(dims[u]) * num::index(dims[v]);
        for line in (0..area).step_by(stride(area, LINES)) {
            let mut index = [0_u32; 3];
            index[u] = num::count(line % num::index(dims[u]));
            index[v] = num::count(line / num::index(dims[u]));
            let mut depth = 0.0;
            for i in 0..dims[axis] {
                index[axis] = i;
                depth += transfer.at(grid.value(index[0], index[1], index[2])).1;
            }
            depths.push(depth * step);
        }
    }
    let most = depths.iter().copied().fold(0.0, f64::max);
    depths.retain(|&depth| depth > 0.01 * most);
    quantile(&sorted(depths), 0.9)
}

/// An evenly spread, repeatable subset of the samples.
fn all_samples(grid: &Grid) -> Vec<f64> {
    let samples = grid.samples();
    let rescale = grid.rescale();
    let stride = stride(samples.len(), SAMPLES);
    (0..samples.len()).step_by(stride).map(|i| rescale.slope * samples.get(i) + rescale.intercept).collect()
}

/// The samples of the box's six faces, thinned out.
fn faces(grid: &Grid) -> Vec<f64> {
    let dims = grid.dims();
    let mut values = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let area = num::index(dims[u]) * num::index(dims[v]);
        for i in (0..area).step_by(stride(area, SAMPLES / 16)) {
            for end in [0, dims[axis] - 1] {
                let mut index = [end; 3];
                index[u] = num::count(i % num::index(dims[u]));
                index[v] = num::count(i / num::index(dims[u]));
                values.push(grid.value(index[0], index[1], index[2]));
            }
        }
    }
    values
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
    use crate::scene::{Field, Rescale, Samples};

    /// Optical depth along the middle line of index axis x.
    fn depth(grid: &Grid, transfer: &TransferFunction) -> f64 {
        let [x, y, z] = grid.dims();
        let taus = (0..x).map(|i| transfer.at(grid.value(i, y / 2, z / 2)).1);
        taus.sum::<f64>() * grid.spacing().x
    }

    /// A ball of about 100 with a core of about 200, in noise of up to 20, in a box of side `side`.
    fn ball(side: f64, sign: f64) -> Grid {
        let n = 40_u32;
        let mut state = 1_u32;
        let mut values = Vec::new();
        for i in 0..n * n * n {
            let place = DVec3::new(f64::from(i % n), f64::from(i / n % n), f64::from(i / n / n));
            let radius = (place - 19.5).length();
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(state >> 8) / f64::from(1 << 24) * 20.0;
            let value = if radius < 6.0 {
                200.0
            } else if radius < 13.0 {
                100.0
            } else {
                0.0
            };
            values.push(num::f32_of(sign * (value + noise)));
        }
        let spacing = DVec3::splat(side / 39.0);
        let grid = Grid::new([n; 3], Samples::F32(values)).unwrap();
        grid.with_placement(spacing, DVec3::ZERO, glam::DMat3::IDENTITY).unwrap()
    }

    #[test]
    fn background_is_vacuum_and_depth_does_not_depend_on_the_unit_of_length() {
        for sign in [1.0, -1.0] {
            let metres = ball(0.2, sign);
            let transfer_metres = transfer(&metres).unwrap();
            for noise in [0.0, 10.0, 19.0] {
                assert!(transfer_metres.at(sign * noise).1 < 0.01 * transfer_metres.max_tau());
            }
            let (shell, core) = (transfer_metres.at(sign * 110.0).1, transfer_metres.at(sign * 210.0).1);
            assert!(shell > 0.0 && core > 2.0 * shell, "{sign}: {shell} {core}");
            let millimetres = ball(200.0, sign);
            let transfer_millimetres = transfer(&millimetres).unwrap();
            let depths = [depth(&metres, &transfer_metres), depth(&millimetres, &transfer_millimetres)];
            assert!(depths[0] > 2.0 && depths[0] < 12.0, "{depths:?}");
            assert!((depths[0] - depths[1]).abs() < 1e-9 * depths[0]);
            assert!(transfer_metres.knots().len() <= 12);
        }
    }

    #[test]
    fn outliers_do_not_hide_the_rest() {
        let clean = ball(1.0, 1.0);
        let Samples::F32(mut values) = clean.samples().clone() else { unreachable!() };
        values[5] = 1e9;
        values[6] = -1e9;
        values[7] = f32::NAN;
        values[8] = f32::INFINITY;
        let dirty = Grid::new([40; 3], Samples::F32(values)).unwrap();
        let transfer = transfer(&dirty).unwrap();
        assert!(transfer.domain()[1] < 300.0, "{:?}", transfer.domain());
        assert!(transfer.at(15.0).1 < 0.01 * transfer.max_tau());
        assert!(transfer.at(110.0).1 > 0.0);
    }

    #[test]
    fn masks_labels_and_constant_data_are_seen() {
        let make = |values: Vec<u8>| Grid::new([16; 3], Samples::U8(values)).unwrap();
        let inside =
            |i: usize| (i % 16).abs_diff(8) < 4 && (i / 16 % 16).abs_diff(8) < 4 && (i / 256).abs_diff(8) < 4;
        let mask = make((0..4096).map(|i| u8::from(inside(i))).collect());
        let tf = transfer(&mask).unwrap();
        assert_eq!(tf.at(0.0).1, 0.0);
        assert!(depth(&mask, &tf) > 2.0 && depth(&mask, &tf) < 12.0);

        // One sample in 4096: below every quantile that is looked at.
        let point = make((0..4096).map(|i| u8::from(i == 2184)).collect());
        assert!(transfer(&point).unwrap().at(1.0).1 > 0.0);

        // One in two million, at an odd place: neither the subset nor a line meets it.
        let samples = (0..1 << 21).map(|i| u8::from(i == 1_096_897)).collect();
        let lost = Grid::new([128; 3], Samples::U8(samples)).unwrap();
        let tf = transfer(&lost).unwrap();
        assert!(tf.at(0.0).1 == 0.0 && tf.at(1.0).1 > 5.0 * tf.at(0.1).1, "{tf:?}");

        let labels = make((0..4096).map(|i| if inside(i) { 1 + u8::from(i % 16 > 8) } else { 0 }).collect());
        let tf = transfer(&labels).unwrap();
        assert_eq!(tf.at(0.0).1, 0.0);
        assert!(tf.at(1.0).1 > 0.0 && tf.at(2.0).1 > 0.0);

        let constant = make(vec![7; 4096]);
        let tf = transfer(&constant).unwrap();
        assert!(depth(&constant, &tf) > 2.0 && depth(&constant, &tf) < 12.0);
    }

    #[test]
    fn the_same_data_gives_the_same_function_whatever_its_scale() {
        let grid = Field::Blobs.sample([32; 3], "u8").unwrap();
        let first = transfer(&grid).unwrap();
        assert_eq!(first, transfer(&grid).unwrap());
        let rescaled = grid.with_rescale(Rescale { slope: 10.0, intercept: -1000.0 }).unwrap();
        for (a, b) in first.knots().iter().zip(transfer(&rescaled).unwrap().knots()) {
            assert!(
                (a.s * 10.0 - 1000.0 - b.s).abs() < 1e-6 && (a.tau - b.tau).abs() < 1e-9 * first.max_tau()
            );
        }
    }

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
                let camera = camera(&grid, width, height).unwrap();
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
}
