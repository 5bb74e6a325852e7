//! What a file holds, and where: the walk over its keywords.

use super::stored::{Flags, Form, Stored};
use crate::error::{Error, Result};
use crate::io::arrays::{ArrayInfo, Association};
use crate::io::samples::{MAX_COMPONENTS, SampleType};
use crate::io::source::Source;
use crate::io::text::{self, Scanner};

/// What a file begins with.
pub(super) const MAGIC: &[u8] = b"# vtk DataFile Version";

/// The newest version that is known.
const NEWEST: (u32, u32) = (5, 1);

/// Most arrays of a file.
const MAX_ARRAYS: usize = 1 << 14;

/// Most names of a note.
const MAX_NAMES: usize = 16;

/// Bytes that are looked at to tell what comes next.
const AHEAD: usize = 600;

/// Every keyword that may stand after an array.
const KEYWORDS: [&str; 35] = [
    "ASPECT_RATIO",
    "BLANKING",
    "CELLS",
    "CELL_DATA",
    "CELL_TYPES",
    "COLOR_SCALARS",
    "CONNECTIVITY",
    "DIMENSIONS",
    "DIRECTION",
    "EDGE_FLAGS",
    "EXTENT",
    "FIELD",
    "GLOBAL_IDS",
    "LINES",
    "LOOKUP_TABLE",
    "METADATA",
    "NORMALS",
    "NULL_ARRAY",
    "OFFSETS",
    "ORIGIN",
    "PEDIGREE_IDS",
    "POINTS",
    "POINT_DATA",
    "POLYGONS",
    "SCALARS",
    "SPACING",
    "TENSORS",
    "TENSORS6",
    "TEXTURE_COORDINATES",
    "TRIANGLE_STRIPS",
    "VECTORS",
    "VERTICES",
    "X_COORDINATES",
    "Y_COORDINATES",
    "Z_COORDINATES",
];

/// The kind of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    StructuredPoints,
    RectilinearGrid,
    StructuredGrid,
    UnstructuredGrid,
    PolyData,
}

impl Kind {
    const ALL: [Self; 5] = [
        Self::StructuredPoints,
        Self::RectilinearGrid,
        Self::StructuredGrid,
        Self::UnstructuredGrid,
        Self::PolyData,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::StructuredPoints => "STRUCTURED_POINTS",
            Self::RectilinearGrid => "RECTILINEAR_GRID",
            Self::StructuredGrid => "STRUCTURED_GRID",
            Self::UnstructuredGrid => "UNSTRUCTURED_GRID",
            Self::PolyData => "POLYDATA",
        }
    }
}

/// Cells with their nodes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Cells {
    /// Each cell's number of nodes before its nodes.
    Inline { count: u64, numbers: Stored },
    /// Since version 5: where each cell's nodes begin, one more where the last end.
    Offsets { offsets: Stored, nodes: Stored },
}

impl Cells {
    pub(super) fn count(&self) -> u64 {
        match self {
            Self::Inline { count, .. } => *count,
            Self::Offsets { offsets, .. } => offsets.tuples.saturating_sub(1),
        }
    }
}

/// What a file holds.
#[derive(Debug)]
pub(super) struct Contents {
    pub(super) kind: Kind,
    pub(super) dims: Option<[u32; 3]>,
    /// Index of the first sample along each axis.
    pub(super) first: [f64; 3],
    pub(super) spacing: Option<[f64; 3]>,
    pub(super) origin: Option<[f64; 3]>,
    /// A matrix by rows; its columns are the axes.
    pub(super) direction: Option<[f64; 9]>,
    pub(super) coordinates: [Option<Stored>; 3],
    pub(super) points: Option<Stored>,
    pub(super) cells: Option<Cells>,
    pub(super) types: Option<Stored>,
    /// Vertices, lines, polygons and strips of triangles.
    pub(super) surface: [Option<u64>; 4],
    /// Arrays of points and cells, and where each lies.
    pub(super) arrays: Vec<ArrayInfo>,
    pub(super) stored: Vec<Stored>,
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
    /// For how many points and cells there is data.
    announced: [Option<u64>; 2],
    /// The first array that is called scalars, of points and of cells.
    scalars: [Option<usize>; 2],
}

