//! Files that appear complete or not at all: written beside their place, then renamed.

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
    let mut beside = std::ffi::OsString::from(".");
    beside.push(name);
    beside.push(format!(".{}-{}.part", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)));
    let part = path.with_file_name(beside);
    let file = OpenOptions::new().write(true).create_new(true).open(&part);
    let mut writer = BufWriter::new(file.map_err(|e| Error::io(path, "cannot write", e))?);
    let guard = Part { path: &part };
    write(&mut writer)
        .and_then(|()| writer.flush())
        .and_then(|()| std::fs::rename(&part, path))
        .map_err(|e| Error::io(path, "cannot write", e))?;
    std::mem::forget(guard);
    Ok(())
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
