//! Time series: files that each hold one step of time.
//!
//! A series is a collection of ParaView (`.pvd`, XML), a list of files (`.series`, JSON), or a file name with `*`.

use std::path::{Path, PathBuf};

use quick_xml::Reader;
use quick_xml::events::Event;
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::build::file_names::in_order;
use crate::io::file::json::parse;
use crate::io::file::source::{Encoding, Source, list};
use crate::io::formats::vtk_xml::attributes::{Attributes, no_xml};
use crate::io::options::ReadOptions;
use crate::io::report::Step;
use crate::num;

/// The limit on the size of a list of files, in bytes.
const MAX_LIST: u64 = 64 << 20;

/// Returns the steps of a series in the order of their times, else of the list, else of the numbers in the names;
/// `None` if the path is that of another file.
///
/// # Errors
///
/// [`Error::Io`] if the list or the folder cannot be read; [`Error::File`] if the list breaks a rule of its format, or
/// there is no step.
pub(crate) fn steps(path: &Path, options: &ReadOptions) -> Result<Option<Vec<Step>>> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let ending = path.extension().unwrap_or_default();
    let mut steps = if ending.eq_ignore_ascii_case("pvd") {
        collection(&open(path, options)?)?
    } else if ending.eq_ignore_ascii_case("series") {
        listed(&open(path, options)?)?
    } else if name.contains('*') && path.symlink_metadata().is_err() {
        fitting(path, &name)?
    } else {
        return Ok(None);
    };
    if steps.is_empty() {
        return Err(Error::file(path, "steps", "there is none"));
    }
    if steps.iter().all(|step| step.time.is_some()) {
        steps.sort_by(|a, b| a.time.partial_cmp(&b.time).unwrap_or(std::cmp::Ordering::Equal));
    } else if let Some(step) = steps.iter().find(|step| step.time.is_some()) {
        let rule = "has a time, and others have none";
        return Err(Error::file(path, step.file.display().to_string(), rule));
    }
    let same = steps.windows(2).find(|pair| pair[0].time.is_some() && pair[0].time == pair[1].time);
    if let Some([first, second]) = same {
        let rule = format!(
            "{} and {} have the same time: parts of a step are not read, write them as one .vtu or .vti",
            first.file.display(),
            second.file.display()
        );
        return Err(Error::file(path, "steps", rule));
    }
    Ok(Some(steps))
}

fn open(path: &Path, options: &ReadOptions) -> Result<Source> {
    let source = Source::open(path, options)?;
    let most = MAX_LIST.min(options.max_bytes);
    if source.len() > most {
        return Err(source.error("file", format!("must have at most {most} bytes")));
    }
    Ok(source)
}

/// Returns the path of a file that a list names, relative to the list.
fn beside(source: &Source, name: &str) -> PathBuf {
    source.path().parent().unwrap_or(Path::new("")).join(name)
}

/// Reads the `DataSet`s of a collection of ParaView.
fn collection(source: &Source) -> Result<Vec<Step>> {
    let mut reader = Reader::from_reader(source.reader(0, Encoding::Raw));
    let (mut steps, mut markup, mut line, mut is_collection) = (Vec::new(), Vec::new(), 1_u64, false);
    loop {
        line += num::wide(markup.iter().filter(|byte| **byte == b'\n').count());
        markup.clear();
        let event = reader.read_event_into(&mut markup).map_err(|error| no_xml(source, line, error))?;
        match &event {
            Event::Eof if is_collection => return Ok(steps),
            Event::Eof => return Err(source.error("content", "no VTKFile of type Collection")),
            Event::Start(tag) | Event::Empty(tag) => match tag.name().as_ref() {
                "VTKFile" => {
                    let own = Attributes::of(source, tag, line)?;
                    is_collection = own.required("type")? == "Collection";
                }
                "DataSet" if is_collection => {
                    let own = Attributes::of(source, tag, line)?;
                    let time = own.get("timestep").map(|_| own.numbers("timestep", [0.0])).transpose()?;
                    let file = beside(source, own.required("file")?);
                    steps.push(Step { file, time: time.map(|[time]| time) });
                }
                _ => {}
            },
            _ => {}
        }
    }
}

/// Reads a list of files, as ParaView writes it beside series of legacy VTK files for example.
fn listed(source: &Source) -> Result<Vec<Step>> {
    #[derive(Deserialize)]
    struct List {
        files: Vec<Entry>,
    }
    #[derive(Deserialize)]
    struct Entry {
        name: String,
        time: Option<f64>,
    }
    let list: List = parse(source.path(), &source.bytes(0, source.len())?)?;
    let step = |Entry { name, time }| Step { file: beside(source, &name), time };
    Ok(list.files.into_iter().map(step).collect())
}

/// Lists the files whose names fit a pattern, in which `*` stands for any text.
fn fitting(path: &Path, pattern: &str) -> Result<Vec<Step>> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let (files, _) = list(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })?;
    let names = files.iter().filter_map(|file| file.file_name());
    let files = names.filter(|name| fits(pattern, &name.to_string_lossy())).map(|name| folder.join(name));
    let files = in_order(files.collect());
    if files.is_empty() {
        return Err(Error::file(path, "file name", "no file fits the pattern"));
    }
    Ok(files.into_iter().map(|file| Step { file, time: None }).collect())
}

/// Whether a name fits a pattern.
fn fits(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let first = parts.next().unwrap_or_default();
    let Some(last) = parts.next_back() else { return pattern == name };
    let inner = name.strip_prefix(first).and_then(|rest| rest.strip_suffix(last));
    // Each part is taken where it stands first.
    let end = inner
        .and_then(|inner| parts.try_fold(inner, |rest, part| rest.split_once(part).map(|(_, rest)| rest)));
    end.is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fit_patterns() {
        for (pattern, name, want) in [
            ("a_*.nrrd", "a_10.nrrd", true),
            ("a_*.nrrd", "a_.nrrd", true),
            ("a_*.nrrd", "b_10.nrrd", false),
            ("a_*.nrrd", "a_10.nrrd.gz", false),
            ("*", "anything", true),
            ("aa*aa", "aaa", false),
            ("*b*d*", "abcd", true),
            ("*d*b*", "abcd", false),
            ("a*b*c", "abbc", true),
            ("a**c", "ac", true),
        ] {
            assert_eq!(fits(pattern, name), want, "{pattern} {name}");
        }
    }
}
