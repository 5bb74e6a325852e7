//! Folders: a stack of slices, one per file, or exactly one data file.

use std::cmp::Ordering;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::file::source::Source;
use crate::io::formats::dicom::{self, recognise};
use crate::io::formats::tiff::{self, file};
use crate::io::options::ReadOptions;
use crate::io::reader::Reader as _;
use crate::io::registry::{by_content, by_name};
use crate::io::report::Loaded;

/// The limit on files examined in a folder.
const MAX_FILES: usize = 1 << 17;

/// Reads the contents of a folder: slices in TIFF files, a DICOM series, or exactly one data file.
pub(crate) fn read(folder: &Path, options: &ReadOptions) -> Result<Loaded> {
    let mut files = Files::list(folder)?;
    files.sort(options)?;
    let Files { slices, images, others, left_out, folders, .. } = &files;
    let mut loaded = match (slices.as_slice(), images.as_slice(), others.as_slice()) {
        ([path], [], []) | ([], [], [(path, _)]) => {
            crate::io::registry::read_source(&Source::open(path, options)?, options)
        }
        (slices, [], []) if !slices.is_empty() => {
            let mut loaded = tiff::read_series(folder, slices, options)?;
            loaded.report.warnings.extend(numbering(slices));
            Ok(loaded)
        }
        ([], images, []) if !images.is_empty() => dicom::read_files(folder, images, options),
        _ => Err(Error::file(folder, "files", files.refusal())),
    }?;
    loaded.report.notes.extend(left_out_note(left_out));
    match folders {
        0 => {}
        1 => loaded.report.notes.push("1 folder is not looked into".to_owned()),
        _ => loaded.report.notes.push(format!("{folders} folders are not looked into")),
    }
    Ok(loaded)
}

/// The files of a folder, sorted by kind.
#[derive(Debug, Default)]
struct Files {
    all: Vec<PathBuf>,
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
    fn list(folder: &Path) -> Result<Self> {
        let mut files = Self::default();
        let failed = |error| Error::io(folder, "cannot list", error);
        for entry in fs::read_dir(folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if path.is_dir() {
                files.folders += 1;
            } else if path.is_file() {
                files.all.push(path);
            }
            if files.all.len() > MAX_FILES {
                return Err(Error::file(folder, "files", format!("more than {MAX_FILES}")));
            }
        }
        files.all.sort_by(|a, b| natural(&name(a), &name(b)));
        Ok(files)
    }

    /// Sorts the files by content and name, opening one at a time.
    fn sort(&mut self, options: &ReadOptions) -> Result<()> {
        let named = |path: &Path, endings: &[&str]| {
            path.extension().is_some_and(|own| endings.iter().any(|ending| own.eq_ignore_ascii_case(ending)))
        };
        let mut named_only = Vec::new();
        for path in std::mem::take(&mut self.all) {
            let name = name(&path);
            if is_aside(&name) {
                self.left_out.push(name);
                continue;
            }
            let source = Source::open(&path, options)?;
            // A file named as a slice must not be skipped silently if its content is not one.
            if file::is_tiff(&source) || named(&path, tiff::Tiff.extensions()) {
                self.slices.push(path);
            } else if recognise::is_dicom(&source) || named(&path, dicom::Dicom.extensions()) {
                self.images.push(path);
            } else if let Some(reader) = by_content(&source) {
                self.others.push((path, reader.name()));
            } else if let Some(reader) = by_name(&source) {
                named_only.push((path, reader.name()));
            } else {
                self.left_out.push(name);
            }
        }
        // If content identifies one file, files identified by name alone are taken as its parts, such as its samples.
        if self.slices.is_empty() && self.images.is_empty() && self.others.is_empty() {
            self.others = named_only;
        } else {
            self.left_out.extend(named_only.iter().map(|(path, _)| name(path)));
        }
        Ok(())
    }

