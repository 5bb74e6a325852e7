//! Depth along rays in a technique's own unit.

use glam::DVec3;

use crate::resident::local_space::LocalSpace;
use crate::scene::{Grid, View};

/// How a technique measures depth: from the plane through a point, in a unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthMeasure {
    pub(crate) centre: DVec3,
    /// World length.
    pub(crate) unit: f64,
}

impl DepthMeasure {
    /// In voxel spacings from the middle of a grid.
    pub(crate) fn of_grid(grid: &Grid) -> Self {
        Self { centre: grid.centre(), unit: grid.spacing().min_element() }
    }

    /// In radii from a centre.
    pub(crate) fn of_frame(frame: &LocalSpace) -> Self {
        Self { centre: frame.centre, unit: frame.radius }
    }
}

/// The lines of a view's pixels, in a technique's measure: at depth z that of a pixel, x to the right and y up from the image's
/// middle, is at `foot / unit + z forward + (kq + kd z) scale (x right + y up)` from the centre, kd 1 in perspective and else 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelLines {
    /// The centre plane's point on the line of the image's middle, from the centre, world units.
    pub(crate) foot: DVec3,
    pub(crate) kq: f64,
    pub(crate) scale: f64,
    /// Depth of the centre from the eye, world units.
    pub(crate) centre_depth: f64,
}

impl DepthMeasure {
    pub(crate) fn lines(&self, view: &View) -> PixelLines {
        let eye = view.camera().eye;
        let centre_depth = (self.centre - eye).dot(view.forward());
        let foot = eye + view.forward() * centre_depth - self.centre;
        let (kq, scale) = match view.is_perspective() {
            true => (centre_depth / self.unit, view.pixel_size()),
            false => (1.0, view.pixel_size() / self.unit),
        };
        PixelLines { foot, kq, scale, centre_depth }
    }
}
