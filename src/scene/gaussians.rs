//! Trained 3D Gaussian splats.

use std::fmt;
use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;

use super::axes::Axes;
use super::harmonics::{self, Rotation};
use crate::error::{Error, Result};
use crate::num;

/// The rule of drawing that splats were trained under, as far as their file says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TrainedMode {
    /// The file says nothing.
    #[default]
    Unknown,
    /// That of the first paper (Kerbl et al. 2023), with footprints widened by a low-pass filter.
    Default,
    /// The same with opacities that make up for the widening (Mip-Splatting, Yu et al. 2024).
    Antialiased,
    /// Flat splats that a ray intersects (2D Gaussian Splatting, Huang et al. 2024).
    Flat,
    /// That of `KHR_gaussian_splatting`, the extension of glTF.
    Khronos,
}

impl TrainedMode {
    /// Returns the name for messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Default => "default",
            Self::Antialiased => "antialiased",
            Self::Flat => "2dgs",
            Self::Khronos => "khr",
        }
    }
}

/// The lists that [`Gaussians`] are made of, with an entry for each splat.
#[derive(Clone, Debug, Default)]
pub struct GaussianParts {
    /// Centres, in world units.
    pub centres: Vec<[f32; 3]>,
    /// Quaternions w, x, y, z of any length but 0.
    pub rotations: Vec<[f32; 4]>,
    /// Natural logarithms of the standard deviations along the rotated x, y and z; negative infinity is flat.
    pub log_scales: Vec<[f32; 3]>,
    /// Opacities in the middle of the splat, 0 to 1.
    pub opacities: Vec<f32>,
    /// The degree of the spherical harmonics, 0 to 4.
    pub degree: u32,
    /// For each splat, for each function of [`harmonics::basis`], a coefficient of red, green and blue.
    pub harmonics: Vec<f32>,
    /// The directions that the axes point to.
    pub axes: Axes,
    /// The rule that the splats were trained under.
    pub mode: TrainedMode,
}

/// The numbers of splats that [`Gaussians::new`] left out or changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Left out: a number is NaN.
    pub nan: usize,
    /// Left out: a coordinate, a coefficient or a part of the quaternion is infinite.
    pub infinite: usize,
    /// Left out: the quaternion is 0.
    pub rotation: usize,
    /// Kept, with a logarithm of a length clamped to [`Gaussians::MOST_LOG_SCALE`] or its negative.
    pub clamped: usize,
}

impl Dropped {
    /// Returns the number of splats left out.
    #[must_use]
    pub fn total(&self) -> usize {
        self.nan + self.infinite + self.rotation
    }
}

impl fmt::Display for Dropped {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let reasons = [
            (self.nan, "with NaN"),
            (self.infinite, "with infinite numbers"),
            (self.rotation, "with a quaternion of length 0"),
        ];
        let texts: Vec<String> = reasons
            .into_iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, reason)| format!("{count} {reason}"))
            .collect();
        f.write_str(&texts.join(", "))
    }
}

/// Trained 3D Gaussian splats: ellipsoids with an opacity and a colour that depends on the direction of view.
///
/// Cheap to clone. Valid by construction: every number is finite but logarithms of lengths, which may be negative
/// infinity; quaternions have unit length up to rounding; there is at least one splat.
///
/// The covariance of a splat is `M Mᵀ` with `M = R(q) diag(exp(log scales))`. Its colour from a direction d, from the eye to
/// its centre, is `max(0, ½ + Σ Y_i(d) k_i)` for each channel, display-referred (sRGB).
#[derive(Clone, Debug)]
pub struct Gaussians {
    centres: Arc<Vec<[f32; 3]>>,
    rotations: Arc<Vec<[f32; 4]>>,
    log_scales: Arc<Vec<[f32; 3]>>,
    opacities: Arc<Vec<f32>>,
    degree: u32,
    harmonics: Arc<Vec<f32>>,
    axes: Axes,
    mode: TrainedMode,
    bounds: [DVec3; 2],
    reach: [DVec3; 2],
}

impl Gaussians {
    /// The largest logarithm of a length, and the negative of the least one that is not flat.
    pub const MOST_LOG_SCALE: f32 = 20.0;

