//! The visible kernels of points.

use crate::num::f32_of;
use crate::resident::splats::space::{Space, classified, finite};
use crate::scene::{Kernel, KernelSize, Kernels, Model, Points, TransferFunction};

/// Returns the visible kernels of points: centre and inverse of sigma, then colour and extinction, or for the
/// interpolating model scalar and weight. Returns the shapes of those with covariances too.
pub(crate) fn scattered(
    points: &Points,
    transfer: &TransferFunction,
    kernels: &Kernels,
    space: &Space,
) -> [Vec<[f32; 4]>; 2] {
    let ends = transfer.domain();
    let density = kernels.model == Model::Density;
    let [mut lists, mut shapes] = [vec![], vec![]];
    for (i, centre) in points.centres().iter().enumerate() {
        let s = finite(points.scalars().map_or(1.0, |all| f64::from(all[i])), ends);
        let weight = points.weights().map_or(1.0, |all| f64::from(all[i]));
        let [x, y, z] = ((*centre - space.centre) / space.unit).to_array().map(f32_of);
        // The radius of a kernel is three sigma of a Gaussian, and two units of a B-spline.
        let per_radius = if kernels.kernel == Kernel::Gaussian { 3.0 } else { 2.0 };
        let mut shape = None;
        let inverse = match points.size() {
            KernelSize::Radius(radius) => per_radius * space.unit / radius,
            KernelSize::Radii(radii) => per_radius * space.unit / f64::from(radii[i]),
            KernelSize::Covariances(all) => {
                shape = root(all[i].map(f64::from).map(|c| c / (space.unit * space.unit)));
                if shape.is_some() { 1.0 } else { f64::NAN }
            }
            KernelSize::Unknown => f64::NAN,
        };
        let valid =
            s.is_finite() && weight.is_finite() && weight != 0.0 && inverse > 0.0 && inverse.is_finite();
        if !valid {
            continue;
        }
        let value = if density {
            let value = classified(transfer, s, weight);
            if value[3] <= 0.0 {
                continue;
            }
            value
        } else {
            [f32_of(s), f32_of(weight), 0.0, 0.0]
        };
        lists.extend([[x, y, z, f32_of(inverse)], value]);
        shapes.extend(shape.into_iter().flatten());
    }
    [lists, shapes]
}

/// Returns the lower triangular root L of the inverse of a covariance S, with `S^-1 = L^T L`, and S itself, as shaders
/// read them.
///
/// The covariance is given as (xx, xy, xz, yy, yz, zz). Returns `None` where it is not positive definite in float32.
fn root([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Option<[[f32; 4]; 4]> {
    // Cholesky: S = C C^T.
    let c00 = xx.sqrt();
    let (c10, c20) = (xy / c00, xz / c00);
    let c11 = (yy - c10 * c10).sqrt();
    let c21 = (yz - c10 * c20) / c11;
    let c22 = (zz - c20 * c20 - c21 * c21).sqrt();
    // L = C^-1.
    let (l00, l11, l22) = (1.0 / c00, 1.0 / c11, 1.0 / c22);
    let l10 = -c10 * l00 * l11;
    let l21 = -c21 * l11 * l22;
    let l20 = (c10 * c21 * l11 - c20) * l00 * l22;
    let all = [l00, l10, l11, l20, l21, l22];
    let positive = [c00, c11, c22].iter().all(|c| c.is_finite() && *c > 0.0);
    let rows = [[l00, l10, l11, l20], [l21, l22, 0.0, 0.0], [xx, xy, xz, yy], [yz, zz, 0.0, 0.0]];
    let rows = rows.map(|row| row.map(f32_of));
    (positive && all.iter().all(|l| f32_of(*l).is_finite())).then_some(rows)
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;

    #[test]
    fn roots_are_those_of_the_inverse() {
        let covariance = [2.0, 0.3, -0.4, 1.0, 0.2, 0.5];
        let [r0, r1, ..] = root(covariance).unwrap().map(|row| row.map(f64::from));
        let l = DMat3::from_cols(
            DVec3::new(r0[0], r0[1], r0[3]),
            DVec3::new(0.0, r0[2], r1[0]),
            DVec3::new(0.0, 0.0, r1[1]),
        );
        let [xx, xy, xz, yy, yz, zz] = covariance;
        let s = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
        let one = l.transpose() * l * s;
        assert!((one - DMat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() < 1e-6), "{one}");
        for singular in
            [[0.0; 6], [1.0, 1.0, 0.0, 1.0, 0.0, 1.0], [f64::NAN; 6], [1.0, 2.0, 0.0, 1.0, 0.0, 1.0]]
        {
            assert!(root(singular).is_none(), "{singular:?}");
        }
    }
}
