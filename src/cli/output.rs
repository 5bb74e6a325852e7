//! Output: lines on stdout and stderr, JSON files, checks of output paths, and progress bars.
//!
//! Paths are checked before any work, so that a long run does not fail at its end. Files are written under a
//! temporary name and renamed when complete.

use std::fs::OpenOptions;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::Value;
use volraster::io::{Progress, ReadOptions};
use volraster::{Error, Result};

/// Prints a line on stdout. A closed pipe (`| head`) is no error: the work goes on.
///
/// # Errors
///
/// [`Error::Io`] when stdout cannot be written for another reason.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(io(Path::new("stdout"), error)),
        _ => Ok(()),
    }
}

/// Prints JSON on stdout.
///
/// # Errors
///
/// As [`print`].
pub(crate) fn print_json(value: &Value) -> Result<()> {
    print(&format!("{value:#}"))
}

/// Prints one line on stderr. Ignores write errors: there is no other place to report them.
pub(crate) fn complain(line: &str) {
    let _ = writeln!(std::io::stderr(), "volraster: {}", plain(line));
}

/// Replaces control characters by spaces, so that text from files stays on one line and cannot control a terminal.
pub(crate) fn plain(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// Shows a progress bar if stderr is a terminal.
pub(crate) fn progress(total: u64, what: &str) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar.set_message(what.to_string());
    bar
}

/// A progress bar for reading a file. It appears on a terminal if reading takes a while, and disappears on drop.
#[derive(Debug)]
pub(crate) struct Reading {
    bar: ProgressBar,
}

impl Reading {
    /// Delay before the bar appears.
    const PATIENCE: Duration = Duration::from_millis(300);

    /// Creates the bar, not yet visible.
    pub(crate) fn new(path: &Path) -> Self {
        let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {bytes}/{total_bytes} {eta}") {
            bar.set_style(style);
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        bar.set_message(plain(&name));
        Self { bar }
    }

    /// Returns the options with a progress callback that updates the bar.
    pub(crate) fn with_progress(&self, options: ReadOptions) -> ReadOptions {
        if !std::io::stderr().is_terminal() {
            return options;
        }
        let (bar, begin) = (self.bar.clone(), Instant::now());
        let shown = std::sync::Once::new();
        let progress = Progress::new(move |done, all| {
            if begin.elapsed() >= Self::PATIENCE {
                bar.set_length(all);
                bar.set_position(done);
                shown.call_once(|| bar.set_draw_target(ProgressDrawTarget::stderr()));
            }
        });
        ReadOptions { progress: Some(progress), ..options }
    }
}

impl Drop for Reading {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Prints the warnings about a file.
pub(crate) fn warn(path: &Path, warnings: &[String]) {
    for warning in warnings {
        complain(&format!("warning: {}: {warning}", path.display()));
    }
}

/// Returns whether two paths name the same file. A path to a missing file is compared as text.
pub(crate) fn same_place(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => a == b,
    }
}

/// Checks an output image path: its ending, and that it is writable.
///
/// # Errors
///
/// [`Error::File`] for another ending than `.exr` and `.png`, otherwise as [`check_file`].
pub(crate) fn check_image(path: &Path) -> Result<()> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    if !matches!(ending.as_deref(), Some("exr" | "png")) {
        return Err(refuse(path, "file name", "must end in .exr or .png"));
    }
    check_file(path)
}

/// Checks that a file is writable, by creating and removing a temporary file beside it.
///
/// # Errors
///
/// [`Error::File`] when the path is a folder, [`Error::Io`] when the file cannot be created.
pub(crate) fn check_file(path: &Path) -> Result<()> {
    if path.file_name().is_none() || path.is_dir() {
        return Err(refuse(path, "file name", "must not be empty or a folder"));
    }
    probe(&beside(path, "check"), path)
}

/// Checks that a folder is writable or can be created, by creating and removing a temporary file.
///
/// # Errors
///
/// [`Error::File`] when a file is in the way, [`Error::Io`] when the folder is not writable.
pub(crate) fn check_folder(path: &Path) -> Result<()> {
    let exists = |folder: &&Path| folder.symlink_metadata().is_ok();
    let nearest = path.ancestors().filter(|folder| !folder.as_os_str().is_empty()).find(exists);
    let nearest = nearest.unwrap_or(Path::new("."));
    if !nearest.is_dir() {
        return Err(refuse(path, "folder", &format!("{} is not a folder", nearest.display())));
    }
    probe(&beside(&nearest.join("volraster"), "check"), path)
}

/// Creates a folder and its parents.
///
/// # Errors
///
/// [`Error::Io`] when that fails.
pub(crate) fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|source| io(path, source))
}

/// Writes a JSON file, completely or not at all.
///
/// # Errors
///
/// As [`volraster::io::write_text`].
pub(crate) fn write_json(path: &Path, value: &Value) -> Result<()> {
    volraster::io::write_text(path, &format!("{value:#}\n"))
}

/// Returns a hidden temporary name in the same folder.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.{ending}", std::process::id()))
}

/// Creates and removes a file; an error names `path`.
fn probe(file: &Path, path: &Path) -> Result<()> {
    OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(file)
        .and_then(|_| std::fs::remove_file(file))
        .map_err(|source| io(path, source))
}

fn io(path: &Path, source: std::io::Error) -> Error {
    Error::Io { path: path.to_path_buf(), action: "cannot write", source }
}

fn refuse(path: &Path, place: &str, rule: &str) -> Error {
    Error::File { path: path.to_path_buf(), place: place.to_string(), rule: rule.to_string() }
}
