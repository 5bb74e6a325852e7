//! Cell types of unstructured meshes: nodes, faces and shape functions at the centre.

/// A cell type, with its nodes in the order of VTK.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CellKind {
    /// 4 nodes.
    Tetrahedron,
    /// 8 nodes: x fastest, then y, then z.
    Voxel,
    /// 8 nodes: around the bottom, then around the top.
    Hexahedron,
    /// 6 nodes: one triangle, then the other.
    Wedge,
    /// 5 nodes: around the base, then the apex.
    Pyramid,
    /// 10 nodes.
    QuadraticTetrahedron,
    /// 20 nodes.
    QuadraticHexahedron,
    /// 15 nodes.
    QuadraticWedge,
    /// 13 nodes.
    QuadraticPyramid,
    /// 27 nodes.
    TriquadraticHexahedron,
}

pub(super) type Face = &'static [usize];

/// Faces, counter-clockwise seen from outside: corners, then the mid-nodes of the edges between them in the same
/// order, then the mid-node of the face. A kind with fewer nodes has the first of them. Those of the wedge follow
/// VTK's code; most programs exchange its two triangles.
const TETRAHEDRON: [Face; 4] = [&[0, 1, 3], &[1, 2, 3], &[2, 0, 3], &[0, 2, 1]];
const VOXEL: [Face; 6] =
    [&[0, 4, 6, 2], &[1, 3, 7, 5], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 2, 3, 1], &[4, 5, 7, 6]];
const HEXAHEDRON: [Face; 6] = [
    &[0, 4, 7, 3, 16, 15, 19, 11, 20],
    &[1, 2, 6, 5, 9, 18, 13, 17, 21],
    &[0, 1, 5, 4, 8, 17, 12, 16, 22],
    &[3, 7, 6, 2, 19, 14, 18, 10, 23],
    &[0, 3, 2, 1, 11, 10, 9, 8, 24],
    &[4, 5, 6, 7, 12, 13, 14, 15, 25],
];
const WEDGE: [Face; 5] = [
    &[0, 1, 2, 6, 7, 8],
    &[3, 5, 4, 11, 10, 9],
    &[0, 3, 4, 1, 12, 9, 13, 6],
    &[1, 4, 5, 2, 13, 10, 14, 7],
    &[2, 5, 3, 0, 14, 11, 12, 8],
];
const PYRAMID: [Face; 5] = [
    &[0, 3, 2, 1, 8, 7, 6, 5],
    &[0, 1, 4, 5, 10, 9],
    &[1, 2, 4, 6, 11, 10],
    &[2, 3, 4, 7, 12, 11],
    &[3, 0, 4, 8, 9, 12],
];

/// A cell type, its number in VTK's files, plural name, number of nodes, largest number of tetrahedra that one is cut
/// into, and faces.
type Row = (CellKind, u8, &'static str, usize, usize, &'static [Face]);

/// Every cell type, in the order of the enum.
const KINDS: [Row; 10] = [
    (CellKind::Tetrahedron, 10, "tetrahedra", 4, 1, &TETRAHEDRON),
    (CellKind::Voxel, 11, "voxels", 8, 6, &VOXEL),
    (CellKind::Hexahedron, 12, "hexahedra", 8, 6, &HEXAHEDRON),
    (CellKind::Wedge, 13, "wedges", 6, 3, &WEDGE),
    (CellKind::Pyramid, 14, "pyramids", 5, 2, &PYRAMID),
    (CellKind::QuadraticTetrahedron, 24, "quadratic tetrahedra", 10, 8, &TETRAHEDRON),
    (CellKind::QuadraticHexahedron, 25, "quadratic hexahedra", 20, 36, &HEXAHEDRON),
    (CellKind::QuadraticWedge, 26, "quadratic wedges", 15, 26, &WEDGE),
    (CellKind::QuadraticPyramid, 27, "quadratic pyramids", 13, 22, &PYRAMID),
    (CellKind::TriquadraticHexahedron, 29, "triquadratic hexahedra", 27, 48, &HEXAHEDRON),
];

impl CellKind {
    /// Returns the cell type of a number in VTK's files, or `None` for types that are not solid or not
    /// supported.
    #[must_use]
    pub fn of_vtk(number: u8) -> Option<Self> {
        KINDS.iter().find(|(_, known, ..)| *known == number).map(|(kind, ..)| *kind)
    }

    /// Returns the plural name for reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        KINDS[self as usize].2
    }

    /// Returns the number of nodes.
    #[must_use]
    pub fn nodes(self) -> usize {
        KINDS[self as usize].3
    }

    /// Returns the largest number of tetrahedra that one cell is cut into.
    #[must_use]
    pub fn most_tets(self) -> usize {
        KINDS[self as usize].4
    }

    /// Returns the nodes of each face that a cell of this kind has.
    pub(super) fn faces(self) -> impl Iterator<Item = Face> {
        let (.., nodes, _, faces) = KINDS[self as usize];
        faces.iter().map(move |face| &face[..face.partition_point(|&node| node < nodes)])
    }

    /// Returns the weights of corners and edge mid-nodes at the centre of a cell that needs a new point
    /// there, or `None`.
    ///
    /// The weights are the cell's serendipity shape functions. Those of the pyramid are rational; its weights
    /// are the ones that reproduce every quadratic polynomial of the straight pyramid with unit base on its
    /// axis, at a quarter of the height.
    #[must_use]
    pub fn centre(self) -> Option<&'static [f64]> {
        const HEXAHEDRON: [f64; 20] = [
            -0.25, -0.25, -0.25, -0.25, -0.25, -0.25, -0.25, -0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25,
            0.25, 0.25, 0.25, 0.25, 0.25,
        ];
        // At (1/3, 1/3, 0): corners -2/9 each, edges of the triangles 2/9, upright edges 1/3.
        const EDGE: f64 = 2.0 / 9.0;
        const UPRIGHT: f64 = 1.0 / 3.0;
        const WEDGE: [[f64; 3]; 5] = [[-EDGE; 3], [-EDGE; 3], [EDGE; 3], [EDGE; 3], [UPRIGHT; 3]];
        // At (0, 0, 1/4) between base corners (+-1, +-1, 0) and apex (0, 0, 1): corners, apex, edges of the
        // base, edges to the apex.
        const PYRAMID: [f64; 13] = [
            -0.1875, -0.1875, -0.1875, -0.1875, -0.125, 0.281_25, 0.281_25, 0.281_25, 0.281_25, 0.1875,
            0.1875, 0.1875, 0.1875,
        ];
        match self {
            Self::QuadraticHexahedron => Some(&HEXAHEDRON),
            Self::QuadraticWedge => Some(WEDGE.as_flattened()),
            Self::QuadraticPyramid => Some(&PYRAMID),
            _ => None,
        }
    }
}
