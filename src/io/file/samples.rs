//! Samples of a grid in one or several files: size checks before memory is allocated, then decoding.

use std::io::{ErrorKind, Read};

use crate::error::{Error, Result};
use crate::io::file::decode::{Layout, Values, append};
use crate::io::file::on_demand::{InFile, PlaneFile, PlaneFiles, Planes};
use crate::io::file::sample_type::{Endian, Pick};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::{Encoding, Source};
use crate::io::file::text;
use crate::io::options::ReadOptions;
use crate::num;
use crate::scene::{OnDemand, Samples};

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
    let wrong = |rule: String| source.error(place, format!("{x} x {y} x {z} {rule}"));
    if let Some(extent) = layout.dims.iter().find(|&&extent| extent < 2) {
        return Err(wrong(format!("has {extent}: every extent must be at least 2")));
    }
    let overflow = || wrong("samples are more than memory can address".to_owned());
    let count = layout.dims.iter().try_fold(1_u64, |n, &extent| n.checked_mul(u64::from(extent)));
    let count = count.ok_or_else(overflow)?;
    let stored = layout.pick.bytes(layout.kind, layout.components);
    let memory = count.checked_mul(stored).ok_or_else(overflow)?;
    if memory > options.max_bytes {
        return Err(wrong(format!("samples take {memory} bytes: the limit is {}", options.max_bytes)));
    }
    let tuple = u64::try_from(layout.components).ok().and_then(|n| n.checked_mul(layout.kind.bytes()));
    let in_file = tuple.and_then(|tuple| count.checked_mul(tuple)).ok_or_else(overflow)?;
    Ok((usize::try_from(count).map_err(|_| overflow())?, in_file))
}

/// Returns the number of samples and their size in the file in bytes, and whether they are as many as the options leave in their file, to be
/// read on demand: the memory limit is not theirs.
pub(crate) fn stays_in_file(
    source: &Source,
    place: &str,
    layout: &Layout,
    options: &ReadOptions,
) -> Result<(usize, u64, bool)> {
    let unlimited = ReadOptions { max_bytes: u64::MAX, ..options.clone() };
    let (count, bytes) = data_size(source, place, layout, &unlimited)?;
    let stays = layout.pick != Pick::Whole && options.on_demand.is_some_and(|least| bytes >= least);
    Ok((count, bytes, stays))
}

/// Reads samples from files that hold equal shares of them and nothing more.
///
/// `source` and `place` are the header and its field, for messages. `part` opens each file when it is needed, so that
/// few files are open at a time, given its index and the size of its share in bytes.
pub(crate) fn read(
    source: &Source,
    place: &str,
    layout: &Layout,
    parts: usize,
    part: &dyn Fn(usize, u64) -> Result<Part>,
    options: &ReadOptions,
) -> Result<Values> {
    if let Some(samples) = on_demand(source, place, layout, parts, part, options)? {
        return Ok(samples);
    }
    let (count, bytes) = data_size(source, place, layout, options)?;
    if parts == 0 || count % parts != 0 {
        return Err(source.error(place, format!("{count} samples do not divide into {parts} files")));
    }
    let (share, bytes) = (count / parts, bytes / num::wide(parts));
    let mut samples = Values::none(layout.kind, layout.components, layout.pick);
    for i in 0..parts {
        let share = Share { part: part(i, bytes)?, layout, count: share, bytes };
        share.check()?;
        if i == 0 {
            // The first file is large enough for its share, which bounds the allocation; the others must be as large.
            let full = |_| source.error(place, format!("{count} samples: memory is full"));
            samples.reserve(count).map_err(full)?;
        }
        share.read(&mut samples)?;
    }
    Ok(samples)
}

/// Returns samples on demand, where they are as many as the options say, uncompressed, and in one file or in files of whole planes.
fn on_demand(
    source: &Source,
    place: &str,
    layout: &Layout,
    parts: usize,
    part: &dyn Fn(usize, u64) -> Result<Part>,
    options: &ReadOptions,
) -> Result<Option<Values>> {
    let (count, bytes, stays) = stays_in_file(source, place, layout, options)?;
    let [depth, shares] = [num::index(layout.dims[2]), parts];
    if !stays || shares == 0 || depth % shares != 0 {
        return Ok(None);
    }
    let bytes = bytes / num::wide(shares);
    let mut files = Vec::new();
    for i in 0..shares {
        let share = Share { part: part(i, bytes)?, layout, count: count / shares, bytes };
        let Part { source, offset, encoding, skip, text } = &share.part;
        if *text || *encoding != Encoding::Raw || shares > 1 && !source.is_on_disk() {
            return Ok(None);
        }
        share.check()?;
        let begin = offset + skip;
        if shares == 1 {
            return in_files(Planes::Joined(source.clone(), begin), layout).map(Some);
        }
        files.push(PlaneFile::new(source, begin));
    }
    in_files(Planes::Files(PlaneFiles::new(files, depth)), layout).map(Some)
}

