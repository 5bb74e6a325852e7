//! The structure of VTK's XML files: what there is, and where the numbers of each array lie.
//!
//! Text is passed over, not kept. The document is read up to its appended data, which need not be XML.

use std::io::{BufRead, ErrorKind, Read};
use std::mem;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use super::samples::{Endian, MAX_COMPONENTS, SampleType};
use super::source::{Budget, Source};
use super::text::{shown, stream_error};
use crate::error::{Error, Result};
use crate::num;

/// Longest tag or comment, in bytes.
const MAX_MARKUP: usize = 1 << 20;

/// Most elements within each other.
const MAX_DEPTH: usize = 64;

/// Longest name of an element or an array, in bytes: those of open elements are kept.
const MAX_NAME: usize = 256;

/// Most attributes of an element.
const MAX_ATTRIBUTES: usize = 64;

/// Most pieces, and most arrays in all of them.
const MAX_COUNT: usize = 1 << 16;

/// What the points of a data set are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Image,
    Rectilinear,
    Unstructured,
}

/// The packing of blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compressor {
    Zlib,
    Lz4,
    Lzma,
}

/// How the bytes of arrays are stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Storage {
    pub(super) endian: Endian,
    /// Bytes of a number in the header of an array: 4 or 8.
    pub(super) word: u64,
    pub(super) compressor: Option<Compressor>,
    pub(super) appended: Option<Appended>,
}

/// Data after the document.
#[derive(Clone, Copy, Debug)]
pub(super) struct Appended {
    /// Where offsets count from.
    pub(super) begin: u64,
    pub(super) base64: bool,
}

/// Text of the document.
#[derive(Clone, Copy, Debug)]
pub(super) struct Text {
    pub(super) begin: u64,
    pub(super) end: u64,
    /// Lines before it.
    pub(super) line: u64,
}

/// Where the numbers of an array lie.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place {
    /// As words.
    Words(Text),
    /// As bytes in base64.
    Base64(Text),
    /// In the appended data.
    Appended(u64),
}

/// An array.
#[derive(Debug)]
pub(super) struct Array {
    pub(super) name: String,
    pub(super) line: u64,
    /// The type of a number, or why it cannot be read.
    pub(super) kind: std::result::Result<SampleType, String>,
    pub(super) components: usize,
    pub(super) place: Place,
}

impl Array {
    /// Where it is, for messages.
    pub(super) fn at(&self) -> String {
        format!("line {}, DataArray \"{}\"", self.line, shown(&self.name))
    }
}

/// The parts of a piece that hold arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Section {
    PointData,
    CellData,
    Points,
    Cells,
    Coordinates,
}

impl Section {
    const ALL: [(&'static str, Self); 5] = [
        ("PointData", Self::PointData),
        ("CellData", Self::CellData),
        ("Points", Self::Points),
        ("Cells", Self::Cells),
        ("Coordinates", Self::Coordinates),
    ];
}

/// First and last index of points along each axis.
pub(super) type Extent = [[i64; 2]; 3];

/// A part of the data set.
#[derive(Debug, Default)]
pub(super) struct Piece {
    pub(super) line: u64,
    /// Of an image or a rectilinear grid.
    pub(super) extent: Extent,
    /// Of an unstructured grid.
    pub(super) points: u64,
    /// Of an unstructured grid.
    pub(super) cells: u64,
    /// Names of the scalars and the vectors to show: of points, and of cells.
    pub(super) active: [[Option<String>; 2]; 2],
    arrays: Vec<(Section, Array)>,
}

impl Piece {
    /// The arrays of a part.
    pub(super) fn arrays(&self, section: Section) -> impl Iterator<Item = &Array> {
        self.arrays.iter().filter(move |(own, _)| *own == section).map(|(_, array)| array)
    }

