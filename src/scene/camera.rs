//! The camera, and the ray of each pixel.

use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};

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

/// The direction of y in clip coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClipY {
    /// y = 1 is the image's lowest row, as Vulkan has it.
    Down,
    /// y = 1 is the image's top row, as in OpenGL, Direct3D, Metal and WebGPU, and in Vulkan with a viewport of negative height.
    Up,
}

/// A camera with an image size and a clip region: defines the ray of each pixel and the part of it that is
/// drawn.
///
/// Pixel (px, py), row 0 on top, is sampled once, at its centre. With a perspective projection its ray starts
/// at the eye and runs along `ahead + x * aspect * right + y * up`; with an orthographic one it starts at `eye + x * aspect *
/// right + y * up` and runs along `forward`. Here `x = (px + 1/2 - W/2) * scale`, `y = (H/2 - py - 1/2) * scale`, and `ahead` is the
/// ray of the image's middle. The view of a camera has `ahead = forward` and `aspect = 1`; other views come from
/// [matrices](Self::from_matrices), [parts](Self::part) and [offsets](Self::offset).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    camera: Camera,
    extent: [u32; 2],
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    /// Height of a pixel: at unit depth for perspective.
    scale: f64,
    /// Width of a pixel over its height; negative where the view mirrors, and `right` points to the left.
    aspect: f64,
    /// Components along `right` and `up` of the ray of the image's middle, per unit of depth; 0 for parallel rays.
    skew: DVec2,
    clip: Clip,
    owned: Option<[DVec3; 2]>,
    /// Of a part of an image the sides of the whole, and where this one's middle lies from that one's, in pixels to the right and down.
    whole: Option<([u32; 2], DVec2)>,
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
        check_sides([width, height])?;
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
        let (aspect, skew, owned, whole) = (1.0, DVec2::ZERO, None, None);
        Ok(Self { camera, extent, right, up, forward, scale, aspect, skew, clip, owned, whole })
    }

    /// Makes the view of an engine's matrices: `projection * view` maps a world position to clip coordinates, and `y` says which way
    /// they go.
    ///
    /// The projection may be off-centre or jittered, and pixels need not be square. Its depths do not matter: they may be
    /// reversed, and the far plane infinite. The camera of a parallel projection looks along -z of the coordinates that `view` maps to, that of a
    /// perspective one along -z or +z. For a volume with a model matrix pass `view * model`: lengths, and with them extinctions, stay
    /// those of the scene. The view may mirror, as matrices of left-handed worlds do.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a number is not finite, an image side is 0 or above [`Self::MAX_SIDE`], or the matrices map no image, or
    /// one whose rows and columns are not perpendicular to 1e-5 (a skewed view, such as that of a model scaled differently along its axes).
    pub fn from_matrices(view: DMat4, projection: DMat4, y: ClipY, width: u32, height: u32) -> Result<Self> {
        let wrong = |why: &str| Err(Error::invalid("view matrices", why));
        let both = projection * view;
        let [across, down, w] = [both.row(0), both.row(1), both.row(3)];
        if ![across, down, w, view.row(2)].iter().all(|row| row.is_finite()) {
            return wrong("view, projection and their product must be finite");
        }
        let perspective = w.truncate() != DVec3::ZERO;
        // The camera looks to where w grows; along -z where w is the same everywhere.
        let back = if perspective { -w } else { view.row(2) };
        let Some(forward) = (-back.truncate()).try_normalize() else {
            return wrong("they map no image: the view's third row has no direction");
        };
        let per_depth = if perspective { w.truncate().length() } else { w.w };
        let aside = |row: DVec4| row.truncate() - forward * row.truncate().dot(forward);
        let upward = down * if y == ClipY::Up { 1.0 } else { -1.0 };
        let (Some(right), Some(up)) = (aside(across).try_normalize(), aside(upward).try_normalize()) else {
            return wrong("they map no image: x or y does not change across the view");
        };
        // Of parallel rays, which run along the axes of neither x nor y.
        let leans = |row: DVec4| row.truncate().dot(forward).abs() > 1e-5 * row.truncate().length();
        if !perspective && (leans(across) || leans(upward)) {
            return wrong("the rays of a parallel projection must run along the view's z axis");
        }
        if right.dot(up).abs() > 1e-5 {
            return wrong("they skew the image: its rows and columns must be perpendicular in the world");
        }
        // The eye, or a point of the middle ray from which depths count: x, y, and w or z are 0 there.
        let rows = [across, upward, back];
        let lengths = rows.map(|row| row.truncate().length());
        let rows = [0, 1, 2].map(|i| rows[i] / lengths[i]);
        let eye = DMat3::from_cols(rows[0].truncate(), rows[1].truncate(), rows[2].truncate())
            .transpose()
            .inverse()
            * -DVec3::new(rows[0].w, rows[1].w, rows[2].w);
        // Half of the image's sides, at unit depth for perspective.
        let half = [across, upward].map(|row| per_depth.abs() / aside(row).length());
        let skew = [across, upward]
            .map(|row| if perspective { -row.truncate().dot(forward) / aside(row).length() } else { 0.0 });
        let flip = if per_depth < 0.0 { -1.0 } else { 1.0 };
        let (right, up) = (right * flip, up * flip);
        let fits = |x: f64| x.is_finite() && x > 0.0;
        if !(eye.is_finite() && half.into_iter().all(fits)) {
            return wrong("they map no image: their inverse is not finite");
        }
        let projection = if perspective {
            Projection::Perspective { fov_y_deg: 2.0 * half[1].atan().to_degrees() }
        } else {
            Projection::Orthographic { half_height: half[1] }
        };
        check_sides([width, height])?;
        let camera = Camera { eye, target: eye + forward, up, projection };
        // Exactly at right angles.
        let plain = forward.cross(up).normalize();
        let mirrors = plain.dot(right) < 0.0;
        let scale = half[1] / (0.5 * f64::from(height));
        let aspect = half[0] / (0.5 * f64::from(width)) / scale;
        let [x, y] = skew;
        Ok(Self {
            camera,
            extent: [width, height],
            right: plain,
            up: plain.cross(forward),
            forward,
            scale,
            aspect: if mirrors { -aspect } else { aspect },
            skew: DVec2::new(if mirrors { -x } else { x }, y),
            clip: Clip::none(),
            owned: None,
            whole: None,
        })
    }

    /// Returns the view of a rectangle of the image, `corner` its left and top pixel: one tile of an image that is drawn in parts, which
    /// joins its neighbours pixel by pixel. It may reach beyond the image. Where rules of trained splats depend on the image's edges, those of
    /// the whole count; `inria` and `antialiased` cut splats off at tiles of 16 x 16 pixels, of which parts should have whole ones.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a side is 0 or above [`Self::MAX_SIDE`].
    pub fn part(&self, corner: [i32; 2], extent: [u32; 2]) -> Result<Self> {
        check_sides(extent)?;
        let middle = |axis: usize| {
            f64::from(corner[axis]) + 0.5 * (f64::from(extent[axis]) - f64::from(self.extent[axis]))
        };
        let by = DVec2::new(middle(0), middle(1));
        let (sides, from) = self.whole();
        Ok(Self { extent, whole: Some((sides, from + by)), ..self.moved(by) })
    }

    /// Returns the sides of the image that this is a part of, and where this one's middle lies from that one's, in pixels to the right and down.
    pub(crate) fn whole(&self) -> ([u32; 2], DVec2) {
        self.whole.unwrap_or((self.extent, DVec2::ZERO))
    }

    /// Returns the view whose image is moved by `pixels`, to the right and down: what was at a place p is at p + `pixels`. Fractions of
    /// a pixel jitter the samples of temporal anti-aliasing.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if an offset is not finite.
    pub fn offset(&self, pixels: DVec2) -> Result<Self> {
        let moved = self.moved(-pixels);
        if moved.skew.is_finite() && moved.camera.eye.is_finite() {
            return Ok(moved);
        }
        Err(Error::invalid("view offset", format!("{pixels}: must be finite")))
    }

    /// Returns the view whose image has its middle at another place, in pixels to the right of and below that of this image.
    fn moved(&self, by: DVec2) -> Self {
        let aside = DVec2::new(by.x * self.aspect, -by.y) * self.scale;
        if self.is_perspective() {
            return Self { skew: self.skew + aside, ..*self };
        }
        let aside = self.right * aside.x + self.up * aside.y;
        let camera =
            Camera { eye: self.camera.eye + aside, target: self.camera.target + aside, ..self.camera };
        Self { camera, ..*self }
    }

    /// Returns the view with this clip region.
    #[must_use]
    pub fn with_clip(self, clip: Clip) -> Self {
        Self { clip, ..self }
    }

    /// Returns the view of what a box owns. A grid is cut into pieces of rays as without it, and those are drawn whose middle lies in the box, or
    /// on the side where the ray enters it; a mesh is clipped to it. Images of boxes that fill space, composited in visibility order, are that of the whole scene to
    /// float32's rounding. Infinite corners own all there is.
    ///
    /// Scenes and techniques that blend otherwise are refused when the view is drawn: points, surfaces, maximum intensity projection, `shear-warp`, raster routes, and
    /// the options `resolution` and `tolerance`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if a number is NaN, or `low` is not below `high` on every axis.
    pub fn with_owned(self, low: DVec3, high: DVec3) -> Result<Self> {
        Clip::none().with_crop(low, high)?;
        Ok(Self { owned: Some([low, high]), ..self })
    }

    /// Returns the corners of [`Self::with_owned`].
    #[must_use]
    pub fn owned(&self) -> Option<[DVec3; 2]> {
        self.owned
    }

    /// Returns the view that is clipped to [`Self::with_owned`]'s box in place of owning pieces.
    pub(crate) fn clipped_to_owned(&self) -> Self {
        let Some([low, high]) = self.owned else { return *self };
        Self { clip: self.clip.cropped(low, high), owned: None, ..*self }
    }

    /// Returns the view that is clipped to that box alone.
    pub(crate) fn of_owned(&self) -> Self {
        self.with_clip(Clip::none()).clipped_to_owned()
    }

    /// Returns a view with the same size, clip region and box from another camera.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn with_camera(&self, camera: Camera) -> Result<Self> {
        let [width, height] = self.extent;
        let view = Self::new(camera, width, height)?;
        Ok(Self { clip: self.clip, owned: self.owned, ..view })
    }

    /// Returns the same view with pixels of about `side` x `side` of these: as many as its height needs, and of the same size as many as
    /// its width needs.
    pub(crate) fn reduced(&self, side: u32) -> Result<Self> {
        let [width, height] = self.extent.map(u64::from);
        let rows = height.div_ceil(u64::from(side.max(1)));
        let columns = (width * rows).div_ceil(height);
        let [columns, rows] = [columns, rows].map(|pixels| u32::try_from(pixels).unwrap_or(u32::MAX));
        check_sides([columns, rows])?;
        let larger = f64::from(self.extent[1]) / f64::from(rows);
        let fewer = |side: u32| crate::num::u32_of((f64::from(side) / larger).ceil());
        Ok(Self {
            extent: [columns, rows],
            scale: self.scale * larger,
            whole: self.whole.map(|(sides, from)| (sides.map(fewer), from / larger)),
            ..*self
        })
    }

    /// Returns the clip region.
    #[must_use]
    pub fn clip(&self) -> &Clip {
        &self.clip
    }

    /// Returns the camera. Of a view from matrices the angle or height is that of an image around the viewing direction; of a
    /// moved view with parallel rays the eye is on the ray of the image's middle.
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
        self.right * self.aspect.signum()
    }

    /// Returns the unit vector that points up in the image.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// Returns the height of a pixel: at unit depth for perspective, in world units for orthographic.
    #[must_use]
    pub fn pixel_size(&self) -> f64 {
        self.scale
    }

    /// Returns the width of a pixel over its height.
    #[must_use]
    pub fn pixel_aspect(&self) -> f64 {
        self.aspect.abs()
    }

    /// Returns by what a ray changes along x, as in the description of [`View`]; up in the image is [`Self::up`].
    pub(crate) fn across(&self) -> DVec3 {
        self.right * self.aspect
    }

    /// Returns the ray of the image's middle, at unit depth.
    pub(crate) fn ahead(&self) -> DVec3 {
        self.forward + self.right * self.skew.x + self.up * self.skew.y
    }

    /// Returns the vectors whose dot products with a position from the eye are its x, y and depth, as in the description of [`View`]; x
    /// and y times the depth for perspective. They are the dual basis of [`Self::across`], [`Self::up`] and [`Self::ahead`].
    pub(crate) fn rows(&self) -> [DVec3; 3] {
        let (right, up) = (self.right - self.forward * self.skew.x, self.up - self.forward * self.skew.y);
        [right / self.aspect, up, self.forward]
    }

    /// Returns what makes a right-angled offset of x, y and depth: `(x * aspect + depth * skew.x, y + depth * skew.y, depth)` along
    /// right, up and forward.
    pub(crate) fn shape(&self) -> (f64, DVec2) {
        (self.aspect, self.skew)
    }

    /// Returns the tangents of the angle between a pixel's ray and the viewing direction, as `x * s[0] + s[2]` and `y * s[1] + s[3]` for
    /// x and y in pixels from the image's middle, y down, up to their signs. All are 0 for parallel rays.
    pub(crate) fn slopes(&self) -> [f64; 4] {
        if !self.is_perspective() {
            return [0.0; 4];
        }
        let x = self.skew.x * self.aspect.signum();
        [self.aspect.abs() * self.scale, self.scale, x, -self.skew.y]
    }

    /// Returns half the image's sides, in pixels.
    pub(crate) fn half_extent(&self) -> [f32; 2] {
        self.extent.map(|side| crate::num::f32_of(f64::from(side) * 0.5))
    }

    /// Returns the image's sides in one word.
    pub(crate) fn sides(&self) -> u32 {
        Self::in_one_word(self.extent)
    }

    /// Returns an image's sides as `glsl/shared/sides.glsl` reads them.
    pub(crate) fn in_one_word([width, height]: [u32; 2]) -> u32 {
        width | height << 16
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
        let offset = self.across() * x + self.up * y;
        if self.is_perspective() {
            (self.camera.eye, (self.ahead() + offset).normalize())
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
        let [right, up, _] = self.rows();
        let x = relative.dot(right) / size + f64::from(self.extent[0]) * 0.5;
        let y = f64::from(self.extent[1]) * 0.5 - relative.dot(up) / size;
        Some((DVec2::new(x, y), depth))
    }
}

fn check_sides([width, height]: [u32; 2]) -> Result<()> {
    for (name, side) in [("width", width), ("height", height)] {
        if side == 0 || side > View::MAX_SIDE {
            let why = format!("{side}: must be 1 to {}", View::MAX_SIDE);
            return Err(Error::invalid(format!("image {name}"), why));
        }
    }
    Ok(())
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
