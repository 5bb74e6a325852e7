//! The parser of the document. It skips text, and stops at the appended data, which need not be XML.

use std::io::{BufRead, ErrorKind};
use std::mem;

use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use crate::error::{Error, Result};
use crate::io::file::budget::Budget;
use crate::io::file::decode::MAX_COMPONENTS;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::source::Source;
use crate::io::file::text::{shown, stream_error};
use crate::io::formats::vtk_xml::attributes::{Attributes, one_line};
use crate::io::formats::vtk_xml::document::{
    Appended, Array, Compressor, Document, Extent, Kind, Piece, Place, Section, Storage, Text,
};
use crate::io::formats::vtk_xml::stream::Counted;
use crate::num;

/// The limit on the length of a tag or comment, in bytes.
const MAX_MARKUP: usize = 1 << 20;

/// The limit on nested elements.
const MAX_DEPTH: usize = 64;

/// The limit on the length of element and array names, in bytes.
const MAX_NAME: usize = 256;

/// The limit on pieces, and on arrays in all of them.
const MAX_COUNT: usize = 1 << 16;

impl Document {
    /// Reads the structure of the document. Its memory is taken from the budget.
    pub(crate) fn read(source: &Source, budget: &mut Budget) -> Result<Self> {
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

/// The current array.
struct Open {
    section: Section,
    array: Array,
    text: Option<Text>,
}

pub(crate) struct Parser<'a> {
    pub(crate) source: &'a Source,
    reader: Reader<Counted<'a>>,
    stack: Vec<Element>,
    document: Option<Document>,
    /// The name of the element that holds the pieces.
    name: String,
    array: Option<Open>,
    /// The number of arrays read.
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
                    // The error is shared, so only its kind and its message can be passed on.
                    let error = std::io::Error::new(error.kind(), error.to_string());
                    return Err(stream_error(self.source, error));
                }
                Err(error) => {
                    return Err(self.error(line, format!("no XML: {}", one_line(&error.to_string()))));
                }
            }
        }
    }

    pub(crate) fn error(&self, line: u64, rule: impl Into<String>) -> Error {
        self.source.error(format!("line {line}"), rule)
    }

    /// Skips text up to the next markup; records where the numbers of an array are.
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

    /// Reads a start tag and classifies the element.
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
                self.file(&Attributes::of(self.source, tag, line)?)?;
                Element::File
            }
            (None, name) => {
                let rule = format!("<{}>: must be one VTKFile", shown(name));
                return Err(self.error(line, rule));
            }
            (Some(Element::File), "AppendedData") => Element::Appended,
            (Some(Element::File), name) if name == self.name => {
                self.set(&Attributes::of(self.source, tag, line)?)?;
                Element::Set
            }
            (Some(Element::Set), "Piece") => {
                self.piece(&Attributes::of(self.source, tag, line)?, budget)?;
                Element::Piece
            }
            (Some(Element::Piece), name) => match Section::ALL.iter().find(|(own, _)| *own == name) {
                Some(&(_, section)) => {
                    self.section(section, &Attributes::of(self.source, tag, line)?);
                    Element::Section(section)
                }
                None => Element::Other,
            },
            (Some(&Element::Section(section)), "DataArray" | "Array") => {
                self.array(section, &Attributes::of(self.source, tag, line)?, budget)?;
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

    /// Reads the root element.
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

    /// Reads the element that holds the pieces.
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
        // The first piece decides the active arrays.
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
        // Lists grow by doubling, so they may hold twice the size.
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

    /// Finds the beginning of the appended data.
    fn appended(&mut self, tag: &BytesStart, line: u64) -> Result<()> {
        let own = Attributes::of(self.source, tag, line)?;
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

/// Returns the size of a type, in bytes.
fn size<T>() -> u64 {
    u64::try_from(size_of::<T>()).unwrap_or(u64::MAX)
}
