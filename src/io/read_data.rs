//! Reading of data files and of files in memory, in any known format, and of folders: a stack of slices, one per file,
//! or exactly one data file.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::build::arrays;
use crate::io::build::data_file::DataFile;
use crate::io::build::file_names::{in_order, is_number, pieces};
use crate::io::file::source::{Source, list};
use crate::io::formats::dicom::{self, recognise};
use crate::io::formats::gaussian::sog;
#[cfg(not(feature = "zarr"))]
use crate::io::formats::refused;
use crate::io::formats::series;
use crate::io::formats::tiff::{self, file};
#[cfg(feature = "zarr")]
use crate::io::formats::zarr;
use crate::io::options::{ReadOptions, Request, Wanted};
use crate::io::reader::Reader as _;
use crate::io::registry::{by_content, by_name, checked, read_source};
use crate::io::report::{Content, Found, Loaded, Step};
use crate::num;
use crate::scene::{Data, Grid};

/// Reads a data file in any known format. The content selects the format; the file name extension is used only if no
/// format recognises the content. A folder is read as a stack of slices, or as the one data file in it; of a series of
/// time steps (`.pvd`, `.series`, or a name with `*`) one step is read.
///
/// # Errors
///
/// [`Error::Io`] if a file cannot be read; [`Error::File`] if no format fits, the contents break a rule of the
/// format, or the data would take more than `options.max_bytes`.
pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Loaded> {
    let path = path.as_ref();
    scene(path, find(path, &Request::scene(options))?)
}

/// Reads a data file as [`read`] does, with the types of the file, and all its arrays. `options.array` names the only
/// array, or component, to read. `one` says that there must be a single one; the error lists them.
///
/// Values that a reader computes, from slices that are uneven or differ in rescale, are those of [`read`].
///
/// # Errors
///
/// As [`read`], and [`Error::File`] if one array is wanted and there are others.
pub fn read_arrays(path: impl AsRef<Path>, options: &ReadOptions, one: bool) -> Result<Loaded<DataFile>> {
    find(path.as_ref(), &request(options, one)).map(as_arrays)
}

/// Reads a data file in memory as [`read_arrays`] does, with the files that [`read_memory`] describes.
///
/// # Errors
///
/// As [`read_arrays`] and [`read_memory`].
pub fn read_arrays_memory(
    files: &[(&str, &[u8])],
    options: &ReadOptions,
    one: bool,
) -> Result<Loaded<DataFile>> {
    read_source(&Source::in_memory(files)?, &request(options, one)).map(as_arrays)
}

fn request(options: &ReadOptions, one: bool) -> Request<'_> {
    Request { options, wanted: if one { Wanted::OneArray } else { Wanted::Arrays } }
}

fn as_arrays(Loaded { data, mut report }: Found) -> Loaded<DataFile> {
    let data = match data {
        Content::Arrays(data) => data,
        Content::Scene(data) => {
            let data = DataFile::of(&data, report.shown_name());
            let arrays = arrays::list(data.arrays());
            report.warnings.push(format!("values are computed, as for rendering, and kept as {arrays}"));
            data
        }
    };
    Loaded { data, report }
}

/// Finds the reader of a file or a folder, and reads it.
fn find(path: &Path, request: &Request) -> Result<Found> {
    let Some(steps) = series::steps(path, request)? else {
        return match request.step {
            // An image may itself have steps.
            #[cfg(feature = "zarr")]
            Some(_) if zarr::metadata::file_in(path).is_some() => find_one(path, request),
            Some(step) => Err(Error::file(path, format!("step {step}"), "this is no series of time steps")),
            None => find_one(path, request),
        };
    };
    let (step, count) = (num::index(request.step.unwrap_or(0)), steps.len());
    let Some(Step { file, .. }) = steps.get(step) else {
        let rule = format!("there are {count}, from 0 to {}", count - 1);
        return Err(Error::file(path, format!("step {step}"), rule));
    };
    let mut found = find_one(file, request)?;
    found.report.notes.push(format!("step {step} of {count}: {}", file.display()));
    found.report.steps = steps;
    Ok(found)
}

