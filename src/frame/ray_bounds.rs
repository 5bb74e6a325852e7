//! Bounds the rays of pixels by the clip planes and the crop box of a view, and by a depth image (`glsl/frame/line-bounds.glsl`).
//!
//! Half-spaces are convex, and so is the part of a ray before a surface. Each ray therefore keeps one interval, and every
//! technique clips its segments to it. A plan without bounds has no such pass, and its pipelines have no code for them.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::depth_measure::{DepthMeasure, PixelRays};
use crate::frame::surfaces::SurfaceFrame;
use crate::gpu::shader::{
    BOUNDS_FAR_AT_ONE, BOUNDS_OWNED, BOUNDS_PERSPECTIVE, BOUNDS_PLANES, LINE_BOUNDS_DEPTH,
    LINE_BOUNDS_PLANES, LineBoundsDepth, LineBoundsPlanes,
};
use crate::gpu::{Buffer, BufferUse, DepthImage, Gpu, Recorder, Sampled};
use crate::interface::BoundsPush;
use crate::num::{self, f32_of};
use crate::primitives::dispatch::{Dispatch, pass, tiles_of};
use crate::scene::{Clip, View};

/// Half-spaces that one dispatch takes.
const PLANES: usize = 6;

/// Half-spaces of a view: its clip planes and the six sides of its crop box.
const MOST_PLANES: usize = Clip::MAX_PLANES + 6;

/// The name of buffer and passes that bound rays.
pub(crate) const BOUNDS: &str = "line.bounds";

/// The name of those that find where rays pass the box that a view owns.
pub(crate) const OWNED: &str = "line.owned";

/// Makes a buffer of bounds: two depths per pixel, in the unit of the technique.
pub(crate) fn bounds_buffer(gpu: &Gpu, name: &str, view: &View) -> Result<Arc<Buffer>> {
    let [width, height] = view.extent().map(u64::from);
    Buffer::new(gpu, name, 8 * width * height, BufferUse::ShaderWrite).map(Arc::new)
}

/// The passes that find the bounds.
#[derive(Debug)]
pub(crate) struct RayBounds {
    first: Dispatch,
    more: Dispatch,
    takes_depth: bool,
    /// Whether a ray in a plane belongs to one side of it alone.
    shares: bool,
    measure: DepthMeasure,
    view: View,
}

impl RayBounds {
    /// Builds the passes. `takes_depth` says that each recording brings a depth image.
    pub(crate) fn new(
        gpu: &Gpu,
        name: &str,
        bounds: &Arc<Buffer>,
        takes_depth: bool,
        measure: DepthMeasure,
        view: &View,
    ) -> Result<Self> {
        let planes =
            |resume: bool| LINE_BOUNDS_PLANES.with(&LineBoundsPlanes { line_bounds: bounds.write(), resume });
        let first = if takes_depth {
            let depth = Sampled::external();
            LINE_BOUNDS_DEPTH.with(&LineBoundsDepth { line_bounds: bounds.write(), depth, resume: false })
        } else {
            planes(false)
        };
        let [first, more] = [first, planes(true)].map(|bound| pass(gpu, name, &bound));
        let made = Self { first: first?, more: more?, takes_depth, shares: false, measure, view: *view };
        made.check(view)?;
        Ok(made)
    }

    /// Changes to another view of the same extent, which [`RayBounds::check`] has accepted.
    pub(crate) fn set_view(&mut self, view: &View) {
        self.view = *view;
    }

    /// Returns the same passes for planes of a box that a view owns: a ray in a plane belongs to one side of it alone.
    pub(crate) fn sharing(self, shares: bool) -> Self {
        Self { shares, ..self }
    }

    /// Checks that float32 holds the planes of a view.
    pub(crate) fn check(&self, view: &View) -> Result<()> {
        let finite = |push: &BoundsPush| {
            push.planes.iter().flatten().chain([&push.kq]).all(|number| number.is_finite())
        };
        if self.pushes(view, None).iter().all(finite) {
            return Ok(());
        }
        let why = "a clip plane or the camera is so far from the data that float32 cannot hold its distance";
        Err(Error::invalid("view", why))
    }

    /// Returns the push constants of each dispatch.
    fn pushes(&self, view: &View, depth: Option<&DepthImage>) -> Vec<BoundsPush> {
        let DepthMeasure { centre, unit } = self.measure;
        let PixelRays { foot, kq, scale, centre_depth } = self.measure.rays(view);
        let perspective = view.is_perspective();
        let planes: Vec<[f32; 4]> = view
            .clip()
            .half_spaces()
            .map(|plane| {
                let n = plane.normal;
                [
                    n.dot(view.across()) * scale,
                    -n.dot(view.up()) * scale,
                    n.dot(view.ahead()),
                    n.dot(foot + (centre - plane.point)) / unit,
                ]
                .map(f32_of)
            })
            .collect();
        let ends = depth.map_or([1.0, 2.0], |depth| [depth.projection.at_zero, depth.projection.at_one]);
        // The far end is stored as 1, or as 0.
        let far = if ends[1] > ends[0] { BOUNDS_FAR_AT_ONE } else { 0 };
        let flags = far
            | if perspective { BOUNDS_PERSPECTIVE } else { 0 }
            | if self.shares { BOUNDS_OWNED } else { 0 };
        // Differences in float64, because a far eye and ends near the data would cancel.
        let depths = ends.map(|end| {
            let from_centre = if end.is_infinite() { end } else { end - centre_depth };
            match (perspective, end.is_infinite()) {
                (true, true) => 1.0,
                (true, false) => from_centre / end,
                (false, _) => from_centre / unit,
            }
        });
        let push = BoundsPush {
            planes: [[0.0; 4]; PLANES],
            sides: view.sides(),
            corner: depth.map_or(0, |depth| depth.corner[0] | depth.corner[1] << 16),
            kq: f32_of(kq),
            inverse: ends.map(|end| f32_of(unit / end)),
            depths: depths.map(f32_of),
            count: flags,
        };
        let mut pushes = vec![push; planes.len().div_ceil(PLANES).max(1)];
        for (push, planes) in pushes.iter_mut().zip(planes.chunks(PLANES)) {
            push.count += num::count(planes.len());
            for (place, plane) in push.planes.iter_mut().zip(planes) {
                *place = *plane;
            }
        }
        pushes
    }