    /// Makes splats, and leaves out those with NaN, infinite places or coefficients, or quaternions of length 0.
    ///
    /// Quaternions get unit length. Logarithms of lengths are clamped to ±[`Self::MOST_LOG_SCALE`], except negative infinity, and
    /// opacities to 0 to 1.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the lists differ in length, the degree is above 4, or no splat is left.
    pub fn new(parts: GaussianParts) -> Result<(Self, Dropped)> {
        let GaussianParts { mut centres, mut rotations, mut log_scales, mut opacities, .. } = parts;
        let GaussianParts { degree, mut harmonics, axes, mode, .. } = parts;
        if degree > harmonics::MAX_DEGREE {
            let why = format!("{degree}: must be 0 to {}", harmonics::MAX_DEGREE);
            return Err(Error::invalid("degree of harmonics", why));
        }
        let (count, width) = (centres.len(), 3 * harmonics::count(degree));
        for (what, given, wanted) in [
            ("rotations", rotations.len(), count),
            ("log scales", log_scales.len(), count),
            ("opacities", opacities.len(), count),
            ("harmonics", harmonics.len(), count.saturating_mul(width)),
        ] {
            if given != wanted {
                let why = format!("{given} are given, {count} splats need {wanted}");
                return Err(Error::invalid(format!("{what} of splats"), why));
            }
        }
        let mut dropped = Dropped::default();
        let mut kept = 0;
        for i in 0..count {
            let colour = i * width..(i + 1) * width;
            let numbers = || {
                let rotation = rotations[i].iter().chain(&centres[i]);
                rotation.chain(&harmonics[colour.clone()]).copied()
            };
            let logs = log_scales[i];
            let length = DQuat::from_array(rotations[i].map(f64::from)).length();
            let reason = if numbers().chain(logs).any(f32::is_nan) || opacities[i].is_nan() {
                &mut dropped.nan
            } else if numbers().any(f32::is_infinite) {
                &mut dropped.infinite
            } else if length == 0.0 {
                &mut dropped.rotation
            } else {
                let most = Self::MOST_LOG_SCALE;
                let within =
                    logs.map(|log| if log == f32::NEG_INFINITY { log } else { log.clamp(-most, most) });
                dropped.clamped += usize::from(within != logs);
                centres[kept] = centres[i];
                rotations[kept] = rotations[i].map(|part| num::f32_of(f64::from(part) / length));
                log_scales[kept] = within;
                opacities[kept] = opacities[i].clamp(0.0, 1.0);
                harmonics.copy_within(colour, kept * width);
                kept += 1;
                continue;
            };
            *reason += 1;
        }
        if kept == 0 {
            let why = match count {
                0 => "there must be at least one".to_owned(),
                _ => format!("none of {count} can be drawn: {dropped}"),
            };
            return Err(Error::invalid("splats", why));
        }
        centres.truncate(kept);
        rotations.truncate(kept);
        log_scales.truncate(kept);
        opacities.truncate(kept);
        harmonics.truncate(kept * width);
        let made = Self {
            centres: Arc::new(centres),
            rotations: Arc::new(rotations),
            log_scales: Arc::new(log_scales),
            opacities: Arc::new(opacities),
            degree,
            harmonics: Arc::new(harmonics),
            axes,
            mode,
            bounds: [DVec3::ZERO; 2],
            reach: [DVec3::ZERO; 2],
        };
        Ok((made.bounded(), dropped))
    }

    /// Computes both bounds.
    fn bounded(mut self) -> Self {
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let joined = |[a, b]: [DVec3; 2], [c, d]: [DVec3; 2]| [a.min(c), b.max(d)];
        let bounds = |extent: &(dyn Fn(usize) -> DVec3 + Sync)| {
            let all = (0..self.len()).into_par_iter().map(|i| {
                let (centre, extent) = (self.centre(i), extent(i));
                [centre - extent, centre + extent]
            });
            all.reduce(|| none, joined)
        };
        let (centres, reach) = (bounds(&|_| DVec3::ZERO), bounds(&|i| 3.0 * self.deviations(i)));
        (self.bounds, self.reach) = (centres, reach);
        self
    }

    /// Returns the opacity of a logit: infinities give 1 and 0.
    #[must_use]
    pub fn opacity_of_logit(logit: f64) -> f32 {
        num::f32_of(1.0 / (1.0 + (-logit).exp()))
    }

