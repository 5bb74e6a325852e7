//! Faces, seams and outlines of small meshes, against known counts and brute force.

use super::*;
use crate::scene::{Orientation, TetScalars};

#[cfg(feature = "io")]
mod real;

#[cfg(feature = "io")]
pub(crate) use real::{REAL, shared_mesh};

/// A mesh with arbitrary scalars.
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

/// The wanted ones of n^3 cubes over [-1, 1]^3, five tetrahedra each, so that faces match.
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

/// Asserts that every side of every cell belongs to one face, on the side where the cell lies.
fn check(mesh: &Tets) -> Topology {
    let topology = Topology::new(mesh).unwrap();
    let (faces, points) = (topology.faces(), mesh.points());
    let mut sides = 0;
    for (number, face) in (0_u32..).zip(faces) {
        let [a, b, c] = face.corners;
        assert!(a < b && b < c, "{face:?}");
        assert!(face.front != NONE || face.back != NONE);
        for (cell, front) in [(face.front, true), (face.back, false)].into_iter().filter(|c| c.0 != NONE) {
            sides += 1;
            let corners = mesh.cells()[num::index(cell)];
            let opposite = topology.cell_faces()[num::index(cell)].iter().position(|&f| f == number).unwrap();
            let apex = corners[opposite];
            assert!(corners.iter().all(|i| face.corners.contains(i) != (*i == apex)));
            let at = [a, b, c, apex].map(|i| points[num::index(i)]);
            let sign = (at[1] - at[0]).cross(at[2] - at[0]).dot(at[3] - at[0]);
            match Orientation::of(at) {
                Orientation::Positive => assert!(front, "{face:?}"),
                Orientation::Negative => assert!(!front, "{face:?}"),
                // Another order of the corners may be closer to the error bound.
                _ => assert!(sign.abs() < 1e-9),
            }
        }
    }
    assert_eq!(sides, 4 * mesh.cells().len());
    assert!(faces.is_sorted_by_key(|face| face.corners));
    let mut boundary: Vec<u32> = topology.seams().iter().flatten().copied().collect();
    boundary.extend(topology.outline());
    boundary.sort_unstable();
    let wanted: Vec<u32> = (0..).zip(faces).filter(|(_, face)| face.is_boundary()).map(|(i, _)| i).collect();
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
        let points =
            corners.map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).to_vec();
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
    // Two cells on the same side.
    let topology = check(&mesh(simplex(), vec![[0, 1, 2, 3], [0, 1, 2, 4]]));
    assert_eq!((topology.split(), topology.boundary_len(), topology.faces().len()), (1, 8, 8));
    // Two on one side, one on the other: the first of either side are paired.
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
    // Disconnected, and one on top of the other.
    assert!(!convex(DVec3::ONE, &[one, [4, 5, 1, 2]]));
    assert!(!convex(DVec3::ONE, &[one, one]));
    let mut points = simplex();
    points.extend(simplex().iter().map(|p| *p + 5.0));
    assert!(!check(&mesh(points, vec![one, one.map(|i| i + 6)])).is_convex());
}

#[test]
fn seams_are_found_by_coordinates_and_never_merged() {
    // The second cell has its own points, in another order, and -0 for 0.
    let mut points = simplex();
    points.extend([DVec3::Y, DVec3::X, DVec3::new(-0.0, 0.0, -0.0)]);
    let both = mesh(points.clone(), vec![[0, 1, 2, 3], [6, 7, 8, 5]]);
    let topology = check(&both);
    assert_eq!((topology.faces().len(), topology.outline().len()), (8, 6));
    let [one, other] = topology.seams()[0].map(|i| topology.faces()[num::index(i)]);
    assert_eq!([one, other].map(|face| face.only()), [0, 1]);
    assert_eq!((one.corners, other.corners), ([0, 1, 2], [6, 7, 8]));
    // On the same side there is an overlap and no seam.
    let topology = check(&mesh(points, vec![[0, 1, 2, 3], [6, 7, 8, 4]]));
    assert_eq!((topology.seams().len(), topology.outline().len()), (0, 8));
}
