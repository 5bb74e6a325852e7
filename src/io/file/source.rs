//! An open file on disk or in memory: its first bytes, its siblings, its decompressed stream.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::{File, Metadata};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::bufread::{MultiGzDecoder, ZlibDecoder};

use crate::error::{Error, Result};
use crate::io::options::{Progress, ReadOptions};
use crate::num;

/// The compression of a file from some offset to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Raw,
    Gzip,
    Zlib,
}

impl Encoding {
    /// Returns an upper bound of the size of `packed` bytes after decompression. Deflate shrinks 258 bytes to two
    /// bits at best (RFC 1951), which is rounded up.
    pub(crate) fn most(self, packed: u64) -> u64 {
        match self {
            Self::Raw => packed,
            Self::Gzip | Self::Zlib => packed.saturating_mul(1032),
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Gzip => "gzip",
            Self::Zlib => "zlib",
        }
    }
}

/// Files in memory by name, where a header finds the files that it names.
type Bundle = BTreeMap<String, Arc<Vec<u8>>>;

enum Body {
    File(File),
    Memory { bytes: Arc<Vec<u8>>, bundle: Arc<Bundle> },
}

/// An open regular file, its size and its first bytes; cheap to clone.
#[derive(Clone)]
pub(crate) struct Source {
    path: Arc<Path>,
    body: Arc<Body>,
    len: u64,
    gzip: bool,
    head: Arc<[u8]>,
    progress: Option<Progress>,
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Source").field("path", &self.path).field("len", &self.len).finish_non_exhaustive()
    }
}

impl Source {
    /// The size of [`Self::head`], in bytes.
    const HEAD: u64 = 4096;