    /// Returns the number of splats.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "there is at least one")]
    pub fn len(&self) -> usize {
        self.centres.len()
    }

    /// Returns the centres, in world units.
    #[must_use]
    pub fn centres(&self) -> &[[f32; 3]] {
        &self.centres
    }

    /// Returns the unit quaternions: w, x, y, z.
    #[must_use]
    pub fn rotations(&self) -> &[[f32; 4]] {
        &self.rotations
    }

    /// Returns the natural logarithms of the standard deviations along the rotated x, y and z: within
    /// ±[`Self::MOST_LOG_SCALE`], or negative infinity.
    #[must_use]
    pub fn log_scales(&self) -> &[[f32; 3]] {
        &self.log_scales
    }

    /// Returns the opacities in the middle of each splat, 0 to 1.
    #[must_use]
    pub fn opacities(&self) -> &[f32] {
        &self.opacities
    }

    /// Returns the degree of the harmonics, 0 to 4.
    #[must_use]
    pub fn degree(&self) -> u32 {
        self.degree
    }

    /// Returns the coefficients: for each splat, for each of the `(degree + 1)²` functions of [`harmonics::basis`], of
    /// red, green and blue.
    #[must_use]
    pub fn harmonics(&self) -> &[f32] {
        &self.harmonics
    }

    /// Returns what the axes point to.
    #[must_use]
    pub fn axes(&self) -> Axes {
        self.axes
    }

    /// Returns the rule that the splats were trained under.
    #[must_use]
    pub fn mode(&self) -> TrainedMode {
        self.mode
    }

    /// Returns the least and the greatest coordinates of the centres.
    #[must_use]
    pub fn bounds(&self) -> [DVec3; 2] {
        self.bounds
    }

    /// Returns the least and the greatest coordinates of the ellipsoids at three standard deviations.
    #[must_use]
    pub fn reach(&self) -> [DVec3; 2] {
        self.reach
    }

    /// Returns the centre of a splat.
    #[must_use]
    pub fn centre(&self, i: usize) -> DVec3 {
        DVec3::from_array(self.centres[i].map(f64::from))
    }

    /// Returns the standard deviations of a splat along its own axes.
    #[must_use]
    pub fn scales(&self, i: usize) -> DVec3 {
        DVec3::from_array(self.log_scales[i].map(|log| f64::from(log).exp()))
    }

    /// Returns the rotation of a splat's own axes to the world's.
    #[must_use]
    pub fn rotation(&self, i: usize) -> DMat3 {
        DMat3::from_quat(quaternion(self.rotations[i]))
    }

    /// Returns the covariance of a splat.
    #[must_use]
    pub fn covariance(&self, i: usize) -> DMat3 {
        let root = self.rotation(i) * DMat3::from_diagonal(self.scales(i));
        root * root.transpose()
    }

    /// Returns the standard deviations of a splat along the world's axes.
    #[must_use]
    pub fn deviations(&self, i: usize) -> DVec3 {
        let root = self.rotation(i) * DMat3::from_diagonal(self.scales(i));
        DVec3::new(root.row(0).length(), root.row(1).length(), root.row(2).length())
    }

    /// Returns the same splats with axes that point elsewhere, without turning anything: for a file that does not tell
    /// its axes.
    #[must_use]
    pub fn with_axes(self, axes: Axes) -> Self {
        Self { axes, ..self }
    }

    /// Returns the splats turned into other axes, with their harmonics.
    #[must_use]
    pub fn turned(&self, axes: Axes) -> Self {
        if axes == self.axes {
            return self.clone();
        }
        Self { axes, ..self.moved(self.axes.rotation_to(axes)) }
    }

    /// Returns the splats with x in the opposite direction, with their harmonics; what the axes are called stays.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        self.moved(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)))
    }

    /// Maps the splats by an orthogonal matrix.
    fn moved(&self, matrix: DMat3) -> Self {
        let centres =
            (0..self.len()).map(|i| (matrix * self.centre(i)).to_array().map(num::f32_of)).collect();
        let rotations = self.rotations.iter().map(|rotation| combine(matrix, *rotation)).collect();
        let mut harmonics = self.harmonics.to_vec();
        if self.degree > 0 {
            turn_harmonics(&Rotation::new(matrix), self.degree, &mut harmonics);
        }
        let moved = Self {
            centres: Arc::new(centres),
            rotations: Arc::new(rotations),
            harmonics: Arc::new(harmonics),
            ..self.clone()
        };
        moved.bounded()
    }
}

