//! The camera, and the ray of each pixel.

use glam::{DVec2, DVec3};

use super::Clip;
use crate::error::{Error, Result};

/// Selects how depth affects size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Rays start at the eye.
    Perspective {
        /// Full vertical angle of view, in degrees, in (0, 180).
        fov_y_deg: f64,
    },
    /// Parallel rays over all real t.
    Orthographic {
        /// Half of the image's height, in world units, positive.
        half_height: f64,
    },
}

/// Describes the viewpoint. Pixels are square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position of the eye, world units. May lie inside the data.
    pub eye: DVec3,
    /// A point on the optical axis, world units.
    pub target: DVec3,
    /// A direction that points up in the image; need not be perpendicular to the viewing direction.
    pub up: DVec3,
    /// The projection.
    pub projection: Projection,
}

impl Camera {
    /// Returns the camera whose image shows things `factor` times as large, from the same eye.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the factor is not positive and finite.
    pub fn zoomed(&self, factor: f64) -> Result<Self> {
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(Error::invalid("zoom", format!("{factor}: must be positive and finite")));
        }
        let projection = match self.projection {
            Projection::Perspective { fov_y_deg } => {
                let half = ((0.5 * fov_y_deg.to_radians()).tan() / factor).atan();
                Projection::Perspective { fov_y_deg: 2.0 * half.to_degrees() }
            }
            Projection::Orthographic { half_height } => {
                Projection::Orthographic { half_height: half_height / factor }
            }
        };
        Ok(Self { projection, ..*self })
    }

    /// Returns the camera rotated by `degrees` about the axis `up` through the target, counter-clockwise seen
    /// from above.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if `up` has no length.
    pub fn orbit(&self, degrees: f64) -> Result<Self> {
        let axis = self.up.try_normalize().ok_or_else(|| Error::invalid("camera up", "has no length"))?;
        let rotation = glam::DQuat::from_axis_angle(axis, degrees.to_radians());
        Ok(Self { eye: self.target + rotation * (self.eye - self.target), ..*self })
    }
}

/// A camera with an image size and a clip region: defines the ray of each pixel and the part of it that is
/// drawn.
///
/// Pixel (px, py), row 0 on top, is sampled once, at its centre. With a perspective projection its ray starts
/// at the eye and runs along `forward + x * right + y * up`; with an orthographic one it starts at `eye + x *
/// right + y * up` and runs along `forward`. Here `x = (px + 1/2 - W/2) * scale` and `y = (H/2 - py - 1/2) *
/// scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    camera: Camera,
    extent: [u32; 2],
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    scale: f64,
    clip: Clip,
}

impl View {
    /// Largest image side, in pixels.
    pub const MAX_SIDE: u32 = 32768;

    /// The angle of view that a perspective image stays below, in degrees.
    pub const MAX_FOV: f64 = 180.0;

    /// Checks camera and size and derives the axes of the view.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a number is not finite, eye and target coincide, `up` is parallel to the viewing
    /// direction, an angle or a height is out of range, or an image side is 0 or above [`Self::MAX_SIDE`].
    pub fn new(camera: Camera, width: u32, height: u32) -> Result<Self> {
        for (name, side) in [("width", width), ("height", height)] {
            if side == 0 || side > Self::MAX_SIDE {
                let why = format!("{side}: must be 1 to {}", Self::MAX_SIDE);
                return Err(Error::invalid(format!("image {name}"), why));
            }
        }
        for (name, v) in [("eye", camera.eye), ("target", camera.target), ("up", camera.up)] {
            if !v.is_finite() {
                return Err(Error::invalid(format!("camera {name}"), format!("{v}: must be finite")));
            }
        }
        let forward = (camera.target - camera.eye)
            .try_normalize()
            .ok_or_else(|| Error::invalid("camera", "eye and target coincide"))?;
        // Its length is the sine of the angle between the viewing direction and up, whatever the length of
        // up.
        let right = camera
            .up
            .try_normalize()
            .map(|up| forward.cross(up))
            .filter(|right| right.length() > 1e-9)
            .ok_or_else(|| {
                let rule = "must have a length and not be parallel to the view";
                Error::invalid("camera up", format!("{}: {rule}", camera.up))
            })?
            .normalize();
        let half_rows = f64::from(height) * 0.5;
        let check = |name: &str, value: f64, fits: bool, rule: &str| {
            let error = || Error::invalid(format!("camera {name}"), format!("{value}: {rule}"));
            if fits { Ok(()) } else { Err(error()) }
        };
        let scale = match camera.projection {
            Projection::Perspective { fov_y_deg: angle } => {
                let fits = angle > 0.0 && angle < Self::MAX_FOV;
                check("fov_y_deg", angle, fits, "must lie between 0 and 180, exclusive")?;
                (angle.to_radians() * 0.5).tan() / half_rows
            }
            Projection::Orthographic { half_height: height } => {
                let fits = height > 0.0 && height.is_finite();
                check("half_height", height, fits, "must be positive and finite")?;
                height / half_rows
            }
        };
        let (extent, up, clip) = ([width, height], right.cross(forward), Clip::none());
        Ok(Self { camera, extent, right, up, forward, scale, clip })
    }

    /// Returns the view with this clip region.
    #[must_use]
    pub fn with_clip(self, clip: Clip) -> Self {
        Self { clip, ..self }
    }

