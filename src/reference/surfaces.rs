//! Rays against the triangles of surfaces.
//!
//! Projected along the ray, the corners are points of a plane and the ray is its origin, as for tetrahedra.
//! The orientation of the origin to each edge is exact. Where the origin lies on an edge, an infinitely small
//! offset decides, the same for all triangles. So a ray through a shared edge or corner meets exactly one of
//! the triangles that cover its surroundings, and a closed surface is met an even number of times.

use glam::{DVec2, DVec3};

use crate::num;
use crate::scene::{Shading, Surface};

use super::tets::{LocalRay, mean, side};
use super::tree::{Node, tree};

/// Largest number of triangles in a leaf.
const LEAF: usize = 4;

/// Bound of the rounding of a corner's position across and along a ray, as a share of the corner's distance.
const ROUNDING: f64 = 1e-14;

/// An intersection of a ray with a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Distance from the ray's origin, in world units.
    pub(super) t: f64,
    /// Premultiplied and shaded.
    pub(super) colour: [f64; 4],
    pub(super) opaque: bool,
    face: Face,
}

/// A triangle as surface and index. This order is that of hits at the same place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Face {
    surface: u32,
    triangle: u32,
}

/// Surfaces, prepared for rays.
#[derive(Debug)]
pub(super) struct SurfaceRays<'a> {
    surfaces: &'a [Surface],
    faces: Vec<Face>,
    nodes: Vec<Node>,
    centre: DVec3,
    /// Half of the longest side of the common box.
    size: f64,
}

impl<'a> SurfaceRays<'a> {
    /// Builds a tree of the visible surfaces that `takes` accepts, or returns `None` without triangles.
    pub(super) fn new(surfaces: &'a [Surface], takes: impl Fn(&Surface) -> bool) -> Option<Self> {
        Self::with_leaves(surfaces, takes, LEAF)
    }

    /// As [`Self::new`], with at most `largest` triangles in a leaf; for one ray no tree is worth its time.
    pub(super) fn with_leaves(
        surfaces: &'a [Surface],
        takes: impl Fn(&Surface) -> bool,
        largest: usize,
    ) -> Option<Self> {
        let seen = |surface: &Surface| surface.colour()[3] > 0.0 && takes(surface);
        let mut faces = Vec::new();
        for (of, surface) in surfaces.iter().zip(0..).filter(|(of, _)| seen(of)) {
            let triangles = 0..num::count(of.triangles().len());
            faces.extend(triangles.map(|triangle| Face { surface, triangle }));
        }
        let bounds = |face: &Face| {
            let [a, b, c] = corners(&surfaces[num::index(face.surface)], face.triangle);
            [a.min(b).min(c), a.max(b).max(c)]
        };
        let centre = |face: &Face| {
            let [low, high] = bounds(face);
            0.5 * low + 0.5 * high
        };
        let nodes = tree(&mut faces, largest, bounds, centre);
        let Node { low, high, .. } = *nodes.first()?;
        // For a box without extent any unit will do.
        let size = Some((0.5 * high - 0.5 * low).max_element()).filter(|size| *size > 0.0).unwrap_or(1.0);
        Some(Self { surfaces, faces, nodes, centre: 0.5 * low + 0.5 * high, size })
    }

