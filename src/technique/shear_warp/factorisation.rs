//! The shear-warp factorisation of a view (Lacroute and Levoy 1994; Peikert, Object Space Volume Rendering,
//! SciVis 2007, pages 4-7 to 4-15), in float64.
//!
//! A view maps an index, as `(x, y, z, 1)`, to `(u w, v w, d, w)`: pixels u and v, depth d, and w, which is 1 for
//! parallel rays. It is `M = W S P`: P permutes the axes so that slices are stacked along z, S shears slice z by
//! `(s_x z, s_y z)` and scales it by `1 / (1 + s_w z)`, so that the points of one ray lie above each other, and W maps the base
//! plane z = 0 to the image, independently of z.

use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};

use crate::error::{Error, Result};
use crate::scene::grid::turned;

/// Determinant of the balanced system below which a base plane counts as edge-on, because its solution has no digits left.
const EDGE_ON: f64 = 1e-12;

/// `M = W S P`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Factorisation {
    pub(crate) permutation: DMat4,
    pub(crate) shear: DMat4,
    pub(crate) warp: DMat4,
}

impl Factorisation {
    /// Factors a view for slices along an axis. The base plane is that of index 0 along it.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] where the base plane is seen edge-on, by parallel rays or because the eye lies in it, and
    /// where a number is not finite.
    pub(crate) fn of(view: DMat4, axis: usize) -> Result<Self> {
        let refuse = |why: &str| Err(Error::invalid("base plane", format!("axis {axis}: {why}")));
        if !view.is_finite() {
            return refuse("the view is not finite");
        }
        let unit = [DVec3::X, DVec3::Y, DVec3::Z];
        let [a, b, c] = turned(unit, axis);
        // Rows: the axes in the order of the stack.
        let permutation = DMat4::from_mat3(DMat3::from_cols(a, b, c).transpose());
        let m = view * permutation.transpose();
        // The warp is M without its third column. (s_x, s_y, s_w) expresses that column by the others; the third row, depth, takes
        // no part.
        let plane = |column: DVec4| DVec3::new(column.x, column.y, column.w);
        let columns = [m.x_axis, m.y_axis, m.w_axis].map(plane);
        // Columns have different units: each is scaled to unit length.
        let lengths = columns.map(DVec3::length);
        if lengths.contains(&0.0) {
            return refuse("it is seen edge-on");
        }
        let [x, y, w] = [0, 1, 2].map(|i| columns[i] / lengths[i]);
        // Rows have different units, too: pixels, and the divisor w.
        let rows = DVec3::new(
            x.x.abs().max(y.x.abs()).max(w.x.abs()),
            x.y.abs().max(y.y.abs()).max(w.y.abs()),
            x.z.abs().max(y.z.abs()).max(w.z.abs()),
        );
        if rows.min_element() == 0.0 {
            return refuse("it is seen edge-on");
        }
        let balanced = DMat3::from_cols(x / rows, y / rows, w / rows);
        let determinant = balanced.determinant();
        if determinant.is_nan() || determinant.abs() <= EDGE_ON {
            return refuse("it is seen edge-on");
        }
        let solve = |right: DVec3| balanced.inverse() * (right / rows);
        let right = plane(m.z_axis);
        let mut s = solve(right);
        // One step of iterative refinement: solves for the residual.
        s += solve(right - (x * s.x + y * s.y + w * s.z));
        let s = s / DVec3::from_array(lengths);
        if !s.is_finite() {
            return refuse("its shear is not finite");
        }
        let shear = DMat4::from_cols(DVec4::X, DVec4::Y, DVec4::new(s.x, s.y, 1.0, s.z), DVec4::W);
        let depth = m.z_axis.z - s.x * m.x_axis.z - s.y * m.y_axis.z - s.z * m.w_axis.z;
        let warp = DMat4::from_cols(m.x_axis, m.y_axis, DVec4::new(0.0, 0.0, depth, 0.0), m.w_axis);
        Ok(Self { permutation, shear, warp })
    }

