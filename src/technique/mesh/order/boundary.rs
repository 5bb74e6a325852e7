//! Relations of cells across gaps, along the rays of the pixels.
//!
//! For each pixel, the faces of the outline that its ray crosses are sorted by depth, entries and exits separately. The
//! cell that the ray leaves by its i-th exit comes before the cell that it enters next. Depths of exits are not compared
//! with those of entries. So two sheets may touch, or overlap a little because quadrilaterals that are not plane were
//! cut along different diagonals.
//!
//! The signs of three determinants, one for each edge, decide whether a ray crosses a face: in float64 with an error
//! bound, and exactly where the bound leaves the sign open. A ray that meets an edge is moved by an infinitesimal amount
//! to the right, and by an infinitely smaller one up. So each ray passes only through the inside of faces, enters and
//! leaves a closed outline alternately, and is never lost between two of its faces. The determinants are homogeneous in
//! the depth of corners, so faces may cross the plane of the eye. Where sheets touch at an edge or a corner that the ray
//! meets, the same movement decides which of two crossings of equal depth is first.

use std::cmp::Ordering;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::num;
use crate::scene::topology::{Face, NONE, Topology};
use crate::scene::{Tets, View, predicates};
use crate::technique::mesh::order::eye::Eye;

/// Rows of a band; large faces, which would be listed in many bands, double it.
const BAND: u32 = 8;

/// A crossing of ray and face.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hit {
    /// Pixel in its band, row by row.
    pixel: u32,
    /// Whether the ray leaves a cell there.
    exit: bool,
    /// The cell.
    cell: u32,
    /// In units of the ray's direction.
    depth: f64,
    /// Bound of the rounding error of the depth.
    error: f64,
    /// Depth of the face's plane on a ray slightly to the right, and much less up: decides ties.
    moved: f64,
}

/// Returns the pairs of cells with a gap between them on the ray of a pixel, nearer cell first, sorted and unique.
///
/// Takes memory for the crossings of one band of rows on each thread, and for all relations.
pub(crate) fn relations(mesh: &Tets, topology: &Topology, view: &View) -> Vec<[u32; 2]> {
    let rays = Rays::new(view);
    // Faces that rays can cross, with their direction and rows.
    let faces: Vec<(Side, [u32; 2])> = topology
        .outline()
        .par_iter()
        .filter_map(|&i| rays.prepare(mesh, topology.faces()[num::index(i)]))
        .collect();
    let height = view.extent()[1];
    let mut band = BAND;
    let listed = |band: u32| {
        faces.iter().map(|(_, [a, b])| num::wide(num::index(b / band - a / band + 1))).sum::<u64>()
    };
    while band < height && listed(band) > num::wide(faces.len()).saturating_mul(8).max(1 << 24) {
        band *= 2;
    }
    let bands = height.div_ceil(band);
    let mut starts = vec![0_usize; num::index(bands) + 1];
    for (_, [first, last]) in &faces {
        for band in first / band..=last / band {
            starts[num::index(band)] += 1;
        }
    }
    let mut sum = 0;
    for start in &mut starts {
        (*start, sum) = (sum, sum + *start);
    }
    let mut list = vec![0_u32; sum];
    let mut next = starts.clone();
    for (i, (_, [first, last])) in (0..).zip(&faces) {
        for band in first / band..=last / band {
            let next = &mut next[num::index(band)];
            list[*next] = i;
            *next += 1;
        }
    }
    let mut pairs: Vec<[u32; 2]> = (0..bands)
        .into_par_iter()
        .map_init(Vec::new, |hits, number| {
            hits.clear();
            let rows = [number * band, (number * band + band).min(height) - 1];
            for &i in &list[starts[num::index(number)]..starts[num::index(number) + 1]] {
                let (side, [first, last]) = &faces[num::index(i)];
                rays.cross(mesh, side, [rows[0].max(*first), rows[1].min(*last)], rows[0], hits);
            }
            hits.sort_unstable_by(|a: &Hit, b: &Hit| {
                (a.pixel, a.exit)
                    .cmp(&(b.pixel, b.exit))
                    .then(a.depth.total_cmp(&b.depth))
                    .then(a.cell.cmp(&b.cell))
            });
            let mut pairs = Vec::new();
            let tied = |a: &Hit, b: &Hit| {
                (a.pixel, a.exit) == (b.pixel, b.exit) && b.depth - a.depth <= a.error + b.error
            };
            for tied in hits.chunk_by_mut(tied).filter(|tied| tied.len() > 1) {
                tied.sort_by(|a, b| a.moved.total_cmp(&b.moved));
            }
            for pixel in hits.chunk_by(|a, b| a.pixel == b.pixel) {
                rays.pair(mesh, topology, pixel, rows[0], &mut pairs);
            }
            pairs.sort_unstable();
            pairs.dedup();
            pairs
        })
        .reduce(Vec::new, |mut all, mut more| {
            all.append(&mut more);
            all
        });
    pairs.par_sort_unstable();
    pairs.dedup();
    pairs
}

