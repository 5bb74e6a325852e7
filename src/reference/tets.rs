//! Rays through a tetrahedral mesh, cut at every face.
//!
//! No connectivity is used: every tetrahedron is intersected separately, and the pieces of a ray are sorted.
//! So cells may be in any order, with holes, seams and overlaps.
//!
//! Projected along the ray, the corners are points of a plane and the ray is its origin. The ray crosses a
//! face if the origin lies in the face's projection. The orientation of the origin to each edge is exact.
//! Where the ray meets an edge or a corner, an infinitely small offset decides, the same for all cells
//! (Edelsbrunner and Mücke 1990, simulation of simplicity). So a ray in a shared face or along a shared edge
//! belongs to one cell, and each cell is entered once and left once or not at all. Two cells with the same
//! corners of a face, in any order, have bit for bit the same crossing. Nothing is counted twice or missed.

use glam::{DVec2, DVec3};

use crate::num;
use crate::scene::{TetScalars, Tets, TransferFunction};

use super::march::{Classes, March, finite};

/// Scalars are clamped to this magnitude, so that their differences do not overflow. Only the transfer
/// function's ends, which replace infinities, can exceed it.
const MAX_SCALAR: f64 = 1e100;

/// The part of a ray inside one tetrahedron; the scalar is linear along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// The tetrahedron, as an index into [`Tets::cells`].
    pub cell: u32,
    /// Begin and end of the piece, in units of world length along the ray.
    pub t: [f64; 2],
    /// The scalars at begin and end.
    pub s: [f64; 2],
}

impl Piece {
    /// Returns the part of the piece inside a range.
    pub(super) fn within(self, range: [f64; 2]) -> Option<Self> {
        let Self { cell, t: [near, far], s: [first, last] } = self;
        let (t0, t1) = (near.max(range[0]), far.min(range[1]));
        if !(t0 < t1 && near <= far) {
            return None;
        }
        let at = |t: f64| {
            let share = (t - near) / (far - near);
            (first + (last - first) * share).max(first.min(last)).min(first.max(last))
        };
        let s = [if t0 > near { at(t0) } else { first }, if t1 < far { at(t1) } else { last }];
        Some(Self { cell, t: [t0, t1], s })
    }
}

/// A ray in the form that intersection tests need.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalRay {
    /// The point of the ray nearest to the data's centre. Parameters count from there, so they are as small
    /// as the data, however far the eye is.
    pub(super) start: DVec3,
    pub(super) direction: DVec3,
    /// Two axes perpendicular to the ray.
    pub(super) across: [DVec3; 2],
    pub(super) range: [f64; 2],
    /// Parameter of `start`, measured from the origin.
    pub(super) nearest: f64,
}

impl LocalRay {
    pub(super) fn new(centre: DVec3, origin: DVec3, direction: DVec3, range: [f64; 2]) -> Self {
        let nearest = (centre - origin).dot(direction);
        let (start, across) = (origin + direction * nearest, direction.any_orthonormal_pair().into());
        Self { start, direction, across, range: range.map(|t| t - nearest), nearest }
    }
}

/// A tetrahedron with finite scalars.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    index: u32,
    /// The corners' x, y and z, in ascending order of their indices, so that two cells treat shared corners alike. Lists
    /// of coordinates, because the compiler then computes with several corners at once.
    points: [[f64; 4]; 3],
    s: [f64; 4],
}

