//! MetaImage: `.mha` with its data attached, `.mhd` with its data in one or several other files.
//!
//! Directions: row i of `TransformMatrix` holds the direction of index axis i, so that the rows are the
//! columns of the map from index to world. A negative spacing turns its axis round.
//!
//! Meaning of the world's axes: writers that know one give `AnatomicalOrientation`, which names the sides
//! that the *index* axes come from in a world where x runs to the left, y to the back and z upwards (`RAI`
//! goes with the identity). So a grid with such a name lies in that world; where the name does not fit
//! the matrix, the matrix decides and a warning says so. `???`, or no such key, says nothing.
//!
//! `ElementDataFile` ends the header. Keys that this format does not know are left alone, as it allows
//! them; those that differ from a known one in capitals only are refused. `CenterOfRotation` belongs to a
//! transform and does not move the image.

use std::cell::Cell;
use std::path::Path;

use glam::{DMat3, DVec3};

use super::fields::Fields;
use super::samples::{self, Endian, Layout, Part, SampleType};
use super::source::{Encoding, Source};
use super::text;
use super::volume::{Chosen, Files, Numbered, Placement};
use super::{Loaded, ReadOptions, Reader};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{Anatomy, Grid, Rescale};

pub(super) struct MetaImage;

/// Longest header that is read, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// The keys that count.
const KEYS: [&str; 24] = [
    "ObjectType",
    "NDims",
    "DimSize",
    "ElementType",
    "ElementDataFile",
    "BinaryData",
    "BinaryDataByteOrderMSB",
    "ElementByteOrderMSB",
    "CompressedData",
    "CompressedDataSize",
    "HeaderSize",
    "ElementSpacing",
    "ElementSize",
    "Offset",
    "Position",
    "Origin",
    "TransformMatrix",
    "Rotation",
    "Orientation",
    "CenterOfRotation",
    "AnatomicalOrientation",
    "ElementNumberOfChannels",
    SLOPE,
    INTERCEPT,
];

/// The map from stored numbers to values.
const SLOPE: &str = "ElementToIntensityFunctionSlope";
const INTERCEPT: &str = "ElementToIntensityFunctionOffset";

impl Reader for MetaImage {
    fn name(&self) -> &'static str {
        "MetaImage"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["mhd", "mha"]
    }

    fn recognises(&self, source: &Source) -> bool {
        // There is no magic number: the first key is one of the format's, and the rank is among the first.
        let text = String::from_utf8_lossy(source.head());
        let mut keys = text.lines().map_while(|line| pair(line).map(|(key, _)| key));
        let first = keys.next();
        !source.is_gzip()
            && first.is_some_and(|key| KEYS.contains(&key) || key == "Comment")
            && (first == Some("NDims") || keys.any(|key| key == "NDims"))
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let header = Header::read(source)?;
        header.read_image(self.name(), options)
    }
}

/// Key and value of a line.
fn pair(line: &str) -> Option<(&str, &str)> {
    let (key, value) = line.split_once(['=', ':'])?;
    Some((key.trim(), value.trim()))
}

struct Header<'a> {
    source: &'a Source,
    fields: Fields<'a>,
    /// Names of files after the header, where it ends in a list.
    names: Vec<String>,
    /// Where attached data begins.
    end: u64,
    /// Axes that the file gives numbers for.
    rank: usize,
}

impl<'a> Header<'a> {
    fn read(source: &'a Source) -> Result<Self> {
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
            if let Some(name) = KEYS.iter().find(|name| **name == key) {
                fields.add(number + 1, name, value)?;
            } else if let Some(name) = KEYS.iter().find(|name| name.eq_ignore_ascii_case(key)) {
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
                let line = line.trim();
                if list && !line.is_empty() {
                    names.push(line.to_owned());
                } else if !line.is_empty() {
                    return Err(source.error(
                        format!("line {}", number + 1),
                        format!("\"{}\": ElementDataFile must be the last key", text::shown(line)),
                    ));
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
                let rule =
                    format!("\"{}\": a volume has 3, or 4 with a last extent of 1", text::shown(other));
                Err(self.fields.error("NDims", rule))
            }
        }
    }

