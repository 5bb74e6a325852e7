//! The automatic transfer function of a grid.

use super::statistics::{
    BINS, DEPTH, HALVES, Histogram, RAYS, SAMPLES, TAILS, WARM, diverging, knot, quantile, ramp, ramp_down,
    signs, sorted, stride, substantial,
};
use crate::error::Result;
use crate::num;
use crate::scene::grid::turned;
use crate::scene::{Grid, Knot, TransferFunction};

pub(super) fn transfer(grid: &Grid) -> Result<TransferFunction> {
    let grid = &*grid.overview();
    let shape = TransferFunction::new(shape(grid))?;
    shape.thickened(DEPTH / dense_depth(grid, &shape))
}

/// Returns the knots, with extinction relative to its largest value.
fn shape(grid: &Grid) -> Vec<Knot> {
    let [lo, hi] = grid.range();
    let values = sorted(all_samples(grid));
    if lo >= hi || values.is_empty() {
        return vec![knot(lo, 1.0, WARM[3])];
    }
    // The subset may have missed a tiny foreground; the range still shows that it exists.
    let or = |inside: Vec<f64>, rare: f64| if inside.is_empty() { vec![rare] } else { inside };
    match foreground(grid, &values) {
        Foreground::Above(foot) => {
            ramp(foot, &or(values.into_iter().filter(|s| *s > foot).collect(), hi), &WARM)
        }
        Foreground::Below(foot) => {
            ramp_down(foot, &or(values.into_iter().filter(|s| *s < foot).collect(), lo), &WARM)
        }
        Foreground::Beside(foot) => diverging(&values, foot),
    }
}

/// Where the foreground starts.
enum Foreground {
    Above(f64),
    Below(f64),
    /// Above this value and below its negative.
    Beside(f64),
}

fn foreground(grid: &Grid, values: &[f64]) -> Foreground {
    let histogram = Histogram::new(values, grid.range());
    let peak = histogram.peak();
    let border = histogram.bin(quantile(&sorted(faces(grid)), 0.5));
    if border.abs_diff(peak) > BINS / 16 {
        // There is no background to leave out, but perhaps air around that fills less than the rest.
        let is_amid = (BINS / 16..BINS - BINS / 16).contains(&border);
        return match signs(values, HALVES).filter(|_| is_amid) {
            Some(_) => Foreground::Beside(0.0),
            None => Foreground::Above(histogram.low),
        };
    }
    // Where the background is zero, both signs are foreground. (That of computed tomography is air, and far from zero.)
    let is_zero = peak.abs_diff(histogram.bin(0.0)) <= 1;
    if let Some(magnitude) = signs(values, TAILS).filter(|_| is_zero) {
        let feet = [true, false].map(|upwards| histogram.foot(peak, upwards).abs());
        return Foreground::Beside(feet[0].min(feet[1]).min(0.5 * magnitude));
    }
    // The foreground is the longer tail.
    if peak < BINS / 2 {
        Foreground::Above(histogram.foot(peak, true))
    } else {
        Foreground::Below(histogram.foot(peak, false))
    }
}

/// Returns the 90 % quantile of optical depth over index-aligned rays, leaving out nearly empty ones; positive.
pub(super) fn dense_depth(grid: &Grid, transfer: &TransferFunction) -> f64 {
    let grid = &*grid.overview();
    let rays = (0..3).flat_map(|axis| spread(grid, axis, RAYS).map(move |ray| (axis, ray)));
    let depth = |(axis, ray)| {
        let taus = (0..grid.dims()[axis]).map(|i| transfer.at(value(grid, axis, ray, i)).1);
        taus.sum::<f64>() * grid.spacing()[axis]
    };
    let depth = quantile(&substantial(rays.map(depth).collect()), 0.9);
    // Features that every ray misses are a few samples wide.
    if depth > 0.0 { depth } else { grid.spacing().max_element() }
}

/// Returns numbers of about `wanted` rays along an axis, counted over the face that they cross.
fn spread(grid: &Grid, axis: usize, wanted: usize) -> impl Iterator<Item = usize> {
    let [u, v, _] = turned(grid.dims(), axis).map(num::index);
    (0..u * v).step_by(stride(u * v, wanted))
}

/// Returns the value of sample `i` on a ray along an axis.
fn value(grid: &Grid, axis: usize, ray: usize, i: u32) -> f64 {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let width = num::index(grid.dims()[u]);
    let mut index = [i; 3];
    (index[u], index[v]) = (num::count(ray % width), num::count(ray / width));
    grid.value(index[0], index[1], index[2])
}

