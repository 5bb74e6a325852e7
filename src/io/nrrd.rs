//! NRRD, with its data attached (`.nrrd`) or in one or several other files (`.nhdr`).
//!
//! Three dimensions, before which one of components may lie and after which further ones of size 1;
//! encodings raw, gzip and text. World coordinates are kept as the file has them; where its `space` is an
//! anatomical one the grid says which.
//!
//! A spacing that is not a number is unknown and counts as 1; a negative one turns the axis round. A file
//! that names a `space` and has `spacings` instead of directions breaks the format's rules; its axes run
//! along the space's, and a warning says so. Without directions and `space origin`, `axis mins` and
//! `axis maxs` place the grid, at the centres of its cells unless the `centers` are nodes.
//!
//! Fields that do not place or scale samples (`content`, `units`, `thicknesses`, ...) are checked for their
//! names only.

use std::cell::Cell;
use std::io::Read;
use std::path::Path;

use glam::{DMat3, DVec3};

use super::fields::Fields;
use super::samples::{self, Endian, Layout, Part, SampleType};
use super::source::{Encoding, Source};
use super::text;
use super::volume::{Chosen, Files, Numbered, Placement};
use super::{Loaded, Pick, ReadOptions, Reader};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Anatomy, Grid};

pub(super) struct Nrrd;

/// Longest header that is read, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// Most bytes that are read without use before the data of several files: one file can be named often.
const MAX_SKIP: u64 = 1 << 28;

/// Every field of the format, under the one name that is used here.
const FIELDS: [&str; 30] = [
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
    "units",
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
        let axes = header.axes()?;
        let packing = header.packing()?;
        let endian = header.endian(kind, packing)?;
        let placement = header.placement(&axes)?;
        let dims = axes.dims();
        let mut chosen =
            Chosen::new(source, "sizes", Layout::scalar(dims, kind, endian), axes.components(), options)?;
        let first_alone = axes.components() > 1 && options.array.is_none() && header.has_no_length();
        if first_alone {
            chosen.layout.pick = Pick::Component(0);
        }

        let files = header.files(&axes)?;
        let count = files.as_ref().map_or(1, Files::count);
        let lines = header.whole_number("line skip", 0)?;
        let skip = header.whole_number("byte skip", -1)?;
        if skip < 0 && packing != Packing::Binary(Encoding::Raw) {
            return Err(header.error("byte skip", "-1: only raw data can be found from the end of its file"));
        }
        let (_, bytes) = samples::data_size(source, "sizes", &chosen.layout, options)?;
        let share = bytes / count.max(1);
        let skipped = Cell::new(0_u64);
        let part = |index: usize| {
            let (data, start) = match &files {
                None => (source.clone(), header.end),
                Some(files) => (source.sibling(Path::new(&files.name(index)), options)?, 0),
            };
            let begin = skip_lines(&data, start, lines)?;
            let skip = match skip {
                -1 => (data.len() - begin).checked_sub(share).ok_or_else(|| {
                    data.error("data", format!("needs {share} bytes: {} are there", data.len() - begin))
                })?,
                skip => skip.unsigned_abs(),
            };
            let (encoding, text) = match packing {
                Packing::Binary(encoding) => (encoding, false),
                Packing::Text => (Encoding::Raw, true),
            };
            // Raw bytes need not be read to be skipped.
            let seeks = packing == Packing::Binary(Encoding::Raw);
            let (offset, skip) = if seeks { (begin.saturating_add(skip), 0) } else { (begin, skip) };
            let read = skipped.get().saturating_add(begin - start).saturating_add(skip);
            skipped.set(read);
            if count > 1 && read > MAX_SKIP {
                let rule =
                    format!("passes over {read} bytes in {} files: the limit is {MAX_SKIP}", index + 1);
                return Err(header.error(if lines > 0 { "line skip" } else { "byte skip" }, rule));
            }
            Ok(Part { source: data, offset, encoding, skip, text })
        };
        let parts = usize::try_from(count).unwrap_or(usize::MAX);
        let samples = samples::read(source, "sizes", &chosen.layout, parts, &part, options)?;

        let grid = Grid::new(dims, samples).map_err(|error| error.in_file(source.path()))?;
        let located = |name, error| header.fields.located(name, error);
        let mut loaded = chosen.placed(self.name(), grid, placement, &located)?;
        if first_alone {
            loaded.report.warnings.push(format!(
                "the first of {} entries at each sample is shown: name values:1 and so on for others",
                axes.components()
            ));
        }
        Ok(loaded)
    }
}

