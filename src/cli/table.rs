//! Aligned text, and numbers short enough for it.

use volraster::glam::DVec3;

/// Lays rows out in columns as wide as their widest cell, two spaces apart. The first row is the
/// heading. Columns whose place is in `left` are left-aligned, the others are of numbers.
pub(crate) fn aligned(rows: &[Vec<String>], left: &[usize]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| {
            if left.contains(&column) { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_string()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Three numbers.
pub(crate) fn triple(v: DVec3) -> String {
    format!("[{}, {}, {}]", number(v.x), number(v.y), number(v.z))
}

/// Six significant digits are enough to look at.
pub(crate) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        return "0".to_string();
    }
    if !(1e-4..1e6).contains(&magnitude) {
        return format!("{value:.5e}");
    }
    let text = format!("{value:.*}", if magnitude < 1.0 { 6 } else { 4 });
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let rows = [["name", "ms"], ["a", "10.5"], ["longer", "7"]];
        let rows: Vec<Vec<String>> = rows.iter().map(|row| row.map(str::to_string).to_vec()).collect();
        assert_eq!(aligned(&rows, &[0]), "name      ms\na       10.5\nlonger     7");
    }

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.0, 0.1 + 0.2, 1e-7, -12.345_678, 3e9].map(number);
        assert_eq!(texts, ["0", "1", "0.3", "1.00000e-7", "-12.3457", "3.00000e9"]);
    }
}
