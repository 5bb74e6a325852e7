//! The first pass over a file: its state, the header and the keywords.

use crate::error::{Error, Result};
use crate::io::build::arrays::Association;
use crate::io::file::decode::MAX_COMPONENTS;
use crate::io::file::sample_type::SampleType;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::vtk_legacy::contents::{Cells, Contents, Kind, MAX_NAMES, side};
use crate::io::formats::vtk_legacy::keywords::{MAGIC, version};
use crate::io::formats::vtk_legacy::stored::{Flags, Stored};

/// The newest supported version.
const NEWEST: (u32, u32) = (5, 1);

/// The state of the first pass.
pub(crate) struct Walk<'a> {
    pub(crate) scanner: Scanner<'a>,
    pub(crate) version: (u32, u32),
    pub(crate) binary: bool,
    pub(crate) contents: Contents,
    /// The current section of attributes: points or cells, and their number.
    pub(crate) section: Option<(Association, u64)>,
    /// The number of components of the last array.
    pub(crate) components: u64,
    /// Names of arrays left out: of the data set as a whole, without numbers, without or with too many components.
    pub(crate) apart: [Vec<String>; 3],
    pub(crate) long: bool,
}

impl<'a> Walk<'a> {
    /// Returns an error about the current place.
    pub(crate) fn error(&self, rule: impl Into<String>) -> Error {
        if self.binary {
            // Line numbers mean nothing in binary files.
            self.scanner.source().error(format!("before byte {}", self.scanner.position()), rule)
        } else {
            self.scanner.error(rule)
        }
    }

