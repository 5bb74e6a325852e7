//! A table: its columns, found in a first pass over all rows, and its numbers.

use std::collections::HashSet;

use crate::error::Result;
use crate::io::build::columns::bare;
use crate::io::file::sample_type::SampleType;
use crate::io::file::source::Source;
use crate::io::file::text::{self, shown};
use crate::io::formats::csv::row::{Delimiter, Row, Rows, is_number, number};

/// The largest magnitude up to which 64-bit floats represent every whole number.
const EXACT: u64 = 1 << 53;

/// The limit on columns.
const MAX_COLUMNS: usize = 1 << 14;

/// The limit on the length of a column name, in bytes.
const MAX_NAME: usize = 256;

/// Names of positions without their coordinate, the first of which is empty.
const STEMS: &str = ",p,pos,position,positions,point,points,coord,coords,coordinate,coordinates,centre,centres,center,\
    centers";

/// Finds the columns of positions by name. The error is a column that duplicates one of them.
pub(crate) fn positions<'n>(
    names: impl Iterator<Item = &'n str>,
) -> std::result::Result<Option<[usize; 3]>, usize> {
    // The columns of the three coordinates for each stem, and the last column that duplicates one.
    let mut found = vec![([None; 3], None); STEMS.split(',').count()];
    for (column, name) in names.enumerate() {
        let name = bare(name).to_lowercase();
        let letter = |axis: char| name.strip_suffix(axis);
        let digit = |axis: char| letter(axis).filter(|stem| !stem.is_empty());
        let parts = [letter('x'), letter('y'), letter('z'), digit('0'), digit('1'), digit('2')];
        let part = parts.into_iter().enumerate().find_map(|(i, stem)| Some((i % 3, stem?)));
        let Some((axis, stem)) = part else { continue };
        let stem = stem.trim_end_matches(['_', ':', '.', ' ']);
        if let Some(rank) = STEMS.split(',').position(|known| known == stem)
            && found[rank].0[axis].replace(column).is_some()
        {
            found[rank].1 = Some(column);
        }
    }
    let complete = found.into_iter().find_map(|(axes, twice)| match axes {
        [Some(x), Some(y), Some(z)] => Some(twice.map_or(Ok([x, y, z]), Err)),
        _ => None,
    });
    complete.transpose()
}

/// A column; its type is None if it holds no numbers.
pub(crate) struct TableColumn {
    pub(crate) name: String,
    pub(crate) kind: Option<SampleType>,
    /// Whether it has whole numbers that 64-bit floats round.
    rounded: bool,
}

/// A table after its first pass.
pub(crate) struct Table<'a> {
    source: &'a Source,
    delimiter: Delimiter,
    /// Whether the first row holds names.
    header: bool,
    /// Whether the columns have names.
    named: bool,
    pub(crate) columns: Vec<TableColumn>,
    pub(crate) axes: [usize; 3],
    pub(crate) rows: u64,
}

