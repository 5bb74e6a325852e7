//! Faces of a tetrahedral mesh: adjacent cells, the boundary, and seams.
//!
//! The faces of all cells go into buckets by their least corner; each bucket is sorted by the other two
//! corners. A mesh of n cells with d faces per bucket costs O(n log d), in two passes over memory.

use std::cmp::Ordering;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Tets, predicates};

/// Stands for "no cell" and "no face".
pub(crate) const NONE: u32 = u32::MAX;

/// Corners of the face opposite to each corner of a cell, in the order in which the normal (b - a) x (c - a)
/// points into the cell.
const INWARD: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// A triangle at which cells meet. Its normal is (b - a) x (c - a).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Face {
    /// Indices of points, a < b < c.
    pub corners: [u32; 3],
    /// The cell on the side that the normal points to, or [`NONE`].
    pub front: u32,
    /// The cell on the other side, or [`NONE`].
    pub back: u32,
}

impl Face {
    /// Returns whether the face has a cell on one side only.
    pub(crate) fn is_boundary(&self) -> bool {
        self.front == NONE || self.back == NONE
    }

    /// Returns the one cell of a boundary face.
    pub(crate) fn only(&self) -> u32 {
        if self.front == NONE { self.back } else { self.front }
    }
}

/// The faces of a mesh and their relations.
///
/// Cells are valid but need not partition space: more than two may share a face, or two may lie on the same
/// side of it. The list holds such a face several times: cells on opposite sides are paired in the order of
/// their indices, and each remaining cell has a boundary face. No face of a cell is lost.
#[derive(Debug)]
pub(crate) struct Topology {
    faces: Vec<Face>,
    cell_faces: Vec<[u32; 4]>,
    outline: Vec<u32>,
    seams: Vec<[u32; 2]>,
    split: usize,
    convex: bool,
}

/// A face of one cell, in the bucket of its least corner.
#[derive(Clone, Copy, Default)]
struct Side {
    /// Second corner and third corner.
    others: u64,
    /// Cell, number of the opposite corner, and whether the cell lies behind the face: 29 + 2 + 1 bits.
    /// Sorting by (others, cell) makes the result a function of the mesh alone.
    cell: u32,
}

impl Topology {
    /// Largest number of cells, which [`Side`] can index.
    const MAX_CELLS: usize = 1 << 29;

    /// Finds the faces of a mesh; needs 64 bytes for each cell beside the result.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] for a mesh of more than 2^29 cells.
    pub(crate) fn new(mesh: &Tets) -> Result<Self> {
        let cells = mesh.cells();
        if cells.len() > Self::MAX_CELLS {
            let most = format!("at most {} are supported", Self::MAX_CELLS);
            return Err(Error::unsupported(format!("mesh of {} tetrahedra", cells.len()), most));
        }
        let (mut sides, ends) = bucket(cells, mesh.points().len());
        let mut faces = Vec::with_capacity(cells.len() * 2 + cells.len() / 8);
        let mut cell_faces = vec![[NONE; 4]; cells.len()];
        let mut split = 0;
        let mut begin = 0;
        for (least, &end) in (0..).zip(&ends) {
            let end = num::index(end);
            let bucket = &mut sides[begin..end];
            begin = end;
            bucket.sort_unstable_by_key(|side| (side.others, side.cell));
            for group in bucket.chunk_by(|a, b| a.others == b.others) {
                let before = faces.len();
                add_faces(group, least, &mut faces, &mut cell_faces);
                split += usize::from(faces.len() > before + 1);
            }
        }
        let boundary: Vec<u32> =
            (0..).zip(&faces).filter(|(_, face)| face.is_boundary()).map(|(i, _)| i).collect();
        let twins = Twins::new(&faces, &boundary, mesh.points());
        let (seams, outline) = match_seams(&faces, &boundary, &twins);
        let convex = split == 0 && is_convex(&faces, &outline, &twins, mesh.points());
        Ok(Self { faces, cell_faces, outline, seams, split, convex })
    }

    /// Returns every face, by ascending corners.
    pub(crate) fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// Returns the indices of each cell's faces, opposite to its corners 0 to 3.
    pub(crate) fn cell_faces(&self) -> &[[u32; 4]] {
        &self.cell_faces
    }

    /// Returns the ascending indices of the boundary faces that are on no seam: the true surface of the mesh.
    pub(crate) fn outline(&self) -> &[u32] {
        &self.outline
    }

