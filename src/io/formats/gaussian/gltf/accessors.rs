//! Buffers, and the numbers that accessors find in them.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use crate::error::{Error, Result};
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::{Encoding, Source};
use crate::io::file::text::shown;
use crate::io::formats::gaussian::gltf::document::{Accessor, Document, Sparse, View};
use crate::io::formats::gaussian::rows::rows;
use crate::io::options::Request;
use crate::num;

/// The greatest distance between elements, in bytes.
const MOST_STRIDE: u64 = 252;

/// Bytes of a file.
#[derive(Clone)]
pub(super) struct Stored {
    pub(super) source: Source,
    pub(super) start: u64,
    pub(super) length: u64,
}

/// The buffers of a file, opened when they are first used.
pub(super) struct Buffers<'a> {
    pub(super) source: &'a Source,
    document: &'a Document,
    binary: Option<Stored>,
    request: &'a Request<'a>,
    open: Vec<Option<Stored>>,
}

/// An accessor with the names of the place that uses it.
#[derive(Clone, Copy)]
pub(super) struct Numbers<'a> {
    pub(super) accessor: &'a Accessor,
    pub(super) index: usize,
    /// Numbers of an element.
    pub(super) components: usize,
    pub(super) kind: SampleType,
}

/// The number of components of a type of elements.
pub(super) fn components(kind: &str) -> Option<usize> {
    match kind {
        "SCALAR" => Some(1),
        "VEC2" => Some(2),
        "VEC3" => Some(3),
        "VEC4" => Some(4),
        _ => None,
    }
}

/// The type of numbers by the code of OpenGL.
pub(super) fn kind_of(code: u32) -> Option<SampleType> {
    match code {
        5120 => Some(SampleType::I8),
        5121 => Some(SampleType::U8),
        5122 => Some(SampleType::I16),
        5123 => Some(SampleType::U16),
        5125 => Some(SampleType::U32),
        5126 => Some(SampleType::F32),
        _ => None,
    }
}

impl<'a> Buffers<'a> {
    pub(super) fn new(
        source: &'a Source,
        document: &'a Document,
        binary: Option<Stored>,
        request: &'a Request<'a>,
    ) -> Self {
        Self { source, document, binary, request, open: document.buffers.iter().map(|_| None).collect() }
    }

    fn view_error(&self, view: usize, rule: impl Into<String>) -> Error {
        self.source.error(format!("bufferViews[{view}]"), rule)
    }

    /// Opens a buffer.
    fn buffer(&mut self, i: usize, budget: &mut Budget) -> Result<Stored> {
        let source = self.source;
        let wrong = |rule: String| source.error(format!("buffers[{i}]"), rule);
        let (Some(buffer), Some(open)) = (self.document.buffers.get(i), self.open.get_mut(i)) else {
            return Err(wrong("there is no such buffer".to_owned()));
        };
        if let Some(stored) = open {
            return Ok(stored.clone());
        }
        let stored = match &buffer.uri {
            None if i == 0 => self
                .binary
                .clone()
                .ok_or_else(|| wrong("has no uri, and there is no binary chunk".to_owned()))?,
            None => return Err(wrong("has no uri".to_owned())),
            Some(uri) => match uri.strip_prefix("data:") {
                Some(data) => {
                    let Some((_, text)) = data.split_once(";base64,") else {
                        return Err(wrong("uri: data must be base64".to_owned()));
                    };
                    budget.take("buffer", num::wide(text.len()))?;
                    let config = GeneralPurposeConfig::new()
                        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
                        .with_decode_allow_trailing_bits(true);
                    let decoded = GeneralPurpose::new(&STANDARD, config).decode(text);
                    let bytes = decoded.map_err(|error| wrong(format!("uri: no base64: {error}")))?;
                    let length = num::wide(bytes.len());
                    Stored { source: Source::unpacked(source.path(), bytes)?, start: 0, length }
                }
                None => {
                    let path = beside(uri).ok_or_else(|| {
                        wrong(format!("uri \"{}\": must be the name of a file beside this one", shown(uri)))
                    })?;
                    let file = source.sibling(&path, self.request)?;
                    Stored { length: file.len(), source: file, start: 0 }
                }
            },
        };
        if buffer.byte_length > stored.length {
            let rule = format!("{} bytes: there are {}", buffer.byte_length, stored.length);
            return Err(wrong(rule));
        }
        Ok(open.insert(Stored { length: buffer.byte_length, ..stored }).clone())
    }

