//! Views: camera, image size and clipping.

use glam::{DMat4, DVec3};

use super::argument::{Structure, choice};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Camera, Clip, ClipY, Projection, View};

/// Kind of a projection.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_projection {
    /// Rays start at the eye.
    VR_PROJECTION_PERSPECTIVE = 1,
    /// Rays are parallel, and also show what lies behind the eye.
    VR_PROJECTION_ORTHOGRAPHIC = 2,
    /// view_matrix and projection_matrix map to clip coordinates whose y = 1 is the image's lowest row, as Vulkan has it. eye, target,
    /// up, fov_y_deg and half_height are ignored.
    VR_PROJECTION_MATRICES_Y_DOWN = 3,
    /// The same with y = 1 at the image's top row, as in OpenGL, Direct3D, Metal and WebGPU.
    VR_PROJECTION_MATRICES_Y_UP = 4,
}

/// A clip plane. It removes the side that its normal points away from.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct vr_clip_plane {
    /// A point of the plane, world units.
    pub point: [f64; 3],
    /// Normal, which points to the side that is kept; of any length but 0.
    pub normal: [f64; 3],
}

/// A camera, the size of its image, and the clipping of the volume. Row 0 is on top. Pixels are square, but for matrices.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_view {
    /// sizeof(vr_view).
    pub struct_size: usize,
    /// Position of the eye, world units. May lie inside the data.
    pub eye: [f64; 3],
    /// A point straight ahead.
    pub target: [f64; 3],
    /// A direction that points up in the image; it need not be perpendicular to the view.
    pub up: [f64; 3],
    /// A vr_projection.
    pub projection: u32,
    /// Image width, in pixels: 1 to 32768.
    pub width: u32,
    /// Image height, in pixels: 1 to 32768.
    pub height: u32,
    /// Number of clip_planes, at most 6.
    pub clip_plane_count: u32,
    /// Full vertical angle of view of a perspective projection, in degrees, between 0 and 180.
    pub fov_y_deg: f64,
    /// Half of the image's height in an orthographic projection, in world units.
    pub half_height: f64,
    /// Clip planes. Every technique cuts rays exactly there.
    pub clip_planes: [vr_clip_plane; 6],
    /// Least corner of the crop box, whose sides are parallel to the world's axes; nothing is drawn outside. Minus infinity
    /// leaves a side open. Both corners all 0: no box.
    pub crop_low: [f64; 3],
    /// Greatest corner of the crop box; infinity leaves a side open.
    pub crop_high: [f64; 3],
    /// Matrix from world to view coordinates, column by column; times a model matrix of the volume where it has one: lengths and
    /// extinctions stay those of the scene. A parallel projection looks along -z of view coordinates, a perspective one along -z or +z.
    pub view_matrix: [f64; 16],
    /// Matrix from view to clip coordinates, column by column. It may be off-centre, jittered, and have any depths, reversed and infinite
    /// ones too.
    pub projection_matrix: [f64; 16],
}

// SAFETY: repr(C), numbers, the first its size.
unsafe impl Structure for vr_view {}

impl vr_view {
    pub(super) fn view(&self) -> Result<View> {
        let by_camera = |projection| {
            let camera =
                Camera { eye: self.eye.into(), target: self.target.into(), up: self.up.into(), projection };
            View::new(camera, self.width, self.height)
        };
        let by_matrices = |y| {
            let [view, projection] = [&self.view_matrix, &self.projection_matrix].map(DMat4::from_cols_array);
            View::from_matrices(view, projection, y, self.width, self.height)
        };
        let kinds: [&dyn Fn() -> Result<View>; 4] = [
            &|| by_camera(Projection::Perspective { fov_y_deg: self.fov_y_deg }),
            &|| by_camera(Projection::Orthographic { half_height: self.half_height }),
            &|| by_matrices(ClipY::Down),
            &|| by_matrices(ClipY::Up),
        ];
        let view = choice(self.projection, 1, &kinds, "projection")?()?;
        let planes = self.clip_planes.get(..num::index(self.clip_plane_count)).ok_or_else(|| {
            Error::invalid("clip_plane_count", format!("{}: at most 6 are taken", self.clip_plane_count))
        })?;
        let mut clip = Clip::none();
        for plane in planes {
            clip = clip.with_plane(plane.point.into(), plane.normal.into())?;
        }
        if self.crop_low != [0.0; 3] || self.crop_high != [0.0; 3] {
            clip = clip.with_crop(self.crop_low.into(), self.crop_high.into())?;
        }
        Ok(view.with_clip(clip))
    }