/// A face of the outline that rays cross in one direction.
#[derive(Clone, Copy, Debug)]
struct Side {
    corners: [u32; 3],
    cell: u32,
    exit: bool,
    /// Whether the eye is behind the face, so that its determinants are positive.
    positive: bool,
}

/// The rays of all pixel centres: direction `ahead + x across + y up`, or origin moved by `x across + y up`.
struct Rays<'a> {
    view: &'a View,
    eye: Eye,
}

/// The determinant of an edge: its coefficients of x, y and 1 in the image, and a bound of its error.
struct Edge {
    at: DVec3,
    error: f64,
}

impl<'a> Rays<'a> {
    fn new(view: &'a View) -> Self {
        Self { view, eye: Eye::of(view) }
    }

    /// Returns the face with the rows of pixels whose rays may cross it; `None` where no ray does.
    fn prepare(&self, mesh: &Tets, face: Face) -> Option<(Side, [u32; 2])> {
        let view = self.view;
        let eye = view.camera().eye;
        let corners = face.corners.map(|i| mesh.points()[num::index(i)] - eye);
        let depths = corners.map(|p| p.dot(view.forward()));
        let [width, height] = view.extent().map(f64::from);
        let mut rows = [0.0, height];
        // Depths have an error of a few epsilon times the distance. A face with a depth below a millionth of the
        // distance is searched in every row.
        let clear = |i: usize| depths[i].abs() > 1e-6 * corners[i].length();
        if view.is_perspective() && (0..3).all(|i| depths[i] < 0.0 && clear(i)) {
            return None;
        }
        if !view.is_perspective() || (0..3).all(|i| depths[i] > 0.0 && clear(i)) {
            let [right, up, _] = view.rows();
            let pixel = |i: usize| {
                let size = view.pixel_size() * if view.is_perspective() { depths[i] } else { 1.0 };
                DVec2::new(corners[i].dot(right), -corners[i].dot(up)) / size
            };
            let [a, b, c] = [0, 1, 2].map(pixel);
            let reach = a.length().max(b.length()).max(c.length());
            let slack = 1e-3 + 1e-8 * reach + 1e-12 * eye.length() / view.pixel_size();
            let half = DVec2::new(width, height) * 0.5;
            let (least, most) = (a.min(b).min(c) + half - slack, a.max(b).max(c) + half + slack);
            if most.x < 0.0 || least.x > width || most.y < 0.0 || least.y > height {
                return None;
            }
            rows = [least.y, most.y];
        }
        // The centre of row r is at r + 1/2.
        let first = num::u32_of((rows[0] - 0.5).ceil().max(0.0));
        let last = (rows[1] - 0.5).floor().min(height - 1.0);
        if last < f64::from(first) {
            return None;
        }
        let positive = match self.eye.side(&face, mesh.points()) {
            Ordering::Less => true,
            Ordering::Greater => false,
            Ordering::Equal => return None,
        };
        // Rays cross from the eye's side to the other one.
        let exit = if positive { face.front == NONE } else { face.back == NONE };
        let side = Side { corners: face.corners, cell: face.only(), exit, positive };
        Some((side, [first, num::u32_of(last)]))
    }

