//! Depth images of the caller, and the projections that wrote them.

use ash::vk;
use ash::vk::Handle as _;
use glam::DMat4;

use super::device::Gpu;
use crate::error::{Error, Result};

/// The mapping from stored depth to depth along the view, given by the depths that are stored as 0 and as 1.
///
/// Either end may be stored as 1, and the far end of a perspective projection may be infinite: `perspective(near, far)` is
/// the usual projection, `perspective(far, near)` a reversed one, `perspective(f64::INFINITY, near)` a reversed one without
/// a far plane. A pixel that stores the far end shows no surface: images are cleared with that value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthProjection {
    pub(crate) at_zero: f64,
    pub(crate) at_one: f64,
    pub(crate) perspective: bool,
    /// Scales from view to clip coordinates along x and y, and where the viewing direction is in the image, to the right and up in half
    /// its sides; known only from a matrix.
    pub(crate) image: Option<([f64; 2], [f64; 2])>,
}

impl DepthProjection {
    /// Makes the projection of a perspective camera from the distances along the view, in world units, that are stored as
    /// 0 and as 1.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] unless both are positive and different; one may be infinite.
    pub fn perspective(at_zero: f64, at_one: f64) -> Result<Self> {
        let fits = at_zero > 0.0 && at_one > 0.0 && at_zero != at_one;
        if !fits {
            let why =
                format!("{at_zero} and {at_one}: must be positive and different, infinity for one at most");
            return Err(Error::invalid("depth projection", why));
        }
        Ok(Self { at_zero, at_one, perspective: true, image: None })
    }

    /// Makes the projection of a camera with parallel rays from the distances along the view from the camera's `eye`, in
    /// world units, that are stored as 0 and as 1. They are negative behind the eye.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] unless both are finite and different.
    pub fn orthographic(at_zero: f64, at_one: f64) -> Result<Self> {
        let fits = at_zero.is_finite() && at_one.is_finite() && at_zero != at_one;
        if !fits {
            let why = format!("{at_zero} and {at_one}: must be finite and different");
            return Err(Error::invalid("depth projection", why));
        }
        Ok(Self { at_zero, at_one, perspective: false, image: None })
    }

    /// Returns the projection in another unit of length: that of a scene whose model matrix scales by `unit`, and whose depths are `unit`
    /// times smaller than those of this projection.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] unless `unit` is positive and finite.
    pub fn in_unit(self, unit: f64) -> Result<Self> {
        if !(unit > 0.0 && unit.is_finite()) {
            return Err(Error::invalid(
                "depth projection's unit",
                format!("{unit}: must be positive and finite"),
            ));
        }
        // Parallel rays have as many pixels in a unit.
        let scales = if self.perspective { 1.0 } else { unit };
        let image = self.image.map(|(scale, middle)| (scale.map(|scale| scale * scales), middle));
        Ok(Self { at_zero: self.at_zero / unit, at_one: self.at_one / unit, image, ..self })
    }

    /// Makes a projection from a matrix that maps view coordinates to clip coordinates with depths from 0 to 1, such as
    /// [`glam::dcamera::rh::proj::vulkan::perspective_infinite_reverse`].
    ///
    /// In view coordinates x points right, y up, and the camera looks along -z or, in perspective, +z. Clip coordinates may have y up or
    /// down. Recording checks that the matrix shows what the view does.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for other matrices: oblique, without depth, or not finite.
    pub fn from_matrix(matrix: &DMat4) -> Result<Self> {
        let [x, y, z, w] = [0, 1, 2, 3].map(|i| matrix.row(i));
        let wrong = |why: &str| Err(Error::invalid("depth projection", format!("{matrix}: {why}")));
        if !matrix.is_finite() {
            return wrong("must be finite");
        }
        let straight = [x.y, y.x, z.x, z.y, w.x, w.y].iter().all(|&e| e == 0.0);
        if !straight || x.x == 0.0 || y.y == 0.0 {
            return wrong("must have x and y of its own, and a depth that does not change with them");
        }
        let scale = [x.x.abs(), y.y.abs()];
        // y may point either way in clip coordinates.
        let middle = |per_depth: f64| [x.z * x.x.signum() / per_depth, y.z * y.y.signum() / per_depth];
        if w.z != 0.0 && w.w == 0.0 {
            // Clip z = z.z v + z.w, w = w.z v, and the depth is |v|: stored = z.z / w.z + z.w / |w.z| / depth.
            let (level, rise) = (z.z / w.z, z.w / w.z.abs());
            let depth = |stored: f64| {
                let inverse = (stored - level) / rise;
                if inverse == 0.0 { f64::INFINITY } else { 1.0 / inverse }
            };
            let image = Some((scale.map(|s| s / w.z.abs()), middle(w.z)));
            return Ok(Self { image, ..Self::perspective(depth(0.0), depth(1.0))? });
        }
        if w.z == 0.0 && w.w != 0.0 {
            let depth = |stored: f64| -(stored * w.w - z.w) / z.z;
            let image = Some((scale.map(|s| s / w.w.abs()), [0.0; 2]));
            return Ok(Self { image, ..Self::orthographic(depth(0.0), depth(1.0))? });
        }
        wrong("must be a perspective or a parallel projection")
    }
}