/// Returns an evenly spread, repeatable subset of the samples.
pub(super) fn all_samples(grid: &Grid) -> Vec<f64> {
    let grid = &*grid.overview();
    let samples = grid.samples();
    let rescale = grid.rescale();
    let stride = stride(samples.len(), SAMPLES);
    (0..samples.len()).step_by(stride).map(|i| rescale.slope * samples.get(i) + rescale.intercept).collect()
}

/// Returns a subset of the samples on the six faces of the box.
fn faces(grid: &Grid) -> Vec<f64> {
    let rays = (0..3).flat_map(|axis| spread(grid, axis, SAMPLES / 16).map(move |ray| (axis, ray)));
    let ends = |(axis, ray)| [0, grid.dims()[axis] - 1].map(|end| value(grid, axis, ray, end));
    rays.flat_map(ends).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::{Field, Rescale, Samples};

    /// Optical depth along the middle ray of index axis x.
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

    /// A grid of 32 samples along each side, of a function of the place in [-1, 1].
    fn made(of: impl Fn(DVec3) -> f64) -> Grid {
        let place =
            |i: u32| DVec3::new(f64::from(i % 32), f64::from(i / 32 % 32), f64::from(i / 1024)) / 15.5 - 1.0;
        Grid::new([32; 3], Samples::F32((0..1 << 15).map(|i| num::f32_of(of(place(i)))).collect())).unwrap()
    }

    fn bump(place: DVec3, at: f64, width: f64) -> f64 {
        (-(place - DVec3::splat(at)).length_squared() / (width * width)).exp()
    }

    #[test]
    fn both_signs_of_a_map_are_shown() {
        // Activation above and below zero, of another height and another share of the samples; a wave without a background.
        let map = made(|p| 3.0 * bump(p, 0.3, 0.25) - 5.0 * bump(p, -0.3, 0.5));
        let wave = made(|p| (7.0 * p.x).sin() * (5.0 * p.y).cos());
        for (grid, some) in [(&map, 2.5), (&wave, 0.9)] {
            let transfer = transfer(grid).unwrap();
            assert!(crate::scene::auto::diverges(&transfer), "{transfer:?}");
            let [(warm, above), (cool, below)] = [some, -some].map(|s| transfer.at(s));
            assert!(above > 0.1 * transfer.max_tau() && above == below, "{above} {below}");
            assert!(warm.x > warm.z && cool.z > cool.x && transfer.at(0.0).1 == 0.0, "{warm} {cool}");
            let maximum = crate::scene::auto::maximum(&grid.clone().into()).unwrap();
            assert_eq!(maximum.domain()[0], 0.0);
        }
    }

    #[test]
    fn values_around_another_background_or_with_an_undershoot_have_one_foreground() {
        let air =
            made(|p| -1000.0 + 1040.0 * f64::from(p.length() < 0.8) + 900.0 * f64::from(p.length() < 0.3));
        let undershoot = made(|p| bump(p, 0.0, 0.3) - 0.04 * bump(p, 0.5, 0.3));
        let wave = made(|p| 0.4 + (7.0 * p.x).sin() * (5.0 * p.y).cos() * 0.5);
        // Computed tomography that was cropped to the body, with air in its corners or within.
        let cropped =
            made(|p| if p.abs().max_element() > 0.95 { -1000.0 } else { 40.0 + 1100.0 * bump(p, 0.0, 0.3) });
        let lungs = made(|p| 40.0 + 1500.0 * bump(p, 0.5, 0.2) - 900.0 * bump(p, -0.4, 0.3));
        for (grid, high) in [(air, 900.0), (undershoot, 0.9), (wave, 0.8), (cropped, 1100.0), (lungs, 1400.0)]
        {
            let transfer = transfer(&grid).unwrap();
            assert!(!crate::scene::auto::diverges(&transfer), "{transfer:?}");
            assert!(transfer.at(high).1 > 0.5 * transfer.max_tau(), "{transfer:?}");
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

        // One sample in 4096: no quantile reaches it.
        let point = make((0..4096).map(|i| u8::from(i == 2184)).collect());
        assert!(transfer(&point).unwrap().at(1.0).1 > 0.0);

        // One sample in two million, at an odd place: neither the subset nor a ray meets it.
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
}
