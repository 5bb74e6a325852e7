//! NPY 1.0 to 3.0: one array of numbers.
//!
//! | shape | what |
//! |---|---|
//! | (z, y, x) | grid of unit spacing |
//! | (z, y, x, c) | grid of tuples, c at most 16 |
//! | (1, z, y, x) | the one grid in it |
//! | (n, 3) | points |
//! | (n, k), k below 64 | points with arrays `column 3`, `column 4`, ... |
//!
//! The same in Fortran order: the axes keep their meaning. Half-precision numbers become `f32`, truth
//! values 0 and 1. Records, strings, times, complex numbers and Python objects are refused; nothing of the
//! header is evaluated.

use std::io::Read;

use glam::DVec3;

use super::arrays::{ArrayInfo, Association, Pick};
use super::dataset::{self, Origin};
use super::samples::{self, Endian, Layout, SampleType};
use super::source::{Budget, Encoding, Source};
use super::text;
use super::volume::Chosen;
use super::{Loaded, ReadOptions, Reader};
use crate::error::Result;
use crate::num;
use crate::scene::{Grid, Samples};

pub(super) struct Npy;

const MAGIC: &[u8] = b"\x93NUMPY";

/// Longest header, in bytes.
const MAX_HEADER: u64 = 1 << 16;

/// Most numbers of a tuple on the last of four axes; more are rather the extent of an axis in space.
const MAX_TUPLE: u64 = 16;

/// Fewest columns that make two axes a picture instead of points.
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

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let array = Array::open(source)?;
        match *array.shape.as_slice() {
            [n, k] if (3..PICTURE).contains(&k) => array.points(n, k, options),
            [z, y, x] => array.grid([x, y, z], 1, options),
            [1, z, y, x] if x > 1 => {
                let mut loaded = array.grid([x, y, z], 1, options)?;
                loaded.report.notes.push("the first of four axes has one entry: left out".to_owned());
                Ok(loaded)
            }
            [z, y, x, c] if c <= MAX_TUPLE => array.grid([x, y, z], c, options),
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

/// The array of a file, its size checked against the file's.
struct Array<'a> {
    source: &'a Source,
    kind: SampleType,
    /// Whether numbers of two bytes become the type.
    half: bool,
    endian: Endian,
    fortran: bool,
    shape: Vec<u64>,
    /// Where the numbers begin.
    start: u64,
}

impl<'a> Array<'a> {
    fn open(source: &'a Source) -> Result<Self> {
        let head = source.head();
        if !head.starts_with(MAGIC) {
            return Err(source.error("byte 0", "must begin with \\x93NUMPY"));
        }
        let &[major, minor] = head.get(6..8).unwrap_or_default() else {
            return Err(source.error("byte 6", "ends before the version"));
        };
        let (length, begin) = match (major, minor, head.get(8..)) {
            (1, 0, Some(&[a, b, ..])) => (u64::from(u16::from_le_bytes([a, b])), 10),
            (2 | 3, 0, Some(&[a, b, c, d, ..])) => (u64::from(u32::from_le_bytes([a, b, c, d])), 12),
            (1..=3, 0, _) => return Err(source.error("byte 8", "ends before the header's length")),
            _ => {
                let rule = format!("version {major}.{minor}: must be 1.0, 2.0 or 3.0");
                return Err(source.error("byte 6", rule));
            }
        };
        if length > MAX_HEADER {
            let rule = format!("a header of {length} bytes: the limit is {MAX_HEADER}");
            return Err(source.error("byte 8", rule));
        }
        let bytes = source.bytes(begin, length)?;
        let Ok(header) = std::str::from_utf8(&bytes) else {
            return Err(source.error("header", "is no text"));
        };
        let (descr, fortran, shape) = Literal { source, header, at: 0 }.header()?;
        let (kind, half, endian) = number_type(source, &descr)?;
        let array = Self { source, kind, half, endian, fortran, shape, start: begin + length };
        let there = source.len().saturating_sub(array.start);
        let needed = array.shape.iter().try_fold(array.item(), |n, &extent| n.checked_mul(extent));
        if needed != Some(there) {
            let needed = needed.map_or("more than 2^64".to_owned(), |needed| needed.to_string());
            let rule =
                format!("{} of type {descr} needs {needed} bytes: {there} are there", array.shape_text());
            return Err(source.error("shape", rule));
        }
        Ok(array)
    }

