//! Keys and values of the header.

use crate::error::Result;
use crate::io::build::volume::Chosen;
use crate::io::file::fields::Fields;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::num;
use crate::scene::Rescale;

/// The limit on the length of the header, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// The keys that are read.
const KEYS: &str = "ObjectType NDims DimSize ElementType ElementDataFile BinaryData BinaryDataByteOrderMSB \
    ElementByteOrderMSB CompressedData CompressedDataSize HeaderSize ElementSpacing ElementSize Offset Position Origin \
    TransformMatrix Rotation Orientation CenterOfRotation AnatomicalOrientation ElementNumberOfChannels \
    ElementToIntensityFunctionSlope ElementToIntensityFunctionOffset";

/// Returns the keys that are read.
pub(crate) fn keys() -> impl Iterator<Item = &'static str> {
    KEYS.split(' ')
}

/// The keys of the map from stored numbers to values.
pub(crate) const SLOPE: &str = "ElementToIntensityFunctionSlope";

const INTERCEPT: &str = "ElementToIntensityFunctionOffset";

/// Splits a line into key and value.
pub(crate) fn pair(line: &str) -> Option<(&str, &str)> {
    let (key, value) = line.split_once(['=', ':'])?;
    Some((key.trim(), value.trim()))
}

pub(crate) struct Header<'a> {
    pub(crate) source: &'a Source,
    pub(crate) fields: Fields<'a>,
    /// Names of data files after the header, if it ends in a list.
    pub(crate) names: Vec<String>,
    /// The offset of attached data.
    pub(crate) end: u64,
    /// The number of axes, 3 or 4.
    pub(crate) rank: usize,
}

impl<'a> Header<'a> {
    pub(crate) fn read(source: &'a Source) -> Result<Self> {
        let bytes = source.bytes(0, source.len().min(MAX_HEADER))?;
        let mut fields = Fields::new(source, "MetaImage");
        let (mut at, mut names) = (0, Vec::new());
        let mut lines = bytes.split_inclusive(|&byte| byte == b'\n').enumerate();
        for (number, line) in lines.by_ref() {
            at += line.len();
            let text = String::from_utf8_lossy(line);
            if text.trim().is_empty() {
                continue;
            }
            let place = || format!("line {}", number + 1);
            let Some((key, value)) = pair(&text) else {
                let rule = format!("\"{}\": must be \"key = value\"", text::shown(text.trim()));
                return Err(source.error(place(), rule));
            };
            if let Some(name) = keys().find(|name| *name == key) {
                fields.add(number + 1, name, value)?;
            } else if let Some(name) = keys().find(|name| name.eq_ignore_ascii_case(key)) {
                return Err(source.error(place(), format!("{key}: must be spelt {name}")));
            }
            if key == "ElementDataFile" {
                break;
            }
        }
        let data = fields.required("ElementDataFile")?.to_owned();
        if !is_local(&data) {
            let list = data.split_whitespace().next() == Some("LIST");
            for (number, line) in lines {
                let line = String::from_utf8_lossy(line);
                match line.trim() {
                    "" => {}
                    line if list => names.push(line.to_owned()),
                    line => {
                        let rule = format!("\"{}\": ElementDataFile must be the last key", text::shown(line));
                        return Err(source.error(format!("line {}", number + 1), rule));
                    }
                }
            }
            if source.len() > MAX_HEADER {
                return Err(source.error("header", format!("longer than {MAX_HEADER} bytes")));
            }
        }
        let end = num::wide(at);
        let mut header = Self { source, fields, names, end, rank: 3 };
        header.rank = header.parse_rank()?;
        Ok(header)
    }

    fn parse_rank(&self) -> Result<usize> {
        if let Some(kind) = self.fields.get("ObjectType").filter(|kind| *kind != "Image") {
            return Err(self.fields.error("ObjectType", format!("\"{kind}\": must be Image")));
        }
        match self.fields.required("NDims")? {
            "3" => Ok(3),
            "4" => Ok(4),
            other => {
                let shown = text::shown(other);
                let rule = format!("\"{shown}\": a volume has 3, or 4 with a last extent of 1");
                Err(self.fields.error("NDims", rule))
            }
        }
    }

