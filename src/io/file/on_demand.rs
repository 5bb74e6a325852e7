//! Samples that stay in their files, uncompressed, and are read box by box.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::io::file::decode::{Layout, Values, append};
use crate::io::file::source::Source;
use crate::io::options::ReadOptions;
use crate::num;
use crate::scene::{SampleSource, Samples};

/// The bytes that a disk gives at once.
const BLOCK: u64 = 4096;

/// Samples of a grid in files, x fastest in each plane.
#[derive(Debug)]
pub(crate) struct InFile {
    pub(crate) planes: Planes,
    pub(crate) layout: Layout,
}

/// Where the planes of a grid lie: each is whole.
#[derive(Debug)]
pub(crate) enum Planes {
    /// One after another, from a byte of a file on.
    Joined(Source, u64),
    /// Each from a byte of one file on.
    Apart(Source, Vec<u64>),
    /// In several files.
    Files(PlaneFiles),
}

/// Files with as many planes each, which are opened to read them: they may be more than a process may have open.
#[derive(Debug)]
pub(crate) struct PlaneFiles {
    files: Vec<PlaneFile>,
    /// Planes in each.
    each: usize,
    /// The file that was opened last.
    open: Mutex<Option<(usize, Source)>>,
}

/// A file with planes, one after another.
#[derive(Clone, Debug)]
pub(crate) struct PlaneFile {
    path: PathBuf,
    /// The size of the file, in bytes.
    len: u64,
    /// The first byte of the first plane.
    offset: u64,
}

impl PlaneFile {
    pub(crate) fn new(source: &Source, offset: u64) -> Self {
        // The program may go to another folder.
        let path = std::path::absolute(source.path()).unwrap_or_else(|_| source.path().into());
        Self { path, len: source.len(), offset }
    }

    fn open(&self) -> Result<Source> {
        let source = Source::open(&self.path, &ReadOptions::default())?;
        if source.len() == self.len {
            return Ok(source);
        }
        let rule = format!("has {} bytes: it had {} when it was opened", source.len(), self.len);
        Err(source.error("file", rule))
    }
}

impl PlaneFiles {
    /// Takes the files of a grid with so many planes.
    pub(crate) fn new(files: Vec<PlaneFile>, planes: usize) -> Self {
        let each = planes / files.len().max(1);
        Self { files, each, open: Mutex::new(None) }
    }

    /// Returns the file of a plane, which has so many bytes, and where it begins.
    fn plane(&self, z: usize, bytes: u64) -> Result<(Source, u64)> {
        let number = z / self.each;
        let file = &self.files[number];
        let offset = file.offset + num::wide(z % self.each) * bytes;
        // Others go on while a file is opened.
        let open = || self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let last = open().clone().filter(|(last, _)| *last == number);
        let source = match last {
            Some((_, source)) => source,
            None => file.open()?,
        };
        *open() = Some((number, source.clone()));
        Ok((source, offset))
    }
}

impl SampleSource for InFile {
    fn read(&self, first: [u32; 3], extent: [u32; 3]) -> Result<Samples> {
        let Layout { dims, kind, components, pick, .. } = self.layout;
        let tuple = kind.bytes().saturating_mul(num::wide(components));
        let [nx, ny, _] = dims.map(u64::from);
        let [width, height, depth] = extent.map(num::index);
        // Whole rows follow each other, and whole planes.
        let joined = matches!(self.planes, Planes::Joined(..));
        let (run, runs) = match (extent[0] == dims[0], joined && extent[1] == dims[1]) {
            (true, true) => (width * height * depth, [1, 1]),
            (true, false) => (width * height, [1, depth]),
            _ => (width, [height, depth]),
        };
        let mut samples = Values::none(kind, components, pick);
        let error = |rule: String| Error::file(self.planes.path(), "data", rule);
        let full = |_| error(format!("a box of {extent:?} samples: memory is full"));
        samples.reserve(width * height * depth).map_err(full)?;
        let tuple_bytes = num::usize_of_u64(tuple);
        let mut bytes = vec![0; width * height * depth * tuple_bytes];
        let fill = |source: &Source, offset: u64, bytes: &mut [u8]| {
            source.fill(offset, bytes).map_err(|error| failed(source, offset, &error))
        };
        let row = run * tuple_bytes;
        let stride = num::usize_of_u64(nx * tuple);
        // A disk gives whole blocks: where each has several rows, one read of all that lies between the first row and the last costs it nothing more.
        let mut between =
            vec![0; if runs[0] > 1 && nx * tuple <= BLOCK { (runs[0] - 1) * stride + row } else { 0 }];
        for (k, plane) in bytes.chunks_exact_mut(runs[0] * row).enumerate() {
            let (source, begin) = self.planes.of(first[2] + num::count(k), nx * ny * tuple)?;
            let offset = |j: usize| {
                let [x, y] = [first[0], first[1] + num::count(j)].map(u64::from);
                begin + (y * nx + x) * tuple
            };
            if between.is_empty() {
                for (j, bytes) in plane.chunks_exact_mut(row).enumerate() {
                    fill(&source, offset(j), bytes)?;
                }
                continue;
            }
            fill(&source, offset(0), &mut between)?;
            for (to, from) in plane.chunks_exact_mut(row).zip(between.chunks(stride)) {
                to.copy_from_slice(&from[..row]);
            }
        }
        append(&mut &*bytes, width * height * depth, &self.layout, &mut samples)
            .map_err(|why| error(why.to_string()))?;
        Ok(samples.into_samples())
    }
}

impl Planes {
    /// Returns the file of a plane, which has so many bytes, and where it begins.
    fn of(&self, z: u32, bytes: u64) -> Result<(Source, u64)> {
        match self {
            Self::Joined(source, offset) => Ok((source.clone(), offset + u64::from(z) * bytes)),
            Self::Apart(source, offsets) => Ok((source.clone(), offsets[num::index(z)])),
            Self::Files(files) => files.plane(num::index(z), bytes),
        }
    }

    /// Returns the path of the first file.
    fn path(&self) -> &Path {
        match self {
            Self::Joined(source, _) | Self::Apart(source, _) => source.path(),
            Self::Files(files) => files.files.first().map_or(Path::new(""), |file| &file.path),
        }
    }
}

fn failed(source: &Source, offset: u64, error: &std::io::Error) -> Error {
    let rule = match error.kind() {
        ErrorKind::UnexpectedEof => "ends here: it had more samples when it was opened".to_owned(),
        _ => format!("cannot read: {error}"),
    };
    source.error(format!("data at byte {offset}"), rule)
}
