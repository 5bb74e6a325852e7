//! The automatic transfer function of points.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::statistics::{
    RAYS, SAMPLES, TAILS, WARM, diverging, hazy, knot, quantile, ramp, signs, sorted, span, stride,
    substantial,
};
use crate::error::Result;
use crate::num;
use crate::scene::{KernelSize, Kernels, Knot, Model, Points, TransferFunction};

/// Linear colour of points without scalars.
const PLAIN: [f64; 3] = [0.46, 0.68, 0.95];

/// Approximate limit of intersections of rays and kernels that are computed along each axis.
const CROSSINGS: usize = 1 << 24;

/// Smallest number of rays along a side of the image.
const FEWEST: usize = 16;

pub(super) fn transfer(points: &Points, kernels: &Kernels) -> Result<TransferFunction> {
    // Unknown sizes are estimated, as when a scene is loaded.
    let estimated = (*points.size() == KernelSize::Unknown).then(|| points.clone().with_estimated_radius());
    let points = estimated.as_ref().unwrap_or(points);
    hazy(shape(points), |transfer| dense_depth(points, kernels, transfer))
}

/// Returns the knots, with extinction relative to its largest value.
fn shape(points: &Points) -> Vec<Knot> {
    if points.scalars().is_none() {
        return vec![knot(1.0, 1.0, PLAIN)];
    }
    let values = shown(points);
    let [low, high] = [quantile(&values, 0.0), quantile(&values, 1.0)];
    // All values are equal, or no point of the subset is visible.
    if values.is_empty() || low >= high {
        let s = if values.is_empty() { points.range()[0] } else { low };
        return vec![knot(s, 1.0, WARM[3])];
    }
    if signs(&values, TAILS).is_some() {
        return diverging(&values, 0.0);
    }
    // Low outliers would use up the colour range.
    let foot = quantile(&values, 0.001);
    let above = &values[values.partition_point(|s| *s <= foot)..];
    ramp(foot, above, &WARM)
}

/// Returns scalars of a subset of the visible points, ascending.
pub(super) fn shown(points: &Points) -> Vec<f64> {
    let scalars = points.scalars().unwrap_or_default();
    let shown = (0..scalars.len()).step_by(stride(scalars.len(), SAMPLES)).filter(|&i| points.shows(i));
    sorted(shown.map(|i| f64::from(scalars[i])).collect())
}

/// A kernel projected along an axis: a Gaussian footprint, and the Gaussian along the ray through its centre.
struct Footprint {
    /// Position across the axis, relative to the low corner of the box.
    middle: DVec2,
    along: f64,
    /// Inverse covariance across the axis: uu, uv, vv.
    inverse: [f64; 3],
    /// Three standard deviations across the axis.
    reach: DVec2,
    /// Standard deviation along the axis for a fixed position across it.
    sigma: f64,
    weight: f64,
    scalar: f64,
}