    /// Returns the place of a pixel's centre in the image, in the units of [`Edge`].
    fn place(&self, x: u32, y: u32) -> DVec2 {
        let [width, height] = self.view.extent().map(f64::from);
        let centre = DVec2::new(f64::from(x) + 0.5 - width * 0.5, height * 0.5 - f64::from(y) - 0.5);
        centre * self.view.pixel_size()
    }

    /// Returns a point and the direction of the ray of a place.
    fn ray(&self, place: DVec2) -> (DVec3, DVec3) {
        let offset = self.view.across() * place.x + self.view.up() * place.y;
        match self.eye {
            Eye::At(eye) => (eye, self.view.ahead() + offset),
            Eye::Along(direction) => (self.view.camera().eye + offset, direction),
        }
    }

    /// Returns det[a - o, b - o, d] as a function of the ray (o, d).
    fn edge(&self, a: DVec3, b: DVec3) -> Edge {
        let (across, up, ahead) = (self.view.across(), self.view.up(), self.view.ahead());
        let eye = self.view.camera().eye;
        let (p, q) = (a - eye, b - eye);
        // At most some thirty roundings, each relative to at most the product of lengths.
        let error = 64.0 * f64::EPSILON * ahead.length().max(across.length());
        if self.view.is_perspective() {
            let normal = p.cross(q);
            let at = DVec3::new(normal.dot(across), normal.dot(up), normal.dot(ahead));
            Edge { at, error: error * p.length() * q.length() }
        } else {
            // Only the component of o in the image plane counts: det[b - a, o - eye, d] is linear in it.
            let moved = (q - p).cross(ahead);
            let at = DVec3::new(-moved.dot(across), -moved.dot(up), p.cross(q).dot(ahead));
            // Origins have rounding errors relative to the eye's coordinates.
            let size = (q - p).length() * (1.0 + eye.length()) + p.length() * q.length();
            Edge { at, error: error * size }
        }
    }

    /// Returns the sign of det[a - o, b - o, d] at a place; `Equal` only for an edge that is seen end-on.
    fn sign(&self, edge: &Edge, ends: [DVec3; 2], place: DVec2) -> Ordering {
        let value = edge.at.x * place.x + edge.at.y * place.y + edge.at.z;
        let bound = edge.error * (1.0 + place.x.abs() + place.y.abs());
        if value.abs() > bound {
            return if value > 0.0 { Ordering::Greater } else { Ordering::Less };
        }
        self.exact(ends, place)
    }

    /// Returns the same sign in exact arithmetic.
    #[cold]
    fn exact(&self, [a, b]: [DVec3; 2], place: DVec2) -> Ordering {
        let (origin, direction) = self.ray(place);
        let along = predicates::along;
        let here = predicates::sign([[a, origin], [b, origin], along(direction)]);
        // The change of the determinant when the ray moves, to the right or up.
        let moved = |by: DVec3| match self.eye {
            Eye::At(_) => predicates::sign([[a, origin], [b, origin], along(by)]),
            Eye::Along(_) => predicates::sign([[b, a], along(by), along(direction)]),
        };
        here.then_with(|| moved(self.view.across())).then_with(|| moved(self.view.up()))
    }

