//! Sums of kernels and the models that integrate them along a ray.

/// Sums over the kernels at a place. Density model: extinction and emission. Interpolation model: weight and
/// weighted scalar.
pub(super) type Sums = [f64; 4];

/// Integrates light along a ray, front to back.
pub(super) trait Medium {
    /// Adds a segment of the ray on which the sums are smooth, at or behind the end of the previous one.
    ///
    /// Over a length of `scale`, the sums vary at most as a Gaussian does over one standard deviation.
    fn add(&mut self, from: f64, to: f64, scale: f64, sums: &impl Fn(f64) -> Sums);

    /// Returns whether overlapping kernels with these values are invisible at every place.
    fn is_vacuum(&self, values: impl Iterator<Item = Sums>) -> bool;

    /// Returns whether the rest of the ray is invisible.
    fn is_opaque(&self) -> bool;
}
