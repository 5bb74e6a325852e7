//! The ray of a pixel: the range in which the volume is drawn, and the surfaces on it.

use glam::{DVec2, DVec3};

use crate::scene::{Scene, View};

use super::surfaces::{Hit, SurfaceRays};

/// A ray, the range in which the volume is drawn on it, and its intersections with surfaces.
#[derive(Debug)]
pub(super) struct ViewRay {
    pub(super) origin: DVec3,
    /// Unit length.
    pub(super) direction: DVec3,
    /// Limited by the clip region and by the first opaque surface; empty when begin >= end.
    pub(super) range: [f64; 2],
    /// Front to back; the first opaque one is the last.
    hits: Vec<Hit>,
}

impl ViewRay {
    /// Makes a ray on which surfaces are drawn in `range`, and the volume in `kept`, a part of it.
    pub(super) fn new(
        surfaces: Option<&SurfaceRays>,
        origin: DVec3,
        direction: DVec3,
        range: [f64; 2],
        kept: [f64; 2],
    ) -> Self {
        let hits = surfaces.map_or_else(Vec::new, |surfaces| surfaces.hits(origin, direction, range));
        let [begin, mut end] = kept;
        if let Some(last) = hits.last().filter(|hit| hit.opaque) {
            end = end.min(last.t);
        }
        Self { origin, direction, range: [begin, end], hits }
    }

    /// Composites the volume, which `volume` integrates over a range of the ray, and the surfaces.
    pub(super) fn composite(&self, mut volume: impl FnMut([f64; 2]) -> [f64; 4]) -> [f64; 4] {
        if self.hits.is_empty() {
            return volume(self.range);
        }
        let mut pixel = [0.0; 4];
        let mut add = |part: [f64; 4]| {
            let transmittance = 1.0 - pixel[3];
            for (sum, value) in pixel.iter_mut().zip(part) {
                *sum += transmittance * value;
            }
            pixel[3] < 1.0
        };
        let [mut begin, end] = self.range;
        for hit in &self.hits {
            let to = hit.t.min(end);
            if begin < to {
                if !add(volume([begin, to])) {
                    return pixel;
                }
                begin = to;
            }
            add(hit.colour);
            if hit.opaque {
                pixel[3] = 1.0;
                return pixel;
            }
        }
        if begin < end {
            add(volume([begin, end]));
        }
        pixel
    }
}

/// Returns the range of a view's rays: all real numbers for orthographic rays, from the eye on for
/// perspective ones.
pub(super) fn view_range(view: &View) -> [f64; 2] {
    [if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY }, f64::INFINITY]
}

/// The rays of a view.
#[derive(Debug)]
pub(super) struct ViewRays<'a> {
    view: &'a View,
    surfaces: Option<SurfaceRays<'a>>,
    range: [f64; 2],
}

impl<'a> ViewRays<'a> {
    pub(super) fn new(scene: &'a Scene, view: &'a View) -> Self {
        let surfaces = SurfaceRays::new(&scene.surfaces, |_| true);
        Self { view, surfaces, range: view_range(view) }
    }

    /// Returns the ray through a position in the image, in pixels from the top left corner.
    pub(super) fn at(&self, pixel: DVec2) -> ViewRay {
        let (origin, direction) = self.view.ray(pixel);
        let kept = self.view.clip().range(origin, direction, self.range);
        ViewRay::new(self.surfaces.as_ref(), origin, direction, self.range, kept)
    }
}
