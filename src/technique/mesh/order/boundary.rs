//! What lies in front of what across gaps, along the rays of the pixels.
//!
//! For each pixel the outline's faces that its ray crosses are sorted by depth, entries and exits apart: the
//! cell that the ray leaves by its i-th exit comes before the one that it enters next. Cells of two sheets that
//! touch, or overlap a little because quadrangles that are not plane were cut along other diagonals, need
//! nothing special, because how deep exits lie compared with entries does not matter.
//!
//! Whether a ray crosses a face is decided by the signs of three determinants, one for each edge: float64 with an
//! error bound, exact where that does not tell. A ray that meets an edge exactly is moved by an infinitesimal
//! amount, to the right, and by one that is infinitely smaller, up; so each ray goes through the inside of faces
//! only, enters and leaves a closed outline in turn, and is never lost between two of its faces. The determinants
//! are homogeneous in the depth of corners: faces may cross the plane of the eye. Where sheets touch at an edge or
//! a corner and the ray goes through it, the same movement tells which of two crossings of equal depth is first.

use std::cmp::Ordering;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::num;
use crate::scene::topology::{Face, NONE, Topology};
use crate::scene::{Tets, View, predicates};
use crate::technique::mesh::order::eye::Eye;

/// Rows that are done at a time, where faces are not so large that their lists would be long.
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
    /// What rounding may have made of it.
    error: f64,
    /// Depth of the face's plane on a ray a little to the right and less than a little up.
    moved: f64,
}

/// Pairs of cells on a ray of the view, with a gap between them: the first one comes first. Sorted, each once.
///
/// Takes memory for the crossings of one band of rows on each thread, and the relations of all.
pub(crate) fn relations(mesh: &Tets, topology: &Topology, view: &View) -> Vec<[u32; 2]> {
    let rays = Rays::new(view);
    // Whether rays enter or leave, and rows: only of faces that can be crossed.
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
    /// Whether the eye is behind the face: its determinants are then positive.
    positive: bool,
}

/// The rays of all pixel centres: direction `forward + x right + y up`, or origin moved by that.
struct Rays<'a> {
    view: &'a View,
    eye: Eye,
}

/// Determinant of an edge as a function of the place in the image: x, y, 1; and a bound of its error there.
struct Edge {
    at: DVec3,
    error: f64,
}

impl<'a> Rays<'a> {
    fn new(view: &'a View) -> Self {
        Self { view, eye: Eye::of(view) }
    }