    /// Bytes of a number in the file.
    fn item(&self) -> u64 {
        if self.half { 2 } else { self.kind.bytes() }
    }

    fn shape_text(&self) -> String {
        let extents: Vec<String> = self.shape.iter().map(u64::to_string).collect();
        match extents.as_slice() {
            [one] => format!("({one},)"),
            _ => format!("({})", extents.join(", ")),
        }
    }

    /// The numbers after so many, as bytes of `self.kind` in `self.order()`.
    fn numbers(&self, skip: u64) -> Box<dyn Read + 'a> {
        let offset = self.start.saturating_add(skip.saturating_mul(self.item()));
        let reader = self.source.reader(offset, Encoding::Raw);
        if self.half {
            Box::new(Halves { reader, endian: self.endian, bytes: [0; 4], left: 0 })
        } else {
            Box::new(reader)
        }
    }

    /// The byte order of what [`Self::numbers`] gives.
    fn order(&self) -> Endian {
        if self.half { Endian::Little } else { self.endian }
    }

    fn grid(&self, extents: [u64; 3], components: u64, options: &ReadOptions) -> Result<Loaded> {
        let source = self.source;
        let mut dims = [0; 3];
        for (dim, extent) in dims.iter_mut().zip(extents) {
            *dim = u32::try_from(extent)
                .map_err(|_| source.error("shape", format!("{extent}: must be below 2^32")))?;
        }
        let layout = Layout::scalar(dims, self.kind, self.order());
        let components = usize::try_from(components).unwrap_or(usize::MAX);
        let chosen = Chosen::new(source, "shape", layout, components, options)?;
        let (count, _) = samples::data_size(source, "shape", &chosen.layout, options)?;
        let samples = if self.fortran {
            self.turned(count, &chosen.layout, options)?
        } else {
            let mut samples = Samples::none(self.kind, chosen.layout.pick);
            samples::append(&mut self.numbers(0), count, &chosen.layout, &mut samples)
                .map_err(|error| text::stream_error(source, error))?;
            samples
        };
        let grid = Grid::new(dims, samples).map_err(|error| error.in_file(source.path()))?;
        let mut loaded = chosen.loaded("NPY", grid);
        // Pictures are stored so, too.
        if components == 1 && dims[0] <= 4 && dims[1] >= 16 && dims[2] >= 16 {
            loaded.report.warnings.push(format!(
                "shape {}: {} samples along x; a picture's channels would look the same",
                self.shape_text(),
                dims[0]
            ));
        }
        Ok(loaded)
    }

    /// Samples whose last axis is the slowest in the file, a block at a time.
    fn turned(&self, count: usize, layout: &Layout, options: &ReadOptions) -> Result<Samples> {
        let source = self.source;
        let volume = num::wide(count);
        let plane = Layout { components: 1, pick: Pick::Component(0), ..*layout };
        let mut budget = Budget::new(source, options);
        let full = |_| source.error("shape", format!("{count} samples: memory is full"));
        let failed = |error| text::stream_error(source, error);
        match layout.pick {
            Pick::Component(component) => {
                let bytes = volume.saturating_mul(layout.kind.stored_bytes());
                budget.take("shape", bytes)?;
                let skip = volume.saturating_mul(num::wide(component));
                let mut numbers = self.numbers(skip);
                let mut samples = Samples::none(layout.kind, layout.pick);
                samples.reserve(count).map_err(full)?;
                macro_rules! scatter {
                    ($list:expr, $variant:path) => {{
                        $list.resize(count, Default::default());
                        scatter(
                            layout.dims,
                            |block| {
                                let mut part = Samples::none(layout.kind, layout.pick);
                                samples::append(&mut numbers, block, &plane, &mut part)?;
                                match part {
                                    $variant(part) => Ok(part),
                                    _ => Ok(Vec::new()),
                                }
                            },
                            |at, value| $list[at] = value,
                        )
                        .map_err(failed)?
                    }};
                }
                match &mut samples {
                    Samples::U8(list) => scatter!(list, Samples::U8),
                    Samples::U16(list) => scatter!(list, Samples::U16),
                    Samples::I16(list) => scatter!(list, Samples::I16),
                    Samples::F32(list) => scatter!(list, Samples::F32),
                }
                Ok(samples)
            }
            Pick::Magnitude => {
                // Components come one after another: their squares are summed up.
                budget.take("shape", volume.saturating_mul(12))?;
                let mut sums: Vec<f64> = Vec::new();
                sums.try_reserve_exact(count).map_err(full)?;
                sums.resize(count, 0.0);
                let mut numbers = self.numbers(0);
                for _ in 0..layout.components {
                    let read = |block| {
                        let mut part = Vec::new();
                        samples::append_f64(&mut numbers, block, layout.kind, layout.endian, &mut part)?;
                        Ok(part)
                    };
                    scatter(layout.dims, read, |at, value: f64| sums[at] += value * value).map_err(failed)?;
                }
                let mut lengths = Vec::new();
                lengths.try_reserve_exact(count).map_err(full)?;
                lengths.extend(sums.into_iter().map(|sum| num::f32_of(sum.sqrt())));
                Ok(Samples::F32(lengths))
            }
        }
    }

    fn points(&self, n: u64, k: u64, options: &ReadOptions) -> Result<Loaded> {
        let source = self.source;
        let mut budget = Budget::new(source, options);
        budget.take("shape", n.saturating_mul(24))?;
        let count = text::index(source, "shape", n)?;
        let columns = usize::try_from(k).unwrap_or(usize::MAX);
        let failed = |error| text::stream_error(source, error);
        let mut centres: Vec<DVec3> = Vec::new();
        let full = |_| source.error("shape", format!("{n} points: memory is full"));
        centres.try_reserve_exact(count).map_err(full)?;
        if self.fortran {
            centres.resize(count, DVec3::ZERO);
            for axis in 0..3_usize {
                let mut numbers = self.numbers(n.saturating_mul(u64::try_from(axis).unwrap_or(0)));
                for block in centres.chunks_mut(BLOCK) {
                    let mut values = Vec::new();
                    samples::append_f64(&mut numbers, block.len(), self.kind, self.order(), &mut values)
                        .map_err(failed)?;
                    for (centre, value) in block.iter_mut().zip(values) {
                        centre[axis] = value;
                    }
                }
            }
        } else {
            let mut numbers = self.numbers(0);
            let mut left = count;
            while left > 0 {
                let block = left.min(BLOCK);
                let mut values = Vec::new();
                samples::append_f64(&mut numbers, block * columns, self.kind, self.order(), &mut values)
                    .map_err(failed)?;
                centres.extend(values.chunks_exact(columns).map(|row| DVec3::new(row[0], row[1], row[2])));
                left -= block;
            }
        }
        let array = |column| ArrayInfo {
            name: format!("column {column}"),
            association: Association::Point,
            kind: self.kind,
            components: 1,
            active: column == 3,
        };
        let arrays = (3..k).map(array).collect();
        let mut read = |index: usize, _: Pick| {
            let column = index + 3;
            let mut samples = Samples::none(self.kind, Pick::Component(0));
            let (skip, components, pick) = if self.fortran {
                (n.saturating_mul(num::wide(column)), 1, Pick::Component(0))
            } else {
                (0, columns, Pick::Component(column))
            };
            let layout = Layout { components, pick, ..Layout::scalar([0; 3], self.kind, self.order()) };
            samples::append(&mut self.numbers(skip), count, &layout, &mut samples).map_err(failed)?;
            Ok(samples)
        };
        dataset::points(centres, Origin { source, format: "NPY", arrays }, &mut budget, &mut read, options)
    }
}

