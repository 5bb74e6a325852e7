//! The numbers of arrays: text, or bytes that are bare or in base64, in one piece or in compressed blocks.
//!
//! Bytes begin with a header of whole numbers. Uncompressed data has one, its size. Compressed data has the number of
//! blocks, the size of a block, the size of the last block if it is smaller (else 0), and the compressed size of each
//! block; in base64 this header is padded and encoded separately.

use std::io::{Cursor, ErrorKind, Read};

use crate::error::{Error, Result};
use crate::io::build::arrays::ArrayInfo;
use crate::io::file::budget::Budget;
use crate::io::file::decode::{self, Layout, Values};
use crate::io::file::on_demand::{InFile, Planes};
use crate::io::file::sample_type::{Endian, Pick, SampleType};
use crate::io::file::samples;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::{self, stream_error};
use crate::io::formats::vtk_xml::blocks::Blocks;
use crate::io::formats::vtk_xml::bytes::Bytes;
use crate::io::formats::vtk_xml::document::{Array, Document, Piece, Place, Storage, Text};
use crate::io::options::ReadOptions;
use crate::num;
use crate::scene::{OnDemand, Samples};

/// The limit on the bytes read, as a multiple of the file size.
const MOST_OFTEN: u64 = 16;

/// The limit on restarts of the decompression of a packed file; common files need about one per array.
const MOST_RESTARTS: u32 = 64;

/// Reads the numbers of arrays.
pub(crate) struct Store<'a> {
    pub(crate) source: &'a Source,
    storage: Storage,
    scanner: Scanner<'a>,
    budget: Budget<'a>,
    /// The number of stored bytes read.
    behind: u64,
    restarts: u32,
}

/// A function that takes numbers from a stream.
pub(crate) type Taker<'t> = dyn FnMut(&mut dyn Read, SampleType, Endian) -> std::io::Result<()> + 't;

impl<'a> Store<'a> {
    pub(crate) fn new(source: &'a Source, storage: Storage, budget: Budget<'a>) -> Self {
        Self { source, storage, scanner: Scanner::new(source), budget, behind: 0, restarts: 0 }
    }

    /// Returns the offset of an array's bytes, an upper bound of their number, and whether they are base64 or text.
    fn span(&self, array: &Array) -> Result<(u64, u64, bool)> {
        let source = self.source;
        Ok(match array.place {
            Place::Words(text) | Place::Base64(text) => (text.begin, text.end - text.begin, true),
            Place::Appended(offset) => {
                let Some(appended) = self.storage.appended else {
                    return Err(source.error(array.at(), "its format is appended: there is no AppendedData"));
                };
                let most = source.encoding().most(source.len());
                let begin = appended.begin.checked_add(offset).filter(|&begin| begin <= most);
                let Some(begin) = begin else {
                    let rule = format!("offset {offset}: the file has {} bytes", source.len());
                    return Err(source.error(array.at(), rule));
                };
                (begin, most - begin, appended.base64)
            }
        })
    }

    /// Checks that an array can hold `count` numbers, before memory is allocated, and returns their type.
    pub(crate) fn check(&self, array: &Array, count: u64) -> Result<SampleType> {
        let kind = array.kind.clone();
        let kind = kind.map_err(|why| self.source.error(array.at(), format!("cannot be read: {why}")))?;
        let (_, stored, base64) = self.span(array)?;
        let most = if matches!(array.place, Place::Words(_)) {
            text::most_numbers(stored)
        } else {
            let bytes = if base64 { stored / 4 * 3 } else { stored };
            self.storage.compressor.map_or(bytes, |compressor| compressor.most(bytes)) / kind.bytes()
        };
        if count <= most {
            return Ok(kind);
        }
        let rule =
            format!("needs {count} numbers of type {}: {stored} bytes hold at most {most}", kind.name());
        Err(self.source.error(array.at(), rule))
    }

