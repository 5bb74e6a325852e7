//! Mip levels of a volume or an image, filtered exactly.

use crate::num::{f64_of, index};

/// Returns the levels of a mip chain, Vulkan's `mipLevels`: the first one included, and down to one texel along every
/// axis of `along`.
pub(crate) fn levels(dims: [u32; 3], along: [bool; 3]) -> u32 {
    let largest = dims.into_iter().zip(along).filter(|(_, along)| *along).map(|(n, _)| n).max();
    largest.unwrap_or(1).max(1).ilog2() + 1
}

/// Computes the next smaller level with a box filter.
///
/// Weights are exact overlaps of texels, so that any size keeps its alignment in normalised coordinates.
///
/// Axes of `along` take the extent of Vulkan's mip chain, `max(1, n / 2)`; the others stay. Values lie
/// x fastest. A NaN makes every texel that covers it NaN.
pub(crate) fn halve(values: &[f32], dims: [u32; 3], along: [bool; 3]) -> (Vec<f32>, [u32; 3]) {
    let mut small = dims;
    // Sums stay in float64 from axis to axis, so that values are rounded once.
    let mut sums: Option<Vec<f64>> = None;
    // x comes last: along the other axes the inner loop runs over neighbours in memory.
    for axis in [2, 1, 0] {
        let from = index(dims[axis]);
        if along[axis] && from > 1 {
            small[axis] = dims[axis] / 2;
            let to = index(small[axis]);
            let stride = dims[..axis].iter().map(|&n| index(n)).product();
            sums = Some(match sums {
                None => shrink(values, stride, from, to),
                Some(sums) => shrink(&sums, stride, from, to),
            });
        }
    }
    let values = match sums {
        None => values.to_vec(),
        Some(sums) => sums.into_iter().map(crate::num::f32_of).collect(),
    };
    (values, small)
}

/// Filters one axis of `from` texels, `stride` apart, to `to` texels.
fn shrink<T: Copy + Into<f64>>(values: &[T], stride: usize, from: usize, to: usize) -> Vec<f64> {
    let taps: Vec<_> = (0..to).map(|place| taps(place, from, to)).collect();
    let mut sums = Vec::with_capacity(values.len() / from * to);
    for block in values.chunks_exact(stride * from) {
        for taps in &taps {
            let start = sums.len();
            sums.resize(start + stride, 0.0);
            for &(texel, weight) in taps {
                let row = &block[texel * stride..(texel + 1) * stride];
                for (sum, &value) in sums[start..].iter_mut().zip(row) {
                    *sum += weight * value.into();
                }
            }
        }
    }
    sums
}

