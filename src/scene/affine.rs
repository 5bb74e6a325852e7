//! Affine maps of Gaussian splats.

use std::ops::Range;

use glam::{DMat3, DQuat, DVec3};

use super::gaussians::{GaussianParts, combine, quaternion, turn_harmonics};
use super::harmonics::{self, Rotation};
use crate::error::{Error, Result};
use crate::num;

/// The difference from a rotation, relative to its scale, up to which a matrix is taken as a rotation with a scale.
const SIMILAR: f64 = 1e-12;

/// A matrix as orthogonal columns, their lengths, and the orthogonal matrix that makes them the columns of the given one.
struct Factors {
    /// Unit vectors that are orthogonal, right-handed or left-handed.
    columns: DMat3,
    /// In descending order.
    lengths: DVec3,
    right: DMat3,
}

impl Factors {
    /// Decomposes a finite matrix by Jacobi rotations of its columns, which keep small lengths as precise as great ones. Their squares are
    /// the eigenvalues of the matrix times its transpose.
    fn new(matrix: DMat3) -> Self {
        let size = matrix.to_cols_array().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let scale = if size > 0.0 { size } else { 1.0 };
        let mut columns = matrix.to_cols_array_2d().map(|column| DVec3::from_array(column) / scale);
        let mut right = [DVec3::X, DVec3::Y, DVec3::Z];
        // Convergence is quadratic: six sweeps suffice for any matrix.
        for _ in 0..30 {
            let mut done = true;
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                let (a, b) = (columns[p].length_squared(), columns[q].length_squared());
                let product = columns[p].dot(columns[q]);
                if product.abs() <= f64::EPSILON * (a * b).sqrt() {
                    continue;
                }
                done = false;
                let zeta = (b - a) / (2.0 * product);
                let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let cosine = 1.0 / tangent.hypot(1.0);
                let sine = cosine * tangent;
                for list in [&mut columns, &mut right] {
                    let (first, second) = (list[p], list[q]);
                    list[p] = first * cosine - second * sine;
                    list[q] = first * sine + second * cosine;
                }
            }
            if done {
                break;
            }
        }
        let mut order = [0, 1, 2];
        order.sort_by(|i, j| columns[*j].length().total_cmp(&columns[*i].length()));
        let (columns, right) = (order.map(|i| columns[i]), order.map(|i| right[i]));
        let lengths = columns.map(DVec3::length);
        let first = columns[0].try_normalize().unwrap_or(DVec3::X);
        let second = (columns[1] - first * first.dot(columns[1])).try_normalize();
        let second = second.unwrap_or_else(|| first.any_orthonormal_vector());
        let third = first.cross(second);
        let right = DMat3::from_cols(right[0], right[1], right[2]);
        // A matrix without a third dimension mirrors nothing.
        let flips = match columns[2].dot(third) {
            0.0 => right.determinant() < 0.0,
            height => height < 0.0,
        };
        let columns = DMat3::from_cols(first, second, if flips { -third } else { third });
        Self { columns, lengths: DVec3::from_array(lengths) * scale, right }
    }

    /// Returns the orthogonal matrix that is nearest to the given one.
    fn polar(&self) -> DMat3 {
        self.columns * self.right.transpose()
    }

    /// Returns the rotation of an ellipsoid with these axes.
    fn rotation(&self) -> DQuat {
        let Self { columns, .. } = self;
        let mirrored = columns.determinant() < 0.0;
        let third = if mirrored { -columns.z_axis } else { columns.z_axis };
        DQuat::from_mat3(&DMat3::from_cols(columns.x_axis, columns.y_axis, third)).normalize()
    }
}

