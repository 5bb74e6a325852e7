//! Output: lines on stdout and stderr, JSON files, checks of output paths, and progress bars.
//!
//! Paths are checked before any work, so that a long run does not fail at its end. Regular files
//! are written under a temporary name and renamed when complete.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressFinish, ProgressStyle};
use serde_json::Value;
use sha2::{Digest, Sha256};
use volraster::io::{Progress, ReadOptions, check_writable};
use volraster::scene::View;
use volraster::{Error, Result};

/// Prints a line on stdout. A closed pipe (`| head`) is no error: the work goes on.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(unwritable(Path::new("stdout"))(error))
        }
        _ => Ok(()),
    }
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
    styled(ProgressBar::new(total), "{msg} {wide_bar} {pos}/{len} {eta}", what)
}

/// Draws a reference image with a progress bar; the work calls its argument after each row.
pub(crate) fn counting_rows<T>(view: &View, work: impl FnOnce(&(dyn Fn(u32, u32) + Sync)) -> T) -> T {
    let bar = progress(u64::from(view.extent()[1]), "reference");
    let result = work(&|_, _| bar.inc(1));
    bar.finish_and_clear();
    result
}

/// Adds a progress bar to the options for reading a file. It appears on a terminal if reading takes a while, and
/// disappears with the options.
pub(crate) fn with_progress(path: &Path, options: ReadOptions) -> ReadOptions {
    const PATIENCE: Duration = Duration::from_millis(300);
    if !std::io::stderr().is_terminal() {
        return options;
    }
    let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::hidden());
    let name = plain(&path.file_name().unwrap_or_default().to_string_lossy());
    let bar = styled(bar, "{msg} {wide_bar} {bytes}/{total_bytes} {eta}", &name);
    let bar = bar.with_finish(ProgressFinish::AndClear);
    let (begin, shown) = (Instant::now(), std::sync::Once::new());
    let progress = Progress::new(move |done, all| {
        if begin.elapsed() >= PATIENCE {
            bar.set_length(all);
            bar.set_position(done);
            shown.call_once(|| bar.set_draw_target(ProgressDrawTarget::stderr()));
        }
    });
    ReadOptions { progress: Some(progress), ..options }
}

fn styled(bar: ProgressBar, template: &str, what: &str) -> ProgressBar {
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.with_message(what.to_string())
}

/// Prints the warnings about a file.
pub(crate) fn warn(path: &Path, warnings: &[String]) {
    for warning in warnings {
        complain(&format!("warning: {}: {warning}", path.display()));
    }
}

/// Refuses an output path that is also another file of the run. A path to a missing file is compared as text.
pub(crate) fn check_apart(what: &str, path: &Path, others: &[(&PathBuf, &str)]) -> Result<()> {
    let is_same = |other: &Path| match (path.canonicalize(), other.canonicalize()) {
        (Ok(path), Ok(other)) => path == other,
        _ => path == other,
    };
    let Some((_, role)) = others.iter().find(|(other, _)| is_same(other)) else { return Ok(()) };
    let why = format!("{}: is also {role}", path.display());
    Err(invalid(what, why))
}

/// Checks an output image path: its ending, and that it is writable.
pub(crate) fn check_image(path: &Path) -> Result<()> {
    check_ending(path)?;
    check_writable(path)
}

/// Checks that the name of an image is that of a format that is written.
pub(crate) fn check_ending(path: &Path) -> Result<()> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    if !matches!(ending.as_deref(), Some("exr" | "png")) {
        return Err(refuse(path, "file name", "must end in .exr or .png"));
    }
    Ok(())
}

/// Checks that a folder is writable or can be created, by creating and removing a temporary file.
pub(crate) fn check_folder(path: &Path) -> Result<()> {
    let exists = |folder: &&Path| folder.symlink_metadata().is_ok();
    let nearest = path.ancestors().filter(|folder| !folder.as_os_str().is_empty()).find(exists);
    let nearest = nearest.unwrap_or(Path::new("."));
    if !nearest.is_dir() {
        return Err(refuse(path, "folder", &format!("{} is not a folder", nearest.display())));
    }
    check_writable(nearest.join(".volraster-check")).map_err(|error| match error {
        Error::Io { action, source, .. } => Error::Io { path: path.to_path_buf(), action, source },
        other => other,
    })
}

/// Creates a folder and its parents.
pub(crate) fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(unwritable(path))
}

/// Writes a JSON file, completely or not at all.
pub(crate) fn write_json(path: &Path, value: &Value) -> Result<()> {
    volraster::io::write_text(path, &format!("{value:#}\n"))
}

/// Returns the first 16 hexadecimal digits of the SHA-256 of bytes.
pub(crate) fn digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

/// Removes the null members of a JSON object: quantities that were not measured.
pub(crate) fn without_nulls(mut object: Value) -> Value {
    if let Value::Object(members) = &mut object {
        members.retain(|_, value| !value.is_null());
    }
    object
}

/// Makes the error of a wrong argument.
pub(crate) fn invalid(what: &str, why: String) -> Error {
    Error::Invalid { what: what.to_string(), why }
}

/// Makes the error of a file that cannot be read.
pub(crate) fn unreadable(path: &Path) -> impl Fn(std::io::Error) -> Error {
    move |source| Error::Io { path: path.to_path_buf(), action: "cannot read", source }
}

/// Makes the error of a file that cannot be written.
pub(crate) fn unwritable(path: &Path) -> impl Fn(std::io::Error) -> Error {
    move |source| Error::Io { path: path.to_path_buf(), action: "cannot write", source }
}

/// Makes the error of a file that breaks a rule.
pub(crate) fn refuse(path: &Path, place: &str, rule: &str) -> Error {
    Error::File { path: path.to_path_buf(), place: place.to_string(), rule: rule.to_string() }
}