/// How the numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    Binary(Encoding),
    Text,
}

/// The axes of the array.
struct Axes {
    sizes: Vec<u32>,
    /// Where the three spatial axes begin; before them lies one of components, if any.
    first: usize,
}

impl Axes {
    fn dims(&self) -> [u32; 3] {
        [self.sizes[self.first], self.sizes[self.first + 1], self.sizes[self.first + 2]]
    }

    fn components(&self) -> usize {
        if self.first == 0 { 1 } else { num::index(self.sizes[0]) }
    }
}

/// Whether an axis of such a kind lies in space or time, or may.
fn is_domain(kind: &str) -> bool {
    matches!(kind.to_lowercase().as_str(), "domain" | "space" | "time" | "none" | "???")
}

/// How many components an axis of such a kind has, where the kind says so.
fn components_of(kind: &str) -> Option<u32> {
    Some(match kind.to_lowercase().as_str() {
        "stub" | "scalar" => 1,
        "complex" | "2-vector" => 2,
        "3-color"
        | "rgb-color"
        | "hsv-color"
        | "xyz-color"
        | "3-vector"
        | "3-gradient"
        | "3-normal"
        | "2d-symmetric-matrix" => 3,
        "4-color" | "rgba-color" | "4-vector" | "quaternion" | "2d-masked-symmetric-matrix" | "2d-matrix" => {
            4
        }
        "2d-masked-matrix" => 5,
        "3d-symmetric-matrix" => 6,
        "3d-masked-symmetric-matrix" => 7,
        "3d-matrix" => 9,
        "3d-masked-matrix" => 10,
        _ => return None,
    })
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
    /// Names of files after `data file: LIST`.
    names: Vec<String>,
    /// Where attached data begins.
    end: u64,
}

impl<'a> Header<'a> {
    /// Most axes of the format.
    const MAX_AXES: usize = 16;