    /// Checks a depth image against the view.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if its extent, projection or format is wrong; [`Error::Unsupported`] if the device cannot sample its
    /// format.
    pub(crate) fn check_depth(&self, gpu: &Gpu, depth: &DepthImage) -> Result<()> {
        let view = &self.view;
        let invalid = |why: String| Err(Error::invalid("depth image", why));
        let fits = |axis: usize| {
            depth.extent[axis] <= View::MAX_SIDE
                && depth.corner[axis].saturating_add(view.extent()[axis]) <= depth.extent[axis]
        };
        let whole = depth.corner == [0; 2] && depth.extent == view.extent();
        if !(whole || depth.in_part && fits(0) && fits(1)) {
            return invalid(format!(
                "{:?} from {:?}: must have the view's extent, {:?}, or room for it at the corner of DepthImage::at",
                depth.extent,
                depth.corner,
                view.extent()
            ));
        }
        if !DepthImage::FORMATS.contains(&depth.format) {
            return invalid(format!("{:?}: must be one of {:?}", depth.format, DepthImage::FORMATS));
        }
        if depth.projection.perspective != view.is_perspective() {
            let kind = |perspective| if perspective { "perspective" } else { "orthographic" };
            let (given, wanted) = (kind(depth.projection.perspective), kind(view.is_perspective()));
            return invalid(format!("its projection is {given}: the view is {wanted}"));
        }
        if let Some((scale, middle)) = depth.projection.image {
            let half = view.extent().map(|side| 0.5 * f64::from(side) * view.pixel_size());
            let wanted = [1.0 / (half[0] * view.pixel_aspect()), 1.0 / half[1]];
            if scale.iter().zip(wanted).any(|(scale, wanted)| (scale - wanted).abs() > 1e-4 * wanted) {
                return invalid(format!(
                    "its projection scales x and y by {scale:?}: the view by {wanted:?}"
                ));
            }
            // Where the image has the viewing direction. A parallel view has its eye in the middle.
            let [right, up, _] = view.rows();
            let wanted = [right.dot(view.forward()) / half[0], up.dot(view.forward()) / half[1]];
            let apart = |(middle, wanted): (&f64, f64)| (middle - wanted).abs() > 1e-4;
            if view.is_perspective() && middle.iter().zip(wanted).any(apart) {
                return invalid(format!(
                    "its projection has the viewing direction at {middle:?} of the image's half sides, to the right and up: the view at {wanted:?}"
                ));
            }
        }
        let needed = ash::vk::FormatFeatureFlags::SAMPLED_IMAGE;
        if !gpu.image_features(depth.format).contains(needed) {
            return Err(Error::unsupported(
                format!("depth image of {:?}", depth.format),
                format!("{needed:?}"),
            ));
        }
        Ok(())
    }

    /// Records the passes: bounds by the depth image, which has been checked, then by the surfaces in `between`, then by planes. The
    /// depth image hides surfaces, and planes do not clip them. Without `between` one dispatch does both.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        depth: Option<&DepthImage>,
        between: Option<&SurfaceFrame>,
    ) -> Result<()> {
        if let Some(depth) = depth {
            self.first.descriptors.sample_external(depth)?;
        }
        self.record_pushes(recorder, self.pushes(&self.view, depth), between);
        Ok(())
    }

    /// Records the passes of bounds by planes alone.
    pub(crate) fn record_planes(&self, recorder: &mut Recorder<'_>) {
        self.record_pushes(recorder, self.pushes(&self.view, None), None);
    }

    /// Records the passes of a view with the most half-spaces, for a dry run.
    pub(crate) fn record_most(&self, recorder: &mut Recorder<'_>, between: Option<&SurfaceFrame>) {
        let full = BoundsPush { count: num::count(PLANES), ..BoundsPush::default() };
        self.record_pushes(recorder, vec![full; MOST_PLANES.div_ceil(PLANES)], between);
    }

    fn record_pushes(
        &self,
        recorder: &mut Recorder<'_>,
        mut pushes: Vec<BoundsPush>,
        between: Option<&SurfaceFrame>,
    ) {
        let groups = tiles_of(self.view.extent());
        if let Some(surfaces) = between {
            if self.takes_depth
                && let Some(push) = pushes.first()
            {
                self.first.record(
                    recorder,
                    &BoundsPush { count: push.count & !BOUNDS_PLANES, ..*push },
                    groups,
                );
            }
            surfaces.record(recorder);
            pushes.retain(|push| push.count & BOUNDS_PLANES > 0);
        }
        for (i, push) in pushes.iter().enumerate() {
            let begins = i == 0 && between.is_none();
            if begins { &self.first } else { &self.more }.record(recorder, push, groups);
        }
    }
}