    /// Returns the bytes of a view.
    fn view(&mut self, i: usize, budget: &mut Budget) -> Result<(&'a View, Stored)> {
        let Some(view) = self.document.buffer_views.get(i) else {
            return Err(self.view_error(i, "there is no such view"));
        };
        if view.extensions.meshopt.is_some() || view.extensions.new_meshopt.is_some() {
            return Err(self.view_error(i, "meshopt_compression is not supported"));
        }
        let buffer = self.buffer(view.buffer, budget)?;
        if view.byte_offset.saturating_add(view.byte_length) > buffer.length {
            let rule = format!(
                "{} bytes from byte {}: the buffer has {}",
                view.byte_length, view.byte_offset, buffer.length
            );
            return Err(self.view_error(i, rule));
        }
        Ok((view, Stored { start: buffer.start + view.byte_offset, length: view.byte_length, ..buffer }))
    }

    /// Finds the numbers of an accessor, and checks that the buffers hold them.
    pub(super) fn find(&mut self, numbers: Numbers, budget: &mut Budget) -> Result<Found> {
        let Numbers { accessor, index, .. } = numbers;
        let source = self.source;
        let wrong = |rule: String| source.error(format!("accessors[{index}]"), rule);
        if accessor.buffer_view.is_none() && accessor.sparse.is_none() {
            return Err(wrong("has neither bufferView nor sparse".to_owned()));
        }
        let mut found = Found { all: None, replaced: None };
        if let Some(view) = accessor.buffer_view {
            let (view, stored) = self.view(view, budget)?;
            let range = Range { stored, offset: accessor.byte_offset, stride: view.byte_stride };
            range.check(source, numbers, accessor.count)?;
            found.all = Some(range);
        }
        if let Some(sparse) = &accessor.sparse {
            let Sparse { count, indices, values } = &**sparse;
            if *count > accessor.count {
                return Err(wrong(format!("sparse: {count} elements of {}", accessor.count)));
            }
            let kind = indices.component_type.and_then(kind_of);
            let whole =
                |kind: &SampleType| matches!(kind, SampleType::U8 | SampleType::U16 | SampleType::U32);
            let Some(kind) = kind.filter(whole) else {
                return Err(wrong("sparse: componentType of indices must be 5121, 5123 or 5125".to_owned()));
            };
            let (_, stored) = self.view(indices.buffer_view, budget)?;
            let places = Range { stored, offset: indices.byte_offset, stride: None };
            places.check(source, Numbers { components: 1, kind, ..numbers }, *count)?;
            let (_, stored) = self.view(values.buffer_view, budget)?;
            let values = Range { stored, offset: values.byte_offset, stride: None };
            values.check(source, numbers, *count)?;
            found.replaced = Some((kind, places, values));
        }
        let present: u64 =
            self.open.iter().flatten().map(|stored| stored.length).fold(0, u64::saturating_add);
        if found.all.is_none() && accessor.count > present {
            return Err(wrong(format!("{} elements: the buffers have {present} bytes", accessor.count)));
        }
        Ok(found)
    }