/// A depth image that the caller owns. It hides the part of the volume behind its surfaces.
#[derive(Clone, Copy, Debug)]
pub struct DepthImage {
    pub(crate) view: vk::ImageView,
    pub(crate) format: vk::Format,
    pub(crate) extent: [u32; 2],
    /// First texel of the view's pixels, and whether others may surround them.
    pub(crate) corner: [u32; 2],
    pub(crate) in_part: bool,
    pub(crate) layout: vk::ImageLayout,
    pub(crate) projection: DepthProjection,
    pub(crate) device: vk::Device,
}

impl DepthImage {
    /// The supported formats; the device must be able to sample them.
    pub const FORMATS: [vk::Format; 6] = [
        vk::Format::D32_SFLOAT,
        vk::Format::X8_D24_UNORM_PACK32,
        vk::Format::D16_UNORM,
        vk::Format::D32_SFLOAT_S8_UINT,
        vk::Format::D24_UNORM_S8_UINT,
        vk::Format::D16_UNORM_S8_UINT,
    ];

    /// Wraps a depth image for [`Plan::record`](crate::Plan::record). `projection` is the one that wrote the image.
    ///
    /// # Safety
    ///
    /// - `view` belongs to the device of `gpu`; it is two-dimensional, with one level, one layer and only the depth aspect,
    ///   in `format` and of exactly `extent`; its image has one sample per texel and the usage `SAMPLED`;
    /// - both live until the caller has seen every submission that reads them end;
    /// - when the recorded commands run, the image is in the layout `DEPTH_READ_ONLY_OPTIMAL`, or that of
    ///   [`DepthImage::in_layout`], and its contents are available and visible to sampled reads in the compute shader
    ///   stage. The commands leave it in that layout, last read in that stage.
    #[must_use]
    pub unsafe fn from_raw(
        gpu: &Gpu,
        view: vk::ImageView,
        format: vk::Format,
        extent: [u32; 2],
        projection: DepthProjection,
    ) -> Self {
        debug_assert!(!view.is_null(), "the null view of {}", gpu.report().name);
        let layout = vk::ImageLayout::DEPTH_READ_ONLY_OPTIMAL;
        let (corner, in_part, device) = ([0; 2], false, gpu.device().handle());
        Self { view, format, extent, corner, in_part, layout, projection, device }
    }

    /// Reads the rectangle of the image that begins at this texel and has the extent of the plan's view, which `projection` maps to the
    /// rectangle alone.
    #[must_use]
    pub fn at(self, corner: [u32; 2]) -> Self {
        Self { corner, in_part: true, ..self }
    }

    /// Sets another layout for sampling, such as `SHADER_READ_ONLY_OPTIMAL`.
    #[must_use]
    pub fn in_layout(self, layout: vk::ImageLayout) -> Self {
        Self { layout, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use glam::dcamera::rh::proj::vulkan;

    /// A matrix and the two ends derived from it store the same value at a depth.
    #[test]
    fn matrices_tell_their_ends() {
        let (near, far) = (0.1, 50.0);
        let cases = [
            (vulkan::perspective(0.7, 1.5, near, far), near, far),
            (glam::dcamera::lh::proj::directx::perspective(0.7, 1.5, near, far), near, far),
            (vulkan::perspective(0.7, 1.5, far, near), far, near),
            (vulkan::perspective_infinite(0.7, 1.5, near), near, f64::INFINITY),
            (vulkan::perspective_infinite_reverse(0.7, 1.5, near), f64::INFINITY, near),
            (vulkan::orthographic(-1.5, 1.5, -1.0, 1.0, -3.0, 7.0), -3.0, 7.0),
            (vulkan::orthographic(-1.5, 1.5, -1.0, 1.0, 7.0, -3.0), 7.0, -3.0),
        ];
        for (matrix, at_zero, at_one) in cases {
            let got = DepthProjection::from_matrix(&matrix).unwrap();
            let same = |a: f64, b: f64| a == b || (a - b).abs() < 1e-9 * b.abs();
            assert!(same(got.at_zero, at_zero) && same(got.at_one, at_one), "{matrix}: {got:?}");
            // Clip coordinates of a point 2.5 away.
            let ahead = if matrix.row(3).z > 0.0 { 2.5 } else { -2.5 };
            let stored = matrix.project_point3(DVec3::new(0.0, 0.0, ahead)).z;
            let back = if got.perspective {
                1.0 / ((1.0 - stored) / got.at_zero + stored / got.at_one)
            } else {
                (1.0 - stored) * got.at_zero + stored * got.at_one
            };
            assert!((back - 2.5).abs() < 1e-9, "{matrix}: {back}");
        }
    }

    #[test]
    fn what_is_no_projection_is_refused() {
        let why = |result: Result<DepthProjection>| result.unwrap_err().to_string();
        assert!(why(DepthProjection::perspective(0.0, 1.0)).contains("positive"));
        assert!(why(DepthProjection::perspective(f64::INFINITY, f64::INFINITY)).contains("different"));
        assert!(why(DepthProjection::perspective(f64::NAN, 1.0)).contains("positive"));
        assert!(why(DepthProjection::orthographic(1.0, f64::INFINITY)).contains("finite"));
        assert!(why(DepthProjection::from_matrix(&DMat4::ZERO)).contains("of its own"));
        let mut oblique = vulkan::perspective(0.7, 1.0, 0.1, 9.0);
        oblique.x_axis.z = 0.2;
        assert!(why(DepthProjection::from_matrix(&oblique)).contains("does not change"));
        assert!(why(DepthProjection::from_matrix(&(DMat4::IDENTITY * f64::NAN))).contains("finite"));
    }
}