    /// Returns pairs of boundary faces at the same place with different points and cells on opposite sides.
    pub(crate) fn seams(&self) -> &[[u32; 2]] {
        &self.seams
    }

    /// Returns the number of triangles shared by more than two cells, or by two on the same side: cells
    /// overlap there.
    pub(crate) fn split(&self) -> usize {
        self.split
    }

    /// Returns whether the outline is one convex surface, so that no ray enters the mesh twice.
    ///
    /// The test is exact, and therefore rarely succeeds for rounded coordinates.
    pub(crate) fn is_convex(&self) -> bool {
        self.convex
    }

    /// Checks that these can be the faces of a mesh.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the mesh has another number of cells.
    pub(crate) fn check(&self, mesh: &Tets) -> Result<()> {
        let (known, given) = (self.cell_faces.len(), mesh.cells().len());
        if known == given {
            return Ok(());
        }
        Err(Error::invalid("topology", format!("made for {known} tetrahedra, the mesh has {given}")))
    }

    /// Returns the number of faces with a cell on one side only, including those on seams.
    #[cfg(test)]
    pub(crate) fn boundary_len(&self) -> usize {
        self.outline.len() + 2 * self.seams.len()
    }
}

/// Returns all faces of all cells, sorted by their least corner, and the end of each corner's bucket.
fn bucket(cells: &[[u32; 4]], points: usize) -> (Vec<Side>, Vec<u32>) {
    // The two least corners of a cell. The least one belongs to three faces and is their least corner; the
    // fourth face has the second one.
    let least = |cell: &[u32; 4]| {
        let (a, b) = (cell[0].min(cell[1]), cell[0].max(cell[1]));
        let (c, d) = (cell[2].min(cell[3]), cell[2].max(cell[3]));
        (num::index(a.min(c)), num::index(a.max(c).min(if a < c { b } else { d })))
    };
    let mut next = vec![0_u32; points];
    for cell in cells {
        let (first, second) = least(cell);
        next[first] += 3;
        next[second] += 1;
    }
    let mut sum = 0;
    for next in &mut next {
        (*next, sum) = (sum, sum + *next);
    }
    let mut sides = vec![Side::default(); cells.len() * 4];
    for (number, cell) in (0_u32..).zip(cells) {
        for (opposite, inward) in (0_u32..).zip(INWARD) {
            let ([a, b, c], odd) = ascending(inward.map(|i| cell[i]));
            let place = &mut next[num::index(a)];
            sides[num::index(*place)] = Side {
                others: u64::from(b) << 32 | u64::from(c),
                cell: number << 3 | opposite << 1 | u32::from(odd),
            };
            *place += 1;
        }
    }
    (sides, next)
}

/// Returns the corners in ascending order and whether that reversed the orientation.
fn ascending([a, b, c]: [u32; 3]) -> ([u32; 3], bool) {
    let (low, high) = (a.min(b), a.max(b));
    let turned = a > b;
    if c < low {
        ([c, low, high], turned)
    } else if c < high {
        ([low, c, high], !turned)
    } else {
        ([low, high, c], turned)
    }
}

/// Adds the faces of all sides of one triangle.
///
/// `INWARD` lists corners whose normal points into the cell; if sorting keeps the orientation, the cell is in
/// front.
fn add_faces(group: &[Side], least: u32, faces: &mut Vec<Face>, cell_faces: &mut [[u32; 4]]) {
    let mut fronts = group.iter().filter(|side| side.cell & 1 == 0);
    let mut backs = group.iter().filter(|side| side.cell & 1 == 1);
    loop {
        let (front, back) = (fronts.next(), backs.next());
        let Some(others) = front.or(back).map(|side| side.others) else { return };
        let number = num::count(faces.len());
        let mut cell_of = |side: Option<&Side>| {
            side.map_or(NONE, |side| {
                let cell = side.cell >> 3;
                cell_faces[num::index(cell)][num::index(side.cell >> 1 & 3)] = number;
                cell
            })
        };
        let (front, back) = (cell_of(front), cell_of(back));
        let [b, c] = [others >> 32, others & u64::from(u32::MAX)].map(|i| u32::try_from(i).unwrap_or(NONE));
        faces.push(Face { corners: [least, b, c], front, back });
    }
}

/// Points of the boundary that coincide with others to the bit.
struct Twins(Vec<(u32, u32)>);