    fn read(source: &'a Source) -> Result<Self> {
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
                // Decided once: a header may have many lines.
                list = header.get("data file").is_some_and(is_list);
            }
        }
        header.end = num::wide(at);
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
            "spacedimension" => "space dimension".to_owned(),
            "spacedirections" => "space directions".to_owned(),
            "spaceorigin" => "space origin".to_owned(),
            "spaceunits" => "space units".to_owned(),
            "measurementframe" => "measurement frame".to_owned(),
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
            "longlong"
            | "long long"
            | "long long int"
            | "signed long long"
            | "signed long long int"
            | "int64"
            | "int64_t" => SampleType::I64,
            "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
                SampleType::U64
            }
            "float" => SampleType::F32,
            "double" => SampleType::F64,
            _ => {
                return Err(self.error(
                    "type",
                    format!(
                        "\"{}\": integers of 8, 16, 32 and 64 bits, float and double are supported",
                        text::shown(text)
                    ),
                ));
            }
        })
    }

    /// The extents, which must be three or as good as three.
    fn axes(&self) -> Result<Axes> {
        let dimension = self.required("dimension")?;
        let rank = dimension.parse().ok().filter(|rank| (3..=Self::MAX_AXES).contains(rank));
        let Some(rank) = rank else {
            let rule = format!(
                "{}: a volume has 3, and at most {} with components",
                text::shown(dimension),
                Self::MAX_AXES
            );
            return Err(self.error("dimension", rule));
        };
        let text = self.required("sizes")?;
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() != rank {
            return Err(
                self.error("sizes", format!("{} numbers: dimension {rank} needs {rank}", words.len()))
            );
        }
        let size = |text: &&str| {
            text.parse::<u32>().ok().filter(|&size| size > 0).ok_or_else(|| {
                let rule =
                    format!("\"{}\": must be a whole number from 1 to {}", text::shown(text), u32::MAX);
                self.error("sizes", rule)
            })
        };
        let sizes = words.iter().map(size).collect::<Result<Vec<u32>>>()?;
        let kinds: Vec<&str> = self.get("kinds").unwrap_or_default().split_whitespace().collect();
        if !kinds.is_empty() && kinds.len() != rank {
            return Err(self.error("kinds", format!("{} kinds: dimension {rank} needs {rank}", kinds.len())));
        }
        let other = |axis: usize| kinds.get(axis).filter(|kind| !is_domain(kind));
        if rank == 3 {
            return match (0..3).find_map(other) {
                Some(kind) => {
                    let rule = format!("\"{kind}\": all three axes of a volume must be spatial");
                    Err(self.error("kinds", rule))
                }
                None => Ok(Axes { sizes, first: 0 }),
            };
        }
        let directions = self.directions(rank)?;
        let undirected =
            |axis: usize| directions.as_ref().is_some_and(|directions| directions[axis].is_none());
        let first = usize::from(other(0).is_some() || undirected(0));
        if let Some(kind) = other(0)
            && let Some(components) = components_of(kind)
            && components != sizes[0]
        {
            return Err(self.error("kinds", format!("{kind}: has {components} components, not {}", sizes[0])));
        }
        for (axis, &size) in sizes.iter().enumerate().skip(first) {
            if let Some(kind) = other(axis).filter(|_| size > 1) {
                let rule = format!("\"{kind}\" on axis {}: components must lie on the first axis", axis + 1);
                return Err(self.error("kinds", rule));
            }
            if axis >= first + 3 && size > 1 {
                let mut rule =
                    format!("{size} on axis {}: a volume has three axes, further ones must be 1", axis + 1);
                if first == 0 {
                    rule.push_str(
                        "; a first axis of components needs a kind such as vector, or direction none",
                    );
                }
                return Err(self.error("sizes", rule));
            }
        }
        if sizes.len() < first + 3 {
            return Err(self.error("sizes", "fewer than three axes beside the components"));
        }
        Ok(Axes { sizes, first })
    }

    /// Whether the components of the first axis are no vector: times, layers, or colours whose length would
    /// count opacity or hue.
    fn has_no_length(&self) -> bool {
        let kind = self.get("kinds").and_then(|kinds| kinds.split_whitespace().next()).unwrap_or_default();
        let kind = kind.to_lowercase();
        matches!(kind.as_str(), "list" | "time" | "rgba-color" | "4-color" | "hsv-color")
    }

    fn packing(&self) -> Result<Packing> {
        match self.required("encoding")?.to_lowercase().as_str() {
            "raw" => Ok(Packing::Binary(Encoding::Raw)),
            "gzip" | "gz" => Ok(Packing::Binary(Encoding::Gzip)),
            "ascii" | "text" | "txt" => Ok(Packing::Text),
            other => {
                let rule = format!("\"{}\": raw and gzip are supported, and ascii", text::shown(other));
                Err(self.error("encoding", rule))
            }
        }
    }

    /// The files of the data, in its order; none where it is attached.
    fn files(&self, axes: &Axes) -> Result<Option<Files>> {
        let Some(name) = self.get("data file") else { return Ok(None) };
        let error = |rule: String| self.error("data file", rule);
        let rank = axes.sizes.len();
        // Axes that each file has: all but the slowest, where nothing is said.
        let sub = |word: Option<&str>| match word {
            None => Ok(rank - 1),
            Some(word) => {
                word.parse::<usize>().ok().filter(|sub| (1..=rank).contains(sub)).ok_or_else(|| {
                    error(format!("\"{}\": each file must have 1 to {rank} axes", text::shown(word)))
                })
            }
        };
        let words: Vec<&str> = name.split_whitespace().collect();
        let (files, sub) = match words.as_slice() {
            [] => return Err(error("empty: must name the data".to_owned())),
            ["LIST"] => (Files::Named(self.names.clone()), sub(None)?),
            ["LIST", word] => (Files::Named(self.names.clone()), sub(Some(word))?),
            [pattern, first, last, step, rest @ ..]
                if rest.len() < 2
                    && let Some(pattern) = Numbered::parse(pattern)
                    && let (Ok(first), Ok(last), Ok(step)) = (first.parse(), last.parse(), step.parse()) =>
            {
                let numbered = pattern.over(first, last, step);
                let numbered =
                    numbered.map_err(|rule| error(format!("\"{}\": {rule}", text::shown(name))))?;
                (Files::Numbered(numbered), sub(rest.first().copied())?)
            }
            _ => return Ok(Some(Files::one(name))),
        };
        let given = files.count();
        if sub == rank {
            // Slabs: equal shares of the slowest axis.
            let last = axes.sizes.last().copied().map_or(0, u64::from);
            if given == 0 || last % given != 0 {
                return Err(error(format!(
                    "{given} files: data in several files of all axes needs a divisor of the last size, {last}"
                )));
            }
        } else {
            let needed = axes.sizes[sub..].iter().fold(1_u64, |n, &size| n.saturating_mul(u64::from(size)));
            if given != needed {
                return Err(error(format!(
                    "{given} files: data in several files of {sub} axes needs {needed}"
                )));
            }
        }
        Ok(Some(files))
    }

    fn endian(&self, kind: SampleType, packing: Packing) -> Result<Endian> {
        match self.get("endian").map(str::to_lowercase).as_deref() {
            Some("little") => Ok(Endian::Little),
            Some("big") => Ok(Endian::Big),
            Some(other) => {
                Err(self.error("endian", format!("\"{}\": must be little or big", text::shown(other))))
            }
            None if kind.bytes() == 1 || packing == Packing::Text => Ok(Endian::Little),
            None => Err(self.error("endian", format!("missing: {} samples need it", kind.name()))),
        }
    }

    /// Where the grid lies, and what the world's axes mean.
    fn placement(&self, axes: &Axes) -> Result<Placement> {
        let anatomy = match self.get("space").map(str::to_lowercase).as_deref() {
            Some("right-anterior-superior" | "ras") => Anatomy::Ras,
            Some("left-anterior-superior" | "las") => Anatomy::Las,
            Some("left-posterior-superior" | "lps") => Anatomy::Lps,
            None | Some("scanner-xyz" | "3d-right-handed" | "3d-left-handed") => Anatomy::Unknown,
            Some(other) => {
                return Err(self.error(
                    "space",
                    format!(
                        "\"{}\": must be one of right-anterior-superior, left-anterior-superior, \
                         left-posterior-superior, scanner-xyz, 3D-right-handed, 3D-left-handed",
                        text::shown(other)
                    ),
                ));
            }
        };
        if let Some(dimension) = self.get("space dimension") {
            if self.get("space").is_some() {
                return Err(self.error("space dimension", "must not be given together with space"));
            }
            if dimension != "3" {
                let rule = format!("{}: a volume lies in 3", text::shown(dimension));
                return Err(self.error("space dimension", rule));
            }
        }
        let origin = match self.get("space origin") {
            None => None,
            Some(text) => match self.vectors("space origin", text)?.as_slice() {
                &[Some(origin)] => Some(origin),
                others => {
                    return Err(self.error("space origin", format!("{} vectors: must be one", others.len())));
                }
            },
        };
        let (mut notes, mut warnings) = (Vec::new(), Vec::new());
        let rank = axes.sizes.len();
        let (place, spacing, origin, direction) = match (self.directions(rank)?, self.get("spacings")) {
            (Some(_), Some(_)) => {
                return Err(self.error("spacings", "must not be given together with space directions"));
            }
            (Some(directions), None) => {
                let &[Some(x), Some(y), Some(z)] = &directions[axes.first..axes.first + 3] else {
                    return Err(self.error(
                        "space directions",
                        "none: all three axes of a volume must have a direction",
                    ));
                };
                let lengths = DVec3::new(x.length(), y.length(), z.length());
                let direction = DMat3::from_cols(x / lengths.x, y / lengths.y, z / lengths.z);
                ("space directions", lengths, origin.unwrap_or(DVec3::ZERO), direction)
            }
            (None, spacings) => {
                if let Some(space) = self.get("space").filter(|_| spacings.is_some()) {
                    warnings.push(format!(
                        "spacings in a space ({space}) do not say where the axes run: taken along the space's"
                    ));
                }
                let place = if spacings.is_some() { "spacings" } else { "sizes" };
                let scale = self.scale(axes)?;
                if origin.is_none() && scale.from_mins {
                    notes.push("axis mins place the grid".to_owned());
                }
                let given = scale.steps;
                let direction = DMat3::from_diagonal(given.map(|step| if step < 0.0 { -1.0 } else { 1.0 }));
                (place, given.abs(), origin.unwrap_or(scale.origin), direction)
            }
        };
        Ok(Placement { place, spacing, origin, direction, anatomy, notes, warnings })
    }

    /// Steps along the axes of a file without directions.
    fn scale(&self, axes: &Axes) -> Result<Scale> {
        let rank = axes.sizes.len();
        let spacings = self.each("spacings", rank)?;
        let mins = self.each("axis mins", rank)?;
        let maxs = self.each("axis maxs", rank)?;
        let centers: Vec<&str> = self.get("centers").unwrap_or_default().split_whitespace().collect();
        let mut steps = [1.0; 3];
        let mut origin = [0.0; 3];
        let mut from_mins = true;
        for i in 0..3 {
            let axis = axes.first + i;
            // A number that is none says that there is nothing to say.
            let at = |list: &Option<Vec<f64>>| list.as_ref().map_or(f64::NAN, |list| list[axis]);
            let (min, max) = (at(&mins), at(&maxs));
            let node = centers.get(axis).is_some_and(|center| center.eq_ignore_ascii_case("node"));
            let size = f64::from(axes.sizes[axis]);
            let gaps = if node { size - 1.0 } else { size };
            let spacing = at(&spacings);
            let spanned = (max - min) / gaps;
            steps[i] = if !spacing.is_nan() {
                spacing
            } else if spanned.is_nan() {
                1.0
            } else {
                spanned
            };
            from_mins &= !min.is_nan();
            origin[i] = if node { min } else { min + 0.5 * steps[i] };
        }
        // Where one is unknown there is no place.
        let origin = if from_mins { DVec3::from_array(origin) } else { DVec3::ZERO };
        Ok(Scale { steps: DVec3::from_array(steps), origin, from_mins })
    }

    /// One number for each axis.
    fn each(&self, name: &str, rank: usize) -> Result<Option<Vec<f64>>> {
        let Some(text) = self.get(name) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        match numbers {
            Some(numbers) if numbers.len() == rank => Ok(Some(numbers)),
            _ => Err(self.error(name, format!("\"{}\": must be {rank} numbers", text::shown(text)))),
        }
    }

    /// A vector for each axis, or none, where there are directions.
    fn directions(&self, rank: usize) -> Result<Option<Vec<Option<DVec3>>>> {
        let Some(text) = self.get("space directions") else { return Ok(None) };
        let vectors = self.vectors("space directions", text)?;
        if vectors.len() != rank {
            let rule = format!("{} vectors: must be {rank}", vectors.len());
            return Err(self.error("space directions", rule));
        }
        Ok(Some(vectors))
    }

    /// Vectors written as `(a,b,c) none (d,e,f)`, blanks allowed anywhere.
    fn vectors(&self, name: &str, text: &str) -> Result<Vec<Option<DVec3>>> {
        let broken = || self.error(name, format!("\"{}\": must be vectors like (1,0,0)", text::shown(text)));
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

/// Whether names of files follow the header.
fn is_list(value: &str) -> bool {
    value.split_whitespace().next() == Some("LIST")
}

/// Steps along the axes and the place of the first sample.
struct Scale {
    steps: DVec3,
    origin: DVec3,
    /// Whether the origin is given.
    from_mins: bool,
}
