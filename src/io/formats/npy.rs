//! NPY 1.0 to 3.0: one array of numbers.
//!
//! | shape | result |
//! |---|---|
//! | (z, y, x) | a grid of unit spacing |
//! | (z, y, x, c) | a grid of tuples, c at most 16 |
//! | (1, z, y, x) | the one grid in it |
//! | (n, 3) | points |
//! | (n, k), k below 64 | points with arrays `column 3`, `column 4`, ... |
//!
//! In Fortran order the axes have the same meaning. Half-precision numbers become `f32`, truth values 0 and 1. Records,
//! strings, times, complex numbers and Python objects are refused. The header is parsed, never evaluated.

mod array;
mod header;

use crate::error::Result;
use crate::io::file::source::Source;
use crate::io::formats::npy::array::Array;
use crate::io::formats::npy::header::MAGIC;
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;

pub(crate) struct Npy;

/// The limit on components on the last of four axes; a larger extent is more likely an axis in space.
const MAX_TUPLE: u64 = 16;

/// The number of columns from which a two-dimensional array is refused as a picture instead of read as points.
const PICTURE: u64 = 64;

impl Reader for Npy {
    fn name(&self) -> &'static str {
        "NPY"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["npy"]
    }

    fn recognises(&self, source: &Source) -> bool {
        !source.is_gzip() && source.head().starts_with(MAGIC)
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let array = Array::open(source)?;
        match *array.shape.as_slice() {
            [n, k] if (3..PICTURE).contains(&k) => array.points(n, k, request),
            [z, y, x] => array.grid([x, y, z], 1, request),
            [1, z, y, x] if x > 1 => {
                let mut loaded = array.grid([x, y, z], 1, request)?;
                loaded.report.notes.push("the first of four axes has one entry: left out".to_owned());
                Ok(loaded)
            }
            [z, y, x, c] if c <= MAX_TUPLE => array.grid([x, y, z], c, request),
            _ => Err(source.error(
                "shape",
                format!(
                    "{}: must be (z, y, x), (z, y, x, c) with c at most {MAX_TUPLE}, or (n, k) with k from 3 to {}",
                    array.shape_text(),
                    PICTURE - 1
                ),
            )),
        }
    }
}