impl Twins {
    fn new(faces: &[Face], boundary: &[u32], points: &[DVec3]) -> Self {
        let mut corners: Vec<u32> = boundary.iter().flat_map(|&i| faces[num::index(i)].corners).collect();
        corners.sort_unstable();
        corners.dedup();
        // Adding +0 turns -0 into +0.
        let place = |i: u32| (points[num::index(i)] + DVec3::ZERO).to_array().map(f64::to_bits);
        let mut by_place: Vec<([u64; 3], u32)> = corners.iter().map(|&i| (place(i), i)).collect();
        by_place.sort_unstable();
        let groups = by_place.chunk_by(|a, b| a.0 == b.0);
        let mut twins: Vec<(u32, u32)> =
            groups.filter(|g| g.len() > 1).flat_map(|g| g.iter().map(|&(_, i)| (i, g[0].1))).collect();
        twins.sort_unstable();
        Self(twins)
    }

    /// Returns the first of the points that coincide with this one.
    fn first(&self, point: u32) -> u32 {
        self.0.binary_search_by_key(&point, |twin| twin.0).map_or(point, |place| self.0[place].1)
    }
}

/// Returns the pairs of boundary faces that coincide, and the remaining ones.
fn match_seams(faces: &[Face], boundary: &[u32], twins: &Twins) -> (Vec<[u32; 2]>, Vec<u32>) {
    if twins.0.is_empty() {
        return (Vec::new(), boundary.to_vec());
    }
    let mut sides: Vec<([u32; 3], u32, bool)> = boundary
        .iter()
        .map(|&i| {
            let face = faces[num::index(i)];
            let (corners, odd) = ascending(face.corners.map(|i| twins.first(i)));
            (corners, i, odd != (face.front == NONE))
        })
        .collect();
    sides.sort_unstable();
    let (mut seams, mut outline) = (Vec::new(), Vec::new());
    for group in sides.chunk_by(|a, b| a.0 == b.0) {
        let mut fronts = group.iter().filter(|side| !side.2).map(|side| side.1);
        let mut backs = group.iter().filter(|side| side.2).map(|side| side.1);
        loop {
            match (fronts.next(), backs.next()) {
                (Some(front), Some(back)) => seams.push([front, back]),
                (None, None) => break,
                (front, back) => outline.extend(front.or(back)),
            }
        }
    }
    seams.sort_unstable();
    outline.sort_unstable();
    (seams, outline)
}

/// Returns whether the outline is connected and locally convex everywhere, which makes it the surface of one
/// convex body (van Heijenoort 1952).
fn is_convex(faces: &[Face], outline: &[u32], twins: &Twins, points: &[DVec3]) -> bool {
    // Each edge with the face, by its place in the outline, and the opposite corner.
    let mut edges: Vec<([u32; 2], u32, u32)> = (0..)
        .zip(outline)
        .flat_map(|(place, &i)| {
            let [a, b, c] = faces[num::index(i)].corners.map(|i| twins.first(i));
            [[a, b, c], [b, c, a], [c, a, b]].map(|[a, b, c]| ([a.min(b), a.max(b)], place, c))
        })
        .collect();
    edges.sort_unstable();
    let mut root: Vec<u32> = (0..num::count(outline.len())).collect();
    let mut parts = outline.len();
    for pair in edges.chunk_by(|a, b| a.0 == b.0) {
        let &[(ends, one, apex), (_, other, far)] = pair else { return false };
        let face = faces[num::index(outline[num::index(one)])];
        let at = |i: u32| points[num::index(i)];
        let [a, b, c] = face.corners.map(at);
        let outside = if face.front == NONE { Ordering::Greater } else { Ordering::Less };
        let side = predicates::sign([[b, a], [c, a], [at(far), a]]);
        // In one plane the second face continues the first, or folds back onto it.
        let [from, to] = ends.map(at);
        let folded = || (to - from).cross(at(apex) - from).dot((to - from).cross(at(far) - from)) >= 0.0;
        if side == outside || (side.is_eq() && folded()) {
            return false;
        }
        let [one, other] = [one, other].map(|mut i| {
            while root[num::index(i)] != i {
                root[num::index(i)] = root[num::index(root[num::index(i)])];
                i = root[num::index(i)];
            }
            i
        });
        if one != other {
            root[num::index(one)] = other;
            parts -= 1;
        }
    }
    parts == 1
}

#[cfg(test)]
pub(crate) mod tests;
