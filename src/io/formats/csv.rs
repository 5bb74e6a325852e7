//! Points in tables of text (`.csv`, `.tsv`, `.xyz`; `.txt` if the content looks like such a table).
//!
//! - **Cells** are separated by tabs if the first row has one outside quotes, else by semicolons, else by commas, else by
//!   blanks. Blanks around cells are ignored. A cell may be in double quotes, in which a doubled quote stands for one, and
//!   may then span several lines. Empty lines and lines that begin with `#` are skipped. Every row has as many cells as
//!   the first.
//! - **The first row** names the columns if it contains names of positions, or fewer than three numbers. Otherwise a
//!   comment before it that has a name for each column names them. Without names, the first three numeric columns are x, y
//!   and z, and the others are `column 4` and so on.
//! - **Positions** are three columns `x y z`, in upper or lower case, with an optional unit in brackets; or these letters,
//!   or `0 1 2`, after `p`, `pos`, `position`, `point`, `coord`, `coordinate`, `centre` or `center`, singular or plural,
//!   with an optional `_`, `:`, `.` or blank between: `px`, `pos_x`, `Points:0`.
//! - **Arrays** are the other columns whose first value is a number, and groups of them as described in
//!   [`crate::io::build::columns`].
//! - **Numbers** have a decimal point. An empty cell, `nan`, `na`, `n/a` and `null` are NaN.

mod row;
mod table;

use crate::error::Result;
use crate::io::build::columns::{self, Column};
use crate::io::build::origin::Origin;
use crate::io::build::points;
use crate::io::file::budget::Budget;
use crate::io::file::decode::Values;
use crate::io::file::sample_type::Pick;
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::csv::row::{Delimiter, Row, is_number, is_skipped};
use crate::io::formats::csv::table::{Table, TableColumn, positions};
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;

pub(crate) struct Csv;

impl Reader for Csv {
    fn name(&self) -> &'static str {
        "CSV"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["csv", "tsv", "xyz", "csv.gz", "tsv.gz", "xyz.gz"]
    }

    /// Recognises only `.txt` files whose first two rows look like a table; other extensions are matched by name.
    fn recognises(&self, source: &Source) -> bool {
        if source.path().extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("txt")) {
            return false;
        }
        let head = String::from_utf8_lossy(source.head());
        // The last line of the head may be incomplete.
        let Some((lines, _)) = head.rsplit_once('\n') else { return false };
        let mut rows = lines.lines().filter(|line| !is_skipped(line));
        let (Some(first), Some(second)) = (rows.next(), rows.next()) else { return false };
        let delimiter = Delimiter::of(first);
        let cells = |line: &str| {
            let mut row = Row::default();
            row.split(line, delimiter, false).is_ok_and(|open| !open).then_some(row)
        };
        let (Some(first), Some(second)) = (cells(first), cells(second)) else { return false };
        if first.len() != second.len() {
            return false;
        }
        match positions(first.cells()) {
            Ok(Some(axes)) => axes.iter().all(|&axis| is_number(second.cell(axis))),
            _ => [first, second].iter().all(|row| row.len() >= 3 && row.cells().all(is_number)),
        }
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let mut budget = Budget::new(source, request);
        let table = Table::survey(source)?;
        let count = text::index(source, "rows", table.rows)?;
        let points = points::positions(source, &mut budget, count, |push| table.each(&table.axes, push))?;

        let numeric = |(place, told): (usize, &TableColumn)| {
            Some((place, Column { name: told.name.clone(), kind: told.kind? }))
        };
        let others = table.columns.iter().enumerate().filter(|(place, _)| !table.axes.contains(place));
        let (scalars, own): (Vec<usize>, Vec<Column>) = others.filter_map(numeric).unzip();
        let groups = columns::groups(&own);
        let arrays = groups.iter().map(|group| group.info.clone()).collect();
        let mut read = |index: usize, pick: Pick| -> Result<Values> {
            let wanted: Vec<usize> = groups[index].needed(pick).iter().map(|&i| scalars[i]).collect();
            columns::collect(&groups[index].info, pick, count, |push| table.each(&wanted, push))
        };
        let (budget, read) = (&mut budget, &mut read);
        let origin = Origin {
            source,
            format: self.name(),
            arrays,
            spare: columns::spare(&groups),
            request,
            budget,
            read,
        };
        let mut loaded = points::points(points, origin)?;
        loaded.report.notes.splice(0..0, table.notes());
        loaded.report.warnings.extend(table.warnings());
        Ok(loaded)
    }
}
