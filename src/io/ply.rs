//! PLY points (`.ply`), in words or binary of either byte order.
//!
//! The element `vertex` is read, with its properties `x`, `y`, `z` of any type; further properties that are
//! numbers are arrays, and together as [`super::columns`] says: `nx ny nz` are `normal`, `red green blue`
//! are `colour`, `scale_0 scale_1 scale_2` are `scale`. Properties that are lists, faces and other elements
//! are passed over, yet must be there as announced. In words, each vertex is a line. Of surfaces [`faces`] are read.

pub(super) mod faces;

use std::io::{ErrorKind, Read};

use glam::DVec3;

use super::arrays::Pick;
use super::columns::{self, Column};
use super::dataset::{self, Origin};
use super::samples::{Endian, SampleType};
use super::source::{Budget, Source};
use super::text::{self, Scanner, shown};
use super::{Loaded, ReadOptions, Reader};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::Samples;

pub(super) struct Ply;

/// Longest header, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// Longest name of a property, in bytes.
const MAX_NAME: usize = 256;

impl Reader for Ply {
    fn name(&self) -> &'static str {
        "PLY"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["ply", "ply.gz"]
    }

    fn recognises(&self, source: &Source) -> bool {
        recognises(source)
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let mut budget = Budget::new(source, options);
        let mut scanner = Scanner::new(source);
        let header = Header::read(&mut scanner)?;
        let (place, axes) = header.vertex(source)?;
        let vertex = &header.elements[place];

        for element in &header.elements[..place] {
            header.pass(&mut scanner, element)?;
        }
        let begin = (scanner.position(), scanner.lines());
        header.holds(&scanner, vertex)?;
        let count = text::index(source, "element vertex", vertex.count)?;
        budget.take("points", vertex.count.saturating_mul(24))?;
        let mut points = Vec::new();
        points.try_reserve_exact(count).map_err(|_| source.error("points", "memory is full"))?;
        header.each(&mut scanner, vertex, &axes, &mut |xyz| {
            if let [x, y, z] = *xyz {
                points.push(DVec3::new(x, y, z));
            }
        })?;
        for element in &header.elements[place + 1..] {
            header.pass(&mut scanner, element)?;
        }
        header.end(&mut scanner)?;

        let mut notes = Vec::new();
        for element in header.elements.iter().filter(|element| element.name != "vertex" && element.count > 0)
        {
            let (count, name) = (element.count, shown(&element.name));
            notes.push(if name == "face" {
                format!("{count} faces left out: points are read")
            } else {
                format!("{count} elements \"{name}\" left out")
            });
        }
        let scalars: Vec<usize> = (0..vertex.properties.len())
            .filter(|place| !axes.contains(place) && vertex.properties[*place].list.is_none())
            .collect();
        for property in vertex.properties.iter().filter(|property| property.list.is_some()) {
            notes.push(format!("property \"{}\": a list, left out", shown(&property.name)));
        }
        let column = |place: &usize| {
            let Property { name, kind, .. } = &vertex.properties[*place];
            Column { name: name.clone(), kind: *kind }
        };
        let groups = columns::groups(&scalars.iter().map(column).collect::<Vec<_>>());
        let arrays = groups.iter().map(|group| group.info.clone()).collect();
        let mut read = |index: usize, pick: Pick| -> Result<Samples> {
            let wanted: Vec<usize> = groups[index].needed(pick).iter().map(|&i| scalars[i]).collect();
            let mut scanner = Scanner::resume(source, begin.0, begin.1)?;
            let mut values = Vec::with_capacity(count);
            header.each(&mut scanner, vertex, &wanted, &mut |numbers| {
                values.push(num::f32_of(columns::value(numbers, pick)));
            })?;
            Ok(Samples::F32(values))
        };
        let origin = Origin { source, format: self.name(), arrays };
        let mut loaded = dataset::points(points, origin, &mut budget, &mut read, options)?;
        loaded.report.notes.splice(0..0, notes);
        Ok(loaded)
    }
}