/// Finds the reader of a file or a folder that is no series, and reads it.
fn find_one(path: &Path, request: &Request) -> Result<Found> {
    #[cfg(not(feature = "zarr"))]
    if let Some(refusal) = refused::folder(path) {
        return Err(refusal);
    }
    #[cfg(feature = "zarr")]
    if let Some(metadata) = zarr::metadata::file_in(path) {
        return read_source(&Source::open(&metadata, request)?, request);
    }
    if path.is_dir() {
        // Images of splats are no files of their own.
        if let Some(meta) = sog::in_folder(path, request)? {
            return read_source(&meta, request);
        }
        return checked(path, read_folder(path, request)?, request);
    }
    read_source(&Source::open(path, request)?, request)
}

/// Returns scene data that was requested.
fn scene(path: &Path, Loaded { data, report }: Found) -> Result<Loaded> {
    match data {
        Content::Scene(data) => Ok(Loaded { data, report }),
        Content::Arrays(_) => Err(Error::file(path, "content", "no data of a scene")),
    }
}

/// Reads a data file in memory: the first of `files`, given as name and content. Files that it names are looked up
/// among the others.
///
/// # Errors
///
/// As [`read`]; [`Error::Invalid`] if there is no file.
pub fn read_memory(files: &[(&str, &[u8])], options: &ReadOptions) -> Result<Loaded> {
    let source = Source::in_memory(files)?;
    scene(source.path(), read_source(&source, &Request::scene(options))?)
}

