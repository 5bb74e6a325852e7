//! Attributes of an element.

use quick_xml::XmlVersion;
use quick_xml::events::BytesStart;

use crate::error::{Error, Result};
use crate::io::file::source::Source;
use crate::io::file::text::shown;
use crate::io::formats::vtk_xml::document::Extent;

/// The limit on attributes of an element.
const MAX_ATTRIBUTES: usize = 64;

/// Shortens a message of a library to one line.
pub(crate) fn one_line(text: &str) -> String {
    text.chars().take(200).map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The attributes of an element.
pub(crate) struct Attributes<'a> {
    source: &'a Source,
    pub(crate) line: u64,
    element: String,
    list: Vec<(String, String)>,
}

impl<'a> Attributes<'a> {
    /// Reads the attributes of an element; control characters become blanks.
    pub(crate) fn of(source: &'a Source, tag: &BytesStart, line: u64) -> Result<Self> {
        let at = |rule: String| source.error(format!("line {line}"), rule);
        let mut list = Vec::new();
        for attribute in tag.attributes() {
            let wrong = |error: String| at(format!("no XML: attributes: {}", one_line(&error)));
            if list.len() == MAX_ATTRIBUTES {
                return Err(at(format!("more than {MAX_ATTRIBUTES} attributes")));
            }
            let attribute = attribute.map_err(|error| wrong(error.to_string()))?;
            let value = attribute
                .normalized_value(XmlVersion::Implicit1_0)
                .map_err(|error| wrong(error.to_string()))?;
            // Line ends may be given as character references.
            let value = value.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
            list.push((attribute.key.as_ref().to_owned(), value));
        }
        let element: &str = &shown(tag.name().as_ref());
        Ok(Self { source, line, element: element.to_owned(), list })
    }

    pub(crate) fn get(&self, name: &str) -> Option<&str> {
        self.list.iter().find(|(own, _)| own == name).map(|(_, value)| value.as_str())
    }

    pub(crate) fn error(&self, name: &str, rule: impl Into<String>) -> Error {
        self.source.error(format!("line {}, {} {name}", self.line, self.element), rule)
    }

    pub(crate) fn required(&self, name: &str) -> Result<&str> {
        self.get(name).ok_or_else(|| self.error(name, "missing"))
    }

    pub(crate) fn count(&self, name: &str) -> Result<u64> {
        let text = self.required(name)?;
        text.trim()
            .parse()
            .map_err(|_| self.error(name, format!("\"{}\": must be a whole number", shown(text))))
    }

    pub(crate) fn numbers<const N: usize>(&self, name: &str, default: [f64; N]) -> Result<[f64; N]> {
        let Some(text) = self.get(name) else { return Ok(default) };
        crate::io::file::text::floats(text)
            .filter(|numbers| numbers.iter().all(|number| number.is_finite()))
            .ok_or_else(|| self.error(name, format!("\"{}\": must be {N} finite numbers", shown(text))))
    }

    pub(crate) fn extent(&self, name: &str) -> Result<Extent> {
        let text = self.required(name)?;
        let wrong = || self.error(name, format!("\"{}\": must be 6 whole numbers", shown(text)));
        let numbers: Vec<i32> = text
            .split_whitespace()
            .take(7)
            .map(str::parse)
            .collect::<std::result::Result<_, _>>()
            .map_err(|_| wrong())?;
        let &[a, b, c, d, e, f] = numbers.as_slice() else { return Err(wrong()) };
        Ok([[a, b], [c, d], [e, f]].map(|pair| pair.map(i64::from)))
    }
}
