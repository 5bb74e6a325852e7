//! Raw samples, whose layout comes from the caller, from a JSON file beside them, or from their name.
//!
//! The JSON file has the name of the samples with the extension `.json`, or is read itself and names them. It has the keys
//! `dims` and `type`, and optionally `file`, `endian`, `spacing`, `origin`, `direction` (nine numbers, row by row; the
//! columns are the directions of the index axes) and `offset`. It takes precedence over the name.
//!
//! The words of a name such as `head_256x256x128_int16_be_0.5x0.5x1.2.raw` are separated by `_`, `-` or blanks, and by
//! dots that are not decimal points.

mod file_name;
pub(crate) mod layout;

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::build::data_file::Lattice;
use crate::io::build::volume::Chosen;
use crate::io::file::decode::{Layout, Values};
use crate::io::file::samples::{self, Part};
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::raw::file_name::named;
use crate::io::formats::raw::layout::{RawLayout, Sidecar};
use crate::io::options::{ReadOptions, Request, Wanted};
use crate::io::reader::Reader;
use crate::io::report::{Found, Loaded};
use crate::scene::Grid;

/// Reads a file that holds `layout.offset` bytes, then exactly the samples. A gzip stream is decompressed first, and
/// the offset counts decompressed bytes.
///
/// # Errors
///
/// [`crate::Error::Io`] if the file cannot be read; [`crate::Error::File`] if its size does not fit the layout, the
/// layout is no valid grid, or the samples would take more than `options.max_bytes`.
pub fn read_raw(path: impl AsRef<Path>, layout: &RawLayout, options: &ReadOptions) -> Result<Grid> {
    read(&Source::open(path.as_ref(), options)?, layout, options)
}

pub(crate) fn read(source: &Source, layout: &RawLayout, options: &ReadOptions) -> Result<Grid> {
    let samples = values(source, layout, &numbers(layout), options)?.into_samples();
    Grid::new(layout.dims, samples)
        .and_then(|grid| grid.with_placement(layout.spacing, layout.origin, layout.direction))
        .map_err(|error| error.in_file(source.path()))
}

fn values(source: &Source, layout: &RawLayout, numbers: &Layout, options: &ReadOptions) -> Result<Values> {
    let part = |_, bytes| Ok(Part::sized(source.clone(), layout.offset, bytes));
    samples::read(source, "dims", numbers, 1, &part, options)
}

pub(crate) struct Raw;

impl Reader for Raw {
    fn name(&self) -> &'static str {
        "raw samples"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["raw", "raw.gz", "json"]
    }

    fn recognises(&self, _: &Source) -> bool {
        // Raw samples can be identified by name only.
        false
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let name = source.path().file_name().map(|name| name.to_string_lossy().into_owned());
        let name = name.unwrap_or_default();
        let Some(stem) = stem(&name) else {
            let sidecar = Sidecar::read(source)?;
            let data = match &sidecar.file {
                Some(file) => PathBuf::from(file),
                None => {
                    let raw = Path::new(&name).with_extension("raw");
                    let packed = Path::new(&name).with_extension("raw.gz");
                    if !source.has_sibling(&raw) && source.has_sibling(&packed) { packed } else { raw }
                }
            };
            let layout = sidecar.layout(|key, rule| source.error(key, rule));
            return found(&source.sibling(&data, request)?, &layout?, request, Vec::new());
        };
        let beside = PathBuf::from(format!("{stem}.json"));
        if source.has_sibling(&beside) {
            let json = source.sibling(&beside, request)?;
            if let Some(sidecar) = Sidecar::parse(&json)? {
                if let Some(other) =
                    sidecar.file.as_ref().filter(|file| file.strip_prefix("./").unwrap_or(file) != name)
                {
                    let rule = format!("\"{}\": lies beside {name} and must name it", text::shown(other));
                    return Err(json.error("file", rule));
                }
                let notes = vec![format!("layout from {}", beside.display())];
                let layout = sidecar.layout(|key, rule| json.error(key, rule))?;
                return found(source, &layout, request, notes);
            }
        }
        let (layout, notes) = named(source, stem)?;
        let bytes = samples::data_size(source, "name", &numbers(&layout), request)?.1;
        if bytes != source.len() && !source.is_gzip() {
            let [x, y, z] = layout.dims;
            let kind = layout.kind.name();
            let rule = format!(
                "{x} x {y} x {z} samples of type {kind} need {bytes} bytes: the file has {}",
                source.len()
            );
            return Err(source.error("name", rule));
        }
        found(source, &layout, request, notes)
    }
}

/// Reads raw samples as [`read_raw`] does, and returns them with a report.
pub(crate) fn load(
    source: &Source,
    layout: &RawLayout,
    options: &ReadOptions,
    notes: Vec<String>,
) -> Result<Loaded> {
    let chosen = Chosen::new(source, "dims", numbers(layout), 1, &Request::scene(options))?;
    let mut loaded = chosen.loaded("raw samples", read(source, layout, options)?);
    loaded.report.notes.extend(notes);
    Ok(loaded)
}

/// Reads raw samples as they are requested.
fn found(source: &Source, layout: &RawLayout, request: &Request, notes: Vec<String>) -> Result<Found> {
    if request.wanted == Wanted::Scene {
        return Ok(load(source, layout, request, notes)?.into());
    }
    let mut chosen = Chosen::new(source, "dims", numbers(layout), 1, request)?;
    let values = values(source, layout, &chosen.layout, request)?;
    let located = |error: Error| error.in_file(source.path());
    let grid = chosen.grid(values).map_err(located)?;
    let RawLayout { dims, spacing, origin, direction, .. } = *layout;
    let lattice = Lattice::new(dims, spacing, origin, direction, &grid).map_err(located)?;
    let mut found = chosen.found("raw samples", grid, lattice);
    found.report.notes.extend(notes);
    Ok(found)
}

fn numbers(layout: &RawLayout) -> Layout {
    Layout::scalar(layout.dims, layout.kind, layout.endian)
}

/// Strips the extension from the name of raw samples.
pub(crate) fn stem(name: &str) -> Option<&str> {
    [".raw", ".raw.gz"].into_iter().find_map(|ending| {
        let (stem, own) = name.split_at_checked(name.len().checked_sub(ending.len())?)?;
        own.eq_ignore_ascii_case(ending).then_some(stem)
    })
}