/// Returns the quaternion w, x, y, z of an ellipsoid that an orthogonal matrix maps.
pub(super) fn combine(matrix: DMat3, [w, x, y, z]: [f32; 4]) -> [f32; 4] {
    // A reflection R S keeps the ellipsoid of a rotation: S Q S is one.
    let mirrors = matrix.determinant() < 0.0;
    let mirror = DMat3::from_diagonal(DVec3::new(if mirrors { -1.0 } else { 1.0 }, 1.0, 1.0));
    let turn = DQuat::from_mat3(&(matrix * mirror)).normalize();
    let own = quaternion(if mirrors { [w, x, -y, -z] } else { [w, x, y, z] });
    let DQuat { x, y, z, w } = (turn * own).normalize();
    [w, x, y, z].map(num::f32_of)
}

/// Turns the coefficients of splats, three for each function.
pub(super) fn turn_harmonics(map: &Rotation, degree: u32, harmonics: &mut [f32]) {
    let functions = harmonics::count(degree);
    let mut channel = vec![0.0; functions];
    for splat in harmonics.chunks_exact_mut(3 * functions) {
        for c in 0..3 {
            for (k, value) in channel.iter_mut().enumerate() {
                *value = f64::from(splat[3 * k + c]);
            }
            map.apply(&mut channel);
            for (k, value) in channel.iter().enumerate() {
                splat[3 * k + c] = num::f32_of(*value);
            }
        }
    }
}

