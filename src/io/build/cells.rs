//! Counts of cells by VTK type number: which types have a volume, which are supported.

use std::collections::BTreeMap;

use crate::error::Result;
use crate::io::file::source::Source;
use crate::scene::CellKind;

/// Cells of each type.
pub(crate) type Counts = BTreeMap<u8, u64>;

/// Whether cells of a type have no volume.
pub(crate) fn flat(number: u8) -> bool {
    matches!(number, 0..=9 | 21..=23 | 28 | 30 | 34..=36 | 60..=63 | 68..=70 | 75..=77)
}

/// Three-dimensional types without a rule must not be lost silently.
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

/// Whether cells among which none is solid leave the points alone. Types 0 to 2 are nothing, vertex and
/// vertices.
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
