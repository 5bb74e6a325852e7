//! The first pass over a file: arrays, which are recorded and skipped.

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association};
use crate::io::file::decode::MAX_COMPONENTS;
use crate::io::file::sample_type::SampleType;
use crate::io::file::text;
use crate::io::formats::vtk_legacy::contents::{remember, side};
use crate::io::formats::vtk_legacy::keywords::{decoded, is_text_type, long_types, may_follow, number_type};
use crate::io::formats::vtk_legacy::stored::{Flags, Form, Stored};
use crate::io::formats::vtk_legacy::walk::Walk;

/// The limit on arrays of a file.
const MAX_ARRAYS: usize = 1 << 14;

/// The number of bytes read ahead to identify what follows.
const AHEAD: usize = 600;

impl<'a> Walk<'a> {
    /// Reads an attribute array of the current section.
    pub(crate) fn attribute(&mut self, keyword: &str) -> Result<()> {
        let components = match keyword {
            "VECTORS" | "NORMALS" => Some(3),
            "TENSORS" => Some(9),
            "TENSORS6" => Some(6),
            "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" => Some(1),
            "SCALARS" | "COLOR_SCALARS" | "LOOKUP_TABLE" | "TEXTURE_COORDINATES" => None,
            _ => {
                let (shown, kind) = (text::shown(keyword), self.contents.kind.name());
                let rule = format!("\"{shown}\": is not a keyword of {kind}, or data before it is longer");
                return Err(self.error(rule));
            }
        };
        let Some((association, count)) = self.section else {
            return Err(self.error(format!("{keyword}: must follow POINT_DATA or CELL_DATA")));
        };
        let name = decoded(&self.word("a name")?);
        let colours = if self.binary { "unsigned_char" } else { "float" };
        let stored = match keyword {
            "LOOKUP_TABLE" => {
                let size = self.count("colours")?;
                return self.array(colours, size, 4).map(drop);
            }
            "SCALARS" => {
                let kind = self.word("a type")?;
                let mut components = 1;
                if self.more_on_line()? && !self.comes("LOOKUP_TABLE")? {
                    components = self.count("components")?;
                }
                if self.comes("LOOKUP_TABLE")? {
                    self.scanner.word()?;
                    self.word("the name of a table")?;
                }
                self.array(&kind, count, components)?
            }
            "COLOR_SCALARS" => {
                let components = self.count("components")?;
                let mut stored = self.array(colours, count, components)?;
                if let Some(stored) = stored.as_mut().filter(|stored| stored.form == Form::Words) {
                    (stored.kind, stored.form) = (SampleType::U8, Form::Shares);
                }
                stored
            }
            _ => {
                let components = components.map_or_else(|| self.count("components"), Ok)?;
                let kind = self.word("a type")?;
                self.array(&kind, count, components)?
            }
        };
        let Some(stored) = stored else {
            self.apart(1, name);
            return Ok(());
        };
        let index = self.contents.arrays.len();
        self.list(name, association, stored)?;
        let first = &mut self.contents.scalars[side(association)];
        if keyword.ends_with("SCALARS") && first.is_none() && self.contents.arrays.len() > index {
            *first = Some(index);
        }
        Ok(())
    }

    pub(crate) fn field(&mut self) -> Result<()> {
        self.word("the name of a field")?;
        let count = self.count("arrays")?;
        for _ in 0..count {
            let name = self.word("the name of an array")?;
            if name == "NULL_ARRAY" {
                continue;
            }
            let name = decoded(&name);
            let components = self.count("components")?;
            let tuples = self.count("tuples")?;
            let kind = self.word("a type")?;
            let stored = self.array(&kind, tuples, components)?;
            match (stored, self.section) {
                (Some(stored), Some((association, _)))
                    if self.version.0 < 4 && name == "vtkGhostLevels" && stored.kind == SampleType::U8 =>
                {
                    let stored = Stored { flags: Flags::Levels, ..stored };
                    self.list("vtkGhostType".to_owned(), association, stored)?;
                }
                (Some(stored), Some((association, _))) => self.list(name, association, stored)?,
                (Some(_), None) => self.apart(0, name),
                (None, _) => self.apart(1, name),
            }
            self.metadata_of_array()?;
        }
        Ok(())
    }

    /// Remembers a name for a note.
    fn apart(&mut self, which: usize, name: String) {
        remember(&mut self.apart[which], name);
    }

    /// Adds an array of points or cells.
    pub(crate) fn list(&mut self, name: String, association: Association, stored: Stored) -> Result<()> {
        let Stored { kind, components, .. } = stored;
        if components == 0 || components > MAX_COMPONENTS {
            self.apart(2, name);
            return Ok(());
        }
        if self.contents.arrays.len() == MAX_ARRAYS {
            return Err(self.error(format!("array \"{name}\": there may be {MAX_ARRAYS} arrays")));
        }
        let info = ArrayInfo { name, association, kind, components, active: false };
        self.contents.arrays.push((info, stored));
        Ok(())
    }

    /// Reads the type of an array of numbers, then records and skips it.
    pub(crate) fn typed(&mut self, tuples: u64, components: u64) -> Result<Stored> {
        let kind = self.word("a type")?;
        let stored = self.array(&kind, tuples, components)?;
        stored.ok_or_else(|| self.error(format!("type {kind}: numbers are needed")))
    }

