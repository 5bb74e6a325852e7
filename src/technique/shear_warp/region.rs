//! The part of the image that one base plane shows, and the factorisation of the view for it.

use glam::{DMat3, DMat4, DVec2, DVec3};

use crate::error::{Error, Result};
use crate::num;
use crate::scene::grid::turned;
use crate::scene::{Grid, View};
use crate::technique::grid::slices_2d::planes;
use crate::technique::shear_warp::base_plane::BasePlane;
use crate::technique::shear_warp::factorisation::Factorisation;
use crate::technique::shear_warp::options::Intermediate;

/// Steepest shear of one base plane, per unit of length along the stack, along either of the other axes' normals.
pub(crate) const MOST_SHEAR: f64 = 1.2;

/// How far pyramids reach over their seams, so that rounding loses no pixel there.
pub(super) const SEAM: f64 = 1.0 + 1e-6;

/// Smallest visible depth in front of the eye, relative to half the stack and one slice.
const NEAREST: f64 = 1e-9;

/// Texels around the region that is drawn, for the warp's filter.
pub(super) const MARGIN: f64 = 2.0;

/// Largest width of a texel in pixels where the resolution is automatic.
const COARSEST: f64 = 3.0;

/// A view of a grid in its own index space.
pub(super) struct GridView<'a> {
    pub(super) grid: &'a Grid,
    pub(super) view: &'a View,
    /// Unit normals of the planes of each axis, along which indices grow.
    pub(super) normals: [DVec3; 3],
    /// Half the image's sides, pixels.
    pub(super) half_image: DVec2,
}

/// A convex polygon of the image, in pixels from its centre.
type Polygon = Vec<DVec2>;

/// Clips a convex polygon to the half-plane `side . (x, y, 1) >= 0`.
fn clip(polygon: &[DVec2], side: DVec3) -> Polygon {
    let at = |p: &DVec2| side.dot(p.extend(1.0));
    let mut kept = Polygon::new();
    for (i, p) in polygon.iter().enumerate() {
        let next = &polygon[(i + 1) % polygon.len()];
        let (here, there) = (at(p), at(next));
        if here >= 0.0 {
            kept.push(*p);
        }
        if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
            kept.push(*p + (*next - *p) * (here / (here - there)));
        }
    }
    kept
}

/// The region of the image that one base plane shows.
pub(super) struct Region {
    axis: usize,
    sign: f64,
    factors: Factorisation,
    /// The base plane's distance along the axis from the domain's centre.
    base: f64,
    /// Distance along the axis of the slice that sets the size of voxels.
    front: f64,
    /// Maps pixels, `(x, y, 1)`, to the base plane; the last coordinate is positive in front of the eye.
    to_base: DMat3,
    steepness: DMat3,
    polygon: Polygon,
}