    /// The face with the rows of pixels whose rays may cross it.
    fn prepare(&self, mesh: &Tets, face: Face) -> Option<(Side, [u32; 2])> {
        let view = self.view;
        let eye = view.camera().eye;
        let corners = face.corners.map(|i| mesh.points()[num::index(i)] - eye);
        let depths = corners.map(|p| p.dot(view.forward()));
        let [width, height] = view.extent().map(f64::from);
        let mut rows = [0.0, height];
        // Depths are off by a few epsilon times the distance; where they are less than a millionth of it, the
        // face is looked for in every row.
        let clear = |i: usize| depths[i].abs() > 1e-6 * corners[i].length();
        if view.is_perspective() && (0..3).all(|i| depths[i] < 0.0 && clear(i)) {
            return None;
        }
        if !view.is_perspective() || (0..3).all(|i| depths[i] > 0.0 && clear(i)) {
            let pixel = |i: usize| {
                let size = view.pixel_size() * if view.is_perspective() { depths[i] } else { 1.0 };
                DVec2::new(corners[i].dot(view.right()), -corners[i].dot(view.up())) / size
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
        // Row r is at r + 1/2.
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
        // Rays go from the eye's side to the other one.
        let exit = if positive { face.front == NONE } else { face.back == NONE };
        let side = Side { corners: face.corners, cell: face.only(), exit, positive };
        Some((side, [first, num::u32_of(last)]))
    }

    /// Place of a pixel's centre in the image, in the units of [`Edge`].
    fn place(&self, x: u32, y: u32) -> DVec2 {
        let [width, height] = self.view.extent().map(f64::from);
        let centre = DVec2::new(f64::from(x) + 0.5 - width * 0.5, height * 0.5 - f64::from(y) - 0.5);
        centre * self.view.pixel_size()
    }

    /// A point and the direction of the ray of a place.
    fn ray(&self, place: DVec2) -> (DVec3, DVec3) {
        let offset = self.view.right() * place.x + self.view.up() * place.y;
        match self.eye {
            Eye::At(eye) => (eye, self.view.forward() + offset),
            Eye::Along(direction) => (self.view.camera().eye + offset, direction),
        }
    }

    /// det[a - o, b - o, d] for the ray (o, d).
    fn edge(&self, a: DVec3, b: DVec3) -> Edge {
        let (right, up, forward) = (self.view.right(), self.view.up(), self.view.forward());
        let eye = self.view.camera().eye;
        let (p, q) = (a - eye, b - eye);
        // Some thirty roundings at the most, each of no more than the product of lengths.
        let error = 64.0 * f64::EPSILON;
        if self.view.is_perspective() {
            let normal = p.cross(q);
            let at = DVec3::new(normal.dot(right), normal.dot(up), normal.dot(forward));
            Edge { at, error: error * p.length() * q.length() }
        } else {
            // Of o the plane component only counts: det[b - a, o - eye, d] is linear in it.
            let moved = (q - p).cross(forward);
            let at = DVec3::new(-moved.dot(right), -moved.dot(up), p.cross(q).dot(forward));
            // Origins are rounded with the eye's own size.
            let size = (q - p).length() * (1.0 + eye.length()) + p.length() * q.length();
            Edge { at, error: error * size }
        }
    }

    /// Sign of det[a - o, b - o, d] at a place, never Equal for an edge that is not seen end-on.
    fn sign(&self, edge: &Edge, ends: [DVec3; 2], place: DVec2) -> Ordering {
        let value = edge.at.x * place.x + edge.at.y * place.y + edge.at.z;
        let bound = edge.error * (1.0 + place.x.abs() + place.y.abs());
        if value.abs() > bound {
            return if value > 0.0 { Ordering::Greater } else { Ordering::Less };
        }
        self.exact(ends, place)
    }

    #[cold]
    fn exact(&self, [a, b]: [DVec3; 2], place: DVec2) -> Ordering {
        let (origin, direction) = self.ray(place);
        let along = predicates::along;
        let here = predicates::sign([[a, origin], [b, origin], along(direction)]);
        // Moved to the right, then up: what the determinant changes by.
        let moved = |by: DVec3| match self.eye {
            Eye::At(_) => predicates::sign([[a, origin], [b, origin], along(by)]),
            Eye::Along(_) => predicates::sign([[b, a], along(by), along(direction)]),
        };
        here.then_with(|| moved(self.view.right())).then_with(|| moved(self.view.up()))
    }

    /// Adds the crossings of a face with the rays of some rows.
    fn cross(&self, mesh: &Tets, side: &Side, rows: [u32; 2], band: u32, hits: &mut Vec<Hit>) {
        let width = self.view.extent()[0];
        let corners = side.corners.map(|i| mesh.points()[num::index(i)]);
        // Points of an edge in ascending order, so that both its faces round in the same way. The determinant of
        // the second edge is that of the face with the opposite sign.
        let ends = [[corners[1], corners[2]], [corners[0], corners[2]], [corners[0], corners[1]]];
        let wanted = [side.positive, !side.positive, side.positive];
        let edges = ends.map(|[a, b]| self.edge(a, b));
        let (u, v) = (corners[1] - corners[0], corners[2] - corners[0]);
        let (normal, size) = (u.cross(v), u.length() * v.length());
        let moved = DVec2::new(2.0_f64.powi(-16), 2.0_f64.powi(-32)) * self.view.pixel_size();
        for y in rows[0]..=rows[1] {
            let start = self.place(0, y);
            // Pixels where no determinant is surely of the wrong sign.
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

    /// Adds the relations of one pixel from its sorted crossings.
    fn pair(&self, mesh: &Tets, topology: &Topology, hits: &[Hit], band: u32, pairs: &mut Vec<[u32; 2]>) {
        let (entries, exits) = hits.split_at(hits.partition_point(|hit| !hit.exit));
        // Cells that the ray starts in, which it leaves without having entered.
        let inside = exits.len().saturating_sub(entries.len());
        for (i, exit) in exits.iter().enumerate() {
            let Some(entry) = (i + 1).checked_sub(inside).and_then(|i| entries.get(i)) else { continue };
            if exit.cell == entry.cell {
                continue;
            }
            let mut pair = [exit.cell, entry.cell];
            if exit.depth - entry.depth > exit.error + entry.error {
                // They overlap: by the middles of their pieces.
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

/// Depth of the middle of what a cell has of a ray.
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