    /// An array by name.
    pub(super) fn array(&self, section: Section, name: &str) -> Option<&Array> {
        self.arrays(section).find(|array| array.name == name)
    }
}

/// What a file holds.
#[derive(Debug)]
pub(super) struct Document {
    pub(super) kind: Kind,
    pub(super) storage: Storage,
    /// Of an image or a rectilinear grid.
    pub(super) whole: Extent,
    /// Of an image: the place of index 0, the spacing, and the direction, row by row.
    pub(super) origin: [f64; 3],
    pub(super) spacing: [f64; 3],
    pub(super) direction: [f64; 9],
    pub(super) pieces: Vec<Piece>,
    pub(super) warnings: Vec<String>,
}

impl Document {
    /// Reads the structure. What it takes of memory is taken from the budget.
    pub(super) fn read(source: &Source, budget: &mut Budget) -> Result<Self> {
        let mut stream =
            Counted { reader: source.reader(0, source.encoding()), position: 0, line: 0, fuel: None };
        if stream.fill_buf().map_err(|error| stream_error(source, error))?.starts_with(b"\xef\xbb\xbf") {
            stream.consume(3);
        }
        let parser = Parser {
            source,
            reader: Reader::from_reader(stream),
            stack: Vec::new(),
            document: None,
            name: String::new(),
            array: None,
            arrays: 0,
        };
        parser.run(budget)
    }
}

/// A stream that counts.
struct Counted<'a> {
    reader: Box<dyn BufRead + 'a>,
    /// Bytes behind.
    position: u64,
    /// Line breaks behind.
    line: u64,
    /// Bytes that may still come, where their number is limited.
    fuel: Option<usize>,
}

impl Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let got = self.fill_buf()?.read(buffer)?;
        self.consume(got);
        Ok(got)
    }
}

impl BufRead for Counted<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        let most = self.fuel.unwrap_or(usize::MAX);
        if most == 0 {
            return Err(std::io::Error::other("markup too long"));
        }
        let bytes = self.reader.fill_buf()?;
        Ok(&bytes[..bytes.len().min(most)])
    }

    fn consume(&mut self, bytes: usize) {
        // What is consumed was filled before, so this reads nothing.
        if let Ok(filled) = self.reader.fill_buf() {
            let lines = filled.iter().take(bytes).filter(|&&byte| byte == b'\n').count();
            self.line += u64::try_from(lines).unwrap_or(0);
        }
        self.reader.consume(bytes);
        self.position = self.position.saturating_add(num::wide(bytes));
        if let Some(fuel) = &mut self.fuel {
            *fuel = fuel.saturating_sub(bytes);
        }
    }
}

/// An open element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Element {
    File,
    Set,
    Piece,
    Section(Section),
    Array,
    Appended,
    Other,
}

/// The array that is open.
struct Open {
    section: Section,
    array: Array,
    text: Option<Text>,
}

struct Parser<'a> {
    source: &'a Source,
    reader: Reader<Counted<'a>>,
    stack: Vec<Element>,
    document: Option<Document>,
    /// The name of the element that holds the pieces.
    name: String,
    array: Option<Open>,
    /// Arrays behind.
    arrays: usize,
}

impl<'a> Parser<'a> {
    fn run(mut self, budget: &mut Budget) -> Result<Document> {
        let mut markup = Vec::new();
        loop {
            self.text()?;
            markup.clear();
            self.reader.get_mut().fuel = Some(MAX_MARKUP);
            let line = self.reader.get_ref().line + 1;
            let event = self.reader.read_event_into(&mut markup);
            let fuel = mem::take(&mut self.reader.get_mut().fuel);
            match event {
                Ok(Event::Start(tag)) => {
                    let element = self.open(&tag, line, budget)?;
                    if element == Element::Appended {
                        self.appended(&tag, line)?;
                        return self.finish();
                    }
                    self.stack.push(element);
                }
                Ok(Event::Empty(tag)) => {
                    let element = self.open(&tag, line, budget)?;
                    self.close(element)?;
                }
                Ok(Event::End(_)) => {
                    if let Some(element) = self.stack.pop() {
                        self.close(element)?;
                    }
                }
                Ok(Event::DocType(_)) => {
                    return Err(
                        self.error(line, "a document type: VTK's files have none, and it is not read")
                    );
                }
                Ok(Event::CData(_)) if self.stack.last() == Some(&Element::Array) => {
                    return Err(
                        self.error(line, "a CDATA section: the numbers of an array must be plain text")
                    );
                }
                Ok(Event::Eof) => return self.finish(),
                Ok(_) => {}
                Err(quick_xml::Error::Io(error)) => {
                    if fuel == Some(0) {
                        return Err(self.error(line, format!("markup longer than {MAX_MARKUP} bytes")));
                    }
                    // The error is shared, so that only its kind and its words can be handed on.
                    let error = std::io::Error::new(error.kind(), error.to_string());
                    return Err(stream_error(self.source, error));
                }
                Err(error) => {
                    return Err(self.error(line, format!("no XML: {}", one_line(&error.to_string()))));
                }
            }
        }
    }

