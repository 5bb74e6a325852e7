//! Element types, and the order of their nodes in VTK.

/// An element type.
pub(crate) struct Kind {
    pub(crate) nodes: usize,
    /// Its VTK type number.
    pub(crate) vtk: u8,
    /// The index here of each node in VTK's order.
    pub(crate) order: &'static [usize],
}

pub(crate) const LINEAR: [usize; 9] = [0, 1, 2, 3, 4, 5, 6, 7, 8];

/// VTK exchanges the last two edges.
pub(crate) const TETRAHEDRON: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8];

/// Gmsh sorts edges by their first corner; VTK has those of the bottom, of the top, then the vertical ones. Faces
/// follow.
pub(crate) const HEXAHEDRON: [usize; 27] =
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26];

pub(crate) const PRISM: [usize; 15] = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11];
pub(crate) const PYRAMID: [usize; 13] = [0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12];

/// Returns the element type with a number, if it is supported.
pub(crate) fn kind_of(number: i64) -> Option<Kind> {
    let (nodes, vtk, order): (usize, u8, &'static [usize]) = match number {
        1 => (2, 3, &LINEAR[..2]),
        2 => (3, 5, &LINEAR[..3]),
        3 => (4, 9, &LINEAR[..4]),
        4 => (4, 10, &LINEAR[..4]),
        5 => (8, 12, &LINEAR[..8]),
        6 => (6, 13, &LINEAR[..6]),
        7 => (5, 14, &LINEAR[..5]),
        8 => (3, 21, &LINEAR[..3]),
        9 => (6, 22, &LINEAR[..6]),
        10 => (9, 28, &LINEAR[..9]),
        11 => (10, 24, &TETRAHEDRON),
        12 => (27, 29, &HEXAHEDRON),
        13 => (18, 26, &PRISM),
        14 => (14, 27, &PYRAMID),
        15 => (1, 1, &LINEAR[..1]),
        16 => (8, 23, &LINEAR[..8]),
        17 => (20, 25, &HEXAHEDRON[..20]),
        18 => (15, 26, &PRISM),
        19 => (13, 27, &PYRAMID),
        _ => return None,
    };
    Some(Kind { nodes, vtk, order })
}

/// Names the family of an unsupported element type.
pub(crate) fn family(number: i64) -> &'static str {
    match number {
        20..=25 | 42..=46 | 52..=56 => "triangles of a higher order",
        26..=28 | 62..=66 => "lines of a higher order",
        29..=33 | 71..=75 | 79..=83 | 137 => "tetrahedra of a higher order",
        34 => "polygons",
        35 => "polyhedra",
        36..=41 | 47..=51 | 57..=61 => "quadrilaterals of a higher order",
        90 | 91 | 106..=117 => "prisms of a higher order",
        92..=105 => "hexahedra of a higher order",
        118..=131 => "pyramids of a higher order",
        _ => "unknown",
    }
}
