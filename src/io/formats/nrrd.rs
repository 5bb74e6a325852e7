//! NRRD, with its data attached (`.nrrd`) or in one or several other files (`.nhdr`).
//!
//! The array has three dimensions, optionally one of components before them and further ones of size 1 after them. The
//! encodings raw, gzip and text are supported. World coordinates are those of the file; an anatomical `space` sets the
//! anatomy of the grid.
//!
//! A spacing of NaN is unknown and counts as 1; a negative one reverses its axis. A file that names a `space` but has
//! `spacings` instead of directions breaks the rules of the format; its axes are taken along those of the space, with a
//! warning. Without directions and `space origin`, `axis mins` and `axis maxs` place the grid, at cell centres unless
//! `centers` says nodes.
//!
//! Only the names of fields that neither place nor scale samples (`content`, `units`, `thicknesses`, ...) are checked.

mod axes;
mod header;
mod placement;

use std::cell::Cell;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};
use crate::io::build::data_file::Unit;
use crate::io::build::file_names::Files;
use crate::io::build::volume::Chosen;
use crate::io::file::decode::Layout;
use crate::io::file::sample_type::Pick;
use crate::io::file::samples::{self, Part};
use crate::io::file::source::{Encoding, Source};
use crate::io::formats::nrrd::header::Header;
use crate::io::options::{Request, Wanted};
use crate::io::reader::Reader;
use crate::io::report::Found;

pub(crate) struct Nrrd;

/// The limit on bytes skipped in all data files together: one file may be named many times.
const MAX_SKIP: u64 = 1 << 28;

impl Reader for Nrrd {
    fn name(&self) -> &'static str {
        "NRRD"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["nrrd", "nhdr"]
    }

    fn recognises(&self, source: &Source) -> bool {
        !source.is_gzip() && source.head().starts_with(b"NRRD")
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let header = Header::read(source)?;
        let kind = header.sample_type()?;
        let axes = header.axes()?;
        let packing = header.packing()?;
        let endian = header.endian(kind, packing)?;
        let placement = header.placement(&axes)?;
        let dims = axes.dims();
        let mut chosen =
            Chosen::new(source, "sizes", Layout::scalar(dims, kind, endian), axes.components(), request)?;
        let is_scene = request.wanted == Wanted::Scene;
        let first_alone =
            is_scene && axes.components() > 1 && request.array.is_none() && header.has_no_length();
        if first_alone {
            chosen.layout.pick = Pick::Component(0);
        }

        if let Some(units) = header.fields.get("space units") {
            let symbol = units.split_whitespace().next().unwrap_or_default().trim_matches('"');
            let unit = Unit::ALL.iter().find(|(_, own)| *own == symbol);
            chosen.unit = unit.map_or(Unit::Unknown, |&(unit, _)| unit);
        }

        let files = header.files(&axes)?;
        let count = files.as_ref().map_or(1, Files::count);
        let lines = header.fields.whole_number("line skip", 0)?;
        let skip = header.fields.whole_number("byte skip", -1)?;
        if skip < 0 && packing != Some(Encoding::Raw) {
            return Err(header
                .fields
                .error("byte skip", "-1: only raw data can be found from the end of its file"));
        }
        let skipped = Cell::new(0_u64);
        let part = |index: usize, share: u64| {
            if index == 0 {
                skipped.set(0);
            }
            let (data, start) = match &files {
                None => (source.clone(), header.end),
                Some(files) => (source.sibling(Path::new(&files.name(index)), request)?, 0),
            };
            let begin = skip_lines(&data, start, lines)?;
            let skip = match skip {
                -1 => (data.len() - begin).checked_sub(share).ok_or_else(|| {
                    data.error("data", format!("needs {share} bytes: {} are there", data.len() - begin))
                })?,
                skip => skip.unsigned_abs(),
            };
            // Uncompressed bytes are skipped by offset, without reading.
            let seeks = packing == Some(Encoding::Raw);
            let (offset, skip) = if seeks { (begin.saturating_add(skip), 0) } else { (begin, skip) };
            let read = skipped.get().saturating_add(begin - start).saturating_add(skip);
            skipped.set(read);
            if count > 1 && read > MAX_SKIP {
                let rule = format!("skips {read} bytes in {} files: the limit is {MAX_SKIP}", index + 1);
                return Err(header.fields.error(if lines > 0 { "line skip" } else { "byte skip" }, rule));
            }
            let encoding = packing.unwrap_or(Encoding::Raw);
            Ok(Part { source: data, offset, encoding, skip, text: packing.is_none() })
        };
        let parts = usize::try_from(count).unwrap_or(usize::MAX);
        let samples = samples::read(source, "sizes", &chosen.layout, parts, &part, request)?;

        let grid = chosen.grid(samples).map_err(|error| error.in_file(source.path()))?;
        let located = |name, error| header.fields.located(name, error);
        let mut loaded = chosen.placed(self.name(), grid, placement, &located)?;
        if first_alone {
            loaded.report.warnings.push(format!(
                "the first of {} entries at each sample is shown: name values:1 and so on for others",
                axes.components()
            ));
        }
        Ok(loaded)
    }
}

/// Returns the offset after skipping lines of the file as stored.
fn skip_lines(source: &Source, start: u64, lines: i64) -> Result<u64> {
    let (mut skipped, mut position) = (0, start);
    let mut bytes = source.reader(start, Encoding::Raw).bytes();
    while skipped < lines {
        let Some(byte) = bytes.next() else {
            return Err(source.error("line skip", format!("{lines}: the data has {skipped} lines")));
        };
        let byte = byte.map_err(|e| Error::io(source.path(), "cannot read", e))?;
        position += 1;
        skipped += i64::from(byte == b'\n');
    }
    Ok(position)
}
