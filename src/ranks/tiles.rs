//! The rectangles that the image is cut into where no boxes of space own what is drawn: kernels overlap, for one.

use glam::{DVec2, DVec3};

use crate::error::{Error, Result};
use crate::num;
use crate::ranks::tree::{check_count, work_of};
use crate::scene::{Data, Points, Scene, View};

/// Pixels beyond a rectangle from which kernels still reach it: of filters for those that are smaller than a pixel.
const MARGIN: f64 = 4.0;

/// The depth, in radii of a kernel, up to which it may reach anywhere.
const NEAR: f64 = 8.0;

/// By how much an affine footprint may be wider than a kernel that is farther away: 1 / (1 - 1 / NEAR), and some.
const WIDER: f64 = 1.25;

/// The sides of the tiles of pixels at whose edges some rules cut trained splats off: rectangles do not cut these.
const SPLAT_TILE: u32 = 16;

/// Rectangles of an image with about the same number of kernels or the same work, one per rank.
#[derive(Clone, Debug, PartialEq)]
pub struct Tiles {
    /// The extent of the image.
    pub(super) image: [u32; 2],
    rectangles: Vec<Rectangle>,
}

/// A place in the image, and the work there.
type Place = (DVec2, f64);

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rectangle {
    pub(super) corner: [u32; 2],
    pub(super) extent: [u32; 2],
}

impl Tiles {
    /// Cuts the image of a view for so many ranks.
    pub(super) fn new(scene: &Scene, view: &View, ranks: u32) -> Result<Self> {
        check_count(ranks)?;
        let extent = view.extent();
        let [width, height] = extent.map(f64::from);
        let unit = if matches!(scene.data, Data::Gaussians(_)) { SPLAT_TILE } else { 1 };
        let seen = |(at, _): (DVec2, f64)| {
            let within = (0.0..=width).contains(&at.x) && (0.0..=height).contains(&at.y);
            within.then_some(at / f64::from(unit))
        };
        let work: Vec<(DVec3, f64)> = match &scene.data {
            Data::Points(points) => points.centres().iter().map(|&place| (place, 1.0)).collect(),
            Data::Gaussians(splats) => (0..splats.len()).map(|i| (splats.centre(i), 1.0)).collect(),
            _ => work_of(scene, view).into_iter().filter_map(|(place, work)| Some((place, work?))).collect(),
        };
        let in_image = |(place, work)| Some((view.project(place).and_then(seen)?, work));
        let mut places: Vec<Place> = work.into_iter().filter_map(in_image).collect();
        let mut rectangles = Vec::new();
        let all = Rectangle { corner: [0; 2], extent: extent.map(|side| side.div_ceil(unit)) };
        cut(&mut places, all, unit, ranks, &mut rectangles)?;
        for Rectangle { corner, extent: sides } in &mut rectangles {
            *corner = corner.map(|at| unit * at);
            *sides = [0, 1].map(|axis| (unit * sides[axis]).min(extent[axis] - corner[axis]));
        }
        Ok(Self { image: extent, rectangles })
    }

    pub(super) fn count(&self) -> u32 {
        num::count(self.rectangles.len())
    }

    pub(super) fn of(&self, rank: u32) -> Rectangle {
        self.rectangles[num::index(rank)]
    }

    /// Returns the points whose kernels may reach a rank's rectangle.
    pub(super) fn part(&self, points: &Points, view: &View, rank: u32) -> Points {
        let Rectangle { corner, extent } = self.of(rank);
        let low = DVec2::from_array(corner.map(f64::from)) - MARGIN;
        let high = DVec2::from_array([0, 1].map(|i| f64::from(corner[i] + extent[i]))) + MARGIN;
        let corners = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
        // Planes through the rectangle's sides, whose normals point inwards.
        let middle = view.ray(0.5 * (low + high));
        let inside = middle.0 + middle.1;
        let sides = [0, 1, 2, 3].map(|i| {
            let [(start, direction), (end, other)] =
                [corners[i], corners[(i + 1) % 4]].map(|at| view.ray(at));
            let across = if view.is_perspective() { other } else { end - start };
            let normal = direction.cross(across).normalize_or_zero();
            let towards = normal.dot(inside - start);
            (start, if towards < 0.0 { -normal } else { normal })
        });
        let eye = view.is_perspective().then(|| view.camera().eye);
        points.within(|centre, reach| {
            // Affine footprints leave the kernel's own outline the more, the nearer to the eye it is.
            eye.is_some_and(|eye| (centre - eye).dot(view.forward()).abs() < NEAR * reach.max_element())
                || sides
                    .iter()
                    .all(|(on, normal)| (centre - *on).dot(*normal) >= -WIDER * reach.dot(normal.abs()))
        })
    }
}

