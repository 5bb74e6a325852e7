//! The prefilter of interpolating cubic B-splines.

use rayon::prelude::*;

/// Replaces samples, x fastest, by the coefficients of an interpolating sum of cubic B-splines.
///
/// The sum of the splines times the coefficients, divided by the sum of the splines, passes through the
/// samples. Along each axis the rows of the system are (1, 4, 1) / 6. The first and the last row lack the
/// outer neighbour and are normalised to (4, 1) / 5. An axis with one sample is unchanged, and constants are
/// preserved. A NaN spreads to all values, because no such field exists.
///
/// Runs in parallel and in place; the length of `values` is the product of `dims`.
pub(crate) fn prefilter(values: &mut [f64], dims: [usize; 3]) {
    let [nx, ny, nz] = dims;
    if values.is_empty() {
        return;
    }
    let system = System::new(nx);
    values.par_chunks_mut(nx).for_each(|line| {
        for i in 1..=nx {
            let before = if i > 1 { line[i - 2] } else { 0.0 };
            line[i - 1] = system.down(i - 1, line[i - 1], before);
        }
        for i in (1..nx).rev() {
            line[i - 1] -= system.ratios[i - 1] * line[i];
        }
    });
    // Along y the unknowns are whole rows, along z whole planes.
    let system = System::new(ny);
    values.par_chunks_mut(nx * ny).for_each(|plane| {
        system.solve(plane, nx, |row, other, f| {
            for (a, b) in row.iter_mut().zip(other) {
                *a = f(*a, *b);
            }
        })
    });
    let system = System::new(nz);
    system.solve(values, nx * ny, |plane, other, f| {
        plane.par_iter_mut().zip(other).with_min_len(4096).for_each(|(a, b)| *a = f(*a, *b));
    });
}

/// The elimination of a tridiagonal system with ones beside its diagonal: rows are scaled by 6, the first and
/// the last by 5.
struct System {
    /// Reciprocals of the pivots; the diagonal is 4.
    ratios: Vec<f64>,
}

impl System {
    fn new(n: usize) -> Self {
        let mut ratios = Vec::with_capacity(n);
        let mut before = 0.0;
        for _ in 0..n {
            before = 1.0 / (4.0 - before);
            ratios.push(before);
        }
        Self { ratios }
    }

    /// Returns a row of the forward elimination, from its right-hand side and the row before.
    fn down(&self, i: usize, value: f64, before: f64) -> f64 {
        let n = self.ratios.len();
        if n == 1 {
            return value;
        }
        let whole = if i == 0 || i == n - 1 { 5.0 } else { 6.0 };
        (whole * value - before) * self.ratios[i]
    }

    /// Solves the system for chunks of values. `each` replaces the values of the first chunk by a function of
    /// both.
    fn solve(
        &self,
        values: &mut [f64],
        chunk: usize,
        each: impl Fn(&mut [f64], &[f64], &(dyn Fn(f64, f64) -> f64 + Sync)),
    ) {
        let n = self.ratios.len();
        let zeros = vec![0.0; chunk];
        for i in 0..n {
            let (done, rest) = values.split_at_mut(i * chunk);
            let before = if i > 0 { &done[(i - 1) * chunk..] } else { &zeros };
            each(&mut rest[..chunk], before, &|value, before| self.down(i, value, before));
        }
        for i in (0..n - 1).rev() {
            let (now, after) = values.split_at_mut((i + 1) * chunk);
            let ratio = self.ratios[i];
            each(&mut now[i * chunk..], &after[..chunk], &|value, after| value - ratio * after);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::footprint::cubic;
    use super::*;
    use crate::num;

    fn check(dims: [usize; 3], seed: u64) -> f64 {
        let mut state = seed;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            num::f64_of_u64(state >> 33) / 2_147_483_648.0
        };
        let count = dims.iter().product();
        let samples: Vec<f64> = (0..count).map(|_| random()).collect();
        let mut c = samples.clone();
        prefilter(&mut c, dims);
        let near = |i: usize, n: usize| i.saturating_sub(1)..=(i + 1).min(n - 1);
        let mut worst = 0.0_f64;
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    let (mut sum, mut weight) = (0.0, 0.0);
                    for k in near(z, dims[2]) {
                        for j in near(y, dims[1]) {
                            for i in near(x, dims[0]) {
                                let w = [(x, i), (y, j), (z, k)]
                                    .map(|(a, b)| cubic(num::f64_of(a) - num::f64_of(b)))
                                    .iter()
                                    .product::<f64>();
                                sum += w * c[i + dims[0] * (j + dims[1] * k)];
                                weight += w;
                            }
                        }
                    }
                    let wanted = samples[x + dims[0] * (y + dims[1] * z)];
                    worst = worst.max((sum / weight - wanted).abs());
                }
            }
        }
        worst
    }

    #[test]
    fn normalised_sums_go_through_the_samples() {
        for (dims, seed) in
            [([9, 6, 7], 1), ([2, 2, 2], 2), ([1, 3, 2], 3), ([33, 2, 1], 4), ([3, 40, 70], 5)]
        {
            let worst = check(dims, seed);
            println!("{dims:?}: {worst:e}");
            assert!(worst < 1e-12, "{dims:?}: {worst:e}");
        }
        prefilter(&mut [], [0, 4, 4]);
    }

    #[test]
    fn constants_stay() {
        let mut values = vec![0.7; 11 * 5 * 80];
        prefilter(&mut values, [11, 5, 80]);
        assert!(values.iter().all(|v| (v - 0.7).abs() < 2e-15));
    }
}
