//! Faces of a tetrahedral mesh: which cells meet at each, which lie on its outside, where it has seams.
//!
//! The faces of all cells are put in buckets by their least corner and sorted there by the other two, so a
//! mesh of n cells costs O(n log d) for d faces at a corner, in two passes over memory.

use std::cmp::Ordering;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Tets, predicates};

/// No cell, no face.
pub(crate) const NONE: u32 = u32::MAX;

/// Corners of the face opposite to each corner of a cell, in the order in which their normal
/// (b - a) x (c - a) points into the cell.
const INWARD: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// A triangle where cells meet. Its normal is (b - a) x (c - a).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Face {
    /// Points a < b < c.
    pub corners: [u32; 3],
    /// The cell on the side that the normal points to, or [`NONE`].
    pub front: u32,
    /// The cell on the other side, or [`NONE`].
    pub back: u32,
}

impl Face {
    /// Whether it has a cell on one side only.
    pub(crate) fn is_boundary(&self) -> bool {
        self.front == NONE || self.back == NONE
    }

    /// The one cell of a boundary face.
    pub(crate) fn only(&self) -> u32 {
        if self.front == NONE { self.back } else { self.front }
    }
}

/// The faces of a mesh.
///
/// Cells are valid but need not be a partition of space: more than two may share a face, or two on the same
/// side of it. Such a face stands in the list several times: cells of opposite sides are paired in the order
/// of their numbers, those that remain have a boundary face each. No face of a cell is lost.
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
    /// Second corner, third corner.
    others: u64,
    /// Cell, number of the opposite corner, whether the cell lies behind: 29 + 2 + 1 bits, so that sorting
    /// by (others, cell) makes the result a function of the mesh alone.
    cell: u32,
}

impl Topology {
    /// Most cells of a mesh: what [`Side`] can number.
    const MAX_CELLS: usize = 1 << 29;