/// Numbers that are read at a time.
const BLOCK: usize = 1 << 13;

/// Reads samples whose z is fastest and x slowest, and puts each to its place where x is fastest.
fn scatter<T>(
    dims: [u32; 3],
    mut read: impl FnMut(usize) -> std::io::Result<Vec<T>>,
    mut put: impl FnMut(usize, T),
) -> std::io::Result<()> {
    let [nx, ny, nz] = dims.map(num::index);
    let mut left = nx * ny * nz;
    let [mut x, mut y, mut z] = [0; 3];
    while left > 0 {
        let block = left.min(BLOCK);
        for value in read(block)? {
            put(x + nx * (y + ny * z), value);
            z += 1;
            if z == nz {
                z = 0;
                y += 1;
                if y == ny {
                    y = 0;
                    x += 1;
                }
            }
        }
        left -= block;
    }
    Ok(())
}

/// Half-precision numbers as the little-endian bytes of single precision.
struct Halves<R> {
    reader: R,
    endian: Endian,
    bytes: [u8; 4],
    /// How many of the last number's bytes are still to be handed out.
    left: usize,
}

impl<R: Read> Read for Halves<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            if self.left == 0 {
                let mut half = [0; 2];
                self.reader.read_exact(&mut half)?;
                let bits = match self.endian {
                    Endian::Little => u16::from_le_bytes(half),
                    Endian::Big => u16::from_be_bytes(half),
                };
                self.bytes = single(bits).to_le_bytes();
                self.left = 4;
            }
            let take = self.left.min(buffer.len() - filled);
            let from = 4 - self.left;
            buffer[filled..filled + take].copy_from_slice(&self.bytes[from..from + take]);
            self.left -= take;
            filled += take;
        }
        Ok(filled)
    }
}