impl Cell {
    /// Returns the part of a ray inside the tetrahedron. Parameters count from the ray's `start`.
    pub(super) fn piece(&self, ray: &LocalRay) -> Option<Piece> {
        let start = ray.start.to_array();
        let relative: [[f64; 4]; 3] =
            std::array::from_fn(|axis| std::array::from_fn(|i| self.points[axis][i] - start[axis]));
        let along = |direction: DVec3| -> [f64; 4] {
            let [x, y, z] = &relative;
            std::array::from_fn(|i| x[i] * direction.x + y[i] * direction.y + z[i] * direction.z)
        };
        // Reject by the projection's box first: many cells are missed.
        let misses = |[a, b, c, d]: [f64; 4]| a.min(b).min(c.min(d)) > 0.0 || a.max(b).max(c.max(d)) < 0.0;
        let (right, up) = (along(ray.across[0]), along(ray.across[1]));
        if misses(right) || misses(up) {
            return None;
        }
        let [a, b, c, d] = std::array::from_fn(|i| DVec2::new(right[i], up[i]));
        let sides = (side(a, b), side(a, c), side(a, d), side(b, c), side(b, d), side(c, d));
        let (ab, ac, ad, bc, bd, cd) = sides;
        let positive = [ab.0, ac.0, ad.0, bc.0, bd.0, cd.0];
        let areas = [ab.1, ac.1, ad.1, bc.1, bd.1, cd.1];
        // The origin lies on the same side of ab, bc and ca.
        let crossed =
            each(FACES, |(_, [bc, ac, ab])| positive[ab] == positive[bc] && positive[ab] != positive[ac]);
        let mut faces = FACES.iter().zip(crossed).filter_map(|(face, crossed)| crossed.then_some(face));
        let first = faces.next()?;
        let depths = along(ray.direction);
        let crossing = |&(face, edges): &([usize; 3], [usize; 3])| {
            let weights = edges.map(|edge| areas[edge]);
            [mean(weights, face.map(|i| depths[i])), mean(weights, face.map(|i| self.s[i]))]
        };
        let (mut near, mut far) = (crossing(first), crossing(faces.next()?));
        if far[0] < near[0] {
            (near, far) = (far, near);
        }
        Piece { cell: self.index, t: [near[0], far[0]], s: [near[1], far[1]] }.within(ray.range)
    }
}

/// Applies a function to four items. Unlike `map` of arrays, the compiler always inlines it.
fn each<T, U>([a, b, c, d]: [T; 4], f: impl Fn(T) -> U) -> [U; 4] {
    [f(a), f(b), f(c), f(d)]
}

/// A mesh and its transfer function, prepared for rays.
#[derive(Debug)]
pub(super) struct TetRays<'a> {
    pub(super) mesh: &'a Tets,
    classes: Classes,
    centre: DVec3,
    /// Half the diagonal of the mesh's box.
    radius: f64,
    /// Scalars that stand for -Inf and +Inf.
    ends: [f64; 2],
}

impl<'a> TetRays<'a> {
    pub(super) fn new(mesh: &'a Tets, transfer: &TransferFunction) -> Self {
        let [low, high] = mesh.bounds();
        Self {
            mesh,
            classes: Classes::new(transfer),
            centre: 0.5 * (low + high),
            radius: 0.5 * (high - low).length(),
            ends: transfer.domain().map(|s| s.clamp(-MAX_SCALAR, MAX_SCALAR)),
        }
    }

