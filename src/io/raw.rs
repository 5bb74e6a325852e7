//! Raw samples, with a layout that the caller gives, a JSON file beside them, or their name.
//!
//! The JSON file has the name of the samples with the ending `.json`, or is itself the file that is read
//! and names them: keys `dims` and `type`, and where wanted `file`, `endian`, `spacing`, `origin`,
//! `direction` (nine numbers, row by row; its columns are the directions of the index axes) and `offset`.
//! It decides where there is one.
//!
//! In a name such as `head_256x256x128_int16_be_0.5x0.5x1.2.raw` words are separated by `_`, `-` or blanks,
//! and by dots where the words are no decimals.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::samples::{self, Endian, Layout, Part, SampleType};
use super::source::Source;
use super::text;
use super::volume::Chosen;
use super::{Loaded, ReadOptions, Reader};
use crate::error::{Error, Result};
use crate::io::scene_file::json_error;
use crate::scene::Grid;

/// Everything that a raw file does not say about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawLayout {
    /// Samples along x, y and z; x is fastest.
    pub dims: [u32; 3],
    /// The type of a sample.
    pub kind: SampleType,
    /// The byte order.
    pub endian: Endian,
    /// Bytes before the first sample.
    pub offset: u64,
    /// Distance between samples along each axis, in world units.
    pub spacing: DVec3,
    /// World position of the first sample.
    pub origin: DVec3,
    /// World directions of the index axes, as columns.
    pub direction: DMat3,
}

impl RawLayout {
    /// Unit spacing along the world's axes at the origin, little-endian, no offset.
    #[must_use]
    pub fn new(dims: [u32; 3], kind: SampleType) -> Self {
        Self {
            dims,
            kind,
            endian: Endian::Little,
            offset: 0,
            spacing: DVec3::ONE,
            origin: DVec3::ZERO,
            direction: DMat3::IDENTITY,
        }
    }
}

/// Reads a file that holds `layout.offset` bytes, then exactly the samples. A file that is a gzip stream
/// is inflated first; the offset counts inflated bytes then.
///
/// # Errors
///
/// [`crate::Error::Io`] if the file cannot be read; [`crate::Error::File`] if its size does not fit the
/// layout, the layout makes no grid, or the samples would take more than `options.max_bytes`.
pub fn read_raw(path: impl AsRef<Path>, layout: &RawLayout, options: &ReadOptions) -> Result<Grid> {
    read(&Source::open(path.as_ref(), options)?, layout, options)
}

pub(crate) fn read(source: &Source, layout: &RawLayout, options: &ReadOptions) -> Result<Grid> {
    let numbers = numbers(layout);
    let (_, bytes) = samples::data_size(source, "dims", &numbers, options)?;
    let part = Part::sized(source.clone(), layout.offset, bytes);
    let samples = samples::read(source, "dims", &numbers, 1, &|_| Ok(part.clone()), options)?;
    Grid::new(layout.dims, samples)
        .and_then(|grid| grid.with_placement(layout.spacing, layout.origin, layout.direction))
        .map_err(|error| error.in_file(source.path()))
}

pub(super) struct Raw;

impl Reader for Raw {
    fn name(&self) -> &'static str {
        "raw samples"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["raw", "raw.gz", "json"]
    }

    fn recognises(&self, _: &Source) -> bool {
        // Nothing but the name tells.
        false
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let name = source.path().file_name().map(|name| name.to_string_lossy().into_owned());
        let name = name.unwrap_or_default();
        let Some(stem) = stem(&name) else {
            let sidecar = Sidecar::parse(source)?;
            let data = match &sidecar.file {
                Some(file) => PathBuf::from(file),
                None => {
                    let raw = Path::new(&name).with_extension("raw");
                    let packed = Path::new(&name).with_extension("raw.gz");
                    if !source.has_sibling(&raw) && source.has_sibling(&packed) { packed } else { raw }
                }
            };
            return self.load(
                &source.sibling(&data, options)?,
                &sidecar.layout(source)?,
                options,
                Vec::new(),
            );
        };
        let beside = PathBuf::from(format!("{stem}.json"));
        if source.has_sibling(&beside) {
            let json = source.sibling(&beside, options)?;
            // What is no JSON at all may be meant as one.
            if is_sidecar(&json) || !is_json(&json) {
                let sidecar = Sidecar::parse(&json)?;
                if let Some(other) =
                    sidecar.file.as_ref().filter(|file| file.strip_prefix("./").unwrap_or(file) != name)
                {
                    let rule = format!("\"{}\": lies beside {name} and must name it", text::shown(other));
                    return Err(json.error("file", rule));
                }
                let notes = vec![format!("layout from {}", beside.display())];
                return self.load(source, &sidecar.layout(&json)?, options, notes);
            }
        }
        let (layout, notes) = named(source, stem)?;
        let bytes = samples::data_size(source, "name", &numbers(&layout), options)?.1;
        if bytes != source.len() && !source.is_gzip() {
            let [x, y, z] = layout.dims;
            let kind = layout.kind.name();
            let rule = format!(
                "{x} x {y} x {z} samples of type {kind} need {bytes} bytes: the file has {}",
                source.len()
            );
            return Err(source.error("name", rule));
        }
        self.load(source, &layout, options, notes)
    }
}