/// Whether a file begins as PLY does.
pub(super) fn recognises(source: &Source) -> bool {
    source.head().strip_prefix(b"ply").is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace))
}

struct Property {
    name: String,
    /// Of a number, or of each of a list.
    kind: SampleType,
    /// Of a list's length.
    list: Option<SampleType>,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

impl Element {
    /// Bytes of one in binary; at least, where there are lists.
    fn bytes(&self) -> u64 {
        self.properties.iter().map(|property| property.list.unwrap_or(property.kind).bytes()).sum()
    }

    fn has_lists(&self) -> bool {
        self.properties.iter().any(|property| property.list.is_some())
    }
}

struct Header {
    /// The byte order; None: numbers are words.
    binary: Option<Endian>,
    elements: Vec<Element>,
}

fn sample_type(name: &str) -> Option<SampleType> {
    Some(match name {
        "char" | "int8" => SampleType::I8,
        "uchar" | "uint8" => SampleType::U8,
        "short" | "int16" => SampleType::I16,
        "ushort" | "uint16" => SampleType::U16,
        "int" | "int32" => SampleType::I32,
        "uint" | "uint32" => SampleType::U32,
        "int64" => SampleType::I64,
        "uint64" => SampleType::U64,
        "float" | "float32" => SampleType::F32,
        "double" | "float64" => SampleType::F64,
        _ => return None,
    })
}

impl Header {
    fn read(scanner: &mut Scanner) -> Result<Self> {
        let first = scanner.next_line()?.unwrap_or_default();
        if first.trim_end() != "ply" {
            return Err(scanner.line_error(format!("\"{}\": must be ply and a line feed", shown(&first))));
        }
        let mut format = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut names = std::collections::HashSet::new();
        let mut properties = std::collections::HashSet::new();
        loop {
            if scanner.position() > MAX_HEADER {
                return Err(scanner.error(format!("header longer than {MAX_HEADER} bytes")));
            }
            let Some(line) = scanner.next_line()? else {
                return Err(scanner.error("ends before end_header"));
            };
            let wrong = |rule: String| Err(scanner.line_error(format!("\"{}\": {rule}", shown(line.trim()))));
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            if let Some(name) = words.last().filter(|name| name.len() > MAX_NAME && words[0] == "property") {
                return wrong(format!("a name of {} bytes: must be at most {MAX_NAME}", name.len()));
            }
            match *words.as_slice() {
                [] | ["comment" | "obj_info", ..] => {}
                ["end_header"] => break,
                ["format", name, version] => {
                    let binary = match name {
                        "ascii" => None,
                        "binary_little_endian" => Some(Endian::Little),
                        "binary_big_endian" => Some(Endian::Big),
                        _ => {
                            let rule = "must be ascii, binary_little_endian or binary_big_endian";
                            return wrong(rule.to_owned());
                        }
                    };
                    if version != "1.0" {
                        return wrong("the version must be 1.0".to_owned());
                    }
                    if format.replace(binary).is_some() {
                        return wrong("a second format".to_owned());
                    }
                }
                ["element", name, count] => {
                    let Ok(count) = count.parse() else {
                        return wrong("must end in a count".to_owned());
                    };
                    if !names.insert(name.to_owned()) {
                        return wrong("a second element of this name".to_owned());
                    }
                    properties.clear();
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", .., name] if matches!(words.len(), 3 | 5) => {
                    let Some(element) = elements.last_mut() else {
                        return wrong("belongs to no element".to_owned());
                    };
                    let (kind, list) = match *words.as_slice() {
                        [_, "list", length, kind, _] => (kind, Some(length)),
                        [_, kind, _] => (kind, None),
                        _ => return wrong("must be a type and a name, or a list".to_owned()),
                    };
                    let Some(kind) = sample_type(kind) else {
                        return wrong(format!("\"{}\" is no type", shown(kind)));
                    };
                    let list = match list.map(|length| (length, sample_type(length))) {
                        None => None,
                        Some((_, Some(length))) if !matches!(length, SampleType::F32 | SampleType::F64) => {
                            Some(length)
                        }
                        Some((length, _)) => {
                            return wrong(format!("\"{}\" is no type of a length", shown(length)));
                        }
                    };
                    if !properties.insert(name.to_owned()) {
                        return wrong("a second property of this name".to_owned());
                    }
                    element.properties.push(Property { name: text::plain(name), kind, list });
                }
                _ => {
                    let rule = "must be format, element, property, comment, obj_info or end_header";
                    return wrong(rule.to_owned());
                }
            }
        }
        match format {
            Some(binary) => Ok(Self { binary, elements }),
            None => Err(scanner.source().error("header", "has no format")),
        }
    }

