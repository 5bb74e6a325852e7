//! Sizes of kernels: the world length of a step, and standard deviations.

use crate::error::{Error, Result};
use crate::scene::grid::diagonal;
use crate::scene::{Grid, KernelSize, Points};

/// Returns the smallest distance of samples along an axis that has several.
pub(crate) fn smallest_spacing(grid: &Grid) -> f64 {
    let spacing = grid.spacing().to_array();
    let dims = grid.dims();
    let several = dims.iter().zip(spacing).filter(|(n, _)| **n > 1).map(|(_, s)| s);
    several.reduce(f64::min).unwrap_or_else(|| diagonal(grid).max(1.0))
}

/// Returns the standard deviations of all points, visible or not.
///
/// Of a covariance it is an upper bound over all axes, the root of the trace.
pub(crate) fn sigmas(points: &Points) -> Box<dyn Iterator<Item = f64> + '_> {
    match points.size() {
        KernelSize::Unknown => Box::new(std::iter::empty()),
        KernelSize::Radius(radius) => Box::new(std::iter::once(*radius / 3.0)),
        KernelSize::Radii(radii) => {
            Box::new(radii.iter().map(|&r| f64::from(r) / 3.0).filter(|r| r.is_finite()))
        }
        KernelSize::Covariances(all) => Box::new(all.iter().filter_map(|c| {
            let trace = f64::from(c[0]) + f64::from(c[3]) + f64::from(c[5]);
            (trace >= 0.0).then(|| trace.sqrt())
        })),
    }
}

/// Returns the median standard deviation of points.
///
/// # Errors
///
/// [`Error::Invalid`] where no point has a size.
pub(crate) fn median_sigma(points: &Points) -> Result<f64> {
    let mut all: Vec<f64> = sigmas(points).filter(|&sigma| sigma > 0.0).collect();
    if all.is_empty() {
        return Err(Error::invalid("points", "none has a size: a radius or covariances must be given"));
    }
    let middle = all.len() / 2;
    Ok(*all.select_nth_unstable_by(middle, f64::total_cmp).1)
}
