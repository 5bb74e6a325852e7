//! The parser of the document. It skips text, which may be longer than memory, and stops at the appended data, which need
//! not be XML.

use std::io::{BufRead, ErrorKind, Read, Take};

use glam::DMat3;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use crate::error::{Error, Result};
use crate::io::build::arrays::Association;
use crate::io::file::budget::Budget;
use crate::io::file::decode::MAX_COMPONENTS;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::{shown, stream_error};
use crate::io::formats::vtk_xml::attributes::{Attributes, no_xml};
use crate::io::formats::vtk_xml::document::{
    Appended, Array, Compressor, Document, Extent, Kind, Piece, Place, Section, Storage, Text, volume,
};
use crate::num;

/// The limit on the length of a tag or comment, in bytes.
const MAX_MARKUP: u64 = 1 << 20;

/// The limit on nested elements.
const MAX_DEPTH: usize = 64;

/// The limit on the length of element and array names, in bytes.
const MAX_NAME: usize = 256;

/// The limit on pieces, and on arrays in all of them.
const MAX_COUNT: usize = 1 << 16;

impl Document {
    /// Reads the structure of the document. Its memory is taken from the budget.
    pub(crate) fn read(source: &Source, budget: &mut Budget) -> Result<Self> {
        let mut scanner = Scanner::new(source);
        if source.head().starts_with(b"\xef\xbb\xbf") {
            scanner.skip(3)?;
        }
        let document = Self {
            kind: Kind::Image,
            storage: Storage { endian: Endian::Little, word: 4, compressor: None, appended: None },
            whole: Extent::default(),
            origin: [0.0; 3],
            spacing: [1.0; 3],
            direction: DMat3::IDENTITY.to_cols_array(),
            pieces: Vec::new(),
            warnings: Vec::new(),
        };
        let reader = Reader::from_reader(scanner.take(u64::MAX));
        let mut parser = Parser { source, reader, line: 0, stack: Vec::new(), document, set: "", arrays: 0 };
        parser.run(budget)?;
        let Parser { line, stack, document, set, .. } = parser;
        if !stack.is_empty() && document.storage.appended.is_none() {
            let rule = format!("ends within {} open elements", stack.len());
            return Err(source.error(format!("line {}", line + 1), rule));
        }
        if set.is_empty() { Err(source.error("content", "no VTKFile element")) } else { Ok(document) }
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

struct Parser<'a> {
    source: &'a Source,
    /// The stream, whose limit is that of markup while the library reads.
    reader: Reader<Take<Scanner<'a>>>,
    /// Line breaks read.
    line: u64,
    stack: Vec<Element>,
    document: Document,
    /// The name of the element that holds the pieces; empty before the root element.
    set: &'static str,
    /// The number of arrays read.
    arrays: usize,
}

impl Parser<'_> {
    /// Reads up to the appended data or the end.
    fn run(&mut self, budget: &mut Budget) -> Result<()> {
        let mut markup = Vec::new();
        loop {
            self.line += breaks(&markup);
            markup.clear();
            self.text()?;
            let line = self.line + 1;
            self.reader.get_mut().set_limit(MAX_MARKUP);
            let event = self.reader.read_event_into(&mut markup);
            let full = self.reader.get_ref().limit() == 0;
            self.reader.get_mut().set_limit(u64::MAX);
            match event {
                Ok(Event::Start(tag)) => match self.open(&tag, line, budget)? {
                    Element::Appended => return self.appended(&Attributes::of(self.source, &tag, line)?),
                    element => self.stack.push(element),
                },
                Ok(Event::Empty(tag)) => drop(self.open(&tag, line, budget)?),
                Ok(Event::End(_)) => drop(self.stack.pop()),
                Ok(Event::DocType(_)) => {
                    let rule = "a document type: VTK's files have none, and it is not read";
                    return Err(self.error(line, rule));
                }
                Ok(Event::CData(_)) if self.stack.last() == Some(&Element::Array) => {
                    let rule = "a CDATA section: the numbers of an array must be plain text";
                    return Err(self.error(line, rule));
                }
                Ok(Event::Eof) => return Ok(()),
                Ok(_) => {}
                Err(quick_xml::Error::Io(error)) => {
                    // The error is shared, so only its kind and its message can be passed on.
                    let error = std::io::Error::new(error.kind(), error.to_string());
                    return Err(stream_error(self.source, error));
                }
                Err(_) if full => {
                    return Err(self.error(line, format!("markup longer than {MAX_MARKUP} bytes")));
                }
                Err(error) => return Err(no_xml(self.source, line, error)),
            }
        }
    }

