//! Real spherical harmonics of degrees 0 to 4, as trained Gaussian splats have them, and their rotation.
//!
//! `Y_lm` for m = -l..l is `(-1)^m N_lm` times `P_l^|m|(z)` without the Condon-Shortley phase, times `cos(mφ)` for
//! m ≥ 0 or `sin(|m|φ)` for m < 0, times `sin^|m|(θ)`. With `N_lm² = (2 - [m = 0]) (2l + 1) / 4π · (l - |m|)! / (l + |m|)!`
//! the functions are orthonormal on the sphere.

use glam::{DMat3, DVec3};

/// The highest degree.
pub const MAX_DEGREE: u32 = 4;

/// Number of functions up to [`MAX_DEGREE`].
pub const MOST: usize = 25;

/// Returns the number of functions up to a degree, which is that of coefficients for each colour channel.
#[must_use]
pub const fn count(degree: u32) -> usize {
    let side = degree as usize + 1;
    side * side
}

/// `1 / √4π`.
pub const C0: f64 = 0.282_094_791_773_878_14;
/// `√(3 / 4π)`.
const C1: f64 = 0.488_602_511_902_919_9;
/// For xy, yz, xz: `√(15 / 4π)`.
const A: f64 = 1.092_548_430_592_079_2;
/// For 2z² - x² - y²: `√(5 / 16π)`.
const B: f64 = 0.315_391_565_252_520_05;
/// For m = ±3: `√(35 / 32π)`.
const E: f64 = 0.590_043_589_926_643_5;
/// For xyz: `√(105 / 4π)`.
const F: f64 = 2.890_611_442_640_554;
/// For m = ±1: `√(21 / 32π)`.
const G: f64 = 0.457_045_799_464_465_8;
/// For m = 0: `√(7 / 16π)`.
const H: f64 = 0.373_176_332_590_115_4;
// Degree 4: the derivatives of P4 = (35z⁴ - 30z² + 3) / 8 are 5z (7z² - 3) / 2, 15 (7z² - 1) / 2, 105z and 105. With N_4m:
// m = 0: √(9 / 4π) / 8; 1: √(9 / 40π) · 5/2; 2: √(1 / 80π) · 15/2; 3: √(1 / 1120π) · 105; 4: √(1 / 8960π) · 105.
/// For m = 0: `3 / (16 √π)`.
const J0: f64 = 0.105_785_546_915_204_31;
/// For m = ±1: `√(45 / 32π)`.
const J1: f64 = 0.669_046_543_557_289_2;
/// For m = ±2: `√(45 / 64π)`.
const J2: f64 = 0.473_087_347_878_780_04;
/// For m = ±3: `√(315 / 32π)`.
const J3: f64 = 1.770_130_769_779_930_5;
/// For m = ±4: `√(315 / 256π)`.
const J4: f64 = 0.625_835_735_449_176_1;

/// Returns the functions up to a degree at a unit direction, in ascending order of l, then m; 0 beyond that degree.
#[must_use]
pub fn basis(degree: u32, direction: DVec3) -> [f64; MOST] {
    let [x, y, z] = direction.to_array();
    let [xx, yy, zz] = [x * x, y * y, z * z];
    let mut all = [0.0; MOST];
    all[0] = C0;
    if degree >= 1 {
        all[1..4].copy_from_slice(&[-C1 * y, C1 * z, -C1 * x]);
    }
    if degree >= 2 {
        let band = [A * x * y, -A * y * z, B * (2.0 * zz - xx - yy), -A * x * z, 0.5 * A * (xx - yy)];
        all[4..9].copy_from_slice(&band);
    }
    if degree >= 3 {
        all[9..16].copy_from_slice(&[
            -E * y * (3.0 * xx - yy),
            F * x * y * z,
            -G * y * (4.0 * zz - xx - yy),
            H * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
            -G * x * (4.0 * zz - xx - yy),
            0.5 * F * z * (xx - yy),
            -E * x * (xx - 3.0 * yy),
        ]);
    }
    if degree >= 4 {
        all[16..25].copy_from_slice(&[
            4.0 * J4 * x * y * (xx - yy),
            -J3 * y * z * (3.0 * xx - yy),
            2.0 * J2 * x * y * (7.0 * zz - 1.0),
            -J1 * y * z * (7.0 * zz - 3.0),
            J0 * (zz * (35.0 * zz - 30.0) + 3.0),
            -J1 * x * z * (7.0 * zz - 3.0),
            J2 * (xx - yy) * (7.0 * zz - 1.0),
            -J3 * x * z * (xx - 3.0 * yy),
            J4 * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy)),
        ]);
    }
    all
}