    fn error(&self, line: u64, rule: impl Into<String>) -> Error {
        self.source.error(format!("line {line}"), rule)
    }

    /// Passes over text, up to the next markup.
    fn text(&mut self) -> Result<()> {
        let (begin, line) = (self.reader.get_ref().position, self.reader.get_ref().line);
        let mut blank = true;
        loop {
            let mut stream = self.reader.stream();
            let buffer = match stream.fill_buf() {
                Ok(buffer) => buffer,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(stream_error(self.source, error)),
            };
            let end = buffer.iter().position(|&byte| byte == b'<');
            let take = end.unwrap_or(buffer.len());
            blank &= buffer[..take].iter().all(u8::is_ascii_whitespace);
            stream.consume(take);
            if end.is_some() || take == 0 {
                break;
            }
        }
        let end = self.reader.get_ref().position;
        if blank {
            return Ok(());
        }
        match self.stack.last() {
            None => Err(self.error(line + 1, "text outside of all elements")),
            Some(Element::Array) => match &mut self.array {
                Some(Open { text: text @ None, .. }) => {
                    *text = Some(Text { begin, end, line });
                    Ok(())
                }
                Some(Open { array, .. }) => Err(self.source.error(
                    array.at(),
                    format!("more numbers on line {}: they must be in one place", line + 1),
                )),
                None => Ok(()),
            },
            Some(_) => Ok(()),
        }
    }

    /// What an element is.
    fn open(&mut self, tag: &BytesStart, line: u64, budget: &mut Budget) -> Result<Element> {
        if self.stack.len() >= MAX_DEPTH {
            return Err(self.error(line, format!("more than {MAX_DEPTH} elements within each other")));
        }
        let name = tag.name();
        let name: &str = name.as_ref();
        if name.len() > MAX_NAME {
            return Err(self.error(line, format!("an element whose name is longer than {MAX_NAME} bytes")));
        }
        let element = match (self.stack.last(), name) {
            (None, "VTKFile") if self.document.is_none() => {
                self.file(&self.attributes(tag, line)?)?;
                Element::File
            }
            (None, name) => {
                let rule = format!("<{}>: must be one VTKFile", shown(name));
                return Err(self.error(line, rule));
            }
            (Some(Element::File), "AppendedData") => Element::Appended,
            (Some(Element::File), name) if name == self.name => {
                self.set(&self.attributes(tag, line)?)?;
                Element::Set
            }
            (Some(Element::Set), "Piece") => {
                self.piece(&self.attributes(tag, line)?, budget)?;
                Element::Piece
            }
            (Some(Element::Piece), name) => match Section::ALL.iter().find(|(own, _)| *own == name) {
                Some(&(_, section)) => {
                    self.section(section, &self.attributes(tag, line)?);
                    Element::Section(section)
                }
                None => Element::Other,
            },
            (Some(&Element::Section(section)), "DataArray" | "Array") => {
                self.array(section, &self.attributes(tag, line)?, budget)?;
                Element::Array
            }
            _ => Element::Other,
        };
        Ok(element)
    }

