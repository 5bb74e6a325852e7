//! Points in tables of text (`.csv`, `.tsv`, `.xyz`; `.txt` where the content is such a table).
//!
//! - **Cells** are separated by tabs where the first row has one outside quotes, else by semicolons, else by
//!   commas, else by blanks. Blanks around cells do not count. A cell may stand in double quotes, where two
//!   are one, and go over several lines. Empty lines, and those that begin with `#`, are passed over. Every
//!   row has as many cells as the first.
//! - **The first row** names the columns, where names of positions are among them or fewer than three of
//!   its cells are numbers. Without names, a comment before it that has some for each column does; else the
//!   first three columns of numbers are x, y and z, and others are named `column 4` and so on.
//! - **Positions** are three columns `x y z`, in upper or lower case, with a unit in brackets or not; or
//!   these letters, or `0 1 2`, behind `p`, `pos`, `position`, `point`, `coord`, `coordinate`, `centre` or
//!   `center`, in the plural or not, with or without one of `_`, `:`, `.` or a blank: `px`, `pos_x`,
//!   `Points:0`.
//! - **Arrays** are the other columns whose first value is a number, and groups of them as
//!   [`super::columns`] says.
//! - **Numbers** have a decimal point. An empty cell, `nan`, `na`, `n/a` and `null` are NaN.

use std::collections::HashSet;
use std::ops::Range;

use glam::DVec3;

use super::arrays::Pick;
use super::columns::{self, Column, bare};
use super::dataset::{self, Origin};
use super::samples::SampleType;
use super::source::{Budget, Source};
use super::text::{self, Scanner, shown};
use super::{Loaded, ReadOptions, Reader};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::Samples;

pub(super) struct Csv;

/// Longest row, in bytes: an open quote would make it the rest of the file.
const MAX_ROW: usize = 1 << 20;

/// Most columns.
const MAX_COLUMNS: usize = 1 << 14;

/// Longest name of a column, in bytes.
const MAX_NAME: usize = 256;

impl Reader for Csv {
    fn name(&self) -> &'static str {
        "CSV"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["csv", "tsv", "xyz", "csv.gz", "tsv.gz", "xyz.gz"]
    }

    /// Only text files whose first two rows can be nothing else: names end in much that is no table.
    fn recognises(&self, source: &Source) -> bool {
        let text = source.path().extension().is_some_and(|ending| ending.eq_ignore_ascii_case("txt"));
        if !text {
            return false;
        }
        let head = String::from_utf8_lossy(source.head());
        // The last line may be cut.
        let Some((lines, _)) = head.rsplit_once('\n') else { return false };
        let mut rows = lines.lines().filter(|line| !is_passed(line));
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
        match positions((0..first.len()).map(|i| first.cell(i))) {
            Ok(Some(axes)) => axes.iter().all(|&axis| is_number(second.cell(axis))),
            _ => [first, second]
                .iter()
                .all(|row| row.len() >= 3 && (0..row.len()).all(|i| is_number(row.cell(i)))),
        }
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let mut budget = Budget::new(source, options);
        let table = Table::survey(source)?;
        let count = text::index(source, "rows", table.rows)?;
        budget.take("points", table.rows.saturating_mul(24))?;
        let mut points = Vec::new();
        points.try_reserve_exact(count).map_err(|_| source.error("points", "memory is full"))?;
        table.each(&table.axes, &mut |xyz| {
            if let [x, y, z] = *xyz {
                points.push(DVec3::new(x, y, z));
            }
        })?;

        let scalars: Vec<usize> = (0..table.columns.len())
            .filter(|place| !table.axes.contains(place) && table.columns[*place].kind.is_some())
            .collect();
        let own: Vec<Column> = scalars
            .iter()
            .map(|&place| &table.columns[place])
            .map(|told| Column { name: told.name.clone(), kind: told.kind.unwrap_or(SampleType::F64) })
            .collect();
        let groups = columns::groups(&own);
        let arrays = groups.iter().map(|group| group.info.clone()).collect();
        let mut read = |index: usize, pick: Pick| -> Result<Samples> {
            let wanted: Vec<usize> = groups[index].needed(pick).iter().map(|&i| scalars[i]).collect();
            let mut values = Vec::with_capacity(count);
            table.each(&wanted, &mut |numbers| {
                values.push(num::f32_of(columns::value(numbers, pick)));
            })?;
            Ok(Samples::F32(values))
        };
        let origin = Origin { source, format: self.name(), arrays };
        let mut loaded = dataset::points(points, origin, &mut budget, &mut read, options)?;
        loaded.report.notes.splice(0..0, table.notes());
        loaded.report.warnings.extend(table.warnings());
        Ok(loaded)
    }
}