/// The same as [`read_raw`], with what is to be told of it.
pub(crate) fn load_raw(path: &Path, layout: &RawLayout, options: &ReadOptions) -> Result<Loaded> {
    Raw.load(&Source::open(path, options)?, layout, options, Vec::new())
}

impl Raw {
    fn load(
        &self,
        source: &Source,
        layout: &RawLayout,
        options: &ReadOptions,
        notes: Vec<String>,
    ) -> Result<Loaded> {
        let chosen = Chosen::new(source, "dims", numbers(layout), 1, options)?;
        let mut loaded = chosen.loaded(self.name(), read(source, layout, options)?);
        loaded.report.notes.extend(notes);
        Ok(loaded)
    }
}

fn numbers(layout: &RawLayout) -> Layout {
    Layout::scalar(layout.dims, layout.kind, layout.endian)
}

/// The name of raw samples without its ending.
fn stem(name: &str) -> Option<&str> {
    [".raw", ".raw.gz"].into_iter().find_map(|ending| {
        let (stem, own) = name.split_at_checked(name.len().checked_sub(ending.len())?)?;
        own.eq_ignore_ascii_case(ending).then_some(stem)
    })
}

/// Largest JSON file that is looked at, in bytes.
const MAX_JSON: u64 = 1 << 20;

/// What a JSON file says of raw samples.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "the layout of raw samples: an object with `dims` and `type`")]
struct Sidecar {
    file: Option<String>,
    dims: [u32; 3],
    r#type: String,
    endian: Option<String>,
    spacing: Option<[f64; 3]>,
    origin: Option<[f64; 3]>,
    direction: Option<[f64; 9]>,
    offset: Option<u64>,
}

impl Sidecar {
    fn parse(source: &Source) -> Result<Self> {
        if !is_sidecar(source) && is_json(source) {
            return Err(source.error(
                "content",
                format!(
                    "no layout of raw samples, which is an object of at most {MAX_JSON} bytes with `dims` and \
                     `type` and without `volume`, `mesh` and `points`"
                ),
            ));
        }
        let bytes = source.bytes(0, source.len().min(MAX_JSON))?;
        let mut deserializer = serde_json::Deserializer::from_slice(&bytes);
        let parsed = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
            let key = error.path().to_string();
            json_error(source.path(), error.inner(), if key == "." { "" } else { &key })
        })?;
        deserializer.end().map_err(|error| json_error(source.path(), &error, ""))?;
        Ok(parsed)
    }

    fn layout(&self, source: &Source) -> Result<RawLayout> {
        let described = Described {
            dims: self.dims,
            kind: &self.r#type,
            endian: self.endian.as_deref(),
            spacing: self.spacing,
            origin: self.origin,
            direction: self.direction,
            offset: self.offset,
        };
        described.layout(&|key, rule| source.error(key, rule))
    }
}

/// What JSON says of raw samples, in a file of its own or in a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Described<'a> {
    pub(crate) dims: [u32; 3],
    pub(crate) kind: &'a str,
    pub(crate) endian: Option<&'a str>,
    pub(crate) spacing: Option<[f64; 3]>,
    pub(crate) origin: Option<[f64; 3]>,
    pub(crate) direction: Option<[f64; 9]>,
    pub(crate) offset: Option<u64>,
}