    fn close(&mut self, element: Element) -> Result<()> {
        if element != Element::Array {
            return Ok(());
        }
        let Some(Open { section, mut array, text }) = self.array.take() else { return Ok(()) };
        match (&mut array.place, text) {
            (Place::Words(place) | Place::Base64(place), Some(text)) => *place = text,
            (Place::Appended(_), Some(_)) => {
                return Err(self.source.error(array.at(), "numbers here: its format is appended"));
            }
            (_, None) => {}
        }
        if let Some(piece) = self.document.as_mut().and_then(|document| document.pieces.last_mut()) {
            piece.arrays.push((section, array));
        }
        Ok(())
    }

    fn finish(self) -> Result<Document> {
        let line = self.reader.get_ref().line + 1;
        let appended = self.document.as_ref().is_some_and(|document| document.storage.appended.is_some());
        if !self.stack.is_empty() && !appended {
            return Err(self.error(line, format!("ends within {} open elements", self.stack.len())));
        }
        match self.document {
            Some(document) => Ok(document),
            None => Err(self.source.error("content", "no VTKFile element")),
        }
    }

    fn attributes(&self, tag: &BytesStart, line: u64) -> Result<Attributes<'a>> {
        let mut list = Vec::new();
        for attribute in tag.attributes() {
            let wrong = |error: String| self.error(line, format!("no XML: attributes: {}", one_line(&error)));
            if list.len() == MAX_ATTRIBUTES {
                return Err(self.error(line, format!("more than {MAX_ATTRIBUTES} attributes")));
            }
            let attribute = attribute.map_err(|error| wrong(error.to_string()))?;
            let value = attribute
                .normalized_value(XmlVersion::Implicit1_0)
                .map_err(|error| wrong(error.to_string()))?;
            // Line ends may come as references.
            let value = value.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
            list.push((attribute.key.as_ref().to_owned(), value));
        }
        let element: &str = &shown(tag.name().as_ref());
        Ok(Attributes { source: self.source, line, element: element.to_owned(), list })
    }

    /// The root element.
    fn file(&mut self, own: &Attributes) -> Result<()> {
        let kind = own.required("type")?;
        let kind = match kind {
            "ImageData" => Kind::Image,
            "RectilinearGrid" => Kind::Rectilinear,
            "UnstructuredGrid" => Kind::Unstructured,
            other => {
                let what = match other {
                    "PolyData" => "surfaces are no volume: ",
                    "StructuredGrid" => "curvilinear grids are not read, convert it to unstructured: ",
                    other if other.starts_with('P') || other.starts_with("vtk") || other == "Collection" => {
                        "it names other files, read those one by one: "
                    }
                    _ => "",
                };
                return Err(own.error(
                    "type",
                    format!(
                        "\"{}\": {what}ImageData, RectilinearGrid and UnstructuredGrid are supported",
                        shown(other)
                    ),
                ));
            }
        };
        own.required("type")?.clone_into(&mut self.name);
        if let Some(version) = own.get("version") {
            let major = version.split('.').next().and_then(|major| major.trim().parse::<u32>().ok());
            if major.is_none_or(|major| major > 2) {
                let rule = format!("\"{}\": versions 0 to 2 are supported", shown(version));
                return Err(own.error("version", rule));
            }
        }
        let endian = match own.get("byte_order") {
            Some("LittleEndian") | None => Endian::Little,
            Some("BigEndian") => Endian::Big,
            Some(other) => {
                let rule = format!("\"{}\": must be LittleEndian or BigEndian", shown(other));
                return Err(own.error("byte_order", rule));
            }
        };
        let word = match own.get("header_type") {
            Some("UInt32") | None => 4,
            Some("UInt64") => 8,
            Some(other) => {
                return Err(
                    own.error("header_type", format!("\"{}\": must be UInt32 or UInt64", shown(other)))
                );
            }
        };
        let compressor = match own.get("compressor") {
            None | Some("") => None,
            Some("vtkZLibDataCompressor") => Some(Compressor::Zlib),
            Some("vtkLZ4DataCompressor") => Some(Compressor::Lz4),
            Some("vtkLZMADataCompressor") => Some(Compressor::Lzma),
            Some(other) => {
                return Err(own.error(
                    "compressor",
                    format!(
                        "\"{}\": vtkZLibDataCompressor, vtkLZ4DataCompressor and vtkLZMADataCompressor are \
                         supported",
                        shown(other)
                    ),
                ));
            }
        };
        let mut warnings = Vec::new();
        if own.get("byte_order").is_none() {
            warnings.push("no byte_order: binary data is taken as little-endian".to_owned());
        }
        self.document = Some(Document {
            kind,
            storage: Storage { endian, word, compressor, appended: None },
            whole: Extent::default(),
            origin: [0.0; 3],
            spacing: [1.0; 3],
            direction: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            pieces: Vec::new(),
            warnings,
        });
        Ok(())
    }

    /// The element that holds the pieces.
    fn set(&mut self, own: &Attributes) -> Result<()> {
        let Some(document) = &mut self.document else { return Ok(()) };
        if document.kind == Kind::Unstructured {
            return Ok(());
        }
        document.whole = own.extent("WholeExtent")?;
        if document.kind == Kind::Image {
            document.origin = own.numbers("Origin", document.origin)?;
            document.spacing = own.numbers("Spacing", document.spacing)?;
            document.direction = own.numbers("Direction", document.direction)?;
        }
        Ok(())
    }

    fn piece(&mut self, own: &Attributes, budget: &mut Budget) -> Result<()> {
        let Some(document) = &mut self.document else { return Ok(()) };
        if document.pieces.len() >= MAX_COUNT {
            return Err(own.error("pieces", format!("more than {MAX_COUNT}")));
        }
        budget.take("pieces", size::<Piece>())?;
        let mut piece = Piece { line: own.line, ..Piece::default() };
        if document.kind == Kind::Unstructured {
            piece.points = own.count("NumberOfPoints")?;
            piece.cells = own.count("NumberOfCells")?;
        } else {
            piece.extent = own.extent("Extent")?;
        }
        document.pieces.push(piece);
        Ok(())
    }

    fn section(&mut self, section: Section, own: &Attributes) {
        let place = match section {
            Section::PointData => 0,
            Section::CellData => 1,
            Section::Points | Section::Cells | Section::Coordinates => return,
        };
        // The first piece speaks for all.
        if let Some(document) = &mut self.document
            && let [piece] = document.pieces.as_mut_slice()
        {
            piece.active[place] = ["Scalars", "Vectors"]
                .map(|name| own.get(name).filter(|name| !name.is_empty()).map(str::to_owned));
        }
    }

    fn array(&mut self, section: Section, own: &Attributes, budget: &mut Budget) -> Result<()> {
        self.arrays += 1;
        if self.arrays > MAX_COUNT {
            return Err(own.error("arrays", format!("more than {MAX_COUNT}")));
        }
        let name = own.get("Name").unwrap_or_default();
        if name.len() > MAX_NAME {
            return Err(own.error("Name", format!("longer than {MAX_NAME} bytes")));
        }
        let bytes = size::<(Section, Array)>().saturating_add(num::wide(name.len()));
        // Lists grow by doubling.
        budget.take("arrays", bytes.saturating_mul(2))?;
        let components = match own.get("NumberOfComponents").map(str::trim) {
            None | Some("" | "0") => 1,
            Some(text) => text.parse::<usize>().map_err(|_| {
                let rule = format!("\"{}\": must be a whole number", shown(text));
                own.error("NumberOfComponents", rule)
            })?,
        };
        let mut kind = match own.required("type")? {
            "Int8" => Ok(SampleType::I8),
            "UInt8" => Ok(SampleType::U8),
            "Int16" => Ok(SampleType::I16),
            "UInt16" => Ok(SampleType::U16),
            "Int32" => Ok(SampleType::I32),
            "UInt32" => Ok(SampleType::U32),
            "Int64" | "vtkIdType" => Ok(SampleType::I64),
            "UInt64" => Ok(SampleType::U64),
            "Float32" => Ok(SampleType::F32),
            "Float64" => Ok(SampleType::F64),
            other => Err(format!("its type is {}", shown(other))),
        };
        if components > MAX_COMPONENTS {
            kind = Err(format!("it has {components} components, more than {MAX_COMPONENTS}"));
        }
        let none = Text { begin: 0, end: 0, line: own.line };
        let place = match own.get("format") {
            None | Some("ascii") => Place::Words(none),
            Some("binary") => Place::Base64(none),
            Some("appended") => {
                let text = own.required("offset")?.trim();
                let offset = text.parse().map_err(|_| {
                    own.error("offset", format!("\"{}\": must be a whole number", shown(text)))
                })?;
                Place::Appended(offset)
            }
            Some(other) => {
                let rule = format!("\"{}\": must be ascii, binary or appended", shown(other));
                return Err(own.error("format", rule));
            }
        };
        let array = Array { name: name.to_owned(), line: own.line, kind, components, place };
        self.array = Some(Open { section, array, text: None });
        Ok(())
    }

    /// Finds where the appended data begins.
    fn appended(&mut self, tag: &BytesStart, line: u64) -> Result<()> {
        let own = self.attributes(tag, line)?;
        let base64 = match own.required("encoding")? {
            "raw" => false,
            "base64" => true,
            other => {
                let rule = format!("\"{}\": must be raw or base64", shown(other));
                return Err(own.error("encoding", rule));
            }
        };
        loop {
            let mut stream = self.reader.stream();
            let found = stream.fill_buf().map_err(|error| stream_error(self.source, error))?.first().copied();
            stream.consume(usize::from(found.is_some()));
            match found {
                Some(byte) if byte.is_ascii_whitespace() => {}
                Some(b'_') => break,
                _ => return Err(self.error(line, "AppendedData: must begin with \"_\"")),
            }
        }
        let begin = self.reader.get_ref().position;
        if let Some(document) = &mut self.document {
            document.storage.appended = Some(Appended { begin, base64 });
        }
        Ok(())
    }
}