    fn read_image(&self, format: &'static str, options: &ReadOptions) -> Result<Loaded> {
        let Self { source, fields, .. } = self;
        let sizes = self.sizes()?;
        let dims = [sizes[0], sizes[1], sizes[2]];
        let kind = self.sample_type()?;
        let endian = self.endian()?;
        let components = match fields.get("ElementNumberOfChannels") {
            None => 1,
            Some(_) => {
                usize::try_from(fields.whole_number("ElementNumberOfChannels", 1)?).unwrap_or(usize::MAX)
            }
        };
        let place = "ElementNumberOfChannels";
        let chosen = Chosen::new(source, place, Layout::scalar(dims, kind, endian), components, options)?;
        let rescale = self.rescale(&chosen)?;
        let placement = self.placement()?;

        let (_, bytes) = samples::data_size(source, "DimSize", &chosen.layout, options)?;
        let data = self.data(&sizes, bytes)?;
        let packed = fields.whole_number("CompressedDataSize", 0)?;
        let parts = usize::try_from(data.parts()).unwrap_or(usize::MAX);
        let stored = Cell::new(0_u64);
        let part = |index| {
            let part = self.part(&data, index, options)?;
            let bytes = part.source.len().saturating_sub(part.offset);
            stored.set(stored.get().saturating_add(bytes));
            Ok(part)
        };
        let samples = samples::read(source, "DimSize", &chosen.layout, parts, &part, options)?;

        let located = |name, error| fields.located(name, error);
        let grid = Grid::new(dims, samples).map_err(|error| error.in_file(source.path()))?;
        let grid = grid.with_rescale(rescale).map_err(|error| located(SLOPE, error))?;
        let mut loaded = chosen.placed(format, grid, placement, &located)?;
        // The stream has its own check sum, and real files have stale numbers here.
        if data.compressed
            && let size @ 1.. = packed
            && size.unsigned_abs() != stored.get()
        {
            let there = stored.get();
            loaded.report.warnings.push(format!(
                "CompressedDataSize {size}: {there} bytes are there, and unpack to what the header says"
            ));
        }
        Ok(loaded)
    }

    /// The extents, as many as the rank.
    fn sizes(&self) -> Result<Vec<u32>> {
        let text = self.fields.required("DimSize")?;
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() != self.rank {
            let rule = format!("{} numbers: NDims {} needs {}", words.len(), self.rank, self.rank);
            return Err(self.fields.error("DimSize", rule));
        }
        let size = |word: &&str| {
            word.parse::<u32>().ok().filter(|&size| size > 0).ok_or_else(|| {
                let rule =
                    format!("\"{}\": must be a whole number from 1 to {}", text::shown(word), u32::MAX);
                self.fields.error("DimSize", rule)
            })
        };
        let sizes = words.iter().map(size).collect::<Result<Vec<u32>>>()?;
        match sizes.get(3) {
            Some(&last) if last != 1 => {
                let rule = format!("a last extent of {last}: a volume has three axes, a fourth must be 1");
                Err(self.fields.error("DimSize", rule))
            }
            _ => Ok(sizes),
        }
    }