    fn error(&self, line: u64, rule: impl Into<String>) -> Error {
        self.source.error(format!("line {line}"), rule)
    }

    fn position(&self) -> u64 {
        self.reader.get_ref().get_ref().position()
    }

    /// Skips text up to the next markup; records where the numbers of an array are.
    fn text(&mut self) -> Result<()> {
        let (begin, line) = (self.position(), self.line);
        let mut blank = true;
        loop {
            let mut stream = self.reader.stream();
            let buffer = match stream.fill_buf() {
                Ok(buffer) => buffer,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(stream_error(self.source, error)),
            };
            let end = buffer.iter().position(|&byte| byte == b'<');
            let text = &buffer[..end.unwrap_or(buffer.len())];
            blank &= text.iter().all(u8::is_ascii_whitespace);
            self.line += breaks(text);
            let take = text.len();
            stream.consume(take);
            if end.is_some() || take == 0 {
                break;
            }
        }
        let end = self.position();
        match self.stack.last() {
            _ if blank => Ok(()),
            None => Err(self.error(line + 1, "text outside of all elements")),
            Some(Element::Array) => self.numbers(Text { begin, end, line }),
            Some(_) => Ok(()),
        }
    }

    /// Records where the numbers of the open array are.
    fn numbers(&mut self, own: Text) -> Result<()> {
        let piece = self.document.pieces.last_mut();
        let Some((_, array)) = piece.and_then(|piece| piece.arrays.last_mut()) else { return Ok(()) };
        let rule = match &mut array.place {
            Place::Appended(_) => "numbers here: its format is appended".to_owned(),
            Place::Words(text) | Place::Base64(text) if text.end == 0 => {
                *text = own;
                return Ok(());
            }
            _ => format!("more numbers on line {}: they must be in one place", own.line + 1),
        };
        Err(self.source.error(array.at(), rule))
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
        let source = self.source;
        let own = || Attributes::of(source, tag, line);
        match (self.stack.last().copied(), name) {
            (None, "VTKFile") if self.set.is_empty() => self.file(&own()?),
            (None, name) => Err(self.error(line, format!("<{}>: must be one VTKFile", shown(name)))),
            (Some(Element::File), "AppendedData") => Ok(Element::Appended),
            (Some(Element::File), name) if name == self.set => self.set(&own()?),
            (Some(Element::Set), "Piece") => self.piece(&own()?, budget),
            (Some(Element::Piece), name) => match Section::ALL.iter().find(|(own, _)| *own == name) {
                Some(&(_, section)) => Ok(self.section(section, &own()?)),
                None => Ok(Element::Other),
            },
            (Some(Element::Section(section)), "DataArray" | "Array") => self.array(section, &own()?, budget),
            _ => Ok(Element::Other),
        }
    }

    /// Reads the root element.
    fn file(&mut self, own: &Attributes) -> Result<Element> {
        let name = own.required("type")?;
        (self.set, self.document.kind) = match name {
            "ImageData" => ("ImageData", Kind::Image),
            "RectilinearGrid" => ("RectilinearGrid", Kind::Rectilinear),
            "UnstructuredGrid" => ("UnstructuredGrid", Kind::Unstructured),
            _ => {
                let what = match name {
                    "PolyData" => "surfaces are no volume: ",
                    "StructuredGrid" => "curvilinear grids are not read, convert it to unstructured: ",
                    _ if name.starts_with('P') || name.starts_with("vtk") || name == "Collection" => {
                        "it names other files, read those one by one: "
                    }
                    _ => "",
                };
                let known = "ImageData, RectilinearGrid and UnstructuredGrid are supported";
                return Err(own.error("type", format!("\"{}\": {what}{known}", shown(name))));
            }
        };
        if let Some(version) = own.get("version") {
            let major = version.split('.').next().and_then(|major| major.trim().parse::<u32>().ok());
            if major.is_none_or(|major| major > 2) {
                let rule = format!("\"{}\": versions 0 to 2 are supported", shown(version));
                return Err(own.error("version", rule));
            }
        }
        let orders = [("LittleEndian", Endian::Little), ("BigEndian", Endian::Big)];
        let endian = own.choice("byte_order", &orders, "must be LittleEndian or BigEndian")?;
        let words = [("UInt32", 4), ("UInt64", 8)];
        let word = own.choice("header_type", &words, "must be UInt32 or UInt64")?;
        let compressors = [
            ("", None),
            ("vtkZLibDataCompressor", Some(Compressor::Zlib)),
            ("vtkLZ4DataCompressor", Some(Compressor::Lz4)),
            ("vtkLZMADataCompressor", Some(Compressor::Lzma)),
        ];
        let rule = "vtkZLibDataCompressor, vtkLZ4DataCompressor and vtkLZMADataCompressor are supported";
        let compressor = own.choice("compressor", &compressors, rule)?.flatten();
        if endian.is_none() {
            let warning = "no byte_order: binary data is taken as little-endian";
            self.document.warnings.push(warning.to_owned());
        }
        let endian = endian.unwrap_or(Endian::Little);
        self.document.storage = Storage { endian, word: word.unwrap_or(4), compressor, appended: None };
        Ok(Element::File)
    }

