//! What the program writes: lines on stdout and stderr, files, progress.
//!
//! Files are written beside their place and renamed when they are complete. Places are checked before
//! any work is done for them.

use std::fs::OpenOptions;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::Value;
use volraster::io::{Progress, ReadOptions};
use volraster::{Error, Result};

/// Prints on stdout. A reader that has gone away (`| head`) is no error: the work goes on.
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

/// Prints one line on stderr. Nobody can be told when that fails.
pub(crate) fn complain(line: &str) {
    let _ = writeln!(std::io::stderr(), "volraster: {}", plain(line));
}

/// Text of files on one line, without what a terminal would obey.
pub(crate) fn plain(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// A bar on a terminal, nothing elsewhere.
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

/// A bar that shows how far reading is, on a terminal, where it takes a while. It goes when this does.
#[derive(Debug)]
pub(crate) struct Reading {
    bar: ProgressBar,
}

impl Reading {
    /// Reading that takes less shows no bar.
    const PATIENCE: Duration = Duration::from_millis(300);

    /// Begins now.
    pub(crate) fn new(path: &Path) -> Self {
        let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {bytes}/{total_bytes} {eta}") {
            bar.set_style(style);
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        bar.set_message(plain(&name));
        Self { bar }
    }

    /// The same options, with the bar told.
    pub(crate) fn tell(&self, options: ReadOptions) -> ReadOptions {
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

/// Prints what may not be as it seems in a file.
pub(crate) fn warn(path: &Path, warnings: &[String]) {
    for warning in warnings {
        complain(&format!("warning: {}: {warning}", path.display()));
    }
}

/// Whether two paths name one file, as far as can be told before it is there.
pub(crate) fn same_place(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => a == b,
    }
}

/// Checks an image's place: the ending, and that it can be written.
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

/// Checks that a file can be written, and leaves nothing there.
///
/// # Errors
///
/// [`Error::File`] when the place is a folder, [`Error::Io`] when its folder takes no file.
pub(crate) fn check_file(path: &Path) -> Result<()> {
    if path.file_name().is_none() || path.is_dir() {
        return Err(refuse(path, "file name", "must not be empty or a folder's"));
    }
    probe(&beside(path, "check"), path)
}

/// Checks that a folder is there and takes files, or that it can be made, and leaves nothing there.
///
/// # Errors
///
/// [`Error::File`] when a file is in the way, [`Error::Io`] when the folder takes no file.
pub(crate) fn check_folder(path: &Path) -> Result<()> {
    let exists = |folder: &&Path| folder.symlink_metadata().is_ok();
    let nearest = path.ancestors().filter(|folder| !folder.as_os_str().is_empty()).find(exists);
    let nearest = nearest.unwrap_or(Path::new("."));
    if !nearest.is_dir() {
        return Err(refuse(path, "folder", &format!("{} is no folder", nearest.display())));
    }
    probe(&beside(&nearest.join("volraster"), "check"), path)
}

/// Makes a folder and those above it.
///
/// # Errors
///
/// [`Error::Io`] when that fails.
pub(crate) fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|source| io(path, source))
}

/// Writes JSON, complete or not at all.
///
/// # Errors
///
/// As [`volraster::io::write_text`].
pub(crate) fn write_json(path: &Path, value: &Value) -> Result<()> {
    volraster::io::write_text(path, &format!("{value:#}\n"))
}

/// A hidden name in the same folder.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.{ending}", std::process::id()))
}

/// Makes a file and removes it; an error is about `path`.
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
