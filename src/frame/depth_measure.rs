//! The unit and the origin in which a technique measures depth along rays.

use glam::DVec3;

use crate::resident::local_space::LocalSpace;
use crate::scene::{Grid, View};

/// Depth is the distance from the plane through `centre` along the viewing direction, in multiples of `unit`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthMeasure {
    pub(crate) centre: DVec3,
    /// Length in world units.
    pub(crate) unit: f64,
}

impl DepthMeasure {
    /// Measures from the middle of a grid, in its smallest voxel spacing.
    pub(crate) fn of_grid(grid: &Grid) -> Self {
        Self { centre: grid.centre(), unit: grid.spacing().min_element() }
    }

    /// Measures from the centre of a local space, in its radius.
    pub(crate) fn of_frame(frame: &LocalSpace) -> Self {
        Self { centre: frame.centre, unit: frame.radius }
    }

    /// Returns the rays of a view.
    pub(crate) fn rays(&self, view: &View) -> PixelRays {
        let eye = view.camera().eye;
        let centre_depth = (self.centre - eye).dot(view.forward());
        let foot = eye + view.ahead() * centre_depth - self.centre;
        let (kq, scale) = match view.is_perspective() {
            true => (centre_depth / self.unit, view.pixel_size()),
            false => (1.0, view.pixel_size() / self.unit),
        };
        PixelRays { foot, kq, scale, centre_depth }
    }
}

/// The rays of a view's pixels in a technique's measure. The ray of the pixel (x, y), x to the right and y up from the image's
/// middle, is at `foot / unit + z ahead + (kq + kd z) scale (x across + y up)` from the centre at depth z, with the vectors of the view. `kd`
/// is 1 in perspective and 0 for parallel rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelRays {
    /// The point where the ray of the image's middle meets the centre plane, relative to the centre, world units.
    pub(crate) foot: DVec3,
    /// Weight of the pixel offset at depth 0: the depth of the centre from the eye in perspective, 1 for parallel rays.
    pub(crate) kq: f64,
    /// Side of a pixel per unit of `kq + kd z`.
    pub(crate) scale: f64,
    /// Depth of the centre from the eye, world units.
    pub(crate) centre_depth: f64,
}