/// Returns the texels that one smaller texel covers, each with its share of the smaller one.
fn taps(place: usize, from: usize, to: usize) -> Vec<(usize, f64)> {
    // The axis is `from * to` units long, so that every boundary is an integer.
    let (start, end) = (place * from, (place + 1) * from);
    (start / to..end.div_ceil(to))
        .map(|texel| {
            let overlap = end.min((texel + 1) * to) - start.max(texel * to);
            (texel, f64_of(overlap) / f64_of(from))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::{count, f32_of};

    const ALL: [bool; 3] = [true; 3];

    fn volume(dims: [u32; 3], value: impl Fn([u32; 3]) -> f32) -> Vec<f32> {
        let mut values = Vec::new();
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                values.extend((0..dims[0]).map(|x| value([x, y, z])));
            }
        }
        values
    }

    fn mean(values: &[f32]) -> f64 {
        values.iter().map(|&v| f64::from(v)).sum::<f64>() / f64_of(values.len())
    }

    #[test]
    fn extents_are_those_of_vulkan_s_chain() {
        let chain = |dims: [u32; 3], along: [bool; 3]| {
            let mut level = (vec![0.0; dims.iter().map(|&n| index(n)).product()], dims);
            let mut chain = vec![dims];
            for _ in 1..levels(dims, along) {
                level = halve(&level.0, level.1, along);
                assert_eq!(level.0.len(), level.1.iter().map(|&n| index(n)).product::<usize>());
                chain.push(level.1);
            }
            chain
        };
        assert_eq!(chain([7, 5, 1], ALL), [[7, 5, 1], [3, 2, 1], [1, 1, 1]]);
        assert_eq!(chain([8, 3, 2], ALL), [[8, 3, 2], [4, 1, 1], [2, 1, 1], [1, 1, 1]]);
        assert_eq!(chain([8, 3, 2], [false, true, true]), [[8, 3, 2], [8, 1, 1]]);
        assert_eq!(chain([8, 3, 2], [false; 3]), [[8, 3, 2]]);
        assert_eq!(levels([1; 3], ALL), 1);
        assert_eq!(levels([256, 255, 1], ALL), 9);
        // Axes that are not halved keep their texels.
        let (values, dims) = halve(&[1.0, 2.0, 3.0, 5.0, 7.0, 9.0], [3, 2, 1], [false, true, false]);
        assert_eq!((values, dims), (vec![3.0, 4.5, 6.0], [3, 1, 1]));
        assert_eq!(halve(&[1.0, 2.0], [2, 1, 1], [false; 3]), (vec![1.0, 2.0], [2, 1, 1]));
    }

    #[test]
    fn weights_are_overlaps() {
        // The first of two texels covers 0, 1 and half of 2 of five texels.
        assert_eq!(taps(0, 5, 2), [(0, 0.4), (1, 0.4), (2, 0.2)]);
        assert_eq!(taps(1, 5, 2), [(2, 0.2), (3, 0.4), (4, 0.4)]);
        assert_eq!(taps(1, 4, 2), [(2, 0.5), (3, 0.5)]);
        assert_eq!(halve(&[3.0, 6.0, 12.0], [3, 1, 1], ALL).0, [7.0]);
        assert_eq!(halve(&[5.0, 0.0, 10.0, 0.0, 5.0], [1, 5, 1], ALL).0, [4.0, 4.0]);
        for from in 2..40 {
            let to = from / 2;
            let mut covered = vec![0.0; from];
            for place in 0..to {
                let taps = taps(place, from, to);
                assert!(taps.len() <= 4 && taps.iter().all(|tap| tap.1 > 0.0));
                taps.iter().for_each(|&(texel, weight)| covered[texel] += weight);
            }
            let share = f64_of(to) / f64_of(from);
            assert!(covered.iter().all(|c| (c - share).abs() < 1e-15), "{from}: {covered:?}");
        }
    }

    #[test]
    fn the_mean_is_kept() {
        let value = |p: [u32; 3]| f32_of(f64::from((p[0] * 7 + p[1] * 13 + p[2] * 29) % 32));
        for dims in [[2, 2, 2], [8, 4, 16], [6, 2, 1], [16, 1, 8]] {
            let values = volume(dims, value);
            assert_eq!(mean(&halve(&values, dims, ALL).0), mean(&values), "{dims:?}");
        }
        for dims in [[3, 5, 7], [7, 1, 3], [5, 4, 31], [1, 1, 1], [13, 6, 9]] {
            let values = volume(dims, value);
            let (small, want) = (mean(&halve(&values, dims, ALL).0), mean(&values));
            assert!((small - want).abs() <= 1e-6 * want.abs(), "{dims:?}: {small}, not {want}");
        }
    }

    #[test]
    fn a_ramp_stays_where_it_was() {
        for axis in 0..3 {
            let place = |n: u32, i: u32| (f64::from(i) + 0.5) / f64::from(n);
            let mut dims = [4, 2, 6];
            dims[axis] = 12;
            let (small, half) = halve(&volume(dims, |p| f32_of(place(dims[axis], p[axis]))), dims, ALL);
            let want = volume(half, |p| f32_of(place(half[axis], p[axis])));
            assert!(small.iter().zip(&want).all(|(a, b)| (a - b).abs() < 1e-7), "axis {axis}: {small:?}");
            // The middle texel of three made of seven stays in the middle.
            dims[axis] = 7;
            let (small, half) = halve(&volume(dims, |p| f32_of(place(dims[axis], p[axis]))), dims, ALL);
            let centre = mean_at(&small, half, axis, half[axis] / 2);
            assert!((centre - 0.5).abs() < 1e-6, "axis {axis}: {small:?}");
        }
    }

    /// Returns the mean of the values whose index along an axis is `at`.
    fn mean_at(values: &[f32], dims: [u32; 3], axis: usize, at: u32) -> f64 {
        let there = volume(dims, |p| if p[axis] == at { 1.0 } else { 0.0 });
        let sum: f64 = values.iter().zip(&there).map(|(&v, &w)| f64::from(v * w)).sum();
        sum / there.iter().map(|&w| f64::from(w)).sum::<f64>()
    }

    #[test]
    fn a_checkerboard_becomes_grey() {
        for dims in [[8, 8, 8], [4, 6, 1], [2, 1, 1]] {
            let values = volume(dims, |p| f32_of(f64::from((p[0] + p[1] + p[2]) % 2)));
            let (small, half) = halve(&values, dims, ALL);
            assert!(small.iter().all(|&v| v == 0.5));
            assert_eq!(count(small.len()), half.iter().product::<u32>());
        }
    }
}