/// The linear map of coefficients that turns a function on the sphere.
///
/// `f'(d) = f(Rᵀ d)`. The matrix of a band is `∫ Y_i(d) Y_j(Rᵀ d)`, which a product of Gauss-Legendre and equally spaced nodes
/// integrates exactly: the integrand is a polynomial of degree at most 8.
#[derive(Clone, Debug)]
pub struct Rotation {
    /// Rows of the matrices of all bands; a row has the width of its band.
    rows: Vec<Vec<f64>>,
}

impl Rotation {
    /// Makes the map of an orthogonal matrix: a rotation, or a reflection.
    #[must_use]
    pub fn new(matrix: DMat3) -> Self {
        let mut full = [[0.0; MOST]; MOST];
        for (direction, weight) in nodes() {
            let from = basis(MAX_DEGREE, matrix.transpose() * direction);
            for (row, to) in full.iter_mut().zip(basis(MAX_DEGREE, direction)) {
                for (sum, from) in row.iter_mut().zip(from) {
                    *sum += weight * to * from;
                }
            }
        }
        let bands = (0..=MAX_DEGREE).map(|l| if l == 0 { 0..1 } else { count(l - 1)..count(l) });
        // What is rounding alone would make zeros of the coefficients other numbers.
        let clean = |value: &f64| if value.abs() < 1e-14 { 0.0 } else { *value };
        let rows = bands.flat_map(|band| {
            full[band.clone()].iter().map(move |row| row[band.clone()].iter().map(clean).collect())
        });
        Self { rows: rows.collect() }
    }

    /// Turns coefficients, as many as a degree has, in place.
    pub fn apply(&self, coefficients: &mut [f64]) {
        let mut start = 0;
        while start < coefficients.len() {
            let width = self.rows.get(start).map_or(0, Vec::len);
            let Some(old) = coefficients.get(start..start + width).filter(|band| !band.is_empty()) else {
                return;
            };
            let old = old.to_vec();
            for i in 0..width {
                coefficients[start + i] = self.rows[start + i].iter().zip(&old).map(|(m, k)| m * k).sum();
            }
            start += width;
        }
    }
}

