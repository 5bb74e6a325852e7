//! The header: elements and their properties.

use std::collections::HashSet;

use crate::error::Result;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::{self, shown};

/// The limit on the length of the header, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// The limit on the length of a property name, in bytes.
const MAX_NAME: usize = 256;

/// Whether a file begins with the magic of PLY.
pub(crate) fn recognises(source: &Source) -> bool {
    source.head().strip_prefix(b"ply").is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace))
}

pub(crate) struct Property {
    pub(crate) name: String,
    /// The type of the number, or of the entries of a list.
    pub(crate) kind: SampleType,
    /// The type of the length, for a list.
    pub(crate) list: Option<SampleType>,
}

pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) count: u64,
    pub(crate) properties: Vec<Property>,
}

impl Element {
    /// Returns the size of an element in binary, in bytes; the least size if it has lists.
    pub(crate) fn bytes(&self) -> u64 {
        self.properties.iter().map(|property| property.list.unwrap_or(property.kind).bytes()).sum()
    }

    pub(crate) fn has_lists(&self) -> bool {
        self.properties.iter().any(|property| property.list.is_some())
    }
}

pub(crate) struct Header {
    /// The byte order; None for text.
    pub(crate) binary: Option<Endian>,
    pub(crate) elements: Vec<Element>,
    /// The texts of comments.
    pub(crate) comments: Vec<String>,
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

/// The lines of a header that have been read.
#[derive(Default)]
struct Lines {
    /// The byte order, as in [`Header`], once it is known.
    format: Option<Option<Endian>>,
    elements: Vec<Element>,
    comments: Vec<String>,
    /// Names of elements, and of properties of the last element.
    names: HashSet<String>,
    properties: HashSet<String>,
}

impl Lines {
    /// Adds a line. True at the end of the header.
    ///
    /// # Errors
    ///
    /// The rule that the line breaks.
    fn add(&mut self, line: &str) -> std::result::Result<bool, String> {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        if let Some(name) = words.last().filter(|name| name.len() > MAX_NAME && words[0] == "property") {
            return Err(format!("a name of {} bytes: must be at most {MAX_NAME}", name.len()));
        }
        match *words.as_slice() {
            [] | ["obj_info", ..] => {}
            ["comment", ..] => {
                self.comments
                    .extend(line.trim_start().strip_prefix("comment").map(|text| text.trim().to_owned()));
            }
            ["end_header"] => return Ok(true),
            ["format", name, version] => {
                let binary = match name {
                    "ascii" => None,
                    "binary_little_endian" => Some(Endian::Little),
                    "binary_big_endian" => Some(Endian::Big),
                    _ => return Err("must be ascii, binary_little_endian or binary_big_endian".to_owned()),
                };
                if version != "1.0" {
                    return Err("the version must be 1.0".to_owned());
                }
                if self.format.replace(binary).is_some() {
                    return Err("a second format".to_owned());
                }
            }
            ["element", name, count] => {
                let Ok(count) = count.parse() else { return Err("must end in a count".to_owned()) };
                if !self.names.insert(name.to_owned()) {
                    return Err("a second element of this name".to_owned());
                }
                self.properties.clear();
                self.elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", .., name] if matches!(words.len(), 3 | 5) => self.property(&words, name)?,
            _ => {
                return Err("must be format, element, property, comment, obj_info or end_header".to_owned());
            }
        }
        Ok(false)
    }

    /// Adds a property to the last element.
    fn property(&mut self, words: &[&str], name: &str) -> std::result::Result<(), String> {
        let Some(element) = self.elements.last_mut() else { return Err("belongs to no element".to_owned()) };
        let known =
            |name: &str| sample_type(name).ok_or_else(|| format!("\"{}\" is not a type", shown(name)));
        let (kind, list) = match *words {
            [_, "list", length, kind, _] => {
                let kind = known(kind)?;
                let whole =
                    sample_type(length).filter(|kind| !matches!(kind, SampleType::F32 | SampleType::F64));
                let rule = || format!("\"{}\" is not a type of a length", shown(length));
                (kind, Some(whole.ok_or_else(rule)?))
            }
            [_, kind, _] => (known(kind)?, None),
            _ => return Err("must be a type and a name, or a list".to_owned()),
        };
        if !self.properties.insert(name.to_owned()) {
            return Err("a second property of this name".to_owned());
        }
        element.properties.push(Property { name: text::plain(name), kind, list });
        Ok(())
    }
}

impl Header {
    pub(crate) fn read(scanner: &mut Scanner) -> Result<Self> {
        let first = scanner.next_line()?.unwrap_or_default();
        if first.trim_end() != "ply" {
            return Err(scanner.line_error(format!("\"{}\": must be ply and a line feed", shown(&first))));
        }
        let mut lines = Lines::default();
        loop {
            if scanner.position() > MAX_HEADER {
                return Err(scanner.error(format!("header longer than {MAX_HEADER} bytes")));
            }
            let Some(line) = scanner.next_line()? else {
                return Err(scanner.error("ends before end_header"));
            };
            let wrong = |rule| scanner.line_error(format!("\"{}\": {rule}", shown(line.trim())));
            if lines.add(&line).map_err(wrong)? {
                break;
            }
        }
        match lines.format {
            Some(binary) => Ok(Self { binary, elements: lines.elements, comments: lines.comments }),
            None => Err(scanner.source().error("header", "has no format")),
        }
    }

    /// Returns the index of the element `vertex`, and those of its properties `x`, `y` and `z`.
    pub(crate) fn vertex(&self, source: &Source) -> Result<(usize, [usize; 3])> {
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
}