    /// Finds the faces of a mesh. Takes 64 bytes for each cell beside the result.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] for a mesh of more than 2^29 cells.
    pub(crate) fn new(mesh: &Tets) -> Result<Self> {
        let cells = mesh.cells();
        if cells.len() > Self::MAX_CELLS {
            return Err(Error::unsupported(
                format!("mesh of {} tetrahedra", cells.len()),
                format!("faces are numbered for at most {}", Self::MAX_CELLS),
            ));
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

    /// Every face, by ascending corners.
    pub(crate) fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// Numbers of the faces of each cell, opposite to its corners 0 to 3.
    pub(crate) fn cell_faces(&self) -> &[[u32; 4]] {
        &self.cell_faces
    }

    /// Numbers of the boundary faces that are on no seam, ascending: where the mesh really ends.
    pub(crate) fn outline(&self) -> &[u32] {
        &self.outline
    }

    /// Pairs of boundary faces that coincide although their points are others, cells on opposite sides.
    pub(crate) fn seams(&self) -> &[[u32; 2]] {
        &self.seams
    }

    /// Number of triangles that more than two cells share, or two on the same side: cells overlap there.
    pub(crate) fn split(&self) -> usize {
        self.split
    }

    /// Whether the outline is one convex surface: no ray leaves the mesh and enters it again. Exact, and so
    /// seldom true of coordinates that were rounded.
    pub(crate) fn is_convex(&self) -> bool {
        self.convex
    }

    /// Whether these can be the faces of a mesh.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when the mesh has another number of cells.
    pub(crate) fn check(&self, mesh: &Tets) -> Result<()> {
        let (known, given) = (self.cell_faces.len(), mesh.cells().len());
        if known == given {
            return Ok(());
        }
        Err(Error::invalid("topology", format!("of {known} tetrahedra, the mesh has {given}")))
    }

    /// Number of faces with a cell on one side only, those on seams included.
    #[cfg(test)]
    pub(crate) fn boundary_len(&self) -> usize {
        self.outline.len() + 2 * self.seams.len()
    }
}

/// All faces of all cells, by their least corner, and where each corner's bucket ends.
fn bucket(cells: &[[u32; 4]], points: usize) -> (Vec<Side>, Vec<u32>) {
    // The two least corners of a cell, once and three times: no face but the one opposite to the least
    // corner goes without it.
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

/// Corners in ascending order, and whether that turned the triangle round.
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

/// The faces of all sides of one triangle. An inward triangle whose normal stayed as it was has its cell in
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

/// Points of the boundary that others coincide with, to the bit.
struct Twins(Vec<(u32, u32)>);

impl Twins {
    fn new(faces: &[Face], boundary: &[u32], points: &[DVec3]) -> Self {
        let mut corners: Vec<u32> = boundary.iter().flat_map(|&i| faces[num::index(i)].corners).collect();
        corners.sort_unstable();
        corners.dedup();
        // Adding +0 makes -0 the same.
        let place = |i: u32| (points[num::index(i)] + DVec3::ZERO).to_array().map(f64::to_bits);
        let mut by_place: Vec<([u64; 3], u32)> = corners.iter().map(|&i| (place(i), i)).collect();
        by_place.sort_unstable();
        let groups = by_place.chunk_by(|a, b| a.0 == b.0);
        let mut twins: Vec<(u32, u32)> =
            groups.filter(|g| g.len() > 1).flat_map(|g| g.iter().map(|&(_, i)| (i, g[0].1))).collect();
        twins.sort_unstable();
        Self(twins)
    }

    /// The first of the points that coincide with this one.
    fn first(&self, point: u32) -> u32 {
        self.0.binary_search_by_key(&point, |twin| twin.0).map_or(point, |place| self.0[place].1)
    }
}

/// Boundary faces that coincide, in pairs; and those that remain.
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

/// Whether the outline is connected and everywhere locally convex, which makes it the surface of one convex
/// body (van Heijenoort 1952).
fn is_convex(faces: &[Face], outline: &[u32], twins: &Twins, points: &[DVec3]) -> bool {
    // Each edge with the face, by its place in the outline, and the corner opposite.
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
        // In one plane the second face goes on where the first one ends, or is folded back on it.
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
pub(crate) mod tests {
    use super::*;
    use crate::scene::{Orientation, TetScalars};

    /// A mesh of cells with scalars that do not matter.
    pub(crate) fn mesh(points: Vec<DVec3>, cells: Vec<[u32; 4]>) -> Tets {
        let scalars = TetScalars::Cell(vec![1.0; cells.len()]);
        Tets::new(points, cells, scalars).unwrap().0
    }

    /// The five tetrahedra of a cube whose corner i has coordinate 1 along the axes of i's bits.
    pub(crate) fn five(corners: [u32; 8], parity: bool) -> [[u32; 4]; 5] {
        let flip = usize::from(parity);
        let cut = |i: usize| [i, i ^ 1, i ^ 2, i ^ 4];
        [[0, 3, 5, 6].map(|i| i ^ flip), cut(1 ^ flip), cut(2 ^ flip), cut(4 ^ flip), cut(7 ^ flip)]
            .map(|cell| cell.map(|i| corners[i]))
    }

    /// Those of n^3 cubes over [-1, 1]^3 that are wanted, five tetrahedra each, so that faces match.
    pub(crate) fn cubes_where(n: u32, wanted: impl Fn([u32; 3]) -> bool) -> Tets {
        let side = n + 1;
        let index = |x: u32, y: u32, z: u32| (z * side + y) * side + x;
        let place = |i: u32| f64::from(i) * 2.0 / f64::from(n) - 1.0;
        let points = (0..side * side * side)
            .map(|i| DVec3::new(place(i % side), place(i / side % side), place(i / side / side)))
            .collect();
        let mut cells = Vec::new();
        for i in 0..n * n * n {
            let [x, y, z] = [i % n, i / n % n, i / n / n];
            if wanted([x, y, z]) {
                let corners =
                    [0, 1, 2, 3, 4, 5, 6, 7].map(|c| index(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)));
                cells.extend(five(corners, (x + y + z) % 2 == 1));
            }
        }
        mesh(points, cells)
    }

    /// n^3 cubes.
    pub(crate) fn cubes(n: u32) -> Tets {
        cubes_where(n, |_| true)
    }

    /// A file of the shared data, or None where there is none.
    pub(crate) fn shared_mesh(name: &str) -> Option<Tets> {
        let root = std::env::var_os("VOLRASTER_DATA").map_or_else(
            || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
            std::path::PathBuf::from,
        );
        let path = root.join("unstructured").join(name);
        if !path.exists() {
            eprintln!("skipped: {} is missing", path.display());
            return None;
        }
        let loaded = crate::io::read(&path, &crate::io::ReadOptions::within(1 << 30)).unwrap();
        let crate::io::Data::Mesh(mesh) = loaded.data else { panic!("{name} is no mesh") };
        Some(mesh)
    }

    /// Real meshes, by ascending size.
    pub(crate) const REAL: [&str; 9] = [
        "tiny_tets_ascii.vtk",
        "tiny_quadratic_tets.vtu",
        "post_small.vtk",
        "can_crush_hex.vtu",
        "bracket_quadratic.vtu",
        "aneurysm_flow.vtu",
        "bluntfin_tets.vtu",
        "combustor_tets.vtu",
        "lox_post_tets.vtu",
    ];

    /// Every side of every cell stands in one face, on the side where the cell lies.
    fn check(mesh: &Tets) -> Topology {
        let topology = Topology::new(mesh).unwrap();
        let (faces, points) = (topology.faces(), mesh.points());
        let mut sides = 0;
        for (number, face) in (0_u32..).zip(faces) {
            let [a, b, c] = face.corners;
            assert!(a < b && b < c, "{face:?}");
            assert!(face.front != NONE || face.back != NONE);
            for (cell, front) in [(face.front, true), (face.back, false)].into_iter().filter(|c| c.0 != NONE)
            {
                sides += 1;
                let corners = mesh.cells()[num::index(cell)];
                let opposite =
                    topology.cell_faces()[num::index(cell)].iter().position(|&f| f == number).unwrap();
                let apex = corners[opposite];
                assert!(corners.iter().all(|i| face.corners.contains(i) != (*i == apex)));
                let at = [a, b, c, apex].map(|i| points[num::index(i)]);
                let sign = (at[1] - at[0]).cross(at[2] - at[0]).dot(at[3] - at[0]);
                match Orientation::of(at) {
                    Orientation::Positive => assert!(front, "{face:?}"),
                    Orientation::Negative => assert!(!front, "{face:?}"),
                    // Another order of the corners may stand nearer to the bound.
                    _ => assert!(sign.abs() < 1e-9),
                }
            }
        }
        assert_eq!(sides, 4 * mesh.cells().len());
        assert!(faces.is_sorted_by_key(|face| face.corners));
        let mut boundary: Vec<u32> = topology.seams().iter().flatten().copied().collect();
        boundary.extend(topology.outline());
        boundary.sort_unstable();
        let wanted: Vec<u32> =
            (0..).zip(faces).filter(|(_, face)| face.is_boundary()).map(|(i, _)| i).collect();
        assert_eq!(boundary, wanted);
        assert_eq!(boundary.len(), topology.boundary_len());
        topology
    }

    fn simplex() -> Vec<DVec3> {
        vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::new(0.1, 0.1, -1.0)]
    }

    #[test]
    fn one_cell_has_four_boundary_faces_that_know_their_side() {
        let topology = check(&mesh(simplex(), vec![[0, 1, 2, 3]]));
        let sides: Vec<bool> = topology.faces().iter().map(|face| face.front == 0).collect();
        let corners: Vec<[u32; 3]> = topology.faces().iter().map(|face| face.corners).collect();
        assert_eq!(corners, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]);
        // z points in, -y out, x in, (1, 1, 1) out.
        assert_eq!(sides, [true, false, true, false]);
        assert_eq!((topology.outline().len(), topology.split()), (4, 0));
        assert_eq!(topology.cell_faces(), [[3, 2, 1, 0]]);
    }

    #[test]
    fn two_cells_share_a_face() {
        let topology = check(&mesh(simplex(), vec![[0, 1, 2, 3], [0, 1, 2, 5]]));
        assert_eq!(topology.faces()[0], Face { corners: [0, 1, 2], front: 0, back: 1 });
        assert_eq!((topology.faces().len(), topology.outline().len()), (7, 6));
    }

    #[test]
    fn cubes_have_known_numbers_of_faces() {
        for parity in [false, true] {
            let corners = [0, 1, 2, 3, 4, 5, 6, 7];
            let points = corners
                .map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)))
                .to_vec();
            let topology = check(&mesh(points.clone(), five(corners, parity).to_vec()));
            assert_eq!((topology.faces().len(), topology.boundary_len()), (16, 12));
            // Kuhn: one path from corner 0 to corner 7 for each order of the axes.
            let orders = [[1, 2, 4], [1, 4, 2], [2, 1, 4], [2, 4, 1], [4, 1, 2], [4, 2, 1]];
            let kuhn = orders.map(|[i, j, _]| [0, i, i | j, 7]).to_vec();
            let topology = check(&mesh(points, kuhn));
            assert_eq!((topology.faces().len(), topology.boundary_len()), (18, 12));
        }
        for n in [1, 2, 3, 6] {
            let topology = check(&cubes(n));
            let boundary = num::index(12 * n * n);
            assert_eq!(topology.boundary_len(), boundary);
            assert_eq!(topology.faces().len(), (num::index(20 * n * n * n) + boundary) / 2);
            assert_eq!((topology.split(), topology.seams().len()), (0, 0));
        }
    }

    #[test]
    fn overlapping_cells_lose_no_face() {
        // Two on the same side.
        let topology = check(&mesh(simplex(), vec![[0, 1, 2, 3], [0, 1, 2, 4]]));
        assert_eq!((topology.split(), topology.boundary_len(), topology.faces().len()), (1, 8, 8));
        // Two on one side, one on the other: the first of either are paired.
        let topology = check(&mesh(simplex(), vec![[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]]));
        assert_eq!(topology.faces()[0], Face { corners: [0, 1, 2], front: 0, back: 2 });
        assert_eq!(topology.faces()[1], Face { corners: [0, 1, 2], front: 1, back: NONE });
        assert_eq!((topology.split(), topology.boundary_len()), (1, 10));
        // The same cell twice.
        let topology = check(&mesh(simplex(), vec![[0, 1, 2, 3], [0, 1, 2, 3]]));
        assert_eq!((topology.split(), topology.boundary_len()), (4, 8));
    }

    #[test]
    fn convexity_is_that_of_the_outline() {
        let convex = |apex: DVec3, cells: &[[u32; 4]]| {
            let mut points = simplex();
            points.push(apex);
            check(&mesh(points, cells.to_vec())).is_convex()
        };
        let (one, below) = ([0, 1, 2, 3], [0, 1, 2, 6]);
        assert!(convex(DVec3::ONE, &[one]));
        assert!(convex(DVec3::new(0.1, 0.1, -1.0), &[one, below]));
        // In one plane with a face above, then beyond it.
        assert!(convex(DVec3::new(0.0, 0.1, -1.0), &[one, below]));
        assert!(!convex(DVec3::new(-0.1, 0.1, -1.0), &[one, below]));
        // Apart, and one upon the other.
        assert!(!convex(DVec3::ONE, &[one, [4, 5, 1, 2]]));
        assert!(!convex(DVec3::ONE, &[one, one]));
        let mut points = simplex();
        points.extend(simplex().iter().map(|p| *p + 5.0));
        assert!(!check(&mesh(points, vec![one, one.map(|i| i + 6)])).is_convex());
    }

    #[test]
    fn seams_are_found_by_coordinates_and_never_merged() {
        // The second cell has points of its own, in another order, and -0 for 0.
        let mut points = simplex();
        points.extend([DVec3::Y, DVec3::X, DVec3::new(-0.0, 0.0, -0.0)]);
        let both = mesh(points.clone(), vec![[0, 1, 2, 3], [6, 7, 8, 5]]);
        let topology = check(&both);
        assert_eq!((topology.faces().len(), topology.outline().len()), (8, 6));
        let [one, other] = topology.seams()[0].map(|i| topology.faces()[num::index(i)]);
        assert_eq!([one, other].map(|face| face.only()), [0, 1]);
        assert_eq!((one.corners, other.corners), ([0, 1, 2], [6, 7, 8]));
        // On the same side there is no seam but an overlap.
        let topology = check(&mesh(points, vec![[0, 1, 2, 3], [6, 7, 8, 4]]));
        assert_eq!((topology.seams().len(), topology.outline().len()), (0, 8));
    }

    #[test]
    fn real_meshes_lose_no_face() {
        for name in REAL {
            let Some(mesh) = shared_mesh(name) else { continue };
            let start = std::time::Instant::now();
            let found = Topology::new(&mesh).unwrap();
            let took = start.elapsed();
            let topology = check(&mesh);
            println!(
                "{name}: {} cells, {} faces, {} on the outline, {} seams, {} split, {:.0} ms",
                mesh.cells().len(),
                found.faces().len(),
                topology.outline().len(),
                topology.seams().len(),
                topology.split(),
                took.as_secs_f64() * 1e3
            );
            let wanted = match name {
                // The seam of the O-grid coincides in its points only: the diagonals of its quadrangles are
                // others on either side.
                "lox_post_tets.vtu" => (27676, 0, 0),
                // Where points coincide at the wall.
                "bluntfin_tets.vtu" => (13438, 39, 0),
                // Crushed cells overlap.
                "can_crush_hex.vtu" => (7682, 0, 161),
                "combustor_tets.vtu" => (15616, 0, 0),
                _ => continue,
            };
            assert_eq!(
                (topology.outline().len(), topology.seams().len(), topology.split()),
                wanted,
                "{name}"
            );
        }
    }
}