    /// Skips an array that begins on the next line, and returns its place; None if it holds no numbers.
    pub(crate) fn array(&mut self, word: &str, tuples: u64, components: u64) -> Result<Option<Stored>> {
        self.components = components;
        let overflow = |walk: &Self| walk.error(format!("{tuples} tuples of {components}: too many numbers"));
        let numbers = tuples.checked_mul(components).ok_or_else(|| overflow(self))?;
        if is_text_type(word) {
            self.skip_text(word, numbers)?;
            return Ok(None);
        }
        let Some(kind) = number_type(word) else {
            let shown = text::shown(word);
            return Err(self.error(format!("type \"{shown}\": must be one of bit, char, short, int, long, float, double, \
                 unsigned_char, unsigned_short, unsigned_int, unsigned_long, vtkIdType, vtktypeint64, vtktypeuint64, string")));
        };
        if self.binary {
            self.end_line()?;
        }
        let bit = word.eq_ignore_ascii_case("bit");
        let mut stored = Stored {
            offset: self.scanner.position(),
            line: self.scanner.lines(),
            tuples,
            components: usize::try_from(components).unwrap_or(usize::MAX),
            kind,
            form: match self.binary {
                false => Form::Words,
                true if bit => Form::Bits,
                true => Form::Bytes,
            },
            flags: Flags::AsTheyAre,
        };
        if !self.binary {
            let most = text::most_numbers(self.scanner.available());
            if numbers > most {
                return Err(self.error(format!("{numbers} numbers are announced: at most {most} can follow")));
            }
            self.scanner.skip_numbers(numbers)?;
            return Ok(Some(stored));
        }
        let size = |kind: SampleType| {
            if bit { Some(numbers.div_ceil(8)) } else { numbers.checked_mul(kind.bytes()) }
        };
        let longs = long_types(word).filter(|_| numbers > 0);
        let narrow = longs.map_or(kind, |[narrow, _]| narrow);
        let bytes = size(narrow).ok_or_else(|| overflow(self))?;
        self.skip_bytes(bytes)?;
        if let Some([narrow, wide]) = longs {
            if may_follow(self.scanner.peek(AHEAD)?) {
                stored.kind = narrow;
                self.long = true;
            } else {
                stored.kind = wide;
                self.skip_bytes(bytes)?;
            }
        }
        Ok(Some(stored))
    }

    fn skip_bytes(&mut self, bytes: u64) -> Result<()> {
        let most = self.scanner.available();
        if bytes > most {
            return Err(self.error(format!("{bytes} bytes are announced: at most {most} can follow")));
        }
        self.scanner.skip(bytes)
    }

    /// Ends the line before binary data; it must be blank.
    fn end_line(&mut self) -> Result<()> {
        match self.scanner.next_line()? {
            Some(rest) if !rest.trim().is_empty() => {
                let shown = text::shown(rest.trim());
                Err(self.error(format!("\"{shown}\": binary data must begin on the next line")))
            }
            _ => Ok(()),
        }
    }

    /// Skips strings: lines of text, or lengths and bytes. Variants are always text.
    fn skip_text(&mut self, word: &str, count: u64) -> Result<()> {
        if word.eq_ignore_ascii_case("variant") {
            for _ in 0..count {
                self.word("the type of a variant")?;
                self.word("a variant")?;
            }
            return Ok(());
        }
        self.end_line()?;
        for i in 0..count {
            let ends = |walk: &Self| walk.error(format!("ends before string {i} of {count}"));
            if !self.binary {
                if !self.scanner.skip_line()? {
                    return Err(ends(self));
                }
                continue;
            }
            // The two highest bits encode the size of the length field.
            let first = self.scanner.peek(1)?.first().copied();
            let size = match first.ok_or_else(|| ends(self))? >> 6 {
                3 => 1,
                2 => 2,
                1 => 4,
                _ => 8,
            };
            let prefix = self.scanner.peek(size)?;
            if prefix.len() < size {
                return Err(ends(self));
            }
            let length = prefix.iter().fold(0_u64, |length, &byte| length << 8 | u64::from(byte));
            let length = if size == 8 { length } else { length & !(3 << (8 * size - 2)) };
            self.skip_bytes(length.saturating_add(u64::try_from(size).unwrap_or(0)))?;
        }
        Ok(())
    }

    /// Skips the metadata of the last array, if it has any.
    pub(crate) fn metadata_of_array(&mut self) -> Result<()> {
        if !self.comes("METADATA")? {
            return Ok(());
        }
        self.scanner.word()?;
        self.metadata()
    }

    /// Skips the metadata of the last array, up to an empty line.
    pub(crate) fn metadata(&mut self) -> Result<()> {
        self.end_line()?;
        let mut keys = 0_u64;
        while let Some(line) = self.scanner.next_line()? {
            let upper = line.trim().to_ascii_uppercase();
            if upper.is_empty() {
                if keys == 0 || may_follow(self.scanner.peek(AHEAD)?) {
                    return Ok(());
                }
            } else if upper.starts_with("COMPONENT_NAMES") {
                for _ in 0..self.components {
                    if self.scanner.next_line()?.is_none() {
                        break;
                    }
                }
            } else if let Some(count) = upper.strip_prefix("INFORMATION") {
                keys = count.trim().parse().unwrap_or(0);
            } else if upper.starts_with("NAME ") {
                keys = keys.saturating_sub(1);
            }
        }
        if keys > 0 {
            return Err(self.error(format!("ends within metadata: {keys} more entries are announced")));
        }
        Ok(())
    }
}