impl GridView<'_> {
    /// The view as a matrix from indices, from the domain's centre plus `offset` on, to pixels from the image's centre.
    fn matrix(&self, offset: DVec3) -> DMat4 {
        let axes = self.grid.index_to_world();
        let origin = self.grid.centre() - self.view.camera().eye + axes * offset;
        let row = |v: DVec3, size: f64| (axes.transpose() * v).extend(origin.dot(v)) / size;
        let scale = self.view.pixel_size();
        let [right, up, forward] = self.view.rows();
        let forward = row(forward, 1.0);
        let last = if self.view.is_perspective() { forward } else { glam::DVec4::W };
        DMat4::from_cols(row(right, scale), row(-up, scale), forward, last).transpose()
    }

    /// Maps pixels to the component of their ray's direction along a vector, which all parallel rays share.
    fn along(&self, v: DVec3) -> DVec3 {
        let lateral = if self.view.is_perspective() { self.view.pixel_size() } else { 0.0 };
        DVec3::new(
            v.dot(self.view.across()) * lateral,
            -v.dot(self.view.up()) * lateral,
            v.dot(self.view.ahead()),
        )
    }

    /// Finds the one base plane that suffices, along `axis` or another. Returns `None` where several are needed, and an empty region
    /// where nothing is visible.
    pub(super) fn only_region(&self, axis: usize) -> Result<Option<Option<Region>>> {
        for axis in [axis, (axis + 1) % 3, (axis + 2) % 3] {
            for sign in [1.0, -1.0] {
                let Some(region) = self.region(axis, sign, Some(MOST_SHEAR))? else { continue };
                // One plane suffices if the limit of shear cuts nothing off: all of the domain lies in front of the eye along the axis...
                let eye = region.eye();
                let half = turned((self.grid.last_index() * 0.5).to_array(), axis)[2];
                let ahead = -half * 1.000_001 > eye && self.shear_of_domain(&region) <= MOST_SHEAR;
                // ... or all rays of the image are within the limit.
                let image = self.image();
                let inside = |p: &DVec2| {
                    let s = region.steepness * p.extend(1.0);
                    MOST_SHEAR * s.x >= s.y.abs().max(s.z.abs())
                };
                if ahead || image.iter().all(inside) {
                    return Ok(Some(Some(region)));
                }
            }
        }
        // No pyramid sees anything: an empty region.
        let mut any = false;
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                any |= self.region(axis, sign, Some(SEAM))?.is_some();
            }
        }
        Ok(if any { None } else { Some(None) })
    }

    /// Returns the largest shear of rays from the eye to the domain, which lies in front of the eye along the axis.
    fn shear_of_domain(&self, region: &Region) -> f64 {
        let normals = turned(self.normals, region.axis);
        self.grid
            .corners()
            .iter()
            .map(|corner| {
                let line = *corner - self.view.camera().eye;
                let ahead = region.sign * line.dot(normals[2]);
                line.dot(normals[0]).abs().max(line.dot(normals[1]).abs()) / ahead
            })
            .fold(0.0, f64::max)
    }

    /// The whole image.
    fn image(&self) -> Polygon {
        let h = self.half_image;
        vec![DVec2::new(-h.x, -h.y), DVec2::new(h.x, -h.y), DVec2::new(h.x, h.y), DVec2::new(-h.x, h.y)]
    }

    /// Finds the region of the image whose rays cross the planes of an axis in one direction, with shears up to `reach` if given. Returns
    /// `None` where it is empty.
    pub(super) fn region(&self, axis: usize, sign: f64, reach: Option<f64>) -> Result<Option<Region>> {
        let [hx, hy, hz] = turned((self.grid.last_index() * 0.5).to_array(), axis);
        let normals = turned(self.normals, axis);
        let steepness =
            DMat3::from_cols(self.along(normals[2]) * sign, self.along(normals[0]), self.along(normals[1]))
                .transpose();
        // The base plane is the nearest slice, or one in front of the eye.
        let mut base = -hz;
        let mut front = -hz;
        if self.view.is_perspective() {
            let from_eye = self.grid.centre() - self.view.camera().eye;
            let step = planes(self.grid)[axis].1;
            let eye = -sign * from_eye.dot(normals[2]) / step;
            // The eye is on the last slice or beyond it: what lies ahead is shorter than rounding.
            if eye >= hz - NEAREST * (hz + 1.0) {
                return Ok(None);
            }
            let least = 0.25 * hz.max(1.0);
            front = front.max(eye + hz.max(1.0));
            base = base.max(eye + least);
        }
        let mut offset = [0.0; 3];
        offset[axis] = sign * base;
        let factors = Factorisation::of(self.matrix(DVec3::from_array(offset)), axis)?;
        let to_base = factors.to_image().inverse();
        if !to_base.is_finite() {
            return Err(Error::invalid(
                "view",
                "float64 cannot hold the map from its pixels to the base plane",
            ));
        }
        let mut region =
            Region { axis, sign, factors, base, front, to_base, steepness, polygon: Polygon::new() };
        // The sign of a homogeneous matrix is free: the last coordinate becomes positive in front of the eye.
        let centre = DVec3::new(0.0, 0.0, 1.0);
        let (ahead, w) = (region.steepness.row(0), region.to_base.row(2));
        let agree = if self.view.is_perspective() {
            // Both are linear in the pixel, and zero on the same line of the image.
            ahead.dot(w) / ahead.length()
        } else {
            w.dot(centre)
        };
        if agree < 0.0 {
            region.to_base *= -1.0;
        }

        let mut polygon = self.image();
        if let Some(reach) = reach {
            let [s, u, v] = [0, 1, 2].map(|i| region.steepness.row(i));
            for side in [s * reach - u, s * reach + u, s * reach - v, s * reach + v] {
                polygon = clip(&polygon, side);
            }
        }
        // The domain's outline in the base plane: rectangles of its nearest and its farthest slice.
        let [mut low, mut high] = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        let eye = region.eye();
        let nearest = (-hz).max(eye + NEAREST * (hz + 1.0));
        let half = DVec2::new(hx, hy);
        for depth in [nearest, hz] {
            for corner in [-half, half] {
                let at = region.on_base(corner, depth);
                low = low.min(at);
                high = high.max(at);
            }
        }
        let [x, y, w] = [0, 1, 2].map(|i| region.to_base.row(i));
        // Slightly larger, so that a domain without extent is not lost to rounding.
        let hair = (high - low).abs() * 1e-9 + low.abs().max(high.abs()) * 1e-12;
        let (low, high) = (low - hair, high + hair);
        for side in [x - w * low.x, w * high.x - x, y - w * low.y, w * high.y - y] {
            polygon = clip(&polygon, side);
        }
        if polygon.is_empty() {
            return Ok(None);
        }
        region.polygon = polygon;
        Ok(Some(region))
    }
}

