//! VTK's XML files: image data (`.vti`), rectilinear grids (`.vtr`) and unstructured grids (`.vtu`), versions 0 to 2.
//!
//! Data may be text, base64 or appended, uncompressed or compressed with zlib, LZ4 or xz. Pieces are joined: those of grids
//! by their extents, those of unstructured grids one after another. The origin of an image is the position of index 0, also
//! if its extent begins elsewhere. A negative spacing reverses its axis. Field data is skipped.

pub(crate) mod attributes;
mod blocks;
mod bytes;
mod cells;
mod document;
mod fields;
mod grid;
mod parser;
mod store;

use crate::error::Result;
use crate::io::build::arrays::ArrayInfo;
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::formats::vtk_xml::document::{Document, Kind};
use crate::io::formats::vtk_xml::fields::Fields;
use crate::io::formats::vtk_xml::store::Store;
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;

/// A file whose structure has been read.
struct File<'a> {
    source: &'a Source,
    document: Document,
    store: Store<'a>,
    arrays: Vec<ArrayInfo>,
    budget: Budget<'a>,
    notes: Vec<String>,
}

pub(crate) struct VtkXml;

impl Reader for VtkXml {
    fn name(&self) -> &'static str {
        "VTK XML"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["vti", "vtu", "vtr"]
    }

    fn recognises(&self, source: &Source) -> bool {
        let head = source.head();
        let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
        head.starts_with(b"<") && head.windows(8).any(|window| window == b"<VTKFile")
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let mut budget = Budget::new(source, request);
        let document = Document::read(source, &mut budget)?;
        let Fields { arrays, notes, .. } = Fields::of(source, &document, request)?;
        let store = Store::new(source, document.storage, budget.clone());
        let mut file = File { source, document, store, arrays, budget, notes };
        let mut loaded = match file.document.kind {
            Kind::Image | Kind::Rectilinear => file.lattice(request),
            Kind::Unstructured => file.cells(request),
        }?;
        file.store.check_end(&file.document)?;
        loaded.report.notes.splice(0..0, file.notes);
        loaded.report.warnings.splice(0..0, file.document.warnings);
        Ok(loaded)
    }
}