    /// Adds the crossings of a face with the rays of some rows.
    fn cross(&self, mesh: &Tets, side: &Side, rows: [u32; 2], band: u32, hits: &mut Vec<Hit>) {
        let width = self.view.extent()[0];
        let corners = side.corners.map(|i| mesh.points()[num::index(i)]);
        // The points of an edge are in ascending order, so that both its faces round alike. This reverses the second
        // edge, and with it the sign of its determinant.
        let ends = [[corners[1], corners[2]], [corners[0], corners[2]], [corners[0], corners[1]]];
        let wanted = [side.positive, !side.positive, side.positive];
        let edges = ends.map(|[a, b]| self.edge(a, b));
        let (u, v) = (corners[1] - corners[0], corners[2] - corners[0]);
        let (normal, size) = (u.cross(v), u.length() * v.length());
        let moved = DVec2::new(2.0_f64.powi(-16), 2.0_f64.powi(-32)) * self.view.pixel_size();
        for y in rows[0]..=rows[1] {
            let start = self.place(0, y);
            // Narrow to the pixels where no determinant is certain to have the wrong sign.
            let (mut low, mut high) = (0.0_f64, f64::from(width) - 1.0);
            for (edge, positive) in edges.iter().zip(wanted) {
                let sign = if positive { 1.0 } else { -1.0 };
                let reach = 1.0 + start.x.abs() + start.y.abs();
                let value =
                    sign * (edge.at.x * start.x + edge.at.y * start.y + edge.at.z) + 2.0 * edge.error * reach;
                let slope = sign * edge.at.x * self.view.pixel_size();
                if slope > 0.0 {
                    low = low.max((-value / slope).floor() - 1.0);
                } else if slope < 0.0 {
                    high = high.min((-value / slope).ceil() + 1.0);
                } else if value < 0.0 {
                    high = -1.0;
                }
            }
            if low > high {
                continue;
            }
            for x in num::u32_of(low)..=num::u32_of(high) {
                let place = self.place(x, y);
                let inside = (0..3).all(|i| {
                    let wanted = if wanted[i] { Ordering::Greater } else { Ordering::Less };
                    self.sign(&edges[i], ends[i], place) == wanted
                });
                if inside {
                    let depth = |(origin, direction): (DVec3, DVec3)| {
                        let slope = normal.dot(direction);
                        let depth = normal.dot(corners[0] - origin) / slope;
                        let reach = (corners[0] - origin).length() + depth.abs() * direction.length();
                        (depth, 16.0 * f64::EPSILON * size * reach / slope.abs())
                    };
                    let (depth, error, moved) = {
                        let (there, _) = depth(self.ray(place + moved));
                        let (here, error) = depth(self.ray(place));
                        (here, error, there)
                    };
                    let pixel = (y - band) * width + x;
                    hits.push(Hit { pixel, exit: side.exit, cell: side.cell, depth, error, moved });
                }
            }
        }
    }

    /// Adds the relations of one pixel, from its sorted crossings.
    fn pair(&self, mesh: &Tets, topology: &Topology, hits: &[Hit], band: u32, pairs: &mut Vec<[u32; 2]>) {
        let (entries, exits) = hits.split_at(hits.partition_point(|hit| !hit.exit));
        // The ray starts in this many cells, and leaves them without having entered.
        let inside = exits.len().saturating_sub(entries.len());
        for (i, exit) in exits.iter().enumerate() {
            let Some(entry) = (i + 1).checked_sub(inside).and_then(|i| entries.get(i)) else { continue };
            if exit.cell == entry.cell {
                continue;
            }
            let mut pair = [exit.cell, entry.cell];
            if exit.depth - entry.depth > exit.error + entry.error {
                // The cells overlap; the middles of their segments decide.
                let width = self.view.extent()[0];
                let ray = self.ray(self.place(exit.pixel % width, band + exit.pixel / width));
                let middle = |cell| middle(mesh, topology, cell, ray);
                if middle(exit.cell) > middle(entry.cell) {
                    pair.reverse();
                }
            }
            pairs.push(pair);
        }
    }
}

/// Returns the depth of the middle of a ray's segment inside a cell.
fn middle(mesh: &Tets, topology: &Topology, cell: u32, (origin, direction): (DVec3, DVec3)) -> f64 {
    let (mut begin, mut end) = (f64::NEG_INFINITY, f64::INFINITY);
    for number in topology.cell_faces()[num::index(cell)] {
        let face = topology.faces()[num::index(number)];
        let [a, b, c] = face.corners.map(|i| mesh.points()[num::index(i)]);
        let normal = (b - a).cross(c - a) * if face.front == cell { 1.0 } else { -1.0 };
        let (slope, depth) = (normal.dot(direction), normal.dot(a - origin) / normal.dot(direction));
        if slope > 0.0 {
            begin = begin.max(depth);
        } else if slope < 0.0 {
            end = end.min(depth);
        }
    }
    (begin + end) * 0.5
}