impl GaussianParts {
    /// Maps splats of a range by `matrix · x + offset`: centres, covariances by `M Σ Mᵀ`, and harmonics by the orthogonal matrix that is
    /// nearest to the given one, which mirrors if that does.
    ///
    /// Rotations and lengths of a matrix that is no rotation with a scale are made again of the covariance, in float64. Splats with
    /// numbers that are not finite keep these.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the matrix is not finite, or the lists are shorter than the range.
    pub fn transform(&mut self, range: Range<usize>, matrix: DMat3, offset: DVec3) -> Result<()> {
        if !matrix.is_finite() || !offset.is_finite() {
            return Err(Error::invalid("transform", "must be finite"));
        }
        let width = 3 * harmonics::count(self.degree.min(harmonics::MAX_DEGREE));
        let own = range.start.saturating_mul(width)..range.end.saturating_mul(width);
        let (Some(centres), Some(rotations), Some(log_scales), Some(coefficients)) = (
            self.centres.get_mut(range.clone()),
            self.rotations.get_mut(range.clone()),
            self.log_scales.get_mut(range.clone()),
            self.harmonics.get_mut(own),
        ) else {
            return Err(Error::invalid("splats", format!("{range:?} of {}", self.centres.len())));
        };
        for centre in centres {
            *centre =
                (matrix * DVec3::from_array(centre.map(f64::from)) + offset).to_array().map(num::f32_of);
        }
        let factors = Factors::new(matrix);
        let polar = factors.polar();
        let scale = factors.lengths.x;
        if scale > 0.0 && factors.lengths.z >= scale * (1.0 - SIMILAR) {
            let grown = scale.ln();
            for (rotation, logs) in rotations.iter_mut().zip(log_scales) {
                if quaternion(*rotation).is_finite() {
                    *rotation = combine(polar, *rotation);
                }
                *logs = logs.map(|log| num::f32_of(f64::from(log) + grown));
            }
        } else {
            for (rotation, logs) in rotations.iter_mut().zip(log_scales) {
                let own = quaternion(*rotation);
                let lengths = DVec3::from_array(logs.map(|log| f64::from(log).exp()));
                if !own.is_finite() || !lengths.is_finite() {
                    continue;
                }
                let factors = Factors::new(matrix * DMat3::from_quat(own) * DMat3::from_diagonal(lengths));
                let DQuat { x, y, z, w } = factors.rotation();
                *rotation = [w, x, y, z].map(num::f32_of);
                *logs = factors.lengths.to_array().map(|length| num::f32_of(length.ln()));
            }
        }
        if self.degree > 0 && polar != DMat3::IDENTITY {
            turn_harmonics(&Rotation::new(polar), self.degree, coefficients);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Axes, Gaussians, TrainedMode};
    use super::*;

    fn parts() -> GaussianParts {
        let number = |i: usize| ((i * 37 % 101) as f32 - 50.0) / 50.0;
        GaussianParts {
            centres: (0..6).map(|i| [number(i), number(i + 5), number(i + 9)]).collect(),
            rotations: (0..6).map(|i| [1.5, number(i + 2), number(i + 3), number(i + 4)]).collect(),
            log_scales: (0..6)
                .map(|i| [number(i) - 1.0, number(i + 1) - 5.0, [f32::NEG_INFINITY, -2.0][i % 2]])
                .collect(),
            opacities: vec![0.5; 6],
            degree: 3,
            harmonics: (0..6 * 48).map(number).collect(),
            axes: Axes::Luf,
            mode: TrainedMode::Unknown,
        }
    }

    fn colour(splats: &Gaussians, i: usize, direction: DVec3) -> DVec3 {
        let own = &splats.harmonics()[48 * i..48 * (i + 1)];
        let all = harmonics::basis(3, direction);
        own.chunks_exact(3).zip(all).map(|(k, y)| DVec3::new(k[0].into(), k[1].into(), k[2].into()) * y).sum()
    }

    /// A rotation about an axis that is not a coordinate's.
    fn turn() -> DMat3 {
        DMat3::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 1.1)
    }