impl Contents {
    /// Drops arrays that are not for so many points or cells, and marks the active one.
    pub(super) fn fit(&mut self, source: &Source, points: u64, cells: u64) -> Result<()> {
        let wanted = [points, cells];
        for ((count, wanted), what) in self.announced.iter().zip(wanted).zip(["POINT_DATA", "CELL_DATA"]) {
            if let Some(count) = count.filter(|&count| count != wanted) {
                return Err(source.error(what, format!("{count}: the data set has {wanted}")));
            }
        }
        if let Some(active) = self.scalars[0].or(self.scalars[1])
            && let Some(array) = self.arrays.get_mut(active)
        {
            array.active = true;
        }
        let arrays = std::mem::take(&mut self.arrays);
        let stored = std::mem::take(&mut self.stored);
        let mut misfits = Vec::new();
        for (array, stored) in arrays.into_iter().zip(stored) {
            let wanted = wanted[side(array.association)];
            if stored.tuples == wanted {
                self.arrays.push(array);
                self.stored.push(stored);
            } else {
                let misfit = format!("{array} has {} tuples instead of {wanted}", stored.tuples);
                remember(&mut misfits, misfit);
            }
        }
        if !misfits.is_empty() {
            self.warnings.push(format!("arrays left out: {}", misfits.join(", ")));
        }
        Ok(())
    }
}

/// Adds a name to those of a note, once, and no more than it has room for.
fn remember(names: &mut Vec<String>, name: String) {
    match names.len() {
        0..MAX_NAMES if !names.contains(&name) => names.push(name),
        MAX_NAMES => names.push("and more".to_owned()),
        _ => {}
    }
}

fn side(association: Association) -> usize {
    match association {
        Association::Point => 0,
        Association::Cell => 1,
    }
}

/// The type of a word, where numbers have it.
fn number_type(word: &str) -> Option<SampleType> {
    Some(match word.to_ascii_lowercase().as_str() {
        "bit" | "unsigned_char" => SampleType::U8,
        "char" | "signed_char" => SampleType::I8,
        "unsigned_short" => SampleType::U16,
        "short" => SampleType::I16,
        "unsigned_int" => SampleType::U32,
        // Written as 32 bits, whatever it is in the program.
        "int" | "vtkidtype" => SampleType::I32,
        "unsigned_long" | "vtktypeuint64" => SampleType::U64,
        "long" | "vtktypeint64" => SampleType::I64,
        "float" => SampleType::F32,
        "double" => SampleType::F64,
        _ => return None,
    })
}

/// A type of arrays that hold no numbers.
fn is_text_type(word: &str) -> bool {
    ["string", "utf8_string", "variant"].iter().any(|name| word.eq_ignore_ascii_case(name))
}

/// The two types that numbers of a name may have, the narrower first: `long` is what the writer's machine
/// had.
fn long_types(word: &str) -> Option<[SampleType; 2]> {
    match word.to_ascii_lowercase().as_str() {
        "long" => Some([SampleType::I32, SampleType::I64]),
        "unsigned_long" => Some([SampleType::U32, SampleType::U64]),
        _ => None,
    }
}

/// A name with what is encoded as `%20`.
fn decoded(name: &str) -> String {
    let bytes = name.as_bytes();
    let mut plain = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let code = || {
            let &[high, low] = bytes.get(at + 1..at + 3)? else { return None };
            let code = char::from(high).to_digit(16)? * 16 + char::from(low).to_digit(16)?;
            u8::try_from(code).ok()
        };
        match code().filter(|_| byte == b'%') {
            Some(code) => {
                plain.push(code);
                at += 3;
            }
            None => {
                plain.push(byte);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&plain).into_owned()
}

/// Whether text like this may follow an array: a keyword, another array of a field, or the end.
fn may_follow(bytes: &[u8]) -> bool {
    let bytes = bytes.trim_ascii_start();
    if bytes.is_empty() {
        return true;
    }
    let line = bytes.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let Ok(line) = std::str::from_utf8(line) else { return false };
    let mut words = line.split_ascii_whitespace();
    let word = words.next().unwrap_or_default().to_ascii_uppercase();
    let mut number = || words.next().is_some_and(|word| word.parse::<u64>().is_ok());
    KEYWORDS.contains(&word.as_str())
        || number()
            && number()
            && words.next().is_some_and(|kind| number_type(kind).is_some() || is_text_type(kind))
}

/// Walks over a file.
pub(super) struct Walk<'a> {
    scanner: Scanner<'a>,
    version: (u32, u32),
    binary: bool,
    contents: Contents,
    /// Whose data comes.
    section: Option<(Association, u64)>,
    /// Components of the last array.
    components: u64,
    /// Names of arrays that belong to the data set as a whole, of those that hold no numbers, and of those
    /// with none or too many in a tuple.
    apart: [Vec<String>; 3],
    long: bool,
}

