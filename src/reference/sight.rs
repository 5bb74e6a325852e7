//! Lines of sight: where on a ray the volume is seen, and which surfaces stand in it.

use glam::{DVec2, DVec3};

use crate::scene::{Scene, View};

use super::surfaces::{Hit, SurfaceRays};
use super::view_range;

/// A ray, the range in which the volume is seen on it, and the surfaces that it meets.
#[derive(Debug)]
pub(super) struct Sight {
    pub(super) origin: DVec3,
    /// Unit length.
    pub(super) direction: DVec3,
    /// Begins and ends where the view's region does, and ends at the first opaque surface; empty when begin >= end.
    pub(super) range: [f64; 2],
    /// Front to back; behind an opaque one is none.
    hits: Vec<Hit>,
}

impl Sight {
    /// A ray on which surfaces are seen in `range`, and the volume in `kept` of that.
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

    /// The volume, of which `volume` draws a range of the ray, and the surfaces over each other.
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

/// The lines of sight of a view.
#[derive(Debug)]
pub(super) struct Sights<'a> {
    view: &'a View,
    surfaces: Option<SurfaceRays<'a>>,
    range: [f64; 2],
}

impl<'a> Sights<'a> {
    pub(super) fn new(scene: &'a Scene, view: &'a View) -> Self {
        let surfaces = SurfaceRays::new(&scene.surfaces, |_| true);
        Self { view, surfaces, range: view_range(view) }
    }

    /// Through a point of the image, in pixels from the top left corner.
    pub(super) fn at(&self, pixel: DVec2) -> Sight {
        let (origin, direction) = self.view.ray(pixel);
        let kept = self.view.clip().range(origin, direction, self.range);
        Sight::new(self.surfaces.as_ref(), origin, direction, self.range, kept)
    }
}