    pub(crate) fn word(&mut self, what: &str) -> Result<String> {
        let word = self.scanner.word()?.map(str::to_owned);
        word.ok_or_else(|| self.error(format!("ends before {what}")))
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T> {
        let word = self.word(what)?;
        word.parse().map_err(|_| self.error(format!("\"{}\": must be {what}", text::shown(&word))))
    }

    pub(crate) fn count(&mut self, what: &str) -> Result<u64> {
        self.number(&format!("the number of {what}"))
    }

    pub(crate) fn numbers<T: std::str::FromStr + Copy + Default, const N: usize>(
        &mut self,
        what: &str,
    ) -> Result<[T; N]> {
        let mut numbers = [T::default(); N];
        for number in &mut numbers {
            *number = self.number(what)?;
        }
        Ok(numbers)
    }

    /// Whether this word follows, after blanks.
    pub(crate) fn comes(&mut self, word: &str) -> Result<bool> {
        let ahead = self.scanner.peek(64 + word.len())?.trim_ascii_start();
        let (own, rest) = ahead.split_at(word.len().min(ahead.len()));
        Ok(own.eq_ignore_ascii_case(word.as_bytes()) && rest.first().is_none_or(u8::is_ascii_whitespace))
    }

    /// Whether anything follows on the same line.
    pub(crate) fn more_on_line(&mut self) -> Result<bool> {
        let ahead = self.scanner.peek(64)?;
        Ok(ahead.iter().find(|byte| !matches!(byte, b' ' | b'\t' | b'\r')).is_some_and(|&byte| byte != b'\n'))
    }

    pub(crate) fn over(source: &'a Source) -> Result<Contents> {
        let mut scanner = Scanner::new(source);
        let line = scanner.next_line()?.unwrap_or_default();
        let (magic, rest) = line.split_at_checked(MAGIC.len()).unwrap_or_default();
        let is_magic = magic.as_bytes().eq_ignore_ascii_case(MAGIC);
        let Some(version) = version(rest).filter(|_| is_magic) else {
            let rule = "must be \"# vtk DataFile Version\" and a number like 3.0";
            return Err(scanner.line_error(format!("\"{}\": {rule}", text::shown(&line))));
        };
        // The title is ignored.
        scanner.next_line()?;
        let word = scanner.word()?.unwrap_or_default().to_ascii_uppercase();
        let binary = word == "BINARY";
        if !binary && word != "ASCII" {
            return Err(scanner.error(format!("\"{}\": must be ASCII or BINARY", text::shown(&word))));
        }
        let word = scanner.word()?.unwrap_or_default().to_ascii_uppercase();
        if word != "DATASET" {
            return Err(scanner.error(format!("\"{}\": must be DATASET", text::shown(&word))));
        }
        let name = scanner.word()?.unwrap_or_default().to_ascii_uppercase();
        let Some(kind) = Kind::ALL.into_iter().find(|kind| kind.name() == name) else {
            let known = Kind::ALL.map(Kind::name).join(", ");
            let shown = text::shown(&name);
            return Err(scanner.error(format!("DATASET \"{shown}\": must be one of {known}")));
        };
        let mut walk = Self {
            scanner,
            version,
            binary,
            contents: Contents { kind, ..Contents::default() },
            section: None,
            components: 0,
            apart: [const { Vec::new() }; 3],
            long: false,
        };
        if version > NEWEST {
            let (major, minor) = version;
            walk.contents.warnings.push(format!("version {major}.{minor} is newer than the reader's 5.1"));
        }
        while let Some(keyword) = walk.scanner.word()?.map(str::to_ascii_uppercase) {
            walk.keyword(&keyword)?;
        }
        Ok(walk.end())
    }

    fn end(self) -> Contents {
        let mut contents = self.contents;
        if self.long {
            contents.notes.push("numbers of type long have 4 bytes, as the text after them shows".to_owned());
        }
        let [whole, text, tuples] = self.apart;
        let many = format!("without components, or with more than {MAX_COMPONENTS},");
        for (names, what) in
            [(whole, "of the data set as a whole"), (text, "without numbers"), (tuples, &many)]
        {
            if !names.is_empty() {
                contents.notes.push(format!("arrays {what} left out: {}", names.join(", ")));
            }
        }
        contents
    }

    fn keyword(&mut self, keyword: &str) -> Result<()> {
        use Kind::{PolyData, RectilinearGrid, StructuredGrid, StructuredPoints, UnstructuredGrid};
        let kind = self.contents.kind;
        match (keyword, kind) {
            ("FIELD", _) => self.field(),
            ("METADATA", _) => self.metadata(),
            ("POINT_DATA", _) => self.begin_data(Association::Point),
            ("CELL_DATA", _) => self.begin_data(Association::Cell),
            ("DIMENSIONS", StructuredPoints | RectilinearGrid | StructuredGrid) => {
                let dims = self.numbers("a whole number of samples")?;
                self.once(keyword, |contents| &mut contents.dims, dims)
            }
            ("EXTENT", StructuredPoints | RectilinearGrid | StructuredGrid) => self.extent(),
            ("SPACING" | "ASPECT_RATIO", StructuredPoints) => {
                // As in VTK, the last of both keywords wins.
                let spacing: [f64; 3] = self.numbers("a spacing")?;
                let before = self.contents.spacing.replace(spacing);
                if let Some([i, j, k]) = before.filter(|before| *before != spacing)
                    && self.contents.warnings.len() < MAX_NAMES
                {
                    let [x, y, z] = spacing;
                    let rule = format!("the previous spacing was {i} {j} {k}, the last one is used");
                    self.contents.warnings.push(format!("{keyword} {x} {y} {z}: {rule}"));
                }
                Ok(())
            }
            ("ORIGIN", StructuredPoints) => {
                let origin = self.numbers("a coordinate")?;
                self.once(keyword, |contents| &mut contents.origin, origin)
            }
            ("DIRECTION", StructuredPoints) => {
                let direction = self.numbers("a number of a matrix")?;
                self.once(keyword, |contents| &mut contents.direction, direction)
            }
            ("X_COORDINATES", RectilinearGrid) => self.coordinates(keyword, 0),
            ("Y_COORDINATES", RectilinearGrid) => self.coordinates(keyword, 1),
            ("Z_COORDINATES", RectilinearGrid) => self.coordinates(keyword, 2),
            ("POINTS", StructuredGrid | UnstructuredGrid | PolyData) => {
                let points = self.counted("points", 3)?;
                self.once(keyword, |contents| &mut contents.points, points)
            }
            ("BLANKING", StructuredGrid) => {
                let mut stored = self.counted("points", 1)?;
                stored.flags = Flags::Visible;
                if stored.kind != SampleType::U8 {
                    return Err(self.error("BLANKING: must be of type unsigned_char"));
                }
                self.list("vtkGhostType".to_owned(), Association::Point, stored)
            }
            ("CELLS", UnstructuredGrid) => {
                let cells = self.cells()?;
                self.once(keyword, |contents| &mut contents.cells, cells)
            }
            ("CELL_TYPES", UnstructuredGrid) => {
                let count = self.count("cells")?;
                let types = self.array("int", count, 1)?;
                let types = types.ok_or_else(|| self.error("no numbers"))?;
                self.once(keyword, |contents| &mut contents.types, types)
            }
            ("VERTICES", PolyData) => self.surface(keyword, 0),
            ("LINES", PolyData) => self.surface(keyword, 1),
            ("POLYGONS", PolyData) => self.surface(keyword, 2),
            ("TRIANGLE_STRIPS", PolyData) => self.surface(keyword, 3),
            _ => self.attribute(keyword),
        }
    }

    /// Reads the number and the type of tuples, then records and skips them.
    fn counted(&mut self, what: &str, components: u64) -> Result<Stored> {
        let count = self.count(what)?;
        self.typed(count, components)
    }

    /// Sets a value that may be given once.
    fn once<T>(
        &mut self,
        keyword: &str,
        place: impl FnOnce(&mut Contents) -> &mut Option<T>,
        value: T,
    ) -> Result<()> {
        if place(&mut self.contents).replace(value).is_some() {
            return Err(self.error(format!("{keyword}: given before")));
        }
        Ok(())
    }

    fn extent(&mut self) -> Result<()> {
        let [x0, x1, y0, y1, z0, z1] = self.numbers::<i32, 6>("a whole number")?;
        let mut dims = [0; 3];
        let pairs = [(x0, x1), (y0, y1), (z0, z1)];
        for (extent, (first, last)) in dims.iter_mut().zip(pairs) {
            let range = u32::try_from(i64::from(last) - i64::from(first) + 1).ok();
            *extent =
                range.ok_or_else(|| self.error(format!("EXTENT {first} to {last}: must not decrease")))?;
        }
        self.contents.first = [x0, y0, z0].map(f64::from);
        self.once("EXTENT", |contents| &mut contents.dims, dims)
    }

    fn coordinates(&mut self, keyword: &str, axis: usize) -> Result<()> {
        let stored = self.counted("coordinates", 1)?;
        self.once(keyword, |contents| &mut contents.coordinates[axis], stored)
    }

    fn cells(&mut self) -> Result<Cells> {
        let count = self.count("cells")?;
        let size = self.count("numbers of cells")?;
        if !self.comes("OFFSETS")? {
            let numbers = self.array("int", size, 1)?.ok_or_else(|| self.error("no numbers"))?;
            // Each cell has at least its number of nodes.
            if count > size {
                let source = self.scanner.source();
                return Err(numbers.error(source, format!("{count} cells in {size} numbers: too few")));
            }
            return Ok(Cells::Inline { count, numbers });
        }
        self.scanner.word()?;
        let offsets = self.typed(count, 1)?;
        self.metadata_of_array()?;
        let word = self.word("CONNECTIVITY")?;
        if !word.eq_ignore_ascii_case("CONNECTIVITY") {
            return Err(self.error(format!("\"{}\": must be CONNECTIVITY", text::shown(&word))));
        }
        let nodes = self.typed(size, 1)?;
        Ok(Cells::Offsets { offsets, nodes })
    }

    fn surface(&mut self, keyword: &str, which: usize) -> Result<()> {
        let count = self.cells()?.count();
        self.once(keyword, |contents| &mut contents.surface[which], count)
    }

    fn begin_data(&mut self, association: Association) -> Result<()> {
        let count = self.count("tuples")?;
        let before = self.contents.announced[side(association)].replace(count);
        if let Some(before) = before.filter(|&before| before != count) {
            return Err(self.error(format!("{count}: the data before is for {before}")));
        }
        self.section = Some((association, count));
        Ok(())
    }
}
