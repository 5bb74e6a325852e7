//! Kernels of one coordinate.

use std::f64::consts::PI;

/// Returns the cubic B-spline of unit mass.
pub(crate) fn cubic(x: f64) -> f64 {
    let x = x.abs();
    if x < 1.0 { 2.0 / 3.0 + x * x * (0.5 * x - 1.0) } else { (2.0 - x).max(0.0).powi(3) / 6.0 }
}

/// Returns the sinc with Lanczos' window of three lobes.
pub(crate) fn lanczos(x: f64) -> f64 {
    let sinc = |x: f64| if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
    if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 }
}