/// Cuts a rectangle of pixels, or of tiles with sides of `unit` pixels, in which work has these places, for so many ranks.
fn cut(
    places: &mut [Place],
    all: Rectangle,
    unit: u32,
    ranks: u32,
    rectangles: &mut Vec<Rectangle>,
) -> Result<()> {
    if ranks == 1 {
        rectangles.push(all);
        return Ok(());
    }
    let axis = usize::from(all.extent[1] > all.extent[0]);
    let [side, other] = [all.extent[axis], all.extent[1 - axis]];
    let below = ranks / 2;
    // Each of the ranks needs a pixel, and whole columns or rows are cut off.
    let least = |ranks: u32| ranks.div_ceil(other);
    if side < least(below) + least(ranks - below) {
        let what = if unit > 1 { format!("tiles of {unit} x {unit} pixels") } else { "pixels".to_string() };
        let why = format!("{ranks} for {} x {} {what}: too few to share out", all.extent[0], all.extent[1]);
        return Err(Error::invalid("ranks", why));
    }
    places.sort_unstable_by(|(a, _), (b, _)| a[axis].total_cmp(&b[axis]));
    let share = f64::from(below) / f64::from(ranks);
    let mut left = share * places.iter().map(|(_, work)| work).sum::<f64>();
    let middle = places.iter().find(|(_, work)| {
        left -= work;
        left < 0.0
    });
    let evenly = f64::from(all.corner[axis]) + f64::from(side) * share;
    let at = middle.map_or(evenly, |(place, _)| place[axis]);
    let width = num::u32_of((at - f64::from(all.corner[axis])).round().max(0.0))
        .clamp(least(below), side - least(ranks - below));
    let at = f64::from(all.corner[axis] + width);
    let (first, second) = places.split_at_mut(places.partition_point(|(place, _)| place[axis] < at));
    let [mut near, mut far] = [all; 2];
    near.extent[axis] = width;
    (far.corner[axis], far.extent[axis]) = (all.corner[axis] + width, side - width);
    cut(first, near, unit, below, rectangles)?;
    cut(second, far, unit, ranks - below, rectangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rectangles cover the image once, whatever lies in it.
    #[test]
    fn rectangles_fill_the_image() {
        for (extent, ranks, places) in
            [([90, 70], 7, 0), ([90, 70], 8, 300), ([5, 1], 5, 20), ([1, 9], 4, 3), ([4, 4], 9, 50)]
        {
            let mut places: Vec<Place> = (0..places)
                .map(|i| DVec2::new(f64::from(i * i % 97) / 97.0, f64::from(i % 13) / 40.0))
                .map(|place| (place * DVec2::from_array(extent.map(f64::from)), 1.0))
                .collect();
            let mut rectangles = Vec::new();
            cut(&mut places, Rectangle { corner: [0; 2], extent }, 1, ranks, &mut rectangles).unwrap();
            assert_eq!(rectangles.len(), num::index(ranks));
            let mut covered = vec![0; num::index(extent[0] * extent[1])];
            for Rectangle { corner, extent: [width, height] } in rectangles {
                assert!(width > 0 && height > 0);
                for y in corner[1]..corner[1] + height {
                    for x in corner[0]..corner[0] + width {
                        covered[num::index(y * extent[0] + x)] += 1;
                    }
                }
            }
            assert!(covered.iter().all(|&count| count == 1), "{extent:?} for {ranks}");
        }
        let one = Rectangle { corner: [0; 2], extent: [2, 1] };
        assert!(cut(&mut [], one, 1, 3, &mut Vec::new()).unwrap_err().to_string().contains("3 for 2 x 1"));
    }
}
