//! Cutting cells of unstructured meshes into tetrahedra.
//!
//! # The rule
//!
//! Two cells that share a face must cut it alike; otherwise rays see gaps and overlaps. So the cut of a face
//! depends on the face's own vertices alone: **a quadrilateral is cut at the vertex of the smallest rank**
//! (Dompierre, Labbé, Vallet and Camarero 1999). The rank of a vertex is the smallest index of a point at its
//! position, so faces match across seams of coincident points as well.
//!
//! - A linear cell is a cone from its vertex of smallest rank over the faces that do not touch that vertex,
//!   each cut by the rule. The faces that do touch it are then cut at it, as the rule demands. A wedge gives
//!   3 tetrahedra, a pyramid 2, a hexahedron 6, or 5 where the face diagonals allow it.
//! - A quadratic tetrahedron gives 8: one at each corner, and 4 from the octahedron between them, which is
//!   cut along its shortest diagonal. A face of six nodes has only one cut into four triangles.
//! - Any other quadratic cell is a cone from its centre over its faces. The centre is the cell's centre node,
//!   or a new point placed and valued by the cell's shape functions. A face of eight nodes becomes its four
//!   corners and the quadrilateral between its mid-nodes, cut by the rule; a face of nine nodes becomes a fan
//!   around its centre.
//!
//! Between the nodes everything is linear: curved faces become flat triangles.

use super::cells::CellKind;

/// Corner tetrahedra. The mid-nodes of the edges 01, 12, 20, 03, 13, 23 are nodes 4 to 9.
const QUADRATIC_CORNERS: [[usize; 4]; 4] = [[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3]];
/// The three diagonals of the inner octahedron, each with the ring of four nodes around it.
const OCTAHEDRON: [([usize; 2], [usize; 4]); 3] =
    [([4, 9], [6, 7, 8, 5]), ([5, 7], [4, 8, 9, 6]), ([6, 8], [4, 5, 9, 7])];

impl CellKind {
    /// Cuts a cell into tetrahedra.
    ///
    /// `rank` orders the vertices for the rule. `centre` is the new point of a kind for which
    /// [`Self::centre`] has weights. `closer` returns whether its first two points are closer together than
    /// its last two. All tetrahedra of a cell that is not twisted have the same orientation, which is
    /// positive for nodes in VTK's order, except in wedges.
    pub(crate) fn cut(
        self,
        nodes: &[u32],
        centre: u32,
        rank: impl Fn(u32) -> u32,
        closer: impl Fn([u32; 2], [u32; 2]) -> bool,
        mut emit: impl FnMut([u32; 4]),
    ) {
        let key = |i: usize| (rank(nodes[i]), i);
        match self {
            Self::Tetrahedron => emit([nodes[0], nodes[1], nodes[2], nodes[3]]),
            Self::QuadraticTetrahedron => {
                for corner in QUADRATIC_CORNERS {
                    emit(corner.map(|i| nodes[i]));
                }
                let ends = |&([a, b], _): &([usize; 2], [usize; 4])| [nodes[a], nodes[b]];
                let mut best = &OCTAHEDRON[0];
                for diagonal in &OCTAHEDRON[1..] {
                    if closer(ends(diagonal), ends(best)) {
                        best = diagonal;
                    }
                }
                let ([a, b], ring) = best;
                for i in 0..4 {
                    emit([*a, *b, ring[i], ring[(i + 1) % 4]].map(|i| nodes[i]));
                }
            }
            Self::Voxel | Self::Hexahedron | Self::Wedge | Self::Pyramid => {
                let tip = (0..self.nodes()).min_by_key(|&i| key(i)).unwrap_or(0);
                let away = self.faces().filter(|face| !face.contains(&tip));
                let mut cone = Vec::with_capacity(6);
                for face in away {
                    triangles(face, &key, |triangle| cone.push(triangle));
                }
                if let Some((far, ring)) = five(&cone) {
                    emit([tip, ring[0], ring[1], ring[2]].map(|i| nodes[i]));
                    emit([far, ring[0], ring[2], ring[1]].map(|i| nodes[i]));
                    cone.retain(|triangle| !triangle.contains(&far));
                }
                for [a, b, c] in cone {
                    emit([tip, a, b, c].map(|i| nodes[i]));
                }
            }
            Self::QuadraticHexahedron
            | Self::QuadraticWedge
            | Self::QuadraticPyramid
            | Self::TriquadraticHexahedron => {
                let tip = if self == Self::TriquadraticHexahedron { nodes[26] } else { centre };
                for face in self.faces() {
                    triangles(face, &key, |[a, b, c]| emit([tip, nodes[a], nodes[b], nodes[c]]));
                }
            }
        }
    }
}