    /// Returns a view with the same size and clip region from another camera.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn with_camera(&self, camera: Camera) -> Result<Self> {
        let [width, height] = self.extent;
        Ok(Self::new(camera, width, height)?.with_clip(self.clip))
    }

    /// Returns the same view with pixels of about `side` x `side` of these: as many as its height needs, and of the same size as many as
    /// its width needs.
    pub(crate) fn reduced(&self, side: u32) -> Result<Self> {
        let [width, height] = self.extent.map(u64::from);
        let rows = height.div_ceil(u64::from(side.max(1)));
        let columns = (width * rows).div_ceil(height);
        let [columns, rows] = [columns, rows].map(|pixels| u32::try_from(pixels).unwrap_or(u32::MAX));
        Ok(Self::new(self.camera, columns, rows)?.with_clip(self.clip))
    }

    /// Returns the clip region.
    #[must_use]
    pub fn clip(&self) -> &Clip {
        &self.clip
    }

    /// Returns the camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns image width and height, in pixels.
    #[must_use]
    pub fn extent(&self) -> [u32; 2] {
        self.extent
    }

    /// Returns the unit vector of the viewing direction.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        self.forward
    }

    /// Returns the unit vector that points to the right in the image.
    #[must_use]
    pub fn right(&self) -> DVec3 {
        self.right
    }

    /// Returns the unit vector that points up in the image.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// Returns the side of a pixel: at unit depth for perspective, in world units for orthographic.
    #[must_use]
    pub fn pixel_size(&self) -> f64 {
        self.scale
    }

    /// Returns whether rays start at the eye.
    #[must_use]
    pub fn is_perspective(&self) -> bool {
        matches!(self.camera.projection, Projection::Perspective { .. })
    }

    /// Returns start and unit direction of the ray through a position in the image.
    ///
    /// `pixel` is in pixels from the top left corner; pixel centres are at half-integers.
    #[must_use]
    pub fn ray(&self, pixel: DVec2) -> (DVec3, DVec3) {
        let x = (pixel.x - f64::from(self.extent[0]) * 0.5) * self.scale;
        let y = (f64::from(self.extent[1]) * 0.5 - pixel.y) * self.scale;
        let offset = self.right * x + self.up * y;
        if self.is_perspective() {
            (self.camera.eye, (self.forward + offset).normalize())
        } else {
            (self.camera.eye + offset, self.forward)
        }
    }

    /// Projects a world position: returns its place in the image and its depth along the viewing direction.
    ///
    /// The place is in pixels from the top left corner. Returns `None` for a position at or behind the eye of
    /// a perspective view.
    #[must_use]
    pub fn project(&self, position: DVec3) -> Option<(DVec2, f64)> {
        let relative = position - self.camera.eye;
        let depth = relative.dot(self.forward);
        if self.is_perspective() && depth <= 0.0 {
            return None;
        }
        let size = if self.is_perspective() { self.scale * depth } else { self.scale };
        let x = relative.dot(self.right) / size + f64::from(self.extent[0]) * 0.5;
        let y = f64::from(self.extent[1]) * 0.5 - relative.dot(self.up) / size;
        Some((DVec2::new(x, y), depth))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(projection: Projection) -> Camera {
        Camera { eye: DVec3::new(2.0, 1.5, 3.8), target: DVec3::ZERO, up: DVec3::Y, projection }
    }

    #[test]
    fn pixel_centres_follow_the_stated_formula() {
        let view = View::new(camera(Projection::Perspective { fov_y_deg: 42.0 }), 512, 256).unwrap();
        let (px, py) = (100.0, 30.0);
        let u = 2.0 * (px + 0.5) / 512.0 - 1.0;
        let v = 1.0 - 2.0 * (py + 0.5) / 256.0;
        let t = 21.0_f64.to_radians().tan();
        let expected = (view.forward() + view.right() * (u * 2.0 * t) + view.up() * (v * t)).normalize();
        let (origin, direction) = view.ray(DVec2::new(px + 0.5, py + 0.5));
        assert_eq!(origin, view.camera().eye);
        assert!((direction - expected).length() < 1e-15);
    }

    #[test]
    fn project_inverts_ray_and_the_top_row_is_up() {
        for projection in
            [Projection::Perspective { fov_y_deg: 42.0 }, Projection::Orthographic { half_height: 1.6 }]
        {
            let view = View::new(camera(projection), 64, 48).unwrap();
            let pixel = DVec2::new(3.25, 40.5);
            let (origin, direction) = view.ray(pixel);
            let (back, depth) = view.project(origin + direction * 3.0).unwrap();
            assert!((back - pixel).length() < 1e-11, "{projection:?}: {back}");
            assert!(depth > 0.0);
            let (above, _) = view.project(view.camera().up * 0.1).unwrap();
            let (below, _) = view.project(view.camera().up * -0.1).unwrap();
            assert!(above.y < below.y);
        }
    }

    #[test]
    fn refuses_frames_that_do_not_exist() {
        let good = camera(Projection::Perspective { fov_y_deg: 42.0 });
        let why = |camera, w, h| View::new(camera, w, h).unwrap_err().to_string();
        assert!(why(good, 0, 4).contains("width"));
        assert!(why(Camera { eye: good.target, ..good }, 4, 4).contains("coincide"));
        assert!(why(Camera { up: good.eye, ..good }, 4, 4).contains("parallel"));
        assert!(why(Camera { up: DVec3::ZERO, ..good }, 4, 4).contains("length"));
        assert!(why(camera(Projection::Perspective { fov_y_deg: 180.0 }), 4, 4).contains("fov_y_deg"));
        assert!(
            why(camera(Projection::Orthographic { half_height: f64::NAN }), 4, 4).contains("half_height")
        );
        assert!(why(Camera { eye: DVec3::NAN, ..good }, 4, 4).contains("eye"));
    }

    #[test]
    fn orbit_keeps_distance_and_height() {
        let start = camera(Projection::Perspective { fov_y_deg: 42.0 });
        let turned = start.orbit(90.0).unwrap();
        assert!((turned.eye - DVec3::new(3.8, 1.5, -2.0)).length() < 1e-12, "{}", turned.eye);
    }
}
