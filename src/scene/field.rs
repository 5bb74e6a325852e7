//! Analytic fields: test signals whose values are known everywhere.

use glam::DVec3;

use super::grid::{Grid, Samples};
use crate::error::{Error, Result};
use crate::num;

/// A scalar field over the cube [-1, 1]³, with values in [0, 1] there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Field {
    /// Marschner and Lobb's test signal (IEEE Visualization 1994) with f = 6, a = 1/4.
    MarschnerLobb,
    /// Twelve Gaussians, clamped to 1.
    Blobs,
    /// One value everywhere.
    Homogeneous(f64),
    /// Affine: `(1 + x) / 2 * 0.6 + (1 + y) / 2 * 0.3 + (1 + z) / 2 * 0.1`. Trilinear reconstruction
    /// is exact, and no two axes or directions look alike.
    Ramp,
    /// 1 inside the sphere of radius 0.7, 0 outside, blurred linearly over a shell of width 0.1.
    Sphere,
}

/// Centre, radius and amplitude of the twelve Gaussians of [`Field::Blobs`].
const BLOBS: [[f64; 5]; 12] = [
    [-0.45, -0.30, 0.40, 0.26, 0.90],
    [0.50, 0.35, 0.45, 0.22, 0.75],
    [0.10, -0.55, -0.35, 0.30, 0.80],
    [-0.55, 0.50, -0.40, 0.20, 1.0],
    [0.60, -0.45, 0.15, 0.16, 0.70],
    [-0.05, 0.20, 0.0, 0.34, 0.55],
    [0.45, 0.60, -0.55, 0.18, 0.85],
    [-0.70, -0.70, -0.65, 0.15, 0.95],
    [-0.20, 0.75, 0.65, 0.13, 0.80],
    [0.80, 0.05, -0.20, 0.12, 0.90],
    [0.25, -0.10, 0.80, 0.14, 0.65],
    [-0.80, 0.05, 0.05, 0.17, 0.60],
];

impl Field {
    /// The names that scene files use.
    pub const NAMES: [&'static str; 5] = ["marschner-lobb", "blobs", "homogeneous", "ramp", "sphere"];

    /// The field of a name. `homogeneous` has the value 1.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the allowed names.
    pub fn from_name(name: &str) -> Result<Self> {
        Ok(match name {
            "marschner-lobb" => Self::MarschnerLobb,
            "blobs" => Self::Blobs,
            "homogeneous" => Self::Homogeneous(1.0),
            "ramp" => Self::Ramp,
            "sphere" => Self::Sphere,
            _ => {
                return Err(Error::invalid(
                    "field",
                    format!("\"{name}\": must be one of {}", Self::NAMES.join(", ")),
                ));
            }
        })
    }

    /// The field's value.
    #[must_use]
    pub fn value(self, p: DVec3) -> f64 {
        use std::f64::consts::PI;
        match self {
            Self::MarschnerLobb => {
                let (f, a) = (6.0, 0.25);
                let r = (p.x * p.x + p.y * p.y).sqrt();
                let rho = (2.0 * PI * f * (PI * r / 2.0).cos()).cos();
                (1.0 - (PI * p.z / 2.0).sin() + a * (1.0 + rho)) / (2.0 * (1.0 + a))
            }
            Self::Blobs => {
                let sum: f64 = BLOBS
                    .iter()
                    .map(|&[x, y, z, r, a]| {
                        a * (-(p - DVec3::new(x, y, z)).length_squared() / (2.0 * r * r)).exp()
                    })
                    .sum();
                sum.clamp(0.0, 1.0)
            }
            Self::Homogeneous(value) => value,
            Self::Ramp => 0.3 * (1.0 + p.x) + 0.15 * (1.0 + p.y) + 0.05 * (1.0 + p.z),
            Self::Sphere => ((0.75 - p.length()) / 0.1).clamp(0.0, 1.0),
        }
    }

    /// The field sampled on a grid that fills [-1, 1]³, samples at `-1 + 2 i / (n - 1)`.
    ///
    /// `type_name` is one of `u8`, `u16`, `i16`, `f32`; integers hold the value times 255, 65535 and
    /// 32767, rounded, and the transfer function must expect those numbers.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for another type, or an extent that [`Grid::new`] refuses.
    pub fn sample(self, dims: [u32; 3], type_name: &str) -> Result<Grid> {
        if let Some(extent) = dims.iter().find(|&&extent| extent < 2) {
            return Err(Error::invalid(
                "grid extent",
                format!("{dims:?} has {extent}: every extent must be at least 2 samples"),
            ));
        }
        let step = DVec3::from_array(dims.map(|n| 2.0 / f64::from(n - 1)));
        let mut values = Vec::new();
        let total = dims.iter().try_fold(1_usize, |n, &extent| n.checked_mul(num::index(extent)));
        let total = total.filter(|&n| n <= 1 << 33).ok_or_else(|| {
            Error::invalid("grid extent", format!("{dims:?}: an analytic field has at most 2^33 samples"))
        })?;
        values.reserve_exact(total);
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    let index = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                    values.push(self.value(DVec3::NEG_ONE + index * step));
                }
            }
        }
        let samples = match type_name {
            "u8" => Samples::U8(values.iter().map(|v| num::u8_code(v * 255.0)).collect()),
            "u16" => Samples::U16(values.iter().map(|v| num::u16_code(v * 65535.0)).collect()),
            "i16" => Samples::I16(values.iter().map(|v| num::i16_code(v * 32767.0)).collect()),
            "f32" => Samples::F32(values.iter().map(|&v| num::f32_of(v)).collect()),
            _ => {
                return Err(Error::invalid(
                    "field type",
                    format!("\"{type_name}\": must be one of u8, u16, i16, f32"),
                ));
            }
        };
        Grid::new(dims, samples)?.with_placement(step, DVec3::NEG_ONE, glam::DMat3::IDENTITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_fill_the_cube_and_stay_in_range() {
        for name in Field::NAMES {
            let grid = Field::from_name(name).unwrap().sample([9, 7, 8], "f32").unwrap();
            assert!((grid.corners()[0] - DVec3::NEG_ONE).length() < 1e-15);
            assert!((grid.corners()[7] - DVec3::ONE).length() < 1e-15);
            let [lo, hi] = grid.range();
            assert!(lo >= 0.0 && hi <= 1.0, "{name}: [{lo}, {hi}]");
        }
    }

    #[test]
    fn marschner_lobb_has_its_known_values() {
        // At the origin rho_r(0) = cos(12 pi) = 1, so the value is (1 + 0.5) / 2.5.
        assert!((Field::MarschnerLobb.value(DVec3::ZERO) - 0.6).abs() < 1e-12);
        // At z = 1 and r = 1 rho_r = cos(0) = 1 and the sine is 1: 0.5 / 2.5.
        assert!((Field::MarschnerLobb.value(DVec3::new(1.0, 0.0, 1.0)) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn integer_types_hold_scaled_values() {
        let grid = Field::Homogeneous(1.0).sample([2, 2, 2], "u16").unwrap();
        assert_eq!(grid.range(), [65535.0, 65535.0]);
        assert!(Field::Ramp.sample([2, 2, 2], "u64").unwrap_err().to_string().contains("u8, u16"));
    }
}
