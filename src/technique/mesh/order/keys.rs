//! Orders by one key for each cell.

use glam::DVec3;
use rayon::prelude::*;

use crate::num;
use crate::scene::topology::Topology;
use crate::scene::{Tets, View};
use crate::technique::mesh::order::eye::Eye;

/// Least cells for each thread; fewer are not worth its start.
pub(crate) const CHUNK: usize = 4096;

/// Returns the distance of each centroid: squared from the eye, or along the view direction for parallel rays.
pub(crate) fn centroid(mesh: &Tets, view: &View) -> Vec<f64> {
    let (points, eye, forward) = (mesh.points(), view.camera().eye, view.forward());
    let perspective = view.is_perspective();
    let key = |cell: &[u32; 4]| {
        let [a, b, c, d] = cell.map(|i| points[num::index(i)] - eye);
        let centroid = (a + b + c + d) * 0.25;
        if perspective { centroid.length_squared() } else { centroid.dot(forward) }
    };
    mesh.cells().par_iter().with_min_len(CHUNK).map(key).collect()
}

/// Returns the power distance |P - C|^2 - r^2 of the eye P to each circumsphere with centre C and radius r.
///
/// Two Delaunay cells that share a face have the same power distance from all points of the face's plane; elsewhere the
/// cell on the eye's side has the smaller one (Edelsbrunner 1990, An Acyclicity Theorem for Cell Complexes in d
/// Dimensions). So for Delaunay meshes ascending keys are a visibility order, up to ties: cospherical cells, as in a
/// cube, have equal keys, which leave their order open.
///
/// With a corner A as origin, |P - C|^2 - r^2 = |P - A|^2 - 2 (P - A).(C - A), because |C - A| = r: the square of a
/// sliver's huge radius cancels. For parallel rays P = -s d with s to infinity; s^2 is the same for all cells, the rest
/// grows as 2 s (d.C), and the key is d.(C - O) for the eye O.
pub(crate) fn power(mesh: &Tets, view: &View) -> Vec<f64> {
    power_with_bounds(mesh, view).into_iter().map(|(key, _)| key).collect()
}

/// Returns the power distances, each with a bound of its rounding error.
fn power_with_bounds(mesh: &Tets, view: &View) -> Vec<(f64, f64)> {
    let (points, eye, forward) = (mesh.points(), view.camera().eye, view.forward());
    let perspective = view.is_perspective();
    let key = |cell: &[u32; 4]| {
        let [a, b, c, d] = cell.map(|i| points[num::index(i)]);
        let (u, v, w) = (b - a, c - a, d - a);
        let parts = [(u, v.cross(w)), (v, w.cross(u)), (w, u.cross(v))];
        let volume = u.dot(parts[0].1);
        // The vector to the circumcentre is the sum of |u|^2 (v x w) over 2 det[u, v, w].
        let centre = parts.iter().map(|(u, area)| *area * u.length_squared()).sum::<DVec3>() / (2.0 * volume);
        let size = u.length() * v.length() * w.length() / volume.abs();
        let reach = 1.5 * (u.length() + v.length() + w.length()) * size;
        // Each cross product, and the determinant, has an error of a few epsilon times the product of lengths. The
        // error of the quotient grows with the ratio of that product to the determinant.
        let error = 16.0 * f64::EPSILON;
        let from = eye - a;
        if perspective {
            let key = from.length_squared() - 2.0 * from.dot(centre);
            (key, error * (from.length_squared() + 2.0 * from.length() * reach * (1.0 + size)))
        } else {
            ((centre - from).dot(forward), error * (from.length() + reach * (1.0 + size)))
        }
    };
    mesh.cells().par_iter().with_min_len(CHUNK).map(key).collect()
}

/// Sorts cells by ascending key, and cells with equal keys by number.
pub(crate) fn ascending(keys: &[f64]) -> Vec<u32> {
    let mut cells: Vec<u32> = (0..num::count(keys.len())).collect();
    cells.par_sort_unstable_by(|&i, &j| keys[num::index(i)].total_cmp(&keys[num::index(j)]).then(i.cmp(&j)));
    cells
}

/// How well the power distance orders a mesh, for one view. A mesh without contrary pairs in any view is Delaunay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PowerCheck {
    /// Pairs of cells at a face that rays cross.
    pub pairs: usize,
    /// Pairs whose keys are equal within rounding, so that their order is open.
    pub equal: usize,
    /// Pairs whose keys contradict the face: the mesh is not Delaunay there.
    pub contrary: usize,
}

/// Compares power distances with the order of the two cells at each shared face.
pub(crate) fn check_power(mesh: &Tets, topology: &Topology, view: &View) -> PowerCheck {
    let keys = power_with_bounds(mesh, view);
    let eye = Eye::of(view);
    let mut check = PowerCheck::default();
    for [first, second] in topology.faces().iter().filter_map(|face| eye.crossed(face, mesh.points())) {
        let [(near, a), (far, b)] = [first, second].map(|cell| keys[num::index(cell)]);
        check.pairs += 1;
        let (decided, contrary) = (far - near > a + b, near - far > a + b);
        check.contrary += usize::from(contrary);
        check.equal += usize::from(!decided && !contrary);
    }
    check
}