    /// Passes the elements of an accessor on, with their indices. Those without a view are zero, and are left out; those that are
    /// replaced come again.
    pub(super) fn each(
        &mut self,
        numbers: Numbers,
        budget: &mut Budget,
        sink: &mut dyn FnMut(usize, &[f64]),
    ) -> Result<()> {
        let Numbers { accessor, index, .. } = numbers;
        let Found { all, replaced } = self.find(numbers, budget)?;
        if let Some(range) = all {
            range.each(self.source, numbers, accessor.count, accessor.normalized, &mut |i, row| {
                sink(i, row)
            })?;
        }
        let (Some((kind, places, values)), Some(sparse)) = (replaced, &accessor.sparse) else {
            return Ok(());
        };
        budget.take("sparse", sparse.count.saturating_mul(16))?;
        let (mut list, mut last, mut wrong) = (Vec::new(), None, None);
        let own = Numbers { components: 1, kind, ..numbers };
        places.each(self.source, own, sparse.count, false, &mut |_, row| {
            let place = num::u64_of(row[0]);
            if place >= accessor.count || last.is_some_and(|last| place <= last) {
                wrong.get_or_insert(place);
            }
            last = Some(place);
            list.push(usize::try_from(place).unwrap_or(usize::MAX));
        })?;
        if let Some(place) = wrong {
            let rule =
                format!("sparse: index {place} must be below {}, and above the one before", accessor.count);
            return Err(self.source.error(format!("accessors[{index}]"), rule));
        }
        values.each(self.source, numbers, sparse.count, accessor.normalized, &mut |i, row| {
            if let Some(place) = list.get(i) {
                sink(*place, row);
            }
        })?;
        budget.put_back(sparse.count.saturating_mul(16));
        Ok(())
    }
}

/// The places of an accessor's numbers.
pub(super) struct Found {
    /// Those of all elements; without it all are 0.
    all: Option<Range>,
    /// Elements that are replaced: the type and the places of their indices, and of their numbers.
    replaced: Option<(SampleType, Range, Range)>,
}

/// Elements in a view.
struct Range {
    stored: Stored,
    offset: u64,
    stride: Option<u64>,
}

impl Range {
    /// Returns the distance between elements and their size, once they are known to lie in the view.
    fn check(&self, source: &Source, numbers: Numbers, count: u64) -> Result<(u64, u64)> {
        let wrong = |rule: String| source.error(format!("accessors[{}]", numbers.index), rule);
        let size = numbers.kind.bytes() * num::wide(numbers.components);
        let stride = self.stride.unwrap_or(size);
        if stride < size || stride > MOST_STRIDE {
            return Err(wrong(format!("byteStride {stride}: must be {size} to {MOST_STRIDE}")));
        }
        let last = stride.saturating_mul(count.saturating_sub(1)).saturating_add(size);
        let end = if count == 0 { 0 } else { self.offset.saturating_add(last) };
        if end > self.stored.length {
            let rule = format!("{count} elements need {end} bytes: the view has {}", self.stored.length);
            return Err(wrong(rule));
        }
        Ok((stride, size))
    }

    fn each(
        &self,
        source: &Source,
        numbers: Numbers,
        count: u64,
        is_normalised: bool,
        sink: &mut dyn FnMut(usize, &[f64]),
    ) -> Result<()> {
        let (stride, size) = self.check(source, numbers, count)?;
        let Some(before) = count.checked_sub(1) else { return Ok(()) };
        let Stored { source, start, .. } = &self.stored;
        let left = stride.saturating_mul(before) + size;
        let reader = source.reader(start + self.offset, Encoding::Raw);
        let mut scanner = Scanner::of(source, reader, left);
        // No number is greater than that of bytes in a file, or than 252.
        let [before, stride, size] = [before, stride, size].map(|n| usize::try_from(n).unwrap_or(usize::MAX));
        let each = size / numbers.components;
        let mut row = [0.0; 4];
        let row = &mut row[..numbers.components];
        let mut decode = |i: usize, bytes: &[u8]| {
            for (number, bytes) in row.iter_mut().zip(bytes.chunks_exact(each)) {
                *number = decoded(numbers.kind, is_normalised, bytes);
            }
            sink(i, row);
        };
        rows(&mut scanner, before, stride, &mut decode)?;
        // Behind the last one there may be nothing.
        rows(&mut scanner, 1, size, &mut |_, bytes| decode(before, bytes))
    }
}