/// Reads a file that holds a grid, as [`read`] does.
///
/// # Errors
///
/// As [`read`], and [`Error::File`] if the file holds something else.
pub fn read_grid(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Grid> {
    let path = path.as_ref();
    match read(path, options)?.data {
        Data::Grid(grid) => Ok(grid),
        other => Err(Error::file(path, "content", format!("{}: must be a grid", other.kind()))),
    }
}

/// Reads the contents of a folder: slices in TIFF files, a DICOM series, or exactly one data file.
fn read_folder(folder: &Path, request: &Request) -> Result<Found> {
    let files = Files::sorted(folder, request)?;
    let Files { slices, images, others, left_out, folders } = &files;
    let mut loaded = match (slices.as_slice(), images.as_slice(), others.as_slice()) {
        ([path], [], []) | ([], [], [(path, _)]) => read_source(&Source::open(path, request)?, request),
        (slices, [], []) if !slices.is_empty() => {
            let mut loaded = tiff::read_series(folder, slices, request)?;
            loaded.report.warnings.extend(numbering(slices));
            Ok(loaded)
        }
        ([], images, []) if !images.is_empty() => dicom::read_files(folder, images, request),
        _ => Err(Error::file(folder, "files", files.refusal())),
    }?;
    loaded.report.notes.extend(left_out_note(left_out));
    loaded.report.notes.extend(match folders {
        0 => None,
        1 => Some("1 folder is not looked into".to_owned()),
        _ => Some(format!("{folders} folders are not looked into")),
    });
    Ok(loaded)
}

/// The files of a folder, sorted by kind.
#[derive(Debug, Default)]
struct Files {
    folders: usize,
    /// TIFF.
    slices: Vec<PathBuf>,
    /// DICOM.
    images: Vec<PathBuf>,
    /// Files of other formats, with the names of the formats.
    others: Vec<(PathBuf, &'static str)>,
    /// Names of files of no known format.
    left_out: Vec<String>,
}

impl Files {
    /// Sorts the files of a folder by content and name, opening one at a time.
    fn sorted(folder: &Path, options: &ReadOptions) -> Result<Self> {
        let named = |path: &Path, endings: &[&str]| {
            path.extension().is_some_and(|own| endings.iter().any(|ending| own.eq_ignore_ascii_case(ending)))
        };
        let (all, folders) = list(folder)?;
        let mut files = Self { folders, ..Self::default() };
        let mut named_only = Vec::new();
        for path in in_order(all) {
            let name = name(&path);
            if is_aside(&name) {
                files.left_out.push(name);
                continue;
            }
            let source = Source::open(&path, options)?;
            // A file named as a slice must not be skipped silently if its content is not one.
            // The preamble of DICOM may be the header of a TIFF file.
            let is_dicom = recognise::is_dicom(&source);
            if !is_dicom && (file::is_tiff(&source) || named(&path, tiff::Tiff.extensions())) {
                files.slices.push(path);
            } else if is_dicom || named(&path, dicom::Dicom.extensions()) {
                files.images.push(path);
            } else if let Some(reader) = by_content(&source) {
                files.others.push((path, reader.name()));
            } else if let Some(reader) = by_name(&source) {
                named_only.push((path, reader.name()));
            } else {
                files.left_out.push(name);
            }
        }
        // If content identifies one file, files identified by name alone are taken as its parts, such as its samples.
        if files.slices.is_empty() && files.images.is_empty() && files.others.is_empty() {
            files.others = named_only;
        } else {
            files.left_out.extend(named_only.iter().map(|(path, _)| name(path)));
        }
        Ok(files)
    }

    /// Says what the folder holds and what is supported.
    fn refusal(&self) -> String {
        let mut names: Vec<&str> = self.others.iter().map(|(_, name)| *name).collect();
        names.sort_unstable();
        let mut counts = vec![(self.slices.len(), "TIFF"), (self.images.len(), "DICOM")];
        counts.extend(names.chunk_by(|a, b| a == b).map(|group| (group.len(), group[0])));
        counts.push((self.left_out.len(), "other"));
        counts.retain(|(count, _)| *count > 0);
        let files = |&(count, what): &(usize, &str)| match count {
            1 => format!("1 {what} file"),
            _ => format!("{count} {what} files"),
        };
        let mut held: Vec<String> = counts.iter().map(files).collect();
        if self.folders > 0 {
            held.push(format!("{} folders", self.folders));
        }
        let held = if held.is_empty() { "nothing".to_owned() } else { held.join(", ") };
        format!(
            "holds {held}: slices in TIFF files, one DICOM series, or exactly one data file are supported"
        )
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Whether the name is that of a file that operating systems or people put beside data.
fn is_aside(name: &str) -> bool {
    let lower = name.to_lowercase();
    lower.starts_with('.')
        || ["thumbs.db", "desktop.ini", "dicomdir"].contains(&lower.as_str())
        || ["readme", "license", "licence"].iter().any(|word| lower.starts_with(word))
}

fn left_out_note(names: &[String]) -> Option<String> {
    /// The limit on names in one note.
    const MOST: usize = 8;
    if names.is_empty() {
        return None;
    }
    let list = names[..names.len().min(MOST)].join(", ");
    let more = names.len().saturating_sub(MOST);
    Some(if more > 0 { format!("left out: {list}, and {more} more") } else { format!("left out: {list}") })
}

/// Returns a warning if the names of consecutive slices suggest gaps or several series.
fn numbering(paths: &[PathBuf]) -> Option<String> {
    let names: Vec<String> = paths.iter().map(|path| name(path)).collect();
    let all: Vec<Vec<&str>> = names.iter().map(|name| pieces(name)).collect();
    let first = all.first()?;
    let mut varies: Option<usize> = None;
    for (own, parts) in names.iter().zip(&all) {
        let alike = |(a, b): (&&str, &&str)| a == b || is_number(a) && is_number(b);
        let (what, several) = if parts.len() != first.len() || !parts.iter().zip(first).all(alike) {
            ("names have several forms", true)
        } else {
            let mut differ = (0..first.len()).filter(|&i| parts[i] != first[i]);
            ("names differ in several numbers", differ.any(|i| *varies.get_or_insert(i) != i))
        };
        if several {
            return Some(format!("{what}, {} and {own}: all are taken as slices of one volume", names[0]));
        }
    }
    let at = varies?;
    let numbers = all.iter().map(|parts| parts[at].parse().ok()).collect::<Option<Vec<u64>>>()?;
    let steps: Vec<u64> = numbers.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    let least = steps.iter().min()?;
    let odd = steps.iter().position(|step| step != least)?;
    let (last, next) = (&names[odd], &names[odd + 1]);
    Some(format!("after {last} comes {next}: slices may be missing, all are taken as equally far apart"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_mixtures_are_told() {
        let of = |names: &[&str]| numbering(&names.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(of(&["z1.tif", "z2.tif", "z3.tif"]), None);
        assert_eq!(of(&["z08.tif", "z10.tif", "z12.tif"]), None);
        assert!(of(&["z1.tif", "z2.tif", "z4.tif"]).unwrap().contains("after z2.tif comes z4.tif"));
        assert!(of(&["a1.tif", "b2.tif"]).unwrap().contains("several forms, a1.tif and b2.tif"));
        assert!(of(&["c1z1.tif", "c2z2.tif"]).unwrap().contains("several numbers"));
        assert_eq!(of(&["z1.tif"]), None);
    }
}
