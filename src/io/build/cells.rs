//! Counts of cells by VTK type number: which types have a volume, which are supported.

use std::collections::BTreeMap;

use crate::error::Result;
use crate::io::file::source::Source;
use crate::scene::CellKind;

/// The number of cells of each VTK type.
pub(crate) type Counts = BTreeMap<u8, u64>;

/// Whether cells of this VTK type have no volume.
pub(crate) fn flat(number: u8) -> bool {
    matches!(number, 0..=9 | 21..=23 | 28 | 30 | 34..=36 | 60..=63 | 68..=70 | 75..=77)
}

/// Refuses cells with a volume that cannot be cut into tetrahedra, which must not be dropped silently.
pub(crate) fn check_supported(source: &Source, counts: &Counts) -> Result<()> {
    let unknown = |number: u8| CellKind::of_vtk(number).is_none() && !flat(number);
    let Some((number, count)) = counts.iter().find(|&(&number, _)| unknown(number)) else { return Ok(()) };
    let name = match number {
        42 => " (polyhedra)",
        64..=67 | 71..=74 | 78..=81 => " (of a higher order)",
        _ => "",
    };
    let rule = format!(
        "{count} of type {number}{name}: tetrahedra, voxels, hexahedra, wedges and pyramids, linear and \
         quadratic, are supported"
    );
    Err(source.error("cells", rule))
}

/// Checks that cells without volume are vertices at most (types 0 to 2: empty, vertex, poly-vertex), so that the data
/// set can be read as points.
pub(crate) fn check_points(source: &Source, counts: &Counts) -> Result<()> {
    check_supported(source, counts)?;
    if counts.keys().all(|&number| number <= 2) {
        return Ok(());
    }
    Err(source.error("cells", format!("{}: a volume needs solid cells, or points alone", named(counts))))
}

fn named(counts: &Counts) -> String {
    let name = |number: u8| match number {
        3 => "lines".to_owned(),
        4 => "polylines".to_owned(),
        5 => "triangles".to_owned(),
        6 => "triangle strips".to_owned(),
        7 => "polygons".to_owned(),
        8 => "pixels".to_owned(),
        9 => "quadrilaterals".to_owned(),
        _ => format!("cells of type {number}"),
    };
    counts.iter().map(|(&number, count)| format!("{count} {}", name(number))).collect::<Vec<_>>().join(", ")
}
