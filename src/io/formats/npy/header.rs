//! The header: a Python dictionary of three known entries, parsed without evaluation.

use crate::error::Result;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::source::Source;
use crate::io::file::text;

pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";

/// The limit on the length of the header, in bytes.
pub(crate) const MAX_HEADER: u64 = 1 << 16;

/// Parses a type such as `<f4`; returns the type, whether it is stored as half precision, and the byte order.
pub(crate) fn number_type(source: &Source, descr: &str) -> Result<(SampleType, bool, Endian)> {
    let (order, name) = match descr.split_at_checked(1) {
        Some((order @ ("<" | ">" | "|" | "="), name)) => (order, name),
        _ => ("=", descr),
    };
    // "=" is the byte order of the writer's machine, which is taken as little-endian.
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

/// A parser of the header, a Python dictionary of three known entries.
pub(crate) struct Literal<'a> {
    pub(crate) source: &'a Source,
    pub(crate) header: &'a str,
    pub(crate) at: usize,
}

impl<'a> Literal<'a> {
    pub(crate) fn header(mut self) -> Result<(String, bool, Vec<u64>)> {
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

    /// Returns the rest after skipping blanks.
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
        let yes = self.take("True");
        if yes || self.take("False") { Ok(yes) } else { Err(self.error("True or False must come here")) }
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
            // Python 2 marks long integers with L.
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