    /// Returns the hits of a ray in a range, front to back, up to the first opaque one.
    ///
    /// The range excludes its beginning and includes its end; `direction` has unit length.
    pub(super) fn hits(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> Vec<Hit> {
        let mut ray = LocalRay::new(self.centre, origin, direction, range);
        let mut hits: Vec<Hit> = Vec::new();
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            let node = &self.nodes[node];
            if !meets(&ray, node) {
                continue;
            }
            if node.count == 0 {
                // Visit the nearer node first: it may hide the other.
                let [a, b] = [node.first, node.first + 1];
                let ahead = |node: usize| {
                    let Node { low, high, .. } = self.nodes[node];
                    (0.5 * low + 0.5 * high).dot(direction)
                };
                open.extend(if ahead(a) < ahead(b) { [b, a] } else { [a, b] });
            }
            for &face in &self.faces[node.first..][..node.count] {
                if let Some(hit) = self.hit(face, &ray) {
                    if hit.opaque {
                        ray.range[1] = ray.range[1].min(hit.t);
                    }
                    hits.push(hit);
                }
            }
        }
        hits.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then(a.face.cmp(&b.face)));
        if let Some(opaque) = hits.iter().position(|hit| hit.opaque) {
            hits.truncate(opaque + 1);
        }
        for hit in &mut hits {
            hit.t += ray.nearest;
        }
        hits
    }

    /// Intersects a ray with a triangle; the parameter counts from the ray's `start`.
    fn hit(&self, face: Face, ray: &LocalRay) -> Option<Hit> {
        let surface = &self.surfaces[num::index(face.surface)];
        let corners = corners(surface, face.triangle);
        let relative = corners.map(|p| p - ray.start);
        let plane = relative.map(|p| DVec2::new(p.dot(ray.across[0]), p.dot(ray.across[1])) / self.size);
        let [a, b, c] = plane;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if low.x > 0.0 || low.y > 0.0 || high.x < 0.0 || high.y < 0.0 {
            return None;
        }
        let [bc, ca, ab] = [side(b, c), side(c, a), side(a, b)];
        if bc.0 != ca.0 || ca.0 != ab.0 {
            return None;
        }
        // Sort the corners by position, so that triangles with the same corners are hit at the same
        // parameter.
        let mut parts =
            [0, 1, 2].map(|i| (corners[i], [bc.1, ca.1, ab.1][i], relative[i].dot(ray.direction)));
        parts.sort_unstable_by(|a, b| {
            let order = |axis: usize| a.0[axis].total_cmp(&b.0[axis]);
            order(0).then(order(1)).then(order(2))
        });
        let t = mean(parts.map(|part| part.1), parts.map(|part| part.2));
        // NaN means that the triangle is too small for its areas.
        if !(t > ray.range[0] && t <= ray.range[1]) {
            return None;
        }
        let [r, g, b, alpha] = surface.colour();
        let shade = match surface.shading() {
            Shading::Flat => 1.0,
            Shading::Headlight => normal(corners).dot(ray.direction).abs().min(1.0),
        };
        let colour = [r * shade * alpha, g * shade * alpha, b * shade * alpha, alpha];
        Some(Hit { t, colour, opaque: surface.is_opaque(), face })
    }
}

/// Returns the positions of a triangle's corners.
fn corners(surface: &Surface, triangle: u32) -> [DVec3; 3] {
    surface.triangles()[num::index(triangle)].map(|i| surface.points()[num::index(i)])
}

/// Returns the unit normal, or zero for a triangle without area.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    // With the longest side scaled to 1, products neither overflow nor underflow.
    let (e, f) = (b - a, c - a);
    let longest = e.abs().max(f.abs()).max_element();
    let normal = (e / longest).cross(f / longest);
    let length = normal.abs().max_element();
    if length > 0.0 { (normal / length).normalize() } else { DVec3::ZERO }
}

/// Returns whether a ray may meet a box, by the box's projections across and along the ray.
fn meets(ray: &LocalRay, node: &Node) -> bool {
    let centre = (0.5 * node.low + 0.5 * node.high) - ray.start;
    let half = 0.5 * node.high - 0.5 * node.low;
    let margin = ROUNDING * (centre.abs() + half + ray.start.abs()).element_sum();
    let shadow = |axis: DVec3| (centre.dot(axis), half.dot(axis.abs()) + margin);
    let across = ray.across.into_iter().all(|axis| {
        let (middle, half) = shadow(axis);
        middle.abs() <= half
    });
    let (middle, half) = shadow(ray.direction);
    across && middle + half >= ray.range[0] && middle - half <= ray.range[1]
}