    /// Says what the folder holds and what is supported.
    fn refusal(&self) -> String {
        let mut held = Vec::new();
        let mut count = |count: usize, what: &str| match count {
            0 => {}
            1 => held.push(format!("1 {what} file")),
            _ => held.push(format!("{count} {what} files")),
        };
        count(self.slices.len(), "TIFF");
        count(self.images.len(), "DICOM");
        let mut names: Vec<&str> = self.others.iter().map(|(_, name)| *name).collect();
        names.sort_unstable();
        for group in names.chunk_by(|a, b| a == b) {
            count(group.len(), group[0]);
        }
        count(self.left_out.len(), "other");
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
    let mut list: Vec<&str> = names.iter().take(MOST).map(String::as_str).collect();
    let more = format!("and {} more", names.len().saturating_sub(MOST));
    if names.len() > MOST {
        list.push(&more);
    }
    Some(format!("left out: {}", list.join(", ")))
}

/// Splits a name into alternating pieces of text and digits.
fn pieces(name: &str) -> Vec<&str> {
    let digit = |byte: u8| byte.is_ascii_digit();
    name.as_bytes()
        .chunk_by(|&a, &b| digit(a) == digit(b))
        // Digits are ASCII, so pieces begin and end at character boundaries.
        .scan(0, |at, piece| {
            let begin = *at;
            *at += piece.len();
            name.get(begin..*at)
        })
        .collect()
}

fn is_number(piece: &str) -> bool {
    piece.starts_with(|c: char| c.is_ascii_digit())
}

/// Compares names so that numbers in them sort by value: 2 before 10.
fn natural(a: &str, b: &str) -> Ordering {
    let (left, right) = (pieces(a), pieces(b));
    for (left, right) in left.iter().zip(&right) {
        let order = if is_number(left) && is_number(right) {
            let (left, right) = (left.trim_start_matches('0'), right.trim_start_matches('0'));
            left.len().cmp(&right.len()).then_with(|| left.cmp(right))
        } else {
            left.cmp(right)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

/// Returns a warning if the names of consecutive slices suggest gaps or several series.
fn numbering(paths: &[PathBuf]) -> Option<String> {
    let names: Vec<String> = paths.iter().map(|path| name(path)).collect();
    let first = pieces(names.first()?);
    let mut varies: Option<usize> = None;
    let mut numbers: Vec<u64> = Vec::new();
    for own in &names {
        let own_pieces = pieces(own);
        let form = |pieces: &[&str]| -> Vec<String> {
            pieces
                .iter()
                .map(|piece| if is_number(piece) { "#".to_owned() } else { (*piece).to_owned() })
                .collect()
        };
        if form(&own_pieces) != form(&first) {
            return Some(format!(
                "names have several forms, {} and {own}: all are taken as slices of one volume",
                names[0]
            ));
        }
        let other = (0..first.len()).filter(|&i| is_number(first[i]) && own_pieces[i] != first[i]);
        for i in other {
            if *varies.get_or_insert(i) != i {
                return Some(format!(
                    "names differ in several numbers, {} and {own}: all are taken as slices of one volume",
                    names[0]
                ));
            }
        }
    }
    let at = varies?;
    for own in &names {
        numbers.push(pieces(own)[at].parse().ok()?);
    }
    let steps: Vec<u64> = numbers.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    let least = steps.iter().min()?;
    let odd = steps.iter().position(|step| step != least)?;
    Some(format!(
        "after {} comes {}: slices may be missing, all are taken as equally far apart",
        names[odd],
        names[odd + 1]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count() {
        let mut names =
            ["b1", "a10", "a2", "a02", "a2b", "a", "10", "9", "a2a10", "\u{e9}2", "a99999999999999999999"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["9", "10", "a", "a02", "a2", "a2a10", "a2b", "a10", "a99999999999999999999", "b1", "\u{e9}2"]
        );
        assert_eq!(pieces("z\u{e9}12x003"), ["z\u{e9}", "12", "x", "003"]);
    }

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
