//! Analytic fields: test signals with known values everywhere.

use glam::DVec3;

use super::gaussians::{GaussianParts, Gaussians};
use super::grid::Grid;
use super::kernel::named;
use super::points::Points;
use super::samples::{Samples, sample_count};
use super::tets::{TetScalars, Tets};
use crate::error::{Error, Result};
use crate::num;

/// An analytic scalar field on the cube [-1, 1]³, with values in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Field {
    /// Marschner and Lobb's test signal (IEEE Visualization 1994) with f = 6, a = 1/4.
    MarschnerLobb,
    /// Twelve Gaussians, clamped to 1.
    Blobs,
    /// The same value everywhere.
    Homogeneous(f64),
    /// Affine: `(1 + x) / 2 * 0.6 + (1 + y) / 2 * 0.3 + (1 + z) / 2 * 0.1`. Trilinear reconstruction is
    /// exact, and no two axes or directions look alike.
    Ramp,
    /// 1 inside the sphere of radius 0.7, 0 outside, with a linear transition over a shell of width 0.1.
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
    /// The names in scene files.
    pub const NAMES: [&'static str; 5] = ["marschner-lobb", "blobs", "homogeneous", "ramp", "sphere"];

    /// The names of the types that it is sampled in.
    pub const TYPES: [&'static str; 4] = ["u8", "u16", "i16", "f32"];

    /// Returns the field of a name. `homogeneous` has the value 1.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the allowed names.
    pub fn from_name(name: &str) -> Result<Self> {
        let fields = [Self::MarschnerLobb, Self::Blobs, Self::Homogeneous(1.0), Self::Ramp, Self::Sphere];
        named("field", name, &Self::NAMES.into_iter().zip(fields).collect::<Vec<_>>())
    }

    /// Returns the field's value at a position.
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

    /// Samples the field on a grid that fills [-1, 1]³, at `-1 + 2 i / (n - 1)`.
    ///
    /// `type_name` is one of [`Self::TYPES`]. Integers hold the value times 255, 65535 and 32767,
    /// rounded; the transfer function must be defined on those numbers.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for another type, or an extent that [`Grid::new`] refuses.
    pub fn sample(self, dims: [u32; 3], type_name: &str) -> Result<Grid> {
        let total = sample_count(dims)?.filter(|&n| n <= 1 << 33).ok_or_else(|| {
            Error::invalid("grid extent", format!("{dims:?}: an analytic field has at most 2^33 samples"))
        })?;
        let step = DVec3::from_array(dims.map(|n| 2.0 / f64::from(n - 1)));
        let mut values = Vec::with_capacity(total);
        let value =
            |index: [u32; 3]| self.value(DVec3::NEG_ONE + DVec3::from_array(index.map(f64::from)) * step);
        values.extend(indices(dims).map(value));
        let samples = match type_name {
            "u8" => Samples::U8(values.iter().map(|v| num::u8_code(v * 255.0)).collect()),
            "u16" => Samples::U16(values.iter().map(|v| num::u16_code(v * 65535.0)).collect()),
            "i16" => Samples::I16(values.iter().map(|v| num::i16_code(v * 32767.0)).collect()),
            "f32" => Samples::F32(values.iter().map(|&v| num::f32_of(v)).collect()),
            _ => {
                let why = format!("\"{type_name}\": must be one of {}", Self::TYPES.join(", "));
                return Err(Error::invalid("field type", why));
            }
        };
        Grid::new(dims, samples)?.with_placement(step, DVec3::NEG_ONE, glam::DMat3::IDENTITY)
    }

    /// Largest number of cubes along each side for [`Self::tets`]: 32 bits count five tetrahedra for each
    /// cube.
    pub const MAX_CUBES: u32 = 950;

    /// Samples the field on a mesh that fills [-1, 1]³ with `cubes`³ equal cubes of five tetrahedra each.
    ///
    /// The scalars are the field's values in float32 at the `(cubes + 1)³` corners, x fastest. One
    /// tetrahedron joins every other corner of its cube, four cut off the remaining corners. The choice of
    /// corners alternates from cube to cube, so the diagonals of shared faces match.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if `cubes` is 0 or above [`Self::MAX_CUBES`], or the mesh does not fit into memory.
    pub fn tets(self, cubes: u32) -> Result<Tets> {
        let refuse = |why: &str| Error::invalid("cubes", format!("{cubes}: {why}"));
        if cubes == 0 || cubes > Self::MAX_CUBES {
            return Err(refuse(&format!("must be 1 to {}", Self::MAX_CUBES)));
        }
        let side = num::index(cubes) + 1;
        let (mut points, mut scalars, mut cells) = (Vec::new(), Vec::new(), Vec::new());
        points
            .try_reserve_exact(side.pow(3))
            .and_then(|()| scalars.try_reserve_exact(side.pow(3)))
            .and_then(|()| cells.try_reserve_exact(5 * (side - 1).pow(3)))
            .map_err(|_| refuse("the mesh does not fit into memory"))?;
        for index in indices([cubes + 1; 3]) {
            let p = DVec3::from_array(index.map(|i| 2.0 * f64::from(i) / f64::from(cubes) - 1.0));
            points.push(p);
            scalars.push(num::f32_of(self.value(p)));
        }
        for [x, y, z] in indices([cubes; 3]) {
            let corner = |bits: u32| {
                let [x, y, z] = [x + (bits & 1), y + (bits >> 1 & 1), z + (bits >> 2)];
                (z * (cubes + 1) + y) * (cubes + 1) + x
            };
            // The inner tetrahedron joins the corners whose coordinates have an even sum.
            let cut = if (x + y + z) % 2 == 0 { &EVEN } else { &ODD };
            cells.extend(cut.map(|cell| cell.map(corner)));
        }
        Ok(Tets::new(points, cells, TetScalars::Point(scalars))?.0)
    }

    /// Samples the field at `count` points of unknown size, uniformly random in [-1, 1]³.
    ///
    /// Positions are the same in every run, and the first points do not depend on `count`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if `count` is 0, or the points do not fit into memory.
    pub fn points(self, count: u32) -> Result<Points> {
        let refuse = |why: &str| Error::invalid("count", format!("{count}: {why}"));
        if count == 0 {
            return Err(refuse("must be at least 1"));
        }
        let (mut centres, mut scalars) = (Vec::new(), Vec::new());
        centres
            .try_reserve_exact(num::index(count))
            .and_then(|()| scalars.try_reserve_exact(num::index(count)))
            .map_err(|_| refuse("the points do not fit into memory"))?;
        let mut state = 0;
        for _ in 0..count {
            let centre = DVec3::from_array(std::array::from_fn(|_| 2.0 * random(&mut state) - 1.0));
            centres.push(centre);
            scalars.push(num::f32_of(self.value(centre)));
        }
        Points::new(centres)?.with_scalars(scalars)
    }

    /// Makes `count` splats at random places of [-1, 1]³, the opaquer the greater the field is there.
    ///
    /// Their lengths differ, and shrink as their number grows. Colours follow the place, and change with the direction by harmonics
    /// of degree 1. Splats are the same in every run, and the places of the first ones do not depend on `count`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if `count` is 0, or the splats do not fit into memory.
    pub fn splats(self, count: u32) -> Result<Gaussians> {
        let points = self.points(count)?;
        let mut state = 1;
        let mut number = || num::f32_of(2.0 * random(&mut state) - 1.0);
        let length = num::f32_of(-f64::from(count).cbrt().ln());
        let mut parts = GaussianParts { degree: 1, ..GaussianParts::default() };
        for &centre in points.centres() {
            let place = centre.to_array().map(num::f32_of);
            parts.centres.push(place);
            parts.rotations.push([1.5, number(), number(), number()]);
            parts.log_scales.push([length + number(), length - 0.5, length - 0.5 + number()]);
            parts.opacities.push(num::f32_of(0.05 + 0.9 * self.value(centre)));
            parts.harmonics.extend(place);
            parts.harmonics.extend(std::iter::repeat_with(|| 0.4 * number()).take(9));
        }
        Ok(Gaussians::new(parts)?.0)
    }
}

/// Returns the indices of a lattice, x fastest.
fn indices([x, y, z]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..z).flat_map(move |k| (0..y).flat_map(move |j| (0..x).map(move |i| [i, j, k])))
}

