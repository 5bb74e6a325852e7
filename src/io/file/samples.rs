//! Samples of a grid in one or several files: size checks before memory is allocated, then decoding.

use std::io::{ErrorKind, Read};

use crate::error::{Error, Result};
use crate::io::file::decode::{Layout, append};
use crate::io::file::sample_type::{Endian, Pick};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::{Encoding, Source};
use crate::io::file::text;
use crate::io::options::ReadOptions;
use crate::num;
use crate::scene::Samples;

/// One file's share of the samples, and where it begins.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) source: Source,
    /// The offset of the stream in the file.
    pub(crate) offset: u64,
    /// The compression from there on.
    pub(crate) encoding: Encoding,
    /// Bytes of the decompressed stream before the first sample.
    pub(crate) skip: u64,
    /// Whether the numbers are text.
    pub(crate) text: bool,
}

impl Part {
    /// Returns the part of a file that holds `bytes` of samples after `skip` other bytes. Samples may begin with the
    /// magic of gzip: a file of exactly the right size is taken as uncompressed.
    pub(crate) fn sized(source: Source, skip: u64, bytes: u64) -> Self {
        let raw = skip.checked_add(bytes) == Some(source.len());
        let encoding = if raw { Encoding::Raw } else { source.encoding() };
        Self { source, offset: 0, encoding, skip, text: false }
    }
}

/// Returns the number of samples and their size in the file in bytes, checked against the memory limit.
pub(crate) fn data_size(
    source: &Source,
    place: &str,
    layout: &Layout,
    options: &ReadOptions,
) -> Result<(usize, u64)> {
    let [x, y, z] = layout.dims;
    if let Some(extent) = layout.dims.iter().find(|&&extent| extent < 2) {
        return Err(
            source.error(place, format!("{x} x {y} x {z} has {extent}: every extent must be at least 2"))
        );
    }
    let overflow =
        || source.error(place, format!("{x} x {y} x {z} samples are more than memory can address"));
    let count = layout
        .dims
        .iter()
        .try_fold(1_u64, |n, &extent| n.checked_mul(u64::from(extent)))
        .ok_or_else(overflow)?;
    let stored = if layout.pick == Pick::Magnitude { 4 } else { layout.kind.stored_bytes() };
    let memory = count.checked_mul(stored).ok_or_else(overflow)?;
    if memory > options.max_bytes {
        return Err(source.error(
            place,
            format!("{x} x {y} x {z} samples take {memory} bytes: the limit is {}", options.max_bytes),
        ));
    }
    let tuple = u64::try_from(layout.components).ok().and_then(|n| n.checked_mul(layout.kind.bytes()));
    let in_file = tuple.and_then(|tuple| count.checked_mul(tuple)).ok_or_else(overflow)?;
    Ok((usize::try_from(count).map_err(|_| overflow())?, in_file))
}

/// Reads samples from files that hold equal shares of them and nothing more.
///
/// `source` and `place` are the header and its field, for messages. `part` opens each file when it is needed, so that
/// few files are open at a time.
pub(crate) fn read(
    source: &Source,
    place: &str,
    layout: &Layout,
    parts: usize,
    part: &dyn Fn(usize) -> Result<Part>,
    options: &ReadOptions,
) -> Result<Samples> {
    let (count, bytes) = data_size(source, place, layout, options)?;
    if parts == 0 || count % parts != 0 {
        return Err(source.error(place, format!("{count} samples do not divide into {parts} files")));
    }
    let mut samples = Samples::none(layout.kind, layout.pick);
    for i in 0..parts {
        let share = Share { count: count / parts, bytes: bytes / num::wide(parts) };
        let part = part(i)?;
        share.check(&part, layout)?;
        if i == 0 {
            // The first file is large enough for its share, which bounds the allocation; the others must be as large.
            let full = |_| source.error(place, format!("{count} samples: memory is full"));
            samples.reserve(count).map_err(full)?;
        }
        share.read(&part, layout, &mut samples)?;
    }
    Ok(samples)
}