/// Returns samples that stay in their files, whose overview is read.
pub(crate) fn in_files(planes: Planes, layout: &Layout) -> Result<Values> {
    let samples = InFile { planes, layout: *layout };
    Ok(Samples::OnDemand(OnDemand::new(layout.dims, samples)?).into())
}

/// The samples in one file, their number and size.
struct Share<'a> {
    part: Part,
    layout: &'a Layout,
    count: usize,
    bytes: u64,
}

impl Share<'_> {
    /// Returns the error that the file does not hold the samples, with what it holds.
    fn needs(&self, place: impl Into<String>, held: &str) -> Error {
        let Layout { dims: [x, y, z], components, kind, .. } = *self.layout;
        let tuples = if components == 1 { String::new() } else { format!(" of {components} components") };
        let all = format!("{x} x {y} x {z} samples{tuples} of type {}", kind.name());
        let rule = format!("needs {} bytes for {} of {all}: {held}", self.bytes, self.count);
        self.part.source.error(place, rule)
    }

    /// Checks that the file can hold its share, before memory is allocated.
    fn check(&self) -> Result<()> {
        let Part { source, offset, encoding, skip, text } = &self.part;
        let stored = source.len().saturating_sub(*offset);
        let end = skip.checked_add(self.bytes);
        let end = end.ok_or_else(|| source.error("data", format!("skips {skip} bytes: overflows")))?;
        let most = encoding.most(stored);
        if *text {
            let (numbers, wanted) = (text::most_numbers(most), self.bytes / self.layout.kind.bytes());
            if wanted > numbers {
                let rule = format!("needs {wanted} numbers: {stored} bytes hold at most {numbers}");
                return Err(source.error("data", rule));
            }
        } else if *encoding != Encoding::Raw {
            if end > most {
                return Err(self.needs("data", &format!("{stored} compressed bytes hold at most {most}")));
            }
        } else if end != stored {
            let place = format!("data at byte {}", offset.saturating_add(*skip));
            return Err(self.needs(place, &format!("{} are there", stored.saturating_sub(*skip))));
        }
        Ok(())
    }

    fn read(&self, samples: &mut Values) -> Result<()> {
        let Part { source, offset, encoding, skip, text } = &self.part;
        let most = encoding.most(source.len().saturating_sub(*offset));
        let mut scanner = Scanner::of(source, source.reader(*offset, *encoding), most);
        scanner.skip(*skip)?;
        if *text {
            // The scanner converts text to little-endian bytes.
            let words = Layout { endian: Endian::Little, ..*self.layout };
            append(&mut scanner.numbers(words.kind), self.count, &words, samples)
                .map_err(|error| self.describe(error, 0))?;
            return match scanner.word()?.map(text::shown) {
                Some(word) => Err(scanner.error(format!("\"{word}\": more numbers than announced"))),
                None => Ok(()),
            };
        }
        let begin = scanner.position();
        append(&mut scanner, self.count, self.layout, samples)
            .map_err(|error| self.describe(error, scanner.position() - begin))?;
        // Reading one more byte detects excess data, and makes gzip verify its checksum.
        match scanner.read(&mut [0]) {
            Ok(0) => Ok(()),
            Ok(_) => Err(self.needs("data", "the stream holds more")),
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                Err(source.error("data", format!("{} stream ends before its check sum", encoding.name())))
            }
            Err(error) => Err(self.describe(error, self.bytes)),
        }
    }

    /// Converts an error of the stream; `got` bytes have been decompressed.
    fn describe(&self, error: std::io::Error, got: u64) -> Error {
        let Part { source, encoding, text, .. } = &self.part;
        match error.kind() {
            ErrorKind::UnexpectedEof if *text => {
                let numbers = self.count * self.layout.components;
                source.error("data", format!("needs {numbers} numbers: there are fewer"))
            }
            ErrorKind::UnexpectedEof => self.needs("data", &format!("ends after {got}")),
            ErrorKind::InvalidData | ErrorKind::InvalidInput => source.error(
                "data",
                format!("{} stream is damaged after {got} unpacked bytes: {error}", encoding.name()),
            ),
            _ => source.io_error(error),
        }
    }
}