/// What separates cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Delimiter {
    Byte(u8),
    Blanks,
}

impl Delimiter {
    /// Of a table with such a first row.
    fn of(line: &str) -> Self {
        let mut quoted = false;
        let mut there = [false; 3];
        for byte in line.trim().bytes() {
            quoted ^= byte == b'"';
            for (there, delimiter) in there.iter_mut().zip(b"\t;,") {
                *there |= !quoted && byte == *delimiter;
            }
        }
        let first = b"\t;,".iter().zip(there).find(|(_, there)| *there);
        first.map_or(Self::Blanks, |(&delimiter, _)| Self::Byte(delimiter))
    }

    fn separates(self, byte: u8) -> bool {
        match self {
            Self::Byte(delimiter) => byte == delimiter,
            Self::Blanks => byte.is_ascii_whitespace(),
        }
    }
}

/// Whether a line is no row.
fn is_passed(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || line.starts_with('#')
}

/// The cells of a row.
#[derive(Default)]
struct Row {
    text: String,
    cells: Vec<Range<usize>>,
    /// Where the cell that is read begins.
    begin: usize,
}

impl Row {
    fn len(&self) -> usize {
        self.cells.len()
    }

    fn cell(&self, i: usize) -> &str {
        &self.text[self.cells[i].clone()]
    }

    /// Splits a line; one that goes on within quotes, where they are open. True where it ends within quotes.
    ///
    /// # Errors
    ///
    /// What follows a quoted cell without a delimiter.
    fn split<'l>(
        &mut self,
        line: &'l str,
        delimiter: Delimiter,
        open: bool,
    ) -> std::result::Result<bool, &'l str> {
        let blank = |c: char| c.is_whitespace() && !(delimiter == Delimiter::Byte(b'\t') && c == '\t');
        let mut rest = line;
        let mut quoted = open;
        if open {
            self.text.push('\n');
        } else {
            self.text.clear();
            self.cells.clear();
        }
        loop {
            if !quoted {
                rest = rest.trim_start_matches(blank);
                if delimiter == Delimiter::Blanks && rest.is_empty() {
                    return Ok(false);
                }
                self.begin = self.text.len();
                if let Some(inside) = rest.strip_prefix('"') {
                    (rest, quoted) = (inside, true);
                }
            }
            if quoted {
                while let Some(end) = rest.find('"') {
                    self.text.push_str(&rest[..end]);
                    rest = &rest[end + 1..];
                    match rest.strip_prefix('"') {
                        Some(more) => {
                            self.text.push('"');
                            rest = more;
                        }
                        None => {
                            quoted = false;
                            break;
                        }
                    }
                }
                if quoted {
                    self.text.push_str(rest);
                    return Ok(true);
                }
                if delimiter != Delimiter::Blanks {
                    rest = rest.trim_start_matches(blank);
                }
                if rest.bytes().next().is_some_and(|byte| !delimiter.separates(byte)) {
                    return Err(rest);
                }
            } else {
                let end = rest.bytes().position(|byte| delimiter.separates(byte)).unwrap_or(rest.len());
                self.text.push_str(rest[..end].trim());
                rest = &rest[end..];
            }
            self.cells.push(self.begin..self.text.len());
            if delimiter != Delimiter::Blanks {
                let Some(next) = rest.get(1..) else { return Ok(false) };
                rest = next;
            }
        }
    }
}

