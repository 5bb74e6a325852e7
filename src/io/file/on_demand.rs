//! Samples that stay in their files, uncompressed, and are read box by box.

use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;

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
    /// Each in a file that is opened to read it: they may be more than a process may have open.
    Files(Vec<PlaneFile>),
}

/// A file with a plane.
#[derive(Clone, Debug)]
pub(crate) struct PlaneFile {
    path: Arc<Path>,
    /// The size of the file, in bytes.
    len: u64,
    /// The first byte of the plane.
    offset: u64,
}

impl PlaneFile {
    pub(crate) fn new(source: &Source, offset: u64) -> Self {
        Self { path: source.path().into(), len: source.len(), offset }
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
        let full = |_| Error::invalid("data", format!("a box of {extent:?} samples: memory is full"));
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
            let (source, begin) = self.plane(first[2] + num::count(k), nx * ny * tuple)?;
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
            .map_err(|error| Error::invalid("data", error.to_string()))?;
        Ok(samples.into_samples())
    }
}

impl InFile {
    /// Returns the file of a plane, which has so many bytes, and where it begins.
    fn plane(&self, z: u32, bytes: u64) -> Result<(Source, u64)> {
        let at = num::index(z);
        match &self.planes {
            Planes::Joined(source, offset) => Ok((source.clone(), offset + u64::from(z) * bytes)),
            Planes::Apart(source, offsets) => Ok((source.clone(), offsets[at])),
            Planes::Files(files) => Ok((files[at].open()?, files[at].offset)),
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
