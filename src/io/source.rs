//! A file that a reader looks at.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

use crate::error::{Error, Result};

/// An open regular file, its size and its first bytes.
#[derive(Debug)]
pub(crate) struct Source {
    path: PathBuf,
    file: File,
    len: u64,
    gzip: bool,
    head: Vec<u8>,
}

impl Source {
    /// Most bytes of [`Self::head`].
    const HEAD: u64 = 4096;

    /// Opens a file and looks at its beginning, through gzip where the file is a gzip stream.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, "cannot open", e))?;
        let metadata = file.metadata().map_err(|e| Error::io(path, "cannot look at", e))?;
        // A device or a pipe has no size to check a header against.
        if !metadata.is_file() {
            return Err(Error::file(path, "file", "is a folder or a device: must be a regular file"));
        }
        let mut source =
            Self { path: path.to_path_buf(), file, len: metadata.len(), gzip: false, head: Vec::new() };
        source.head = source.bytes(0, Self::HEAD.min(source.len))?;
        if source.head.starts_with(&[0x1f, 0x8b]) {
            source.gzip = true;
            let mut head = Vec::new();
            // A damaged stream leaves a short head; reading the whole says what is wrong with it.
            let _ = source.reader(0, true)?.take(Self::HEAD).read_to_end(&mut head);
            source.head = head;
        }
        Ok(source)
    }

    /// The file's path, for messages.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Size of the file in bytes.
    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// Whether the whole file is a gzip stream.
    pub(crate) fn is_gzip(&self) -> bool {
        self.gzip
    }

    /// The first bytes, uncompressed; fewer than 4096 only where there are no more.
    pub(crate) fn head(&self) -> &[u8] {
        &self.head
    }

    /// An error that names this file.
    pub(crate) fn error(&self, place: impl Into<String>, rule: impl Into<String>) -> Error {
        Error::file(&self.path, place, rule)
    }

    /// A piece of the file. The caller bounds `len`.
    pub(crate) fn bytes(&self, offset: u64, len: u64) -> Result<Vec<u8>> {
        if offset.checked_add(len).is_none_or(|end| end > self.len) {
            return Err(self.error(
                format!("byte {offset}"),
                format!("needs {len} bytes here, the file has {} in all", self.len),
            ));
        }
        let mut bytes = Vec::new();
        let read = self.reader(offset, false)?.take(len).read_to_end(&mut bytes);
        read.map_err(|e| Error::io(&self.path, "cannot read", e))?;
        Ok(bytes)
    }

    /// The stream from `offset` to the end, inflated if `gzip`.
    pub(crate) fn reader(&self, offset: u64, gzip: bool) -> Result<Box<dyn BufRead + '_>> {
        let mut file = &self.file;
        file.seek(SeekFrom::Start(offset)).map_err(|e| Error::io(&self.path, "cannot seek in", e))?;
        let file = BufReader::with_capacity(1 << 16, file);
        Ok(if gzip { Box::new(BufReader::new(MultiGzDecoder::new(file))) } else { Box::new(file) })
    }
}