    /// Returns the extents, one per axis.
    pub(crate) fn sizes(&self) -> Result<Vec<u32>> {
        let sizes = self.fields.extents("DimSize", "NDims", self.rank)?;
        match sizes.get(3) {
            Some(&last) if last != 1 => {
                let rule = format!("a last extent of {last}: a volume has three axes, a fourth must be 1");
                Err(self.fields.error("DimSize", rule))
            }
            _ => Ok(sizes),
        }
    }

    pub(crate) fn sample_type(&self) -> Result<SampleType> {
        Ok(match self.fields.required("ElementType")? {
            "MET_CHAR" => SampleType::I8,
            "MET_UCHAR" => SampleType::U8,
            "MET_SHORT" => SampleType::I16,
            "MET_USHORT" => SampleType::U16,
            // MET_LONG has four bytes on every machine.
            "MET_INT" | "MET_LONG" => SampleType::I32,
            "MET_UINT" | "MET_ULONG" => SampleType::U32,
            "MET_LONG_LONG" => SampleType::I64,
            "MET_ULONG_LONG" => SampleType::U64,
            "MET_FLOAT" => SampleType::F32,
            "MET_DOUBLE" => SampleType::F64,
            other => {
                let rule = format!(
                    "\"{}\": must be MET_CHAR, MET_SHORT, MET_INT, MET_LONG, MET_LONG_LONG, one of these \
                     with U such as MET_UCHAR, MET_FLOAT or MET_DOUBLE",
                    text::shown(other)
                );
                return Err(self.fields.error("ElementType", rule));
            }
        })
    }

    /// Parses a truth value, if the field exists.
    pub(crate) fn truth(&self, name: &str) -> Result<Option<bool>> {
        let Some(text) = self.fields.get(name) else { return Ok(None) };
        match text.to_ascii_lowercase().as_str() {
            "true" | "t" | "1" => Ok(Some(true)),
            "false" | "f" | "0" => Ok(Some(false)),
            _ => {
                let rule = format!("\"{}\": must be True or False", text::shown(text));
                Err(self.fields.error(name, rule))
            }
        }
    }

    pub(crate) fn endian(&self) -> Result<Endian> {
        let names = ["BinaryDataByteOrderMSB", "ElementByteOrderMSB"];
        let big = match (self.truth(names[0])?, self.truth(names[1])?) {
            (Some(a), Some(b)) if a != b => {
                return Err(self.fields.error(names[1], format!("must not differ from {}", names[0])));
            }
            (a, b) => a.or(b).unwrap_or(false),
        };
        Ok(if big { Endian::Big } else { Endian::Little })
    }

    /// Parses the numbers of a field with alternative names; returns them with the name that the file has, else the
    /// first one.
    pub(crate) fn named<'n>(&self, names: &[&'n str], count: usize) -> Result<(&'n str, Option<Vec<f64>>)> {
        let mut found = (names[0], None);
        for name in names {
            let Some(numbers) = self.fields.numbers(name, count)? else { continue };
            if found.1.as_ref().is_some_and(|others| *others != numbers) {
                return Err(self.fields.error(name, format!("must not differ from {}", found.0)));
            }
            if found.1.is_none() {
                found = (name, Some(numbers));
            }
        }
        Ok(found)
    }

    pub(crate) fn rescale(&self, chosen: &Chosen) -> Result<Rescale> {
        let slope = self.fields.numbers(SLOPE, 1)?.map_or(1.0, |numbers| numbers[0]);
        let intercept = self.fields.numbers(INTERCEPT, 1)?.map_or(0.0, |numbers| numbers[0]);
        chosen.rescale(self.source, INTERCEPT, Rescale { slope, intercept })
    }
}

pub(crate) fn is_local(data: &str) -> bool {
    matches!(data, "LOCAL" | "Local" | "local")
}