    /// Reads the element that holds the pieces.
    fn set(&mut self, own: &Attributes) -> Result<Element> {
        let document = &mut self.document;
        if document.kind != Kind::Unstructured {
            document.whole = own.extent("WholeExtent")?;
        }
        if document.kind == Kind::Image {
            document.origin = own.numbers("Origin", document.origin)?;
            document.spacing = own.numbers("Spacing", document.spacing)?;
            document.direction = own.numbers("Direction", document.direction)?;
        }
        Ok(Element::Set)
    }

    fn piece(&mut self, own: &Attributes, budget: &mut Budget) -> Result<Element> {
        if self.document.pieces.len() >= MAX_COUNT {
            return Err(own.error("pieces", format!("more than {MAX_COUNT}")));
        }
        budget.take("pieces", num::wide(size_of::<Piece>()))?;
        let mut piece = Piece { line: own.line, ..Piece::default() };
        if self.document.kind == Kind::Unstructured {
            piece.points = own.count("NumberOfPoints")?;
            piece.cells = own.count("NumberOfCells")?;
        } else {
            piece.extent = own.extent("Extent")?;
            [piece.points, piece.cells] =
                [Association::Point, Association::Cell].map(|association| volume(piece.extent, association));
        }
        self.document.pieces.push(piece);
        Ok(Element::Piece)
    }

    fn section(&mut self, section: Section, own: &Attributes) -> Element {
        let sections = [Section::PointData, Section::CellData];
        // The first piece decides the active arrays.
        if let [piece] = self.document.pieces.as_mut_slice()
            && let Some(place) = sections.iter().position(|data| *data == section)
        {
            piece.active[place] = ["Scalars", "Vectors"]
                .map(|name| own.get(name).filter(|name| !name.is_empty()).map(str::to_owned));
        }
        Element::Section(section)
    }

    fn array(&mut self, section: Section, own: &Attributes, budget: &mut Budget) -> Result<Element> {
        self.arrays += 1;
        if self.arrays > MAX_COUNT {
            return Err(own.error("arrays", format!("more than {MAX_COUNT}")));
        }
        let name = own.get("Name").unwrap_or_default();
        if name.len() > MAX_NAME {
            return Err(own.error("Name", format!("longer than {MAX_NAME} bytes")));
        }
        let bytes = num::wide(size_of::<(Section, Array)>() + name.len());
        // Lists grow by doubling, so they may hold twice the size.
        budget.take("arrays", bytes.saturating_mul(2))?;
        let components = match own.get("NumberOfComponents").map(str::trim) {
            None | Some("" | "0") => 1,
            Some(_) => usize::try_from(own.count("NumberOfComponents")?).unwrap_or(usize::MAX),
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
        let (words, base64) = (Place::Words(none), Place::Base64(none));
        let places = [("ascii", words), ("binary", base64), ("appended", Place::Appended(0))];
        let mut place = own.choice("format", &places, "must be ascii, binary or appended")?.unwrap_or(words);
        if let Place::Appended(offset) = &mut place {
            *offset = own.count("offset")?;
        }
        let array = Array { name: name.to_owned(), line: own.line, kind, components, place };
        if let Some(piece) = self.document.pieces.last_mut() {
            piece.arrays.push((section, array));
        }
        Ok(Element::Array)
    }

    /// Finds the beginning of the appended data.
    fn appended(&mut self, own: &Attributes) -> Result<()> {
        own.required("encoding")?;
        let encodings = [("raw", false), ("base64", true)];
        let base64 = own.choice("encoding", &encodings, "must be raw or base64")? == Some(true);
        let scanner = self.reader.get_mut().get_mut();
        scanner.skip_blanks()?;
        if scanner.peek(1)? != b"_" {
            return Err(self.error(own.line, "AppendedData: must begin with \"_\""));
        }
        scanner.skip(1)?;
        self.document.storage.appended = Some(Appended { begin: self.position(), base64 });
        Ok(())
    }
}

/// Returns the number of line breaks.
fn breaks(bytes: &[u8]) -> u64 {
    num::wide(bytes.iter().filter(|&&byte| byte == b'\n').count())
}
