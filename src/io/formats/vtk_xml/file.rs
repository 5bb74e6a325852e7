//! A file while its arrays are read.

use crate::io::build::arrays::ArrayInfo;
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::formats::vtk_xml::document::Document;
use crate::io::formats::vtk_xml::store::Store;

/// A file whose structure has been read.
pub(crate) struct File<'a> {
    pub(crate) source: &'a Source,
    pub(crate) document: Document,
    pub(crate) store: Store<'a>,
    pub(crate) arrays: Vec<ArrayInfo>,
    pub(crate) budget: Budget<'a>,
    pub(crate) notes: Vec<String>,
}