    /// The place of the element `vertex`, and those of `x`, `y` and `z` in it.
    fn vertex(&self, source: &Source) -> Result<(usize, [usize; 3])> {
        let Some(place) = self.elements.iter().position(|element| element.name == "vertex") else {
            let names: Vec<&str> =
                self.elements.iter().take(16).map(|element| element.name.as_str()).collect();
            let rule = format!("none: elements are {}", shown(&names.join(", ")));
            return Err(source.error("element vertex", rule));
        };
        let mut axes = [0; 3];
        for (axis, name) in axes.iter_mut().zip(["x", "y", "z"]) {
            let vertex = &self.elements[place];
            let found = vertex.properties.iter().position(|p| p.name == name && p.list.is_none());
            *axis = found.ok_or_else(|| {
                source.error("element vertex", format!("has no property \"{name}\" that is a number"))
            })?;
        }
        Ok((place, axes))
    }

    /// Whether so many elements can follow, before memory is taken for them.
    fn holds(&self, scanner: &Scanner, element: &Element) -> Result<()> {
        let available = scanner.available();
        let least = match self.binary {
            Some(_) => element.count.checked_mul(element.bytes()),
            // A digit and a blank each; the last needs no blank.
            None => u64::try_from(element.properties.len()).ok().and_then(|words| {
                element.count.checked_mul(words)?.checked_mul(2)?.checked_sub(1).or(Some(0))
            }),
        };
        if least.is_some_and(|least| least <= available) {
            return Ok(());
        }
        let (count, name) = (element.count, shown(&element.name));
        let rule = format!("{count}: the {available} bytes that follow cannot hold them");
        Err(scanner.source().error(format!("element {name}"), rule))
    }

    /// Reads elements, and hands out of each the numbers of the properties that are wanted, in that order.
    fn each(
        &self,
        scanner: &mut Scanner,
        element: &Element,
        wanted: &[usize],
        sink: &mut dyn FnMut(&[f64]),
    ) -> Result<()> {
        // Where each property goes.
        let mut slots = vec![None; element.properties.len()];
        for (slot, &property) in wanted.iter().enumerate() {
            slots[property] = Some(slot);
        }
        let mut numbers = vec![0.0; wanted.len()];
        match self.binary {
            None => {
                for i in 0..element.count {
                    let Some(line) = scanner.full_line()? else {
                        let rule = format!("ends after {i} of {} {}", element.count, shown(&element.name));
                        return Err(scanner.error(rule));
                    };
                    row(scanner, element, &line, &slots, &mut numbers)?;
                    sink(&numbers);
                }
            }
            Some(endian) if element.has_lists() => {
                for i in 0..element.count {
                    for (property, slot) in element.properties.iter().zip(&slots) {
                        if let Some(length) = property.list {
                            pass_list(scanner, property, length, endian)
                                .map_err(|e| ended(scanner.source(), element, i, e))?;
                            continue;
                        }
                        let number = number(scanner, property.kind, endian)
                            .map_err(|e| ended(scanner.source(), element, i, e))?;
                        if let Some(slot) = *slot {
                            numbers[slot] = number;
                        }
                    }
                    sink(&numbers);
                }
            }
            Some(endian) => {
                // Where each number that is wanted lies.
                let (mut places, mut stride) = (Vec::new(), 0);
                for (property, slot) in element.properties.iter().zip(&slots) {
                    let bytes = usize::try_from(property.kind.bytes()).unwrap_or(8);
                    places.extend(slot.map(|slot| (slot, stride..stride + bytes, property.kind)));
                    stride += bytes;
                }
                let rows = (BLOCK / stride.max(1)).max(1);
                let mut block = vec![0; rows * stride];
                let mut done = 0;
                while done < element.count {
                    let left = usize::try_from(element.count - done).unwrap_or(usize::MAX);
                    let block = &mut block[..rows.min(left) * stride];
                    scanner.read_exact(block).map_err(|e| ended(scanner.source(), element, done, e))?;
                    for row in block.chunks_exact(stride.max(1)) {
                        for (slot, place, kind) in &places {
                            numbers[*slot] = decode(&row[place.clone()], *kind, endian);
                        }
                        sink(&numbers);
                    }
                    done += u64::try_from(rows.min(left)).unwrap_or(u64::MAX);
                }
            }
        }
        Ok(())
    }

