//! Files that appear complete or not at all: written beside their place, then renamed. Pipes and devices are written into. The next writer of a file removes the parts that
//! killed processes have left there: a lock tells whether a part is being written.

use std::ffi::{OsStr, OsString};
use std::fs::{File, FileType, OpenOptions, Permissions};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::{Error, Result};

/// Where a file goes.
enum Place {
    /// Beside this path and then onto it: a regular file, or none yet. Symbolic links are followed, so that they stay.
    Onto(PathBuf, Option<Permissions>),
    /// Into what is there: a terminal, the null device, a pipe.
    Into,
}

/// Returns where a file of this path goes.
fn place_of(path: &Path) -> Result<Place> {
    const MOST_LINKS: usize = 40;
    if path.file_name().is_none() {
        return Err(Error::file(path, "file name", "must not be empty or a folder's"));
    }
    let unwritable = |e| Error::io(path, "cannot write", e);
    let metadata = std::fs::metadata(path);
    let mut target = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        if metadata.is_ok() && names_open_file(&target) {
            return Ok(Place::Into);
        }
        let Ok(next) = std::fs::read_link(&target) else { break };
        target = target.with_file_name("").join(next);
    }
    let metadata = match metadata {
        // Perhaps links to a file that is not there yet.
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Place::Onto(target, None)),
        metadata => metadata.map_err(unwritable)?,
    };
    if metadata.is_file() {
        if metadata.permissions().readonly() {
            return Err(Error::file(path, "permissions", "must allow writing"));
        }
        return Ok(Place::Onto(target, Some(metadata.permissions())));
    }
    if is_stream(metadata.file_type()) {
        return Ok(Place::Into);
    }
    let rule = "must name a regular file, a pipe, a character device, or nothing yet";
    Err(Error::file(path, "file type", rule))
}

/// Whether a path is one of the system's own names of files that are open, which others write too.
fn names_open_file(path: &Path) -> bool {
    ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc"].iter().any(|open| path.starts_with(open))
}

#[cfg(unix)]
fn is_stream(kind: FileType) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    kind.is_char_device() || kind.is_fifo()
}

#[cfg(not(unix))]
fn is_stream(_: FileType) -> bool {
    false
}

/// Checks that [`replace`] can write a file of this path, by creating and removing an empty one beside it.
pub(crate) fn check_writable(path: &Path) -> Result<()> {
    if let Place::Onto(target, _) = place_of(path)? {
        let (part, _) = create_beside(&target).map_err(|e| Error::io(path, "cannot write", e))?;
        drop(Part { path: &part });
    }
    Ok(())
}

/// Creates an empty file beside `target`, of a name that nobody else has.
fn create_beside(target: &Path) -> std::io::Result<(PathBuf, File)> {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let mut beside = start_of(target);
    beside.push(format!("{}-{}.part", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)));
    let part = target.with_file_name(beside);
    let file = OpenOptions::new().write(true).create_new(true).open(&part)?;
    Ok((part, file))
}

/// Returns the begin of the names of parts of a file.
fn start_of(target: &Path) -> OsString {
    [OsStr::new("."), target.file_name().unwrap_or_default(), OsStr::new(".")].into_iter().collect()
}