/// Projects kernel `i` along the first axis; None if it is invisible or flat. `low` is the low corner of the box.
fn project(points: &Points, [axis, u, v]: [usize; 3], low: DVec3, i: usize) -> Option<Footprint> {
    let round = |radius: f64| ((radius / 3.0).powi(2), [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
    // Relative to the largest variance: products of tiny lengths would underflow.
    let (variance, c) = match points.size() {
        KernelSize::Unknown => return None,
        KernelSize::Radius(radius) => round(*radius),
        KernelSize::Radii(radii) => round(radii[i].into()),
        KernelSize::Covariances(all) => {
            let c = all[i].map(f64::from);
            let most = c[0].max(c[3]).max(c[5]);
            (most, c.map(|c| c / most))
        }
    };
    let weight = points.weights().map_or(1.0, |weights| f64::from(weights[i]));
    let entry = |a: usize, b: usize| c[[[0, 1, 2], [1, 3, 4], [2, 4, 5]][a][b]];
    let (uu, uv, vv) = (entry(u, u), entry(u, v), entry(v, v));
    let (au, av) = (entry(axis, u), entry(axis, v));
    let across = uu * vv - uv * uv;
    // Schur complement: the variance along the axis for a fixed position across it.
    let along = entry(axis, axis) - (au * au * vv - 2.0 * au * av * uv + av * av * uu) / across;
    let shows = points.shows(i) && weight > 0.0 && weight.is_finite() && variance > 0.0;
    if !(shows && across > 0.0 && along > 0.0) {
        return None;
    }
    let centre = points.centres()[i] - low;
    Some(Footprint {
        middle: DVec2::new(centre[u], centre[v]),
        along: centre[axis],
        inverse: [vv, -uv, uu].map(|entry| entry / across / variance),
        reach: 3.0 * (DVec2::new(uu, vv) * variance).map(f64::sqrt),
        sigma: (along * variance).sqrt(),
        weight,
        scalar: points.scalars().map_or(1.0, |scalars| scalars[i].into()),
    })
}

/// Sums over the kernels on a ray.
#[derive(Clone, Copy, Default)]
struct RaySums {
    /// Integral of the weighted kernels.
    weight: f64,
    /// Integral of the weighted kernels times their extinction.
    tau: f64,
    /// Total length of the intervals in which single kernels exceed the threshold, and the slices (64ths of
    /// the box's depth) that these intervals touch, as bits.
    lengths: f64,
    touched: u64,
}

/// Returns the 90 % quantile of optical depth over axis-aligned rays, leaving out nearly empty ones;
/// positive.
pub(super) fn dense_depth(points: &Points, kernels: &Kernels, transfer: &TransferFunction) -> f64 {
    let depths = (0..3).into_par_iter().flat_map(|axis| ray_depths(points, kernels, transfer, axis));
    let depths = substantial(depths.collect());
    // Rays rarely meet small kernels, which then rarely overlap: measure single kernels.
    let few = depths.len() < FEWEST * FEWEST;
    let single = if few { single_depth(points, kernels, transfer) } else { 0.0 };
    let depth = quantile(&depths, 0.9).max(single);
    if depth > 0.0 && depth.is_finite() { depth } else { 1.0 }
}

/// Returns the 90 % quantile of optical depth over rays through the centres of single kernels.
fn single_depth(points: &Points, kernels: &Kernels, transfer: &TransferFunction) -> f64 {
    let count = points.centres().len();
    let depths = (0..count).step_by(stride(count, SAMPLES)).filter_map(|i| {
        let footprint = project(points, [0, 1, 2], DVec3::ZERO, i)?;
        let mut ray = RaySums::default();
        ray.add(&footprint, 0.0, kernels, transfer, 0.0);
        Some(ray.depth(kernels, f64::INFINITY))
    });
    quantile(&sorted(depths.filter(|depth| *depth > 0.0).collect()), 0.9)
}

impl RaySums {
    /// Adds a kernel; `half_square` is half the square of its distance from the ray, in standard deviations.
    ///
    /// `slice` is a 64th of the box's depth, or 0 where slices are not counted.
    fn add(
        &mut self,
        footprint: &Footprint,
        half_square: f64,
        kernels: &Kernels,
        transfer: &TransferFunction,
        slice: f64,
    ) {
        let Footprint { along, sigma, weight, scalar, .. } = *footprint;
        let peak = weight * (-half_square).exp();
        let integral = peak * sigma * (2.0 * std::f64::consts::PI).sqrt();
        self.weight += integral;
        self.tau += integral * transfer.at(scalar).1;
        if kernels.model == Model::Interpolate && peak > kernels.least {
            let rim = (2.0 * (peak / kernels.least).ln()).min(9.0 - 2.0 * half_square).max(0.0);
            let half = sigma * rim.sqrt();
            self.lengths += 2.0 * half;
            if slice > 0.0 {
                let [first, last] = [along - half, along + half].map(|t| num::usize_of(t / slice).min(63));
                self.touched |= (u64::MAX << first) & (u64::MAX >> (63 - last));
            }
        }
    }

    fn depth(&self, kernels: &Kernels, slice: f64) -> f64 {
        match kernels.model {
            Model::Density => self.tau,
            // Mean extinction times the length on which the field exists.
            Model::Interpolate if self.weight > 0.0 => {
                let touched = slice * f64::from(self.touched.count_ones().max(1));
                self.tau / self.weight * self.lengths.min(touched)
            }
            Model::Interpolate => 0.0,
        }
    }
}

/// Returns the optical depths of parallel rays through the kernels' box along one axis.
fn ray_depths(points: &Points, kernels: &Kernels, transfer: &TransferFunction, axis: usize) -> Vec<f64> {
    let axes = [axis, (axis + 1) % 3, (axis + 2) % 3];
    let [low, high] = points.reach();
    let size = DVec2::new((high - low)[axes[1]], (high - low)[axes[2]]);
    let footprint = |i: usize| project(points, axes, low, i);
    let count = points.centres().len();

    // Where kernels are many and large, fewer rays suffice, and then a subset of the kernels.
    let subset = stride(count, SAMPLES / 16);
    let shares = (0..count).step_by(subset).filter_map(|i| {
        let share = 2.0 * footprint(i)?.reach / size;
        Some((share.x * share.y).min(1.0))
    });
    let share = shares.sum::<f64>() * num::f64_of(subset);
    let mut side = num::usize_of(num::f64_of(RAYS).sqrt());
    let crossings = |side: usize| num::usize_of(share * num::f64_of(side * side));
    while side > FEWEST && crossings(side) > CROSSINGS {
        side /= 2;
    }
    let each = if crossings(side) > CROSSINGS {
        stride(count, count / (crossings(side) / CROSSINGS + 1))
    } else {
        1
    };

    let step = size / num::f64_of(side);
    let slice = (high - low)[axis] / 64.0;
    // Offset from the middle by different amounts, so that no ray passes through the points of a lattice.
    let place = |i: usize, axis: usize| step[axis] * (num::f64_of(i) + [0.4427, 0.5839][axis]);
    let mut all = vec![RaySums::default(); side * side];
    for footprint in (0..count).step_by(each).filter_map(footprint) {
        let Footprint { middle, reach, inverse, .. } = footprint;
        let span =
            |axis: usize| span([middle[axis] - reach[axis], middle[axis] + reach[axis]], step[axis], side);
        for j in span(1) {
            for i in span(0) {
                let p = DVec2::new(place(i, 0), place(j, 1)) - middle;
                let half_square =
                    0.5 * (inverse[0] * p.x * p.x + 2.0 * inverse[1] * p.x * p.y + inverse[2] * p.y * p.y);
                if half_square < 4.5 {
                    all[j * side + i].add(&footprint, half_square, kernels, transfer, slice);
                }
            }
        }
    }
    let all_of = num::f64_of(each);
    // With interpolation, skipped kernels overlap those that were added, so nothing is scaled.
    let scale = if kernels.model == Model::Density { all_of } else { 1.0 };
    all.iter().map(|ray| scale * ray.depth(kernels, slice)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::statistics::DEPTH;
    use super::*;
    use crate::scene::Field;

    fn flat() -> TransferFunction {
        TransferFunction::new(vec![knot(0.0, 1.0, PLAIN)]).unwrap()
    }

    fn scattered(count: u32, scale: f64) -> Points {
        let points = Field::Blobs.points(count).unwrap();
        let centres = points.centres().iter().map(|p| *p * scale).collect();
        Points::new(centres).unwrap().with_scalars(points.scalars().unwrap().to_vec()).unwrap()
    }

    /// Optical depths of some rays along x, ascending, by the definition of the density model.
    fn depths(points: &Points, transfer: &TransferFunction) -> Vec<f64> {
        let KernelSize::Radius(radius) = points.size() else { panic!() };
        let [low, high] = points.bounds();
        let sigma = radius / 3.0;
        let ray = |i: u32| {
            let share = DVec3::new(0.0, f64::from(i % 20) + 0.5, f64::from(i / 20) + 0.5) / 20.0;
            let p = low + (high - low) * share;
            let of = |(i, c): (usize, &DVec3)| {
                let square = (c.y - p.y).powi(2) + (c.z - p.z).powi(2);
                let integral =
                    (-square / (2.0 * sigma * sigma)).exp() * sigma * (2.0 * std::f64::consts::PI).sqrt();
                let s = points.scalars().map_or(1.0, |scalars| f64::from(scalars[i]));
                let w = points.weights().map_or(1.0, |weights| f64::from(weights[i]));
                if square < radius * radius { w * integral * transfer.at(s).1 } else { 0.0 }
            };
            points.centres().iter().enumerate().map(of).sum::<f64>()
        };
        sorted((0..400).map(ray).filter(|depth| *depth > 0.0).collect())
    }

    #[test]
    fn charges_of_both_signs_diverge() {
        let charges =
            (0..3000_u16).map(|i| if i % 5 == 0 { 2.0 } else { -1.0 } * (0.5 + f32::from(i % 256) / 512.0));
        let points = scattered(3000, 1.0).with_scalars(charges.collect()).unwrap();
        let transfer = transfer(&points, &Kernels::of_points()).unwrap();
        assert!(
            crate::scene::auto::diverges(&transfer) && transfer.at(-0.9).1 > transfer.at(0.0).1,
            "{transfer:?}"
        );
    }

    #[test]
    fn the_densest_tenth_of_lines_has_a_depth_of_five_in_any_unit_and_with_any_weight() {
        let mut first = None;
        for (scale, weight) in [(1.0, 1.0), (1e-9, 1.0), (1e9, 1.0), (1.0, 1e-6)] {
            let points =
                scattered(4000, scale).with_weights(vec![weight; 4000]).unwrap().with_estimated_radius();
            let transfer = transfer(&points, &Kernels::of_points()).unwrap();
            let depth = quantile(&depths(&points, &transfer), 0.9);
            // The rays differ from those of the function, and there is a haze.
            assert!(depth > 4.0 && depth < 7.0, "{scale} {weight}: {depth}");
            let first = *first.get_or_insert(depth);
            assert!((depth - first).abs() < 1e-5 * first, "{scale} {weight}: {depth} instead of {first}");
            // The same with unknown size.
            let unknown = points.clone().with_size(KernelSize::Unknown).unwrap();
            assert_eq!(super::transfer(&unknown, &Kernels::of_points()).unwrap(), transfer);
        }
    }

    #[test]
    fn points_without_scalars_have_one_colour_and_others_a_ramp() {
        let points = scattered(3000, 1.0);
        let plain = Points::new(points.centres().to_vec()).unwrap();
        let one = transfer(&plain, &Kernels::of_points()).unwrap();
        assert_eq!(one.knots().len(), 1);
        assert!((quantile(&depths(&plain.with_estimated_radius(), &one), 0.9) - DEPTH).abs() < 1.0);
        let ramp = transfer(&points, &Kernels::of_points()).unwrap();
        assert!(ramp.knots().len() >= 5 && ramp.at(0.0).1 > 0.0 && ramp.at(1.0).1 > 20.0 * ramp.at(0.0).1);
        let tau: Vec<f64> = ramp.knots().iter().map(|knot| knot.tau).collect();
        assert!(tau.windows(2).all(|pair| pair[0] <= pair[1]), "{tau:?}");
        // One value beside a NaN; two values; nothing visible.
        let with =
            |f: &dyn Fn(usize) -> f32| points.clone().with_scalars((0..3000).map(f).collect()).unwrap();
        let of = |points: &Points| transfer(points, &Kernels::of_points()).unwrap();
        let same = of(&with(&|i| if i == 7 { f32::NAN } else { -4.0 }));
        assert_eq!((same.knots().len(), same.domain()), (1, [-4.0, -4.0]));
        let two = of(&with(&|i| if i % 3 == 0 { 2.0 } else { 1.0 }));
        assert!(two.at(2.0).1 > 5.0 * two.at(1.0).1 && two.at(1.0).1 > 0.0, "{two:?}");
        let outliers = of(&with(&|i| if i == 5 { -1e30 } else { points.scalars().unwrap()[i] }));
        assert!(outliers.domain()[0] > -1.0, "{outliers:?}");
        let none = of(&points.clone().with_weights(vec![0.0; 3000]).unwrap());
        assert!(none.max_tau().is_finite() && none.max_tau() > 0.0);
    }

    #[test]
    fn footprints_of_every_kind_of_size_measure_kernels() {
        let centres = vec![DVec3::new(5.0, -3.0, 2.0)];
        let points = Points::new(centres).unwrap();
        let kernels = Kernels::of_points();
        let middle = |points: &Points, axis: usize| {
            ray_depths(points, &kernels, &flat(), axis).into_iter().fold(0.0, f64::max)
        };
        let peak = (2.0 * std::f64::consts::PI).sqrt();
        let near = |got: f64, want: f64| assert!((got / want - 1.0).abs() < 0.01, "{got} instead of {want}");
        for scale in [1e-6_f32, 1.0, 1e6] {
            let wide = f64::from(scale);
            let radius = points.clone().with_size(KernelSize::Radius(3.0 * wide)).unwrap();
            let radii = points.clone().with_size(KernelSize::Radii(vec![3.0 * scale])).unwrap();
            let square = scale * scale;
            let round = [square, 0.0, 0.0, square, 0.0, square];
            let round = points.clone().with_size(KernelSize::Covariances(vec![round])).unwrap();
            for axis in 0..3 {
                near(middle(&radius, axis), peak * wide);
                near(middle(&radii, axis), peak * wide);
                near(middle(&round, axis), peak * wide);
            }
            // Rotated by 45 degrees about z: squared deviations 25 and 1 along the diagonals.
            let oblique = [13.0, 12.0, 0.0, 13.0, 0.0, 4.0].map(|c: f32| c * square);
            let oblique = points.clone().with_size(KernelSize::Covariances(vec![oblique])).unwrap();
            // The inverse has 13 / 25 along x and y.
            near(middle(&oblique, 0), peak * wide * (25.0_f64 / 13.0).sqrt());
            near(middle(&oblique, 1), peak * wide * (25.0_f64 / 13.0).sqrt());
            near(middle(&oblique, 2), peak * wide * 2.0);
        }
        let flat_one =
            points.clone().with_size(KernelSize::Covariances(vec![[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]]));
        assert_eq!(middle(&flat_one.unwrap(), 0), 0.0);
    }

    #[test]
    fn interpolated_points_are_as_deep_as_what_they_cover() {
        // A lattice of 9³ points at distance 1: kernels of standard deviation 1 cover it and a little more.
        let line = || (0..9).map(f64::from);
        let lattice = line().flat_map(|z| line().flat_map(move |y| line().map(move |x| DVec3::new(x, y, z))));
        let points = Points::new(lattice.collect()).unwrap().with_estimated_radius();
        let kernels = Kernels { model: Model::Interpolate, ..Kernels::of_points() };
        let depth = dense_depth(&points, &kernels, &flat());
        // At the rim one kernel on the ray falls to 0.05 at 2.4, several a little farther out.
        assert!(depth > 8.0 + 2.0 * 2.4 - 0.2 && depth < 8.0 + 2.0 * 3.0, "{depth}");
        // A single kernel falls to 0.05 at 2.448 standard deviations.
        let one = Points::new(vec![DVec3::ZERO]).unwrap().with_size(KernelSize::Radius(3.0)).unwrap();
        let depth = single_depth(&one, &kernels, &flat());
        assert!((depth - 2.0 * 2.4477).abs() < 1e-3, "{depth}");
        // Below the threshold nothing is visible, and the depth has its default.
        let faint = one.with_weights(vec![0.01]).unwrap();
        assert_eq!(dense_depth(&faint, &kernels, &flat()), 1.0);
    }

    #[test]
    fn small_and_large_kernels_are_measured() {
        let points = scattered(300, 1.0);
        // From so small that rays hardly meet them to so large that every ray meets all.
        for radius in [1e-7, 1e-3, 0.5, 40.0] {
            let points = points.clone().with_size(KernelSize::Radius(radius)).unwrap();
            let depth = dense_depth(&points, &Kernels::of_points(), &flat());
            let one = radius / 3.0 * (2.0 * std::f64::consts::PI).sqrt();
            assert!(depth > 0.5 * one && depth < 300.1 * one, "{radius}: {depth} against {one}");
        }
        // A subset keeps the sums: a million kernels, each over most of the box, against a 64th of them.
        let depth = |count: u32| {
            let many = Field::Ramp.points(count).unwrap().with_size(KernelSize::Radius(20.0)).unwrap();
            dense_depth(&many, &Kernels::of_points(), &flat())
        };
        let ratio = depth(1 << 20) / depth(1 << 14);
        assert!((ratio / 64.0 - 1.0).abs() < 0.1, "{ratio}");
    }
}
