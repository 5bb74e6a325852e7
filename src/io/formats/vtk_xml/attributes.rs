//! Attributes of an element.

use std::fmt::Display;

use quick_xml::XmlVersion;
use quick_xml::events::BytesStart;

use crate::error::{Error, Result};
use crate::io::file::source::Source;
use crate::io::file::text::{floats, plain, shown};
use crate::io::formats::vtk_xml::document::Extent;

/// The limit on attributes of an element.
const MAX_ATTRIBUTES: usize = 64;

/// Makes an error of the XML library one of the file, in one short line.
pub(crate) fn no_xml(source: &Source, line: u64, error: impl Display) -> Error {
    let text: String = plain(&error.to_string()).chars().take(200).collect();
    source.error(format!("line {line}"), format!("no XML: {text}"))
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
        let mut list = Vec::new();
        for attribute in tag.attributes() {
            let wrong = |error: &dyn Display| no_xml(source, line, format!("attributes: {error}"));
            if list.len() == MAX_ATTRIBUTES {
                let rule = format!("more than {MAX_ATTRIBUTES} attributes");
                return Err(source.error(format!("line {line}"), rule));
            }
            let attribute = attribute.map_err(|error| wrong(&error))?;
            let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| wrong(&error))?;
            // Line ends may be given as character references.
            list.push((attribute.key.as_ref().to_owned(), plain(&value)));
        }
        Ok(Self { source, line, element: shown(tag.name().as_ref()), list })
    }

    pub(crate) fn get(&self, name: &str) -> Option<&str> {
        self.list.iter().find(|(own, _)| own == name).map(|(_, value)| value.as_str())
    }

    pub(crate) fn error(&self, name: &str, rule: impl Into<String>) -> Error {
        self.source.error(format!("line {}, {} {name}", self.line, self.element), rule)
    }

    /// Returns the error that a value breaks a rule.
    fn wrong(&self, name: &str, value: &str, rule: &str) -> Error {
        self.error(name, format!("\"{}\": {rule}", shown(value)))
    }

    pub(crate) fn required(&self, name: &str) -> Result<&str> {
        self.get(name).ok_or_else(|| self.error(name, "missing"))
    }

    /// Returns what the value of an attribute means; None if the attribute is missing.
    pub(crate) fn choice<T: Copy>(&self, name: &str, known: &[(&str, T)], rule: &str) -> Result<Option<T>> {
        let Some(value) = self.get(name) else { return Ok(None) };
        let found = known.iter().find(|(own, _)| *own == value).map(|(_, meaning)| *meaning);
        found.ok_or_else(|| self.wrong(name, value, rule)).map(Some)
    }

    pub(crate) fn count(&self, name: &str) -> Result<u64> {
        let text = self.required(name)?.trim();
        text.parse().map_err(|_| self.wrong(name, text, "must be a whole number"))
    }

    pub(crate) fn numbers<const N: usize>(&self, name: &str, default: [f64; N]) -> Result<[f64; N]> {
        let Some(text) = self.get(name) else { return Ok(default) };
        let finite = floats(text).filter(|numbers| numbers.iter().all(|number| number.is_finite()));
        finite.ok_or_else(|| self.wrong(name, text, &format!("must be {N} finite numbers")))
    }

    pub(crate) fn extent(&self, name: &str) -> Result<Extent> {
        let text = self.required(name)?;
        let words = text.split_whitespace().take(7);
        let numbers: Option<Vec<i32>> = words.map(|word| word.parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[a, b, c, d, e, f]) => Ok([[a, b], [c, d], [e, f]].map(|pair| pair.map(i64::from))),
            _ => Err(self.wrong(name, text, "must be 6 whole numbers")),
        }
    }
}