    /// Passes a stream of an array to `taker`, and checks that it holds exactly `count` numbers.
    pub(crate) fn take(&mut self, array: &Array, count: u64, taker: &mut Taker) -> Result<()> {
        if count == 0 {
            return Ok(());
        }
        let kind = self.check(array, count)?;
        let (begin, ..) = self.span(array)?;
        self.read(array, count, kind, taker)?;
        if let Place::Base64(text) = array.place {
            // Markup follows the text, so no blank beyond it is skipped.
            self.scanner.skip_blanks()?;
            if self.scanner.position() < text.end {
                let rule = format!("more base64 than the {count} numbers need");
                return Err(self.source.error(array.at(), rule));
            }
        }
        // Arrays may share bytes, but not so often that a small file takes long to read.
        self.behind = self.behind.saturating_add(self.scanner.position().saturating_sub(begin));
        let most = self.source.encoding().most(self.source.len()).saturating_mul(MOST_OFTEN);
        if self.behind <= most {
            return Ok(());
        }
        Err(self.source.error(array.at(), "too many arrays lie in the same place"))
    }

    /// Checks that the array of a piece that has this description can hold its numbers, if there is one.
    pub(crate) fn check_samples(&self, piece: &Piece, info: &ArrayInfo) -> Result<()> {
        let Some(array) = piece.array(info.association, &info.name) else { return Ok(()) };
        self.check(array, self.numbers(array, piece.tuples(info.association))?).map(drop)
    }

    /// Reads the selected part of each tuple of the array of a piece that has this description, if there is one.
    pub(crate) fn values(
        &mut self,
        piece: &Piece,
        info: &ArrayInfo,
        pick: Pick,
        values: &mut Values,
    ) -> Result<()> {
        let Some(array) = piece.array(info.association, &info.name) else { return Ok(()) };
        let components = array.components;
        let tuples = text::index(self.source, &array.at(), piece.tuples(info.association))?;
        let numbers = self.numbers(array, num::wide(tuples))?;
        self.take(array, numbers, &mut |reader, kind, endian| {
            let layout = Layout { dims: [0; 3], kind, endian, components, pick };
            decode::append(reader, tuples, &layout, values)
        })
    }

    /// Returns the samples of the array of a piece that has this description, where they are bare bytes that stay in the file.
    pub(crate) fn in_file(
        &mut self,
        piece: &Piece,
        info: &ArrayInfo,
        pick: Pick,
        dims: [u32; 3],
        options: &ReadOptions,
    ) -> Result<Option<Samples>> {
        let Some(array) = piece.array(info.association, &info.name) else { return Ok(None) };
        let components = array.components;
        let numbers = self.numbers(array, piece.tuples(info.association))?;
        let kind = self.check(array, numbers)?;
        let (begin, stored, base64) = self.span(array)?;
        let layout = Layout { dims, kind, endian: self.storage.endian, components, pick };
        let (_, bytes, stays) = samples::stays_in_file(self.source, &array.at(), &layout, options)?;
        let packed = base64 || self.storage.compressor.is_some() || self.source.is_gzip();
        // Arrays that are not of this grid are refused later.
        if packed || !stays || numbers.saturating_mul(kind.bytes()) != bytes {
            return Ok(None);
        }
        self.seek(begin)?;
        let scanner = &mut self.scanner;
        Bytes { source: self.source, at: array.at(), scanner, stored, left: 0, decoded: None }
            .begin(self.storage, bytes)?;
        let offset = begin + self.storage.word;
        // The end of the document comes after them.
        self.seek(offset + bytes)?;
        let samples = InFile { planes: Planes::Joined(self.source.clone(), offset), layout };
        Ok(Some(Samples::OnDemand(OnDemand::new(dims, samples)?)))
    }

    /// Skips the bytes of an array that is neither compressed nor text, if they are there.
    fn skip_plain(&mut self, base64: bool) -> Result<()> {
        if self.storage.compressor.is_some() || base64 {
            return Ok(());
        }
        let header = self.scanner.peek(usize::try_from(self.storage.word).unwrap_or(8))?;
        let bytes = self.storage.endian.whole(header);
        if bytes <= self.scanner.available() && !self.source.is_gzip() {
            self.scanner.skip(bytes)
        } else {
            Ok(())
        }
    }