impl<'a> Table<'a> {
    pub(crate) fn survey(source: &'a Source) -> Result<Self> {
        if [&[0xff, 0xfe], &[0xfe, 0xff]].iter().any(|mark| source.head().starts_with(*mark)) {
            return Err(source.error("byte 0", "text of 16-bit units: must be UTF-8"));
        }
        let mut rows = Rows::new(source, None);
        if !rows.next()? {
            return Err(source.error("rows", "there is none"));
        }
        let width = rows.row.len();
        if width > MAX_COLUMNS {
            return Err(rows.error(format!("{width} columns: must be at most {MAX_COLUMNS}")));
        }
        let delimiter = rows.delimiter.unwrap_or(Delimiter::Blanks);
        let twice = |column: usize| {
            rows.error(format!("column {} is a second column of the same coordinate", column + 1))
        };
        let mut axes = positions(rows.row.cells()).map_err(twice)?;
        let numeric: Vec<usize> = (0..width).filter(|&i| is_number(rows.row.cell(i))).collect();
        let header = axes.is_some() || numeric.len() < 3;
        let (mut names, mut named) = (rows.row.names(), true);
        if !header {
            (names, named) = ((1..=width).map(|column| format!("column {column}")).collect(), false);
            axes = numeric.first_chunk().copied();
            // A comment may name the columns.
            let mut row = Row::default();
            let comment = rows.comment.as_deref().unwrap_or("");
            if row.split(comment, delimiter, false) == Ok(false)
                && row.len() == width
                && let Some(told) = positions(row.cells()).map_err(twice)?
            {
                (names, named, axes) = (row.names(), true, Some(told));
            }
        }
        let Some(axes) = axes else {
            let rule = format!(
                "\"{}\": no columns of positions, which are x, y and z, or px, pos_x, Points:0 and the like",
                shown(&names.join(", "))
            );
            return Err(rows.error(rule));
        };

        if let Some(i) = names.iter().position(|name| name.len() > MAX_NAME) {
            let rule = format!("column {}: its name is longer than {MAX_NAME} bytes", i + 1);
            return Err(rows.error(rule));
        }
        let columns = names
            .iter()
            .map(|name| TableColumn { name: text::plain(name), kind: None, rounded: false })
            .collect();
        let mut table = Self { source, delimiter, header, named, columns, axes, rows: 0 };
        let mut words = vec![false; width];
        let mut more = !header || rows.next()?;
        while more {
            if rows.row.len() != width {
                return Err(rows.error(format!("{} cells: the first row has {width}", rows.row.len())));
            }
            table.rows += 1;
            for ((told, words), cell) in table.columns.iter_mut().zip(&mut words).zip(rows.row.cells()) {
                // The first value decides whether the column is numeric; it is a column of whole numbers if all
                // values are.
                told.rounded |= cell.parse().is_ok_and(|whole: i64| whole.unsigned_abs() > EXACT);
                match told.kind {
                    _ if *words => {}
                    None if cell.is_empty() => {}
                    None => match number(cell) {
                        Some(number) if number.is_nan() => {}
                        // A column with a missing number has NaN, which whole numbers lack.
                        Some(_) if table.rows == 1 && cell.parse::<i64>().is_ok() => {
                            told.kind = Some(SampleType::I64);
                        }
                        Some(_) => told.kind = Some(SampleType::F64),
                        None => *words = true,
                    },
                    Some(SampleType::I64) if cell.parse::<i64>().is_err() => {
                        told.kind = Some(SampleType::F64)
                    }
                    Some(_) => {}
                }
            }
            more = rows.next()?;
        }
        if table.rows == 0 {
            return Err(source.error("rows", "there is none but that of names"));
        }
        Ok(table)
    }

    /// Passes the numbers of the wanted columns to `sink`, row by row.
    pub(crate) fn each(&self, wanted: &[usize], sink: &mut dyn FnMut(&[f64])) -> Result<()> {
        let mut rows = Rows::new(self.source, Some(self.delimiter));
        let mut numbers = vec![0.0; wanted.len()];
        if self.header {
            rows.next()?;
        }
        while rows.next()? {
            for (value, &column) in numbers.iter_mut().zip(wanted) {
                let Some(cell) = (column < rows.row.len()).then(|| rows.row.cell(column)) else {
                    return Err(rows.error(format!("{} cells: too few", rows.row.len())));
                };
                *value = number(cell).ok_or_else(|| {
                    let name = shown(&self.columns[column].name);
                    let place = format!("line {}, column {} ({name})", rows.line, column + 1);
                    let comma = if cell.contains(',') { " with a decimal point" } else { "" };
                    self.source.error(place, format!("\"{}\": must be a number{comma}", shown(cell)))
                })?;
            }
            sink(&numbers);
        }
        Ok(())
    }

    pub(crate) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.named {
            let [x, y, z] = self.axes.map(|axis| axis + 1);
            notes
                .push(format!("the columns have no names: columns {x}, {y} and {z} are taken as x, y and z"));
        }
        let words = self.columns.iter().filter(|told| told.kind.is_none() && !told.name.is_empty());
        let words: Vec<&str> = words.map(|told| told.name.as_str()).take(16).collect();
        if !words.is_empty() {
            notes.push(format!("columns without numbers left out: {}", shown(&words.join(", "))));
        }
        notes
    }

    pub(crate) fn warnings(&self) -> Vec<String> {
        let mut names = HashSet::new();
        let again =
            self.columns.iter().filter(|told| told.kind.is_some() && !names.insert(told.name.as_str()));
        let warning =
            |name: &str| format!("several columns \"{}\": the first is read by this name", shown(name));
        let rounded = self.columns.iter().filter(|told| told.kind.is_some() && told.rounded);
        let rounding =
            |name: &str| format!("column \"{}\": whole numbers beyond 2^53 are rounded", shown(name));
        let warnings = again.take(16).map(|told| warning(&told.name));
        warnings.chain(rounded.take(16).map(|told| rounding(&told.name))).collect()
    }
}