/// Writes a file beside `path` and renames it onto `path` when it is complete. The new file has the permissions of the old one. A symbolic
/// link stays, and its target is replaced; what is a pipe or a device is written into.
pub(crate) fn replace(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<()> {
    let unwritable = |e| Error::io(path, "cannot write", e);
    let (target, permissions) = match place_of(path)? {
        Place::Onto(target, permissions) => (target, permissions),
        Place::Into => {
            let file = OpenOptions::new().append(true).open(path).map_err(unwritable)?;
            let mut writer = BufWriter::new(file);
            return write(&mut writer).and_then(|()| writer.flush()).map_err(unwritable);
        }
    };
    remove_left(&target);
    let (part, file) = create_beside(&target).map_err(unwritable)?;
    let guard = Part { path: &part };
    // Some file systems have no locks: parts then stay.
    let _ = file.try_lock();
    if let Some(permissions) = permissions {
        // Some file systems have none.
        let _ = file.set_permissions(permissions);
    }
    let mut writer = BufWriter::new(file);
    write(&mut writer)
        .and_then(|()| writer.flush())
        .and_then(|()| std::fs::rename(&part, &target))
        .map_err(unwritable)?;
    std::mem::forget(guard);
    Ok(())
}

/// Removes parts of a file that nobody writes any longer. What cannot be removed stays.
fn remove_left(target: &Path) {
    let start = start_of(target);
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.as_encoded_bytes();
        if !name.starts_with(start.as_encoded_bytes()) || !name.ends_with(b".part") {
            continue;
        }
        let is_left = |file: File| file.try_lock().is_ok();
        if OpenOptions::new().write(true).open(entry.path()).is_ok_and(is_left) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// A file that is removed unless it was renamed.
struct Part<'a> {
    path: &'a PathBuf,
}

impl Drop for Part<'_> {
    fn drop(&mut self) {
        // What failed before is the error to report.
        let _ = std::fs::remove_file(self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_writer_removes_what_a_killed_one_has_left() {
        let folder = std::env::temp_dir().join(format!("volraster-left-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("picture.png");
        let [left, other] = [".picture.png.99-0.part", ".picture.png.old.png"].map(|name| folder.join(name));
        std::fs::write(&left, "half").unwrap();
        std::fs::write(&other, "another file").unwrap();
        // The part that is being written stays.
        replace(&path, |writer| {
            assert!(!left.exists() && other.exists());
            replace(&path, |writer| writer.write_all(b"first"))
                .and_then(|()| writer.write_all(b"second").map_err(|e| Error::io(&path, "cannot write", e)))
                .map_err(std::io::Error::other)
        })
        .unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 2);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = std::env::temp_dir().join(format!("volraster-replace-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("picture.png");
        std::fs::write(&path, "old").unwrap();
        let failed = replace(&path, |writer| {
            writer.write_all(b"half")?;
            writer.flush()?;
            Err(std::io::Error::other("disk is full"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk is full"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        replace(&path, |writer| writer.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    /// A folder of its own for a test.
    #[cfg(unix)]
    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("volraster-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_and_their_targets_are_written() {
        use std::os::unix::fs::{PermissionsExt as _, symlink};
        let folder = folder("links");
        let [real, link, dangling] = ["real.png", "link.png", "dangling.png"].map(|name| folder.join(name));
        std::fs::write(&real, "old").unwrap();
        std::fs::set_permissions(&real, Permissions::from_mode(0o640)).unwrap();
        symlink("real.png", &link).unwrap();
        symlink("later.png", &dangling).unwrap();
        for path in [&link, &dangling] {
            check_writable(path).unwrap();
            replace(path, |writer| writer.write_all(b"new")).unwrap();
            assert!(path.symlink_metadata().unwrap().is_symlink(), "{path:?}");
            assert_eq!(std::fs::read(path).unwrap(), b"new");
        }
        assert_eq!(std::fs::read(&real).unwrap(), b"new");
        assert_eq!(real.metadata().unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 4);
        // Links in a circle, and what must not be replaced.
        symlink("circle", folder.join("circle")).unwrap();
        std::fs::set_permissions(&real, Permissions::from_mode(0o440)).unwrap();
        let socket = folder.join("socket");
        let _listening = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        for (path, part) in [
            (folder.join("circle"), "cannot write"),
            (real, "must allow writing"),
            (link, "must allow writing"),
            (socket, "must name a regular file"),
            (folder.clone(), "must name a regular file"),
        ] {
            let errors = [check_writable(&path), replace(&path, |writer| writer.write_all(b"newer"))];
            for error in errors.map(|done| done.unwrap_err().to_string()) {
                assert!(error.contains(part) && error.contains(&path.display().to_string()), "{error}");
            }
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn pipes_and_devices_are_written_into() {
        use std::os::unix::fs::FileTypeExt as _;
        let folder = folder("pipes");
        let [pipe, null] = ["pipe", "null.png"].map(|name| folder.join(name));
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        std::os::unix::fs::symlink("/dev/null", &null).unwrap();
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::read(pipe).unwrap()
        });
        for path in [&pipe, &null] {
            check_writable(path).unwrap();
            replace(path, |writer| writer.write_all(b"through")).unwrap();
        }
        assert_eq!(reader.join().unwrap(), b"through");
        assert!(pipe.symlink_metadata().unwrap().file_type().is_fifo());
        assert!(null.metadata().unwrap().file_type().is_char_device());
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 2);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