    /// Converts a camera's view, the inverse of [`Self::view`]; `struct_size` stays 0.
    pub(super) fn of(view: &View) -> Self {
        let camera = view.camera();
        let (projection, fov_y_deg, half_height) = match camera.projection {
            Projection::Perspective { fov_y_deg } => {
                (vr_projection::VR_PROJECTION_PERSPECTIVE, fov_y_deg, 0.0)
            }
            Projection::Orthographic { half_height } => {
                (vr_projection::VR_PROJECTION_ORTHOGRAPHIC, 0.0, half_height)
            }
        };
        let mut clip_planes = [vr_clip_plane::default(); Clip::MAX_PLANES];
        for (place, plane) in clip_planes.iter_mut().zip(view.clip().planes()) {
            *place = vr_clip_plane { point: plane.point.into(), normal: plane.normal.into() };
        }
        let [crop_low, crop_high] = view.clip().crop().unwrap_or([DVec3::ZERO; 2]);
        let [width, height] = view.extent();
        Self {
            struct_size: 0,
            eye: camera.eye.into(),
            target: camera.target.into(),
            up: camera.up.into(),
            projection: projection as u32,
            width,
            height,
            clip_plane_count: num::count(view.clip().planes().count()),
            fov_y_deg,
            half_height,
            clip_planes,
            crop_low: crop_low.into(),
            crop_high: crop_high.into(),
            view_matrix: [0.0; 16],
            projection_matrix: [0.0; 16],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain() -> vr_view {
        vr_view {
            struct_size: size_of::<vr_view>(),
            eye: [1.0, 2.0, 3.0],
            target: [0.0; 3],
            up: [0.0, 1.0, 0.0],
            projection: vr_projection::VR_PROJECTION_PERSPECTIVE as u32,
            width: 40,
            height: 30,
            clip_plane_count: 0,
            fov_y_deg: 50.0,
            half_height: 2.0,
            clip_planes: [vr_clip_plane::default(); 6],
            crop_low: [0.0; 3],
            crop_high: [0.0; 3],
            view_matrix: [0.0; 16],
            projection_matrix: [0.0; 16],
        }
    }

    /// Matrices make the same view in C as in Rust, for both directions of y; unset ones are refused.
    #[test]
    fn matrices_are_read_column_by_column() {
        let world = glam::dcamera::rh::view::look_at_mat4(DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO, DVec3::Y);
        let mut projection = glam::dcamera::rh::proj::vulkan::perspective_infinite_reverse(0.7, 1.5, 0.1);
        projection.z_axis.x = 0.2;
        let codes =
            [vr_projection::VR_PROJECTION_MATRICES_Y_DOWN, vr_projection::VR_PROJECTION_MATRICES_Y_UP];
        for (code, y) in codes.into_iter().zip([ClipY::Down, ClipY::Up]) {
            let given = vr_view { projection: code as u32, ..plain() };
            assert!(given.view().unwrap_err().to_string().contains("no image"));
            let matrices = vr_view {
                view_matrix: world.to_cols_array(),
                projection_matrix: projection.to_cols_array(),
                ..given
            };
            assert_eq!(matrices.view().unwrap(), View::from_matrices(world, projection, y, 40, 30).unwrap());
        }
    }

    #[test]
    fn there_and_back_is_the_same_view() {
        let mut views = vec![plain()];
        views.push(vr_view { projection: vr_projection::VR_PROJECTION_ORTHOGRAPHIC as u32, ..plain() });
        let mut cut = plain();
        cut.clip_plane_count = 2;
        cut.clip_planes[0] = vr_clip_plane { point: [0.1, 0.2, 0.3], normal: [1.0, 0.0, 0.0] };
        cut.clip_planes[1] = vr_clip_plane { point: [0.4, 0.5, 0.6], normal: [0.0, 0.0, -2.0] };
        // Beyond the count, hence ignored.
        cut.clip_planes[2] = vr_clip_plane { point: [f64::NAN; 3], normal: [0.0; 3] };
        cut.crop_low = [-1.0, f64::NEG_INFINITY, -1.0];
        cut.crop_high = [1.0; 3];
        views.push(cut);
        for (i, given) in views.iter().enumerate() {
            let view = given.view().unwrap();
            assert_eq!(view.extent(), [40, 30]);
            assert_eq!(view.clip().planes().count(), if i == 2 { 2 } else { 0 });
            assert_eq!(view.clip().crop().is_some(), i == 2);
            assert_eq!(vr_view::of(&view).view().unwrap(), view, "{i}");
        }
        assert_eq!(views[0].view().unwrap().camera().eye, DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(views[0].view().unwrap().camera().projection, Projection::Perspective { fov_y_deg: 50.0 });
        assert_eq!(
            views[1].view().unwrap().camera().projection,
            Projection::Orthographic { half_height: 2.0 }
        );
    }

    #[test]
    fn what_is_no_view_is_refused() {
        let why = |view: vr_view| view.view().unwrap_err().to_string();
        assert!(why(vr_view { projection: 0, ..plain() }).contains("projection: 0"));
        assert!(why(vr_view { clip_plane_count: 7, ..plain() }).contains("at most 6"));
        assert!(why(vr_view { clip_plane_count: 1, ..plain() }).contains("normal"));
        assert!(why(vr_view { crop_low: [1.0; 3], ..plain() }).contains("crop"));
        assert!(why(vr_view { width: 0, ..plain() }).contains("width"));
        assert!(why(vr_view { up: [0.0; 3], ..plain() }).contains("up"));
    }
}
