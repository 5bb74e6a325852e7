//! NRRD, with its data attached (`.nrrd`) or in one other file (`.nhdr`).
//!
//! Three dimensions, encodings raw and gzip. World coordinates are kept as the file has them; where its
//! `space` is an anatomical one the grid says which. A spacing that is not a number is unknown and
//! counts as 1; a negative one turns the axis round. Fields that do not place or scale samples
//! (`content`, `kinds` of spatial axes, `units`, `thicknesses`, `axis mins`, ...) are checked for their
//! names only.

use std::io::Read;
use std::path::Path;

use glam::{DMat3, DVec3};

use super::fields::Fields;
use super::samples::{self, Endian, Layout, Part, SampleType};
use super::source::{Encoding, Source};
use super::{Loaded, ReadOptions, Reader};
use crate::error::{Error, Result};
use crate::scene::{Anatomy, Grid};

pub(super) struct Nrrd;

/// Longest header that is read, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// Every field of the format, under the one name that is used here.
const FIELDS: [&str; 29] = [
    "axis maxs",
    "axis mins",
    "block size",
    "byte skip",
    "centers",
    "content",
    "data file",
    "dimension",
    "encoding",
    "endian",
    "kinds",
    "labels",
    "line skip",
    "max",
    "measurement frame",
    "min",
    "number",
    "old max",
    "old min",
    "sample units",
    "sizes",
    "space",
    "space dimension",
    "space directions",
    "space origin",
    "space units",
    "spacings",
    "thicknesses",
    "type",
];

impl Reader for Nrrd {
    fn name(&self) -> &'static str {
        "NRRD"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["nrrd", "nhdr"]
    }

    fn recognises(&self, source: &Source) -> bool {
        !source.is_gzip() && source.head().starts_with(b"NRRD")
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let header = Header::read(source)?;
        let kind = header.sample_type()?;
        let dims = header.dims()?;
        let endian = header.endian(kind)?;
        let placement = header.placement()?;
        let encoding = match header.required("encoding")?.to_lowercase().as_str() {
            "raw" => Encoding::Raw,
            "gzip" | "gz" => Encoding::Gzip,
            other => {
                return Err(header.error("encoding", format!("\"{other}\": raw and gzip are supported")));
            }
        };

        let (data, start) = match header.get("data file") {
            None => (source.clone(), header.end),
            Some(name) => {
                let several = name == "LIST" || name.starts_with("LIST ") || name.contains('%');
                if name.is_empty() || several {
                    return Err(header.error(
                        "data file",
                        format!("\"{name}\": must name one file; data in several files is not supported"),
                    ));
                }
                (source.sibling(Path::new(name), options)?, 0)
            }
        };
        let lines = header.whole_number("line skip", 0)?;
        let start = skip_lines(&data, start, lines)?;
        let layout = Layout::scalar(dims, kind, endian);
        let skip = match header.whole_number("byte skip", -1)? {
            -1 if encoding != Encoding::Raw => {
                return Err(
                    header.error("byte skip", "-1: only raw data can be found from the end of its file")
                );
            }
            -1 => {
                let (_, bytes) = samples::data_size(source, "sizes", &layout, options)?;
                (data.len() - start).checked_sub(bytes).ok_or_else(|| {
                    data.error("data", format!("needs {bytes} bytes: {} are there", data.len() - start))
                })?
            }
            skip => skip.unsigned_abs(),
        };
        let part = Part { source: data.clone(), offset: start, encoding, skip, text: false };
        let samples = samples::read(source, "sizes", &layout, 1, &|_| Ok(part.clone()), options)?;

        let (place, spacing, origin, direction, anatomy) = placement;
        let grid = Grid::new(dims, samples).map_err(|error| error.in_file(data.path()))?;
        let grid = grid.with_placement(spacing, origin, direction).map_err(|error| match error {
            Error::Invalid { why, .. } => header.error(place, why),
            other => other,
        })?;
        Ok(Loaded::new(self.name(), grid.with_anatomy(anatomy)))
    }
}

/// Where the stream goes on after some lines. They are skipped in the file as it is stored.
fn skip_lines(source: &Source, start: u64, lines: i64) -> Result<u64> {
    let mut left = lines;
    let mut position = start;
    if left == 0 {
        return Ok(start);
    }
    for byte in source.reader(start, Encoding::Raw).bytes() {
        let byte = byte.map_err(|e| Error::io(source.path(), "cannot read", e))?;
        position += 1;
        if byte == b'\n' {
            left -= 1;
            if left == 0 {
                return Ok(position);
            }
        }
    }
    Err(source.error("line skip", format!("{lines}: the data has {} lines", lines - left)))
}

