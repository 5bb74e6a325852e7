//! Orders by one number for each cell.

use glam::DVec3;
use rayon::prelude::*;

use crate::num;
use crate::scene::topology::Topology;
use crate::scene::{Tets, View};
use crate::technique::mesh::order::eye::Eye;

/// Cells below which a thread is not worth its start.
pub(crate) const CHUNK: usize = 4096;

/// Distance of each centroid: squared from the eye, or along the view for parallel rays.
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

/// Power distance of the eye to each circumsphere, |P - C|^2 - r^2. On the plane of a face that two Delaunay
/// cells share it is the same for both, and less for the cell on whose side the eye is (Edelsbrunner 1990, An
/// Acyclicity Theorem for Cell Complexes in d Dimensions), so for Delaunay meshes ascending keys are a
/// visibility order up to ties; cospherical cells, as in a cube, have equal keys, and their order is not told.
///
/// With a corner A as origin |P - C|^2 - r^2 = |P - A|^2 - 2 (P - A).(C - A), because |C - A| = r: the square
/// of a sliver's huge radius does not occur. For parallel rays P = -s d, s to infinity: the square of s is the
/// same for all, what is left grows as 2 s (d.C), and the key is d.(C - O) for the eye O.
pub(crate) fn power(mesh: &Tets, view: &View) -> Vec<f64> {
    power_with_bounds(mesh, view).into_iter().map(|(key, _)| key).collect()
}

/// The same, each with a bound of its rounding error.
fn power_with_bounds(mesh: &Tets, view: &View) -> Vec<(f64, f64)> {
    let (points, eye, forward) = (mesh.points(), view.camera().eye, view.forward());
    let perspective = view.is_perspective();
    let key = |cell: &[u32; 4]| {
        let [a, b, c, d] = cell.map(|i| points[num::index(i)]);
        let (u, v, w) = (b - a, c - a, d - a);
        let parts = [(u, v.cross(w)), (v, w.cross(u)), (w, u.cross(v))];
        let volume = u.dot(parts[0].1);
        // To the circumcentre: sum of |u|^2 (v x w) over 2 det[u, v, w].
        let centre = parts.iter().map(|(u, area)| *area * u.length_squared()).sum::<DVec3>() / (2.0 * volume);
        let size = u.length() * v.length() * w.length() / volume.abs();
        let reach = 1.5 * (u.length() + v.length() + w.length()) * size;
        // Each cross product, and the determinant itself, is off by a few epsilon times the product of
        // lengths; what that makes of the quotient goes with the ratio of that product to the determinant.
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

/// Cells in ascending order of their keys, and of their numbers where keys are the same.
pub(crate) fn ascending(keys: &[f64]) -> Vec<u32> {
    let mut cells: Vec<u32> = (0..num::count(keys.len())).collect();
    cells.par_sort_unstable_by(|&i, &j| keys[num::index(i)].total_cmp(&keys[num::index(j)]).then(i.cmp(&j)));
    cells
}

/// How the power distance does on a mesh, for one view. A mesh without contrary pairs in any view is Delaunay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PowerCheck {
    /// Pairs of cells that share a face which rays cross.
    pub pairs: usize,
    /// Of them, those whose keys are the same within rounding: their order is not told.
    pub equal: usize,
    /// Of them, those whose keys say the contrary: the mesh is not Delaunay there.
    pub contrary: usize,
}

/// Compares power distances with what lies in front of what at shared faces.
pub(crate) fn check_power(mesh: &Tets, topology: &Topology, view: &View) -> PowerCheck {
    let keys = power_with_bounds(mesh, view);
    let eye = Eye::of(view);
    let mut check = PowerCheck::default();
    for [first, second] in topology.faces().iter().filter_map(|face| eye.crossed(face, mesh.points())) {
        let [(near, a), (far, b)] = [first, second].map(|cell| keys[num::index(cell)]);
        check.pairs += 1;
        let (told, contrary) = (far - near > a + b, near - far > a + b);
        check.contrary += usize::from(contrary);
        check.equal += usize::from(!told && !contrary);
    }
    check
}
