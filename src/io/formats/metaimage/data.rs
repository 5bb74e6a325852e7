//! The files of the data, and where the samples begin in each.

use std::path::Path;

use crate::error::Result;
use crate::io::build::file_names::{Files, Numbered};
use crate::io::file::samples::Part;
use crate::io::file::source::Encoding;
use crate::io::file::text;
use crate::io::formats::metaimage::header::{Header, is_local};
use crate::io::options::ReadOptions;

impl<'a> Header<'a> {
    /// Finds the files of the data and their encoding.
    pub(crate) fn data(&self, sizes: &[u32]) -> Result<Data> {
        let fields = &self.fields;
        let text = !self.truth("BinaryData")?.unwrap_or(true);
        let compressed = self.truth("CompressedData")?.unwrap_or(false);
        if text && compressed {
            return Err(fields.error("CompressedData", "must not be given together with text data"));
        }
        let skip = fields.whole_number("HeaderSize", -1)?;
        if skip < 0 && (text || compressed) {
            let rule = "-1: only binary data without compression can be found from the end of its file";
            return Err(fields.error("HeaderSize", rule));
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
                    [word] => {
                        let rank = word.trim_end_matches(['d', 'D']).parse().ok();
                        let rule = || {
                            format!("\"{}\": each file must have 1 to {} axes", text::shown(word), self.rank)
                        };
                        rank.filter(|rank| (1..=self.rank).contains(rank)).ok_or_else(|| error(rule()))?
                    }
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
        Ok(Data { files, text, compressed, skip })
    }

    /// Opens a file of the data, which holds `share` decompressed bytes of it.
    pub(crate) fn part(&self, data: &Data, index: usize, share: u64, options: &ReadOptions) -> Result<Part> {
        let (source, least) = match &data.files {
            None => (self.source.clone(), self.end),
            Some(files) => (self.source.sibling(Path::new(&files.name(index)), options)?, 0),
        };
        let offset = match data.skip {
            0 => least,
            -1 => source.len().checked_sub(share).ok_or_else(|| {
                source.error("data", format!("needs {share} bytes: {} are there", source.len()))
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
            // The format specifies zlib; gzip occurs as well.
            let gzip = stored >= 2 && source.bytes(offset, 2)? == [0x1f, 0x8b];
            encoding = if gzip { Encoding::Gzip } else { Encoding::Zlib };
        }
        Ok(Part { source, offset, encoding, skip: 0, text: data.text })
    }
}

/// Parses numbered files such as `slice%03d.raw 1 93 1`. Missing numbers default to 1 up to the number of slices.
/// Returns None if the first words are no pattern.
fn numbered(words: &[&str], slices: u64) -> Option<std::result::Result<Numbered, String>> {
    // File names may contain blanks, so numbers are taken from the end.
    let number = |word: &&str| word.parse::<i64>().ok();
    let tail: Vec<i64> = words.iter().rev().map_while(number).take(3).collect();
    let count = i64::try_from(slices).unwrap_or(i64::MAX);
    let [first, last, step] = match *tail.as_slice() {
        [step, last, first] => [first, last, step],
        [last, first] => [first, last, 1],
        [first] => [first, first.saturating_add(count - 1), 1],
        _ => [1, count, 1],
    };
    let pattern = Numbered::parse(&words[..words.len() - tail.len()].join(" "))?;
    Some(pattern.over(first, last, step).map_err(|rule| {
        let shown = text::shown(&words.join(" "));
        format!("\"{shown}\": {rule}; needed are a pattern, first and last number, and step")
    }))
}

pub(crate) struct Data {
    /// The files; None if the data follows the header.
    pub(crate) files: Option<Files>,
    text: bool,
    pub(crate) compressed: bool,
    /// Bytes before the data of each file; -1 locates the data from the end.
    skip: i64,
}