/// Returns a quaternion of w, x, y, z with unit length to float64.
pub(super) fn quaternion([w, x, y, z]: [f32; 4]) -> DQuat {
    DQuat::from_array([x, y, z, w].map(f64::from)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(count: usize, degree: u32) -> GaussianParts {
        let number = |i: usize| ((i * 37 % 101) as f32 - 50.0) / 50.0;
        GaussianParts {
            centres: (0..count).map(|i| [number(i), number(i + 5), number(i + 9)]).collect(),
            rotations: (0..count).map(|i| [1.5, number(i + 2), number(i + 3), number(i + 4)]).collect(),
            log_scales: (0..count).map(|i| [number(i) - 3.0, number(i + 1) - 3.0, -5.0]).collect(),
            opacities: (0..count).map(|i| (number(i) + 1.0) / 2.0).collect(),
            degree,
            harmonics: (0..count * 3 * harmonics::count(degree)).map(number).collect(),
            axes: Axes::Rdf,
            mode: TrainedMode::Unknown,
        }
    }

    #[test]
    fn what_cannot_be_drawn_is_left_out_and_counted() {
        let mut bad = parts(9, 1);
        bad.centres[0][1] = f32::INFINITY;
        bad.log_scales[1][2] = f32::NAN;
        bad.rotations[2] = [0.0; 4];
        bad.harmonics[3 * 12 + 7] = f32::NAN;
        bad.opacities[4] = f32::NAN;
        bad.log_scales[5] = [f32::NEG_INFINITY, 25.0, -3.0];
        bad.opacities[6] = 1.5;
        bad.log_scales[7] = [-30.0, f32::INFINITY, 0.0];
        let (made, dropped) = Gaussians::new(bad.clone()).unwrap();
        assert_eq!(dropped, Dropped { nan: 3, infinite: 1, rotation: 1, clamped: 2 });
        assert_eq!((made.len(), dropped.total()), (4, 5));
        assert_eq!(made.log_scales()[0], [f32::NEG_INFINITY, 20.0, -3.0]);
        assert_eq!(made.log_scales()[2], [-20.0, 20.0, 0.0]);
        assert_eq!(made.opacities()[1], 1.0);
        assert_eq!(made.scales(0).x, 0.0);
        assert_eq!(made.centres()[3], bad.centres[8]);
        assert_eq!(made.harmonics()[3 * 12..], bad.harmonics[8 * 12..]);
        for &[w, x, y, z] in made.rotations() {
            assert!((w * w + x * x + y * y + z * z - 1.0).abs() < 1e-6);
        }
        assert_eq!(
            dropped.to_string(),
            "3 with NaN, 1 with infinite numbers, 1 with a quaternion of length 0"
        );
        let nothing = GaussianParts { rotations: vec![[0.0; 4]; 2], ..parts(2, 0) };
        let why = Gaussians::new(nothing).unwrap_err().to_string();
        assert!(why.contains("none of 2"), "{why}");
        assert!(Gaussians::new(parts(0, 0)).is_err() && Gaussians::new(parts(1, 5)).is_err());
        let short = GaussianParts { opacities: vec![1.0], ..parts(2, 0) };
        assert!(Gaussians::new(short).unwrap_err().to_string().contains("opacities"));
    }

    #[test]
    fn logits_may_be_infinite() {
        let logits = [f64::INFINITY, f64::NEG_INFINITY, 0.0, 1e9, -1e9];
        assert_eq!(logits.map(Gaussians::opacity_of_logit), [1.0, 0.0, 0.5, 1.0, 0.0]);
        assert!(Gaussians::opacity_of_logit(f64::NAN).is_nan());
    }

    #[test]
    fn bounds_are_those_of_centres_and_of_three_deviations() {
        let parts = GaussianParts {
            centres: vec![[1.0, 2.0, 3.0]],
            // A quarter turn about z: x becomes y.
            rotations: vec![[0.5_f32.sqrt(), 0.0, 0.0, 0.5_f32.sqrt()]],
            log_scales: vec![[2.0_f32.ln(), 0.0, f32::NEG_INFINITY]],
            ..parts(1, 0)
        };
        let made = Gaussians::new(parts).unwrap().0;
        assert_eq!(made.bounds(), [DVec3::new(1.0, 2.0, 3.0); 2]);
        let [low, high] = made.reach();
        assert!(low.distance(DVec3::new(-2.0, -4.0, 3.0)) < 1e-5, "{low}");
        assert!(high.distance(DVec3::new(4.0, 8.0, 3.0)) < 1e-5, "{high}");
        let covariance = made.covariance(0);
        assert!((covariance.y_axis.y - 4.0).abs() < 1e-5 && (covariance.x_axis.x - 1.0).abs() < 1e-6);
    }

    /// Colours before clamping.
    fn colour(splats: &Gaussians, i: usize, direction: DVec3) -> DVec3 {
        let functions = harmonics::count(splats.degree());
        let own = &splats.harmonics()[3 * functions * i..3 * functions * (i + 1)];
        let all = harmonics::basis(splats.degree(), direction);
        own.chunks_exact(3).zip(all).map(|(k, y)| DVec3::new(k[0].into(), k[1].into(), k[2].into()) * y).sum()
    }

    #[test]
    fn turned_splats_are_the_same_ones_in_other_axes() {
        for degree in 0..=4 {
            let made = Gaussians::new(parts(5, degree)).unwrap().0;
            for axes in [Axes::Rub, Axes::Rfu, Axes::Bdr] {
                let turned = made.turned(axes);
                let matrix = Axes::Rdf.rotation_to(axes);
                assert_eq!(turned.axes(), axes);
                check(&made, &turned, matrix);
                let back = turned.turned(Axes::Rdf);
                assert_eq!(back.centres(), made.centres());
            }
            check(&made, &made.mirrored(), DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)));
        }
    }

    fn check(made: &Gaussians, turned: &Gaussians, matrix: DMat3) {
        for i in 0..made.len() {
            assert_eq!(turned.centre(i), matrix * made.centre(i));
            let expected = matrix * made.covariance(i) * matrix.transpose();
            let difference = turned.covariance(i) - expected;
            assert!(difference.to_cols_array().iter().all(|d| d.abs() < 1e-6), "{difference}");
            for direction in [DVec3::new(0.36, 0.48, 0.8), DVec3::NEG_Y, DVec3::new(-0.6, 0.0, 0.8)] {
                let seen = colour(turned, i, matrix * direction);
                assert!(seen.distance(colour(made, i, direction)) < 1e-5);
            }
        }
        assert_eq!(turned.opacities(), made.opacities());
    }
}