/// Returns a random number in [0, 1) and advances the state (Steele, Lea and Flood 2014: SplitMix64).
pub(crate) fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    num::f64_of_u64((z ^ z >> 31) >> 11) * (-53.0_f64).exp2()
}

/// A cube as five positively oriented tetrahedra. Bits number the corners: 1 is x, 2 is y, 4 is z. The inner
/// tetrahedron joins the corners of even parity, or of odd parity.
const EVEN: [[u32; 4]; 5] = [[0, 3, 6, 5], [1, 3, 0, 5], [2, 0, 3, 6], [4, 0, 6, 5], [7, 3, 5, 6]];
const ODD: [[u32; 4]; 5] = [[1, 2, 4, 7], [0, 1, 2, 4], [3, 1, 7, 2], [5, 1, 4, 7], [6, 2, 7, 4]];

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
    fn cubes_are_cut_into_five_tetrahedra_that_meet_face_to_face() {
        for cubes in [1, 2, 3, 12] {
            let mesh = Field::Ramp.tets(cubes).unwrap();
            let n = num::index(cubes);
            assert_eq!((mesh.points().len(), mesh.cells().len()), ((n + 1).pow(3), 5 * n.pow(3)));
            assert_eq!(mesh.bounds(), [DVec3::NEG_ONE, DVec3::ONE]);
            let TetScalars::Point(scalars) = mesh.scalars() else { panic!("scalars of cells") };
            for (p, s) in mesh.points().iter().zip(scalars) {
                assert_eq!(*s, num::f32_of(Field::Ramp.value(*p)));
            }
            let mut volume = 0.0;
            let mut faces = std::collections::HashMap::new();
            for cell in mesh.cells() {
                let [a, b, c, d] = cell.map(|i| mesh.points()[num::index(i)]);
                volume += (b - a).cross(c - a).dot(d - a) / 6.0;
                for skip in 0..4 {
                    let mut face: Vec<u32> = (0..4).filter(|&i| i != skip).map(|i| cell[i]).collect();
                    face.sort_unstable();
                    *faces.entry(face).or_insert(0_usize) += 1;
                }
            }
            assert!((volume - 8.0).abs() < 1e-12, "{cubes}: volume {volume}");
            assert!(faces.values().all(|&count| count <= 2));
            // Two triangles on each square of the hull.
            assert_eq!(faces.values().filter(|&&count| count == 1).count(), 12 * n * n);
        }
        let count = |cubes| Field::Blobs.tets(cubes).unwrap().cells().len();
        assert_eq!([count(12), count(34)], [8640, 196_520]);
        for wrong in [0, Field::MAX_CUBES + 1, u32::MAX] {
            let why = Field::Blobs.tets(wrong).unwrap_err().to_string();
            assert!(why.contains("cubes") && why.contains("1 to 950"), "{why}");
        }
    }

    /// The tables themselves are positively oriented, so `Tets::new` exchanges no corners.
    #[test]
    fn both_cuts_are_positively_oriented() {
        for cell in EVEN.iter().chain(&ODD) {
            let [a, b, c, d] = cell
                .map(|bits| DVec3::new(f64::from(bits & 1), f64::from(bits >> 1 & 1), f64::from(bits >> 2)));
            assert!((b - a).cross(c - a).dot(d - a) > 0.0, "{cell:?}");
        }
    }

    #[test]
    fn points_are_spread_evenly_and_the_same_again() {
        let points = Field::Ramp.points(4096).unwrap();
        let [low, high] = points.bounds();
        assert!(low.min_element() >= -1.0 && high.max_element() < 1.0);
        let mut octants = [0; 8];
        for (p, s) in points.centres().iter().zip(points.scalars().unwrap()) {
            octants[usize::from(p.x > 0.0) + 2 * usize::from(p.y > 0.0) + 4 * usize::from(p.z > 0.0)] += 1;
            assert_eq!(*s, num::f32_of(Field::Ramp.value(*p)));
        }
        // Expected 512 each; the standard deviation is 21.
        assert!(octants.iter().all(|count| (420..=604).contains(count)), "{octants:?}");
        let again = Field::Blobs.points(100).unwrap();
        assert_eq!(again.centres(), &points.centres()[..100]);
        assert!(Field::Ramp.points(0).unwrap_err().to_string().contains("at least 1"));
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