/// The number and size of the samples in one file.
struct Share {
    count: usize,
    bytes: u64,
}

impl Share {
    fn wanted(&self, layout: &Layout) -> String {
        let [x, y, z] = layout.dims;
        let all = if layout.components == 1 {
            format!("{x} x {y} x {z} samples")
        } else {
            format!("{x} x {y} x {z} samples of {} components", layout.components)
        };
        format!("{} bytes for {} of {all} of type {}", self.bytes, self.count, layout.kind.name())
    }

    /// Checks that the file can hold its share, before memory is allocated.
    fn check(&self, part: &Part, layout: &Layout) -> Result<()> {
        let source = &part.source;
        let stored = source.len().saturating_sub(part.offset);
        let end = part.skip.checked_add(self.bytes);
        let end = end.ok_or_else(|| source.error("data", format!("skips {} bytes: overflows", part.skip)))?;
        let most = part.encoding.most(stored);
        if part.text {
            let numbers = text::most_numbers(most);
            let wanted = self.bytes / layout.kind.bytes();
            if wanted > numbers {
                return Err(source.error(
                    "data",
                    format!("needs {wanted} numbers: {stored} bytes hold at most {numbers}"),
                ));
            }
        } else if part.encoding != Encoding::Raw {
            if end > most {
                return Err(source.error(
                    "data",
                    format!("needs {}: {stored} compressed bytes hold at most {most}", self.wanted(layout)),
                ));
            }
        } else if end != stored {
            return Err(source.error(
                format!("data at byte {}", part.offset.saturating_add(part.skip)),
                format!("needs {}: {} are there", self.wanted(layout), stored.saturating_sub(part.skip)),
            ));
        }
        Ok(())
    }

    fn read(&self, part: &Part, layout: &Layout, samples: &mut Samples) -> Result<()> {
        let source = &part.source;
        let packed = source.reader(part.offset, part.encoding);
        let most = part.encoding.most(source.len().saturating_sub(part.offset));
        let mut scanner = Scanner::of(source, packed, most);
        scanner.skip(part.skip)?;
        if part.text {
            // The scanner converts text to little-endian bytes.
            let words = Layout { endian: Endian::Little, ..*layout };
            append(&mut scanner.numbers(layout.kind), self.count, &words, samples)
                .map_err(|error| self.describe(error, 0, part, layout))?;
            return match scanner.word()?.map(text::shown) {
                Some(word) => Err(scanner.error(format!("\"{word}\": more numbers than announced"))),
                None => Ok(()),
            };
        }
        let begin = scanner.position();
        append(&mut scanner, self.count, layout, samples)
            .map_err(|error| self.describe(error, scanner.position() - begin, part, layout))?;
        // Reading one more byte detects excess data, and makes gzip verify its checksum.
        let mut more = [0_u8];
        match scanner.read(&mut more) {
            Ok(0) => Ok(()),
            Ok(_) => {
                Err(source.error("data", format!("needs {}: the stream holds more", self.wanted(layout))))
            }
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                Err(source
                    .error("data", format!("{} stream ends before its check sum", part.encoding.name())))
            }
            Err(error) => Err(self.describe(error, self.bytes, part, layout)),
        }
    }

    fn describe(&self, error: std::io::Error, got: u64, part: &Part, layout: &Layout) -> Error {
        let source = &part.source;
        match error.kind() {
            ErrorKind::UnexpectedEof if part.text => source
                .error("data", format!("needs {} numbers: there are fewer", self.count * layout.components)),
            ErrorKind::UnexpectedEof => {
                source.error("data", format!("needs {}: ends after {got}", self.wanted(layout)))
            }
            ErrorKind::InvalidData | ErrorKind::InvalidInput => source.error(
                "data",
                format!("{} stream is damaged after {got} unpacked bytes: {error}", part.encoding.name()),
            ),
            _ => source.io_error(error),
        }
    }
}