/// Bytes of a type.
fn size<T>() -> u64 {
    u64::try_from(size_of::<T>()).unwrap_or(u64::MAX)
}

/// A library's message as one line of sane length.
fn one_line(text: &str) -> String {
    text.chars().take(200).map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The attributes of an element.
struct Attributes<'a> {
    source: &'a Source,
    line: u64,
    element: String,
    list: Vec<(String, String)>,
}

impl Attributes<'_> {
    fn get(&self, name: &str) -> Option<&str> {
        self.list.iter().find(|(own, _)| own == name).map(|(_, value)| value.as_str())
    }

    fn error(&self, name: &str, rule: impl Into<String>) -> Error {
        self.source.error(format!("line {}, {} {name}", self.line, self.element), rule)
    }

    fn required(&self, name: &str) -> Result<&str> {
        self.get(name).ok_or_else(|| self.error(name, "missing"))
    }

    fn count(&self, name: &str) -> Result<u64> {
        let text = self.required(name)?;
        text.trim()
            .parse()
            .map_err(|_| self.error(name, format!("\"{}\": must be a whole number", shown(text))))
    }

    fn numbers<const N: usize>(&self, name: &str, default: [f64; N]) -> Result<[f64; N]> {
        let Some(text) = self.get(name) else { return Ok(default) };
        super::text::floats(text)
            .filter(|numbers| numbers.iter().all(|number| number.is_finite()))
            .ok_or_else(|| self.error(name, format!("\"{}\": must be {N} finite numbers", shown(text))))
    }

    fn extent(&self, name: &str) -> Result<Extent> {
        let text = self.required(name)?;
        let wrong = || self.error(name, format!("\"{}\": must be 6 whole numbers", shown(text)));
        let numbers: Vec<i32> = text
            .split_whitespace()
            .take(7)
            .map(str::parse)
            .collect::<std::result::Result<_, _>>()
            .map_err(|_| wrong())?;
        let &[a, b, c, d, e, f] = numbers.as_slice() else { return Err(wrong()) };
        Ok([[a, b], [c, d], [e, f]].map(|pair| pair.map(i64::from)))
    }
}
