//! An array at its place in the file, and the ways to read it.

use std::io::{ErrorKind, Read};

use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::file::decode::{self, Layout, Tuples, Values};
use crate::io::file::sample_type::{Endian, Pick, SampleType};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::num;
use crate::scene::Samples;

/// The encoding of the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// As text.
    Words,
    /// As big-endian bytes.
    Bytes,
    /// As bits, the first in the most significant bit of a byte.
    Bits,
    /// As text from 0 to 1, for bytes from 0 to 255.
    Shares,
}

/// The conversion of stored flags to VTK's ghost flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flags {
    /// No conversion.
    AsTheyAre,
    /// Ghost levels, before version 4: from 1 on, the element duplicates one of another piece.
    Levels,
    /// Visibility, before version 4: 0 hides the element.
    Visible,
}

/// An array of the file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stored {
    /// The offset of its numbers in the decompressed file.
    pub(crate) offset: u64,
    /// The number of lines before it.
    pub(crate) line: u64,
    pub(crate) tuples: u64,
    pub(crate) components: usize,
    pub(crate) kind: SampleType,
    pub(crate) form: Form,
    pub(crate) flags: Flags,
}

impl Stored {
    /// Describes its place, for messages.
    pub(crate) fn place(&self) -> String {
        match self.form {
            Form::Words | Form::Shares => format!("array of line {}", self.line + 1),
            Form::Bytes | Form::Bits => format!("array at byte {}", self.offset),
        }
    }

    /// Passes the stream of its bytes, and their byte order, to a function.
    fn stream(
        &self,
        source: &Source,
        read: &mut dyn FnMut(&mut dyn Read, Endian) -> std::io::Result<()>,
    ) -> Result<()> {
        let mut scanner = Scanner::resume(source, self.offset, self.line)?;
        let result = match self.form {
            Form::Words => read(&mut scanner.numbers(self.kind), Endian::Little),
            Form::Bytes => read(&mut scanner, Endian::Big),
            Form::Bits => {
                let (mut byte, mut left) = ([0], 0);
                let bit = || {
                    if left == 0 {
                        scanner.read_exact(&mut byte)?;
                        left = 8;
                    }
                    left -= 1;
                    Ok((byte[0] >> left) & 1)
                };
                read(&mut OneByOne(bit), Endian::Big)
            }
            Form::Shares => {
                let mut numbers = scanner.numbers(SampleType::F32);
                let code = || {
                    let mut share = [0; 4];
                    numbers.read_exact(&mut share)?;
                    Ok(num::u8_code(255.0 * f64::from(f32::from_le_bytes(share))))
                };
                read(&mut OneByOne(code), Endian::Big)
            }
        };
        result.map_err(|error| match error.kind() {
            // A number is out of range, or the compression is damaged.
            ErrorKind::InvalidData | ErrorKind::InvalidInput => source.error(self.place(), error.to_string()),
            _ => text::stream_error(source, error),
        })
    }

    /// Reads the selected part of each tuple.
    pub(crate) fn values(&self, source: &Source, pick: Pick) -> Result<Values> {
        let count = text::index(source, &self.place(), self.tuples)?;
        let Self { kind, components, .. } = *self;
        let mut values = Values::none(kind, components, pick);
        self.stream(source, &mut |stream, endian| {
            let layout = Layout { dims: [0; 3], kind, endian, components, pick };
            decode::append(stream, count, &layout, &mut values)
        })?;
        // Arrays of flags are bytes.
        if let Values::Samples(Samples::U8(flags)) | Values::Whole(Tuples { bytes: flags, .. }) = &mut values
        {
            match self.flags {
                Flags::AsTheyAre => {}
                Flags::Levels => flags.iter_mut().for_each(|flag| *flag = u8::from(*flag > 0)),
                Flags::Visible => flags.iter_mut().for_each(|flag| *flag = 2 * u8::from(*flag == 0)),
            }
        }
        Ok(values)
    }

    /// Reads points, some at a time, until the function returns false.
    pub(crate) fn each_point(&self, source: &Source, each: &mut dyn FnMut(DVec3) -> bool) -> Result<()> {
        const SOME: u64 = 1 << 12;
        self.stream(source, &mut |stream, endian| {
            let mut left = self.tuples;
            let mut points = Vec::new();
            while left > 0 {
                let some = left.min(SOME);
                points.clear();
                let count = usize::try_from(some).unwrap_or(0);
                decode::append_points(stream, count, self.kind, endian, &mut points)?;
                left = if points.iter().all(|&point| each(point)) { left - some } else { 0 };
            }
            Ok(())
        })
    }

    /// Reads all points. The caller has taken the memory from the budget.
    pub(crate) fn points(&self, source: &Source) -> Result<Vec<DVec3>> {
        let mut points = self.room(source)?;
        self.stream(source, &mut |stream, endian| {
            decode::append_points(stream, self.count(), self.kind, endian, &mut points)
        })?;
        Ok(points)
    }

    /// Reads all numbers as 64-bit floats.
    pub(crate) fn coordinates(&self, source: &Source) -> Result<Vec<f64>> {
        let mut all = self.room(source)?;
        self.stream(source, &mut |stream, endian| {
            decode::append_f64(stream, self.count(), self.kind, endian, &mut all)
        })?;
        Ok(all)
    }

    /// Reads all numbers as indices. The function returns the rule that a number breaks.
    pub(crate) fn indices(
        &self,
        source: &Source,
        each: &mut dyn FnMut(u32) -> std::result::Result<(), String>,
    ) -> Result<()> {
        self.stream(source, &mut |stream, endian| {
            decode::each_index(stream, self.count(), self.kind, endian, each)
        })
    }

    /// Returns an empty list with capacity for one entry per tuple.
    pub(crate) fn room<T>(&self, source: &Source) -> Result<Vec<T>> {
        room(source, &self.place(), self.tuples)
    }

    fn count(&self) -> usize {
        usize::try_from(self.tuples).unwrap_or(usize::MAX)
    }

    /// Returns an error about the array.
    pub(crate) fn error(&self, source: &Source, rule: impl Into<String>) -> Error {
        source.error(self.place(), rule)
    }
}

/// Returns an empty list with capacity for `count` entries.
pub(crate) fn room<T>(source: &Source, place: &str, count: u64) -> Result<Vec<T>> {
    let mut list = Vec::new();
    let full = |_| source.error(place, format!("{count}: memory is full"));
    list.try_reserve_exact(text::index(source, place, count)?).map_err(full)?;
    Ok(list)
}

/// Reads the bytes that a function returns.
struct OneByOne<F>(F);

impl<F: FnMut() -> std::io::Result<u8>> Read for OneByOne<F> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        for place in buffer.iter_mut() {
            *place = (self.0)()?;
        }
        Ok(buffer.len())
    }
}