    #[test]
    fn covariances_and_colours_follow_any_matrix() {
        let other = DMat3::from_axis_angle(DVec3::Y, 0.7);
        let diagonal = |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z));
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.7, 1.0, 0.0), DVec3::new(0.1, -0.3, 1.0));
        // A matrix, and the orthogonal one of its polar decomposition where it is known.
        let cases = [
            (turn(), Some(turn())),
            (turn() * 0.5, Some(turn())),
            (DMat3::IDENTITY, Some(DMat3::IDENTITY)),
            (diagonal(-1.0, 1.0, 1.0), Some(diagonal(-1.0, 1.0, 1.0))),
            (turn() * diagonal(2.0, -2.0, 2.0), Some(turn() * diagonal(1.0, -1.0, 1.0))),
            // A symmetric factor behind a rotation.
            (turn() * (other * diagonal(3.0, 0.5, 1e-6) * other.transpose()), Some(turn())),
            (turn() * diagonal(-3.0, -0.5, -1e-3), Some(-turn())),
            (shear, None),
            (turn() * shear * diagonal(1.0, -4.0, 1.0), None),
        ];
        let offset = DVec3::new(1.0, -2.0, 3.0);
        let before = Gaussians::new(parts()).unwrap().0;
        for (case, (matrix, orthogonal)) in cases.into_iter().enumerate() {
            let mut moved = parts();
            moved.transform(1..6, matrix, offset).unwrap();
            assert_eq!(moved.centres[0], parts().centres[0]);
            assert_eq!(moved.harmonics[..48], parts().harmonics[..48]);
            let after = Gaussians::new(moved).unwrap().0;
            let polar = Factors::new(matrix).polar();
            if let Some(orthogonal) = orthogonal {
                let difference = (polar - orthogonal).to_cols_array();
                assert!(difference.iter().all(|d| d.abs() < 1e-9), "{case}: {difference:?}");
            }
            assert!(polar.determinant() * matrix.determinant() > 0.0, "{case}");
            for i in 1..6 {
                assert!(after.centre(i).distance(matrix * before.centre(i) + offset) < 1e-5);
                let expected = matrix * before.covariance(i) * matrix.transpose();
                let norm = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
                let difference = norm(after.covariance(i) - expected) / norm(expected);
                assert!(difference < 3e-6, "{case}, {i}: {difference}");
                for direction in [DVec3::new(0.36, 0.48, 0.8), DVec3::NEG_Y, DVec3::new(-0.6, 0.0, 0.8)] {
                    let seen = colour(&after, i, polar * direction);
                    assert!(seen.distance(colour(&before, i, direction)) < 1e-5, "{case}, {i}");
                }
            }
        }
    }

    #[test]
    fn matrices_without_a_dimension_make_flat_splats() {
        for (matrix, rank) in [
            (DMat3::ZERO, 0),
            (DMat3::from_diagonal(DVec3::new(0.0, 2.0, 0.0)), 1),
            (turn() * DMat3::from_diagonal(DVec3::new(0.0, 2.0, 1.0)), 2),
        ] {
            let mut moved = parts();
            moved.transform(0..6, matrix, DVec3::ZERO).unwrap();
            let (after, dropped) = Gaussians::new(moved).unwrap();
            assert_eq!(dropped.total(), 0);
            for logs in after.log_scales() {
                let solid = logs.iter().filter(|log| **log > -15.0).count();
                assert!(solid <= rank, "{logs:?}");
            }
            assert!((Factors::new(matrix).polar().determinant() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_not_finite_stays() {
        let mut broken = parts();
        broken.rotations[0] = [0.0; 4];
        broken.log_scales[1][0] = f32::NAN;
        broken.centres[2][0] = f32::NAN;
        for matrix in [turn() * 2.0, DMat3::from_diagonal(DVec3::new(1.0, 2.0, 3.0))] {
            let mut moved = broken.clone();
            moved.transform(0..6, matrix, DVec3::ONE).unwrap();
            let (after, dropped) = Gaussians::new(moved).unwrap();
            assert_eq!((after.len(), dropped.nan, dropped.rotation), (3, 2, 1));
        }
        let wrong = DMat3::from_diagonal(DVec3::new(1.0, f64::NAN, 1.0));
        assert!(broken.transform(0..6, wrong, DVec3::ZERO).is_err());
        assert!(broken.transform(0..7, turn(), DVec3::ZERO).is_err());
    }
}