/// The value of a half-precision number (IEEE 754 binary16); exact.
fn single(bits: u16) -> f32 {
    let fraction = f32::from(bits & 0x3ff);
    let size = match (bits >> 10) & 0x1f {
        0 => fraction / 16_777_216.0, // 2^-24
        31 if bits & 0x3ff == 0 => f32::INFINITY,
        31 => f32::NAN,
        exponent => (1024.0 + fraction) * f32::from_bits(u32::from(exponent + 102) << 23), // 2^(e - 25)
    };
    if bits & 0x8000 == 0 { size } else { -size }
}

/// The type of a description such as `<f4`: type, whether it is kept as two bytes, byte order.
fn number_type(source: &Source, descr: &str) -> Result<(SampleType, bool, Endian)> {
    let (order, name) = match descr.split_at_checked(1) {
        Some((order @ ("<" | ">" | "|" | "="), name)) => (order, name),
        _ => ("=", descr),
    };
    // A machine's own order: little on all that this crate builds for in practice, and on the writer's.
    let endian = if order == ">" { Endian::Big } else { Endian::Little };
    let kind = match name {
        "b1" | "u1" => SampleType::U8,
        "i1" => SampleType::I8,
        "u2" => SampleType::U16,
        "i2" => SampleType::I16,
        "u4" => SampleType::U32,
        "i4" => SampleType::I32,
        "u8" => SampleType::U64,
        "i8" => SampleType::I64,
        "f2" => return Ok((SampleType::F32, true, endian)),
        "f4" => SampleType::F32,
        "f8" => SampleType::F64,
        _ => {
            let what = match name.as_bytes().first() {
                Some(b'O') => "Python objects",
                Some(b'c') => "complex numbers",
                Some(b'S' | b'U' | b'a') => "strings",
                Some(b'M' | b'm') => "times",
                Some(b'V') => "raw records",
                Some(b'f') => "floats of another size",
                _ => "no numbers that are known",
            };
            let rule =
                format!("\"{}\": {what}; must be b1, u1 to u8, i1 to i8, f2, f4 or f8", text::shown(descr));
            return Err(source.error("descr", rule));
        }
    };
    Ok((kind, false, endian))
}

/// The header: a Python dictionary of three known entries.
struct Literal<'a> {
    source: &'a Source,
    header: &'a str,
    at: usize,
}