impl Region {
    /// Depth of the eye from the domain's centre, along the axis; minus infinity for parallel rays.
    fn eye(&self) -> f64 {
        let scaling = self.sign * self.factors.scaling();
        if scaling == 0.0 { f64::NEG_INFINITY } else { self.base - 1.0 / scaling }
    }

    /// Returns the point where the ray through a point of the slice at `depth` meets the base plane.
    fn on_base(&self, point: DVec2, depth: f64) -> DVec2 {
        let z = self.sign * (depth - self.base);
        (point + z * self.factors.shears()) / (1.0 + self.factors.scaling() * z)
    }

    /// Returns the point where the ray of a pixel meets the base plane.
    fn of_pixel(&self, pixel: DVec2) -> DVec2 {
        let p = self.to_base * pixel.extend(1.0);
        p.truncate() / p.z
    }

    /// Returns the derivative of that point by the pixel's x and y.
    fn per_pixel(&self, pixel: DVec2) -> [DVec2; 2] {
        let p = self.to_base * pixel.extend(1.0);
        let at = p.truncate() / p.z;
        [self.to_base.x_axis, self.to_base.y_axis].map(|c| (c.truncate() - at * c.z) / p.z)
    }

    /// The corners and the middle of the region.
    fn looks(&self) -> Polygon {
        let mut points = self.polygon.clone();
        points.push(self.middle());
        points
    }

    /// The mean of the corners.
    fn middle(&self) -> DVec2 {
        self.polygon.iter().sum::<DVec2>() / f64::from(num::count(self.polygon.len()))
    }

    /// Returns the distance of texels on the base plane.
    pub(super) fn pitch(&self, resolution: Intermediate) -> DVec2 {
        // A voxel of the front slice, projected to the base plane.
        let voxel = DVec2::splat(1.0 / (1.0 + self.factors.scaling() * self.sign * (self.front - self.base)));
        // The pitch at which texels are as large as pixels, in the middle of the region.
        let pixel = || {
            let [x, y] = self.per_pixel(self.middle());
            // Pixels per unit of the base plane: rows of the inverse.
            let steps = DVec2::new(DVec2::new(x.y, y.y).length(), DVec2::new(x.x, y.x).length());
            x.perp_dot(y).abs() / steps
        };
        let pitch = match resolution {
            Intermediate::Voxel => voxel,
            Intermediate::Pixel(texels) => pixel() / texels,
            Intermediate::Auto => voxel.min(COARSEST * pixel()).max(pixel()),
        };
        // A pitch above the region's extent would leave it without a texel.
        let [low, high] = self.bounds();
        let extent = (high - low).max(DVec2::splat(1e-300));
        DVec2::select(pitch.cmplt(extent), pitch, extent)
    }