impl<'a> Walk<'a> {
    pub(super) fn over(source: &'a Source) -> Result<Contents> {
        let mut scanner = Scanner::new(source);
        let line = scanner.next_line()?.unwrap_or_default();
        let is_magic =
            line.get(..MAGIC.len()).is_some_and(|begin| begin.as_bytes().eq_ignore_ascii_case(MAGIC));
        let version = line.get(MAGIC.len()..).filter(|_| is_magic).and_then(version).ok_or_else(|| {
            let shown = text::shown(&line);
            scanner
                .line_error(format!("\"{shown}\": must be \"# vtk DataFile Version\" and a number like 3.0"))
        })?;
        // The title says nothing.
        scanner.next_line()?;
        let binary = match scanner.word()?.map(str::to_ascii_uppercase).as_deref() {
            Some("ASCII") => false,
            Some("BINARY") => true,
            other => {
                let shown = text::shown(other.unwrap_or_default());
                return Err(scanner.error(format!("\"{shown}\": must be ASCII or BINARY")));
            }
        };
        let keyword = scanner.word()?.map(str::to_ascii_uppercase);
        if keyword.as_deref() != Some("DATASET") {
            let shown = text::shown(&keyword.unwrap_or_default());
            return Err(scanner.error(format!("\"{shown}\": must be DATASET")));
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
            contents: Contents {
                kind,
                dims: None,
                first: [0.0; 3],
                spacing: None,
                origin: None,
                direction: None,
                coordinates: [None; 3],
                points: None,
                cells: None,
                types: None,
                surface: [None; 4],
                arrays: Vec::new(),
                stored: Vec::new(),
                notes: Vec::new(),
                warnings: Vec::new(),
                announced: [None; 2],
                scalars: [None; 2],
            },
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
            contents.notes.push("long numbers take 4 bytes, as what follows them shows".to_owned());
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

    /// An error about what was read last.
    fn error(&self, rule: impl Into<String>) -> Error {
        if self.binary {
            // Lines end somewhere in binary data.
            self.scanner.source().error(format!("before byte {}", self.scanner.position()), rule)
        } else {
            self.scanner.error(rule)
        }
    }

    fn word(&mut self, what: &str) -> Result<String> {
        let word = self.scanner.word()?.map(str::to_owned);
        word.ok_or_else(|| self.error(format!("ends before {what}")))
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T> {
        let word = self.word(what)?;
        word.parse().map_err(|_| self.error(format!("\"{}\": must be {what}", text::shown(&word))))
    }

    fn count(&mut self, what: &str) -> Result<u64> {
        self.number(&format!("the number of {what}"))
    }

    fn numbers<T: std::str::FromStr + Copy + Default, const N: usize>(
        &mut self,
        what: &str,
    ) -> Result<[T; N]> {
        let mut numbers = [T::default(); N];
        for number in &mut numbers {
            *number = self.number(what)?;
        }
        Ok(numbers)
    }

    /// Whether this word comes next, after blanks.
    fn comes(&mut self, word: &str) -> Result<bool> {
        let ahead = self.scanner.peek(64 + word.len())?.trim_ascii_start();
        let (own, rest) = ahead.split_at(word.len().min(ahead.len()));
        Ok(own.eq_ignore_ascii_case(word.as_bytes()) && rest.first().is_none_or(u8::is_ascii_whitespace))
    }

    /// Whether something comes on the same line.
    fn more_on_line(&mut self) -> Result<bool> {
        let ahead = self.scanner.peek(64)?;
        Ok(ahead.iter().find(|byte| !matches!(byte, b' ' | b'\t' | b'\r')).is_some_and(|&byte| byte != b'\n'))
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
                // VTK takes the last of both names.
                let spacing: [f64; 3] = self.numbers("a spacing")?;
                let before = self.contents.spacing.replace(spacing);
                if let Some([i, j, k]) = before.filter(|before| *before != spacing)
                    && self.contents.warnings.len() < MAX_NAMES
                {
                    let [x, y, z] = spacing;
                    let rule = format!("the spacing before was {i} {j} {k}, the last counts");
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
                let count = self.count("points")?;
                let points = self.typed(count, 3)?;
                self.once(keyword, |contents| &mut contents.points, points)
            }
            ("BLANKING", StructuredGrid) => {
                let count = self.count("points")?;
                let mut stored = self.typed(count, 1)?;
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

    /// Sets what may be given once.
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
            *extent = range.ok_or_else(|| self.error(format!("EXTENT {first} to {last}: must not fall")))?;
        }
        self.contents.first = [x0, y0, z0].map(f64::from);
        self.once("EXTENT", |contents| &mut contents.dims, dims)
    }

    fn coordinates(&mut self, keyword: &str, axis: usize) -> Result<()> {
        let count = self.count("coordinates")?;
        let stored = self.typed(count, 1)?;
        self.once(keyword, |contents| &mut contents.coordinates[axis], stored)
    }

    fn cells(&mut self) -> Result<Cells> {
        let count = self.count("cells")?;
        let size = self.count("numbers of cells")?;
        if !self.comes("OFFSETS")? {
            let numbers = self.array("int", size, 1)?.ok_or_else(|| self.error("no numbers"))?;
            // Each cell has its number of nodes at least.
            if count > size {
                let source = self.scanner.source();
                return Err(numbers.error(source, format!("{count} cells in {size} numbers: too few")));
            }
            return Ok(Cells::Inline { count, numbers });
        }
        self.scanner.word()?;
        let offsets = self.typed(count, 1)?;
        if self.comes("METADATA")? {
            self.scanner.word()?;
            self.metadata()?;
        }
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
            return Err(self.error(format!("{count}: there is data for {before} before")));
        }
        self.section = Some((association, count));
        Ok(())
    }

    /// An array of the section.
    fn attribute(&mut self, keyword: &str) -> Result<()> {
        let kind = self.contents.kind.name();
        let known = [
            "SCALARS",
            "COLOR_SCALARS",
            "LOOKUP_TABLE",
            "VECTORS",
            "NORMALS",
            "TENSORS",
            "TENSORS6",
            "TEXTURE_COORDINATES",
            "GLOBAL_IDS",
            "PEDIGREE_IDS",
            "EDGE_FLAGS",
        ];
        if !known.contains(&keyword) {
            let shown = text::shown(keyword);
            return Err(
                self.error(format!("\"{shown}\": is no keyword of {kind}, or data before it is longer"))
            );
        }
        let Some((association, count)) = self.section else {
            return Err(self.error(format!("{keyword}: must follow POINT_DATA or CELL_DATA")));
        };
        let name = decoded(&self.word("a name")?);
        let stored = match keyword {
            "LOOKUP_TABLE" => {
                let size = self.count("colours")?;
                self.array(if self.binary { "unsigned_char" } else { "float" }, size, 4)?;
                return Ok(());
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
                let kind = if self.binary { "unsigned_char" } else { "float" };
                let stored = self.array(kind, count, components)?;
                let bytes = |stored: Stored| match stored.form {
                    Form::Words => Stored { kind: SampleType::U8, form: Form::Shares, ..stored },
                    _ => stored,
                };
                stored.map(bytes)
            }
            _ => {
                let components = match keyword {
                    "VECTORS" | "NORMALS" => 3,
                    "TENSORS" => 9,
                    "TENSORS6" => 6,
                    "TEXTURE_COORDINATES" => self.count("components")?,
                    _ => 1,
                };
                let kind = self.word("a type")?;
                self.array(&kind, count, components)?
            }
        };
        match stored {
            Some(stored) => {
                let index = self.contents.arrays.len();
                self.list(name, association, stored)?;
                let first = &mut self.contents.scalars[side(association)];
                if keyword.ends_with("SCALARS") && first.is_none() && self.contents.arrays.len() > index {
                    *first = Some(index);
                }
                Ok(())
            }
            None => {
                self.apart(1, name);
                Ok(())
            }
        }
    }

    fn field(&mut self) -> Result<()> {
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
                (Some(stored), Some((association, _))) => {
                    let levels = self.version.0 < 4 && name == "vtkGhostLevels";
                    if levels && stored.kind == SampleType::U8 {
                        let stored = Stored { flags: Flags::Levels, ..stored };
                        self.list("vtkGhostType".to_owned(), association, stored)?;
                    } else {
                        self.list(name, association, stored)?;
                    }
                }
                (Some(_), None) => self.apart(0, name),
                (None, _) => self.apart(1, name),
            }
            if self.comes("METADATA")? {
                self.scanner.word()?;
                self.metadata()?;
            }
        }
        Ok(())
    }

