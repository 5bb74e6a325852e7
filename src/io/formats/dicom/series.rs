//! The files of one series: those of a folder that belong together.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::dicom::assemble::assemble;
use crate::io::formats::dicom::data_set;
use crate::io::formats::dicom::header::{Account, Header};
use crate::io::formats::dicom::recognise::is_dicom;
use crate::io::options::Request;
use crate::io::report::Found;

/// The limit on files of a series.
const MAX_FILES: usize = 1 << 16;

/// Reads the header of a file and frees its data.
fn header_of(source: &Source, account: &mut Account) -> Result<Header> {
    let (header, data) = data_set::read(source, account)?;
    drop(data);
    account.budget.put_back(header.inflated);
    Ok(header)
}

/// Returns the error for an image without samples.
fn cut(header: &Header) -> Error {
    header.error("PixelData", "there is none: the file may be cut short")
}

/// Reads the series that a file belongs to.
pub(crate) fn read(source: &Source, request: &Request) -> Result<Found> {
    /// The limit on damaged files named in warnings.
    const NAMED: usize = 8;
    let mut account = Account::new(Budget::new(source, request));
    let own = header_of(source, &mut account)?;
    if own.pixels.is_none() {
        return Err(cut(&own));
    }
    if own.frames > 1 {
        return assemble(source, vec![own], &|_| Ok(source.clone()), Vec::new(), account, request);
    }
    let mut names = Vec::new();
    let mut headers = Vec::new();
    let mut others = 0;
    let (mut damaged, mut named) = (0_usize, Vec::new());
    let mut is_damaged = |error: Error| {
        damaged += 1;
        if named.len() < NAMED {
            named.push(format!("left out: {error}"));
        }
    };
    for name in source.neighbours()? {
        let neighbour = source.sibling(&name, request)?;
        if !is_dicom(&neighbour) {
            continue;
        }
        let header = match header_of(&neighbour, &mut account) {
            Ok(header) => header,
            Err(error) if account.full => return Err(error),
            // The damaged file may belong to another series, or be a missing slice of this one.
            Err(error) => {
                is_damaged(error);
                continue;
            }
        };
        let same = header.series == own.series;
        if same && header.pixels.is_some() && header.frames == 1 {
            if headers.len() == MAX_FILES {
                return Err(source.error("series", format!("more than {MAX_FILES} files")));
            }
            names.push(name);
            headers.push(header);
            continue;
        }
        account.budget.put_back(header.taken);
        if same && header.pixels.is_none() {
            is_damaged(cut(&header));
        } else {
            others += 1;
        }
    }
    let mut notes = Vec::new();
    if others > 0 {
        notes.push(format!(
            "{others} DICOM files of the folder are of other series, or no single slices, and left out"
        ));
    }
    let open = |i: usize| source.sibling(&names[i], request);
    let mut loaded = assemble(source, headers, &open, notes, account, request)?;
    if damaged > 0 {
        loaded.report.warnings.extend(named);
        let files = if damaged == 1 { "file" } else { "files" };
        loaded.report.warnings.push(format!(
            "{damaged} damaged {files} of the folder left out: slices of the series may be missing, at its ends or \
             where values were interpolated"
        ));
    }
    Ok(loaded)
}

/// Reads files that must belong to one series.
pub(crate) fn read_files(folder: &Path, files: &[PathBuf], request: &Request) -> Result<Found> {
    let Some(path) = files.first() else {
        return Err(Error::file(folder, "files", "there is none"));
    };
    let source = &Source::open(path, request)?;
    let mut account = Account::new(Budget::new(source, request));
    let mut headers: Vec<Header> = Vec::new();
    let mut without = 0;
    for path in files {
        let header = header_of(&Source::open(path, request)?, &mut account)?;
        if header.pixels.is_none() {
            if header.rows > 0 && header.columns > 0 {
                return Err(cut(&header));
            }
            account.budget.put_back(header.taken);
            without += 1;
        } else if headers.len() == MAX_FILES {
            return Err(Error::file(folder, "series", format!("more than {MAX_FILES} files")));
        } else {
            headers.push(header);
        }
    }
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for header in &headers {
        *counts.entry(&header.series).or_insert(0) += 1;
    }
    if counts.len() > 1 {
        let mut list: Vec<String> = counts
            .iter()
            .take(8)
            .map(|(series, count)| format!("{} of {count} files", text::shown(series)))
            .collect();
        if counts.len() > list.len() {
            list.push(format!("and {} more", counts.len() - list.len()));
        }
        let rule = format!(
            "{} series: {}; name one file of the series that is meant",
            counts.len(),
            list.join(", ")
        );
        return Err(Error::file(folder, "SeriesInstanceUID", rule));
    }
    let Some(first) = headers.first() else {
        return Err(Error::file(folder, "series", "no DICOM file with samples"));
    };
    let mut notes = Vec::new();
    if without > 0 {
        notes.push(format!("{without} DICOM files without samples are left out"));
    }
    let source = Source::open(&first.path, request)?;
    let paths: Vec<PathBuf> = headers.iter().map(|header| header.path.clone()).collect();
    assemble(&source, headers, &|i| Source::open(&paths[i], request), notes, account, request)
}