/// Cuts a face into triangles by the rule.
fn triangles(face: &[usize], key: &impl Fn(usize) -> (u32, usize), mut emit: impl FnMut([usize; 3])) {
    match *face {
        [a, b, c] => emit([a, b, c]),
        [..] if face.len() == 4 => {
            let first = (0..4).min_by_key(|&i| key(face[i])).unwrap_or(0);
            let at = |i: usize| face[(first + i) % 4];
            emit([at(0), at(1), at(2)]);
            emit([at(0), at(2), at(3)]);
        }
        [a, b, c, ab, bc, ca] => {
            for triangle in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                emit(triangle);
            }
        }
        [a, b, c, d, ab, bc, cd, da] => {
            for triangle in [[a, ab, da], [b, bc, ab], [c, cd, bc], [d, da, cd]] {
                emit(triangle);
            }
            triangles(&[ab, bc, cd, da], key, emit);
        }
        [a, b, c, d, ab, bc, cd, da, middle] => {
            let ring = [a, ab, b, bc, c, cd, d, da];
            for i in 0..8 {
                emit([middle, ring[i], ring[(i + 1) % 8]]);
            }
        }
        _ => {}
    }
}

/// Finds the cut of a hexahedron into five: returns the far corner and its three neighbours.
///
/// `cone` is a hexahedron's cone of six triangles. The cut exists where no face diagonal ends at the corner
/// opposite to the tip. One tetrahedron then joins the three neighbours to the tip, another joins them to the
/// far corner.
fn five(cone: &[[usize; 3]]) -> Option<(usize, [usize; 3])> {
    if cone.len() != 6 {
        return None;
    }
    // The far corner lies in three faces, each of which is two triangles.
    let far = (0..8).find(|vertex| cone.chunks(2).all(|face| face.as_flattened().contains(vertex)))?;
    let opposite = |triangle: &[usize; 3]| {
        let at = triangle.iter().position(|&vertex| vertex == far)?;
        Some([triangle[(at + 1) % 3], triangle[(at + 2) % 3]])
    };
    // It is in exactly one triangle of each only where no diagonal ends there.
    let edges: Vec<[usize; 2]> = cone.iter().filter_map(opposite).collect();
    let &[[first, second], ..] = &edges[..] else { return None };
    // Order the neighbours around the far corner: the last vertex of one edge is the first of the next.
    let [_, third] = *edges.iter().find(|edge| edge[0] == second)?;
    (edges.len() == 3).then_some((far, [first, second, third]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Node positions of a kind in its reference shape.
    fn shape(kind: CellKind) -> Vec<DVec3> {
        let v = DVec3::new;
        let hexahedron = vec![
            v(-1.0, -1.0, -1.0),
            v(1.0, -1.0, -1.0),
            v(1.0, 1.0, -1.0),
            v(-1.0, 1.0, -1.0),
            v(-1.0, -1.0, 1.0),
            v(1.0, -1.0, 1.0),
            v(1.0, 1.0, 1.0),
            v(-1.0, 1.0, 1.0),
        ];
        let wedge = vec![
            v(0.0, 0.0, -1.0),
            v(1.0, 0.0, -1.0),
            v(0.0, 1.0, -1.0),
            v(0.0, 0.0, 1.0),
            v(1.0, 0.0, 1.0),
            v(0.0, 1.0, 1.0),
        ];
        let pyramid = vec![
            v(-1.0, -1.0, 0.0),
            v(1.0, -1.0, 0.0),
            v(1.0, 1.0, 0.0),
            v(-1.0, 1.0, 0.0),
            v(0.0, 0.0, 1.0),
        ];
        let tetrahedron = vec![v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 0.0, 1.0)];
        let middles = |mut points: Vec<DVec3>, edges: &[[usize; 2]]| {
            for &[a, b] in edges {
                points.push((points[a] + points[b]) / 2.0);
            }
            points
        };
        let round =
            [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
        match kind {
            CellKind::Tetrahedron => tetrahedron,
            CellKind::Voxel => [0, 1, 3, 2, 4, 5, 7, 6].map(|i| hexahedron[i]).to_vec(),
            CellKind::Hexahedron => hexahedron,
            CellKind::Wedge => wedge,
            CellKind::Pyramid => pyramid,
            CellKind::QuadraticTetrahedron => {
                middles(tetrahedron, &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])
            }
            CellKind::QuadraticHexahedron => middles(hexahedron, &round),
            CellKind::QuadraticWedge => {
                middles(wedge, &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]])
            }
            CellKind::QuadraticPyramid => {
                middles(pyramid, &[[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]])
            }
            CellKind::TriquadraticHexahedron => {
                let mut points = middles(hexahedron, &round);
                points.extend([DVec3::NEG_X, DVec3::X, DVec3::NEG_Y, DVec3::Y, DVec3::NEG_Z, DVec3::Z]);
                points.push(DVec3::ZERO);
                points
            }
        }
    }

    const ALL: [CellKind; 10] = [
        CellKind::Tetrahedron,
        CellKind::Voxel,
        CellKind::Hexahedron,
        CellKind::Wedge,
        CellKind::Pyramid,
        CellKind::QuadraticTetrahedron,
        CellKind::QuadraticHexahedron,
        CellKind::QuadraticWedge,
        CellKind::QuadraticPyramid,
        CellKind::TriquadraticHexahedron,
    ];

    /// Returns a volume that must be positive. Wedges count negative: the shape has them in the order of most
    /// programs.
    fn volume(kind: CellKind, [a, b, c, d]: [DVec3; 4]) -> f64 {
        let sign = if matches!(kind, CellKind::Wedge | CellKind::QuadraticWedge) { -1.0 } else { 1.0 };
        let volume = sign * (b - a).cross(c - a).dot(d - a) / 6.0;
        assert!(volume > 0.0, "{kind:?}: a tetrahedron is inside out");
        volume
    }

    /// Cuts a kind's reference shape under some ranks; index `nodes` is the new centre.
    fn tets(kind: CellKind, ranks: &[u32]) -> (Vec<DVec3>, Vec<[u32; 4]>) {
        let mut points = shape(kind);
        let nodes: Vec<u32> = (0..u32::try_from(points.len()).unwrap()).collect();
        if let Some(weights) = kind.centre() {
            points.push(points.iter().zip(weights).map(|(p, w)| *p * *w).sum());
        }
        let at = |i: u32| points[i as usize];
        let mut tets = Vec::new();
        let rank = |i: u32| ranks[i as usize];
        let closer = |[a, b]: [u32; 2], [c, d]: [u32; 2]| (at(a) - at(b)).length() < (at(c) - at(d)).length();
        kind.cut(&nodes, u32::try_from(kind.nodes()).unwrap(), rank, closer, |tet| tets.push(tet));
        (points, tets)
    }

    /// Returns a permutation of ranks for a seed.
    fn ranks(count: usize, seed: u64) -> Vec<u32> {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut ranks: Vec<u32> = (0..u32::try_from(count).unwrap()).collect();
        for i in (1..count).rev() {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            ranks.swap(i, usize::try_from(state % (i as u64 + 1)).unwrap());
        }
        ranks
    }

    #[test]
    fn tetrahedra_fill_the_cell_and_meet_face_to_face() {
        for kind in ALL {
            let solid = match kind {
                CellKind::Tetrahedron | CellKind::QuadraticTetrahedron => 1.0 / 6.0,
                CellKind::Wedge | CellKind::QuadraticWedge => 1.0,
                CellKind::Pyramid | CellKind::QuadraticPyramid => 4.0 / 3.0,
                _ => 8.0,
            };
            let mut counts = std::collections::BTreeSet::new();
            for seed in 0..200 {
                let (points, tets) = tets(kind, &ranks(kind.nodes(), seed));
                assert!(tets.len() <= kind.most_tets(), "{kind:?}");
                counts.insert(tets.len());
                let sum: f64 = tets.iter().map(|tet| volume(kind, tet.map(|i| points[i as usize]))).sum();
                assert!((sum - solid).abs() < 1e-12, "{kind:?}: volume {sum}, not {solid}");
                // An inner face occurs twice, a face of the hull once.
                let mut faces = std::collections::HashMap::new();
                for [a, b, c, d] in &tets {
                    for mut face in [[*a, *b, *c], [*a, *b, *d], [*a, *c, *d], [*b, *c, *d]] {
                        face.sort_unstable();
                        *faces.entry(face).or_insert(0) += 1;
                    }
                }
                let mut hull = 0.0;
                for (face, count) in faces {
                    assert!(count <= 2, "{kind:?}: a face of {count} tetrahedra");
                    if count == 1 {
                        let [a, b, c] = face.map(|i| points[i as usize]);
                        hull += (b - a).cross(c - a).length() / 2.0;
                    }
                }
                let area = match kind {
                    CellKind::Tetrahedron | CellKind::QuadraticTetrahedron => 1.5 + 0.75_f64.sqrt(),
                    CellKind::Wedge | CellKind::QuadraticWedge => 1.0 + 2.0 * (2.0 + 2.0_f64.sqrt()),
                    CellKind::Pyramid | CellKind::QuadraticPyramid => 4.0 + 4.0 * 2.0_f64.sqrt(),
                    _ => 24.0,
                };
                assert!((hull - area).abs() < 1e-12, "{kind:?}: hull {hull}, not {area}");
            }
            let wanted: &[usize] = match kind {
                CellKind::Hexahedron | CellKind::Voxel => &[5, 6],
                _ => &[kind.most_tets()],
            };
            assert_eq!(counts.into_iter().collect::<Vec<_>>(), wanted, "{kind:?}");
        }
    }

    /// The triangles of each face, as sets of ranks, follow from the face's own ranks.
    #[test]
    fn a_face_is_cut_by_its_own_vertices() {
        for kind in ALL {
            for seed in 0..100 {
                let ranks = ranks(kind.nodes(), seed);
                let (_, tets) = tets(kind, &ranks);
                for face in kind.faces() {
                    let face: Vec<u32> = match kind {
                        // `faces` lists the linear faces for both tetrahedra.
                        CellKind::QuadraticTetrahedron => continue,
                        _ => face.iter().map(|&i| u32::try_from(i).unwrap()).collect(),
                    };
                    let mut found: Vec<[u32; 3]> = Vec::new();
                    for tet in &tets {
                        for skip in 0..4 {
                            let mut triangle: Vec<u32> =
                                (0..4).filter(|&i| i != skip).map(|i| tet[i]).collect();
                            triangle.sort_unstable();
                            if triangle.iter().all(|i| face.contains(i)) {
                                found.push([triangle[0], triangle[1], triangle[2]]);
                            }
                        }
                    }
                    let mut wanted: Vec<[u32; 3]> = Vec::new();
                    let indices: Vec<usize> = face.iter().map(|&i| i as usize).collect();
                    triangles(&indices, &|i| (ranks[i], i), |triangle| {
                        let mut triangle = triangle.map(|i| u32::try_from(i).unwrap());
                        triangle.sort_unstable();
                        wanted.push(triangle);
                    });
                    found.sort_unstable();
                    wanted.sort_unstable();
                    assert_eq!(found, wanted, "{kind:?}, face {face:?}, ranks {ranks:?}");
                    if face.len() == 4 {
                        let least = *face.iter().min_by_key(|&&i| ranks[i as usize]).unwrap();
                        assert!(found.iter().all(|triangle| triangle.contains(&least)));
                    }
                }
            }
        }
    }

    #[test]
    fn centres_give_quadratic_polynomials_their_values() {
        for kind in [CellKind::QuadraticHexahedron, CellKind::QuadraticWedge, CellKind::QuadraticPyramid] {
            let (points, weights) = (shape(kind), kind.centre().unwrap());
            let polynomial = |p: DVec3| {
                1.0 + p.x - 2.0 * p.y + 3.0 * p.z + p.x * p.x - p.y * p.y + 2.0 * p.z * p.z + p.x * p.y
                    - p.y * p.z
            };
            let centre: DVec3 = points.iter().zip(weights).map(|(p, w)| *p * *w).sum();
            let value: f64 = points.iter().zip(weights).map(|(p, w)| polynomial(*p) * w).sum();
            assert!((value - polynomial(centre)).abs() < 1e-14, "{kind:?}: {value} at {centre}");
        }
    }

    #[test]
    fn the_octahedron_is_cut_along_its_shortest_diagonal() {
        let (points, tets) = tets(CellKind::QuadraticTetrahedron, &[0; 10]);
        let length = |a: u32, b: u32| (points[a as usize] - points[b as usize]).length();
        let shortest = length(4, 9).min(length(5, 7)).min(length(6, 8));
        let used =
            [[4, 9], [5, 7], [6, 8]].into_iter().find(|[a, b]| tets[4].contains(a) && tets[4].contains(b));
        let [a, b] = used.unwrap();
        assert!((length(a, b) - shortest).abs() < 1e-15);
    }
}