    /// Remembers a name for a note.
    fn apart(&mut self, which: usize, name: String) {
        remember(&mut self.apart[which], name);
    }

    /// Adds an array of points or cells.
    fn list(&mut self, name: String, association: Association, stored: Stored) -> Result<()> {
        let Stored { kind, components, .. } = stored;
        if components == 0 || components > MAX_COMPONENTS {
            self.apart(2, name);
            return Ok(());
        }
        if self.contents.arrays.len() == MAX_ARRAYS {
            return Err(self.error(format!("array \"{name}\": there may be {MAX_ARRAYS} arrays")));
        }
        self.contents.arrays.push(ArrayInfo { name, association, kind, components, active: false });
        self.contents.stored.push(stored);
        Ok(())
    }

    /// An array whose type comes first, and that must hold numbers.
    fn typed(&mut self, tuples: u64, components: u64) -> Result<Stored> {
        let kind = self.word("a type")?;
        let stored = self.array(&kind, tuples, components)?;
        stored.ok_or_else(|| self.error(format!("type {kind}: numbers are needed")))
    }

    /// Passes over an array that begins on the next line, after its type. None if it holds no numbers.
    fn array(&mut self, word: &str, tuples: u64, components: u64) -> Result<Option<Stored>> {
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
        let mut stored = Stored {
            offset: 0,
            line: 0,
            tuples,
            components: usize::try_from(components).unwrap_or(usize::MAX),
            kind,
            form: Form::Words,
            flags: Flags::AsTheyAre,
        };
        if !self.binary {
            (stored.offset, stored.line) = (self.scanner.position(), self.scanner.lines());
            let most = text::most_numbers(self.scanner.available());
            if numbers > most {
                return Err(self.error(format!("{numbers} numbers are announced: at most {most} can follow")));
            }
            self.scanner.skip_numbers(numbers)?;
            return Ok(Some(stored));
        }
        self.end_line()?;
        (stored.offset, stored.line) = (self.scanner.position(), self.scanner.lines());
        let bit = word.eq_ignore_ascii_case("bit");
        stored.form = if bit { Form::Bits } else { Form::Bytes };
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

    /// Ends the line before binary data.
    fn end_line(&mut self) -> Result<()> {
        match self.scanner.next_line()? {
            Some(rest) if !rest.trim().is_empty() => {
                let shown = text::shown(rest.trim());
                Err(self.error(format!("\"{shown}\": binary data must begin on the next line")))
            }
            _ => Ok(()),
        }
    }

    /// Passes over strings: lines of text, or lengths with bytes. Variants are always words.
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
            // The two highest bits tell how long the length is.
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

    /// Passes over what is told of the last array: to an empty line.
    fn metadata(&mut self) -> Result<()> {
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

/// The version in words.
fn version(text: &str) -> Option<(u32, u32)> {
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