    /// Passes over elements, which must be there.
    fn pass(&self, scanner: &mut Scanner, element: &Element) -> Result<()> {
        self.holds(scanner, element)?;
        if element.properties.is_empty() {
            return Ok(());
        }
        match self.binary {
            Some(_) if !element.has_lists() => scanner.skip(element.count.saturating_mul(element.bytes())),
            Some(_) => self.each(scanner, element, &[], &mut |_| {}),
            // Lines of long lists may be longer than a line may be elsewhere.
            None => {
                for _ in 0..element.count {
                    for property in &element.properties {
                        let words: u64 = match property.list {
                            Some(_) => scanner.number("the length of a list")?,
                            None => 1,
                        };
                        for _ in 0..words {
                            if scanner.word()?.is_none() {
                                let rule = format!("ends before the last {}", shown(&element.name));
                                return Err(scanner.error(rule));
                            }
                        }
                    }
                    scanner.end_line()?;
                }
                Ok(())
            }
        }
    }

    /// Whether nothing is left over.
    fn end(&self, scanner: &mut Scanner) -> Result<()> {
        if self.binary.is_none() {
            return match scanner.word()?.map(shown) {
                Some(word) => Err(scanner.error(format!("\"{word}\": more than the header announces"))),
                None => Ok(()),
            };
        }
        let position = scanner.position();
        let mut more = [0];
        match scanner.read(&mut more) {
            Ok(0) => Ok(()),
            Ok(_) => {
                let rule = "more than the header announces";
                Err(scanner.source().error(format!("byte {position}"), rule))
            }
            Err(error) => Err(text::stream_error(scanner.source(), error)),
        }
    }
}

/// Bytes that are read at once.
const BLOCK: usize = 1 << 16;

/// An error of a stream, with how many elements came before.
fn ended(source: &Source, element: &Element, done: u64, error: std::io::Error) -> Error {
    if error.kind() == ErrorKind::UnexpectedEof {
        let place = format!("element {}", shown(&element.name));
        return source.error(place, format!("ends between {done} and all {}", element.count));
    }
    text::stream_error(source, error)
}

/// A number of `kind.bytes()` bytes.
fn decode(bytes: &[u8], kind: SampleType, endian: Endian) -> f64 {
    macro_rules! number {
        ($type:ty) => {{
            let bytes = bytes.first_chunk().copied().unwrap_or_default();
            match endian {
                Endian::Little => <$type>::from_le_bytes(bytes) as f64,
                Endian::Big => <$type>::from_be_bytes(bytes) as f64,
            }
        }};
    }
    match kind {
        SampleType::U8 => number!(u8),
        SampleType::I8 => number!(i8),
        SampleType::U16 => number!(u16),
        SampleType::I16 => number!(i16),
        SampleType::U32 => number!(u32),
        SampleType::I32 => number!(i32),
        SampleType::U64 => number!(u64),
        SampleType::I64 => number!(i64),
        SampleType::F32 => number!(f32),
        SampleType::F64 => number!(f64),
    }
}

fn number(scanner: &mut Scanner, kind: SampleType, endian: Endian) -> std::io::Result<f64> {
    let mut bytes = [0; 8];
    let bytes = &mut bytes[..usize::try_from(kind.bytes()).unwrap_or(8)];
    scanner.read_exact(bytes)?;
    Ok(decode(bytes, kind, endian))
}

/// The length of a list in binary, whose numbers can follow.
fn list_length(
    scanner: &mut Scanner,
    property: &Property,
    length: SampleType,
    endian: Endian,
) -> std::io::Result<u64> {
    let count = number(scanner, length, endian)?;
    let name = shown(&property.name);
    let place = format!("byte {}", scanner.position());
    let wrong = |rule: String| std::io::Error::other(scanner.source().error(place, rule));
    if count < 0.0 {
        return Err(wrong(format!("property {name}: a list of {count}")));
    }
    let length = num::u64_of(count);
    if length.saturating_mul(property.kind.bytes()) > scanner.available() {
        return Err(wrong(format!("property {name}: a list of {count} is longer than what follows")));
    }
    Ok(length)
}

/// Passes over a list in binary.
fn pass_list(
    scanner: &mut Scanner,
    property: &Property,
    length: SampleType,
    endian: Endian,
) -> std::io::Result<()> {
    let count = list_length(scanner, property, length, endian)?;
    scanner.skip(count * property.kind.bytes()).map_err(std::io::Error::other)
}

/// The numbers that are wanted of a vertex in words.
fn row(
    scanner: &Scanner,
    element: &Element,
    line: &str,
    slots: &[Option<usize>],
    numbers: &mut [f64],
) -> Result<()> {
    let mut words = line.split_ascii_whitespace();
    for (property, slot) in element.properties.iter().zip(slots) {
        let name = || shown(&property.name);
        let mut next = || {
            let rule = || scanner.line_error(format!("ends before property {}", name()));
            words.next().ok_or_else(rule)
        };
        let word = next()?;
        if property.list.is_some() {
            let length: u64 = word.parse().map_err(|_| {
                scanner.line_error(format!("\"{}\": must be the length of list {}", shown(word), name()))
            })?;
            for _ in 0..length {
                next()?;
            }
        } else if let Some(slot) = *slot {
            numbers[slot] = parse(word, property.kind).ok_or_else(|| {
                let kind = property.kind.name();
                scanner.line_error(format!(
                    "\"{}\": property {} must be a number of type {kind}",
                    shown(word),
                    name()
                ))
            })?;
        }
    }
    match words.next() {
        Some(word) => {
            let rule = format!("\"{}\": must not follow here", shown(word));
            Err(scanner.line_error(rule))
        }
        None => Ok(()),
    }
}

/// A number in words, as its type would hold it.
fn parse(word: &str, kind: SampleType) -> Option<f64> {
    fn whole<T: std::str::FromStr + Into<f64>>(word: &str) -> Option<f64> {
        word.parse::<T>().ok().map(Into::into)
    }
    match kind {
        SampleType::U8 => whole::<u8>(word),
        SampleType::I8 => whole::<i8>(word),
        SampleType::U16 => whole::<u16>(word),
        SampleType::I16 => whole::<i16>(word),
        SampleType::U32 => whole::<u32>(word),
        SampleType::I32 => whole::<i32>(word),
        SampleType::U64 => word.parse::<u64>().ok().map(|number| number as f64),
        SampleType::I64 => word.parse::<i64>().ok().map(|number| number as f64),
        SampleType::F32 => text::float::<f32>(word).map(Into::into),
        SampleType::F64 => text::float(word),
    }
}