    fn sample_type(&self) -> Result<SampleType> {
        Ok(match self.fields.required("ElementType")? {
            "MET_CHAR" => SampleType::I8,
            "MET_UCHAR" => SampleType::U8,
            "MET_SHORT" => SampleType::I16,
            "MET_USHORT" => SampleType::U16,
            // A long has four bytes in this format, on every machine.
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

    /// A truth value, where there is one.
    fn truth(&self, name: &str) -> Result<Option<bool>> {
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

    fn endian(&self) -> Result<Endian> {
        let names = ["BinaryDataByteOrderMSB", "ElementByteOrderMSB"];
        let big = match (self.truth(names[0])?, self.truth(names[1])?) {
            (Some(a), Some(b)) if a != b => {
                return Err(self.fields.error(names[1], format!("must not differ from {}", names[0])));
            }
            (a, b) => a.or(b).unwrap_or(false),
        };
        Ok(if big { Endian::Big } else { Endian::Little })
    }

    /// Numbers of a field, as many as `count`.
    fn numbers(&self, name: &str, count: usize) -> Result<Option<Vec<f64>>> {
        let Some(text) = self.fields.get(name) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        match numbers {
            Some(numbers) if numbers.len() == count => Ok(Some(numbers)),
            _ => {
                let rule = format!("\"{}\": must be {count} numbers", text::shown(text));
                Err(self.fields.error(name, rule))
            }
        }
    }

    /// The numbers of a field that has several names, with the name that it has.
    fn named<'n>(&self, names: &[&'n str], count: usize) -> Result<Option<(&'n str, Vec<f64>)>> {
        let mut found: Option<(&str, Vec<f64>)> = None;
        for name in names {
            let Some(numbers) = self.numbers(name, count)? else { continue };
            match &found {
                Some((first, others)) if *others != numbers => {
                    return Err(self.fields.error(name, format!("must not differ from {first}")));
                }
                Some(_) => {}
                None => found = Some((name, numbers)),
            }
        }
        Ok(found)
    }

    fn rescale(&self, chosen: &Chosen) -> Result<Rescale> {
        let number = |name: &str, default: f64| {
            Ok::<_, Error>(self.numbers(name, 1)?.and_then(|n| n.first().copied()).unwrap_or(default))
        };
        let slope = number(SLOPE, 1.0)?;
        let intercept = number(INTERCEPT, 0.0)?;
        chosen.rescale(self.source, INTERCEPT, Rescale { slope, intercept })
    }

    fn placement(&self) -> Result<Placement> {
        let rank = self.rank;
        let (mut notes, mut warnings) = (Vec::new(), Vec::new());
        // Without a spacing the size of an element stands for it.
        let (spacing_place, spacing) = match self.numbers("ElementSpacing", rank)? {
            Some(spacing) => ("ElementSpacing", vector(&spacing)),
            None => match self.numbers("ElementSize", rank)? {
                Some(size) => ("ElementSize", vector(&size)),
                None => ("DimSize", DVec3::ONE),
            },
        };
        let origin = self.named(&["Offset", "Position", "Origin"], rank)?;
        let origin_place = origin.as_ref().map(|(name, _)| *name);
        let origin = origin.map_or(DVec3::ZERO, |(_, numbers)| vector(&numbers));
        let matrix = self.named(&["TransformMatrix", "Rotation", "Orientation"], rank * rank)?;
        let matrix_place = matrix.as_ref().map(|(name, _)| *name);
        let direction = match &matrix {
            None => DMat3::IDENTITY,
            Some((name, numbers)) => {
                // What a fourth axis does to the other three, and they to it.
                let mixes = |i: usize| (i % rank == 3) != (i / rank == 3);
                if let Some((_, number)) =
                    numbers.iter().enumerate().find(|&(i, &number)| mixes(i) && number != 0.0)
                {
                    let rule = format!("{number}: the fourth axis must not mix with the others");
                    return Err(self.fields.error(name, rule));
                }
                let row = |i: usize| vector(&numbers[i * rank..]);
                DMat3::from_cols(row(0), row(1), row(2))
            }
        };
        let turned = spacing.map(|number| if number < 0.0 { -1.0 } else { 1.0 });
        let direction = direction * DMat3::from_diagonal(turned);
        if turned != DVec3::ONE {
            notes.push("a negative spacing turns its axis round".to_owned());
        }

        if let Some(centre) = self.numbers("CenterOfRotation", rank)?
            && vector(&centre) != DVec3::ZERO
        {
            notes.push(format!("CenterOfRotation {} does not move the image", vector(&centre)));
        }
        let anatomy = match self.fields.get("AnatomicalOrientation") {
            None | Some("" | "???" | "????") => Anatomy::Unknown,
            Some(name) => match sides(name) {
                None => {
                    let shown = text::shown(name);
                    warnings.push(format!("AnatomicalOrientation \"{shown}\": no orientation, left alone"));
                    Anatomy::Unknown
                }
                Some(sides) => {
                    let axes = [direction.x_axis, direction.y_axis, direction.z_axis];
                    // Oblique axes have several names; an axis that hardly runs the way of its name has not
                    // this one.
                    if axes.iter().zip(sides).any(|(axis, side)| axis.normalize().dot(side) < 0.3) {
                        warnings.push(format!(
                            "AnatomicalOrientation {name} does not fit the directions of the axes, which decide"
                        ));
                    }
                    Anatomy::Lps
                }
            },
        };
        // The field to blame is the one that is there.
        let bad_spacing = !(spacing.is_finite() && spacing.abs().min_element() > 0.0);
        let place = if bad_spacing {
            spacing_place
        } else if !origin.is_finite() {
            origin_place.unwrap_or("Offset")
        } else {
            matrix_place.unwrap_or("TransformMatrix")
        };
        Ok(Placement { place, spacing: spacing.abs(), origin, direction, anatomy, notes, warnings })
    }

    /// The files of the data and how they are packed. `bytes` is their size, unpacked.
    fn data(&self, sizes: &[u32], bytes: u64) -> Result<Data> {
        let fields = &self.fields;
        let text = !self.truth("BinaryData")?.unwrap_or(true);
        let compressed = self.truth("CompressedData")?.unwrap_or(false);
        if text && compressed {
            return Err(fields.error("CompressedData", "must not be given together with numbers in words"));
        }
        let skip = fields.whole_number("HeaderSize", -1)?;
        if skip < 0 && (text || compressed) {
            return Err(fields.error(
                "HeaderSize",
                "-1: only binary data without compression can be found from the end of its file",
            ));
        }
        let value = fields.required("ElementDataFile")?;
        let error = |rule: String| fields.error("ElementDataFile", rule);
        let words: Vec<&str> = value.split_whitespace().collect();
        let slices =
            |rank: usize| sizes[rank..].iter().fold(1_u64, |n, &size| n.saturating_mul(u64::from(size)));
        let (files, wanted) = match words.as_slice() {
            [] => return Err(error("empty: must be LOCAL, LIST, or name the data".to_owned())),
            _ if is_local(value) => (None, 1),
            ["LIST", rest @ ..] => {
                let rank = match rest {
                    [] => self.rank - 1,
                    [rank] => rank
                        .trim_end_matches(['d', 'D'])
                        .parse()
                        .ok()
                        .filter(|rank| (1..=self.rank).contains(rank))
                        .ok_or_else(|| {
                            let shown = text::shown(rank);
                            error(format!("\"{shown}\": each file must have 1 to {} axes", self.rank))
                        })?,
                    _ => return Err(error(format!("\"{}\": must be LIST, or LIST 2", text::shown(value)))),
                };
                (Some(Files::Named(self.names.clone())), slices(rank))
            }
            _ => match numbered(&words, u64::from(sizes[self.rank - 1])).transpose().map_err(error)? {
                Some(numbered) => (Some(Files::Numbered(numbered)), slices(self.rank - 1)),
                None => (Some(Files::one(value)), 1),
            },
        };
        let given = files.as_ref().map_or(1, Files::count);
        if given != wanted {
            return Err(error(format!("{given} files: the extents need {wanted}")));
        }
        Ok(Data { files, text, compressed, skip, share: bytes / wanted.max(1) })
    }

    fn part(&self, data: &Data, index: usize, options: &ReadOptions) -> Result<Part> {
        let (source, least) = match &data.files {
            None => (self.source.clone(), self.end),
            Some(files) => (self.source.sibling(Path::new(&files.name(index)), options)?, 0),
        };
        let offset = match data.skip {
            0 => least,
            -1 => source.len().checked_sub(data.share).ok_or_else(|| {
                source.error("data", format!("needs {} bytes: {} are there", data.share, source.len()))
            })?,
            skip => skip.unsigned_abs(),
        };
        if offset < least {
            let rule = format!("{}: the data would begin within the header", data.skip);
            return Err(self.fields.error("HeaderSize", rule));
        }
        let mut encoding = Encoding::Raw;
        if data.compressed {
            let stored = source.len().saturating_sub(offset);
            // Writers use zlib; readers take gzip as well.
            let gzip = stored >= 2 && source.bytes(offset, 2)? == [0x1f, 0x8b];
            encoding = if gzip { Encoding::Gzip } else { Encoding::Zlib };
        }
        Ok(Part { source, offset, encoding, skip: 0, text: data.text })
    }
}

/// The first three of several numbers; there are as many.
fn vector(numbers: &[f64]) -> DVec3 {
    DVec3::new(numbers[0], numbers[1], numbers[2])
}

fn is_local(data: &str) -> bool {
    matches!(data, "LOCAL" | "Local" | "local")
}

/// The numbered files of words such as `slice%03d.raw 1 93 1`. Numbers that are left out run from 1 over
/// all slices. None, where the first words are no pattern.
fn numbered(words: &[&str], slices: u64) -> Option<std::result::Result<Numbered, String>> {
    // Names may hold blanks: what follows the pattern counts from the end.
    let number = |word: &&str| word.parse::<i64>().ok();
    let tail: Vec<i64> = words.iter().rev().map_while(number).take(3).collect();
    let (name, numbers) = match *tail.as_slice() {
        [step, last, first] => (&words[..words.len() - 3], [first, last, step]),
        [last, first] => (&words[..words.len() - 2], [first, last, 1]),
        [first] => {
            let count = i64::try_from(slices).unwrap_or(i64::MAX);
            (&words[..words.len() - 1], [first, first.saturating_add(count - 1), 1])
        }
        _ => (words, [1, i64::try_from(slices).unwrap_or(i64::MAX), 1]),
    };
    let pattern = Numbered::parse(&name.join(" "))?;
    let [first, last, step] = numbers;
    Some(pattern.over(first, last, step).map_err(|rule| {
        format!(
            "\"{}\": {rule}; needed are a pattern, first and last number, and step",
            text::shown(&words.join(" "))
        )
    }))
}

/// The directions that axes run in which come from the named sides, in a world of left, back and up.
fn sides(name: &str) -> Option<[DVec3; 3]> {
    let side = |letter| match letter {
        'R' => Some(DVec3::X),
        'L' => Some(DVec3::NEG_X),
        'A' => Some(DVec3::Y),
        'P' => Some(DVec3::NEG_Y),
        'I' => Some(DVec3::Z),
        'S' => Some(DVec3::NEG_Z),
        _ => None,
    };
    let sides: Vec<DVec3> = name.chars().map(side).collect::<Option<_>>()?;
    let &[x, y, z] = sides.as_slice() else { return None };
    (x.cross(y).dot(z) != 0.0).then_some([x, y, z])
}

struct Data {
    /// None where the data follows the header.
    files: Option<Files>,
    text: bool,
    compressed: bool,
    /// Bytes before the data of each file; -1 finds it from the end.
    skip: i64,
    /// Unpacked bytes of each file.
    share: u64,
}

impl Data {
    fn parts(&self) -> u64 {
        self.files.as_ref().map_or(1, Files::count)
    }
}