/// A number, or NaN for what stands for none.
fn number(cell: &str) -> Option<f64> {
    if cell.is_empty() || ["na", "n/a", "null"].iter().any(|none| cell.eq_ignore_ascii_case(none)) {
        return Some(f64::NAN);
    }
    text::float(cell)
}

/// Whether a cell can be nothing but a number: `Na` may be sodium.
fn is_number(cell: &str) -> bool {
    text::float::<f64>(cell).is_some()
}

/// Rows, one after the other.
struct Rows<'a> {
    scanner: Scanner<'a>,
    delimiter: Option<Delimiter>,
    row: Row,
    /// Where it begins.
    line: u64,
    /// The last comment before the first row.
    comment: Option<String>,
}

impl<'a> Rows<'a> {
    fn new(source: &'a Source, delimiter: Option<Delimiter>) -> Self {
        let scanner = Scanner::new(source);
        Self { scanner, delimiter, row: Row::default(), line: 0, comment: None }
    }

    /// Reads the next row. False at the end.
    fn next(&mut self) -> Result<bool> {
        loop {
            let Some(mut line) = self.scanner.next_line()? else { return Ok(false) };
            if self.scanner.lines() == 1 && line.starts_with('\u{feff}') {
                line.remove(0);
            }
            if is_passed(&line) {
                if let Some(comment) = line.trim().strip_prefix('#').filter(|_| self.delimiter.is_none()) {
                    self.comment = Some(comment.to_owned());
                }
                continue;
            }
            self.line = self.scanner.lines();
            let delimiter = *self.delimiter.get_or_insert_with(|| Delimiter::of(&line));
            let mut open = false;
            loop {
                match self.row.split(&line, delimiter, open) {
                    Ok(false) => return Ok(true),
                    Ok(true) => open = true,
                    Err(rest) => {
                        return Err(self.error(format!("\"{}\": must not follow a quoted cell", shown(rest))));
                    }
                }
                if self.row.text.len() > MAX_ROW {
                    return Err(self.error(format!("a row longer than {MAX_ROW} bytes: is a quote open?")));
                }
                let Some(next) = self.scanner.next_line()? else {
                    return Err(self.error("ends within quotes"));
                };
                line = next;
            }
        }
    }

    fn error(&self, rule: impl Into<String>) -> Error {
        self.scanner.source().error(format!("line {}", self.line), rule)
    }
}

/// The columns that are positions. An error has the column that is one a second time.
fn positions<'n>(names: impl Iterator<Item = &'n str>) -> std::result::Result<Option<[usize; 3]>, usize> {
    const STEMS: [&str; 15] = [
        "",
        "p",
        "pos",
        "position",
        "positions",
        "point",
        "points",
        "coord",
        "coords",
        "coordinate",
        "coordinates",
        "centre",
        "centres",
        "center",
        "centers",
    ];
    let mut found = [[None; 3]; STEMS.len()];
    let mut twice = [None; STEMS.len()];
    for (column, name) in names.enumerate() {
        let name = bare(name).to_lowercase();
        let letter = |axis: char| name.strip_suffix(axis);
        let digit = |axis: char| letter(axis).filter(|stem| !stem.is_empty());
        let parts = [letter('x'), letter('y'), letter('z'), digit('0'), digit('1'), digit('2')];
        let Some((place, stem)) = parts.into_iter().enumerate().find_map(|(i, stem)| Some((i % 3, stem?)))
        else {
            continue;
        };
        let stem = stem.trim_end_matches(['_', ':', '.', ' ']);
        if let Some(rank) = STEMS.iter().position(|known| *known == stem)
            && found[rank][place].replace(column).is_some()
        {
            twice[rank] = Some(column);
        }
    }
    for (found, twice) in found.into_iter().zip(twice) {
        if let [Some(x), Some(y), Some(z)] = found {
            return twice.map_or(Ok(Some([x, y, z])), Err);
        }
    }
    Ok(None)
}