/// The header.
struct Header<'a> {
    source: &'a Source,
    fields: Fields<'a>,
    /// Where attached data begins.
    end: u64,
}

impl<'a> Header<'a> {
    fn read(source: &'a Source) -> Result<Self> {
        let bytes = source.bytes(0, source.len().min(MAX_HEADER))?;
        let mut header = Self { source, fields: Fields::new(source, "NRRD"), end: source.len() };
        let mut at = 0;
        let mut complete = false;
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
            } else if !text.starts_with('#') {
                header.field(number + 1, text)?;
            }
        }
        header.end = u64::try_from(at).unwrap_or(u64::MAX);
        // A detached header may end with its file; attached data needs the empty line.
        if !complete && (header.get("data file").is_none() || source.len() > MAX_HEADER) {
            return Err(source.error(
                "header",
                format!("no empty line ends it within {} bytes, and no data file is named", bytes.len()),
            ));
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
        let key = match key.trim().to_lowercase().as_str() {
            "datafile" => "data file".to_owned(),
            "lineskip" => "line skip".to_owned(),
            "byteskip" => "byte skip".to_owned(),
            "blocksize" => "block size".to_owned(),
            "axismins" => "axis mins".to_owned(),
            "axismaxs" => "axis maxs".to_owned(),
            "centerings" => "centers".to_owned(),
            "oldmin" => "old min".to_owned(),
            "oldmax" => "old max".to_owned(),
            "sampleunits" => "sample units".to_owned(),
            key => key.to_owned(),
        };
        let Some(name) = FIELDS.iter().find(|name| **name == key) else {
            return Err(self.source.error(place(), format!("\"{}\": no such field in NRRD", shown())));
        };
        self.fields.add(number, name, value.trim())
    }

    fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(name)
    }

    fn required(&self, name: &str) -> Result<&str> {
        self.fields.required(name)
    }

    fn error(&self, name: &str, rule: impl Into<String>) -> Error {
        self.fields.error(name, rule)
    }

    fn whole_number(&self, name: &str, least: i64) -> Result<i64> {
        self.fields.whole_number(name, least)
    }

    fn sample_type(&self) -> Result<SampleType> {
        let text = self.required("type")?;
        Ok(match text.to_lowercase().split_whitespace().collect::<Vec<_>>().join(" ").as_str() {
            "signed char" | "int8" | "int8_t" => SampleType::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => SampleType::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
                SampleType::I16
            }
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => SampleType::U16,
            "int" | "signed int" | "int32" | "int32_t" => SampleType::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => SampleType::U32,
            "float" => SampleType::F32,
            "double" => SampleType::F64,
            _ => {
                return Err(self.error(
                    "type",
                    format!("\"{text}\": integers of 8, 16 and 32 bits, float and double are supported"),
                ));
            }
        })
    }

    fn dims(&self) -> Result<[u32; 3]> {
        let dimension = self.required("dimension")?;
        if dimension != "3" {
            return Err(self.error("dimension", format!("{dimension}: a volume has 3")));
        }
        let text = self.required("sizes")?;
        let sizes: Vec<&str> = text.split_whitespace().collect();
        let &[x, y, z] = sizes.as_slice() else {
            return Err(self.error("sizes", format!("{} numbers: dimension 3 needs 3", sizes.len())));
        };
        let size = |text: &str| {
            text.parse::<u32>().ok().filter(|&size| size > 0).ok_or_else(|| {
                self.error("sizes", format!("\"{text}\": must be a whole number from 1 to {}", u32::MAX))
            })
        };
        let spatial = ["domain", "space", "time", "none", "???"];
        let kinds = self.get("kinds").unwrap_or_default();
        let other = kinds.split_whitespace().find(|kind| !spatial.contains(&kind.to_lowercase().as_str()));
        if let Some(kind) = other {
            return Err(
                self.error("kinds", format!("\"{kind}\": all three axes of a volume must be spatial"))
            );
        }
        Ok([size(x)?, size(y)?, size(z)?])
    }

    fn endian(&self, kind: SampleType) -> Result<Endian> {
        match self.get("endian").map(str::to_lowercase).as_deref() {
            Some("little") => Ok(Endian::Little),
            Some("big") => Ok(Endian::Big),
            Some(other) => Err(self.error("endian", format!("\"{other}\": must be little or big"))),
            None if kind.bytes() == 1 => Ok(Endian::Little),
            None => Err(self.error("endian", format!("missing: {} samples need it", kind.name()))),
        }
    }

    /// The field that placed the grid, spacing, origin, direction, and what the world's axes mean.
    fn placement(&self) -> Result<(&'static str, DVec3, DVec3, DMat3, Anatomy)> {
        let anatomy = match self.get("space").map(str::to_lowercase).as_deref() {
            Some("right-anterior-superior" | "ras") => Anatomy::Ras,
            Some("left-anterior-superior" | "las") => Anatomy::Las,
            Some("left-posterior-superior" | "lps") => Anatomy::Lps,
            None | Some("scanner-xyz" | "3d-right-handed" | "3d-left-handed") => Anatomy::Unknown,
            Some(other) => {
                return Err(self.error(
                    "space",
                    format!(
                        "\"{other}\": must be one of right-anterior-superior, left-anterior-superior, \
                         left-posterior-superior, scanner-xyz, 3D-right-handed, 3D-left-handed"
                    ),
                ));
            }
        };
        if let Some(dimension) = self.get("space dimension") {
            if self.get("space").is_some() {
                return Err(self.error("space dimension", "must not be given together with space"));
            }
            if dimension != "3" {
                return Err(self.error("space dimension", format!("{dimension}: a volume lies in 3")));
            }
        }
        let origin = match self.get("space origin") {
            None => DVec3::ZERO,
            Some(text) => match self.vectors("space origin", text)?.as_slice() {
                &[origin] => origin,
                others => {
                    return Err(self.error("space origin", format!("{} vectors: must be one", others.len())));
                }
            },
        };
        let (place, spacing, direction) = match (self.get("space directions"), self.get("spacings")) {
            (Some(_), Some(_)) => {
                return Err(self.error("spacings", "must not be given together with space directions"));
            }
            (Some(text), None) => {
                if text.split_whitespace().any(|word| word.eq_ignore_ascii_case("none")) {
                    return Err(self.error(
                        "space directions",
                        "none: all three axes of a volume must have a direction",
                    ));
                }
                let vectors = self.vectors("space directions", text)?;
                let &[x, y, z] = vectors.as_slice() else {
                    return Err(
                        self.error("space directions", format!("{} vectors: must be 3", vectors.len()))
                    );
                };
                let lengths = DVec3::new(x.length(), y.length(), z.length());
                let direction = DMat3::from_cols(x / lengths.x, y / lengths.y, z / lengths.z);
                ("space directions", lengths, direction)
            }
            (None, Some(text)) => {
                let numbers: Vec<f64> =
                    text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
                let (&[x, y, z], 3) = (numbers.as_slice(), text.split_whitespace().count()) else {
                    return Err(self.error("spacings", format!("\"{text}\": must be 3 numbers")));
                };
                let given = DVec3::new(x, y, z).map(|number| if number.is_nan() { 1.0 } else { number });
                ("spacings", given.abs(), DMat3::from_diagonal(given.signum()))
            }
            (None, None) => ("sizes", DVec3::ONE, DMat3::IDENTITY),
        };
        Ok((place, spacing, origin, direction, anatomy))
    }

    /// Vectors written as `(a,b,c) (d,e,f)`, blanks allowed anywhere.
    fn vectors(&self, name: &str, text: &str) -> Result<Vec<DVec3>> {
        let broken = || self.error(name, format!("\"{text}\": must be vectors like (1,0,0)"));
        let mut vectors = Vec::new();
        let mut rest = text.trim();
        while !rest.is_empty() {
            let inner = rest.strip_prefix('(').ok_or_else(broken)?;
            let (inner, after) = inner.split_once(')').ok_or_else(broken)?;
            let numbers: Vec<Option<f64>> = inner.split(',').map(|word| word.trim().parse().ok()).collect();
            let &[Some(x), Some(y), Some(z)] = numbers.as_slice() else { return Err(broken()) };
            vectors.push(DVec3::new(x, y, z));
            rest = after.trim_start();
        }
        Ok(vectors)
    }
}
