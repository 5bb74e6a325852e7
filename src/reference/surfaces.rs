//! Rays against the triangles of surfaces.
//!
//! Seen along the ray the corners are points of a plane, and the ray is its origin, as for tetrahedra: the orientation
//! of the origin to each edge is decided exactly, and by an infinitely small step aside where it lies on an edge. So
//! a ray through an edge or a corner that triangles share meets one of those that cover its surroundings, and a
//! closed surface is met an even number of times.

use glam::{DVec2, DVec3};

use crate::num;
use crate::scene::{Shading, Surface};

use super::tets::{mean, side};

/// Most triangles of a leaf.
const LEAF: usize = 4;

/// What rounding takes from the place of a corner across a ray or along it, as a share of the corner's distance.
const ROUNDING: f64 = 1e-14;

/// A ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// In units of world length from the ray's origin.
    pub(super) t: f64,
    /// Premultiplied, shaded.
    pub(super) colour: [f64; 4],
    pub(super) opaque: bool,
    face: Face,
}

/// A triangle: its surface and its place there. Their order is that of hits at the same place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Face {
    surface: u32,
    triangle: u32,
}

/// A box around triangles.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// Of a leaf the first triangle, else the first of two nodes.
    first: usize,
    /// Triangles of a leaf; 0 for others.
    count: usize,
}

/// Surfaces, prepared for rays.
#[derive(Debug)]
pub(super) struct SurfaceRays<'a> {
    surfaces: &'a [Surface],
    faces: Vec<Face>,
    nodes: Vec<Node>,
    centre: DVec3,
    /// Half of the longest side of the box of all.
    size: f64,
}

/// A ray, as triangles see it.
#[derive(Clone, Copy)]
struct Line {
    /// The ray's point that is nearest to the middle of all: parameters count from there.
    start: DVec3,
    direction: DVec3,
    across: [DVec3; 2],
    range: [f64; 2],
}

impl<'a> SurfaceRays<'a> {
    /// For many rays: the surfaces that can be seen of those that `takes` names. None where there is no triangle.
    pub(super) fn new(surfaces: &'a [Surface], takes: impl Fn(&Surface) -> bool) -> Option<Self> {
        Self::with_leaves(surfaces, takes, LEAF)
    }

    /// For one ray, which looks at every triangle.
    pub(super) fn once(surfaces: &'a [Surface]) -> Option<Self> {
        Self::with_leaves(surfaces, |_| true, usize::MAX)
    }

    fn with_leaves(
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
        if faces.is_empty() {
            return None;
        }
        let nodes = tree(surfaces, &mut faces, largest);
        let Node { low, high, .. } = nodes[0];
        // Of a box without extent any unit does.
        let size = Some((0.5 * high - 0.5 * low).max_element()).filter(|size| *size > 0.0).unwrap_or(1.0);
        Some(Self { surfaces, faces, nodes, centre: 0.5 * low + 0.5 * high, size })
    }