    /// Prepares a ray, with axes in units of the mesh's size. `direction` has unit length, so the parameter is a
    /// world length.
    pub(super) fn ray(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> LocalRay {
        let ray = LocalRay::new(self.centre, origin, direction, range);
        LocalRay { across: ray.across.map(|axis| axis / self.radius), ..ray }
    }

    /// Intersects one ray with every tetrahedron and integrates it.
    pub(super) fn trace(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> [f64; 4] {
        let ray = self.ray(origin, direction, range);
        let all = self.all().filter(|&cell| self.shows(cell)).filter_map(|cell| self.cell(cell));
        let mut pieces: Vec<Piece> = all.filter_map(|cell| cell.piece(&ray)).collect();
        self.integrate(&mut pieces)
    }

    /// Returns the indices of all tetrahedra.
    pub(super) fn all(&self) -> std::ops::Range<u32> {
        0..num::count(self.mesh.cells().len())
    }

    /// Returns a tetrahedron, or `None` if a scalar of it is NaN.
    pub(super) fn cell(&self, index: u32) -> Option<Cell> {
        let mut corners = self.mesh.cells()[num::index(index)];
        corners.sort_unstable();
        let s = self.scalars(index, corners)?;
        let points = each(corners, |i| self.mesh.points()[num::index(i)]);
        Some(Cell { index, points: [0, 1, 2].map(|axis| each(points, |point| point[axis])), s })
    }

    /// Returns the scalars of a tetrahedron's corners, or `None` if one is NaN.
    fn scalars(&self, index: u32, corners: [u32; 4]) -> Option<[f64; 4]> {
        let s = match self.mesh.scalars() {
            TetScalars::Point(values) => each(corners, |i| values[num::index(i)]),
            TetScalars::Cell(values) => [values[num::index(index)]; 4],
        };
        (!s.iter().any(|s| s.is_nan())).then(|| each(s, |s| finite(s.into(), self.ends)))
    }

    /// Returns whether extinction is positive anywhere in a tetrahedron.
    pub(super) fn shows(&self, index: u32) -> bool {
        let Some(s) = self.scalars(index, self.mesh.cells()[num::index(index)]) else { return false };
        let low = s.into_iter().fold(f64::INFINITY, f64::min);
        let high = s.into_iter().fold(f64::NEG_INFINITY, f64::max);
        !self.classes.is_vacuum([low, high])
    }

    /// Integrates emission and absorption along pieces, after sorting them.
    pub(super) fn integrate(&self, pieces: &mut [Piece]) -> [f64; 4] {
        sort(pieces);
        let mut march = March::new(self.classes.most.to_array());
        for Piece { t, s, .. } in pieces {
            march.add_cubic(&self.classes, &[s[0], s[1] - s[0], 0.0, 0.0], t[1] - t[0], None);
            if march.is_opaque() {
                break;
            }
        }
        march.pixel()
    }
}

/// Corners a < b < c of the faces, and the indices of the edges bc, ac, ab among 01, 02, 03, 12, 13, 23.
const FACES: [([usize; 3], [usize; 3]); 4] =
    [([0, 1, 2], [3, 1, 0]), ([0, 1, 3], [4, 2, 0]), ([0, 2, 3], [5, 2, 1]), ([1, 2, 3], [5, 4, 3])];

/// Returns the mean with non-negative weights, kept within the range of the values despite rounding.
pub(super) fn mean(weights: [f64; 3], of: [f64; 3]) -> f64 {
    let sum = weights[0] + weights[1] + weights[2];
    let mean = (weights[0] * of[0] + weights[1] * of[1] + weights[2] * of[2]) / sum;
    if mean.is_nan() {
        return mean;
    }
    mean.max(of[0].min(of[1]).min(of[2])).min(of[0].max(of[1]).max(of[2]))
}

/// Sorts pieces front to back.
///
/// The middle orders adjacent pieces whatever the rounding of their ends. Overlapping pieces have no correct
/// order; the cell's index makes it unique.
pub(super) fn sort(pieces: &mut [Piece]) {
    let middle = |piece: &Piece| piece.t[0] + piece.t[1];
    pieces.sort_unstable_by(|a, b| middle(a).total_cmp(&middle(b)).then(a.cell.cmp(&b.cell)));
}

/// Returns on which side of the origin the edge from a to b passes (true for counter-clockwise), and twice
/// the area of its triangle with the origin.
///
/// The sign is exact. If it is zero, the origin is taken to be at `(e, e²)` with a positive e smaller than
/// any number; the determinant is then `e (ay - by) + e² (bx - ax)`. The area is accurate to its last digits,
/// by Kahan's difference of products with Dekker's exact product.
pub(super) fn side(a: DVec2, b: DVec2) -> (bool, f64) {
    let (p, q) = (a.x * b.y, a.y * b.x);
    let mut area = p - q;
    // Five or more bits cancel: the difference is exact, but the products are not.
    if area.abs() < 0.03125 * (p.abs() + q.abs()) {
        let (e, f) = (rest(a.x, b.y, p), rest(a.y, b.x, q));
        let difference = e - f;
        area += difference;
        if area == 0.0 {
            // The rounding error of the difference (Knuth's two-sum).
            let virtual_f = e - difference;
            area = (e - (difference + virtual_f)) + (virtual_f - f);
        }
    }
    let positive = if area != 0.0 {
        area > 0.0
    } else if a.y != b.y {
        a.y > b.y
    } else {
        b.x > a.x
    };
    (positive, area.abs())
}

/// Returns the rounding error of a product (Dekker 1971, with Veltkamp's splitting).
fn rest(a: f64, b: f64, product: f64) -> f64 {
    let split = |x: f64| {
        let c = 134_217_729.0 * x;
        let high = c - (c - x);
        (high, x - high)
    };
    let ((a1, a0), (b1, b0)) = (split(a), split(b));
    ((a1 * b1 - product) + a1 * b0 + a0 * b1) + a0 * b0
}