impl Described<'_> {
    /// The layout. `refuse` makes an error of a key and the rule that its value breaks.
    pub(crate) fn layout(&self, refuse: &dyn Fn(&str, String) -> Error) -> Result<RawLayout> {
        let Some((kind, _)) = type_of(&self.kind.to_lowercase()) else {
            let names = SampleType::ALL.map(SampleType::name).join(", ");
            let rule = format!("\"{}\": must be one of {names}", text::shown(self.kind));
            return Err(refuse("type", rule));
        };
        let endian = match self.endian.map(str::to_lowercase).as_deref() {
            None | Some("little") => Endian::Little,
            Some("big") => Endian::Big,
            Some(other) => {
                let rule = format!("\"{}\": must be little or big", text::shown(other));
                return Err(refuse("endian", rule));
            }
        };
        let plain = RawLayout::new(self.dims, kind);
        Ok(RawLayout {
            endian,
            offset: self.offset.unwrap_or(0),
            spacing: self.spacing.map_or(plain.spacing, DVec3::from_array),
            origin: self.origin.map_or(plain.origin, DVec3::from_array),
            // The file has rows, the matrix columns.
            direction: self
                .direction
                .map_or(plain.direction, |rows| DMat3::from_cols_array(&rows).transpose()),
            ..plain
        })
    }
}

/// Whether a JSON file describes raw samples, and is no scene.
fn is_sidecar(source: &Source) -> bool {
    #[derive(Deserialize)]
    struct Keys {
        dims: Option<IgnoredAny>,
        volume: Option<IgnoredAny>,
        mesh: Option<IgnoredAny>,
        points: Option<IgnoredAny>,
    }
    let fits = |keys: Keys| {
        keys.dims.is_some() && keys.volume.is_none() && keys.mesh.is_none() && keys.points.is_none()
    };
    source.len() <= MAX_JSON
        && source.bytes(0, source.len()).is_ok_and(|bytes| serde_json::from_slice(&bytes).is_ok_and(fits))
}

/// Whether a file is well-formed JSON, or too large to be looked at.
fn is_json(source: &Source) -> bool {
    source.len() > MAX_JSON
        || source
            .bytes(0, source.len())
            .is_ok_and(|bytes| serde_json::from_slice::<IgnoredAny>(&bytes).is_ok())
}

/// Whether a file is JSON that describes raw samples, and no scene.
pub(crate) fn describes_raw(path: &Path, options: &ReadOptions) -> bool {
    Source::open(path, options).is_ok_and(|source| is_sidecar(&source))
}

/// A sample type by the names that people use, in lower case, and whether the name is a word of its own
/// kind: `short` may mean something else, `int16` hardly.
fn type_of(name: &str) -> Option<(SampleType, bool)> {
    let (kind, plain) = match name {
        "u8" | "uint8" => (SampleType::U8, true),
        "uchar" | "ubyte" | "byte" => (SampleType::U8, false),
        "i8" | "int8" => (SampleType::I8, true),
        "schar" | "sbyte" => (SampleType::I8, false),
        "u16" | "uint16" => (SampleType::U16, true),
        "ushort" => (SampleType::U16, false),
        "i16" | "int16" => (SampleType::I16, true),
        "short" => (SampleType::I16, false),
        "u32" | "uint32" => (SampleType::U32, true),
        "uint" => (SampleType::U32, false),
        "i32" | "int32" => (SampleType::I32, true),
        "int" => (SampleType::I32, false),
        "u64" | "uint64" => (SampleType::U64, true),
        "i64" | "int64" => (SampleType::I64, true),
        "f32" | "float32" => (SampleType::F32, true),
        "float" => (SampleType::F32, false),
        "f64" | "float64" => (SampleType::F64, true),
        "double" => (SampleType::F64, false),
        _ => return None,
    };
    Some((kind, plain))
}

fn endian_of(word: &str) -> Option<Endian> {
    match word {
        "le" | "little" => Some(Endian::Little),
        "be" | "big" => Some(Endian::Big),
        _ => None,
    }
}

/// Words of a name that mean something.
#[derive(Debug, PartialEq)]
enum Word {
    Dims([u32; 3]),
    Spacing([f64; 3]),
    Type(SampleType, bool, Option<Endian>),
    Endian(Endian),
    /// Looks like extents or a spacing, and is none.
    Unclear,
    Other,
}