    /// What a ray meets behind the beginning of a range and up to its end, front to back, and nothing behind the first
    /// that is opaque; `direction` has unit length.
    pub(super) fn hits(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> Vec<Hit> {
        let nearest = (self.centre - origin).dot(direction);
        let (u, v) = direction.any_orthonormal_pair();
        let mut line = Line {
            start: origin + direction * nearest,
            direction,
            across: [u, v],
            range: range.map(|t| t - nearest),
        };
        let mut hits: Vec<Hit> = Vec::new();
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            let node = &self.nodes[node];
            if !line.meets(node) {
                continue;
            }
            if node.count == 0 {
                // The nearer one is looked at first: it may hide the other.
                let [a, b] = [node.first, node.first + 1];
                let ahead = |node: usize| {
                    let Node { low, high, .. } = self.nodes[node];
                    (0.5 * low + 0.5 * high).dot(direction)
                };
                open.extend(if ahead(a) < ahead(b) { [b, a] } else { [a, b] });
            }
            for &face in &self.faces[node.first..][..node.count] {
                if let Some(hit) = self.hit(face, &line) {
                    if hit.opaque {
                        line.range[1] = line.range[1].min(hit.t);
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
            hit.t += nearest;
        }
        hits
    }

    /// Where a ray meets a triangle; the parameter counts from the ray's `start`.
    fn hit(&self, face: Face, line: &Line) -> Option<Hit> {
        let surface = &self.surfaces[num::index(face.surface)];
        let corners = corners(surface, face.triangle);
        let relative = corners.map(|p| p - line.start);
        let plane = relative.map(|p| DVec2::new(p.dot(line.across[0]), p.dot(line.across[1])) / self.size);
        let [a, b, c] = plane;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if low.x > 0.0 || low.y > 0.0 || high.x < 0.0 || high.y < 0.0 {
            return None;
        }
        let [bc, ca, ab] = [side(b, c), side(c, a), side(a, b)];
        if bc.0 != ca.0 || ca.0 != ab.0 {
            return None;
        }
        // In an order of the places: triangles of the same corners are met at the same parameter.
        let mut parts =
            [0, 1, 2].map(|i| (corners[i], [bc.1, ca.1, ab.1][i], relative[i].dot(line.direction)));
        parts.sort_unstable_by(|a, b| {
            let order = |axis: usize| a.0[axis].total_cmp(&b.0[axis]);
            order(0).then(order(1)).then(order(2))
        });
        let t = mean(parts.map(|part| part.1), parts.map(|part| part.2));
        // A triangle that is too small for its own areas has no place.
        if !(t > line.range[0] && t <= line.range[1]) {
            return None;
        }
        let [r, g, b, alpha] = surface.colour();
        let shade = match surface.shading() {
            Shading::Flat => 1.0,
            Shading::Headlight => normal(corners).dot(line.direction).abs().min(1.0),
        };
        let colour = [r * shade * alpha, g * shade * alpha, b * shade * alpha, alpha];
        Some(Hit { t, colour, opaque: surface.is_opaque(), face })
    }
}

/// Places of a triangle's corners.
fn corners(surface: &Surface, triangle: u32) -> [DVec3; 3] {
    surface.triangles()[num::index(triangle)].map(|i| surface.points()[num::index(i)])
}

/// The unit normal; none of a triangle without area.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    // Products neither overflow nor vanish when the longest side is 1.
    let (e, f) = (b - a, c - a);
    let longest = e.abs().max(f.abs()).max_element();
    let normal = (e / longest).cross(f / longest);
    let length = normal.abs().max_element();
    if length > 0.0 { (normal / length).normalize() } else { DVec3::ZERO }
}

impl Line {
    /// Whether the ray may meet what is in a box: the box's shadows across the ray and along it.
    fn meets(&self, node: &Node) -> bool {
        let centre = (0.5 * node.low + 0.5 * node.high) - self.start;
        let half = 0.5 * node.high - 0.5 * node.low;
        let margin = ROUNDING * (centre.abs() + half + self.start.abs()).element_sum();
        let shadow = |axis: DVec3| (centre.dot(axis), half.dot(axis.abs()) + margin);
        let across = |axis: DVec3| {
            let (middle, half) = shadow(axis);
            middle.abs() <= half
        };
        let (middle, half) = shadow(self.direction);
        across(self.across[0])
            && across(self.across[1])
            && middle + half >= self.range[0]
            && middle - half <= self.range[1]
    }
}

/// Sorts triangles into a tree of leaves of at most `largest`: each node's are parted at the median of their boxes' centres, along the longest side
/// of the box of those.
fn tree(surfaces: &[Surface], faces: &mut [Face], largest: usize) -> Vec<Node> {
    let extent = |face: Face| {
        let [a, b, c] = corners(&surfaces[num::index(face.surface)], face.triangle);
        (a.min(b).min(c), a.max(b).max(c))
    };
    let middle = |face: Face| {
        let (low, high) = extent(face);
        0.5 * low + 0.5 * high
    };
    let leaf = |first: usize, count: usize| Node { low: DVec3::ZERO, high: DVec3::ZERO, first, count };
    let mut nodes = vec![leaf(0, faces.len())];
    let mut next = 0;
    while next < nodes.len() {
        let Node { first, count, .. } = nodes[next];
        let some = &mut faces[first..first + count];
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut least, mut most) = (low, high);
        for &face in some.iter() {
            let (from, to) = extent(face);
            (low, high) = (low.min(from), high.max(to));
            let middle = middle(face);
            (least, most) = (least.min(middle), most.max(middle));
        }
        (nodes[next].low, nodes[next].high) = (low, high);
        if count > largest {
            let axis = (most - least).max_position();
            some.select_nth_unstable_by(count / 2, |a, b| middle(*a)[axis].total_cmp(&middle(*b)[axis]));
            (nodes[next].first, nodes[next].count) = (nodes.len(), 0);
            nodes.push(leaf(first, count / 2));
            nodes.push(leaf(first + count / 2, count - count / 2));
        }
        next += 1;
    }
    nodes
}