    /// The shear of a slice per unit of z.
    pub(crate) fn shears(&self) -> DVec2 {
        DVec2::new(self.shear.z_axis.x, self.shear.z_axis.y)
    }

    /// `s_w`: slice z is scaled by `1 / (1 + s_w z)`; 0 for parallel rays.
    pub(crate) fn scaling(&self) -> f64 {
        self.shear.z_axis.w
    }

    /// Maps the base plane, `(x, y, 1)`, to the image, `(u w, v w, w)`.
    pub(crate) fn to_image(self) -> DMat3 {
        let plane = |column: DVec4| DVec3::new(column.x, column.y, column.w);
        DMat3::from_cols(plane(self.warp.x_axis), plane(self.warp.y_axis), plane(self.warp.w_axis))
    }

    /// Returns the point where the ray through a point of the base plane meets slice z.
    #[cfg(test)]
    fn on_slice(&self, base: DVec2, z: f64) -> DVec2 {
        base + z * (self.scaling() * base - self.shears())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A view of a lattice of unit cells about the origin.
    fn view(eye: DVec3, target: DVec3, half_height: Option<f64>) -> DMat4 {
        let forward = (target - eye).normalize();
        let right = forward.cross(DVec3::new(0.1, 1.0, 0.05)).normalize();
        let up = right.cross(forward);
        let scale = 0.01;
        let row = |v: DVec3, s: f64| (v / s).extend((-eye).dot(v) / s);
        let w = if half_height.is_some() { DVec4::W } else { row(forward, 1.0) };
        DMat4::from_cols(row(right, scale), row(-up, scale), row(forward, 1.0), w).transpose()
    }

    fn eyes() -> Vec<DVec3> {
        let mut eyes = Vec::new();
        for i in 0..200_u32 {
            let t = f64::from(i);
            let direction = DVec3::new((t * 0.71).sin(), (t * 1.13).cos(), (t * 0.37 + 0.2).sin());
            eyes.push(direction.normalize() * (1.5 + t));
        }
        eyes
    }

    /// The product is the view for every axis and projection, and the warp's third column is 0 but for depth.
    #[test]
    fn the_product_of_the_factors_is_the_view() {
        let mut factored = 0;
        for (i, eye) in eyes().into_iter().enumerate() {
            for half_height in [None, Some(2.0)] {
                let m = view(eye, DVec3::new(0.3, -0.2, 0.1), half_height);
                for axis in 0..3 {
                    let Ok(f) = Factorisation::of(m, axis) else { continue };
                    factored += 1;
                    let product = f.warp * f.shear * f.permutation;
                    // Large shears magnify rounding: they are multiplied back.
                    let size = f.shear.z_axis.abs().max_element().max(1.0);
                    for column in 0..4 {
                        let (got, want) = (product.col(column), m.col(column));
                        // Each row in its own unit.
                        for row in 0..4 {
                            let scale = m.row(row).abs().max_element();
                            let off = (got[row] - want[row]).abs() / scale;
                            assert!(off < 1e-12 * size, "eye {i} axis {axis} [{row}, {column}]: {off}");
                        }
                    }
                    assert_eq!([f.warp.z_axis.x, f.warp.z_axis.y, f.warp.z_axis.w], [0.0; 3]);
                    let p = f.permutation;
                    assert_eq!(p * p.transpose(), DMat4::IDENTITY);
                    assert_eq!((p * DVec3::AXES[axis].extend(0.0)).truncate(), DVec3::Z);
                }
            }
        }
        // All but the few whose eye lies in a base plane through the origin.
        assert!(factored > 1190, "{factored}");
    }

    /// Pages 4-12 and 4-16: without a permutation `w_ij = v_ij` and the shear solves a 2 x 2 or a 3 x 3 system.
    #[test]
    fn without_a_permutation_the_textbook_s_formulas_hold() {
        for eye in [DVec3::new(1.0, 2.0, 5.0), DVec3::new(-0.4, 0.1, -7.0)] {
            let m = view(eye, DVec3::ZERO, Some(1.0));
            let f = Factorisation::of(m, 2).unwrap();
            assert_eq!(f.permutation, DMat4::IDENTITY);
            let v = |r: usize, c: usize| m.col(c)[r];
            let det = v(0, 0) * v(1, 1) - v(0, 1) * v(1, 0);
            let sx = (v(1, 1) * v(0, 2) - v(0, 1) * v(1, 2)) / det;
            let sy = (v(0, 0) * v(1, 2) - v(1, 0) * v(0, 2)) / det;
            assert!((f.shears() - DVec2::new(sx, sy)).length() < 1e-13 && f.scaling() == 0.0, "{f:?}");
            let w22 = -sx * v(2, 0) - sy * v(2, 1) + v(2, 2);
            assert!((f.warp.z_axis.z - w22).abs() < 1e-13);
            for c in [0, 1, 3] {
                assert_eq!(f.warp.col(c), m.col(c));
            }

            // Perspective: the shear is that of the line to the eye, and the scale falls with the distance to it.
            let f = Factorisation::of(view(eye, DVec3::ZERO, None), 2).unwrap();
            let want = DVec3::new(-eye.x / eye.z, -eye.y / eye.z, -1.0 / eye.z);
            assert!((f.shears().extend(f.scaling()) - want).length() < 1e-13, "{f:?}, not {want}");
        }
    }

    /// A ray through the base plane meets each slice at the point that the sheared slice has above the same point.
    #[test]
    fn lines_of_sight_are_upright_in_sheared_space() {
        for (axis, half_height) in [(0, None), (1, Some(1.0)), (2, None)] {
            let m = view(DVec3::new(4.0, 3.0, 5.0), DVec3::ZERO, half_height);
            let f = Factorisation::of(m, axis).unwrap();
            let base = DVec2::new(0.3, -0.7);
            let pixel = |turned: DVec3| {
                let p = m * f.permutation.transpose() * turned.extend(1.0);
                DVec2::new(p.x, p.y) / p.w
            };
            for z in [-2.0, 0.5, 3.0] {
                let off = pixel(f.on_slice(base, z).extend(z)) - pixel(base.extend(0.0));
                assert!(off.length() < 1e-10, "{axis} {z}: {off}");
            }
            let by_warp = f.to_image() * base.extend(1.0);
            assert!((by_warp.truncate() / by_warp.z - pixel(base.extend(0.0))).length() < 1e-10);
        }
    }

    /// Edge-on, nearly so, and numbers that are none: an error or finite factors.
    #[test]
    fn singular_views_are_errors_and_never_nan() {
        // Parallel rays along x: the planes of the other axes are edge-on.
        let along = view(DVec3::new(9.0, 0.0, 0.0), DVec3::ZERO, Some(1.0));
        for axis in [1, 2] {
            let error = Factorisation::of(along, axis).unwrap_err().to_string();
            assert!(error.contains("edge-on") && error.contains(&format!("axis {axis}")), "{error}");
        }
        assert!(Factorisation::of(along, 0).is_ok());
        // The eye in the base plane.
        for axis in 0..3 {
            let mut eye = DVec3::new(3.0, 4.0, 5.0);
            eye[axis] = 0.0;
            assert!(Factorisation::of(view(eye, DVec3::splat(0.2), None), axis).is_err());
            for power in -18..2 {
                eye[axis] = 10.0_f64.powi(power);
                if let Ok(f) = Factorisation::of(view(eye, DVec3::splat(0.2), None), axis) {
                    assert!(f.warp.is_finite() && f.shear.is_finite(), "{axis} {power}: {f:?}");
                    assert!((f.scaling() * eye[axis] + 1.0).abs() < 1e-3, "{axis} {power}: {f:?}");
                }
            }
        }
        assert!(Factorisation::of(DMat4::ZERO, 1).is_err());
        assert!(Factorisation::of(along * f64::NAN, 1).is_err());
        assert!(Factorisation::of(along * f64::INFINITY, 1).is_err());
    }
}
