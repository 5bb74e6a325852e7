//! The rays of a view in a grid's index space, as `glsl/grid/grid.glsl` reads them.

use glam::{DMat3, DVec3};

use crate::scene::grid::turned;
use crate::scene::{Grid, View};

/// `p(z) = q + z d` with `q = q0 + kq (x px + y py)` and `d = d0 + kd (x px + y py)`: z is the depth
/// from the plane through the domain's centre, world units; positions are indices from that centre; x and y are
/// pixels from the image's centre, y down. The device reads depth in voxel spacings (`grid/cut.rs`).
///
/// Everything is derived in float64. The numbers on the device have the magnitude of the grid, so that neither
/// a far eye nor a small angle costs digits there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GridRays {
    pub(crate) q0: DVec3,
    pub(crate) px: DVec3,
    pub(crate) py: DVec3,
    pub(crate) d0: DVec3,
    pub(crate) kq: f64,
    pub(crate) kd: f64,
    /// Depth of the eye, world units; minus infinity for parallel rays.
    pub(crate) near: f64,
    /// Depths, world units, between which the domain lies in front of the eye; an empty interval when it lies behind.
    pub(crate) depths: [f64; 2],
}

impl GridRays {
    /// Derives the rays in the index space of a grid.
    pub(crate) fn new(grid: &Grid, view: &View) -> Self {
        let centre = grid.centre();
        let corners = grid.corners().map(|corner| corner - centre);
        Self::of(grid.index_to_world().inverse(), centre, &corners, view)
    }

    /// Derives the rays in any affine space: `to_index` maps offsets from `centre` to it, and `corners` are such offsets.
    pub(crate) fn of(to_index: DMat3, centre: DVec3, corners: &[DVec3], view: &View) -> Self {
        let scale = view.pixel_size();
        let eye = view.camera().eye;
        let centre_depth = (centre - eye).dot(view.forward());
        // The point where the ray of the image's centre meets the centre plane, relative to the domain's centre, so that no large
        // numbers cancel.
        let foot = eye + view.ahead() * centre_depth - centre;
        let (kq, kd, near) = if view.is_perspective() {
            (centre_depth, 1.0, -centre_depth)
        } else {
            (1.0, 0.0, f64::NEG_INFINITY)
        };
        let half = corners.iter().map(|corner| corner.dot(view.forward()).abs()).fold(0.0, f64::max);
        Self {
            q0: to_index * foot,
            px: to_index * view.across() * scale,
            py: to_index * view.up() * -scale,
            d0: to_index * view.ahead(),
            kq,
            kd,
            near,
            depths: [near.max(-half), half],
        }
    }
}

impl GridRays {
    /// Returns the rays with index axes in the order of a stack along `axis`.
    pub(crate) fn turned(self, axis: usize) -> Self {
        let turn = |v: DVec3| DVec3::from_array(turned(v.to_array(), axis));
        Self { q0: turn(self.q0), px: turn(self.px), py: turn(self.py), d0: turn(self.d0), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, Field, Projection};
    use glam::DVec2;

    /// The formula gives the same positions as the camera, for both projections and a sheared,
    /// mirrored lattice.
    #[test]
    fn index_space_rays_are_the_camera_s_rays() {
        let direction =
            DMat3::from_cols(DVec3::new(0.0, 1.0, 0.1), DVec3::new(1.0, 0.0, 0.0), DVec3::new(0.2, 0.0, 1.5));
        let grid = Field::Ramp.sample([5, 6, 7], "f32").unwrap();
        let grid =
            grid.with_placement(DVec3::new(0.5, 0.25, 2.0), DVec3::new(3.0, -1.0, 9.0), direction).unwrap();
        for projection in
            [Projection::Perspective { fov_y_deg: 50.0 }, Projection::Orthographic { half_height: 4.0 }]
        {
            let camera =
                Camera { eye: DVec3::new(9.0, 8.0, -20.0), target: grid.centre(), up: DVec3::Y, projection };
            let view = View::new(camera, 30, 20).unwrap();
            let rays = GridRays::new(&grid, &view);
            for pixel in [DVec2::new(0.5, 0.5), DVec2::new(15.0, 10.0), DVec2::new(29.5, 3.5)] {
                let (x, y) = (pixel.x - 15.0, pixel.y - 10.0);
                let lateral = rays.px * x + rays.py * y;
                for z in [-3.0, 0.0, 2.5] {
                    let index = rays.q0 + lateral * rays.kq + (rays.d0 + lateral * rays.kd) * z;
                    let index = index + grid.last_index() * 0.5;
                    let (back, _) = view.project(grid.world_of_index(index)).unwrap();
                    assert!((back - pixel).length() < 1e-9, "{projection:?} {pixel} {z}: {back}");
                }
            }
        }
    }
}
