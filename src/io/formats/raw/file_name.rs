//! The layout that a file name encodes.

use std::path::Path;

use glam::DVec3;

use crate::error::Result;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::raw::layout::{RawLayout, type_of};

fn endian_of(word: &str) -> Option<Endian> {
    match word {
        "le" | "little" => Some(Endian::Little),
        "be" | "big" => Some(Endian::Big),
        _ => None,
    }
}

/// The meaning of a word of the name.
#[derive(Debug, PartialEq)]
enum Word {
    Dims([u32; 3]),
    Spacing([f64; 3]),
    Type(SampleType, bool, Option<Endian>),
    Endian(Endian),
    /// It looks like extents or a spacing, but is neither.
    Unclear,
    Other,
}

impl Word {
    /// Classifies a word. `whole` says that it has not been split at dots.
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
                // Two numbers are not the size of a volume; if a dot has cut the word, they may be part of one.
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
        // Type and byte order may be one word, such as uint16le.
        let ends = text.len().checked_sub(2).and_then(|at| text.split_at_checked(at));
        if let Some((name, order)) = ends
            && let (Some((kind, plain)), Some(endian)) = (type_of(name), endian_of(order))
        {
            return Self::Type(kind, plain, Some(endian));
        }
        Self::Other
    }
}

/// Parses the layout from a name; also returns notes.
pub(crate) fn named(source: &Source, stem: &str) -> Result<(RawLayout, Vec<String>)> {
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
    let (mut dims, mut spacings, mut types) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (_, word)) in words.iter().enumerate() {
        match (word, words.get(i + 1)) {
            (Word::Dims(size), _) => dims.push(*size),
            (Word::Spacing(size), _) => spacings.push(*size),
            (Word::Type(kind, plain, None), Some((_, Word::Endian(endian)))) => {
                types.push((*kind, *plain, Some(*endian)));
            }
            (Word::Type(kind, plain, endian), _) => types.push((*kind, *plain, *endian)),
            _ => {}
        }
    }
    // An ambiguous word such as `short` counts only if no unambiguous type exists.
    if types.iter().any(|(_, plain, _)| *plain) {
        types.retain(|(_, plain, _)| *plain);
    }
    let dims = match *dims.as_slice() {
        [dims] => dims,
        [a, b, ..] => return error(format!("{a:?} and {b:?}: only one can be the size")),
        [] => return error(missing(source, stem, "no size")),
    };
    let (kind, endian) = match *types.as_slice() {
        [(kind, _, endian)] => (kind, endian),
        [] => return error(missing(source, stem, "no sample type")),
        [(a, ..), (b, ..), ..] => {
            return error(format!("{} and {}: only one can be the type", a.name(), b.name()));
        }
    };
    let spacing = spacings.pop();
    if !spacings.is_empty() {
        return error("more than one spacing".to_owned());
    }
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

/// Suggests what to do about an incomplete name.
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