/// A column, and the type of its numbers if they are some.
struct Told {
    name: String,
    kind: Option<SampleType>,
}

/// What a first look at all rows tells.
struct Table<'a> {
    source: &'a Source,
    delimiter: Delimiter,
    /// Whether the first row is names.
    header: bool,
    /// Whether there are names at all.
    named: bool,
    columns: Vec<Told>,
    axes: [usize; 3],
    rows: u64,
}

impl<'a> Table<'a> {
    fn survey(source: &'a Source) -> Result<Self> {
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
        let cells: Vec<String> = (0..width).map(|i| rows.row.cell(i).to_owned()).collect();
        let twice = |column: usize| {
            rows.error(format!("column {} is a position again: which one counts?", column + 1))
        };
        let mut axes = positions(cells.iter().map(String::as_str)).map_err(twice)?;
        let numeric: Vec<usize> = (0..width).filter(|&i| is_number(&cells[i])).collect();
        let header = axes.is_some() || numeric.len() < 3;
        let mut names = cells;
        let mut named = true;
        if !header {
            named = false;
            names = (1..=width).map(|column| format!("column {column}")).collect();
            axes = numeric.first_chunk().copied();
            // A comment may name the columns.
            let mut row = Row::default();
            let comment = rows.comment.as_deref().unwrap_or("");
            if row.split(comment, delimiter, false) == Ok(false)
                && row.len() == width
                && let Some(told) = positions((0..width).map(|i| row.cell(i))).map_err(twice)?
            {
                named = true;
                names = (0..width).map(|i| row.cell(i).to_owned()).collect();
                axes = Some(told);
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
        let names = names.iter().map(|name| text::plain(name));
        let columns = names.map(|name| Told { name, kind: None }).collect();
        let mut table = Self { source, delimiter, header, named, columns, axes, rows: 0 };
        let mut words = vec![false; width];
        let mut more = !header || rows.next()?;
        while more {
            if rows.row.len() != width {
                return Err(rows.error(format!("{} cells: the first row has {width}", rows.row.len())));
            }
            table.rows += 1;
            for (i, (told, words)) in table.columns.iter_mut().zip(&mut words).enumerate() {
                let cell = rows.row.cell(i);
                // The first value decides whether these are numbers, all of them whether they are whole.
                match told.kind {
                    _ if *words => {}
                    None if cell.is_empty() => {}
                    None => match number(cell) {
                        Some(number) if number.is_nan() => {}
                        Some(_) if cell.parse::<i64>().is_ok() => told.kind = Some(SampleType::I64),
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

    /// Hands out of each row the numbers of the columns that are wanted.
    fn each(&self, wanted: &[usize], sink: &mut dyn FnMut(&[f64])) -> Result<()> {
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

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.named {
            let [x, y, z] = self.axes.map(|axis| axis + 1);
            notes.push(format!("no names of columns: columns {x}, {y} and {z} are taken for x, y and z"));
        }
        let words = self.columns.iter().filter(|told| told.kind.is_none() && !told.name.is_empty());
        let words: Vec<&str> = words.map(|told| told.name.as_str()).take(16).collect();
        if !words.is_empty() {
            notes.push(format!("columns without numbers left out: {}", shown(&words.join(", "))));
        }
        notes
    }

    fn warnings(&self) -> Vec<String> {
        let mut names = HashSet::new();
        let again =
            self.columns.iter().filter(|told| told.kind.is_some() && !names.insert(told.name.as_str()));
        again
            .take(16)
            .map(|told| format!("several columns \"{}\": the first is read by this name", shown(&told.name)))
            .collect()
    }
}
