//! Records of 32 bytes (`.splat`), known by the file name alone: float32 position and lengths, a byte each for red, green,
//! blue and opacity, and for the parts w, x, y, z of a quaternion. Axes are right, down, front.

use crate::error::Result;
use crate::io::build::gaussians::{About, Columns};
use crate::io::file::budget::Budget;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::formats::gaussian::rows::rows;
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;
use crate::num;
use crate::scene::{Axes, TrainedMode};

pub(crate) struct Splat;

/// Bytes of a record.
const RECORD: usize = 32;

impl Reader for Splat {
    fn name(&self) -> &'static str {
        "splat"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["splat"]
    }

    fn recognises(&self, _: &Source) -> bool {
        false
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let len = source.len();
        if source.is_gzip() {
            return Err(source.error("content", "a gzip stream: unpack it first"));
        }
        if !len.is_multiple_of(num::wide(RECORD)) {
            return Err(source.error("size", format!("{len} bytes: must be a multiple of {RECORD}")));
        }
        let mut budget = Budget::new(source, request);
        let mut columns = Columns::new(source, &mut budget, len / num::wide(RECORD), 0)?;
        let count = columns.parts.centres.len();
        rows(&mut Scanner::new(source), count, RECORD, &mut |i, row| {
            let (floats, bytes) = row.split_at(24);
            let float =
                |k: usize| f32::from_le_bytes(floats[4 * k..].first_chunk().copied().unwrap_or_default());
            let byte = |k: usize| f64::from(bytes[k]);
            columns.parts.centres[i] = [0, 1, 2].map(float);
            columns.parts.log_scales[i] = [3, 4, 5].map(|k| num::f32_of(f64::from(float(k)).ln()));
            columns.set_colour(i, [0, 1, 2].map(|k| byte(k) / 255.0));
            columns.parts.opacities[i] = num::f32_of(byte(3) / 255.0);
            columns.parts.rotations[i] = [4, 5, 6, 7].map(|k| num::f32_of((byte(k) - 128.0) / 128.0));
        })?;
        let about = About {
            format: self.name(),
            axes: Axes::Rdf.into(),
            axes_from: "the convention of .splat files",
            mode: TrainedMode::Unknown,
            texts: Vec::new(),
            notes: Vec::new(),
        };
        columns.finish(source, &mut budget, about, request)
    }
}
