//! Tables of footprints for parallel rays.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::footprint::Lattice;
use crate::error::{Error, Result};
use crate::num;
use crate::scene::Kernels;

/// The footprint of a lattice's kernel in the image. For parallel rays it is the same for all samples.
///
/// It is a table of `size` x `size` values over the kernel's projected extent, both ends included, x fastest.
/// Look-ups are bilinear, and 0 outside.
///
/// # Accuracy
///
/// Largest error of a look-up as a share of the footprint's peak, over 40 oblique directions:
///
/// | kernel | 64 x 64 | 128 x 128 |
/// |---|---|---|
/// | Gaussian, sigma 0.7, cut at 3 | 2.4e-3 | 1.3e-3 |
/// | Gaussian, sigma 0.7, cut at 4 | 3.8e-3 | 8.9e-4 |
/// | cubic B-spline | 7.1e-3 | 1.7e-3 |
/// | tent | 1.7e-2 | 7.0e-3 |
/// | Lanczos-3 | 2.5e-2 | 5.5e-3 |
#[derive(Clone, Debug)]
pub(crate) struct Template {
    /// Half of the extent along the image's axes, in their units.
    pub(crate) half: [f64; 2],
    /// Integrals of the kernel along the ray, in units of the direction's parameter.
    pub(crate) values: Vec<f32>,
}

impl Template {
    /// Computes the footprint for rays along `direction` and image axes along `axes`, all in voxels.
    ///
    /// The unit of `direction` is the ray's parameter: if it covers one world unit, extinction times the
    /// value is an optical depth. The unit of `axes` is that of places in the image, such as a pixel.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the three do not span space, or `size` is below 2.
    pub(crate) fn new(kernels: Kernels, direction: DVec3, axes: [DVec3; 2], size: u32) -> Result<Self> {
        let matrix = DMat3::from_cols(axes[0], axes[1], direction);
        let volume = axes[0].length() * axes[1].length() * direction.length();
        if !(matrix.determinant().abs() > 1e-12 * volume && volume.is_finite()) {
            return Err(Error::invalid("footprint", "direction and axes must span space"));
        }
        if size < 2 {
            return Err(Error::invalid("footprint", format!("{size} values: must be at least 2")));
        }
        let lattice = Lattice::new(kernels);
        // The image's coordinates as functions of the offset.
        let inverse = matrix.inverse();
        let half = [inverse.row(0), inverse.row(1)].map(|row| lattice.extent(row));
        let n = num::index(size);
        let place = |i: usize, half: f64| half * (2.0 * num::f64_of(i) / f64::from(size - 1) - 1.0);
        let mut values = vec![0.0; n * n];
        values.par_chunks_mut(n).enumerate().for_each(|(j, row)| {
            for (i, value) in row.iter_mut().enumerate() {
                let start = axes[0] * place(i, half[0]) + axes[1] * place(j, half[1]);
                *value = num::f32_of(lattice.line(start, direction, [f64::NEG_INFINITY, f64::INFINITY]));
            }
        });
        Ok(Self { half, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Kernel;

    /// Returns the value at a place of the image relative to the sample's, interpolated as on the device.
    fn at(template: &Template, x: f64, y: f64) -> f64 {
        let size = num::count(template.values.len().isqrt());
        let last = f64::from(size - 1);
        let [u, v] = [x / template.half[0], y / template.half[1]].map(|place| 0.5 * (place + 1.0) * last);
        if !(u >= 0.0 && u <= last && v >= 0.0 && v <= last) {
            return 0.0;
        }
        let cell = |u: f64| num::u32_of(u).min(size - 2);
        let (i, j) = (cell(u), cell(v));
        let (fu, fv) = (u - f64::from(i), v - f64::from(j));
        let value = |i: u32, j: u32| f64::from(template.values[num::index(j * size + i)]);
        let row = |j: u32| value(i, j) * (1.0 - fu) + value(i + 1, j) * fu;
        row(j) * (1.0 - fv) + row(j + 1) * fv
    }

    /// Returns the largest error of a look-up as a share of the peak, over directions and places.
    fn error(kernels: Kernels, size: u32) -> f64 {
        let lattice = Lattice::new(kernels);
        let mut worst = 0.0_f64;
        for turn in 0..40 {
            let (a, b) = (0.35 + 0.61 * f64::from(turn), 0.17 + 0.37 * f64::from(turn));
            let direction = DVec3::new(a.cos() * b.cos(), a.sin() * b.cos(), b.sin());
            let right = direction.any_orthonormal_vector();
            let axes = [right, direction.cross(right) * 0.5];
            let template = Template::new(kernels, direction, axes, size).unwrap();
            let exact = |x: f64, y: f64| {
                lattice.line(axes[0] * x + axes[1] * y, direction, [f64::NEG_INFINITY, f64::INFINITY])
            };
            let peak = exact(0.0, 0.0);
            for i in 0..2000_u32 {
                let place = |step: f64| 2.1 * (f64::from(i) * step).fract() - 1.05;
                let (x, y) = (
                    place(0.754_877_666_246_693) * template.half[0],
                    place(0.569_840_290_998_053) * template.half[1],
                );
                worst = worst.max((at(&template, x, y) - exact(x, y)).abs() / peak);
            }
        }
        worst
    }

    #[test]
    fn lookups_are_as_good_as_stated() {
        let gauss = |cut: f64| Kernels { cut, ..Kernels::of_points() };
        let product = |kernel: Kernel| Kernels { kernel, ..Kernels::of_samples() };
        for (kernels, coarse, fine) in [
            (gauss(3.0), 2.6e-3, 1.4e-3),
            (gauss(4.0), 4.0e-3, 9.5e-4),
            (product(Kernel::BSpline), 7.5e-3, 1.8e-3),
            (product(Kernel::Tent), 1.8e-2, 7.5e-3),
            (product(Kernel::Sinc), 2.6e-2, 5.8e-3),
        ] {
            for (size, bound) in
                [(64, coarse), (128, fine)].into_iter().take(if crate::exhaustive() { 2 } else { 1 })
            {
                let error = error(kernels, size);
                println!("{:?} cut {}, {size}: {error:.2e}", kernels.kernel, kernels.cut);
                assert!(error < bound && error > 0.7 * bound, "{kernels:?}, {size}: {error:e}");
            }
        }
    }

    #[test]
    fn nodes_hold_footprints_and_the_extent_is_the_support() {
        let kernels = Kernels { kernel: Kernel::BSpline, ..Kernels::of_samples() };
        let template = Template::new(kernels, DVec3::Z * 4.0, [DVec3::X * 0.5, DVec3::Y], 5).unwrap();
        assert_eq!(template.half, [4.0, 2.0]);
        // Rays along z, 4 voxels per unit of the parameter: through the sample, and one voxel beside it.
        assert_eq!(template.values[12], num::f32_of(4.0 / 9.0 / 4.0));
        assert!((at(&template, 2.0, 0.0) - 1.0 / 9.0 / 4.0).abs() < 1e-8);
        assert_eq!((at(&template, 4.1, 0.0), at(&template, 0.0, f64::NAN)), (0.0, 0.0));
        assert!(Template::new(kernels, DVec3::X, [DVec3::X, DVec3::Y], 9).is_err());
        assert!(Template::new(kernels, DVec3::Z, [DVec3::X, DVec3::Y], 1).is_err());
    }
}