    /// Opens a file and reads its first bytes, decompressed if the file is a gzip stream.
    pub(crate) fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        // A device or a pipe has no size to check a header against, and opening a pipe waits for its other end.
        let regular = |metadata: &Metadata| {
            let refusal = || Error::file(path, "file", "is a folder or a device: must be a regular file");
            if metadata.is_file() { Ok(()) } else { Err(refusal()) }
        };
        regular(&std::fs::metadata(path).map_err(|e| Error::io(path, "cannot open", e))?)?;
        let file = File::open(path).map_err(|e| Error::io(path, "cannot open", e))?;
        let metadata = file.metadata().map_err(|e| Error::io(path, "cannot look at", e))?;
        regular(&metadata)?;
        Self::new(path, Body::File(file), metadata.len(), options.progress.clone())
    }

    /// Opens the first of several files in memory; the others can be opened as siblings.
    pub(crate) fn in_memory(files: &[(&str, &[u8])]) -> Result<Self> {
        let bundle: Bundle =
            files.iter().map(|(name, bytes)| ((*name).to_owned(), Arc::new(bytes.to_vec()))).collect();
        let Some((name, _)) = files.first() else {
            return Err(Error::invalid("files", "there is none"));
        };
        Self::of_bundle(Path::new(name), &Arc::new(bundle))
    }

    /// Opens decompressed contents of a file under its name, without siblings. The bytes are not copied.
    pub(crate) fn unpacked(path: &Path, bytes: Vec<u8>) -> Result<Self> {
        let (len, bytes) = (num::wide(bytes.len()), Arc::new(bytes));
        Self::new(path, Body::Memory { bytes, bundle: Arc::default() }, len, None)
    }

    fn of_bundle(path: &Path, bundle: &Arc<Bundle>) -> Result<Self> {
        let Some(bytes) = path.to_str().and_then(|name| bundle.get(name)).cloned() else {
            return Err(Error::io(path, "cannot open", std::io::ErrorKind::NotFound.into()));
        };
        let len = num::wide(bytes.len());
        Self::new(path, Body::Memory { bytes, bundle: bundle.clone() }, len, None)
    }

    fn new(path: &Path, body: Body, len: u64, progress: Option<Progress>) -> Result<Self> {
        let (path, body, head) = (path.into(), Arc::new(body), Arc::default());
        let source = Self { path, body, len, gzip: false, head, progress: None };
        let mut head = source.bytes(0, Self::HEAD.min(len))?;
        let gzip = head.starts_with(&[0x1f, 0x8b]);
        if gzip {
            head.clear();
            // A damaged stream leaves a short head; reading it later reports the damage.
            let _ = source.reader(0, Encoding::Gzip).take(Self::HEAD).read_to_end(&mut head);
        }
        Ok(Self { gzip, head: head.into(), progress, ..source })
    }

    fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Opens another file that this one names, by a path relative to this file's folder.
    pub(crate) fn sibling(&self, name: &Path, options: &ReadOptions) -> Result<Self> {
        let path = self.folder().join(name);
        match &*self.body {
            Body::File(_) => Self::open(&path, options),
            Body::Memory { bundle, .. } => Self::of_bundle(&path, bundle),
        }
    }

    /// Whether a file with this name exists beside this one.
    pub(crate) fn has_sibling(&self, name: &Path) -> bool {
        let path = self.folder().join(name);
        match &*self.body {
            Body::File(_) => path.exists(),
            Body::Memory { bundle, .. } => path.to_str().is_some_and(|name| bundle.contains_key(name)),
        }
    }

    /// Returns the names of the regular files in the same folder, including this one, sorted.
    #[cfg(feature = "dicom")]
    pub(crate) fn neighbours(&self) -> Result<Vec<PathBuf>> {
        let folder = self.folder();
        let paths = match &*self.body {
            Body::File(_) if folder.as_os_str().is_empty() => list(Path::new("."))?.0,
            Body::File(_) => list(folder)?.0,
            Body::Memory { bundle, .. } => {
                bundle.keys().map(PathBuf::from).filter(|path| path.parent() == Some(folder)).collect()
            }
        };
        let mut names: Vec<PathBuf> =
            paths.iter().filter_map(|path| path.file_name()).map(PathBuf::from).collect();
        names.sort();
        Ok(names)
    }

    /// Whether this is a file on disk, beside which others are.
    pub(crate) fn is_on_disk(&self) -> bool {
        matches!(&*self.body, Body::File(_))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the size of the file as stored, in bytes.
    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// Whether the whole file is a gzip stream.
    pub(crate) fn is_gzip(&self) -> bool {
        self.gzip
    }

    /// The compression of the file as a whole.
    pub(crate) fn encoding(&self) -> Encoding {
        if self.gzip { Encoding::Gzip } else { Encoding::Raw }
    }

    /// The first 4096 bytes, decompressed; fewer only if the file is shorter.
    pub(crate) fn head(&self) -> &[u8] {
        &self.head
    }

    /// Returns an error that names this file.
    pub(crate) fn error(&self, place: impl Into<String>, rule: impl Into<String>) -> Error {
        Error::file(&self.path, place, rule)
    }

    /// Converts an error of a stream of this file: unwraps an error of this crate, and wraps those of the operating
    /// system.
    pub(crate) fn io_error(&self, error: std::io::Error) -> Error {
        match error.downcast::<Error>() {
            Ok(ours) => ours,
            Err(error) => Error::io(&self.path, "cannot read", error),
        }
    }

    /// Reads a range of the file as stored. The caller bounds `len`.
    pub(crate) fn bytes(&self, offset: u64, len: u64) -> Result<Vec<u8>> {
        if offset.checked_add(len).is_none_or(|end| end > self.len) {
            let rule = format!("needs {len} bytes here, the file has {} in all", self.len);
            return Err(self.error(format!("byte {offset}"), rule));
        }
        let mut bytes = Vec::new();
        let read = match &*self.body {
            // Ranges are often small and far apart: a buffer would read more than needed.
            Body::File(file) => At { source: self, file, position: offset }.take(len).read_to_end(&mut bytes),
            Body::Memory { .. } => self.reader(offset, Encoding::Raw).take(len).read_to_end(&mut bytes),
        };
        read.map_err(|e| Error::io(&self.path, "cannot read", e))?;
        Ok(bytes)
    }

    /// Fills a buffer with bytes of the file as stored. Several threads may read at once.
    ///
    /// # Errors
    ///
    /// Those of the system; [`std::io::ErrorKind::UnexpectedEof`] if the file ends early.
    pub(crate) fn fill(&self, offset: u64, buffer: &mut [u8]) -> std::io::Result<()> {
        match &*self.body {
            #[cfg(unix)]
            Body::File(file) => std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset),
            #[cfg(windows)]
            Body::File(file) => {
                let mut filled = 0;
                while filled < buffer.len() {
                    let at = offset.saturating_add(num::wide(filled));
                    match std::os::windows::fs::FileExt::seek_read(file, &mut buffer[filled..], at)? {
                        0 => return Err(std::io::ErrorKind::UnexpectedEof.into()),
                        read => filled += read,
                    }
                }
                Ok(())
            }
            Body::Memory { .. } => self.reader(offset, Encoding::Raw).read_exact(buffer),
        }
    }

    /// Reads some bytes of the file as stored, none at its end.
    pub(crate) fn read_some(&self, offset: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        match &*self.body {
            Body::File(file) => At { source: self, file, position: offset }.read(buffer),
            Body::Memory { .. } => self.reader(offset, Encoding::Raw).read(buffer),
        }
    }

    /// Returns the decompressed stream from `offset` to the end.
    pub(crate) fn reader(&self, offset: u64, encoding: Encoding) -> Box<dyn BufRead + '_> {
        let stored: Box<dyn BufRead + '_> = match &*self.body {
            Body::File(file) => {
                Box::new(BufReader::with_capacity(1 << 16, At { source: self, file, position: offset }))
            }
            Body::Memory { bytes, .. } => {
                let offset = usize::try_from(offset).unwrap_or(usize::MAX);
                Box::new(bytes.get(offset..).unwrap_or_default())
            }
        };
        match encoding {
            Encoding::Raw => stored,
            Encoding::Gzip => Box::new(BufReader::with_capacity(1 << 16, MultiGzDecoder::new(stored))),
            Encoding::Zlib => Box::new(BufReader::with_capacity(1 << 16, ZlibDecoder::new(stored))),
        }
    }
}

/// A reader with its own position in a file that several readers share.
struct At<'a> {
    source: &'a Source,
    file: &'a File,
    position: u64,
}

impl Read for At<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.file.seek(SeekFrom::Start(self.position))?;
        let got = self.file.read(buffer)?;
        self.position = self.position.saturating_add(num::wide(got));
        if let Some(progress) = &self.source.progress {
            progress.call(self.position.min(self.source.len), self.source.len);
        }
        Ok(got)
    }
}

/// Lists the regular files in a folder, in any order, and counts its folders.
///
/// # Errors
///
/// If the folder cannot be read, or holds more than 131,072 files.
pub(crate) fn list(folder: &Path) -> Result<(Vec<PathBuf>, usize)> {
    const MOST: usize = 1 << 17;
    let failed = |error| Error::io(folder, "cannot list", error);
    let (mut files, mut folders) = (Vec::new(), 0);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            folders += 1;
        } else if path.is_file() {
            files.push(path);
        }
        if files.len() > MOST {
            return Err(Error::file(folder, "files", format!("more than {MOST}")));
        }
    }
    Ok((files, folders))
}