/// Returns a number of a type, between -1 or 0 and 1 if it is normalised.
fn decoded(kind: SampleType, normalised: bool, bytes: &[u8]) -> f64 {
    let mut little = [0; 4];
    for (to, from) in little.iter_mut().zip(bytes) {
        *to = *from;
    }
    let whole = Endian::Little.whole(bytes);
    let (value, most) = match kind {
        SampleType::F32 => return f32::from_le_bytes(little).into(),
        SampleType::I8 => (f64::from(i8::from_le_bytes([little[0]])), 127.0),
        SampleType::I16 => (f64::from(i16::from_le_bytes([little[0], little[1]])), 32_767.0),
        SampleType::U8 => (num::f64_of_u64(whole), 255.0),
        SampleType::U16 => (num::f64_of_u64(whole), 65_535.0),
        _ => (num::f64_of_u64(whole), f64::from(u32::MAX)),
    };
    if normalised { (value / most).max(-1.0) } else { value }
}

/// Returns the path of a URI that names a file in the folder of this one, or below.
fn beside(uri: &str) -> Option<PathBuf> {
    let decoded = unescaped(uri)?;
    let path = Path::new(&*decoded);
    let plain = !decoded.is_empty()
        && !decoded.contains(['\\', ':', '?', '#', '\0'])
        && path.components().all(|part| matches!(part, Component::Normal(_)));
    plain.then(|| path.to_owned())
}

/// Returns a URI without percent-encoding.
fn unescaped(uri: &str) -> Option<Cow<'_, str>> {
    if !uri.contains('%') {
        return Some(Cow::Borrowed(uri));
    }
    let mut parts = uri.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let (code, rest) = part.split_at_checked(2)?;
        if !code.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return None;
        }
        bytes.push(u8::from_str_radix(code, 16).ok()?);
        bytes.extend_from_slice(rest.as_bytes());
    }
    String::from_utf8(bytes).ok().map(Cow::Owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_normalised_as_the_format_says() {
        for (kind, bytes, plain, normalised) in [
            (SampleType::I8, vec![0x80], -128.0, -1.0),
            (SampleType::I8, vec![127], 127.0, 1.0),
            (SampleType::U8, vec![51], 51.0, 0.2),
            (SampleType::I16, vec![0x01, 0x80], -32_767.0, -1.0),
            (SampleType::U16, vec![255, 255], 65_535.0, 1.0),
            (SampleType::U32, vec![0, 0, 0, 0x80], 2_147_483_648.0, 2_147_483_648.0 / 4_294_967_295.0),
            (SampleType::F32, vec![0, 0, 0xc0, 0x3f], 1.5, 1.5),
        ] {
            assert_eq!(decoded(kind, false, &bytes), plain);
            assert_eq!(decoded(kind, true, &bytes), normalised);
        }
    }

    #[test]
    fn names_of_files_lie_beside() {
        let path = |uri: &str| beside(uri).map(|path| path.to_str().unwrap().to_owned());
        assert_eq!(path("a%20b.bin").as_deref(), Some("a b.bin"));
        assert_eq!(path("data/%c3%a4.bin").as_deref(), Some("data/\u{e4}.bin"));
        for wrong in [
            "../a",
            "%2e%2e/a",
            "/a",
            "%2Fa",
            "http://a/b",
            "file:a",
            "a\\b",
            "",
            "a%2",
            "a%zz",
            "a%+1",
            "%ff",
            "a?b",
        ] {
            assert_eq!(path(wrong), None, "{wrong}");
        }
    }
}