/// Returns nodes and weights that integrate polynomials of degree up to 8 over the sphere.
fn nodes() -> impl Iterator<Item = (DVec3, f64)> {
    const RING: u32 = 9;
    let (root, outer) = (2.0 * (10.0_f64 / 7.0).sqrt(), 13.0 * 70.0_f64.sqrt());
    let [near, far] = [5.0 - root, 5.0 + root].map(|square| square.sqrt() / 3.0);
    let [heavy, light] = [322.0 + outer, 322.0 - outer].map(|weight| weight / 900.0);
    let heights = [(0.0, 128.0 / 225.0), (near, heavy), (-near, heavy), (far, light), (-far, light)];
    heights.into_iter().flat_map(|(z, weight)| {
        (0..RING).map(move |i| {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(RING);
            let radius = (1.0 - z * z).sqrt();
            let share = std::f64::consts::TAU / f64::from(RING);
            (DVec3::new(radius * angle.cos(), radius * angle.sin(), z), weight * share)
        })
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn rotation() -> DMat3 {
        DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.1)
    }

    fn coefficients() -> [f64; MOST] {
        std::array::from_fn(|i| ((i * 37 % 23) as f64 - 11.0) / 7.0)
    }

    fn value(coefficients: &[f64], direction: DVec3) -> f64 {
        basis(MAX_DEGREE, direction).iter().zip(coefficients).map(|(y, k)| y * k).sum()
    }

    fn directions() -> impl Iterator<Item = DVec3> {
        (0..40).map(|i| {
            let t = f64::from(i);
            DVec3::new((1.7 * t).sin(), (2.9 * t + 1.0).cos(), (0.6 * t - 2.0).sin()).normalize()
        })
    }

    #[test]
    fn constants_are_those_of_their_derivation() {
        for (constant, square) in [
            (C0, 1.0 / 4.0),
            (C1, 3.0 / 4.0),
            (A, 15.0 / 4.0),
            (B, 5.0 / 16.0),
            (E, 35.0 / 32.0),
            (F, 105.0 / 4.0),
            (G, 21.0 / 32.0),
            (H, 7.0 / 16.0),
            (J0, 9.0 / 256.0),
            (J1, 45.0 / 32.0),
            (J2, 45.0 / 64.0),
            (J3, 315.0 / 32.0),
            (J4, 315.0 / 256.0),
        ] {
            assert!((constant - (square / PI).sqrt()).abs() < 4e-16, "{constant}");
        }
    }

    #[test]
    fn functions_are_orthonormal() {
        let mut products = [[0.0; MOST]; MOST];
        for (direction, weight) in nodes() {
            let all = basis(MAX_DEGREE, direction);
            for (i, row) in products.iter_mut().enumerate() {
                for (j, product) in row.iter_mut().enumerate() {
                    *product += weight * all[i] * all[j];
                }
            }
        }
        for (i, row) in products.iter().enumerate() {
            for (j, product) in row.iter().enumerate() {
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-14, "{i} {j}: {product}");
            }
        }
        // A rule of its own: the midpoints of many equal shares of the sphere.
        let (rings, sides) = (400, 16);
        let mut squares = [0.0; MOST];
        for i in 0..rings {
            let z = (f64::from(i) + 0.5) / f64::from(rings) * 2.0 - 1.0;
            for j in 0..sides {
                let angle = 2.0 * PI * f64::from(j) / f64::from(sides);
                let radius = (1.0 - z * z).sqrt();
                let all = basis(MAX_DEGREE, DVec3::new(radius * angle.cos(), radius * angle.sin(), z));
                for (sum, y) in squares.iter_mut().zip(all) {
                    *sum += y * y * 4.0 * PI / f64::from(rings * sides);
                }
            }
        }
        assert!(squares.iter().all(|square| (square - 1.0).abs() < 1e-3), "{squares:?}");
    }

    #[test]
    fn a_degree_has_its_functions_only() {
        let all = basis(MAX_DEGREE, DVec3::new(0.36, 0.48, 0.8));
        for degree in 0..=MAX_DEGREE {
            let some = basis(degree, DVec3::new(0.36, 0.48, 0.8));
            assert_eq!(some[..count(degree)], all[..count(degree)]);
            assert!(some[count(degree)..].iter().all(|y| *y == 0.0));
        }
    }

    #[test]
    fn turned_coefficients_are_those_of_the_turned_function() {
        for matrix in [rotation(), DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), DMat3::IDENTITY] {
            let mut turned = coefficients();
            Rotation::new(matrix).apply(&mut turned);
            for direction in directions() {
                let expected = value(&coefficients(), matrix.transpose() * direction);
                assert!((value(&turned, direction) - expected).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn a_rotation_keeps_the_power_of_each_band() {
        let mut turned = coefficients();
        Rotation::new(rotation()).apply(&mut turned);
        let power =
            |k: &[f64; MOST], band: std::ops::Range<usize>| k[band].iter().map(|k| k * k).sum::<f64>();
        for band in [0..1, 1..4, 4..9, 9..16, 16..25] {
            let [old, new] = [&coefficients(), &turned].map(|k| power(k, band.clone()));
            assert!((old - new).abs() < 1e-12 * old, "{band:?}: {old} {new}");
        }
        assert_ne!(turned, coefficients());
    }

    #[test]
    fn half_turns_are_signs() {
        let signs = |matrix: DVec3| {
            let mut all = [1.0; MOST];
            Rotation::new(DMat3::from_diagonal(matrix)).apply(&mut all);
            all
        };
        let [x, y, z] = [-1.0, -1.0, 1.0];
        let expected = [1.0, y, z, x, x * y, y * z, 1.0, x * z, 1.0, y, x * y * z, y, z, x, z, x];
        for (found, expected) in signs(DVec3::new(x, y, z)).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
        // Fewer coefficients than the highest degree has.
        let mut few = [1.0, 2.0, 3.0, 4.0];
        Rotation::new(DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0))).apply(&mut few);
        assert!(few.iter().zip([1.0, -2.0, -3.0, 4.0]).all(|(a, b): (&f64, f64)| (a - b).abs() < 1e-14));
    }
}