impl Word {
    /// `whole` where dots are no separators.
    fn of(text: &str, whole: bool) -> Self {
        let text = text.to_lowercase();
        let numbers: Vec<&str> = text.split('x').collect();
        let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        let decimal = |text: &str| text.split('.').all(digits) && text.split('.').count() <= 2;
        if numbers.len() > 1 && numbers.iter().all(|text| decimal(text)) {
            return match numbers.as_slice() {
                [x, y, z] if !text.contains('.') => match (x.parse(), y.parse(), z.parse()) {
                    (Ok(x), Ok(y), Ok(z)) => Self::Dims([x, y, z]),
                    _ => Self::Unclear,
                },
                [x, y, z] => match (x.parse(), y.parse(), z.parse()) {
                    (Ok(x), Ok(y), Ok(z)) => Self::Spacing([x, y, z]),
                    _ => Self::Unclear,
                },
                // Two numbers are no volume's, unless a dot has cut them off.
                [_, _] if whole => Self::Other,
                _ => Self::Unclear,
            };
        }
        if let Some((kind, plain)) = type_of(&text) {
            return Self::Type(kind, plain, None);
        }
        if let Some(endian) = endian_of(&text) {
            return Self::Endian(endian);
        }
        // Both in one word, such as uint16le.
        let ends = text.len().checked_sub(2).and_then(|at| text.split_at_checked(at));
        if let Some((name, order)) = ends
            && let (Some((kind, plain)), Some(endian)) = (type_of(name), endian_of(order))
        {
            return Self::Type(kind, plain, Some(endian));
        }
        Self::Other
    }
}

/// The layout that a name tells, and what is to be said of it.
fn named(source: &Source, stem: &str) -> Result<(RawLayout, Vec<String>)> {
    let error = |rule: String| Err(source.error("name", rule));
    let mut words = Vec::new();
    for text in stem.split(['_', '-', ' ']) {
        match Word::of(text, true) {
            Word::Other if text.contains('.') => {
                words.extend(text.split('.').map(|text| (text, Word::of(text, false))));
            }
            word => words.push((text, word)),
        }
    }
    if let Some((text, _)) = words.iter().find(|(_, word)| *word == Word::Unclear) {
        let shown = text::shown(text);
        return error(format!("\"{shown}\": neither three extents such as 64x64x40 nor three spacings"));
    }
    let mut dims =
        words.iter().filter_map(|(_, word)| if let Word::Dims(dims) = word { Some(*dims) } else { None });
    let mut spacings =
        words.iter().filter_map(|(_, word)| if let Word::Spacing(size) = word { Some(*size) } else { None });
    let types: Vec<(usize, SampleType, bool, Option<Endian>)> = (words.iter().enumerate())
        .filter_map(|(i, (_, word))| match *word {
            Word::Type(kind, plain, endian) => Some((i, kind, plain, endian)),
            _ => None,
        })
        .collect();
    // A word such as short counts where nothing plainer is there.
    let plain: Vec<_> = types.iter().filter(|(_, _, plain, _)| *plain).copied().collect();
    let types = if plain.is_empty() { types } else { plain };
    let dims = match (dims.next(), dims.next()) {
        (Some(dims), None) => dims,
        (Some(a), Some(b)) => return error(format!("{a:?} and {b:?}: only one can be the size")),
        (None, _) => return error(missing(source, stem, "no size")),
    };
    let (at, kind, endian) = match types.as_slice() {
        [(at, kind, _, endian)] => (*at, *kind, *endian),
        [] => return error(missing(source, stem, "no sample type")),
        [(_, a, ..), (_, b, ..), ..] => {
            return error(format!("{} and {}: only one can be the type", a.name(), b.name()));
        }
    };
    let spacing = match (spacings.next(), spacings.next()) {
        (spacing, None) => spacing,
        _ => return error("more than one spacing".to_owned()),
    };
    let endian = endian.or(match words.get(at + 1) {
        Some((_, Word::Endian(endian))) => Some(*endian),
        _ => None,
    });
    let [x, y, z] = dims;
    let mut notes = vec![format!("layout from the name: {x} x {y} x {z} samples of type {}", kind.name())];
    if endian.is_none() && kind.bytes() > 1 {
        notes.push("the name gives no byte order: little-endian".to_owned());
    }
    if let Some([x, y, z]) = spacing {
        notes.push(format!("spacing from the name: {x} {y} {z}"));
    }
    let plain = RawLayout::new(dims, kind);
    let endian = endian.unwrap_or(plain.endian);
    Ok((RawLayout { endian, spacing: spacing.map_or(plain.spacing, DVec3::from_array), ..plain }, notes))
}

/// What to do about a name that says too little.
fn missing(source: &Source, stem: &str, what: &str) -> String {
    let headers = ["nhdr", "mhd"].map(|ending| format!("{stem}.{ending}"));
    match headers.into_iter().find(|name| source.has_sibling(Path::new(name))) {
        Some(header) => format!("{what}: read {header} instead"),
        None => format!(
            "{what}: must be like head_256x256x128_int16.raw, or {stem}.json beside it must give dims and type, \
             or a scene file"
        ),
    }
}
