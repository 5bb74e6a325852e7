//! Files that appear complete or not at all: written beside their place, then renamed. The next writer of a file removes the parts that
//! killed processes have left there: a lock tells whether a part is being written.

use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::{Error, Result};

/// Writes a file beside `path` and renames it onto `path` when it is complete.
pub(crate) fn replace(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<()> {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let Some(name) = path.file_name() else {
        return Err(Error::file(path, "file name", "must not be empty or a folder's"));
    };
    let start = [OsStr::new("."), name, OsStr::new(".")].into_iter().collect::<OsString>();
    remove_left(path, &start);
    let mut beside = start;
    beside.push(format!("{}-{}.part", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)));
    let part = path.with_file_name(beside);
    let file = OpenOptions::new().write(true).create_new(true).open(&part);
    let file = file.map_err(|e| Error::io(path, "cannot write", e))?;
    let guard = Part { path: &part };
    // Some file systems have no locks: parts then stay.
    let _ = file.try_lock();
    let mut writer = BufWriter::new(file);
    write(&mut writer)
        .and_then(|()| writer.flush())
        .and_then(|()| std::fs::rename(&part, path))
        .map_err(|e| Error::io(path, "cannot write", e))?;
    std::mem::forget(guard);
    Ok(())
}

/// Removes parts of a file that nobody writes any longer. `start` begins their names. What cannot be removed stays.
fn remove_left(path: &Path, start: &OsStr) {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
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
}