    /// The bounding box of the region on the base plane.
    fn bounds(&self) -> [DVec2; 2] {
        let mut bounds = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        for point in &self.polygon {
            let at = self.of_pixel(*point);
            bounds = [bounds[0].min(at), bounds[1].max(at)];
        }
        bounds
    }

    /// The sides of that box.
    pub(super) fn extent(&self) -> DVec2 {
        let [low, high] = self.bounds();
        high - low
    }

    /// Lays the lattice of texels, and derives their rays.
    pub(super) fn base_plane(&self, seen: &GridView<'_>, pitch: DVec2, parted: bool) -> Result<BasePlane> {
        let [low, high] = self.bounds();
        // A texel coincides with the pixel nearest to the image's centre, so that an identity warp does not resample.
        let parity = seen.half_image - seen.half_image.floor();
        let centre = DVec2::splat(0.5) - parity;
        let ahead = (self.to_base * centre.extend(1.0)).z;
        let mut anchor = if ahead > 0.0 { self.of_pixel(centre) } else { self.of_pixel(self.middle()) };
        // The ray of that pixel may be nearly parallel to the plane, and meet it beyond the precision of float64.
        let away = ((low - anchor) / pitch).abs().max_element();
        if away.is_nan() || away > 1e9 {
            anchor = (low + high) * 0.5;
        }
        let first = anchor + ((low - anchor) / pitch - MARGIN).floor() * pitch;
        let size = ((high - first) / pitch + MARGIN).ceil() + 1.0;
        let sides = [size.x, size.y].map(num::u32_of);
        let middle = sides.map(|side| side / 2);
        let origin = first + pitch * DVec2::new(f64::from(middle[0]), f64::from(middle[1]));
        // The ray through the point b of the base plane meets slice z, counted from that plane, at b + z (s_w b - s).
        let (scaling, shears) = (self.factors.scaling(), self.factors.shears());
        let slope = self.sign * (scaling * origin - shears);
        let step_slope = self.sign * scaling * pitch;
        let to_texel = DMat3::from_cols(
            DVec3::new(1.0 / pitch.x, 0.0, 0.0),
            DVec3::new(0.0, 1.0 / pitch.y, 0.0),
            DVec3::new(-first.x / pitch.x, -first.y / pitch.y, 1.0),
        ) * self.to_base;
        // The scale of a homogeneous matrix is free: the largest w of the region becomes 1.
        let scale = self.polygon.iter().map(|p| (to_texel * p.extend(1.0)).z).fold(0.0, f64::max);
        let mut texels_per_pixel: f64 = 0.0;
        for point in self.looks() {
            for column in self.per_pixel(point) {
                texels_per_pixel = texels_per_pixel.max((column / pitch).length());
            }
        }
        let axes = seen.grid.index_to_world();
        let turned_axes = turned([axes.x_axis, axes.y_axis, axes.z_axis], self.axis);
        let middle_slope = self.sign * (scaling * self.of_pixel(self.middle()) - shears);
        let step =
            turned_axes[0] * middle_slope.x + turned_axes[1] * middle_slope.y + turned_axes[2] * self.sign;
        let plane = BasePlane {
            axis: self.axis,
            sign: self.sign,
            size: sides,
            q: origin - self.base * slope,
            step_q: pitch - self.base * step_slope,
            d: slope,
            step_d: step_slope,
            near: self.eye(),
            to_texel: to_texel * (1.0 / scale),
            steepness: if parted { self.steepness } else { DMat3::ZERO },
            texels_per_pixel,
            length: step.length(),
        };
        let finite = [plane.q, plane.step_q, plane.d, plane.step_d].iter().all(|v| v.is_finite());
        if !(finite && plane.to_texel.is_finite() && size.max_element() < 1e9) {
            return Err(Error::invalid("view", "float64 cannot hold the rays through its base plane"));
        }
        Ok(plane)
    }
}
