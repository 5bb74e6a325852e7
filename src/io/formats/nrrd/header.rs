//! Fields of the header, sample type, encoding and byte order.

use glam::DVec3;

use crate::error::Result;
use crate::io::file::fields::Fields;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::source::{Encoding, Source};
use crate::io::file::text;
use crate::num;

/// The limit on the length of the header, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// Every field of the format, by its canonical name.
const FIELDS: &str = "axis maxs, axis mins, block size, byte skip, centers, content, data file, dimension, encoding, \
    endian, kinds, labels, line skip, max, measurement frame, min, number, old max, old min, sample units, sizes, space, \
    space dimension, space directions, space origin, space units, spacings, thicknesses, type, units";

pub(crate) struct Header<'a> {
    source: &'a Source,
    pub(crate) fields: Fields<'a>,
    /// The file names after `data file: LIST`.
    pub(crate) names: Vec<String>,
    /// The offset of attached data.
    pub(crate) end: u64,
}

impl<'a> Header<'a> {
    pub(crate) fn read(source: &'a Source) -> Result<Self> {
        let bytes = source.bytes(0, source.len().min(MAX_HEADER))?;
        let fields = Fields::new(source, "NRRD");
        let mut header = Self { source, fields, names: Vec::new(), end: source.len() };
        let mut at = 0;
        let mut complete = false;
        let mut list = false;
        for (number, line) in bytes.split_inclusive(|&byte| byte == b'\n').enumerate() {
            at += line.len();
            let ended = line.ends_with(b"\n");
            let text = String::from_utf8_lossy(line);
            let text = text.trim_end_matches(['\n', '\r']);
            let place = format!("line {}", number + 1);
            if number == 0 {
                let version = text.strip_prefix("NRRD000").and_then(|version| version.parse::<u8>().ok());
                if !version.is_some_and(|version| (1..=6).contains(&version)) {
                    let shown: String = text.chars().take(16).collect();
                    return Err(source.error(place, format!("\"{shown}\": must be NRRD0001 to NRRD0006")));
                }
            } else if text.is_empty() && ended {
                complete = true;
                break;
            } else if list {
                header.names.push(text.trim().to_owned());
            } else if !text.starts_with('#') {
                header.field(number + 1, text)?;
                // Checked only after fields, because a list may have many lines.
                let files = header.fields.get("data file").unwrap_or_default();
                list = files.split_whitespace().next() == Some("LIST");
            }
        }
        header.end = num::wide(at);
        // A detached header may end with the file; attached data needs an empty line before it.
        if !complete && (header.fields.get("data file").is_none() || source.len() > MAX_HEADER) {
            let length = bytes.len();
            let rule = format!("no empty line ends it within {length} bytes, and no data file is named");
            return Err(source.error("header", rule));
        }
        Ok(header)
    }

    fn field(&mut self, number: usize, text: &str) -> Result<()> {
        let place = || format!("line {number}");
        let shown = || text.chars().take(40).collect::<String>();
        let Some((key, value)) = text.split_once(':') else {
            return Err(self.source.error(place(), format!("\"{}\": must be \"field: value\"", shown())));
        };
        if value.starts_with('=') {
            return Ok(()); // a key/value pair, free for the writer's use
        }
        let key = key.trim().to_lowercase();
        // Canonical names may come without their blank.
        let is = |name: &&str| *name == key || name.replace(' ', "") == key;
        let name = if key == "centerings" { Some("centers") } else { FIELDS.split(", ").find(is) };
        let Some(name) = name else {
            return Err(self.source.error(place(), format!("\"{}\": no such field in NRRD", shown())));
        };
        self.fields.add(number, name, value.trim())
    }

    pub(crate) fn sample_type(&self) -> Result<SampleType> {
        let text = self.fields.required("type")?;
        Ok(match text.to_lowercase().split_whitespace().collect::<Vec<_>>().join(" ").as_str() {
            "signed char" | "int8" | "int8_t" => SampleType::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => SampleType::U8,
            "short" | "short int" | "signed short" | "signed short int" => SampleType::I16,
            "int16" | "int16_t" => SampleType::I16,
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => SampleType::U16,
            "int" | "signed int" | "int32" | "int32_t" => SampleType::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => SampleType::U32,
            "longlong" | "long long" | "long long int" => SampleType::I64,
            "signed long long" | "signed long long int" | "int64" | "int64_t" => SampleType::I64,
            "ulonglong" | "unsigned long long" | "unsigned long long int" => SampleType::U64,
            "uint64" | "uint64_t" => SampleType::U64,
            "float" => SampleType::F32,
            "double" => SampleType::F64,
            _ => {
                let shown = text::shown(text);
                let rule =
                    format!("\"{shown}\": integers of 8, 16, 32 and 64 bits, float and double are supported");
                return Err(self.fields.error("type", rule));
            }
        })
    }

    /// Returns the compression of the numbers; None for text.
    pub(crate) fn packing(&self) -> Result<Option<Encoding>> {
        match self.fields.required("encoding")?.to_lowercase().as_str() {
            "raw" => Ok(Some(Encoding::Raw)),
            "gzip" | "gz" => Ok(Some(Encoding::Gzip)),
            "ascii" | "text" | "txt" => Ok(None),
            other => {
                let rule = format!("\"{}\": raw and gzip are supported, and ascii", text::shown(other));
                Err(self.fields.error("encoding", rule))
            }
        }
    }

    pub(crate) fn endian(&self, kind: SampleType, packing: Option<Encoding>) -> Result<Endian> {
        match self.fields.get("endian").map(str::to_lowercase).as_deref() {
            Some("little") => Ok(Endian::Little),
            Some("big") => Ok(Endian::Big),
            Some(other) => {
                Err(self.fields.error("endian", format!("\"{}\": must be little or big", text::shown(other))))
            }
            None if kind.bytes() == 1 || packing.is_none() => Ok(Endian::Little),
            None => Err(self.fields.error("endian", format!("missing: {} samples need it", kind.name()))),
        }
    }

    /// Returns one vector or `none` per axis, if the file gives directions.
    pub(crate) fn directions(&self, rank: usize) -> Result<Option<Vec<Option<DVec3>>>> {
        let Some(text) = self.fields.get("space directions") else { return Ok(None) };
        let vectors = self.vectors("space directions", text)?;
        if vectors.len() != rank {
            let rule = format!("{} vectors: must be {rank}", vectors.len());
            return Err(self.fields.error("space directions", rule));
        }
        Ok(Some(vectors))
    }

    /// Parses vectors such as `(a,b,c) none (d,e,f)`, with blanks anywhere.
    pub(crate) fn vectors(&self, name: &str, text: &str) -> Result<Vec<Option<DVec3>>> {
        let broken =
            || self.fields.error(name, format!("\"{}\": must be vectors like (1,0,0)", text::shown(text)));
        let mut vectors = Vec::new();
        let mut rest = text.trim();
        while !rest.is_empty() {
            if let Some((word, after)) = rest.split_at_checked(4)
                && word.eq_ignore_ascii_case("none")
            {
                vectors.push(None);
                rest = after.trim_start();
                continue;
            }
            let inner = rest.strip_prefix('(').ok_or_else(broken)?;
            let (inner, after) = inner.split_once(')').ok_or_else(broken)?;
            let numbers: Vec<Option<f64>> = inner.split(',').map(|word| word.trim().parse().ok()).collect();
            let &[Some(x), Some(y), Some(z)] = numbers.as_slice() else { return Err(broken()) };
            vectors.push(Some(DVec3::new(x, y, z)));
            rest = after.trim_start();
        }
        Ok(vectors)
    }
}
