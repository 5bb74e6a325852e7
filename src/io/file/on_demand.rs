//! Samples that stay in their file, uncompressed, and are read box by box.

use std::io::ErrorKind;

use crate::error::{Error, Result};
use crate::io::file::decode::{Layout, Values, append};
use crate::io::file::source::Source;
use crate::num;
use crate::scene::{SampleSource, Samples};

/// The bytes that a disk gives at once.
const BLOCK: u64 = 4096;

/// Where the samples of a grid lie in a file, x fastest.
#[derive(Debug)]
pub(crate) struct InFile {
    pub(crate) source: Source,
    /// The first byte of the first sample.
    pub(crate) offset: u64,
    pub(crate) layout: Layout,
}

impl SampleSource for InFile {
    fn read(&self, first: [u32; 3], extent: [u32; 3]) -> Result<Samples> {
        let Layout { dims, kind, components, pick, .. } = self.layout;
        let tuple = kind.bytes().saturating_mul(num::wide(components));
        let [nx, ny, _] = dims.map(u64::from);
        let [width, height, depth] = extent.map(num::index);
        // Whole rows follow each other, and whole planes.
        let (run, runs) = match (extent[0] == dims[0], extent[1] == dims[1]) {
            (true, true) => (width * height * depth, [1, 1]),
            (true, false) => (width * height, [1, depth]),
            _ => (width, [height, depth]),
        };
        let mut samples = Values::none(kind, components, pick);
        let full = |_| self.source.error("data", format!("a box of {extent:?} samples: memory is full"));
        samples.reserve(width * height * depth).map_err(full)?;
        let tuple_bytes = num::usize_of_u64(tuple);
        let mut bytes = vec![0; width * height * depth * tuple_bytes];
        let offset = |j: usize, k: usize| {
            let [x, y, z] = [first[0], first[1] + num::count(j), first[2] + num::count(k)].map(u64::from);
            self.offset + ((z * ny + y) * nx + x) * tuple
        };
        let fill = |offset: u64, bytes: &mut [u8]| {
            self.source.fill(offset, bytes).map_err(|error| self.failed(offset, &error))
        };
        let row = run * tuple_bytes;
        let stride = num::usize_of_u64(nx * tuple);
        // A disk gives whole blocks: where each has several rows, one read of all that lies between the first row and the last costs it nothing more.
        let mut between =
            vec![0; if runs[0] > 1 && nx * tuple <= BLOCK { (runs[0] - 1) * stride + row } else { 0 }];
        for (k, plane) in bytes.chunks_exact_mut(runs[0] * row).enumerate() {
            if between.is_empty() {
                for (j, bytes) in plane.chunks_exact_mut(row).enumerate() {
                    fill(offset(j, k), bytes)?;
                }
                continue;
            }
            fill(offset(0, k), &mut between)?;
            for (to, from) in plane.chunks_exact_mut(row).zip(between.chunks(stride)) {
                to.copy_from_slice(&from[..row]);
            }
        }
        append(&mut &*bytes, width * height * depth, &self.layout, &mut samples)
            .map_err(|error| self.failed(self.offset, &error))?;
        Ok(samples.into_samples())
    }
}

impl InFile {
    fn failed(&self, offset: u64, error: &std::io::Error) -> Error {
        let rule = match error.kind() {
            ErrorKind::UnexpectedEof => "ends here: it had more samples when it was opened".to_owned(),
            _ => format!("cannot read: {error}"),
        };
        self.source.error(format!("data at byte {offset}"), rule)
    }
}
