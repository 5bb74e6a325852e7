//! Keywords, type names and encoded names.

use crate::io::file::sample_type::SampleType;

/// The magic at the beginning of a file.
pub(crate) const MAGIC: &[u8] = b"# vtk DataFile Version";

/// Every keyword that may follow an array.
const KEYWORDS: &str = "ASPECT_RATIO BLANKING CELLS CELL_DATA CELL_TYPES COLOR_SCALARS CONNECTIVITY DIMENSIONS \
    DIRECTION EDGE_FLAGS EXTENT FIELD GLOBAL_IDS LINES LOOKUP_TABLE METADATA NORMALS NULL_ARRAY OFFSETS ORIGIN \
    PEDIGREE_IDS POINTS POINT_DATA POLYGONS SCALARS SPACING TENSORS TENSORS6 TEXTURE_COORDINATES \
    TRIANGLE_STRIPS VECTORS VERTICES X_COORDINATES Y_COORDINATES Z_COORDINATES";

/// Returns the type of numbers with this name.
pub(crate) fn number_type(word: &str) -> Option<SampleType> {
    Some(match word.to_ascii_lowercase().as_str() {
        "bit" | "unsigned_char" => SampleType::U8,
        "char" | "signed_char" => SampleType::I8,
        "unsigned_short" => SampleType::U16,
        "short" => SampleType::I16,
        "unsigned_int" => SampleType::U32,
        // VTK writes both as 32 bits.
        "int" | "vtkidtype" => SampleType::I32,
        "unsigned_long" | "vtktypeuint64" => SampleType::U64,
        "long" | "vtktypeint64" => SampleType::I64,
        "float" => SampleType::F32,
        "double" => SampleType::F64,
        _ => return None,
    })
}

/// Whether arrays of this type hold text instead of numbers.
pub(crate) fn is_text_type(word: &str) -> bool {
    ["string", "utf8_string", "variant"].iter().any(|name| word.eq_ignore_ascii_case(name))
}

/// Returns the two types that `long` may be, the narrower first: its size depends on the writer's machine.
pub(crate) fn long_types(word: &str) -> Option<[SampleType; 2]> {
    match word.to_ascii_lowercase().as_str() {
        "long" => Some([SampleType::I32, SampleType::I64]),
        "unsigned_long" => Some([SampleType::U32, SampleType::U64]),
        _ => None,
    }
}

/// Decodes a name with codes such as `%20`.
pub(crate) fn decoded(name: &str) -> String {
    let mut parts = name.split('%');
    let mut plain = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let code = part.get(..2).filter(|code| code.bytes().all(|digit| digit.is_ascii_hexdigit()));
        let code = code.and_then(|code| u8::from_str_radix(code, 16).ok());
        plain.push(code.unwrap_or(b'%'));
        plain.extend_from_slice(&part.as_bytes()[if code.is_some() { 2 } else { 0 }..]);
    }
    String::from_utf8_lossy(&plain).into_owned()
}

/// Whether an array may be followed by this text: a keyword, another array of a field, or the end of the file.
pub(crate) fn may_follow(bytes: &[u8]) -> bool {
    let bytes = bytes.trim_ascii_start();
    if bytes.is_empty() {
        return true;
    }
    let line = bytes.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let Ok(line) = std::str::from_utf8(line) else { return false };
    let mut words = line.split_ascii_whitespace();
    let word = words.next().unwrap_or_default().to_ascii_uppercase();
    let mut number = || words.next().is_some_and(|word| word.parse::<u64>().is_ok());
    KEYWORDS.split(' ').any(|keyword| keyword == word)
        || number()
            && number()
            && words.next().is_some_and(|kind| number_type(kind).is_some() || is_text_type(kind))
}

/// Parses the version.
pub(crate) fn version(text: &str) -> Option<(u32, u32)> {
    let (major, minor) = text.trim().split_once('.')?;
    let minor: String = minor.chars().take_while(char::is_ascii_digit).collect();
    Some((major.parse().ok()?, minor.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_decoded() {
        for (name, plain) in [
            ("a%20b", "a b"),
            ("%25", "%"),
            ("50%", "50%"),
            ("%zz%4", "%zz%4"),
            ("%C3%A9", "é"),
            ("%+1", "%+1"),
        ] {
            assert_eq!(decoded(name), plain);
        }
    }

    #[test]
    fn versions_are_two_numbers() {
        assert_eq!(version(" 3.0"), Some((3, 0)));
        assert_eq!(version(" 5.1 \r"), Some((5, 1)));
        for wrong in ["", " 3", " x.1", " 3.", " -1.0"] {
            assert_eq!(version(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn what_may_follow_an_array() {
        for text in
            ["", "\n \n", "\nPOINT_DATA 4\n", "cells 3 4", "\nother%20name 2 4 float\n\0\0", "a 1 4 string\n"]
        {
            assert!(may_follow(text.as_bytes()), "{text:?}");
        }
        for text in ["\0\0\0\x01", "\n12 13 14 15\n", "word", "a 1 4 quad"] {
            assert!(!may_follow(text.as_bytes()), "{text:?}");
        }
        assert!(!may_follow(b"\xff\xfe 1 4 float\n"));
    }
}
