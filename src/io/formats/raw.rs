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

use crate::error::Result;
use crate::io::build::volume::Chosen;
use crate::io::file::decode::Layout;
use crate::io::file::samples::{self, Part};
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::raw::file_name::named;
use crate::io::formats::raw::layout::{RawLayout, Sidecar};
use crate::io::options::ReadOptions;
use crate::io::reader::Reader;
use crate::io::report::Loaded;
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
    let part = |_, bytes| Ok(Part::sized(source.clone(), layout.offset, bytes));
    let samples = samples::read(source, "dims", &numbers(layout), 1, &part, options)?;
    Grid::new(layout.dims, samples)
        .and_then(|grid| grid.with_placement(layout.spacing, layout.origin, layout.direction))
        .map_err(|error| error.in_file(source.path()))
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

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
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
            return load(&source.sibling(&data, options)?, &layout?, options, Vec::new());
        };
        let beside = PathBuf::from(format!("{stem}.json"));
        if source.has_sibling(&beside) {
            let json = source.sibling(&beside, options)?;
            if let Some(sidecar) = Sidecar::parse(&json)? {
                if let Some(other) =
                    sidecar.file.as_ref().filter(|file| file.strip_prefix("./").unwrap_or(file) != name)
                {
                    let rule = format!("\"{}\": lies beside {name} and must name it", text::shown(other));
                    return Err(json.error("file", rule));
                }
                let notes = vec![format!("layout from {}", beside.display())];
                let layout = sidecar.layout(|key, rule| json.error(key, rule))?;
                return load(source, &layout, options, notes);
            }
        }
        let (layout, notes) = named(source, stem)?;
        let bytes = samples::data_size(source, "name", &numbers(&layout), options)?.1;
        if bytes != source.len() && !source.is_gzip() {
            let [x, y, z] = layout.dims;
            let kind = layout.kind.name();
            let rule = format!(
                "{x} x {y} x {z} samples of type {kind} need {bytes} bytes: the file has {}",
                source.len()
            );
            return Err(source.error("name", rule));
        }
        load(source, &layout, options, notes)
    }
}

/// Reads raw samples as [`read_raw`] does, and returns them with a report.
pub(crate) fn load(
    source: &Source,
    layout: &RawLayout,
    options: &ReadOptions,
    notes: Vec<String>,
) -> Result<Loaded> {
    let chosen = Chosen::new(source, "dims", numbers(layout), 1, options)?;
    let mut loaded = chosen.loaded("raw samples", read(source, layout, options)?);
    loaded.report.notes.extend(notes);
    Ok(loaded)
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