impl<'a> Literal<'a> {
    fn header(mut self) -> Result<(String, bool, Vec<u64>)> {
        let (mut descr, mut fortran, mut shape) = (None, None, None);
        self.expect("{")?;
        while !self.take("}") {
            let key = self.string()?;
            self.expect(":")?;
            let twice = match key {
                "descr" => {
                    if self.rest().starts_with(['[', '(']) {
                        let rule = "a record of several fields: must be one number, such as '<f4'";
                        return Err(self.source.error("descr", rule));
                    }
                    descr.replace(self.string()?.to_owned()).is_some()
                }
                "fortran_order" => fortran.replace(self.truth()?).is_some(),
                "shape" => shape.replace(self.tuple()?).is_some(),
                other => {
                    let shown = text::shown(other);
                    return Err(self.error(&format!("'{shown}': must be descr, fortran_order or shape")));
                }
            };
            if twice {
                return Err(self.error(&format!("'{key}' is there twice")));
            }
            if !self.take(",") {
                self.expect("}")?;
                break;
            }
        }
        if !self.rest().trim_matches([' ', '\n', '\0', '\t', '\r']).is_empty() {
            return Err(self.error("nothing must follow the dictionary"));
        }
        let missing = |name: &str| self.source.error("header", format!("'{name}' is missing"));
        Ok((
            descr.ok_or_else(|| missing("descr"))?,
            fortran.ok_or_else(|| missing("fortran_order"))?,
            shape.ok_or_else(|| missing("shape"))?,
        ))
    }

    /// What is left, without blanks before it.
    fn rest(&mut self) -> &'a str {
        let rest = self.header.get(self.at..).unwrap_or_default();
        let trimmed = rest.trim_start_matches([' ', '\t', '\n', '\r']);
        self.at += rest.len() - trimmed.len();
        trimmed
    }

    fn error(&self, rule: &str) -> crate::Error {
        let rest = self.header.get(self.at..).unwrap_or_default();
        let shown: String = text::shown(rest).chars().take(20).collect();
        self.source.error(format!("header at {}", self.at), format!("\"{shown}\": {rule}"))
    }

    fn take(&mut self, token: &str) -> bool {
        let found = self.rest().starts_with(token);
        if found {
            self.at += token.len();
        }
        found
    }

    fn expect(&mut self, token: &str) -> Result<()> {
        if self.take(token) { Ok(()) } else { Err(self.error(&format!("{token} must come here"))) }
    }

    fn string(&mut self) -> Result<&'a str> {
        let rest = self.rest();
        let quote = rest.chars().next().filter(|c| matches!(c, '\'' | '"'));
        let text = quote.and_then(|quote| rest.get(1..)?.split_once(quote)).map(|(text, _)| text);
        match text.filter(|text| !text.contains(['\\', '\n'])) {
            Some(text) => {
                self.at += text.len() + 2;
                Ok(text)
            }
            None => Err(self.error("a string must come here")),
        }
    }

    fn truth(&mut self) -> Result<bool> {
        if self.take("True") {
            Ok(true)
        } else if self.take("False") {
            Ok(false)
        } else {
            Err(self.error("True or False must come here"))
        }
    }

    fn tuple(&mut self) -> Result<Vec<u64>> {
        let mut extents = Vec::new();
        self.expect("(")?;
        let mut comma = true;
        while !self.take(")") {
            if !comma || extents.len() == 32 {
                return Err(self.error("a list of at most 32 extents must end here"));
            }
            let rest = self.rest();
            let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
            let Ok(extent) = rest[..digits].parse() else {
                return Err(self.error("a whole number must come here"));
            };
            extents.push(extent);
            self.at += digits;
            // Old writers mark long numbers.
            if rest[digits..].starts_with('L') {
                self.at += 1;
            }
            comma = self.take(",");
        }
        if extents.len() == 1 && !comma {
            return Err(self.error("a shape of one extent needs a comma"));
        }
        Ok(extents)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_exact() {
        for (bits, value) in [
            (0x0000, 0.0),
            (0x0001, 5.960_464_5e-8),
            (0x03ff, 6.097_555e-5),
            (0x0400, 6.103_515_6e-5),
            (0x3555, 0.333_251_95),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0xfc00, f32::NEG_INFINITY),
        ] {
            assert_eq!(single(bits).to_bits(), f32::to_bits(value), "{bits:#x}");
        }
        assert!(single(0x7e00).is_nan());
        assert!(single(0x8000).is_sign_negative());
    }
}