    /// Refuses anything but blanks after the end of a document with appended data, which the parser does not reach. The
    /// search for the end begins at the last array, whose bytes may mean anything.
    pub(crate) fn check_end(&mut self, document: &Document) -> Result<()> {
        let Some(appended) = self.storage.appended else { return Ok(()) };
        let offset = |array: &Array| match array.place {
            Place::Appended(offset) => Some(offset),
            Place::Words(_) | Place::Base64(_) => None,
        };
        let arrays = document.pieces.iter().flat_map(|piece| &piece.arrays);
        let last = arrays.filter_map(|(_, array)| offset(array)).max().unwrap_or(0);
        let last = appended.begin.saturating_add(last);
        // After the last array has been read, its bytes need not be searched.
        if self.scanner.position() <= last {
            self.seek(last)?;
            self.skip_plain(appended.base64)?;
        }
        if !self.scanner.pass(b"</VTKFile>")? {
            return Ok(());
        }
        self.scanner.skip_blanks()?;
        let at = self.scanner.position();
        match self.scanner.peek(1)? {
            [] => Ok(()),
            _ => {
                Err(self.source.error(format!("byte {at}"), "text outside of all elements, after </VTKFile>"))
            }
        }
    }

    /// Returns the number of values in `count` tuples of an array.
    pub(crate) fn numbers(&self, array: &Array, count: u64) -> Result<u64> {
        count.checked_mul(num::wide(array.components)).ok_or_else(|| {
            self.source.error(array.at(), format!("{count} tuples: more than memory can address"))
        })
    }

    /// Moves to an offset of the decompressed file. In a packed file, moving backwards restarts decompression.
    fn seek(&mut self, begin: u64) -> Result<()> {
        if self.source.is_gzip() && begin < self.scanner.position() {
            self.restarts += 1;
            if self.restarts > MOST_RESTARTS {
                let rule = "arrays in an order that needs unpacking the file too often: unpack it first";
                return Err(self.source.error("data", rule));
            }
        }
        self.scanner.go_on(begin, 0)
    }

    fn read(&mut self, array: &Array, count: u64, kind: SampleType, taker: &mut Taker) -> Result<()> {
        let source = self.source;
        let (begin, stored, base64) = self.span(array)?;
        let failed = |error: std::io::Error| match error.kind() {
            ErrorKind::UnexpectedEof => {
                source.error(array.at(), format!("needs {count} numbers of type {}: ends early", kind.name()))
            }
            ErrorKind::InvalidData if error.get_ref().is_some_and(|inner| !inner.is::<Error>()) => {
                source.error(array.at(), error.to_string())
            }
            _ => stream_error(source, error),
        };
        self.seek(begin)?;
        if let Place::Words(Text { line, .. }) = array.place {
            let words = (&mut self.scanner).take(stored);
            let mut scanner = Scanner::of(source, words, stored).after_lines(line);
            taker(&mut scanner.numbers(kind), kind, Endian::Little).map_err(failed)?;
            return match scanner.word()?.map(text::shown) {
                None => Ok(()),
                Some(word) => {
                    let rule = format!("\"{word}\": more than the {count} numbers that are needed");
                    Err(scanner.error(rule))
                }
            };
        }
        let wanted = count.checked_mul(kind.bytes()).ok_or_else(|| {
            source.error(array.at(), format!("needs {count} numbers: more than memory can address"))
        })?;
        let decoded = base64.then(Cursor::default);
        let mut bytes =
            Bytes { source, at: array.at(), scanner: &mut self.scanner, stored, left: 0, decoded };
        let endian = self.storage.endian;
        let Some(compressor) = self.storage.compressor else {
            bytes.begin(self.storage, wanted)?;
            return taker(&mut bytes, kind, endian).map_err(failed);
        };
        let mut blocks = Blocks::open(bytes, self.storage, compressor, wanted, &mut self.budget)?;
        taker(&mut blocks, kind, endian).map_err(failed)?;
        let taken = blocks.taken;
        drop(blocks);
        self.budget.put_back(taken);
        Ok(())
    }
}
